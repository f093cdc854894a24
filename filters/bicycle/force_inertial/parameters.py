"""Parameters of the force/inertial filter: rider, bicycle, sensors, noises; the defaults are a usual rider's.

All places are from the trunk's pivot (the lumbar joint; a point of the seat in the paper), forward and up in the
bicycle's axes, m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...core.model import check_positive
from ...core.quantity import GRAVITY, Channel
from ..geometry import RiderEquations, RiderGeometry
from .axes import true_angles
from .forces import Masses, Pedals, SeatSensors
from .rider import rider_parameters

DEG = math.pi / 180.0
CHANNELS = (
    Channel("bicycle_imu/gyr", 3, "rad/s"),
    Channel("bicycle_imu/acc", 3, "m/s²"),
    Channel("trunk_imu/gyr", 3, "rad/s"),
    Channel("trunk_imu/acc", 3, "m/s²"),
    Channel("seat/wrench", 6, "N, N·m"),
    Channel("seat/load_cells", 3, "N"),
    Channel("handlebar/force", 6, "N"),
    Channel("wheel/speed", 1, "m/s"),
)


@dataclass(frozen=True)
class ForceInertialParameters(RiderEquations):
    """Numbers that filter and integration share."""

    dt: float = 0.02
    """s; the paper's 50 Hz"""
    gravity: float = GRAVITY
    """m/s²"""
    imu_tilt: float = 10.0 * DEG
    """α, nose up (table I)"""
    imu_forward: float = 0.37
    """p_x, from the rear contact (table I)"""
    imu_height: float = 0.71
    """p_z, above ground (table I)"""
    pivot_forward: float = 0.2593
    """l_s, of the trunk's pivot from the rear contact (table I: 0.26 for the seat)"""
    pivot_height: float = 1.037
    """h_s, above ground (table I: 0.38, below bicycle's IMU and mass centre, perhaps another reference)"""
    seat_forward: float = 0.0
    """of the saddle point from the pivot: −x_V"""
    seat_below: float = 0.1545
    """of the saddle point below the pivot; zero in the paper"""
    post_length: float = 0.13
    """L_1, from the saddle point down the post to the six-axis sensor (table I)"""
    post_tilt: float = 20.0 * DEG
    """γ, backwards (table I)"""
    cells_long: float = 0.20
    """L_x, from the rear load cells to the front one (table I)"""
    cells_wide: float = 0.12
    """L_y, between the rear ones (table I)"""
    cells_behind: float = 0.043
    """L_m, from the rear ones forward to the saddle point (table I)"""
    grip_forward: float = 0.5307
    """d_x, of the hands from the pivot; not published"""
    grip_up: float = 0.003
    """d_z, likewise"""
    grip_half_width: float = 0.27
    """of each hand from the middle"""
    wheelbase: float = 1.05
    """tells how far the handlebar is turned from the path's curvature; zero in the paper: it stays straight"""
    caster: float = 0.3142
    """tilt of the steering axis, backwards"""
    trunk_mass: float = 29.835
    """m_h, kg: trunk above the pivot, head, and what of the arms hangs at the shoulders; not published"""
    trunk_height: float = 0.3716
    """h_h, from the pivot to its centre of mass; not published"""
    trunk_across: float = 1.016
    """I_t, moment of inertia about an axis through the centre across the trunk, kg·m²; zero in the paper"""
    trunk_along: float = 0.392
    """I_a, along the trunk, kg·m²; zero in the paper"""
    trunk_imu_height: float = 0.2729
    """h, of the trunk's IMU up the trunk from the pivot; needed by ``acceleration="accelerometer"`` only"""
    carried_mass: float = 38.166
    """m_c: what else is carried and turns with the bicycle, kg; zero in the paper"""
    carried_forward: float = 0.15545
    """of its centre from the pivot"""
    carried_up: float = -0.19145
    """of its centre above the pivot"""
    pedal_share: float = 1.0
    """1: the pedals carry what seat and hands do not; 0: there are none, as in the paper"""
    axle_forward: float = 0.1667
    """of the crank's axle from the pivot"""
    axle_up: float = -0.757
    """of the crank's axle above the pivot: negative"""
    pedal_down: float = 138.177
    """force of both resting legs down on the pedals, mean of a turn, N"""
    pedal_back: float = 24.3313
    """likewise, backwards"""
    drive_forward: float = 0.3832
    """of where a driving force acts, from the pivot: ahead of the axle by 4/π crank lengths, the mean moment of a half
    sine of tangential force over its mean vertical part"""
    bias_time: float = 1800.0
    """τ, s (table I)"""
    bias_deviation: float = 0.15 * DEG
    """σ of (15), rad/s; not published"""
    gyroscope_noise: float = 1.0 * DEG
    """standard deviation a sample, rad/s: stands for scale and alignment and for the Euler step too; not published"""
    torque_noise: float = 12.0
    """of τ̂_φh and τ̂_θ, N·m: stands for what legs and arms do besides, which lasts; not published"""
    roll_noise: float = 2.0 * DEG
    """of φ̂_b, rad; not published"""
    shoulder_noise: float = 0.1
    """of the sine of the shoulders' tilt; not published. Too small a value pulls φ_h of an upright trunk"""
    ahead_share: float = 0.2
    """0: shoulders are level (17); 1: the chest faces ahead, to the bicycle; between: a weighted mean of the two, since
    riders who lean tilt their shoulders"""
    gyroscope_filter: float = 0.04
    """s, time constant of the differentiated gyroscopes' low-pass"""
    speed_filter: float = 0.2
    """s, of the differentiated wheel speed's"""
    lean_prior: float = 10.0 * DEG
    """standard deviation of the first φ_h, rad"""
    pitch_prior: float = 10.0 * DEG
    """of θ"""
    spin_prior: float = 15.0 * DEG
    """of φ"""
    roll_prior: float = 4.0 * DEG
    """of φ_b"""
    bias_prior: float = 0.15 * DEG
    """of b, rad/s"""

    def __post_init__(self) -> None:
        """Refuse what cannot be divided by."""
        super().__post_init__()
        positive = ("trunk_mass", "trunk_height", "trunk_imu_height", "imu_forward", "bias_time", "cells_long")
        noises = ("torque_noise", "roll_noise", "shoulder_noise")
        or_zero = ("gyroscope_filter", "speed_filter", "carried_mass", "trunk_across", "trunk_along")
        check_positive(self, *positive, *noises, or_zero=or_zero)

    @classmethod
    def rider_parameters(cls, geometry: RiderGeometry) -> dict[str, Any]:
        """Lengths and masses of the rider, places of the sensors."""
        return rider_parameters(geometry)

    def truth(self, truth: Mapping[str, Any]) -> dict[str, Any]:
        """The trunk's angles in the paper's frame, from the orientations of bicycle and trunk."""
        return true_angles(truth) if {"bicycle/orientation", "trunk/orientation"} <= set(truth) else {}

    def masses(self) -> Masses:
        """What sits on the seat."""
        return Masses(
            self.trunk_mass,
            self.trunk_height,
            self.trunk_across,
            self.trunk_along,
            self.carried_mass,
            self.carried_forward,
            self.carried_up,
        )

    def pedals(self) -> Pedals:
        """How the feet push."""
        return Pedals(self.axle_forward, self.axle_up, self.pedal_down, self.pedal_back, self.drive_forward)

    def seat_sensors(self) -> SeatSensors:
        """Where the seat's sensors are."""
        return SeatSensors(
            self.post_length,
            self.post_tilt,
            self.cells_long,
            self.cells_wide,
            self.cells_behind,
            self.seat_forward,
            self.seat_below,
        )
