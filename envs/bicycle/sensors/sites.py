"""Sensor sites and axes of the published suites on rider and bicycle.

Sensor axes are x forward, y left, z up along the body that carries them. (The papers' axes point down or to the right,
which changes signs only.) Bodies and frames: ``bicycle`` (rear frame; origin on the
ground under the rear hub), ``trunk`` (origin in the lumbar joint, z up the trunk), ``head`` (origin in the lowest joint
of the neck, z up through the crown), ``upper_arm_left``,
``upper_arm_right``, ``thigh_left``, ``thigh_right`` (origin in the proximal joint, z from the distal joint to it).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ...sensors.ideal import Mounting
from ..frame.parameters import Vector3
from ..ride.contact_forces import LoadCells
from ..rider.posture import Posture

BICYCLE_IMU_SITE, BICYCLE_IMU_TILT = (0.37, 0.0, 0.71), math.radians(10.0)
"""m ahead of the rear contact and above ground, rad nose up: p_x, p_z, α (force-inertial table I; whole-body's ξ)"""
POST_TILT, POST_LENGTH = math.radians(20.0), 0.13
"""rad, backwards, and m from the saddle down to the six-axis sensor: γ, L1 (force-inertial table I)"""
CAMERA_SITE = (-0.45, 0.0, 1.45)
"""m in the bicycle frame: on a rod behind the rider; the papers give no numbers, so this is assumed"""
MARKERS = ((-0.02, 0.12, 0.10), (-0.02, -0.12, 0.10), (-0.02, 0.0, -0.12))
"""m from the trunk's IMU, trunk axes: the arms of the T-shaped fixture from T4 to T11; assumed"""
SPREAD_VIEWPOINTS = ((-0.45, 0.35, 1.10), (-0.45, -0.35, 1.10), (0.10, 0.35, 1.90))
"""m in the bicycle frame: three range finders apart from each other, which together see every rotation; assumed"""


def pitched(angle: float) -> tuple[float, ...]:
    """Mounting of axes that are pitched nose up by ``angle`` (rad): unit quaternion w, x, y, z."""
    return math.cos(0.5 * angle), 0.0, -math.sin(0.5 * angle), 0.0


@dataclass(frozen=True)
class SensorSites:
    """Sensor sites on one rider and bicycle; lengths in m.

    Raises:
        ValueError: a wheel radius that is not positive, or not three markers and three viewpoints.
    """

    bicycle_imu: Mounting
    trunk_imu: Mounting
    head_imu: Mounting
    """on a band or helmet at the crown"""
    upper_arm: Mounting
    """of both gyroscopes on the upper arms"""
    thigh: Mounting
    """of both gyroscopes on the thighs"""
    saddle: Vector3
    """point S where post and saddle meet, bicycle frame"""
    seat_sensor: Mounting
    """of the six-axis sensor, in the bicycle frame"""
    load_cells: LoadCells
    """relative to the saddle point"""
    wheel_radius: float
    """rolling radius of the rear wheel"""
    markers: tuple[Vector3, Vector3, Vector3]
    """in the frame of the body that the camera sees"""
    viewpoints: tuple[Vector3, Vector3, Vector3]
    """viewpoints of the marker distances, bicycle frame; three times the same point for one camera"""
    seen: str = "trunk"
    """the body that the camera sees"""

    def __post_init__(self) -> None:
        if not 0.0 < self.wheel_radius < math.inf:
            raise ValueError(f"wheel_radius must be positive and finite (m), got {self.wheel_radius}")
        for name in ("markers", "viewpoints"):
            if np.shape(getattr(self, name)) != (3, 3) or not np.all(np.isfinite(getattr(self, name))):
                raise ValueError(f"{name} must be three points (m), got {getattr(self, name)}")

    def describe(self) -> dict[str, Any]:
        """All sites, for JSON."""
        return asdict(self)


def sensor_sites(posture: Posture, *, viewpoints: Sequence[Vector3] = (CAMERA_SITE,) * 3) -> SensorSites:
    """Sensor sites on a person fitted to a bicycle.

    Args:
        posture: the person on the bicycle.
        viewpoints: three points of the bicycle frame from which markers are seen. From one point (the papers' camera)
            the distances do not change when the trunk rotates about the line from its joint to the camera;
            :data:`SPREAD_VIEWPOINTS` do not have this blind direction.
    """
    bicycle, trunk = posture.bicycle, np.array(posture.trunk_imu)
    down_post = POST_LENGTH * np.array([math.sin(POST_TILT), 0.0, -math.cos(POST_TILT)])
    seat = tuple((np.array(bicycle.saddle) + down_post).tolist())
    return SensorSites(
        bicycle_imu=Mounting(BICYCLE_IMU_SITE, pitched(BICYCLE_IMU_TILT)),
        trunk_imu=Mounting(posture.trunk_imu),
        head_imu=Mounting((0.0, 0.0, posture.body.crown_height)),
        upper_arm=Mounting((0.0, 0.0, -0.5 * posture.arm.upper)),
        thigh=Mounting((0.0, 0.0, -0.5 * posture.leg.upper)),
        saddle=bicycle.saddle,
        seat_sensor=Mounting(seat, pitched(POST_TILT)),
        load_cells=LoadCells(),
        # the tyre model touches the ground with the lowest point of its tread, so it rolls on its unloaded radius
        wheel_radius=bicycle.rear_wheel.radius,
        markers=tuple(tuple((trunk + marker).tolist()) for marker in np.array(MARKERS)),  # type: ignore[arg-type]
        viewpoints=tuple(viewpoints),  # type: ignore[arg-type]
    )


def fixture_sites(sites: SensorSites, centre: Vector3) -> SensorSites:
    """The two-gyro paper's fixture instead of a rider: a rotating disk, body ``disk``, seen by a camera above it.

    Args:
        sites: those of the bicycle.
        centre: of the disk in the bicycle frame, m; origin of the disk's frame, whose z is its normal.
    """
    # three markers, 120° apart (assumed)
    angles = np.radians([90.0, 210.0, 330.0])
    rim = 0.15 * np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=1)
    camera = tuple(np.add(centre, (-0.35, 0.1, 0.35)).tolist())
    markers = tuple(tuple(marker) for marker in rim.tolist())
    return replace(sites, seen="disk", markers=markers, viewpoints=(camera,) * 3)  # type: ignore[arg-type]
