"""Errors of a real sensor, drawn for one episode: :class:`NoiseProcess`, for a channel of any width.

Order of the chain: scale factor, misalignment and g-sensitivity; white noise; low-pass; bias; quantisation;
saturation; loss of samples. Everything that is independent of the signal is drawn ahead in blocks, from normal numbers
in a fixed layout of one row a sample: samples one by one and whole sequences give the same numbers, and two models of
different grade see the same realisation, scaled.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from itertools import accumulate
from statistics import NormalDist

import numpy as np

from .noise_model import NoiseModel

BLOCK = 256
"""Samples drawn ahead when samples are taken one by one."""


@dataclass
class NoiseState:
    """All memory of a :class:`NoiseProcess`; W is the width of the channel, N the samples drawn ahead."""

    generator: np.random.Generator
    turn_on: np.ndarray
    """(W,) u"""
    wander: np.ndarray
    """(W,) Gauss-Markov bias of the last row drawn, u"""
    walk: np.ndarray
    """(W,) random-walk bias of the last row drawn, u"""
    matrix: np.ndarray
    """(W, W) scale factors and cross-axis sensitivities"""
    force_matrix: np.ndarray
    """(W, 3) g-sensitivity, u/(m/s²)"""
    bias: np.ndarray
    """(W,) bias of the last sample taken, u"""
    in_burst: bool
    noise_filter: np.ndarray
    """(2, W) low-pass on the noise"""
    signal_filter: np.ndarray | None
    """(2, W) low-pass on the signal; None before the first sample"""
    errors: np.ndarray
    """(N, W) white noise and bias, u"""
    biases: np.ndarray
    """(N, W) u"""
    lost: np.ndarray
    """(N,) bool"""
    used: int
    """rows already taken"""
    carry: np.ndarray | None = None
    """(W,) what counting left for the next sample, u; None where nothing is counted"""


class NoiseProcess:
    """The errors of one channel during one episode.

    Args:
        model: how large they are.
        width: values a sample, W.
        rate: samples a second.
        generator: what to draw from; the process owns it from now on.

    Raises:
        ValueError: ``width`` or ``rate`` is not positive.
    """

    def __init__(self, model: NoiseModel, width: int, rate: float, generator: np.random.Generator) -> None:
        if width < 1:
            raise ValueError(f"width must be at least 1, got {width}")
        if not 0.0 < rate < math.inf:
            raise ValueError(f"rate must be positive and finite (Hz), got {rate}")
        self.model, self.width, self.rate = model, width, rate
        dt = 1.0 / rate
        self._white = model.white_noise * math.sqrt(rate)
        self._memory = math.exp(-dt / model.bias_correlation_time)
        self._wander = model.bias_instability * math.sqrt(1.0 - self._memory**2)
        self._walk = model.bias_random_walk * math.sqrt(dt)
        self._lost_above = exceeded_with(model.dropout)
        self._burst_above = exceeded_with(model.burst_rate * dt)
        self._recovery_above = exceeded_with(dt / model.burst_duration)
        self._filtered = model.bandwidth < 0.5 * rate
        if self._filtered:
            # on demand: this import takes longer than all others together
            from scipy import signal

            self._lfilter = signal.lfilter
            self._coefficients = signal.butter(2, model.bandwidth, fs=rate)
            self._settled = signal.lfilter_zi(*self._coefficients)[:, None]
        turn_on, wander, scale = generator.standard_normal((3, width))
        crosstalk = generator.standard_normal((width, width))
        force_matrix = model.g_sensitivity * generator.standard_normal((width, 3))
        np.fill_diagonal(crosstalk, 0.0)
        turn_on *= model.turn_on_bias
        wander *= model.bias_instability
        empty = np.zeros((0, width))
        self._state = NoiseState(
            generator=generator,
            turn_on=turn_on,
            wander=wander,
            walk=np.zeros(width),
            matrix=np.diag(1.0 + model.scale_factor * scale) + model.misalignment * crosstalk,
            force_matrix=force_matrix,
            bias=turn_on + wander,
            in_burst=False,
            noise_filter=np.zeros((2, width)),
            signal_filter=None,
            errors=empty,
            biases=empty,
            lost=np.zeros(0, dtype=bool),
            used=0,
        )
        self._exact = model.scale_factor == 0.0 and model.misalignment == 0.0

    @property
    def bias(self) -> np.ndarray:
        """True bias (turn-on, wander and walk) of the last sample ``(W,)``, u; before it, that of the start."""
        return self._state.bias

    def save(self) -> NoiseState:
        """A copy of all memory, the generator's included."""
        return copy.deepcopy(self._state)

    def restore(self, state: NoiseState) -> None:
        """Go on from a saved state, exactly."""
        self._state = copy.deepcopy(state)

    def step(self, value: np.ndarray, specific_force: np.ndarray | None = None) -> np.ndarray:
        """Measure once.

        Args:
            value: ``(W,)`` what an ideal sensor reads.
            specific_force: ``(3,)`` m/s² in sensor axes, for the g-sensitivity; not needed without one.

        Returns:
            The measurement ``(W,)``; NaN if the sample is lost.
        """
        state = self._state
        if state.used == len(state.lost):
            self._draw(BLOCK)
        row = state.used
        state.used += 1
        state.bias = state.biases[row]
        if state.lost[row] and not self._filtered:
            return np.full(self.width, np.nan)
        measured = self._chain(value, specific_force, state.errors[row])
        return np.full(self.width, np.nan) if state.lost[row] else measured

    def sequence(self, values: np.ndarray, specific_force: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Measure T times: the same numbers as T steps.

        Args:
            values: ``(T, W)`` what an ideal sensor reads.
            specific_force: ``(T, 3)`` m/s² in sensor axes, for the g-sensitivity; not needed without one.

        Returns:
            The measurements ``(T, W)``, NaN where lost, and the true biases ``(T, W)``.
        """
        state, length = self._state, len(values)
        if length == 0:
            return np.zeros((0, self.width)), np.zeros((0, self.width))
        ahead = len(state.lost) - state.used
        if ahead < length:
            self._draw(length - ahead)
        rows = slice(state.used, state.used + length)
        state.used += length
        biases, lost = state.biases[rows], state.lost[rows]
        state.bias = biases[-1]
        measured = self._chain(values, specific_force, state.errors[rows])
        measured[lost] = np.nan
        return measured, biases

    def _draw(self, count: int) -> None:
        """Append ``count`` rows to what is drawn ahead and forget the rows already used."""
        state, width = self._state, self.width
        normal = state.generator.standard_normal((count, 3 * width + 2))
        white = self._white * normal[:, :width]
        if self._filtered:
            white, state.noise_filter = self._lfilter(*self._coefficients, white, axis=0, zi=state.noise_filter)
        wander = self._recurrence(state.wander, self._wander * normal[:, width : 2 * width])
        state.wander = wander[-1]
        steps = self._walk * normal[:, 2 * width : 3 * width]
        walk = np.cumsum(np.concatenate([state.walk[None], steps]), axis=0)[1:]
        state.walk = walk[-1]
        biases = state.turn_on + wander + walk
        lost = normal[:, -2] > self._lost_above
        if self.model.burst_rate > 0.0:
            lost |= self._bursts(normal[:, -1])
        kept = slice(state.used, None)
        state.errors = np.concatenate([state.errors[kept], white + biases])
        state.biases = np.concatenate([state.biases[kept], biases])
        state.lost = np.concatenate([state.lost[kept], lost])
        state.used = 0

    def _recurrence(self, start: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """First-order recurrence b ← m b + push over the rows of ``pushes`` ``(N, W)``."""
        if self.model.bias_instability == 0.0:
            return np.zeros_like(pushes)
        memory = self._memory
        columns = [
            list(accumulate(column, lambda bias, push: memory * bias + push, initial=first))[1:]
            for first, column in zip(start.tolist(), pushes.T.tolist(), strict=True)
        ]
        return np.array(columns).T

    def _bursts(self, normal: np.ndarray) -> np.ndarray:
        """Samples ``(N,)`` inside bursts: a two-state Markov chain driven by ``normal`` ``(N,)``."""
        inside, lost = self._state.in_burst, []
        for number in normal.tolist():
            inside = number <= self._recovery_above if inside else number > self._burst_above
            lost.append(inside)
        self._state.in_burst = inside
        return np.array(lost)

    def _chain(self, values: np.ndarray, specific_force: np.ndarray | None, errors: np.ndarray) -> np.ndarray:
        """The part that depends on the signal, over leading dimensions: ``(..., W)``."""
        model = self.model
        # sums instead of matrix products: their rounding does not depend on the number of rows
        if not self._exact:
            values = np.sum(self._state.matrix * values[..., None, :], axis=-1)
        if model.g_sensitivity > 0.0:
            if specific_force is None:
                raise ValueError("specific_force is needed by a model with g_sensitivity > 0, got None")
            values = values + np.sum(self._state.force_matrix * specific_force[..., None, :], axis=-1)
        if self._filtered:
            values = self._low_pass(values)
        measured = values + errors
        if model.resolution > 0.0:
            measured = np.rint(measured / model.resolution) * model.resolution
        if model.full_scale < math.inf:
            measured = np.minimum(np.maximum(measured, -model.full_scale), model.full_scale)
        return measured

    def _low_pass(self, values: np.ndarray) -> np.ndarray:
        """Second-order Butterworth; it starts settled on the first value."""
        state, rows = self._state, np.atleast_2d(values)
        if state.signal_filter is None:
            state.signal_filter = self._settled * rows[0]
        filtered, state.signal_filter = self._lfilter(*self._coefficients, rows, axis=0, zi=state.signal_filter)
        return filtered.reshape(values.shape)


def exceeded_with(probability: float) -> float:
    """What a standard normal number exceeds with ``probability``; ± infinity at and beyond 0 and 1."""
    if probability <= 0.0:
        return math.inf
    return -math.inf if probability >= 1.0 else -NormalDist().inv_cdf(probability)
