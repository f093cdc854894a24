"""The force/inertial filter on simulated rides of a full rider: table II, figures 6 to 10, where errors come from."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....envs.bicycle.sensors.measured_geometry import measured
from ....envs.data.trajectory import Trajectory
from ....filters.analysis.bounds import posterior_bound
from ....filters.bicycle.force_inertial.axes import true_angles
from ....filters.bicycle.force_inertial.filter import ForceInertial
from ....filters.bicycle.force_inertial.integration import ForceInertialIntegration
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.core import rotation
from ....filters.core.consistency import nees
from ....filters.core.kalman import KalmanFilter
from ....filters.core.observer import Observer
from ...plots import new_figure
from ..kit import Study, load_ride
from ..report import DEVIATION, Report
from .motion import DEG
from .simulation import from_the_truth
from .states import torques, true_states

ANGLES = ("φ_h", "θ", "φ", "φ_b")
SETTLED = 10.0
"""s: errors count from here"""
POINT_MASS = {
    "carried_mass": 0.0,
    "pedal_share": 0.0,
    "trunk_across": 0.0,
    "trunk_along": 0.0,
    "wheelbase": 0.0,
    "handlebar_load": "sum",
}
FILTERS: dict[str, dict[str, Any]] = {
    "this filter": {},
    "no bias model": {"bias_model": False},
    "level shoulders (17) alone": {"ahead_share": 0.0},
    "chest ahead counts 0.4": {"ahead_share": 0.4},
    "static torque": {"torque_model": "static"},
    "raw (13)": {"roll_model": "printed"},
    "(12) without N_z": {"torque_reading": "without-z"},
    "no pedals, no pelvis, sum of the hands": POINT_MASS,
}
"""Name → options; the last is the paper's rider, a point mass, with our lengths."""
SOURCES = ("all errors", "force sensors: zeros known", "force sensors: exact", "gyroscopes: no bias", "both exact")
PRINTED = {
    ("indoor_circle", "this filter"): ("3.42 ± 1.34", "1.62 ± 1.06", "5.56 ± 1.45", "0.82 ± 0.31"),
    ("indoor_circle", "no bias model"): ("3.73 ± 1.46", "1.84 ± 1.09", "5.81 ± 1.42", "0.84 ± 0.33"),
    ("outdoor", "this filter"): ("4.46 ± 1.62", "4.01 ± 1.61", "6.18 ± 2.43", "2.31 ± 0.89"),
    ("outdoor", "no bias model"): ("4.42 ± 1.75", "4.18 ± 1.63", "6.24 ± 2.39", "2.30 ± 0.88"),
}
"""Table II, deg."""
NAN = (float("nan"),) * 4


def samples_of(ride: Trajectory) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray]:
    """Samples, truth and time from the first tick at which every channel has a sample."""
    names = [channel.name for channel in ForceInertial.channels]
    whole = np.all([np.isfinite(ride.measurements[name]).all(axis=-1) for name in names], axis=0)
    first = int(np.argmax(whole))
    truth = {name: ride.truth[name] for name in ("bicycle/roll", "trunk_imu/gyroscope_bias")} | true_angles(ride.truth)
    return (
        {name: ride.measurements[name][first:] for name in names},
        {name: values[first:] for name, values in truth.items()},
        ride.time[first:],
    )


def errors_of(pose: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]) -> np.ndarray:
    """Error ``(T, 4)`` of φ_h, θ, φ, φ_b, deg."""
    angles = rotation.wrap(pose["force-inertial/trunk_angles"] - truth["force-inertial/trunk_angles"])
    return np.degrees(np.concatenate([angles, pose["bicycle/roll"] - truth["bicycle/roll"]], axis=-1))


def rms_after(errors: np.ndarray, time: np.ndarray, start: float = SETTLED, end: float = np.inf) -> list[float]:
    """RMS of each column between two times; NaN where a ride is too short."""
    part = (time >= start) & (time < end)
    return [float(v) for v in np.sqrt(np.mean(errors[part] ** 2, axis=0))] if part.any() else list(NAN)


def better_sensors(ride: Trajectory, model: ForceInertial, source: str) -> dict[str, np.ndarray]:
    """The samples of a ride with some errors taken away."""
    samples, truth, _ = samples_of(ride)
    first = len(ride.time) - len(truth["bicycle/roll"])
    true = {name: values[first:] for name, values in ride.truth.items()}
    if source == "force sensors: zeros known":
        for name in ("seat/wrench", "handlebar/force"):
            samples[name] = samples[name] - true[f"{name}_bias"]
    if source in ("force sensors: exact", "both exact"):
        # our axes: x forward, y left, z up; the sensor is down the post, pitched with it
        arm = model.post_length * np.array([-np.sin(model.post_tilt), 0.0, np.cos(model.post_tilt)])
        mounted = rotation.exp(np.array([0.0, -model.post_tilt, 0.0]))
        moment = true["seat/moment"] + rotation.cross(arm, true["seat/force"])
        both = [rotation.rotate_back(mounted, values) for values in (true["seat/force"], moment)]
        samples["seat/wrench"] = np.concatenate(both, axis=-1)
        hands = [true[f"handlebar/force_{side}"] for side in ("left", "right")]
        samples["handlebar/force"] = np.concatenate(hands, axis=-1)
    if source in ("gyroscopes: no bias", "both exact"):
        for name in ("trunk_imu", "bicycle_imu"):
            samples[f"{name}/gyr"] = samples[f"{name}/gyr"] - true[f"{name}/gyroscope_bias"]
    return samples


