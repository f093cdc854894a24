"""Front end of a network that chooses among several tunings of one filter of inertial sensors.

How far a gyroscope and how far a bound on the velocity can be trusted depends on the device and on the motion: a
running phone has a velocity, a fast rotation shows the scale errors of the gyroscope. No constants serve all. Here the
filter runs with its published constants and, beside them, with other gains on the same samples. The inclinations that
the others find are **candidates**: tilts of the published filter's level frame. What the network sees of them, and of
the motion in that frame, does not change with the heading, which is arbitrary.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from ....filters.core.backend import Array, namespace
from ....filters.core.estimator import check_measurements
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import UP, Channel, Estimate, Measurement
from ....filters.core.rotation import rotate
from ....filters.core.sampling import FilterState, zeros
from .front_end import Seen
from .gravity_aligned_frame import SCALARS, VECTORS
from .level_frame import LevelFrame, LevelState

GAINS = ("process", "velocity", "rest")
"""of bounded-motion-rest"""
IGNORED = 1000.0
"""Factor on σ_R with which a rest tells nothing."""
TUNINGS = (
    *((0.1, 1.0, 1.0), (0.3, 1.0, 1.0), (0.3, 5.0, 1.0), (1.0, 0.5, 1.0), (1.0, 4.0, 1.0), (3.0, 1.0, 1.0)),
    *((3.0, 4.0, 1.0), (1.0, 1.0, IGNORED), (0.3, 1.0, IGNORED)),
)
"""Factors on the deviations σ_g of the gyroscope, σ_V of the velocity and σ_R of rest, one row a candidate. σ_g and σ_V
surround the published pair as far as recordings of hands, phones and a drone prefer one of them; the last two do not
believe what a rest tells of the bias."""
VELOCITY = 1
"""Which of the vectors the directions of the others are told from: the filter's velocity in its level frame."""


class BankState(NamedTuple):
    """Memory of :class:`FilterBank`: of the level frame, and of the other filters."""

    level: LevelState
    others: FilterState


