"""Figures 5.18 to 5.21 and Table 5.1: what the thesis measured with a tracker, on simulated devices after calibration.

The devices have the errors that a calibration leaves instead of white noise of 0.1 g, the hand accelerates less than in
the simulation of the thesis (the controller less than OCTA, as it says), and the reference is a tracker whose markers
are known within 1 mm, so that its angles err by up to 0.38°.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.hand.controller_gestures import Pointing
from ....envs.hand.devices import DEVICES, array_preset
from ....envs.hand.sensing import simulate_hand
from ....filters.arrays.spatial.pointing import tilt_error_bound
from ....filters.core import rotation
from ....filters.core.consistency import nees
from ....filters.core.estimator import run
from ....filters.core.kalman import KalmanFilter
from ...plots import TRUTH_COLOR, legend_above, new_figure
from ..averages import interval_of_mean
from ..claims import Claim
from ..kit import Study
from ..report import OVER_MOTIONS, Report
from ..ride_figures import DRAWN
from .figures import pointing_figure
from .orientation_bounds import attitude_covariance
from .rate_table import TABLE_4_2
from .spatial import (
    DURATION,
    FIELD,
    PROPOSED,
    RATE,
    STANDARD_GRAVITY,
    WITH_GYROSCOPE,
    WITHOUT_GYROSCOPE,
    estimated,
    pointed,
    pointing_curves,
    pointing_errors,
    prepared,
)
from .tables import Row

SENSORS = "array-calibrated"
ACCELERATIONS = {"controller": 1.0, "octa": 2.5}
"""m/s² rms an axis: the hand of the experiments; the thesis says only which is smaller"""
TRACKER = math.radians(0.382) / 2.0
"""rad: (5.57), 1 mm over 0.3 m, as two standard deviations"""
FIRST = {"controller": PROPOSED, "octa": WITHOUT_GYROSCOPE}
"""Device → the proposed method as the thesis uses it there"""
METHODS = {
    "controller": ("integration", "tilt sensor", "Marins, σ_q = 0.5", PROPOSED),
    "octa": ("integration of the array's rate", "tilt sensor", "Marins, σ_q = 0.3, array's rate", WITHOUT_GYROSCOPE),
}
"""Device → methods of its figures; the last is the proposed one"""
MORE: dict[str, tuple[str, ...]] = {"controller": (), "octa": (WITH_GYROSCOPE,)}
"""Further methods of the table"""
PUBLISHED = {"controller": (3.0, 10.0), "octa": (3.0, 5.0)}
"""Table 5.1, deg: largest error in simulation, in the experiment"""
NUMBERS = {"controller": "5.18 and 5.19", "octa": "5.20 and 5.21"}
"""Device → numbers of its figures"""
OFFSETS = np.radians([row[1] for row in TABLE_4_2.values()])
"""rad/s: offsets of the thesis' gyroscope before its calibration"""
UNCORRECTED = "integration with the offsets of Table 4.2"
SETTLED = 2.0
"""s after which errors count; both start from the true attitude"""


def tracked(device: str, seed: int, duration: float) -> tuple[Trajectory, np.ndarray]:
    """A device in a calm hand, with calibrated sensors, and what the tracker says of its orientation ``(T, 4)``."""
    name = "octa-gyroscope" if device == "octa" else device
    held = replace(DEVICES[name], magnetic_field=(0.0, FIELD, 0.0))
    gesture = Pointing(acceleration=ACCELERATIONS[device])
    trajectory = simulate_hand(gesture, seed, array_preset(SENSORS), RATE, duration, device=held)
    rng = np.random.default_rng([seed, 5])
    error = rotation.exp(TRACKER * rng.standard_normal((len(trajectory), 3)))
    return trajectory, rotation.multiply(trajectory.truth["orientation"], error)


def measured_curves(device: str, seed: int, duration: float) -> dict[str, Any]:
    """:func:`.spatial.pointing_curves` of the experiment, against the tracker; the proposed method first."""
    return pointing_curves(device, *tracked(device, seed, duration), METHODS[device][::-1])


def largest(device: str, seed: int, duration: float) -> list[Row]:
    """Largest error of pitch and azimuth (deg) of each method, after the start."""
    trajectory, reference = tracked(device, seed, duration)
    tried = {method: (method, trajectory) for method in (*METHODS[device], *MORE[device])}
    if device == "controller":
        rate = trajectory.measurements["imu/gyr"] + OFFSETS
        moved = trajectory.replace(measurements={**trajectory.measurements, "imu/gyr": rate})
        tried[UNCORRECTED] = ("integration", moved)
    rows = []
    for name, (method, samples) in tried.items():
        errors = np.array(pointing_errors(estimated(method, device, samples), reference)[:2])
        worst = np.abs(errors[:, trajectory.time >= SETTLED]).max()
        rows.append({"device": device, "method": name, "largest": float(np.degrees(worst))})
    return rows


def attitude_nees(device: str, seed: int, duration: float, calibrated: bool) -> float:
    """NEES of the attitude of the proposed filter, a degree of freedom, after calibration or with white noise."""
    trajectory = tracked(device, seed, duration)[0] if calibrated else pointed(device, seed, duration)
    model, measurements = prepared(FIRST[device], device, trajectory)
    estimate = run(KalmanFilter(model), measurements)
    truth, late = trajectory.truth["orientation"], trajectory.time >= SETTLED
    error = rotation.log(rotation.multiply(rotation.conjugate(truth), estimate.pose["orientation"]))[late]
    return float(np.mean(nees(error, attitude_covariance(np.asarray(estimate.covariance)[late], truth[late])))) / 3.0


