r"""Bicycle, trunk, arms and legs as one linkage, shared by the whole-body filter and its baseline.

Geometry is given in the environment's axes (x forward, y left, z up; :class:`.geometry.RiderGeometry`). Geometry and
samples are converted here to the axes of the whole-body paper (x forward, y up, z to the right): (x, y, z) → (x, z,
−y). The trunk rotates about the lumbar joint above a pelvis that is fixed to the frame; in the paper it rotates about
the seat.

The paper's angles are the environment's: Θ is ``trunk/angles``, Φ ``shoulder_…/angles``, Ψ ``hip_…/angles``, α and β
``elbow_…/flexion`` and ``knee_…/flexion``, φ ``bicycle/roll``, with the same signs on both sides.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...core.backend import Array, constant, namespace
from ...core.matrices import times
from ...core.quantity import Channel, Measurement, Quantity
from ...core.rotation import elementary_matrix, euler_matrix, exp, rotate
from ..geometry import ARM_MASS, Point, RiderEquations, RiderGeometry
from . import constraints as limb_constraints

USUAL = RiderGeometry()
SIDES = ("right", "left")
"""In the paper's order."""
SIGNS = {"right": -1.0, "left": 1.0}
"""Sign of y in the environment's axes."""
ROLL, YAW_ACCELERATION, TRUNK, RELATIVE_ACCELERATION = slice(0, 1), slice(1, 2), slice(2, 5), slice(5, 8)
SHOULDER = {"right": slice(8, 11), "left": slice(14, 17)}
HIP = {"right": slice(11, 14), "left": slice(17, 20)}
ERROR_SIZE = 20
ERROR_PARTS = {
    name: (part.start, part.stop)
    for name, part in (
        ("bicycle/roll", ROLL),
        ("trunk/angles", TRUNK),
        *((f"shoulder_{side}/angles", SHOULDER[side]) for side in SIDES),
        *((f"hip_{side}/angles", HIP[side]) for side in SIDES),
    )
}
"""Quantity → its part of the error state; elbows and knees follow from the others."""
STEER, CRANK = slice(20, 21), slice(21, 22)
"""Last valid samples of the encoders, for the angles of elbows and knees."""

GYROSCOPES = (
    "bicycle_imu/gyr",
    "trunk_imu/gyr",
    "upper_arm_right/gyr",
    "upper_arm_left/gyr",
    "thigh_right/gyr",
    "thigh_left/gyr",
)
"""In the paper's order."""
CHANNELS = (
    *(Channel(name, 3, "rad/s") for name in GYROSCOPES),
    Channel("bicycle_imu/acc", 3, "m/s²"),
    Channel("trunk_imu/acc", 3, "m/s²"),
    Channel("seat/load_cells", 3, "N"),
    Channel("wheel/speed", 1, "m/s"),
    Channel("steer/angle", 1, "rad"),
    Channel("crank/angle", 1, "rad"),
)
OUTPUTS = (
    Quantity("bicycle/roll", "angle", 1, "rad"),
    Quantity("trunk/angles", "angle", 3, "rad"),
    *(Quantity(f"{joint}_{side}/angles", "angle", 3, "rad") for side in SIDES for joint in ("shoulder", "hip")),
    *(Quantity(f"{joint}_{side}/flexion", "angle", 1, "rad") for side in SIDES for joint in ("elbow", "knee")),
)

PELVIS = 0.1117
"""Mass of the lower trunk, share of the rider's (de Leva 1996, men)"""


def paper_axes(vector: Array) -> Array:
    """The environment's (forward, left, up) ``(..., 3)`` in the paper's axes (forward, up, right)."""
    xp = namespace(vector)
    return xp.stack([vector[..., 0], vector[..., 2], -vector[..., 1]], axis=-1)


