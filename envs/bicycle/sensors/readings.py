"""Ideal readings of everything on rider and bicycle that is no inertial sensor, from what truly happens."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ....filters.core import rotation
from ...sensors.ideal import BodyState
from ...sensors.sensor import pick
from ...sensors.suite import SensorSuite
from .suites import SensorPlaces


@dataclass(frozen=True)
class RideQuantities:
    """What truly happens at one tick, or with a time axis first at many; world axes, SI units.

    What no channel of a suite needs may be left out.
    """

    bodies: Mapping[str, BodyState]
    """motion of the bodies named in :mod:`.sensors.suites`; distances need positions, everything else orientations"""
    wheel_rate: float | np.ndarray | None = None
    """(...) rad/s of the rear wheel, at the tick or on average since the last one"""
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
            raise ValueError(f"{name} is needed by the channels of this suite, got None")
        return np.asarray(value, dtype=float)


def seat_wrench(ride: RideQuantities, places: SensorPlaces) -> np.ndarray:
    """Force (N) and moment about its own origin (N·m) of the rider on the six-axis sensor ``(..., 6)``, its axes.

    The rider's weight reads negative on z. Saddle and post above the sensor are taken as massless.
    """
    frame, sensor = pick(ride.bodies, "bicycle").orientation, places.seat_sensor
    force, moment = (rotation.rotate_back(frame, ride.known(name)) for name in ("seat_force", "seat_moment"))
    arm = np.array(places.saddle) - np.array(sensor.lever_arm)
    moment = moment + rotation.cross(arm, force)
    axes = np.array(sensor.rotation)
    return np.concatenate([rotation.rotate_back(axes, force), rotation.rotate_back(axes, moment)], axis=-1)


def seat_load_cells(ride: RideQuantities, places: SensorPlaces) -> np.ndarray:
    """Compression ``(..., 3)`` of the cells front, rear left, rear right, N: statics of three supports."""
    frame = pick(ride.bodies, "bicycle").orientation
    force, moment = (rotation.rotate_back(frame, ride.known(name)) for name in ("seat_force", "seat_moment"))
    return places.load_cells.share(-force, -moment)


def centre_of_pressure(cells: np.ndarray, places: SensorPlaces) -> np.ndarray:
    """Where the vertical load on the saddle acts ``(..., 2)``: m ahead and to the left of the saddle point.

    Args:
        cells: ``(..., 3)`` compression front, rear left, rear right, N.
        places: of the cells.

    Returns:
        x_C and y_C below (10) of the force-inertial paper, here with y to the left.
    """
    return cells @ np.array([places.load_cells.x, places.load_cells.y]).T / np.sum(cells, axis=-1, keepdims=True)


def handlebar_force(ride: RideQuantities, places: SensorPlaces) -> np.ndarray:
    """Force of the left and the right hand on the handlebar ``(..., 6)``, N, bicycle axes.

    Their sum is F_h in (12) of the force-inertial paper.
    """
    frame, hands = pick(ride.bodies, "bicycle").orientation, ride.known("hands")
    return np.concatenate([rotation.rotate_back(frame, hands[..., side, :]) for side in (0, 1)], axis=-1)


def relative_orientation(ride: RideQuantities, places: SensorPlaces) -> np.ndarray:
    """Unit quaternion ``(..., 4)``, w ≥ 0, of the body that the camera sees, to bicycle axes."""
    frame, body = (pick(ride.bodies, name).orientation for name in ("bicycle", places.seen))
    return rotation.positive(rotation.multiply(rotation.conjugate(frame), body))


def relative_distances(ride: RideQuantities, places: SensorPlaces) -> np.ndarray:
    """Distance ``(..., 3)`` of each marker from its viewpoint, m."""
    frame, body = (pick(ride.bodies, name) for name in ("bicycle", places.seen))
    offset = body.position - frame.position
    lines = [
        offset
        + rotation.rotate(body.orientation, np.array(marker))
        - rotation.rotate(frame.orientation, np.array(viewpoint))
        for marker, viewpoint in zip(places.markers, places.viewpoints, strict=True)
    ]
    return np.concatenate([rotation.norm(line) for line in lines], axis=-1)


Reading = Callable[[RideQuantities, SensorPlaces], np.ndarray]
READINGS: dict[str, Reading] = {
    "seat/wrench": seat_wrench,
    "seat/load_cells": seat_load_cells,
    "handlebar/force": handlebar_force,
    "wheel/speed": lambda ride, places: places.wheel_radius * ride.known("wheel_rate")[..., None],
    "steer/angle": lambda ride, places: rotation.wrap(ride.known("steer"))[..., None],
    "crank/angle": lambda ride, places: rotation.wrap(ride.known("crank"))[..., None],
    "relative/orientation": relative_orientation,
    "relative/distances": relative_distances,
}
"""Channel → its ideal reading."""


def given_readings(suite: SensorSuite, ride: RideQuantities, places: SensorPlaces) -> dict[str, np.ndarray]:
    """Ideal readings of the channels of kind ``given``, for :meth:`SensorSuite.sample` or :meth:`SensorSuite.simulate`.

    Args:
        suite: the sensors.
        ride: one tick, or T of them.
        places: the suite's.

    Returns:
        Channel → ``(size,)``, or ``(T, size)``.

    Raises:
        ValueError: a channel is not known here, or a quantity that it needs was left out.
    """
    names = [sensor.channel.name for sensor in suite.sensors if sensor.kind == "given"]
    unknown = [name for name in names if name not in READINGS]
    if unknown:
        raise ValueError(f"given channels must be among {list(READINGS)}, got {unknown}")
    return {name: READINGS[name](ride, places) for name in names}
