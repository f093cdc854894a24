"""Exact motions of a platform without pitch and a body on it, for studies of the two-gyroscope filter.

No physics: angles are closed forms of time, orientations follow from them, and an ideal gyroscope reports the rotation
vector of each interval divided by its length (as the environments do with ``sampling="interval"``). Angles are those of
:mod:`poise.filters.bicycle.two_gyro.kinematics`; channels and truth have the names and axes of the environments.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.relative_sensor import relative_orientation
from ....filters.bicycle.two_gyro.filter import TwoGyro
from ....filters.core import rotation
from ....filters.core.quantity import DEG
from ..signals import Function, Waves, gauss_markov

NOTHING = Waves()


@dataclass(frozen=True)
class Pulses:
    """Yaw angle of a straight way with short turns: ``rate`` (rad/s) for ``length`` out of every ``period`` s."""

    rate: float
    length: float
    period: float

    def __call__(self, time: np.ndarray) -> np.ndarray:
        """Angles ``(T,)``, rad."""
        rounds, rest = np.divmod(time, self.period)
        return self.rate * (rounds * self.length + np.minimum(rest, self.length))


@dataclass(frozen=True)
class Bump:
    """Pitch of ``height`` (rad), Gaussian around ``time`` with half width ``width`` at 1/e (s), on top of vibration."""

    height: float
    time: float
    width: float
    vibration: Waves = NOTHING

    def __call__(self, time: np.ndarray) -> np.ndarray:
        """Angles ``(T,)``, rad."""
        return self.height * np.exp(-(((time - self.time) / self.width) ** 2)) + self.vibration(time)


VIBRATION = Waves(
    terms=(
        (4.0 * DEG / (2.0 * math.pi * 0.8), 2.0 * math.pi * 0.8, 0.3),
        (5.0 * DEG / (2.0 * math.pi * 2.7), 2.0 * math.pi * 2.7, 1.1),
    )
)
"""Pitch of a rough road: rates of 4 °/s at 0.8 Hz and 5 °/s at 2.7 Hz."""
ROLL = Waves(terms=((7.0 * DEG, 0.7, 0.2), (3.0 * DEG, 1.9, 1.0)))
"""Within ±10°."""
THETA = (
    Waves(terms=((13.0 * DEG, 0.9, 0.4), (7.0 * DEG, 2.3, 1.3))),
    Waves(terms=((12.0 * DEG, 1.1, 1.7), (8.0 * DEG, 1.7, 0.1))),
    Waves(terms=((14.0 * DEG, 0.6, 2.2), (6.0 * DEG, 2.9, 0.9))),
)
"""Within ±20°."""


@dataclass(frozen=True)
class Motion:
    """Angles of a platform and of a body on it as functions of time (s), rad."""

    yaw: Function
    roll: Function = ROLL
    pitch: Function = NOTHING
    theta: tuple[Function, Function, Function] = THETA

    def orientations(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Quaternions ``(T, 4)`` of platform and body to the world, axes of the environments."""
        platform = rotation.from_euler_zyx(-self.yaw(time), -self.pitch(time), self.roll(time))
        theta = np.stack([angle(time) for angle in self.theta], axis=-1)
        return platform, rotation.multiply(platform, relative_orientation(theta))


def turning(rate: float) -> Motion:
    """Steady turn at ``rate`` (rad/s) with a moving body."""
    return Motion(Waves(slope=rate))


MOTIONS: dict[str, Motion] = {
    "circle": Motion(Waves(30.0 * DEG, 0.0, ((12.0 * DEG, 0.4, 0.0), (4.0 * DEG, 1.7, 0.0))).integral),
    "sine": Motion(Waves(terms=((20.0 * DEG, 0.1 * math.pi, 0.0),)).integral),
    "vibration": Motion(
        Waves(30.0 * DEG, 0.0, ((12.0 * DEG, 0.4, 0.0), (4.0 * DEG, 1.7, 0.0))).integral, pitch=VIBRATION
    ),
    "pulses": Motion(Pulses(12.0 * DEG, 2.0, 8.0)),
    "straight": Motion(Waves()),
    "bump": Motion(Waves(slope=30.0 * DEG), pitch=Bump(20.0 * DEG, 15.0, 2.0, VIBRATION)),
    "slow bump": Motion(Waves(slope=9.0 * DEG), pitch=Bump(20.0 * DEG, 15.0, 1.0, VIBRATION)),
    "small bump": Motion(Waves(slope=30.0 * DEG), pitch=Bump(5.0 * DEG, 15.0, 2.0, VIBRATION)),
    "frozen": replace(turning(20.0 * DEG), roll=Waves(8.0 * DEG), theta=(Waves(), Waves(-0.5), Waves(0.1))),
}
"""Motions of the studies by name; yaw rates are those of the paper's figure 4 and of rides on a circle of 2 m."""


