"""Head of a network that sets the gains of a filter, and its loss: the errors of the filter that runs with them.

Outputs t become bounded log factors on the gains, the same over each interval of the network,

    factor = limit · tanh(t / limit),   gain ← gain · exp(power · factor)

and zero is the published tuning. They are trained through the filter: of each sequence the loss is

    ln(RMS + e₀) + w · mean ½ [ln s² + (ν + 1) ln(1 + e² / (ν s²))]

with e the error of an output and s² its variance in the filter's covariance. The first part weighs quiet and vigorous
sequences alike, as gradients of the mean error would not. The second, the likelihood of the errors under Student's t
distribution with ν = 8, keeps the covariance honest; a published tuning that errs by a hundred deviations does not
outweigh everything else, as it would under the normal distribution. In a gap of an input and after it the filter has
the published tuning, in training as in use (:mod:`.gain_filter`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.core.backend import Array, namespace
from ....filters.core.estimator import check_measurements
from ....filters.core.kalman import KalmanFilter
from ....filters.core.model import Equations, parameters_of, with_parameters
from ....filters.core.quantity import UP, Measurement, Quantity
from ....filters.core.rotation import wrap
from ....filters.core.sampling import GapWatch, join, split
from ..inputs.gain_features import GainFeatures

if TYPE_CHECKING:
    from ..data import SequenceData

LONGEST_GAP = 0.09
"""s without an input. Where half of all samples of 100 Hz are lost, one by one, most of them are left to the network: a
shorter one would come up every second."""
FREEDOM = 8.0
"""ν, degrees of freedom of the distribution of errors"""
CONSTANT_STEPS = 60
"""of gradient descent to the best constants, from which a network starts"""
LARGEST_ERROR = math.radians(30.0)
"""rad: larger errors of a sample count as that, so that a filter that was lost for a second does not decide"""


@dataclass(frozen=True)
class GainHead:
    """What the outputs of a network mean to a filter.

    Attributes:
        kalman: the filter; sequences bring their own constants (sampling interval, rider).
        gains: names of the gains that the network sets, in the order of its outputs.
        limits: largest log factor of each gain, on a variance for a gain of power ½.
        likelihood: w, weight of the likelihood.
        small_error: e₀, rad; errors below it count little.

    Raises:
        ValueError: a gain is unknown, limits are not one positive number a gain, or nothing that is estimated can be
            scored.
    """

    kalman: KalmanFilter
    gains: tuple[str, ...]
    limits: tuple[float, ...]
    likelihood: float = 0.01
    small_error: float = math.radians(0.5)

    kind: ClassVar[str] = "gains"

    def __post_init__(self) -> None:
        if not self.outputs:
            raise ValueError(f"{type(self.kalman.model).__name__} tells neither an inclination nor an angle")
        unknown = sorted(set(self.gains) - set(self.kalman.gains))
        if unknown or not self.gains:
            raise ValueError(f"gains must be among {sorted(self.kalman.gains)}, got {list(self.gains)}")
        if len(self.limits) != len(self.gains) or not all(0.0 < limit < math.inf for limit in self.limits):
            raise ValueError(f"limits must be {len(self.gains)} positive numbers, one a gain, got {self.limits}")

    @cached_property
    def outputs(self) -> tuple[Quantity, ...]:
        """What is scored: the inclination, or all angles."""
        known = self.kalman.outputs
        return tuple(q for q in known if q.name == UP.name) or tuple(q for q in known if q.kind == "angle")

    @property
    def size(self) -> int:
        """Numbers that the network gives: one a gain."""
        return len(self.gains)

    def describe(self) -> dict[str, Any]:
        """Kind and settings for a card; JSON-able."""
        limits = [round(limit, 6) for limit in self.limits]
        weights = {"likelihood": self.likelihood, "small_error": self.small_error}
        return {"kind": self.kind, "gains": list(self.gains), "limits": limits, **weights}

    @classmethod
    def read(cls, described: Mapping[str, Any], kalman: KalmanFilter) -> Self:
        """The inverse of :meth:`describe`."""
        weights = {name: float(described[name]) for name in ("likelihood", "small_error") if name in described}
        return cls(kalman, tuple(described["gains"]), tuple(described["limits"]), **weights)

    def factors(self, output: Array) -> Array:
        """Log factors ``(..., gains)`` of outputs; zeros for zeros."""
        parts, xp = [], namespace(output)
        for index, limit in enumerate(self.limits):
            parts.append(limit * xp.tanh(output[..., index] / limit))
        return xp.stack(parts, axis=-1)

    # ---- training ----------------------------------------------------------------------------------------------------

    def sequence(self, trajectory: Trajectory, front_end: GainFeatures) -> tuple[np.ndarray, ...]:
        """Data of a trajectory for :class:`..data.SequenceData`.

        Features ``(N, F)``; the filter's constants, then samples and truth of the interval ``(N, K)``; no spread
        ``(N, 0)``; mask ``(N,)``. Samples that were lost, and truth that is not scored, are NaN.

        Raises:
            ValueError: a channel or the truth is missing, or the trajectory is too short or too slow.
        """
        front_end = front_end.with_dt(trajectory.dt).configured(trajectory.metadata)
        model = front_end.kalman.model
        arrays = check_measurements(front_end.channels, trajectory.measurements, time_axis=True)
        whole = front_end.features.interval_samples(trajectory.dt)
        count = len(trajectory) // whole
        if count < 2:
            raise ValueError(f"{trajectory.name} is too short: {len(trajectory)} samples")
        seen = front_end.run(arrays)
        truths = {**trajectory.truth, **model.truth(trajectory.truth)}
        known = trajectory.replace(truth=truths)
        truth = np.concatenate([np.asarray(known.truth_of(q.name)) for q in self.outputs], axis=-1)
        truth = np.where(trajectory.mask[:, None], truth, np.nan)
        samples = np.concatenate([join(arrays, front_end.channels), truth], axis=-1)
        slots = np.full((count, most_samples(front_end.interval), samples.shape[-1]), np.nan)
        slots[:, :whole] = samples[: count * whole].reshape(count, whole, -1)
        numbers = [float(whole), *parameters_of(model).values()]
        constants = np.broadcast_to(numbers, (count, len(numbers)))
        target = np.concatenate([constants, slots.reshape(count, -1)], axis=-1)
        features = seen.features[seen.due == 1.0]
        mask = np.isfinite(truth[: count * whole]).all(axis=-1).reshape(count, whole).any(axis=1)
        return features, target, features[:, :0], mask

    def loss(self, output: Any, target: Any, spread: Any, mask: Any) -> Any:
        """A torch number to be minimised: outputs ``(B, N, gains)``, targets of :meth:`sequence` ``(B, N, K)``."""
        import torch

        total = output.new_zeros((), dtype=torch.float64)
        scored = 0
        for raw_output, given, counted in zip(output, target, mask, strict=True):
            if not counted.any():
                continue
            error, variance = self._through(raw_output, given)
            counts = torch.isfinite(error).any(dim=-1)
            square = torch.where(torch.isfinite(error), error * error, 0.0)[counts]
            s2 = variance[counts] + 1e-9
            rms = torch.sqrt(square.clamp(max=LARGEST_ERROR**2).mean(dim=0) + 1e-12)
            heavy = (FREEDOM + 1.0) * torch.log1p(square / (FREEDOM * s2))
            likelihood = 0.5 * (torch.log(s2) + heavy).mean(dim=0)
            total = total + (torch.log(rms + self.small_error) + self.likelihood * likelihood).mean()
            scored += 1
        return total / max(scored, 1)

    def begin(self, module: Any, data: SequenceData, seed: int) -> np.ndarray:
        """Let a network that is still zero say the best constants, found by gradient descent on some sequences.

        Args:
            module: with a last layer ``output`` and the ``scale`` of what it says; changed in place.
            data: training data.
            seed: of the choice of sequences.

        Returns:
            Their log factors ``(gains,)``.
        """
        import torch

        constant = torch.zeros(self.size, dtype=torch.float64, requires_grad=True)
        optimizer = torch.optim.Adam([constant], lr=0.5)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, CONSTANT_STEPS)
        generator = np.random.default_rng(seed)
        length = data.features.shape[1]
        for _ in range(CONSTANT_STEPS):
            chosen = generator.choice(len(data), min(4, len(data)), replace=False)
            target, mask = torch.from_numpy(data.target[chosen]), torch.from_numpy(data.mask[chosen])
            optimizer.zero_grad()
            self.loss(constant.expand(len(chosen), length, -1), target, None, mask).backward()
            optimizer.step()
            schedule.step()
        with torch.no_grad():
            module.output.bias.copy_(constant / module.scale)
        return np.asarray(self.factors(constant.detach().numpy()))

    def errors(self, output: Any, target: Any, spread: Any) -> Any:
        """Error ``(B, N, parts)`` in rad: the root mean square of each interval; 0 where nothing is known."""
        import torch

        found = []
        for raw_output, given in zip(output, target, strict=True):
            error, _ = self._through(raw_output, given)
            known = torch.isfinite(error)
            square = torch.where(known, error * error, 0.0).reshape(len(raw_output), -1, error.shape[-1])
            there = known.reshape(square.shape).sum(dim=1).clamp(min=1)
            found.append(torch.sqrt(square.sum(dim=1) / there))
        return torch.stack(found)

    def augmented(
        self, features: np.ndarray, target: np.ndarray, generator: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """As they are: features do not depend on heading or mounting, and rides are mirrored as a whole."""
        return features, target

    @cached_property
    def _filter(self) -> Any:
        from ..differentiable_filter import DifferentiableFilter

        return DifferentiableFilter(self.kalman, self.gains)

    def _through(self, raw_output: Any, target: Any) -> tuple[Any, Any]:
        """The filter over one sequence: errors and variances ``(T, parts)`` of its outputs, torch.

        The output at the end of an interval holds over the next one.
        """
        import torch

        constants = parameters_of(self.kalman.model)
        numbers = target.detach().double().numpy()
        whole, own = int(numbers[0, 0]), dict(zip(constants, numbers[0, 1 : 1 + len(constants)].tolist(), strict=True))
        width = sum(channel.size for channel in self.kalman.channels)
        slots = numbers[:, 1 + len(constants) :].reshape(len(numbers), -1, width + sum(q.size for q in self.outputs))
        samples = slots[:, :whole].reshape(len(numbers) * whole, -1)
        arrays = split(samples[:, None, :width], self.kalman.channels)
        truth = torch.from_numpy(samples[:, width:])
        held = torch.cat([torch.zeros_like(raw_output[:1]), raw_output[:-1]]).double()
        model = with_parameters(self.kalman.model, own)
        factors = self.factors(held)
        # what the filter would not take is lowered, without a derivative of its own
        named = {name: factors[:, index].detach().numpy() for index, name in enumerate(self.gains)}
        taken = np.stack([np.asarray(values) for values in model.limited(named).values()], axis=-1)
        factors = factors + (torch.from_numpy(taken) - factors.detach())
        bears = torch.from_numpy(recovering(model, arrays))
        factors = torch.where(bears[..., None], 0.0, factors.repeat_interleave(whole, dim=0)[:, None])
        through = self._filter.with_model(model)
        _, found = through.run(through.init({name: array[0] for name, array in arrays.items()}), arrays, factors)
        return self._scored(found, truth)

    def _scored(self, found: Any, truth: Any) -> tuple[Any, Any]:
        """Errors and variances ``(T, parts)``."""
        import torch

        P = found.covariance[:, 0]
        if self.outputs[0].name == UP.name:
            up = found.pose[UP.name][:, 0]
            return tilt_error(up, truth)[:, None], tilt_variance(self.kalman, P, up)[:, None]
        angles = torch.cat([found.pose[q.name][:, 0] for q in self.outputs], dim=-1)
        parts = [slice(*self.kalman.model.error_parts[q.name]) for q in self.outputs]
        variances = torch.diagonal(P, dim1=-2, dim2=-1)
        return wrap(angles - truth), torch.cat([variances[:, part] for part in parts], dim=-1)


def recovering(model: Equations, measurements: Measurement) -> np.ndarray:
    """Samples ``(T, *batch)`` at which an estimate bears a gap of the model's inputs before them, NumPy."""
    gaps = GapWatch(model, LONGEST_GAP)
    since = gaps.run(measurements)
    return gaps.bears(np.concatenate([gaps.start((1, *since.shape[1:])), since[:-1]]))


def tilt_error(up: Any, truth: Any) -> Any:
    """Angle ``(T,)`` between inclination vectors ``(T, 3)``, torch; with a derivative at zero."""
    import torch

    chord = ((up - truth) ** 2).sum(dim=-1)
    return 2.0 * torch.asin((0.5 * torch.sqrt(chord + 1e-14)).clamp(max=1.0))


def tilt_variance(kalman: KalmanFilter, P: Array, up: Array) -> Array:
    """Variance ``(...)`` of the angle between estimated and true vertical, rad²: both directions together."""
    parts = kalman.model.error_parts
    for name in ("orientation", "relative_orientation"):
        if name in parts:  # the error is a rotation in world axes
            start = parts[name][0]
            return P[..., start, start] + P[..., start + 1, start + 1]
    start, stop = parts[UP.name]
    block, xp = P[..., start:stop, start:stop], namespace(P)
    along = xp.sum(up * (block @ up[..., None])[..., 0], axis=-1)
    return block[..., 0, 0] + block[..., 1, 1] + block[..., 2, 2] - along


def most_samples(interval: float) -> int:
    """Samples that an interval of training data has room for: those of sensors of up to 300 Hz."""
    return round(300.0 * interval) + 1
