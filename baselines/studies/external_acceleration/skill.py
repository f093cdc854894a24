"""What the filter's modes must beat, whether their covariance is right, and when mode 3 first corrects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....filters.core.estimator import run
from ....filters.core.kalman import KalmanFilter
from ....filters.core.metrics import DEGREES, direction_error
from ....filters.core.rotation import normalize
from ....filters.imu.external_acceleration import ExternalAcceleration
from ...registry import make_estimator
from ..claims import Claim
from ..report import Report
from ..ride_study import MEAN, STRAPDOWN, ZERO, interval_of_mean
from .simulation import MODES, RATE, TESTS, Trial, simulate

FLOOR = 1e-8
"""Share of the identity that is added to a covariance whose radial part is zero after normalisation"""


def skill_of_test(test: str, seeds: Sequence[int]) -> dict[str, Any]:
    """Method → inclination RMS (deg), one a trial; NEES of the modes on the tangent plane, each of 2 degrees."""
    # the same motion and noise, with a reference that is not misaligned, for the covariance
    trial, aligned = simulate(test, seeds), simulate(test, seeds, misalignment=(0.0, 0.0))
    found: dict[str, Any] = {"inclination": {}, "nees": {}}
    for mode in MODES:
        model = ExternalAcceleration(dt=1.0 / RATE, mode=mode, exact_rotation=False, gyroscope_sample="previous")
        estimate = run(KalmanFilter(model, restart=False), trial.measurements)
        up = estimate.pose["up"]
        found["inclination"][f"mode {mode}"] = _inclination(up, trial.up)
        found["nees"][f"mode {mode}"] = tangent_nees(up, aligned.up, np.asarray(estimate.covariance))
    alone = run(make_estimator("gyroscope-integration", dt=1.0 / RATE), trial.measurements).pose["up"]
    found["inclination"][STRAPDOWN] = _inclination(alone, trial.up)
    level = np.zeros_like(trial.up)
    level[..., 2] = 1.0
    found["inclination"][ZERO] = _inclination(level, trial.up)
    found["inclination"]["posterior bound, white acceleration"] = white_bound(trial)
    found["inclination"][MEAN] = _inclination(normalize(trial.up.mean(axis=0)) + 0.0 * trial.up, trial.up)
    return found


def white_bound(trial: Trial) -> list[float]:
    """Bound of the inclination's RMS error (deg), one a trial, if the external acceleration were white with its size.

    Across the inclination vector Q = Δt² σ_G² and R = (σ_A² + ⟨a²⟩) / g², ⟨a²⟩ the mean square of an axis; the variance
    after a correction then settles at p = (−q + √(q² + 4 q r)) / 2. The acceleration of a hand is not white.
    """
    model = ExternalAcceleration()
    q = (model.gyroscope_noise / RATE) ** 2
    square = np.mean(np.sum(trial.acceleration**2, axis=-1), axis=0) / 3.0
    r = (model.accelerometer_noise**2 + square) / model.gravity**2
    p = 0.5 * (-q + np.sqrt(q * q + 4.0 * q * r))
    return (np.sqrt(2.0 * p) * DEGREES).tolist()


def _inclination(up: np.ndarray, true: np.ndarray) -> list[float]:
    return (np.sqrt(np.mean(direction_error(up, true) ** 2, axis=0)) * DEGREES).tolist()


def tangent_nees(up: np.ndarray, true: np.ndarray, covariance: np.ndarray) -> list[float]:
    """Mean NEES of the error across the inclination vector, each of its two degrees of freedom, one a trial."""
    # two axes across the estimate
    aside = np.where(np.abs(up[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    one = normalize(np.cross(up, aside))
    T = np.stack([one, np.cross(up, one)], axis=-2)
    error = (T @ (up - true)[..., None])[..., 0]
    P = T @ covariance @ np.swapaxes(T, -1, -2) + FLOOR * np.eye(2)
    values = np.einsum("...i,...i->...", error, np.linalg.solve(P, error[..., None])[..., 0]) / 2.0
    return values.mean(axis=0).tolist()


def first_correction(samples: int = 20) -> int:
    """Number of quiet samples that mode 3 sees before its first correction, of a sensor at rest."""
    still = {
        "imu/gyr": np.zeros((samples, 3)),
        "imu/acc": np.tile([0.0, 0.0, ExternalAcceleration().gravity], (samples, 1)),
    }
    estimate = run(KalmanFilter(ExternalAcceleration(dt=1.0 / RATE, mode=3), restart=False), still)
    assert estimate.covariance is not None
    size = np.trace(estimate.covariance, axis1=-2, axis2=-1)
    return int(np.argmax(np.diff(size) < 0.0)) + 2


def skill(report: Report, found: dict[str, dict[str, Any]]) -> list[Claim]:
    """Table of all tests, and what holds of it."""
    rows = []
    for test in TESTS:
        for method, values in found[test]["inclination"].items():
            nees = found[test]["nees"].get(method)
            rows.append(
                {"test": test, "method": method, "inclination, deg": round(float(np.mean(values)), 2)}
                | {"NEES, 95 % interval": None if nees is None else interval_of_mean(nees)}
            )
    report.table(
        "Skill: inclination of each test",
        rows,
        "Mean over trials of the RMS error. *Always zero*: the sensor is level. NEES of the two directions across the "
        "inclination vector, 1 if the covariance is right: the model takes the acceleration for white noise. The bound "
        "is that of white acceleration of the test's size, with sensors and reference aligned and free of biases.",
    )
    mean = {test: {name: float(np.mean(v)) for name, v in found[test]["inclination"].items()} for test in TESTS}
    count = first_correction()
    n = round(ExternalAcceleration().window * RATE)
    return [
        *(
            Claim.less(f"Test {test}: mode 1 beats the gyroscope alone", mean[test]["mode 1"], mean[test][STRAPDOWN])
            for test in TESTS
        ),
        *(
            Claim.less(
                f"Test {test}: mode 1 beats the best constant", mean[test]["mode 1"], mean[test][MEAN], factor=0.5
            )
            for test in TESTS
        ),
        Claim(
            f"(30): mode 3 starts to correct when n + 1 = {n + 1} samples in a row are quiet",
            f"at sample {count}",
            count == n + 1,
        ),
    ]
