"""Test fixtures: plausible measurements for any registered estimator, for contract tests and for ``poise speed``.

They follow from the channels that an estimator reads, so a new estimator needs nothing here unless its channels are of
a new family: a line in :data:`FAMILIES`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from ...envs.bicycle.sensors.suites import CHANNELS as BICYCLE_CHANNELS
from ...filters.arrays.array import AccelerometerArray, PlanarArray
from ...filters.core import rotation
from ...filters.core.estimator import Estimator

Data = dict[str, np.ndarray]

FIELD = np.array([0.0, 20.0, -45.0])
GRAVITY = np.array([0.0, 0.0, 9.81])
RIDE = 6.0
"""s of the ride from which pieces are cut"""
LEVEL_AXIS = rotation.exp(np.array([0.5 * np.pi, 0.0, 0.0]))
"""A body whose z axis is horizontal: planar arrays move in its x-y plane."""


def shaken_imu(estimator: Estimator[Any], seed: int, length: int, dt: float) -> Data:
    """An IMU that turns and is shaken."""
    rng = np.random.default_rng(seed)
    rate = rng.normal(0.0, 1.0, 3) + np.cumsum(rng.normal(0.0, 0.2, (length, 3)), axis=0)
    q = [rotation.exp(rng.normal(0.0, 0.5, 3))]
    for omega in rate[1:]:
        q.append(rotation.multiply(q[-1], rotation.exp(dt * omega)))
    orientation = np.array(q)
    force = rotation.rotate_back(orientation, GRAVITY[None])
    force = force + np.sin(np.arange(length)[:, None] * 0.3 + rng.uniform(0, 6, 3))
    return {
        "imu/gyr": rate + rng.normal(0.0, 0.01, rate.shape),
        "imu/acc": force + rng.normal(0.0, 0.05, force.shape),
        "imu/mag": rotation.rotate_back(orientation, FIELD[None]) + rng.normal(0.0, 0.3, force.shape),
    }


def moving_array(estimator: Estimator[Any], seed: int, length: int, dt: float) -> Data:
    """A body with an array of accelerometers and an IMU, from rest; a planar array stays in its plane."""
    rng = np.random.default_rng(seed)
    array = array_of(estimator)
    planar = isinstance(array, PlanarArray)
    time = dt * np.arange(length)[:, None, None]
    amplitude, angular = rng.normal(0.0, 1.0, (3, 4)), 2.0 * np.pi * rng.uniform(0.3, 2.0, (3, 4))
    if planar:
        amplitude[:2] = 0.0
    rate = (amplitude * np.sin(angular * time)).sum(axis=-1)
    turning = (amplitude * angular * np.cos(angular * time)).sum(axis=-1)
    first = rotation.exp(rng.normal(0.0, 0.4, 3) * ([0, 0, 1] if planar else [1, 1, 1]))
    q = [rotation.multiply(LEVEL_AXIS, first) if planar else first]
    for before, after in pairwise(rate):
        q.append(rotation.multiply(q[-1], rotation.exp(0.5 * dt * (before + after))))
    orientation = np.array(q)
    force = rotation.rotate_back(orientation, GRAVITY[None])
    force = force + (0.0 if planar else 0.3) * np.sin(5.0 * time[:, 0] + rng.uniform(0, 6, 3))
    seen = (force[:, :2], turning[:, 2:], rate[:, 2:]) if planar else (force, turning, rate)
    readings = array.readings(*seen)
    return {
        array.channel.name: readings + rng.normal(0.0, 0.02, readings.shape),
        "imu/gyr": rate + rng.normal(0.0, 0.01, rate.shape),
        "planar/gyr": rate[:, 2:] + rng.normal(0.0, 0.01, (length, 1)),
        "imu/acc": force + rng.normal(0.0, 0.02, force.shape),
        "imu/mag": rotation.rotate_back(orientation, FIELD[None]) + rng.normal(0.0, 0.3, force.shape),
    }


def array_of(estimator: Any) -> AccelerometerArray:
    """The array of a filter or of its model."""
    equations = getattr(estimator, "model", estimator)
    return next(value for value in vars(equations).values() if isinstance(value, AccelerometerArray))


@cache
def ride() -> Data:
    """All channels of a rider on a bicycle, without errors."""
    from ...envs.bicycle.environment import RiderBicycleEnv
    from ...envs.record import record_once

    env = RiderBicycleEnv("slalom", suite="all", sensors="ideal", rate=100.0, duration=RIDE)
    return record_once(env, 3).measurements


def piece_of_ride(estimator: Estimator[Any], seed: int, length: int, dt: float) -> Data:
    """A piece of a ride."""
    every = round(100.0 * dt)
    rng = np.random.default_rng(seed)
    start = int(rng.integers(0, round(100.0 * RIDE) - every * length))
    picked = slice(start, start + every * length, every)
    return {name: array[picked] + rng.normal(0.0, 1e-3, array[picked].shape) for name, array in ride().items()}


FAMILIES: tuple[tuple[frozenset[str], Callable[..., Data]], ...] = (
    (frozenset(("imu/gyr", "imu/acc", "imu/mag")), shaken_imu),
    (frozenset(("array/acc", "imu/gyr", "planar/gyr", "imu/acc", "imu/mag")), moving_array),
    (frozenset(BICYCLE_CHANNELS), piece_of_ride),
)
"""Channels of a family, and what simulates them; the first family that has all channels of an estimator is taken."""


def plausible_measurements(estimator: Estimator[Any], seed: int, length: int = 80, dt: float = 0.01) -> Data:
    """Plausible samples ``(T, size)`` of the channels that an estimator reads.

    Its channels choose the family, and its array of accelerometers, if it has one, the readings. Rides last a few
    seconds, with intervals of a multiple of 0.01 s.

    Raises:
        ValueError: no family has all these channels.
    """
    names = [channel.name for channel in estimator.channels]
    for channels, make in FAMILIES:
        if channels.issuperset(names):
            data = make(estimator, seed, length, dt)
            return {name: data[name] for name in names}
    raise ValueError(f"no measurements for the channels {names}: add their family to {__name__}.FAMILIES")
