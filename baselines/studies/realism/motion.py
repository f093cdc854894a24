"""Statistics of the motion that an inertial sensor sees: strength, bandwidth, jerk, sinusoids, slow velocity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.core import rotation
from ....filters.core.quantity import STANDARD_GRAVITY
from .spectra import WINDOW, Spectrum, checked, sinusoid_share, spectrum, whole_stretches

UNITS = {
    "gyr_rms": "deg/s",
    "gyr_f95": "Hz",
    "gyr_f99": "Hz",
    "gyr_above_3": "%",
    "gyr_above_10": "%",
    "gyr_sinusoids": "",
    "force_above_2": "m/s²",
    "force_above_10": "m/s²",
    "force_f95": "Hz",
    "force_jerk": "m/s³",
    "force_sinusoids": "",
    "acc_rms": "m/s²",
    "acc_f95": "Hz",
    "acc_f99": "Hz",
    "acc_above_3": "%",
    "acc_above_10": "%",
    "acc_jerk": "m/s³",
    "acc_sinusoids": "",
    "slow_velocity": "m/s",
}
"""Statistic → unit. ``gyr``: angular rate without its mean. ``force``: specific force in sensor axes above 0.5 Hz,
where gravity hardly counts. ``acc``: acceleration in the world, gravity removed, where the orientation is known.
``f95``, ``f99``: frequency below which so much of the power lies; ``above_3``, ``above_10``: share of the power above
3 and 10 Hz (of the specific force: rms above 2 and 10 Hz); ``sinusoids``: share of the variance in the four strongest
sinusoids of 20 s; ``slow_velocity``: rms velocity below 0.2 Hz, where the position is known."""
HIGH_PASS = 0.5
"""Hz, from which specific force is taken"""
SLOW = 0.2
"""Hz, below which velocity is slow"""
SHARE_OF_RATE = 0.45
"""of the sampling rate: the bandwidth of statistics unless another is given"""
DEG = 180.0 / np.pi


class MotionSpectra(NamedTuple):
    """Spectra of one sensor, and the signals behind them.

    Attributes:
        gyr: of the angular rate, (rad/s)²/Hz.
        force: of the specific force in sensor axes, (m/s²)²/Hz.
        acc: of the acceleration in the world, (m/s²)²/Hz; None where no orientation is known.
        velocity: of the velocity in the world, (m/s)²/Hz; None where no position is known.
        signals: ``gyr``, ``force`` and, where known, ``acc`` → ``(T, 3)``.
        rate: Hz.
    """

    gyr: Spectrum
    force: Spectrum
    acc: Spectrum | None
    velocity: Spectrum | None
    signals: dict[str, np.ndarray]
    rate: float


def motion_spectra(
    trajectory: Trajectory,
    site: str = "imu",
    *,
    orientation: str = "orientation",
) -> MotionSpectra:
    """Spectra of the gyroscope and accelerometer at ``site``.

    All samples count, rests as well, whether the trajectory's mask scores them or not.

    Args:
        trajectory: with the channels ``site/gyr`` in rad/s and ``site/acc`` in m/s².
        site: where the sensor is.
        orientation: name of the true orientation of this sensor.

    Raises:
        ValueError: a channel is missing, or is never sampled for a second on end.
    """
    trajectory = trajectory.on_grid().reference_clock_corrected()
    for kind in ("gyr", "acc"):
        if f"{site}/{kind}" not in trajectory.measurements:
            known = ", ".join(trajectory.measurements)
            raise ValueError(f"{trajectory.name} has no channel {site}/{kind}; it has {known}")
    rate = 1.0 / trajectory.dt
    signals = {"gyr": trajectory.measurements[f"{site}/gyr"], "force": trajectory.measurements[f"{site}/acc"]}
    if orientation in trajectory.truth:
        turned = trajectory.truth[orientation]
        if reports_means(trajectory, site):
            # a mean over the interval is in the axes of its middle
            turned = rotation.multiply(turned, rotation.exp(-0.5 / rate * signals["gyr"]))
        signals["acc"] = rotation.rotate(turned, signals["force"]) - np.array([0.0, 0.0, STANDARD_GRAVITY])
    moved = slow = None
    try:
        if "acc" in signals:
            moved = spectrum(signals["acc"], rate)
        if "position" in trajectory.truth:
            slow = velocity_spectrum(trajectory.truth["position"], rate)
        return MotionSpectra(
            spectrum(signals["gyr"], rate), spectrum(signals["force"], rate), moved, slow, signals, rate
        )
    except ValueError as reason:
        raise ValueError(f"{trajectory.name}, {site}: {reason}") from None


def reports_means(trajectory: Trajectory, site: str) -> bool:
    """Whether the accelerometer reports means over its interval, as far as the metadata say."""
    described = trajectory.metadata.get("sensors")
    sensors = described.get("sensors", []) if isinstance(described, dict) else []
    sampling = [each.get("sampling") for each in sensors if each.get("channel") == f"{site}/acc"]
    return (sampling or [trajectory.metadata.get("sampling")])[0] == "interval"


def velocity_spectrum(position: np.ndarray, rate: float) -> Spectrum | None:
    """Spectrum of the velocity of a position ``(T, 3)`` in m; None if it is nowhere known for :data:`WINDOW` s."""
    velocity = np.gradient(checked(position, rate), 1.0 / rate, axis=0)
    if not any(True for _ in whole_stretches(velocity, rate, WINDOW)):
        return None
    return spectrum(velocity, rate, WINDOW)


def statistics_of(spectra: MotionSpectra, bandwidth: float | None = None) -> dict[str, float]:
    """The statistics of :data:`UNITS`; NaN where one is not known.

    Args:
        spectra: of one sensor.
        bandwidth: Hz; what is faster does not count, so that records of other rates can be compared. None for 0.45 of
            the sampling rate.

    Raises:
        ValueError: the bandwidth is not above 10 Hz, or above half the sampling rate.
    """
    bandwidth = SHARE_OF_RATE * spectra.rate if bandwidth is None else bandwidth
    if not 10.0 < bandwidth <= 0.5 * spectra.rate:
        raise ValueError(
            f"bandwidth must be above 10 Hz and at most half the sampling rate of {spectra.rate:.4g} Hz, "
            f"got {bandwidth:.4g}"
        )
    gyr, force = spectra.gyr.band(0.0, bandwidth), spectra.force.band(HIGH_PASS, bandwidth)
    found = {
        "gyr_rms": DEG * gyr.rms(),
        "gyr_f95": gyr.edge(0.95),
        "gyr_f99": gyr.edge(0.99),
        "gyr_above_3": 100.0 * gyr.share(3.0),
        "gyr_above_10": 100.0 * gyr.share(10.0),
        "gyr_sinusoids": sinusoid_share(spectra.signals["gyr"], spectra.rate, high=bandwidth),
        "force_above_2": force.rms(2.0),
        "force_above_10": force.rms(10.0),
        "force_f95": force.edge(0.95),
        "force_jerk": force.derivative_rms(),
        "force_sinusoids": sinusoid_share(spectra.signals["force"], spectra.rate, low=HIGH_PASS, high=bandwidth),
    }
    if spectra.acc is not None:
        acc = spectra.acc.band(0.0, bandwidth)
        found |= {
            "acc_rms": acc.rms(),
            "acc_f95": acc.edge(0.95),
            "acc_f99": acc.edge(0.99),
            "acc_above_3": 100.0 * acc.share(3.0),
            "acc_above_10": 100.0 * acc.share(10.0),
            "acc_jerk": acc.derivative_rms(),
            "acc_sinusoids": sinusoid_share(spectra.signals["acc"], spectra.rate, high=bandwidth),
        }
    if spectra.velocity is not None:
        found["slow_velocity"] = spectra.velocity.rms(0.0, SLOW)
    return {name: found.get(name, float("nan")) for name in UNITS}


def motion_statistics(trajectory: Trajectory, site: str = "imu", *, bandwidth: float | None = None) -> dict[str, float]:
    """Statistics of the motion at a site: :func:`statistics_of` the :func:`motion_spectra`.

    Raises:
        ValueError: see there.
    """
    return statistics_of(motion_spectra(trajectory, site), bandwidth)