def experiment(study: Study, report: Report, simulated: list[Row]) -> None:
    """Table 5.1, figures 5.18 to 5.22; ``simulated``: rows of :func:`.spatial.attitude_errors`."""
    seeds, duration = (2, 30.0) if study.quick else (5, DURATION)
    roots = [study.seed_of("experiment", index) for index in range(seeds)]
    jobs = [(device, seed, duration) for device in FIRST for seed in roots]
    measured = [row for found in study.map("experiment", largest, jobs) for row in found]
    rows, claims, worst = [], [], {}
    for device, method in FIRST.items():
        in_simulation = [
            max(row["pitch_max"], row["azimuth_max"])
            for row in simulated
            if row["device"] == device and row["method"] == method
        ]
        found = {
            name: [row["largest"] for row in measured if row["device"] == device and row["method"] == name]
            for name in (*METHODS[device], *MORE[device])
        }
        small, large = PUBLISHED[device]
        for kind, published, values in (("simulation", small, in_simulation), ("experiment", large, found[method])):
            rows.append(
                {"device": device, "quantity": f"largest error, {kind}", "published": f"±{published:g}"}
                | {"values": values, "unit": "deg"}
            )
        figure = NUMBERS[device]
        own, integrated, tilted, marins = (float(np.max(found[name])) for name in (method, *METHODS[device][:3]))
        worst[device] = own
        claims += [
            Claim.less(f"{device}, experiment: the proposed method stays within ±{large:g}° (Table 5.1)", own, large),
            Claim.less(f"{device}, experiment: integration is lost, beyond 20° (Figures {figure})", 20.0, integrated),
            Claim.less(f"{device}, experiment: Marins is worse than the proposed method", own, marins),
            Claim.less(f"{device}, experiment: Marins stays within ±10°", marins, 10.0),
            Claim.less(f"{device}, experiment: the tilt sensor is worse than the proposed method", own, tilted),
        ]
    helped = max(row["largest"] for row in measured if row["method"] == WITH_GYROSCOPE)
    lost = max(row["largest"] for row in measured if row["method"] == UNCORRECTED)
    claims.append(Claim.less(f"controller: integration is lost with{UNCORRECTED.partition('with')[2]}", 20.0, lost))
    claims.append(
        Claim.less("octa, with a gyroscope the proposed method stays within ±5°", helped, PUBLISHED["octa"][1])
    )
    report.compare(
        "Table 5.1: simulation and experiment",
        rows,
        f"Largest error of pitch and azimuth over {seeds} motions of {duration:g} s. *Experiment* is a simulated one: "
        f"errors *{SENSORS}*, hand {ACCELERATIONS['controller']:g} and {ACCELERATIONS['octa']:g} m/s² rms an axis, a "
        "tracker as reference. The published ± are ranges read off figures, not standard deviations.",
        interval=OVER_MOTIONS,
    )
    for kind, error in (("without", worst["octa"]), ("with", helped)):
        statement = f"OCTA {kind} a gyroscope is as accurate as the controller with one (Table 5.1)"
        claims.append(Claim.within(statement, error / worst["controller"], 0.5, 2.0, "times"))
    report.claims("Table 5.1: what holds", claims)
    cases = [(device, seed, duration, calibrated) for device in FIRST for calibrated in (False, True) for seed in roots]
    found_nees = dict(zip(cases, study.map("attitude NEES", attitude_nees, cases), strict=True))
    rows = []
    for device in FIRST:
        row: dict[str, Any] = {"device": device, "method": FIRST[device]}
        for kind, calibrated in (("white noise", False), ("after calibration", True)):
            values = [value for case, value in found_nees.items() if case[0] == device and case[3] is calibrated]
            row[f"NEES, {kind}, 95 % interval"] = interval_of_mean(values)
        rows.append(row)
    report.table("Consistency of the proposed method", rows, "Of the attitude, a degree of freedom; 1 if P is right.")
    for device in FIRST:
        one = study.cached(f"experiment curves {device}", measured_curves, device, roots[0], duration)
        title = f"Figures {NUMBERS[device]}: the {device} after calibration"
        note = "Simulated; errors beyond 20° are cut."
        report.figure(f"experiment-{device}", pointing_figure(one, "tracker", 20.0), title, note)
    report.figure(
        "cone", cone_figure(study.seed_of("pointing", 0), duration), "Figure 5.22: errors and the cone (5.63)"
    )


def cone_figure(seed: int, duration: float) -> Any:
    """Errors of pitch against the acceleration of the hand, by the tilt sensor and the proposed method, and (5.63)."""
    trajectory = pointed("controller", seed, duration)
    size = np.linalg.norm(trajectory.truth["acceleration"], axis=-1)
    figure, (ax,) = new_figure(6.0, 3.6)
    for method, color in (("tilt sensor", DRAWN[1]), (PROPOSED, DRAWN[-1])):
        pitch = pointing_errors(estimated(method, "controller", trajectory), trajectory.truth["orientation"])[0]
        ax.plot(size, np.degrees(pitch), ".", color=color, markersize=1.5, label=method)
    grid = np.linspace(0.0, 0.999 * STANDARD_GRAVITY, 100)
    bound = np.degrees(tilt_error_bound(grid[:, None] * np.array([1.0, 0.0, 0.0]), STANDARD_GRAVITY))
    for name, values, style in (
        ("arcsine", bound, "-"),
        ("arctangent", np.degrees(np.arctan(grid / STANDARD_GRAVITY)), "--"),
    ):
        ax.plot(grid, values, style, color=TRUTH_COLOR, linewidth=0.9, label=name)
        ax.plot(grid, -values, style, color=TRUTH_COLOR, linewidth=0.9)
    ax.set(xlabel="‖b̈‖, m/s²", ylabel="error of pitch, deg", ylim=(-90.0, 90.0))
    legend_above(ax)
    return figure