def true_angles(truth: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """The paper's angles from an environment's truth: they have the same names, axes and signs.

    Raises:
        ValueError: one is missing.
    """
    missing = [quantity.name for quantity in OUTPUTS if quantity.name not in truth]
    if missing:
        raise ValueError(f"truth must hold {[quantity.name for quantity in OUTPUTS]}, got none of {missing}")
    return {quantity.name: np.asarray(truth[quantity.name], dtype=float) for quantity in OUTPUTS}


@dataclass(frozen=True)
class RiderLinkage(RiderEquations):
    """Geometry of rider and bicycle (m, environment's axes), initial state, angles of elbows and knees.

    State: φ (1), yaw acceleration (1), Θ (3), a_ts (3), Φ_r (3), Ψ_r (3), Φ_l (3), Ψ_l (3), last valid steering and
    crank angle (2).
    """

    saddle: Point = USUAL.saddle
    """S, point where post and saddle meet"""
    trunk_pivot: Point = USUAL.trunk_pivot
    """lumbar joint"""
    shoulder: Point = USUAL.shoulder
    """left shoulder joint from the lumbar joint, trunk frame"""
    hip: Point = USUAL.hip
    """left hip joint"""
    grip: Point = USUAL.grip
    """left hand at zero steer"""
    steer_origin: Point = USUAL.steer_origin
    """a point of the steering axis"""
    steer_axis: Point = USUAL.steer_axis
    """unit vector, upwards"""
    crank_axle: Point = USUAL.crank_axle
    crank_length: float = USUAL.crank_length
    pedal_offset: float = USUAL.pedal_offset
    """of a foot from the mid-plane"""
    upper_arm: float = USUAL.upper_arm
    """l_h"""
    forearm: float = USUAL.forearm
    """l_f, elbow to grip"""
    thigh: float = USUAL.thigh
    """l_t"""
    shank: float = USUAL.shank
    """l_s, knee to ankle"""
    ankle_to_pedal: float = USUAL.ankle_to_pedal
    """l_z ("knee to pedal" in the paper's list of symbols)"""
    ankle_angle: float = USUAL.ankle_angle
    """γ, rad: exterior, 0 with the foot in line with the shank"""
    bicycle_imu: Point = USUAL.bicycle_imu
    """p_x and p_y of the paper are its x and z"""
    bicycle_imu_tilt: float = USUAL.bicycle_imu_tilt
    """ξ, rad, nose up"""
    trunk_flexion: float = USUAL.trunk_flexion
    """rad: the filter starts with Θ = (−trunk_flexion, 0, 0)"""
    published_knee: bool = False
    """C8 with the published small-angle form"""

    channels: ClassVar[tuple[Channel, ...]] = CHANNELS
    outputs: ClassVar[tuple[Quantity, ...]] = OUTPUTS
    state_size: ClassVar[int] = 22

    @property
    def knee_to_pedal(self) -> Any:
        """l_sp, m."""
        xp = namespace(self.shank)
        a, b, one = self.shank, self.ankle_to_pedal, 1.0
        return xp.sqrt(a * a + b * b + 2.0 * a * b * xp.cos(self.ankle_angle * one))

    def point(self, place: Point, side: str, like: Array) -> Array:
        """A position of the left side, mirrored for the right side, paper's axes ``(3,)``."""
        x, y, z = place
        return paper_axes(constant([x, (y if side == "left" else -y), z], like))

    def hand(self, side: str, steer: Array) -> Array:
        """Position of the hand ``(..., 3)`` at the steering angle ``(..., 1)``, paper's axes."""
        x, y, z = self.grip
        ox, oy, oz = self.steer_origin
        arm = constant([x - ox, (y if side == "left" else -y) - oy, z - oz], steer)
        axis = constant([*self.steer_axis], steer)
        return paper_axes(constant([*self.steer_origin], steer) + rotate(exp(axis * steer), arm + 0.0 * steer))

    def pedal(self, side: str, crank: Array) -> Array:
        """Position of the pedal ``(..., 3)`` at the crank angle ``(..., 1)``, 0 with the left one in front."""
        xp, sign = namespace(crank), SIGNS[side]
        along, down = self.crank_length * xp.cos(crank[..., 0]), self.crank_length * xp.sin(crank[..., 0])
        across = self.pedal_offset + 0.0 * along
        origin = constant([*self.crank_axle], crank)
        return paper_axes(origin + sign * xp.stack([along, across, -down], axis=-1))

    def bicycle_axes(self, vector: Array) -> Array:
        """A sample of the bicycle's IMU ``(..., 3)`` in the paper's axes of the bicycle: R_z(ξ)."""
        R = elementary_matrix(2, self.bicycle_imu_tilt + 0.0 * vector[..., 0])
        return times(R, paper_axes(vector))

    def rates(self, z: Measurement) -> dict[str, Array]:
        """Gyroscope channel → rate ``(..., 3)`` in the paper's axes of the body that carries it."""
        rates = {name: paper_axes(z[name]) for name in GYROSCOPES[1:]}
        return rates | {GYROSCOPES[0]: self.bicycle_axes(z[GYROSCOPES[0]])}

    def start(self, z: Measurement) -> Array:
        """State ``(..., 22)``: usual trunk flexion, limbs by inverse kinematics without swivel.

        NaN until every gyroscope, the bicycle's accelerometer and both encoders have had a valid sample.
        """
        steer, crank = z["steer/angle"], z["crank/angle"]
        xp = namespace(steer)
        zero = 0.0 * steer
        trunk = xp.concat([zero - self.trunk_flexion, zero, zero], axis=-1)
        parts = self.limb_angles(trunk, steer, crank)
        limbs = [parts[f"{joint}_{side}"] for side in SIDES for joint in ("shoulder", "hip")]
        x = xp.concat([zero, zero, trunk, zero, zero, zero, *limbs, steer, crank], axis=-1)
        present = xp.concat([z[name] for name in (*GYROSCOPES, "bicycle_imu/acc")], axis=-1)
        return xp.where(xp.all(xp.isfinite(present), axis=-1)[..., None], x, xp.nan)

    def limb_angles(self, trunk: Array, steer: Array, crank: Array) -> dict[str, Array]:
        """``shoulder_right`` … ``hip_left`` → angles ``(..., 3)`` by inverse kinematics: elbows out, knees forward.

        Args:
            trunk: ``(..., 3)`` angles Θ.
            steer: ``(..., 1)``, rad.
            crank: ``(..., 1)``, rad.
        """
        R, zero, parts = euler_matrix("zxy", trunk), 0.0 * steer, {}
        for side in SIDES:
            root = self.point(self.trunk_pivot, "left", steer) + times(R, self.point(self.shoulder, side, steer))
            outward = constant([0.0, 0.0, -SIGNS[side]], steer)
            frame, _ = limb_constraints.limb_frame(
                root, self.hand(side, steer), self.upper_arm, self.forearm, outward, "arm"
            )
            parts[f"shoulder_{side}"] = limb_constraints.shoulder_angles(R, frame)
            frame, _ = limb_constraints.limb_frame(
                self.point(self.hip, side, steer) + zero,
                self.pedal(side, crank),
                self.thigh,
                self.knee_to_pedal,
                constant([1.0, 0.0, 0.0], steer),
                "leg",
            )
            parts[f"hip_{side}"] = limb_constraints.hip_angles(frame)
        return parts

    def pose(self, x: Array) -> dict[str, Array]:
        """Roll, angles of trunk, shoulders and hips from the state, elbows by C4, knees by C8."""
        steer, crank = x[..., STEER], x[..., CRANK]
        pose = {"bicycle/roll": x[..., ROLL], "trunk/angles": x[..., TRUNK]}
        for side in SIDES:
            pose[f"shoulder_{side}/angles"], pose[f"hip_{side}/angles"] = x[..., SHOULDER[side]], x[..., HIP[side]]
            elbow = limb_constraints.elbow_flexion(
                x[..., TRUNK],
                self.point(self.trunk_pivot, "left", x),
                self.point(self.shoulder, side, x),
                self.hand(side, steer),
                self.upper_arm,
                self.forearm,
            )
            knee = limb_constraints.knee_flexion(
                self.point(self.hip, side, x),
                self.pedal(side, crank),
                self.thigh,
                self.shank,
                self.ankle_to_pedal,
                self.ankle_angle,
                self.published_knee,
            )
            pose[f"elbow_{side}/flexion"], pose[f"knee_{side}/flexion"] = elbow[..., None], knee[..., None]
        return pose


def seat_moments(geometry: RiderGeometry) -> tuple[Point, Point]:
    """First moments of the masses that rotate with the trunk and with the frame, kg·m.

    Newton–Euler for the rider about the saddle point: the support moment is the sum of (position × m × specific force)
    less the load on hands and feet. Shoulders carry half of each arm, hands the rest. The centre of the pelvis lies
    half way to the lumbar joint. Legs are supported by saddle and pedals and left out.

    Returns:
        Trunk axes from the lumbar joint, and bicycle axes from the saddle (environment's axes).
    """
    arms = ARM_MASS * geometry.rider_mass
    x, _, z = geometry.trunk_centre
    _, _, height = geometry.shoulder
    turning = (geometry.trunk_mass * x, 0.0, geometry.trunk_mass * z + arms * height)
    pelvis = PELVIS * geometry.rider_mass
    mass = geometry.trunk_mass + arms + 0.5 * pelvis
    px, py, pz = (a - b for a, b in zip(geometry.trunk_pivot, geometry.saddle, strict=True))
    return turning, (mass * px, mass * py, mass * pz)
