"""Errors of real sensors: :class:`NoiseModel` has their parameters, :class:`NoiseProcess` draws those of an episode.

Order of the chain: scale factor, misalignment and g-sensitivity; white noise; low-pass; bias; quantisation;
saturation; loss of samples. Everything that is independent of the signal is drawn from normal numbers in a fixed layout
of one row a sample: a motion in one piece or in several gives the same numbers, and two models of different
``noise_scale`` see the same realisation, scaled.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, fields, replace
from statistics import NormalDist
from typing import Literal, Self

import numpy as np

from ...filters.core import rotation

Form = Literal["additive", "angle", "rotation", "counted"]
"""Error model. ``additive``: the error is added to the reading. ``angle``: likewise, wrapped to [−π, π]. ``rotation``:
the reading is a unit quaternion and is rotated by the error, a rotation vector (rad) in axes of the child frame.
``counted``: additive, quantised with carry to the next sample, like an incremental encoder."""

FORMS: tuple[Form, ...] = ("additive", "angle", "rotation", "counted")
TIMES = ("bias_correlation_time", "warm_up_time", "burst_duration")
"""fields that must be positive and have nothing to do with the size of the errors"""


@dataclass(frozen=True)
class NoiseModel:
    """Parameters of the errors of a channel. ``u`` is the unit of the channel; standard deviations are per axis.

    The defaults are an ideal sensor. Terms follow IEEE Std 952 (gyroscopes) and IEEE Std 1293 (accelerometers).

    Raises:
        ValueError: a negative or not finite number, or a probability above 1.
    """

    white_noise: float = 0.0
    """u/√Hz: Allan deviation of the white part at 1 s; a sample at ``rate`` has standard deviation white_noise·√rate"""
    bias_random_walk: float = 0.0
    """u/√s: growth of a random-walk bias (rate random walk)"""
    bias_instability: float = 0.0
    """u: stationary standard deviation of a first-order Gauss-Markov bias; its Allan deviation peaks at 0.62 of it"""
    bias_correlation_time: float = 200.0
    """s: correlation time of the Gauss-Markov bias"""
    turn_on_bias: float = 0.0
    """u: standard deviation of the bias from episode to episode"""
    temperature_coefficient: float = 0.0
    """u/K: standard deviation of the change of the bias with the temperature of the device"""
    warm_up: float = 0.0
    """K: rise of that temperature from the first sample, exponentially with ``warm_up_time``"""
    warm_up_time: float = 300.0
    """s: time constant of warming; assumed for all devices"""
    scale_factor: float = 0.0
    """1: standard deviation of the relative scale error"""
    misalignment: float = 0.0
    """rad (1): standard deviation of each cross-axis sensitivity"""
    g_sensitivity: float = 0.0
    """u/(m/s²): standard deviation of each entry of the matrix by which specific force adds to the reading"""
    full_scale: float = math.inf
    """u: readings saturate at ± this"""
    resolution: float = 0.0
    """u: readings are rounded to multiples of this; 0 for none"""
    bandwidth: float = math.inf
    """Hz: -3 dB of a second-order Butterworth low-pass; without effect from half the sampling rate upwards"""
    dropout: float = 0.0
    """1: probability of an isolated lost sample"""
    burst_rate: float = 0.0
    """1/s: how often a burst of lost samples begins"""
    burst_duration: float = 0.2
    """s: mean duration of a burst (exponential)"""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            unbounded = field.name in ("full_scale", "bandwidth")
            positive = unbounded or field.name in TIMES
            low_enough = value <= 1.0 if field.name == "dropout" else (unbounded or value < math.inf)
            if not ((value > 0.0 if positive else value >= 0.0) and low_enough):
                wanted = "in [0, 1]" if field.name == "dropout" else "positive" if positive else "not negative"
                raise ValueError(f"{field.name} must be {wanted}{'' if unbounded else ' and finite'}, got {value}")

    def scaled(self, noise_scale: float) -> Self:
        """The same sensor with all its errors ``noise_scale`` times as large: 0 is ideal, 1 leaves it as it is.

        The full scale stays: it belongs to the observation space.

        Raises:
            ValueError: ``noise_scale`` is negative or not finite.
        """
        if not 0.0 <= noise_scale < math.inf:
            raise ValueError(f"noise_scale must lie in [0, inf), got {noise_scale}")
        kept = ("full_scale", "bandwidth", "dropout", "warm_up", *TIMES)
        larger = {
            field.name: noise_scale * getattr(self, field.name) for field in fields(self) if field.name not in kept
        }
        # a perfect sensor is infinitely fast
        bandwidth = self.bandwidth / noise_scale if noise_scale > 0.0 else math.inf
        return replace(self, bandwidth=bandwidth, dropout=min(1.0, noise_scale * self.dropout), **larger)

    def describe(self) -> dict[str, float | None]:
        """All fields for JSON; infinity becomes None."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: None if value == math.inf else float(value) for name, value in values.items()}


