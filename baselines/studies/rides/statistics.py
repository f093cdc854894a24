"""Simulated rides in numbers: speed, roll, lean, accelerations, forces, gaps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.core import rotation

SUITE = ("bicycle_imu/acc", "trunk_imu/acc")
"""Channels that are recorded, without errors: what the papers' accelerometers would have to measure."""


@dataclass(frozen=True)
class RideStatistics:
    """One ride. Angles in deg, ``sd``: standard deviation over the ride."""

    scenario: str
    subject: int
    seed: int
    duration: float
    """s that were ridden"""
    upright: bool
    """whether the rider got to the end"""
    speed_mean: float
    """m/s"""
    speed_min: float
    """m/s"""
    speed_max: float
    """m/s"""
    roll_mean: float
    """deg, to the right positive"""
    roll_sd: float
    """deg"""
    roll_max: float
    """deg, largest magnitude"""
    pitch_max: float
    """deg, largest magnitude"""
    lean_mean: float
    """deg: the trunk's lean to the side against the vertical, towards the middle of the turn on the whole positive"""
    lean_sd: float
    """deg"""
    yaw_rate_mean: float
    """deg/s, mean of the magnitude"""
    yaw_rate_max: float
    """deg/s"""
    acceleration_max: float
    """m/s²: largest specific force on an axis of the bicycle's IMU"""
    seat_force_mean: float
    """N, magnitude of the rider's force on the saddle"""
    seat_force_max: float
    """N"""
    handlebar_force_mean: float
    """N, magnitude of each hand's force on the handlebar, mean of both hands"""
    handlebar_force_max: float
    """N, largest of both hands"""
    gap_max: float | None
    """mm, largest distance of a hand from its grip or of a foot from its pedal; None for a lumped rider"""


def trunk_lean(truth: Mapping[str, np.ndarray]) -> np.ndarray:
    """Lean of the trunk's axis to the side ``(T,)``, rad, to the right positive.

    The angle φ_h of the force-inertial paper: about the horizontal axis in which the bicycle heads.
    """
    axis = rotation.rotate(truth["trunk/orientation"], np.array([0.0, 0.0, 1.0]))
    heading = truth["bicycle/yaw"][:, 0]
    rightwards = axis[:, 0] * np.sin(heading) - axis[:, 1] * np.cos(heading)
    return np.arctan2(rightwards, axis[:, 2])


def ride_statistics(
    trajectory: Trajectory, *, scenario: str, subject: int, gaps: np.ndarray | None = None
) -> RideStatistics:
    """Numbers of one recorded ride.

    Args:
        trajectory: of ``poise/RiderBicycle-v0`` with the channel ``bicycle_imu/acc``.
        scenario: its name.
        subject: number of the rider.
        gaps: ``(T, 4)`` m, see :func:`.loop_closure_error`; None if they are not known.
    """
    truth = trajectory.truth
    speed, roll, pitch = (truth[f"bicycle/{name}"][:, 0] for name in ("speed", "roll", "pitch"))
    turning = rotation.rotate(truth["bicycle/orientation"], truth["bicycle/angular_rate"])[:, 2]
    lean = trunk_lean(truth)
    # turning left is a positive rate, leaning left a negative angle
    inwards = -math.copysign(1.0, float(turning.mean()))
    seat = np.linalg.norm(truth["seat/force"], axis=1)
    hands = np.stack([np.linalg.norm(truth[f"handlebar/force_{side}"], axis=1) for side in ("left", "right")])
    return RideStatistics(
        scenario=scenario,
        subject=subject,
        seed=int(trajectory.metadata["seed"]),
        duration=float(trajectory.time[-1] - trajectory.time[0]),
        upright=trajectory.metadata.get("ended") != "terminated",
        speed_mean=float(speed.mean()),
        speed_min=float(speed.min()),
        speed_max=float(speed.max()),
        roll_mean=math.degrees(roll.mean()),
        roll_sd=math.degrees(roll.std()),
        roll_max=math.degrees(np.abs(roll).max()),
        pitch_max=math.degrees(np.abs(pitch).max()),
        lean_mean=inwards * math.degrees(lean.mean()),
        lean_sd=math.degrees(lean.std()),
        yaw_rate_mean=math.degrees(np.abs(turning).mean()),
        yaw_rate_max=math.degrees(np.abs(turning).max()),
        acceleration_max=float(np.nanmax(np.abs(trajectory.measurements["bicycle_imu/acc"]))),
        seat_force_mean=float(seat.mean()),
        seat_force_max=float(seat.max()),
        handlebar_force_mean=float(hands.mean()),
        handlebar_force_max=float(hands.max()),
        gap_max=None if gaps is None else 1e3 * float(gaps.max()),
    )


def ride(scenario: str, subject: int, duration: float, fidelity: str, seed: int) -> RideStatistics:
    """Ride once and summarise what happened.

    Args:
        scenario: name of a scenario.
        subject: 0…4.
        duration: s.
        fidelity: ``full`` or ``lumped``.
        seed: of the ride.

    Raises:
        ValueError: an unknown scenario or rider, or a number out of its range.
    """
    from ....envs.bicycle.environment import RiderBicycleEnv
    from ....envs.bicycle.rider.anthropometry import rider_body
    from ....envs.bicycle.rider.posture import loop_closure_error, sit
    from ....envs.record import record

    env = RiderBicycleEnv(
        scenario,
        subject,
        suite=SUITE,
        sensors="ideal",
        duration=duration,
        fidelity=fidelity,  # type: ignore[arg-type]
    )
    try:
        trajectory = record(env, seed=seed)
    finally:
        env.close()
    gaps = (
        loop_closure_error(trajectory.truth, sit(env.parameters, rider_body(subject))) if fidelity == "full" else None
    )
    return ride_statistics(trajectory, scenario=scenario, subject=subject, gaps=gaps)
