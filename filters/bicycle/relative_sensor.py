"""Measurements of a camera on a bicycle: the orientation of a body on it, or the distances of three markers.

Relative angles are those of :mod:`.two_gyro.kinematics` (x forward, y right, z down). The sensors' axes are x forward,
y left, z up. The two differ by half a turn about x, which changes the signs of θ₂ and θ₃.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from ..core.backend import Array, constant, namespace, rows
from ..core.matrices import vector_of
from ..core.rotation import cross, from_euler_xyz, rotate, to_euler_xyz
from .geometry import Point, RiderGeometry
from .two_gyro.kinematics import SIGNS

TRUNK_MARKERS: tuple[Point, Point, Point] = ((-0.02, 0.12, 0.10), (-0.02, -0.12, 0.10), (-0.02, 0.0, -0.12))
"""m from the trunk's IMU, trunk axes: arms of a T-shaped fixture; the paper gives no numbers, these are assumed"""
CAMERA: Point = (-0.45, 0.0, 1.45)
"""m in the bicycle frame; assumed as well"""
DISK_CENTRE: Point = (0.26, 0.0, 1.0)
"""m in the bicycle frame, of the turning disk above the saddle; assumed"""


def relative_angles(orientation: Array) -> Array:
    """θ ``(..., 3)`` of a unit quaternion ``(..., 4)``, body to bicycle in the sensors' axes (up, left, forward)."""
    angles = namespace(orientation).stack(to_euler_xyz(orientation), axis=-1)
    return angles * constant(SIGNS, angles)


def relative_orientation(theta: Array) -> Array:
    """Unit quaternion ``(..., 4)``, body to bicycle in the sensors' axes, of θ ``(..., 3)``."""
    return from_euler_xyz(theta[..., 0], -theta[..., 1], -theta[..., 2])


@dataclass(frozen=True)
class MarkerPlaces:
    """Positions of three markers and of the points that observe them; lengths in m.

    Attributes:
        pivot: origin of the body's frame, about which the body rotates, in the bicycle frame.
        markers: in the body's frame.
        viewpoints: points from which the distances are measured, one per marker, bicycle frame.
    """

    pivot: Point
    markers: tuple[Point, Point, Point]
    viewpoints: tuple[Point, Point, Point]

    @classmethod
    def of_trunk(cls, geometry: RiderGeometry) -> Self:
        """Markers on a rider's back, observed by one camera behind."""
        x, y, z = geometry.trunk_imu
        left, right, low = ((x + dx, y + dy, z + dz) for dx, dy, dz in TRUNK_MARKERS)
        return cls(geometry.trunk_pivot, (left, right, low), (CAMERA, CAMERA, CAMERA))

    @classmethod
    def of_disk(cls) -> Self:
        """Markers 120° apart on the rim of the disk of ``poise/BicycleFixture-v0``, observed from behind and above."""
        centre, radius = DISK_CENTRE, 0.15
        half, height = 0.5 * radius, 0.75**0.5 * radius
        camera = (centre[0] - 0.35, centre[1] + 0.1, centre[2] + 0.35)
        markers = ((0.0, radius, 0.0), (-height, -half, 0.0), (height, -half, 0.0))
        return cls(centre, markers, (camera, camera, camera))


def marker_distances(theta: Array, places: MarkerPlaces) -> tuple[Array, Array]:
    """Distances h(θ) ``(*batch, 3)`` of (16), m, and their Jacobian ``(*batch, 3, 3)``.

    A change of θ_j rotates a marker about the j-th axis of the sequence, so dh = u · (axis_j × R m), where u is the
    unit vector from the viewpoint to the marker.
    """
    xp = namespace(theta)
    orientation = relative_orientation(theta)
    zero = 0.0 * theta[..., :1]
    unit = [constant(row, theta) + zero for row in ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0])]
    none = 0.0 * theta[..., 0]
    axes = [
        unit[0],
        rotate(from_euler_xyz(theta[..., 0], none, none), unit[1]),
        rotate(from_euler_xyz(theta[..., 0], -theta[..., 1], none), unit[2]),
    ]
    distances, slopes = [], []
    for marker, viewpoint in zip(places.markers, places.viewpoints, strict=True):
        arm = rotate(orientation, vector_of(marker, zero))
        line = vector_of(places.pivot, zero) + arm - vector_of(viewpoint, zero)
        distance = xp.sqrt(xp.sum(line * line, axis=-1))
        distances.append(distance)
        slopes.append([xp.sum(line * cross(axis, arm), axis=-1) / distance for axis in axes])
    return xp.stack(distances, axis=-1), rows(slopes)
