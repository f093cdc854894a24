"""What the filter's modes must beat, whether their covariance is right, and when mode 3 first corrects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from ....envs.sensors.presets import sensor_preset
from ....filters.analysis.lasting_errors import Lasting, lasting_and_white, lasting_bound
from ....filters.core.estimator import run
from ....filters.core.kalman import KalmanFilter
from ....filters.core.metrics import DEGREES, direction_error, rms
from ....filters.core.rotation import normalize
from ....filters.imu.external_acceleration import ExternalAcceleration
from ...registry import make_estimator
from ..averages import interval_of_mean
from ..claims import Claim
from ..report import Report
from ..ride_study import MEAN, STRAPDOWN, ZERO
from .simulation import MODES, RATE, SENSORS, TESTS, Trial, estimate, simulate

BOUND = "posterior bound"
FLOOR = 1e-8
"""Share of the identity that is added to a covariance whose radial part is zero after normalisation"""


def skill_of_test(test: str, seeds: Sequence[int]) -> dict[str, Any]:
    """Method → inclination RMS (deg), one a trial; NEES of the modes on the tangent plane, each of 2 degrees."""
    # the same motion and noise, with a reference that is not misaligned, for the covariance
    trial, aligned = simulate(test, seeds), simulate(test, seeds, misalignment=(0.0, 0.0))
    found: dict[str, Any] = {"inclination": {}, "nees": {}}
    for mode in MODES:
        model = ExternalAcceleration(dt=1.0 / RATE, mode=mode, exact_rotation=False, gyroscope_sample="previous")
        found_by = run(KalmanFilter(model, restart=False), trial.measurements)
        up = found_by.pose["up"]
        found["inclination"][f"mode {mode}"] = _inclination(up, trial.up)
        found["nees"][f"mode {mode}"] = tangent_nees(up, aligned.up, np.asarray(found_by.covariance))
    alone = run(make_estimator("gyroscope-integration", dt=1.0 / RATE), trial.measurements).pose["up"]
    found["inclination"][STRAPDOWN] = _inclination(alone, trial.up)
    level = np.zeros_like(trial.up)
    level[..., 2] = 1.0
    found["inclination"][ZERO] = _inclination(level, trial.up)
    found["inclination"][BOUND] = lasting_bounds(aligned)
    found["inclination"][MEAN] = _inclination(normalize(trial.up.mean(axis=0)) + 0.0 * trial.up, trial.up)
    return found


def lasting_bounds(trial: Trial) -> list[float]:
    """Bound of the inclination's RMS error (deg), one a trial, for the acceleration as it lasts and a constant bias.

    The static output y_A − g Z is off by the true acceleration: along each axis a constant, a process of its size and
    frequency, and white noise.
    """
    found = []
    gyroscope = sensor_preset(SENSORS).noise_of("gyroscope")
    assert gyroscope is not None
    for k in range(trial.up.shape[1]):
        samples = {name: values[:, k] for name, values in trial.measurements.items()}
        model = ExternalAcceleration(
            dt=1.0 / RATE, mode=2, gyroscope_sample="previous", gyroscope_noise=gyroscope.white_noise * RATE**0.5
        )
        x = np.zeros((len(trial.up), 7))
        x[:, :3] = trial.up[:, k]
        off = samples["imu/acc"] - model.gravity * trial.up[:, k]
        errors, whites = lasting_and_white(off, model.dt, 3.0 * model.dt)
        errors.append(Lasting((gyroscope.turn_on_bias,) * 3, channel="imu/gyr"))
        white = np.diag(whites**2 + model.accelerometer_noise**2)
        P = lasting_bound(model, partial(_unmoved, x), samples, errors, white=white)
        # across the vertical; along it the length is known to be one
        across = np.trace(P, axis1=-2, axis2=-1) - np.einsum("ti,tij,tj->t", x[:, :3], P, x[:, :3])
        found.append(float(np.sqrt(np.mean(across))) * DEGREES)
    return found


def _unmoved(x: np.ndarray, samples: Mapping[str, Any]) -> np.ndarray:
    """True states, which hold nothing of the samples."""
    return x


LONG = 120.0
"""s: how long a hand may go on"""


def long_errors(seeds: Sequence[int]) -> dict[str, dict[str, float]]:
    """Test → mean inclination error (deg) of mode 1 and of the gyroscope alone over :data:`LONG` of its motion."""
    found = {}
    for test in ("B", "C"):
        trial = simulate(test, seeds, duration=LONG)
        model = ExternalAcceleration(exact_rotation=False)
        alone = run(make_estimator("gyroscope-integration", dt=1.0 / RATE), trial.measurements).pose["up"]
        found[test] = {
            "mode 1": float(np.mean(_inclination(estimate(trial, model)["up"], trial.up))),
            STRAPDOWN: float(np.mean(_inclination(alone, trial.up))),
        }
    return found


def beyond_the_trial(found: dict[str, dict[str, float]]) -> list[Claim]:
    """Whether the filter is worth it where the hand goes on for longer than in the paper's trials."""
    return [
        Claim.less(
            f"Over {LONG:g} s of test {test} mode 1 beats the gyroscope alone",
            errors["mode 1"],
            errors[STRAPDOWN],
            names=("mode 1", STRAPDOWN),
        )
        for test, errors in found.items()
    ]


def _inclination(up: np.ndarray, true: np.ndarray) -> list[float]:
    return (rms(direction_error(up, true)) * DEGREES).tolist()


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


def first_correction() -> int:
    """Number of quiet samples that mode 3 sees before its first correction, of a sensor at rest."""
    still = {"imu/gyr": np.zeros((20, 3)), "imu/acc": np.tile([0.0, 0.0, ExternalAcceleration().gravity], (20, 1))}
    found = run(KalmanFilter(ExternalAcceleration(dt=1.0 / RATE, mode=3), restart=False), still)
    assert found.covariance is not None
    size = np.trace(found.covariance, axis1=-2, axis2=-1)
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
        "knows the acceleration's size and frequency and the gyroscope's bias; its reference is aligned.",
    )
    mean = {test: {name: float(np.mean(v)) for name, v in found[test]["inclination"].items()} for test in TESTS}
    count = first_correction()
    n = round(ExternalAcceleration().window * RATE)
    return [
        *(
            Claim.less(f"Test {test}: mode 1 {what}", mean[test][one], mean[test][other], factor=factor)
            for what, one, other, factor in (
                ("does not lie below the bound", BOUND, "mode 1", 1.05),
                ("beats the gyroscope alone", "mode 1", STRAPDOWN, 1.0),
                ("beats the best constant", "mode 1", MEAN, 0.5),
            )
            for test in TESTS
        ),
        Claim(
            f"(30): mode 3 starts to correct when n + 1 = {n + 1} samples in a row are quiet",
            f"at sample {count}",
            count == n + 1,
        ),
    ]
