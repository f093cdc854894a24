"""From a network's output to a pose: what is corrected, by how much at most, and how uncertain the result is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.core import rotation
from ...filters.core.backend import Array, constant, namespace
from ...filters.core.metrics import direction_error, rms, scored
from ...filters.core.quantity import UP, Estimate, Quantity
from .inputs.front_end import Seen
from .inputs.gravity_aligned_frame import VECTORS


class Head(Protocol):
    """Interface of heads. A network's last output, of ``size`` numbers, becomes an estimate at every sample."""

    @property
    def kind(self) -> str:
        """Name under which cards know it."""
        ...

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """Estimated quantities."""
        ...

    @property
    def size(self) -> int:
        """Numbers that the network gives."""
        ...

    def estimate(self, seen: Seen, output: Array) -> Estimate:
        """The estimate ``(..., )`` of samples with the last output ``(..., size)`` of the network."""
        ...

    def target(self, seen: Seen, trajectory: Trajectory) -> np.ndarray:
        """What the output should say, ``(T, K)``; NaN where the truth is unknown."""
        ...

    def loss(self, output: Any, target: Any, spread: Any, mask: Any) -> Any:
        """A torch number to be minimised: outputs ``(B, N, size)``, targets ``(B, N, K)``, mask ``(B, N)``."""
        ...

    def errors(self, output: Array, target: Array, spread: Array) -> Array:
        """Error ``(..., parts)`` in rad of each part of the target, as a table would show it."""
        ...

    def augmented(
        self, features: np.ndarray, target: np.ndarray, generator: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """The same sequences ``(B, N, …)`` seen otherwise, with the same right to be seen."""
        ...

    def describe(self) -> dict[str, Any]:
        """Kind and settings for a card; JSON-able."""
        ...


class InclinationHead:
    """What heads of the inclination share; subclasses say the up vector in the level frame."""

    outputs: ClassVar[tuple[Quantity, ...]] = (UP,)

    def up(self, output: Array, spread: Array) -> Array:
        """The up vector ``(..., 3)``, of any length, in the level frame.

        Args:
            output: ``(..., size)`` of the network.
            spread: of the front end (:class:`.front_end.Seen`).
        """
        raise NotImplementedError

    def estimate(self, seen: Seen, output: Array) -> Estimate:
        """See :class:`Head`."""
        orientation = seen.base["relative_orientation"]
        return Estimate({"up": rotation.rotate_back(orientation, rotation.normalize(self.up(output, seen.spread)))})

    def target(self, seen: Seen, trajectory: Trajectory) -> np.ndarray:
        """See :class:`Head`: the true up vector in the level frame."""
        return np.asarray(rotation.rotate(seen.base["relative_orientation"], trajectory.truth_of("up")))

    def errors(self, output: Array, target: Array, spread: Array) -> Array:
        """See :class:`Head`."""
        return direction_error(self.up(output, spread), target)[..., None]


@dataclass(frozen=True)
class TiltHead(InclinationHead):
    """The inclination: a tilt ``(2,)`` of the level frame, horizontal part of the up vector in it.

    Attributes:
        limit: longest tilt in standard deviations of the front end's filter; None: not limited. A filter that is
            certain cannot be overruled.
        floor: rad that may always be corrected.
    """

    limit: float | None = None
    floor: float = 0.002

    kind: ClassVar[str] = "tilt"
    size: ClassVar[int] = 2

    def describe(self) -> dict[str, Any]:
        """See :class:`Head`."""
        return {"kind": self.kind, "limit": self.limit, "floor": self.floor}

    @classmethod
    def read(cls, described: Mapping[str, Any]) -> Self:
        """The inverse of :meth:`describe`."""
        return cls(described.get("limit"), float(described.get("floor", 0.002)))

    def up(self, output: Array, spread: Array) -> Array:
        """The up vector ``(..., 3)``, of any length, in the level frame."""
        xp = namespace(output)
        tilt = output
        if self.limit is not None:
            longest = self.limit * spread + self.floor
            length = xp.sqrt(xp.sum(tilt * tilt, axis=-1, keepdims=True) + 1e-18)
            # a smooth bound: slope 1 at zero
            tilt = tilt * longest * xp.tanh(length / longest) / length
        return xp.concat([tilt, xp.ones_like(tilt[..., :1])], axis=-1)

    def loss(self, output: Any, target: Any, spread: Any, mask: Any) -> Any:
        """Mean over sequences of the root mean square inclination error in time, rad.

        Tables of trials show this error. Its gradient weights sequences with small and large errors equally, in
        contrast to the mean square over all samples. Zero, with gradient zero, where nothing is scored.
        """
        return mean_of_sequences(direction_error(self.up(output, spread), target), mask)

    def augmented(
        self, features: np.ndarray, target: np.ndarray, generator: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Every sequence in a level frame of another heading, which is arbitrary."""
        return turned(features, target, generator.uniform(-np.pi, np.pi, len(features)))


@dataclass(frozen=True)
class AngleHead:
    """Corrections of angles (or vectors) that the front end gives, added to them; of zero, where it gives none.

    Attributes:
        outputs: what is corrected, in this order.
        scale: rad; each output of the network is in this unit, one for each corrected number.
        limit: largest correction in standard deviations of the front end, if it knows any; None: not limited.
        deviations: standard deviations in rad of what remains, found on held-out data; empty: no covariance.
        growth: what the variances grow by where inputs are unlike those of the training (:mod:`.calibration`),
            ``deviations² (1 + growth uᵖ)``; the network says u after its corrections. Empty: they are constant.
        power: p, 1 or 2.
    """

    outputs: tuple[Quantity, ...]
    scale: tuple[float, ...]
    limit: float | None = None
    deviations: tuple[float, ...] = ()
    growth: tuple[float, ...] = ()
    power: int = 1

    kind: ClassVar[str] = "angles"

    def __post_init__(self) -> None:
        if len(self.scale) != self.corrected or not all(scale > 0.0 for scale in self.scale):
            raise ValueError(f"scale must be {self.corrected} positive numbers, got {self.scale}")
        for name in ("deviations", "growth"):
            if getattr(self, name) and len(getattr(self, name)) != self.corrected:
                raise ValueError(f"{name} must be {self.corrected} numbers or none, got {getattr(self, name)}")
        if self.growth and not (self.deviations and all(0.0 <= each < math.inf for each in self.growth)):
            raise ValueError(f"growth must be of deviations that are given, and 0 or more, got {self.growth}")
        if self.power not in (1, 2):
            raise ValueError(f"power must be 1 or 2, got {self.power}")

    @property
    def corrected(self) -> int:
        """How many numbers are corrected, K."""
        return sum(quantity.size for quantity in self.outputs)

    @property
    def size(self) -> int:
        """One for each number that is corrected, and one if the covariance grows."""
        return self.corrected + bool(self.growth)

    @property
    def error_parts(self) -> dict[str, tuple[int, int]]:
        """Quantity → its part of the covariance; empty where there is none."""
        parts, start = {}, 0
        for quantity in self.outputs if self.deviations else ():
            parts[quantity.name] = (start, start + quantity.size)
            start += quantity.size
        return parts

    def describe(self) -> dict[str, Any]:
        """See :class:`Head`."""
        outputs = [[q.name, q.kind, q.size, q.unit] for q in self.outputs]
        numbers = {"scale": list(self.scale), "deviations": list(self.deviations), "growth": list(self.growth)}
        return {"kind": self.kind, "outputs": outputs, "limit": self.limit, **numbers, "power": self.power}

    @classmethod
    def read(cls, described: Mapping[str, Any]) -> Self:
        """The inverse of :meth:`describe`."""
        outputs = tuple(Quantity(*given) for given in described["outputs"])
        deviations, growth = (tuple(described.get(name, ())) for name in ("deviations", "growth"))
        power = described.get("power", 1)  # older cards have none
        return cls(outputs, tuple(described["scale"]), described.get("limit"), deviations, growth, power)

    def estimate(self, seen: Seen, output: Array) -> Estimate:
        """See :class:`Head`."""
        correction, xp = self.correction(output, seen.spread), namespace(output)
        if seen.alone is not None:
            correction = xp.where(seen.alone[..., None], 0.0 * correction, correction)
        pose, start = {}, 0
        for quantity in self.outputs:
            part = correction[..., start : start + quantity.size]
            value = seen.base.get(quantity.name, 0.0) + part
            pose[quantity.name] = rotation.wrap(value) if quantity.kind == "angle" else value
            start += quantity.size
        if not self.deviations:
            return Estimate(pose)
        size = self.corrected
        growth = constant(np.array(self.growth or (0.0,) * size), output)
        variances = constant(np.square(self.deviations), output) * (1.0 + growth * output[..., -1:] ** self.power)
        if seen.alone is not None:
            known = [seen.variances.get(name, variances[..., slice(*part)]) for name, part in self.error_parts.items()]
            variances = xp.where(seen.alone[..., None], xp.concat(known, axis=-1), variances)
        return Estimate(pose, variances[..., None] * constant(np.eye(size), output))

    def correction(self, output: Array, spread: Array) -> Array:
        """What is added ``(..., size)``, rad."""
        xp = namespace(output)
        correction = output[..., : self.corrected] * constant(np.array(self.scale), output)
        if self.limit is not None:
            longest = self.limit * spread + 1e-6
            correction = longest * xp.tanh(correction / longest)
        return correction

    def target(self, seen: Seen, trajectory: Trajectory) -> np.ndarray:
        """See :class:`Head`: truth minus the front end's estimate; NaN where one of them is unknown."""
        parts = []
        for quantity in self.outputs:
            truth = trajectory.truth_of(quantity.name)
            difference = np.asarray(truth - seen.base.get(quantity.name, 0.0))
            parts.append(rotation.wrap(difference) if quantity.kind == "angle" else difference)
        return np.concatenate(parts, axis=-1)

    def loss(self, output: Any, target: Any, spread: Any, mask: Any) -> Any:
        """Mean over sequences and angles of the root mean square error in time, rad: what tables of rides show.

        Its gradient weights angles that a filter knows to 0.3° as much as those that it knows to 5°.
        """
        return mean_of_sequences(self._difference(output, target, spread), mask)

    def errors(self, output: Array, target: Array, spread: Array) -> Array:
        """See :class:`Head`."""
        return namespace(output).abs(self._difference(output, target, spread))

    def _difference(self, output: Array, target: Array, spread: Array) -> Array:
        """Correction less target ``(..., K)``; angles on both sides of half a turn are near each other."""
        difference = self.correction(output, spread) - target
        turns = [2.0 * math.pi * (quantity.kind == "angle") for quantity in self.outputs for _ in range(quantity.size)]
        whole = namespace(difference).round(difference / (2.0 * math.pi))
        return difference - constant(np.array(turns), difference) * whole

    def augmented(
        self, features: np.ndarray, target: np.ndarray, generator: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """As they are: rides are redrawn and mirrored as a whole."""
        return features, target


def mean_of_sequences(error: Array, mask: Array) -> Array:
    """Mean over sequences ``(B, N, …)`` of the root mean square in time of what is in the mask; 0 where nothing is."""
    xp, each = namespace(error), of_sequences(error, mask)
    count = xp.sum(xp.astype(xp.any(scored(error, mask), axis=1), each.dtype))
    return xp.sum(each) / xp.where(count > 0.0, count, xp.ones_like(count))


def of_sequences(error: Array, mask: Array) -> Array:
    """Root mean square in time ``(B, …)`` of what is in the mask of sequences ``(B, N, …)``; 0 where nothing is."""
    xp, each = namespace(error), rms(error, mask, axis=1)
    return xp.where(xp.any(scored(error, mask), axis=1), each, xp.zeros_like(each))


def turned(features: np.ndarray, up: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same sequences ``(B, N, …)`` in level frames turned by ``angles`` ``(B,)`` about the vertical."""
    shape = (-1, *(1,) * (features.ndim - 2))
    cosine, sine = (part.astype(features.dtype).reshape(shape) for part in (np.cos(angles), np.sin(angles)))
    copies = []
    for array, vectors in ((features, VECTORS), (up, 1)):
        copy = array.copy()
        for index in range(vectors):
            x, y = array[..., 3 * index], array[..., 3 * index + 1]
            copy[..., 3 * index], copy[..., 3 * index + 1] = cosine * x - sine * y, sine * x + cosine * y
        copies.append(copy)
    return copies[0], copies[1]