@dataclass(frozen=True)
class FilterBank:
    """The level frame of a filter, and the inclinations that the same filter finds with other gains.

    Features: of the vectors of :class:`.gravity_aligned_frame.GravityAlignedFrame` and the candidates (in deviations of
    tilt) the lengths of their horizontal parts and the directions of these against that of the velocity; the vertical
    parts of the vectors; the scalars of the frame and the filter's deviation. All are of the order of one.

    ``spread`` holds the deviation of tilt (1) and the candidates (2 K, rad).

    Attributes:
        level: with the filter.
        tunings: factors on deviations of the filter, a row for each of K candidates.
        gains: of the filter that are these deviations.

    Raises:
        ValueError: no filter, one without these gains, or factors that are not positive.
    """

    level: LevelFrame
    tunings: tuple[tuple[float, ...], ...] = TUNINGS
    gains: tuple[str, ...] = GAINS

    kind: ClassVar[str] = "filter-bank"

    def __post_init__(self) -> None:
        if self.level.kalman is None or not set(self.gains) <= set(self.level.kalman.gains):
            raise ValueError(f"level must have a filter with the gains {self.gains}, got {self.level.kalman}")
        tunings = tuple(tuple(float(factor) for factor in row) for row in self.tunings)
        fit = all(len(row) == len(self.gains) and all(0.0 < factor < math.inf for factor in row) for row in tunings)
        if not tunings or not fit:
            raise ValueError(
                f"tunings must be rows of positive factors on {self.gains}, one row at least, got {self.tunings}"
            )
        object.__setattr__(self, "tunings", tunings)

    @property
    def kalman(self) -> KalmanFilter:
        """The filter with its published constants."""
        assert self.level.kalman is not None
        return self.level.kalman

    @property
    def dt(self) -> float:
        """Sampling interval, s."""
        return self.level.dt

    @property
    def interval(self) -> float:
        """Time between updates of the network, s."""
        return self.level.interval

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Those of the filter."""
        return self.level.channels

    @property
    def size(self) -> int:
        """Number of features."""
        horizontals = VECTORS + len(self.tunings)
        return VECTORS + horizontals + 2 * (horizontals - 1) + SCALARS + 1

    def with_dt(self, dt: float) -> Self:
        """See :class:`.front_end.FrontEnd`."""
        return replace(self, level=self.level.with_dt(dt))

    def configured(self, metadata: Mapping[str, Any]) -> Self:
        """Nothing to configure."""
        return self

    def describe(self) -> dict[str, Any]:
        """See :class:`.front_end.FrontEnd`."""
        rows = {"gains": list(self.gains), "tunings": [list(row) for row in self.tunings]}
        return {**self.level.describe(), "kind": self.kind, **rows}

    @classmethod
    def read(cls, described: Mapping[str, Any], dt: float) -> Self:
        """The inverse of :meth:`describe`."""
        rows = tuple(tuple(row) for row in described["tunings"])
        # cards of an earlier date name no gains
        return cls(LevelFrame.read(described, dt), rows, tuple(described.get("gains", GAINS[:2])))

    def init(self, measurement: Measurement) -> BankState:
        """See :class:`.front_end.FrontEnd`."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        return BankState(self.level.init(arrays), self._others.init(self._repeated(arrays)))

    def step(self, state: BankState, measurement: Measurement) -> tuple[BankState, Seen]:
        """See :class:`.front_end.FrontEnd`."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        level, seen = self.level.step(state.level, arrays)
        others, estimate = self._others.step(state.others, self._repeated(arrays), self._factors())
        return BankState(level, others), self._seen(seen, estimate)

    def run(self, measurements: Mapping[str, Any]) -> Seen:
        """See :class:`.front_end.FrontEnd`."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        repeated = self._repeated(arrays)
        shape = next(iter(repeated.values())).shape[:-1]
        factors = {name: np.broadcast_to(values, shape) for name, values in self._factors().items()}
        return self._seen(self.level.run(arrays), self._others.run(repeated, factors))

    @property
    def _others(self) -> KalmanFilter:
        return replace(self.kalman, keep_covariance=False)

    def _factors(self) -> dict[str, np.ndarray]:
        """Gain → logarithm of its factor ``(K,)``, of the variance."""
        return {name: 2.0 * np.log([row[i] for row in self.tunings]) for i, name in enumerate(self.gains)}

    def _repeated(self, arrays: Measurement) -> dict[str, Array]:
        """The samples of every channel once for each candidate ``(..., K, size)``."""
        xp, count = namespace(*arrays.values()), len(self.tunings)
        return {name: xp.stack([array] * count, axis=-2) for name, array in arrays.items()}

    def _seen(self, seen: Seen, others: Estimate) -> Seen:
        found = self._candidates(seen.base["relative_orientation"], others)
        xp, batch = namespace(found), tuple(seen.due.shape)
        # before the start there are none
        candidates = xp.where(xp.isfinite(found), found, xp.zeros_like(found))
        sigma = xp.where(xp.isfinite(seen.spread), seen.spread, xp.ones_like(seen.spread))
        spread = xp.concat([sigma, xp.reshape(candidates, (*batch, -1))], axis=-1)
        now = seen.due == 1.0
        features = zeros(sigma, self.size)
        if bool(xp.any(now)):
            features = xp.where(now[..., None], self._features(seen.features, candidates, sigma), features)
        return seen._replace(features=features, spread=spread)

    def _candidates(self, orientation: Array, others: Estimate) -> Array:
        """What the others find beside the filter's ``orientation``: tilts ``(..., K, 2)`` in its level frame."""
        return rotate(orientation[..., None, :], others.pose[UP.name])[..., :2]

    def _features(self, motion: Array, tilts: Array, sigma: Array) -> Array:
        """Features of the level frame, and candidates ``(..., K, 2)``, in terms that do not depend on the heading."""
        xp = namespace(motion)
        vectors = xp.reshape(motion[..., : 3 * VECTORS], (*tuple(motion.shape[:-1]), VECTORS, 3))
        horizontal = xp.concat([vectors[..., :2], tilts / (sigma[..., None] + 0.002)], axis=-2)
        length = xp.sqrt(xp.sum(horizontal * horizontal, axis=-1) + 1e-6)
        unit = horizontal / (length[..., None] + 0.02)
        x, y = unit[..., VELOCITY, :1], unit[..., VELOCITY, 1:]
        relative = [
            xp.clip(vectors[..., 2], -3.0, 3.0),
            xp.log(length) / 3.0 + 0.3,
            *(unit[..., part, 0] * x + unit[..., part, 1] * y for part in self._told),
            *(unit[..., part, 0] * y - unit[..., part, 1] * x for part in self._told),
            motion[..., 3 * VECTORS :],
        ]
        return xp.concat(relative, axis=-1)

    @property
    def _told(self) -> tuple[slice, slice]:
        """All horizontals but the velocity."""
        return slice(0, VELOCITY), slice(VELOCITY + 1, VECTORS + len(self.tunings))