def assess(path: Path) -> dict[str, Any]:
    """All numbers of one ride."""
    ride = load_ride(path)
    samples, truth, time = samples_of(ride)
    geometry = RiderGeometry.of(ride.metadata)
    model = ForceInertial.for_rider(geometry, dt=ride.dt)
    found: dict[str, Any] = {"subject": ride.metadata.get("subject"), "filters": {}, "sources": {}}
    for name, options in FILTERS.items():
        pose = KalmanFilter(ForceInertial.for_rider(geometry, dt=ride.dt, **options)).run(samples).pose
        found["filters"][name] = rms_after(errors_of(pose, truth), time)
    rng = np.random.default_rng(zlib.crc32(path.stem.encode()))
    tape = ForceInertial.for_rider(measured(geometry, rng), dt=ride.dt)
    found["filters"]["geometry measured"] = rms_after(errors_of(KalmanFilter(tape).run(samples).pose, truth), time)
    for source in SOURCES:
        pose = KalmanFilter(model).run(better_sensors(ride, model, source)).pose
        found["sources"][source] = rms_after(errors_of(pose, truth), time)
    integrated = Observer(ForceInertialIntegration.for_rider(geometry, dt=ride.dt)).run(samples).pose
    estimate = KalmanFilter(model).run(samples)
    drift = {"integration": errors_of(integrated, truth), "this filter": errors_of(estimate.pose, truth)}
    found["drift"] = {
        name: {"before 50 s": rms_after(errors, time, SETTLED, 50.0), "after 50 s": rms_after(errors, time, 50.0)}
        for name, errors in drift.items()
    }
    right = from_the_truth(KalmanFilter(model), samples, truth)
    found["wrong start"] = []
    for off in (35.0, -35.0):
        wrong = from_the_truth(KalmanFilter(model), samples, truth, off * DEG)
        bad = np.abs(errors_of(wrong, right)[:, 0]) > 1.0
        found["wrong start"].append(float(len(bad) - np.argmax(bad[::-1])) * ride.dt if bad.any() else 0.0)
    found["torques"] = torque_numbers(model, samples, truth, time)
    found["consistency"] = agreement(estimate, truth, time)
    bound = posterior_bound(model, true_states(model, samples, truth), samples)
    part = time >= SETTLED
    spread = np.sqrt(np.diagonal(bound[part], axis1=-2, axis2=-1)[:, :4].mean(axis=0)) if part.any() else NAN
    found["bound"] = [float(v) for v in np.degrees(spread)]
    return found


def torque_numbers(
    model: ForceInertial, samples: dict[str, np.ndarray], truth: dict[str, np.ndarray], time: np.ndarray
) -> dict[str, list[float]]:
    """Mean and deviation (over 0.2 s) of what is read and what the two models predict, and their RMS difference."""
    read, dynamic = torques(model, samples, truth)
    _, static = torques(replace(model, torque_model="static"), samples, truth)
    smooth = [
        np.stack([np.convolve(part[:, k], np.ones(10) / 10.0, "same") for k in (0, 1)], axis=-1)
        for part in (read, dynamic, static)
    ]
    kept = (time >= 2.0) & (time <= time[-1] - 1.0)
    named = dict(zip(("read", "dynamic", "static"), (part[kept] for part in smooth), strict=True))
    numbers = {name: [*part.mean(axis=0), *part.std(axis=0)] for name, part in named.items()}
    for name in ("dynamic", "static"):
        numbers[f"{name} − read"] = [*np.sqrt(np.mean((named[name] - named["read"]) ** 2, axis=0))]
    return {name: [float(v) for v in values] for name, values in numbers.items()}


def agreement(estimate: Any, truth: Mapping[str, np.ndarray], time: np.ndarray) -> dict[str, float]:
    """NEES of the four angles, and NIS, for each degree of freedom."""
    part = time >= min(SETTLED, 0.5 * float(time[-1]))
    error = np.radians(errors_of(estimate.pose, truth))[part]
    covariance = estimate.covariance[part][:, :4, :4]
    return {"NEES": float(np.mean(nees(error, covariance)) / 4.0), "NIS": float(np.mean(estimate.nis[part]) / 4.0)}


def rides(study: Study, report: Report) -> None:
    """Tables and figures of both courses."""
    for scenario in ("indoor_circle", "outdoor"):
        paths = study.ride_files(scenario, "force-inertial")
        every = study.map(f"rides {scenario}", assess, [(path,) for path in paths])
        _tables(report, scenario, every)
        _figure(report, scenario, paths[0])


