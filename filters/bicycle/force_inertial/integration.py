"""Integration of the two gyroscopes: the force/inertial filter without force measurements.

The baseline of Y. Zhang, K. Chen, J. Yi, IEEE Transactions on Biomedical Engineering 60, 2013, section III: strapdown
integration of (3) and (4) from the angles that the first forces determine. It drifts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ...analysis.forward_mode import cos, sin
from ...core.backend import Array, namespace
from ...core.model import Recurrence
from ...core.quantity import Channel, Measurement, Quantity
from ...core.rotation import wrap
from .filter import ROLL, TRUNK_ANGLES
from .kinematics import Angles, down, rates, regular, up_the_trunk
from .parameters import CHANNELS, ForceInertialParameters
from .readings import readings, static_angles, steering


@dataclass(frozen=True)
class ForceInertialIntegration(ForceInertialParameters, Recurrence):
    """Euler steps (16) without a measurement update. State: φ_h, θ, φ, φ_b."""

    channels: ClassVar[tuple[Channel, ...]] = CHANNELS
    outputs: ClassVar[tuple[Quantity, ...]] = (ROLL, TRUNK_ANGLES)
    state_size: ClassVar[int] = 4

    def prior(self, z: Measurement) -> Array:
        """Angles from the first forces; NaN until every channel has had a valid sample."""
        xp = namespace(z["seat/wrench"])
        rate, speed = down(z["bicycle_imu/gyr"]), z["wheel/speed"][..., 0]
        yaw = cos(self.imu_tilt) * rate[2] - sin(self.imu_tilt) * rate[0]
        read = readings(self, z, steering(self, speed, yaw), "each")
        start = xp.stack(static_angles(self, read, speed * yaw), axis=-1)
        others = ("bicycle_imu/acc", "trunk_imu/acc", "trunk_imu/gyr", "seat/load_cells")
        return start + 0.0 * sum(xp.sum(z[name], axis=-1, keepdims=True) for name in others)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """Angles after one interval; θ keeps its distance from the singularities."""
        angles = Angles(*(x[..., index] for index in range(4)))
        omega = up_the_trunk(z["trunk_imu/gyr"]), down(z["bicycle_imu/gyr"])
        rate = rates(angles, *omega, self.imu_tilt)
        phi_h, theta, phi, phi_b = (angle + self.dt * change for angle, change in zip(angles, rate[:4], strict=True))
        return namespace(x).stack([wrap(phi_h), regular(theta), wrap(phi), wrap(phi_b)], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Roll (right positive) and trunk angles in the paper's frame R."""
        return {"bicycle/roll": x[..., 3:4], "force-inertial/trunk_angles": x[..., :3]}
