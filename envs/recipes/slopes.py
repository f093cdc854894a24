"""A ride on level ground, as gyroscopes and a camera would see it on slopes and bumps.

The world is turned under the ride: orientations become W(t) R(t), W a turn by the pitch α(t) about the horizontal axis
across the bicycle's heading. Gyroscopes then read Rᵀ Ω more, with Ω the rate of W in its own axes; what the camera sees
of the rider does not change. This is exact for orientations and rates, whatever the rider does. Forces, accelerations
and speeds would need another ride, so these channels are left out.

An estimator that believes in level ground must know when not to; a ride on a ramp costs fifteen seconds, this none.
"""

from __future__ import annotations

import math

import numpy as np

from ...filters.core import rotation
from ...filters.core.quantity import DEG
from ...filters.support.ranges import log_uniform
from ..bicycle.rider.body_motion import smooth_step
from ..data.trajectory import Trajectory

SLOPE, RISE, TOP = (1.0 * DEG, 20.0 * DEG), (0.4, 3.0), (1.0, 12.0)
"""rad, s, s: angle of a slope, up or down, and how long it takes to begin or end, and lasts"""
JOLT, JOLT_LENGTH = (1.0 * DEG, 8.0 * DEG), (0.1, 0.4)
"""rad, s: largest pitch on a bump, first up and then down, and the time that it takes"""
EVERY = 15.0
"""s: one slope and one bump in this time, on average"""


def sloped(ride: Trajectory, generator: np.random.Generator) -> Trajectory:
    """The same ride on ground that rises and falls.

    Args:
        ride: of ``poise/RiderBicycle-v0``, with the truth ``bicycle/orientation`` and ``<site>/rotation``.
        generator: of slopes and bumps.

    Returns:
        Gyroscopes and ``relative/…``, and the true orientations; everything else is left out.

    Raises:
        ValueError: the ride lacks the orientation of a bicycle.
    """
    if "bicycle/orientation" not in ride.truth:
        raise ValueError(f"{ride.name} needs the truth bicycle/orientation, it has {sorted(ride.truth)}")
    dt, forward = ride.dt, rotation.rotate(ride.truth["bicycle/orientation"], np.array([1.0, 0.0, 0.0]))
    across = np.stack([-forward[:, 1], forward[:, 0], 0.0 * forward[:, 0]], axis=-1)
    across = across / np.linalg.norm(across, axis=-1, keepdims=True)
    W = rotation.exp(-pitch_profile(len(ride), dt, generator)[:, None] * across)
    rate = np.zeros((len(ride), 3))
    rate[1:] = rotation.log(rotation.multiply(rotation.conjugate(W[:-1]), W[1:])) / dt
    measurements = {}
    for name, values in ride.measurements.items():
        site, _, kind = name.partition("/")
        body = f"{site.removesuffix('_imu')}/orientation"
        if site == "relative":
            measurements[name] = values
        elif kind == "gyr" and {body, f"{site}/rotation"} <= set(ride.truth):
            sensor = rotation.multiply(ride.truth[body], ride.truth[f"{site}/rotation"])
            measurements[name] = values + rotation.rotate_back(midway(sensor), rate)
    truth = {name: rotation.multiply(W, values) for name, values in ride.truth.items() if name.endswith("/orientation")}
    return ride.replace(measurements=measurements, truth=truth, metadata={**ride.metadata, "sloped": True})


def pitch_profile(count: int, dt: float, generator: np.random.Generator) -> np.ndarray:
    """Pitch of the ground ``(count,)``, rad, nose up, at samples ``dt`` s apart; level at first."""
    time, pitch = dt * np.arange(count), np.zeros(count)
    for _ in range(generator.poisson(time[-1] / EVERY)):
        start, angle = generator.uniform(2.0, max(2.0, time[-1])), log_uniform(generator, SLOPE)
        rise, top = log_uniform(generator, RISE), log_uniform(generator, TOP)
        climb = smooth_step(time - start, 0.0, rise) - smooth_step(time - start - rise - top, 0.0, rise)
        pitch += generator.choice([-1.0, 1.0]) * angle * climb
    for _ in range(generator.poisson(time[-1] / EVERY)):
        start, angle = generator.uniform(2.0, max(2.0, time[-1])), log_uniform(generator, JOLT)
        along = np.clip((time - start) / log_uniform(generator, JOLT_LENGTH), 0.0, 1.0)
        pitch += angle * np.sin(2.0 * math.pi * along) * np.sin(math.pi * along)
    return pitch


def midway(orientation: np.ndarray) -> np.ndarray:
    """Orientations ``(T, 4)`` in the middle of the intervals that end at the samples."""
    turn = rotation.log(rotation.multiply(rotation.conjugate(orientation[:-1]), orientation[1:]))
    return np.concatenate([orientation[:1], rotation.multiply(orientation[:-1], rotation.exp(0.5 * turn))])