@dataclass(frozen=True)
class Errors:
    """Errors of the sensors, with the standard deviations of the studies; rad and rad/s."""

    body_gyroscope: float = 0.1 * DEG
    """of one sample"""
    platform_gyroscope: float = 0.1 * DEG
    """of one sample"""
    camera: float = 1.0 * DEG
    """of one frame, on each relative angle"""
    bias: float = 0.3 * DEG
    """of each gyroscope axis at the start"""
    bias_drift: float = 0.1 * DEG
    """of the Markov process that goes on from there"""
    bias_time: float = 1800.0
    """s"""
    camera_offset: float = 0.0
    """constant error of the relative angles"""
    camera_interval: int = 1
    """samples from frame to frame"""


IDEAL = Errors(0.0, 0.0, 0.0, 0.0, 0.0)


def filter_of(
    errors: Errors, dt: float, model: Literal["sigma1", "sigma2"] = "sigma2", roll_prior: float = 5.0 * DEG
) -> TwoGyro:
    """The filter that knows these errors, with the published Euler step; densities are deviations times √dt."""
    root = math.sqrt(dt)
    return TwoGyro(
        dt=dt,
        model=model,
        integration="euler",
        body_gyroscope_noise=(errors.body_gyroscope * root,) * 3,
        platform_gyroscope_noise=(errors.platform_gyroscope * root,) * 3,
        body_bias_drift=errors.bias_drift,
        platform_bias_drift=errors.bias_drift,
        body_bias_time=errors.bias_time,
        platform_bias_time=errors.bias_time,
        orientation_noise=errors.camera,
        body_bias_prior=errors.bias,
        platform_bias_prior=errors.bias,
        roll_prior=roll_prior,
        imu_tilt=0.0,
    )


def simulate(
    motion: Motion,
    duration: float,
    dt: float,
    errors: Errors = IDEAL,
    rng: np.random.Generator | None = None,
    sampling: Literal["interval", "instant"] = "interval",
) -> Trajectory:
    """A motion as two gyroscopes and a camera see it, for ``duration`` s every ``dt`` s.

    Args:
        motion: what happens.
        duration: s.
        dt: s.
        errors: of the sensors.
        rng: draws the errors; None for a fixed seed.
        sampling: what a gyroscope's sample is: the mean of the interval that it ends, or the rate at its end.

    Returns:
        ``bicycle_imu/gyr`` (mounted without tilt), ``trunk_imu/gyr``, ``relative/orientation``, and the truth under
        the environments' names.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    time = dt * np.arange(round(duration / dt) + 1)
    back = dt if sampling == "interval" else 1e-4
    ahead = 0.0 if sampling == "interval" else 1e-4
    measurements, truth = {}, {}
    orientations = motion.orientations(time)
    before, after = motion.orientations(time - back), motion.orientations(time + ahead)
    names = (("bicycle", "bicycle_imu", errors.platform_gyroscope), ("trunk", "trunk_imu", errors.body_gyroscope))
    for index, (body, place, noise) in enumerate(names):
        turn = rotation.log(rotation.multiply(rotation.conjugate(before[index]), after[index]))
        bias = bias_of(len(time), dt, errors, rng)
        white = noise * rng.standard_normal(bias.shape)
        measurements[f"{place}/gyr"] = turn / (back + ahead) + bias + white
        truth[f"{place}/gyroscope_bias"] = bias
        truth[f"{body}/orientation"] = orientations[index]
    truth["bicycle/roll"] = motion.roll(time)[:, None]
    theta = np.stack([angle(time) for angle in motion.theta], axis=-1) + errors.camera_offset * rng.standard_normal(3)
    frames = relative_orientation(theta + errors.camera * rng.standard_normal(theta.shape))
    frames[np.arange(len(time)) % errors.camera_interval != 0] = np.nan
    measurements["relative/orientation"] = frames
    geometry = replace(RiderGeometry(), bicycle_imu_tilt=0.0)
    metadata = {"name": "exact", "geometry": geometry.describe()}
    return Trajectory(time, measurements, truth, np.ones(len(time), bool), metadata)


def bias_of(length: int, dt: float, errors: Errors, rng: np.random.Generator) -> np.ndarray:
    """Biases ``(length, 3)`` of a gyroscope: a Markov process from a start of its own, equations (2) and (10)."""
    normal = rng.standard_normal((length, 3))
    normal[0] = rng.standard_normal(3)
    return gauss_markov(normal, errors.bias_drift, errors.bias_time, dt, errors.bias)
