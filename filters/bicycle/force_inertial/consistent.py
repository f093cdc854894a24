"""The force/inertial filter with noises that hold on rides, and a start that does not rest on one sample of the forces.

The published form takes its first angles from the first forces. A rider who begins to pedal or rises from the saddle
then seems to lie flat; with the published noises the filter is certain of it and settles in a second equilibrium, the
trunk turned by 90° about its own axis and tilted by as much to the side, which meets (17) equally well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from ...core.backend import Array, constant, namespace
from ...core.matrices import block_diagonal, diagonal, zeros
from ...core.quantity import DEG, Measurement
from ...core.rotation import wrap
from ...support.parameters import check_positive
from ..geometry import RiderGeometry
from .filter import ForceInertial


@dataclass(frozen=True)
class ConsistentForceInertial(ForceInertial):
    """:class:`.ForceInertial` from the rider's usual posture, with noises chosen on rides.

    The noises have the largest likelihood of the true angles on simulated rides of training riders, for devices from
    laboratory to phone grade, worn with placement errors, and a rider measured with a tape. They are no noise of a
    sample: they stand for lasting (time-correlated) errors. The usual posture is one more, weak measurement, without
    which the second equilibrium is not left again.
    """

    usual_pitch: float = 0.5 * math.pi - 0.5847
    """rad: θ at the start, from the usual lean of the trunk"""
    torque_noise: float = 100.0
    """N·m"""
    roll_noise: float = 8.2 * DEG
    """rad"""
    shoulder_noise: float = 0.5
    """of the sine of the shoulders' tilt"""
    ahead_share: float = 0.4
    """weight of a chest that faces forward"""
    gyroscope_noise: float = 26.0 * DEG
    """rad/s a sample at 100 Hz"""
    bias_prior: float = 6.8 * DEG
    """rad/s: turn-on bias of gyroscopes of phone grade, and what their alignment adds"""
    bias_std: float = 0.23 * DEG
    """rad/s"""
    lean_prior: float = 34.0 * DEG
    """rad"""
    pitch_prior: float = 43.0 * DEG
    """rad"""
    spin_prior: float = 60.0 * DEG
    """rad"""
    roll_prior: float = 30.0 * DEG
    """rad"""
    posture_noise: float = 0.21
    """rad √s, of the mean over one second: how far a rider is from the usual posture, in which the trunk leans forward
    in the plane of the bicycle"""

    residual_size: ClassVar[int] = 7

    def __post_init__(self) -> None:
        """Check the noise of the posture."""
        super().__post_init__()
        check_positive(self, "posture_noise")

    @classmethod
    def rider_parameters(cls, geometry: RiderGeometry) -> dict[str, Any]:
        """As of the published filter, with the usual lean of the trunk."""
        return {**super().rider_parameters(geometry), "usual_pitch": 0.5 * math.pi - geometry.trunk_flexion}

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """The usual posture in the bicycle's plane; roll and memory as published."""
        x, covariance = super().prior(z)
        none = 0.0 * x[..., :1]
        return namespace(x).concat([none, none + self.usual_pitch, none, x[..., 3:]], axis=-1), covariance

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """As published, and the usual posture as a measurement of the trunk's angles, φ_h of them from the bicycle."""
        xp = namespace(x)
        r, H, R = super().residual(x, z)
        usual = xp.concat([x[..., 3:4] - x[..., :1], self.usual_pitch - x[..., 1:2], -x[..., 2:3]], axis=-1)
        rows = constant([[1.0, 0, 0, -1.0, 0, 0, 0], [0, 1.0, 0, 0, 0, 0, 0], [0, 0, 1.0, 0, 0, 0, 0]], x)
        H = xp.concat([H, rows + zeros(x, 3, 7)], axis=-2)
        spread = diagonal([self.posture_noise**2 / self.dt] * 3, 0.0 * x[..., :1])
        return xp.concat([r, wrap(usual)], axis=-1), H, block_diagonal([R, spread])
