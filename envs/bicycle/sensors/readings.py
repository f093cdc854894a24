"""Kinds of sensors on rider and bicycle that are not inertial: their ideal readings from motion and contact forces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ....filters.core import rotation
from ...sensors.ideal import BodyState
from ...sensors.kinds import SensorKind
from ...sensors.suite import pick
from .sites import SensorSites


@dataclass(frozen=True)
class RideQuantities:
    """True quantities at one time step, or with a leading time axis at many; world axes, SI units.

    Fields that no sensor of the suite needs may be left out.
    """

    bodies: Mapping[str, BodyState]
    """motion of the bodies named in :mod:`.sites`; distances need positions, everything else orientations"""
    sites: SensorSites
    """sensor sites"""
    wheel_rate: float | np.ndarray | None = None
    """(...) rad/s of the rear wheel, at the time step or on average since the last one"""
    steer: float | np.ndarray | None = None
    """(...) rad, left positive"""
    crank: float | np.ndarray | None = None
    """(...) rad, 0 with the left pedal in front, forward positive; wrapped or not"""
    seat_force: np.ndarray | None = None
    """(..., 3) N of the rider on the saddle"""
    seat_moment: np.ndarray | None = None
    """(..., 3) N·m of the rider on the saddle, about the saddle point"""
    hands: np.ndarray | None = None
    """(..., 2, 3) N of the left and the right hand on the handlebar"""

    def known(self, name: str) -> np.ndarray:
        """A field as an array.

        Raises:
            ValueError: it was left out.
        """
        value = getattr(self, name)
        if value is None:
            raise ValueError(f"{name} is needed by the sensors of this suite, got None")
        return np.asarray(value, dtype=float)


def seat_wrench(ride: RideQuantities) -> np.ndarray:
    """Force (N) and moment about its own origin (N·m) of the rider on the six-axis sensor ``(..., 6)``, its axes.

    The rider's weight is negative on z. Saddle and post above the sensor are massless.
    """
    frame, sensor = pick(ride.bodies, "bicycle").orientation, ride.sites.seat_sensor
    force, moment = (rotation.rotate_back(frame, ride.known(name)) for name in ("seat_force", "seat_moment"))
    arm = np.array(ride.sites.saddle) - np.array(sensor.lever_arm)
    moment = moment + rotation.cross(arm, force)
    axes = np.array(sensor.rotation)
    return np.concatenate([rotation.rotate_back(axes, force), rotation.rotate_back(axes, moment)], axis=-1)


def seat_load_cells(ride: RideQuantities) -> np.ndarray:
    """Compression ``(..., 3)`` of the cells front, rear left, rear right, N: statics of three supports."""
    frame = pick(ride.bodies, "bicycle").orientation
    force, moment = (rotation.rotate_back(frame, ride.known(name)) for name in ("seat_force", "seat_moment"))
    return ride.sites.load_cells.share(-force, -moment)


def centre_of_pressure(cells: np.ndarray, sites: SensorSites) -> np.ndarray:
    """Centre of pressure on the saddle ``(..., 2)``: m ahead and to the left of the saddle point.

    It is x_C, y_C below (10) of the force-inertial paper, here with y to the left, of cells ``(..., 3)`` that are
    compressed in front, rear left and rear right, N.
    """
    return cells @ np.array([sites.load_cells.x, sites.load_cells.y]).T / np.sum(cells, axis=-1, keepdims=True)


def handlebar_force(ride: RideQuantities) -> np.ndarray:
    """Force of the left and the right hand on the handlebar ``(..., 6)``, N, bicycle axes.

    Their sum is F_h in (12) of the force-inertial paper.
    """
    frame, hands = pick(ride.bodies, "bicycle").orientation, ride.known("hands")
    return np.concatenate([rotation.rotate_back(frame, hands[..., side, :]) for side in (0, 1)], axis=-1)


def relative_orientation(ride: RideQuantities) -> np.ndarray:
    """Unit quaternion ``(..., 4)``, w ≥ 0, of the body that the camera sees, to bicycle axes."""
    frame, body = (pick(ride.bodies, name).orientation for name in ("bicycle", ride.sites.seen))
    return rotation.positive(rotation.multiply(rotation.conjugate(frame), body))


def relative_distances(ride: RideQuantities) -> np.ndarray:
    """Distance ``(..., 3)`` of each marker from its viewpoint, m."""
    frame, body = (pick(ride.bodies, name) for name in ("bicycle", ride.sites.seen))
    offset = body.position - frame.position
    lines = [
        offset
        + rotation.rotate(body.orientation, np.array(marker))
        - rotation.rotate(frame.orientation, np.array(viewpoint))
        for marker, viewpoint in zip(ride.sites.markers, ride.sites.viewpoints, strict=True)
    ]
    return np.concatenate([rotation.norm(line) for line in lines], axis=-1)


def _kind(name: str, size: int, unit: str, reading: Callable[[RideQuantities], np.ndarray]) -> SensorKind:
    return SensorKind(name, size, unit, name.split("-", 1)[1], reading, on_body=False)


SEAT_WRENCH = _kind("seat-wrench", 6, "N, N·m", seat_wrench)
SEAT_LOAD_CELLS = _kind("seat-load_cells", 3, "N", seat_load_cells)
HANDLEBAR_FORCE = _kind("handlebar-force", 6, "N", handlebar_force)
WHEEL_SPEED = _kind("wheel-speed", 1, "m/s", lambda ride: ride.sites.wheel_radius * ride.known("wheel_rate")[..., None])
STEER_ANGLE = _kind("steer-angle", 1, "rad", lambda ride: rotation.wrap(ride.known("steer"))[..., None])
CRANK_ANGLE = _kind("crank-angle", 1, "rad", lambda ride: rotation.wrap(ride.known("crank"))[..., None])
RELATIVE_ORIENTATION = _kind("relative-orientation", 4, "1", relative_orientation)
RELATIVE_DISTANCES = _kind("relative-distances", 3, "m", relative_distances)