def _mean(rows: list[list[float]]) -> dict[str, float]:
    return {name: round(float(v), 2) for name, v in zip(ANGLES, np.nanmean(np.array(rows), axis=0), strict=True)}


def _tables(report: Report, scenario: str, every: list[dict[str, Any]]) -> None:
    compared = []
    for name in ("this filter", "no bias model"):
        for index, angle in enumerate(ANGLES):
            printed = PRINTED[scenario, name][index]
            values = [each["filters"][name][index] for each in every]
            compared.append({"filter": name, "quantity": angle, "printed": printed, "values": values, "unit": "deg"})
    report.compare(f"Table II, {scenario}", compared, f"RMS after {SETTLED:g} s.", interval=DEVIATION)
    for name in FILTERS:
        for index, angle in enumerate(ANGLES):
            values = [each["filters"][name][index] for each in every]
            report.numbers(
                [
                    {
                        "estimator": f"force-inertial: {name}",
                        "trajectory": f"{scenario}-{number}",
                        "quantity": angle,
                        "metric": "rms",
                        "value": value,
                        "unit": "deg",
                    }
                    for number, value in enumerate(values)
                ]
            )
    names = [*FILTERS, "geometry measured"]
    rows = [{"filter": name, **_mean([each["filters"][name] for each in every])} for name in names]
    report.table(
        f"Variants, {scenario}, mean RMS in deg",
        rows,
        "*Geometry measured*: segment lengths within 2 %, joints within 1 cm, trunk mass within 3 %.",
    )
    rows = [{"sensors": name, **_mean([each["sources"][name] for each in every])} for name in SOURCES]
    bound = {"sensors": "lower bound for the filter's noises", **_mean([each["bound"] for each in every])}
    report.table(
        f"Where errors come from, {scenario}, mean RMS in deg",
        [*rows, bound],
        "The bound (Cramér–Rao, along the true states) supposes white noises of the sizes that the filter assumes; "
        "what is left with exact sensors is the rider's model: pedalling, and shoulders that are not level.",
    )
    rows = []
    for name in ("integration", "this filter"):
        for span in ("before 50 s", "after 50 s"):
            values = [each["drift"][name][span] for each in every]
            if np.isfinite(values).any():
                rows.append({"method": name, "time": span, **_mean(values)})
    report.table(f"Drift, {scenario}, mean RMS in deg", rows)
    rows = []
    for name in ("read", "dynamic", "static"):
        mean = np.mean([each["torques"][name] for each in every], axis=0)
        off = np.mean([each["torques"].get(f"{name} − read", [np.nan] * 2) for each in every], axis=0)
        labels = ("τ_φh mean", "τ_θ mean", "τ_φh sd", "τ_θ sd", "τ_φh − read, rms", "τ_θ − read, rms")
        rows.append({"N·m": name, **dict(zip(labels, np.round([*mean, *off], 1).tolist(), strict=True))})
    report.table(f"Torques at the true pose, {scenario}", rows, "Smoothed over 0.2 s. Means of all rides.")
    starts = np.array([each["wrong start"] for each in every])
    agree = {name: float(np.mean([each["consistency"][name] for each in every])) for name in ("NEES", "NIS")}
    report.text(
        f"{scenario}: a filter whose φ_h starts 35° off agrees for good within 1° with one that starts right after "
        f"{starts.mean():.1f} s in the mean, {starts.max():.1f} s at most. NEES {agree['NEES']:.2f}, NIS "
        f"{agree['NIS']:.2f} for each degree of freedom (1 is consistent): errors of zeros, pedalling and tilted "
        "shoulders last, which the filter takes for white."
    )


def _figure(report: Report, scenario: str, path: Path) -> None:
    """Estimates and truth of the first ride, beside integration."""
    ride = load_ride(path)
    samples, truth, time = samples_of(ride)
    geometry = RiderGeometry.of(ride.metadata)
    integration = Observer(ForceInertialIntegration.for_rider(geometry, dt=ride.dt))
    poses = {
        "integration": (integration.run(samples).pose, "#b9bec7"),
        "filter": (KalmanFilter(ForceInertial.for_rider(geometry, dt=ride.dt)).run(samples).pose, "#1f5fa8"),
    }
    figure, axes = new_figure(8.0, 7.0, 4)
    for index, (ax, name) in enumerate(zip(axes, ANGLES, strict=True)):
        for label, (pose, colour) in poses.items():
            ax.plot(time, np.degrees(_column(pose, index)), color=colour, linewidth=1.0, label=label)
        ax.plot(time, np.degrees(_column(truth, index)), color="#c2571a", linewidth=1.0, linestyle="--", label="truth")
        ax.set_ylabel(f"{name}, deg")
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False)
    axes[-1].set_xlabel("time, s")
    report.figure(f"angles-{scenario}", figure, f"Angles of one ride, {scenario}", "As the paper's figures 6 and 9.")


def _column(pose: Mapping[str, np.ndarray], index: int) -> np.ndarray:
    return pose["bicycle/roll"][:, 0] if index == 3 else pose["force-inertial/trunk_angles"][:, index]
