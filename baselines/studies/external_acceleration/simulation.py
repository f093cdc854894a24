"""The three tests of the external-acceleration paper, simulated, and the errors of the filter in them.

Tests A, B and C of J. K. Lee, E. J. Park, S. N. Robinovitch (2012, section IV) are the gestures ``slow``, ``fast`` and
``severe``. The paper's reference was an optical marker triangle fixed to the sensor by hand; its misalignment, which no
filter removes, is drawn here too (1.6° an axis).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ....envs.hand.gestures import Trial as GestureTrial
from ....envs.hand.gestures import gesture_config
from ....envs.sensors.suite import imu_suite
from ....filters.core import rotation
from ....filters.core.estimator import run
from ....filters.core.kalman import KalmanFilter
from ....filters.core.metrics import DEGREES, direction_error, rms
from ....filters.imu.external_acceleration import ExternalAcceleration

TESTS = {"A": "slow", "B": "fast", "C": "severe"}
"""Test of the paper → gesture."""

MISALIGNMENT = np.radians(1.6)
"""Standard deviation of the reference's misalignment about each axis, rad."""

MODES: tuple[Literal[1, 2, 3], ...] = (1, 2, 3)

SENSORS = "paper-hand"
"""Preset of the simulated sensor."""

RATE = 100.0
"""Samples a second, as in the paper."""


@dataclass(frozen=True)
class Trial:
    """Trials of one test, side by side.

    Attributes:
        measurements: channel → ``(T, trials, 3)``.
        up: ``(T, trials, 3)`` reference, misaligned.
        acceleration: ``(T, trials, 3)`` true external acceleration, sensor axes, m/s².
    """

    measurements: dict[str, np.ndarray]
    up: np.ndarray
    acceleration: np.ndarray


def simulate(
    test: str,
    seeds: Sequence[int],
    *,
    motion_share: float = 1.0,
    duration: float | None = None,
    misalignment: tuple[float, float] | None = None,
    gyroscope_bias: float = 0.0,
) -> Trial:
    """Draw trials of test A, B or C: instantaneous samples with the noise of the study.

    Args:
        test: A, B or C.
        seeds: one a trial.
        motion_share: the levels of acceleration are those of the test times this.
        duration: s; None for that of the test.
        misalignment: of the reference in roll and pitch, rad; None draws it.
        gyroscope_bias: added to every axis, rad/s.

    Raises:
        ValueError: unknown test.
    """
    if test not in TESTS:
        raise ValueError(f"unknown test {test!r}; there are {', '.join(TESTS)}")
    parts: list[tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]] = []
    for seed in seeds:
        motion, noise, mounting = (np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(3))
        config = gesture_config(TESTS[test])
        assert isinstance(config, GestureTrial)
        mean, peak = motion_share * config.mean_acceleration, motion_share * config.peak_acceleration
        gesture = replace(config, mean_acceleration=mean, peak_acceleration=peak).draw(motion, duration)
        times = np.arange(round(gesture.duration * RATE) + 1) / RATE
        bodies = gesture.sample(np.minimum(times, gesture.duration))
        suite = imu_suite(SENSORS, RATE, sampling="instant")
        suite.reset(noise)
        measurements = suite.simulate(bodies).measurements
        turn = mounting.normal(0.0, MISALIGNMENT, 3) if misalignment is None else np.array([*misalignment, 0.0])
        misaligned = rotation.exp(turn)
        up = rotation.rotate(misaligned, rotation.up_in_body(bodies.orientation))
        acceleration = rotation.rotate_back(bodies.orientation, np.asarray(bodies.acceleration))
        measurements["imu/gyr"] = measurements["imu/gyr"] + gyroscope_bias
        parts.append(({name: measurements[name] for name in ("imu/gyr", "imu/acc")}, up, acceleration))
    measured = {name: np.stack([part[0][name] for part in parts], axis=1) for name in parts[0][0]}
    return Trial(measured, np.stack([part[1] for part in parts], 1), np.stack([part[2] for part in parts], 1))


def estimate(trial: Trial, model: ExternalAcceleration) -> dict[str, np.ndarray]:
    """Quantity → ``(T, trials, 3)``; each gyroscope sample is held until the next."""
    model = replace(model, dt=1.0 / RATE, gyroscope_sample="previous")
    return run(KalmanFilter(model, keep_covariance=False, restart=False), trial.measurements).pose


def reference(trial: Trial) -> np.ndarray:
    """The paper's reference acceleration y_A − g Z_ref, which holds the error of Z_ref, ``(T, trials, 3)``."""
    return trial.measurements["imu/acc"] - ExternalAcceleration().gravity * trial.up


def errors(trial: Trial, model: ExternalAcceleration) -> dict[str, np.ndarray]:
    """Root mean square errors, a number a trial: angles in deg, accelerations in m/s².

    a_x … and ‖a‖ are the paper's, against its reference; ``true a`` is the length of the error against the true
    acceleration, ``inclination`` the angle between estimated and true inclination vector.
    """
    pose = estimate(trial, model)
    up, acceleration = pose["up"], pose["external_acceleration"]
    angles = zip(rotation.roll_pitch(up), rotation.roll_pitch(trial.up), strict=True)
    roll, pitch = (rms(rotation.wrap(ours - true)) * DEGREES for ours, true in angles)
    off = acceleration - reference(trial)
    sizes = np.linalg.norm(acceleration, axis=-1) - np.linalg.norm(reference(trial), axis=-1)
    return {
        "roll": roll,
        "pitch": pitch,
        **{f"a_{axis}": rms(off[..., index]) for index, axis in enumerate("xyz")},
        "‖a‖": rms(sizes),
        "true a": rms(np.linalg.norm(acceleration - trial.acceleration, axis=-1)),
        "inclination": rms(direction_error(up, trial.up)) * DEGREES,
    }


def compare_modes(seeds: Sequence[int]) -> list[dict[str, float | str | int]]:
    """Mean over trials of the root mean square errors of all modes in all tests, with both forms of the rotation.

    Returns:
        Rows with test, mean and peak of |a| (m/s²), mode, rotation, and roll, pitch and inclination (deg).
    """
    rows: list[dict[str, float | str | int]] = []
    for test in TESTS:
        trial = simulate(test, seeds)
        size = np.linalg.norm(trial.acceleration, axis=-1)
        level: dict[str, float | str | int] = {
            "test": test,
            "mean a": float(size.mean()),
            "peak a": float(size.max(axis=0).mean()),
        }
        for rotated, exact in (("published", False), ("exact", True)):
            for mode in MODES:
                found = errors(trial, ExternalAcceleration(mode=mode, exact_rotation=exact))
                means = {name: float(found[name].mean()) for name in ("roll", "pitch", "inclination")}
                rows.append({**level, "rotation": rotated, "mode": mode, **means})
    return rows