@dataclass
class NoiseState:
    """All memory of a :class:`NoiseProcess`; W is the number of its errors a sample."""

    generator: np.random.Generator
    turn_on: np.ndarray
    """(W,) u"""
    wander: np.ndarray
    """(W,) Gauss-Markov bias of the last sample, u"""
    walk: np.ndarray
    """(W,) random-walk bias of the last sample, u"""
    warming: np.ndarray
    """(W,) change of the bias when the device is warm, u"""
    age: int
    """samples so far"""
    matrix: np.ndarray
    """(W, W) scale factors and cross-axis sensitivities"""
    force_matrix: np.ndarray
    """(W, 3) g-sensitivity, u/(m/s²)"""
    bias: np.ndarray
    """(W,) bias of the last sample, u"""
    in_burst: bool
    noise_filter: np.ndarray
    """(2, W) low-pass on the noise"""
    signal_filter: np.ndarray | None
    """(2, W) low-pass on the signal; None before the first sample"""
    carry: np.ndarray
    """(W,) carry of the quantisation to the next sample, u"""


class NoiseProcess:
    """The errors of one channel during one episode.

    Args:
        model: their parameters.
        size: values a sample.
        rate: samples per second.
        generator: source of randomness, owned by the process from now on.
        form: the error model.
        units: size of one unit of ``model`` on each axis of the error, in units of the channel; empty for ones.

    Raises:
        ValueError: ``size`` or ``rate`` is not positive.
    """

    def __init__(
        self,
        model: NoiseModel,
        size: int,
        rate: float,
        generator: np.random.Generator,
        form: Form = "additive",
        units: tuple[float, ...] = (),
    ) -> None:
        if size < 1:
            raise ValueError(f"size must be at least 1, got {size}")
        if not 0.0 < rate < math.inf:
            raise ValueError(f"rate must be positive and finite (Hz), got {rate}")
        width = error_size(form, size)
        self.form, self.width, self.rate, self._limit = form, width, rate, model.full_scale
        self._units = np.array(units) if units else np.ones(width)
        # wrapped and unit readings cannot leave their range; counting comes after everything else
        self.model = model if form == "additive" else replace(model, full_scale=math.inf)
        self._count = model.resolution if form == "counted" else 0.0
        if self._count:
            self.model = replace(self.model, resolution=0.0)
        model, dt = self.model, 1.0 / rate
        self._white = model.white_noise * math.sqrt(rate)
        self._memory = math.exp(-dt / model.bias_correlation_time)
        self._wander = model.bias_instability * math.sqrt(1.0 - self._memory**2)
        self._walk = model.bias_random_walk * math.sqrt(dt)
        self._lost_above = upper_quantile(model.dropout)
        self._burst_above = upper_quantile(model.burst_rate * dt)
        self._recovery_above = upper_quantile(dt / model.burst_duration)
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
        # a child of its own, so that the other numbers do not depend on this term
        warming = generator.spawn(1)[0].standard_normal(width) if model.temperature_coefficient else np.zeros(width)
        turn_on *= model.turn_on_bias
        wander *= model.bias_instability
        self._state = NoiseState(
            generator=generator,
            turn_on=turn_on,
            wander=wander,
            walk=np.zeros(width),
            warming=model.temperature_coefficient * model.warm_up * warming,
            age=0,
            matrix=np.diag(1.0 + model.scale_factor * scale) + model.misalignment * crosstalk,
            force_matrix=force_matrix,
            bias=turn_on + wander,
            in_burst=False,
            noise_filter=np.zeros((2, width)),
            signal_filter=None,
            carry=np.zeros(width),
        )
        self._exact = model.scale_factor == 0.0 and model.misalignment == 0.0

    @property
    def bias(self) -> np.ndarray:
        """True bias (turn-on, wander, walk, warming) of the last sample, in units of the channel; before it, the first.

        ``(size,)``; a rotation vector ``(3,)`` (rad) for rotations.
        """
        return self._state.bias * self._units

    def save(self) -> NoiseState:
        """A copy of all memory, the generator's included."""
        return copy.deepcopy(self._state)

    def restore(self, state: NoiseState) -> None:
        """Continue from a saved state, exactly."""
        self._state = copy.deepcopy(state)

    def sequence(self, values: np.ndarray, specific_force: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Measure the next T samples.

        Args:
            values: ``(T, size)`` what an ideal sensor reads.
            specific_force: ``(T, 3)`` m/s² in sensor axes, for the g-sensitivity; not needed without one.

        Returns:
            The measurements ``(T, size)``, NaN where lost, and the true biases of each sample (see :attr:`bias`).
        """
        if len(values) == 0:
            return np.zeros(values.shape), np.zeros((0, self.width))
        errors, biases, lost = self._draw(len(values))
        biases = biases * self._units
        if self.form == "rotation":
            rotations = self._chain(np.zeros((len(values), 3)), specific_force, errors) * self._units
            measured = rotation.positive(rotation.multiply(values, rotation.exp(rotations)))
            measured[lost] = np.nan
            return measured, biases
        measured = self._chain(values / self._units, specific_force, errors) * self._units
        measured[lost] = np.nan
        if self.form == "angle":
            measured = rotation.wrap(measured)
        elif self.form == "counted":
            measured = np.clip(self._counted(measured) if self._count else measured, -self._limit, self._limit)
        return measured, biases

    def _draw(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """White noise plus bias ``(count, W)`` of the next samples, their biases ``(count, W)``, and which are lost."""
        state, width, model = self._state, self.width, self.model
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
        if model.temperature_coefficient > 0.0:
            ages = (state.age + np.arange(count)) / (self.rate * model.warm_up_time)
            biases = biases - np.expm1(-ages)[:, None] * state.warming
        state.age += count
        state.bias = biases[-1]
        lost = normal[:, -2] > self._lost_above
        if model.burst_rate > 0.0:
            burst, state.in_burst = burst_chain(normal[:, -1], self._burst_above, self._recovery_above, state.in_burst)
            lost |= burst
        return white + biases, biases, lost

    def _recurrence(self, start: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """First-order recurrence b ← m b + push over the rows of ``pushes`` ``(N, W)``."""
        if self.model.bias_instability == 0.0:
            return np.zeros_like(pushes)
        memory, columns = self._memory, pushes.T.tolist()
        for column, bias in zip(columns, start.tolist(), strict=True):
            column[:] = [bias := memory * bias + push for push in column]
        return np.array(columns).T

    def _chain(self, values: np.ndarray, specific_force: np.ndarray | None, errors: np.ndarray) -> np.ndarray:
        """The part of the chain that depends on the signal: ``(T, W)``."""
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
        state = self._state
        if state.signal_filter is None:
            state.signal_filter = self._settled * values[0]
        filtered, state.signal_filter = self._lfilter(*self._coefficients, values, axis=0, zi=state.signal_filter)
        return filtered

    def _counted(self, rows: np.ndarray) -> np.ndarray:
        """Whole counts; a lost sample takes its counts with it and leaves the carry as it is."""
        # in plain floats, ten times as fast as in arrays of one value
        columns, carries = rows.T.tolist(), self._state.carry.tolist()
        for axis, column in enumerate(columns):
            for number, value in enumerate(column):
                if value == value:
                    whole = value + carries[axis]
                    column[number] = round(whole / self._count) * self._count
                    carries[axis] = whole - column[number]
        self._state.carry = np.array(carries)
        return np.array(columns).T


def error_size(form: Form, size: int) -> int:
    """Values of the error of a reading with ``size`` values: three for a quaternion."""
    return 3 if form == "rotation" else size


def upper_quantile(probability: float) -> float:
    """What a standard normal number exceeds with ``probability``; ± infinity at and beyond 0 and 1."""
    if probability <= 0.0:
        return math.inf
    return -math.inf if probability >= 1.0 else -NormalDist().inv_cdf(probability)


def burst_chain(normal: np.ndarray, begin_above: float, recover_above: float, inside: bool) -> tuple[np.ndarray, bool]:
    """Samples inside bursts: a two-state Markov chain driven by normal numbers.

    Args:
        normal: ``(N,)``.
        begin_above: what such a number must exceed for a burst to begin.
        recover_above: and for one to end.
        inside: whether the sample before was in a burst.

    Returns:
        Which samples ``(N,)`` are in a burst, and whether the last one is.
    """
    lost = []
    for number in normal.tolist():
        inside = number <= recover_above if inside else number > begin_above
        lost.append(inside)
    return np.array(lost, bool), inside
