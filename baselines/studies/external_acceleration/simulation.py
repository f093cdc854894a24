"""The three tests of the external-acceleration paper, simulated: every mode, printed and exact rotation.

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
        suite = imu_suite("paper-hand", RATE, sampling="instant")
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


def compare_modes(seeds: Sequence[int]) -> list[dict[str, float | str | int]]:
    """Mean over trials of the root mean square errors of all modes in all tests, with both forms of the rotation.

    Returns:
        Rows with test, mean and peak of |a| (m/s²), mode, rotation, and roll, pitch and inclination (deg).
    """
    rows: list[dict[str, float | str | int]] = []
    for test in TESTS:
        trial = simulate(test, seeds)
        size = np.linalg.norm(trial.acceleration, axis=-1)
        level, peak = float(size.mean()), float(size.max(axis=0).mean())
        for rotated, exact in (("printed", False), ("exact", True)):
            for mode in MODES:
                up = estimate_up(trial, ExternalAcceleration(mode=mode, exact_rotation=exact))
                angles = zip(rotation.roll_pitch(up), rotation.roll_pitch(trial.up), strict=True)
                roll, pitch = (float(rms(rotation.wrap(a - b)).mean()) * DEGREES for a, b in angles)
                row: dict[str, float | str | int] = {"test": test, "mean a": level, "peak a": peak}
                row |= {"rotation": rotated, "mode": mode}
                row |= {"roll": roll, "pitch": pitch, "inclination": inclination_rms(up, trial.up)}
                rows.append(row)
    return rows


def sweep_c_a(seeds: Sequence[int], values: Sequence[float]) -> list[dict[str, float | str]]:
    """Inclination error of mode 1 against c_a, deg, printed rotation: a row a test (Table II of the paper)."""
    rows = []
    for test in TESTS:
        trial = simulate(test, seeds)
        row: dict[str, float | str] = {"test": test}
        for c_a in values:
            up = estimate_up(trial, ExternalAcceleration(c_a=c_a, exact_rotation=False))
            row[f"c_a = {c_a:g}"] = inclination_rms(up, trial.up)
        rows.append(row)
    return rows


def estimate_up(trial: Trial, model: ExternalAcceleration) -> np.ndarray:
    """The filter's upward vertical ``(T, trials, 3)``."""
    return estimate(trial, model)["up"]


def estimate(trial: Trial, model: ExternalAcceleration) -> dict[str, np.ndarray]:
    """What the filter says, quantity → ``(T, trials, 3)``; each gyroscope sample holds until the next."""
    model = replace(model, dt=1.0 / RATE, gyroscope_sample="previous")
    return run(KalmanFilter(model, keep_covariance=False), trial.measurements).pose


def inclination_rms(up: np.ndarray, truth: np.ndarray) -> float:
    """Mean over trials of the RMS inclination error, deg."""
    return float(rms(direction_error(up, truth)).mean() * DEGREES)
