"""Integration of six gyroscopes: the baseline of figure 6 of the whole-body paper, which drifts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ...core.backend import Array, expand, namespace
from ...core.model import Recurrence
from ...core.quantity import Measurement
from .linkage import HIP, RELATIVE_ACCELERATION, ROLL, SHOULDER, SIDES, TRUNK, YAW_ACCELERATION, RiderLinkage
from .rates import advance


@dataclass(frozen=True)
class WholeBodyIntegration(RiderLinkage, Recurrence):
    """Equations (2), (6), (10), (15) of the paper from the same initial state as the filter.

    State: as :class:`.RiderLinkage`; accelerations stay zero. Elbow and knee angles follow from the encoders
    (C4, C8), as in the filter.
    """

    sampling: Literal["interval", "instant"] = "interval"
    """meaning of a gyroscope sample: mean rate of the interval that it ends, or rate at its end (as in the paper)"""

    def prior(self, z: Measurement) -> Array:
        """Upright with the usual trunk flexion, limbs by inverse kinematics."""
        return self.start(z)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """Midpoint rule."""
        xp, rates = namespace(x), self.rates(z)
        if self.sampling == "instant":
            before = self.rates(previous)
            rates = {name: 0.5 * (rates[name] + before[name]) for name in rates}
        bicycle, trunk = rates["bicycle_imu/gyr"], rates["trunk_imu/gyr"]
        parts = [
            x[..., ROLL] + expand(self.dt, 1) * bicycle[..., :1],
            x[..., YAW_ACCELERATION],
            advance("zxy", x[..., TRUNK], trunk, bicycle, self.dt)[0],
            x[..., RELATIVE_ACCELERATION],
        ]
        for side in SIDES:
            arm, thigh = rates[f"upper_arm_{side}/gyr"], rates[f"thigh_{side}/gyr"]
            parts.append(advance("yxy", x[..., SHOULDER[side]], arm, trunk, self.dt)[0])
            parts.append(advance("zxy", x[..., HIP[side]], thigh, bicycle, self.dt)[0])
        return xp.concat([*parts, z["steer/angle"], z["crank/angle"]], axis=-1)
