"""The two-gyroscope filter on simulated rides: table I, figures 9 to 17, and where the errors come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.analysis.bounds import posterior_bound, with_gaps
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.platform_gyro import PlatformGyro, TwoGyroIntegration
from ....filters.bicycle.two_gyro.filter import TwoGyro
from ....filters.bicycle.two_gyro.truth import true_angles, true_states
from ....filters.core import rotation
from ....filters.core.consistency import nees
from ....filters.core.kalman import KalmanFilter
from ....filters.core.observer import Observer
from ....filters.core.quantity import Estimate
from ..kit import Study, load_ride
from ..report import DEVIATION, Report
from .motion import DEG

SETTLED = 10.0
"""s: errors count from here, when the roll has converged"""
DRIFTED = 20.0
"""s at the end of a ride, in which a drift shows most"""
ROUGH = 1.4 * DEG
"""rad/s/√Hz: 10 °/s a sample at 50 Hz"""
FILTERS: dict[str, dict[str, Any]] = {
    "Σ2": {},
    "Σ1": {"model": "sigma1"},
    "Σ2, printed step": {"integration": "euler"},
    "Σ2, guard 0.5 °/s": {"zero_yaw_guard": 0.5 * DEG},
    "Σ2, inflated": {"pitch_rate_noise": ROUGH, "roll_rate_noise": ROUGH},
    "Σ1 with (5)": {"model": "sigma1", "constraint": True},
}
CHECKED = ("Σ2", "Σ1", "Σ2, inflated")
"""Filters whose consistency is looked at."""
ALONE, INTEGRATED, ZERO = "platform gyroscope alone", "integration", "roll 0"
FRAME = 1.0 * DEG
"""rad: white noise of the simulated camera's frames"""
SOURCES: dict[str, dict[str, Any]] = {
    "all errors": {},
    "camera: white noise only": {"camera": "white"},
    "camera: no errors": {"camera": "exact"},
    "gyroscopes: no bias": {"gyroscopes": "unbiased"},
    "gyroscopes: no errors": {"gyroscopes": "exact"},
    "gyroscopes no bias, camera white": {"gyroscopes": "unbiased", "camera": "white"},
    "no errors": {"gyroscopes": "exact", "camera": "exact"},
}
"""What is taken away from the sensors to see what makes the errors."""
PRINTED = {"θ1": "2.11 ± 0.45", "θ2": "2.62 ± 0.89", "θ3": "1.98 ± 0.75", "φ": "0.72 ± 0.22"}
"""Table I, deg."""
EARLIER = {"θ1": "2.21 ± 0.46", "θ2": "2.98 ± 0.97", "θ3": "3.46 ± 1.04", "φ": "0.61 ± 0.13"}
"""Table I: the method with force sensors that the paper compares with."""
SCENARIOS = {
    "indoor_circle": ("figures 9 to 11", "Σ2 does not drift, Σ1 does"),
    "outdoor": ("figures 12 to 14", "Σ2 does not drift, Σ1 does"),
    "pitch": ("figures 15 and 16", "φ is not significantly degraded by up to 20° of pitch"),
    "straight": ("figure 17", "stays satisfactory though the yaw rate is near zero"),
    "slalom": ("not in the paper", ""),
}


def without_errors(
    ride: Trajectory, gyroscopes: str = "recorded", camera: str = "recorded", body: str = "trunk"
) -> dict[str, np.ndarray]:
    """The samples of a ride with some errors taken away.

    Args:
        ride: with ``bicycle_imu/gyr``, ``trunk_imu/gyr`` (or ``disk/gyr``) and ``relative/orientation``.
        gyroscopes: ``recorded``, ``unbiased``, or ``exact``.
        camera: ``recorded``, ``white`` (its alignment error taken away), or ``exact``.
        body: ``trunk`` or ``disk``.
    """
    samples = dict(ride.measurements)
    tilt = RiderGeometry.of(ride.metadata).bicycle_imu_tilt
    second = "trunk_imu" if body == "trunk" else "disk"
    places = {"bicycle_imu": ("bicycle", rotation.exp(np.array([0.0, -tilt, 0.0]))), second: (body, None)}
    for place, (frame, mounted) in places.items():
        if gyroscopes == "unbiased":
            samples[f"{place}/gyr"] = samples[f"{place}/gyr"] - ride.truth[f"{place}/gyroscope_bias"]
        elif gyroscopes == "exact":
            q = ride.truth[f"{frame}/orientation"]
            turn = rotation.log(rotation.multiply(rotation.conjugate(q[:-1]), q[1:])) / ride.dt
            turn = np.concatenate([turn[:1], turn])
            samples[f"{place}/gyr"] = turn if mounted is None else rotation.rotate_back(mounted, turn)
    seen = samples["relative/orientation"]
    if camera == "white":
        alignment = rotation.exp(-ride.truth["relative/orientation_bias"])
        samples["relative/orientation"] = rotation.multiply(seen, alignment)
    elif camera == "exact":
        bicycle, other = ride.truth["bicycle/orientation"], ride.truth[f"{body}/orientation"]
        exact = rotation.multiply(rotation.conjugate(bicycle), other)
        samples["relative/orientation"] = np.where(np.isfinite(seen), exact, np.nan)
    return samples


def errors_of(pose: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Error ``(T,)`` of θ1, θ2, θ3 (if given) and φ, deg."""
    found = {}
    if "two-gyro/relative_angles" in pose:
        theta = rotation.wrap(pose["two-gyro/relative_angles"] - truth["two-gyro/relative_angles"]) / DEG
        found = {f"θ{index + 1}": theta[:, index] for index in range(3)}
    return found | {"φ": rotation.wrap(pose["bicycle/roll"] - truth["bicycle/roll"])[:, 0] / DEG}


def estimates(ride: Trajectory) -> dict[str, Estimate]:
    """Every filter on the ride as it was recorded."""
    geometry, dt = RiderGeometry.of(ride.metadata), ride.dt
    found = {
        name: KalmanFilter(TwoGyro.for_rider(geometry, dt=dt, **options)).run(ride.measurements)
        for name, options in FILTERS.items()
    }
    found[ALONE] = KalmanFilter(PlatformGyro.for_rider(geometry, dt=dt)).run(ride.measurements)
    found[INTEGRATED] = Observer(TwoGyroIntegration.for_rider(geometry, dt=dt)).run(ride.measurements)
    found[ZERO] = Estimate({"bicycle/roll": np.zeros((len(ride), 1))})
    return found


def summary(errors: Mapping[str, np.ndarray], time: np.ndarray) -> dict[str, float]:
    """RMS after the start, RMS and mean of φ at the end, peak of φ; NaN for a ride that is too short."""
    settled, end = time >= SETTLED, time >= time[-1] - DRIFTED
    if not np.any(settled):
        return {**dict.fromkeys(errors, float("nan")), "end": float("nan"), "peak": float("nan")}
    found = {name: float(np.sqrt(np.mean(error[settled] ** 2))) for name, error in errors.items()}
    found["end"] = float(np.sqrt(np.mean(errors["φ"][settled & end] ** 2)))
    return found | {"peak": float(np.abs(errors["φ"][settled]).max())}


def assess(path: Path) -> dict[str, Any]:
    """All numbers of one ride."""
    ride = load_ride(path)
    truth, time, geometry = true_angles(ride.truth), ride.time, RiderGeometry.of(ride.metadata)
    found: dict[str, Any] = {"subject": ride.metadata.get("subject"), "ended": ride.metadata.get("ended")}
    found["length"] = float(time[-1])
    rate = ride.truth["bicycle/angular_rate"][:, 2] / DEG
    found["ride"] = {
        "φ rms": float(np.sqrt(np.mean(truth["bicycle/roll"] ** 2))) / DEG,
        "χ largest": float(np.abs(truth["two-gyro/pitch"]).max()) / DEG,
        "|dψ/dt| mean": float(np.abs(rate).mean()),
    }
    every = estimates(ride)
    found["filters"] = {name: summary(errors_of(part.pose, truth), time) for name, part in every.items()}
    found["consistency"] = {name: agreement(ride, every[name], truth) for name in CHECKED}
    found["sources"] = {}
    for name, options in SOURCES.items():
        samples = without_errors(ride, **options)
        estimate = KalmanFilter(TwoGyro.for_rider(geometry, dt=ride.dt)).run(samples)
        found["sources"][name] = summary(errors_of(estimate.pose, truth), time)
    found["bound"] = efficiency(ride, truth)
    return found


def agreement(ride: Trajectory, estimate: Estimate, truth: Mapping[str, np.ndarray]) -> dict[str, float]:
    """NEES of φ and θ, and NIS, for each degree of freedom: 1 if the filter's covariance is right."""
    settled = ride.time >= min(SETTLED, 0.5 * float(ride.time[-1]))
    errors = errors_of(estimate.pose, truth)
    error = DEG * np.stack([errors[name] for name in ("φ", "θ1", "θ2", "θ3")], axis=-1)[settled]
    assert estimate.covariance is not None
    assert estimate.nis is not None
    covariance = estimate.covariance[settled][:, :4, :4]
    seen = settled & np.isfinite(ride.measurements["relative/orientation"][:, 0])
    return {
        "NEES": float(np.mean(nees(error, covariance))) / 4.0,
        "NEES of φ": float(np.mean(error[:, 0] ** 2 / covariance[:, 0, 0])),
        "NIS": float(np.mean(estimate.nis[seen])) / 3.0,
    }


def efficiency(ride: Trajectory, truth: Mapping[str, np.ndarray]) -> dict[str, list[float]]:
    """Mean squares (deg²) of achieved errors and of the bound, for φ and θ, with a camera whose noise is white.

    The bound knows white noise and drifting biases, no alignment error of the camera, so that is taken away.
    """
    model = TwoGyro.for_rider(RiderGeometry.of(ride.metadata), dt=ride.dt, orientation_noise=FRAME)
    errors = errors_of(KalmanFilter(model).run(without_errors(ride, camera="white")).pose, truth)
    exact = with_gaps(without_errors(ride, gyroscopes="exact", camera="exact"), ride.measurements)
    orientations = {name: ride.truth[name] for name in ("bicycle/orientation", "trunk/orientation")}
    covariance = posterior_bound(model, true_states(orientations, model), exact)
    settled = ride.time >= min(SETTLED, 0.5 * float(ride.time[-1]))
    variances = np.mean(np.diagonal(covariance, axis1=1, axis2=2)[settled, :4], axis=0) / DEG**2
    achieved = [float(np.mean(errors[name][settled] ** 2)) for name in ("φ", "θ1", "θ2", "θ3")]
    return {"achieved": achieved, "bound": variances.tolist()}


def rides(study: Study, report: Report) -> None:
    """Table I and the scenarios of figures 9 to 17."""
    results = {}
    once = replace(study, seeds=1)
    for scenario in SCENARIOS:
        files = (study if scenario == "indoor_circle" else once).ride_files(scenario, "two-gyro")
        results[scenario] = study.map(f"rides {scenario}", assess, [(path,) for path in files])
        if scenario == "indoor_circle":
            table_1(report, results[scenario])
            sources(report, results[scenario])
        draw(report, load_ride(files[0]), scenario)
    scenarios(report, results)
    agreements(report, results)
    report.numbers(
        [
            {
                "estimator": name,
                "trajectory": f"{scenario}-{result['subject']}-{index}",
                "quantity": quantity,
                "metric": "angle",
                "value": value,
                "unit": "deg",
            }
            for scenario, found in results.items()
            for index, result in enumerate(found)
            for name, errors in result["filters"].items()
            for quantity, value in errors.items()
        ]
    )


def table_1(report: Report, results: list[dict[str, Any]]) -> None:
    """Printed errors beside ours."""
    rows = []
    for name in (*FILTERS, ALONE, INTEGRATED, ZERO):
        for angle in ("θ1", "θ2", "θ3", "φ"):
            values = [result["filters"][name].get(angle, float("nan")) for result in results]
            if np.isfinite(values).any():
                printed = PRINTED[angle] if name == "Σ2" else None
                rows.append({"filter": name, "quantity": angle, "printed": printed, "values": values, "unit": "deg"})
    note = (
        f"RMS from {SETTLED:g} s on, indoor circle. The method with force sensors that the paper compares with: "
        + ", ".join(f"{name} {value}" for name, value in EARLIER.items())
        + ". *roll 0* says zero all the time: what any roll estimate must beat."
    )
    report.compare("Table I", rows, note, interval=DEVIATION)


def sources(report: Report, results: list[dict[str, Any]]) -> None:
    """Where the errors come from, and how far the filter is from the bound."""
    rows = []
    for name in SOURCES:
        row: dict[str, Any] = {"sensors": name}
        for angle in ("θ1", "θ2", "θ3", "φ"):
            row[angle] = round(mean([result["sources"][name][angle] for result in results]), 2)
        rows.append(row)
    report.table(
        "Where the errors come from",
        rows,
        "Mean RMS in deg of Σ2 on the same rides. *White noise only*: without the alignment error of the camera's "
        "marker (1° fixed and 1° drifting with 60 s, which this environment assumes; the paper gives nothing). It "
        "passes to the roll, since a rider's trunk hardly moves against the bicycle; no tuning tells the two apart.",
    )
    achieved, bound = (np.mean([result["bound"][key] for result in results], axis=0) for key in ("achieved", "bound"))
    report.table(
        "Achieved errors beside the bound",
        [
            {
                "angle": name,
                "achieved RMS, deg": round(float(np.sqrt(one)), 3),
                "bound, deg": round(float(np.sqrt(two)), 3),
                "efficiency (bound / achieved)": round(float(np.sqrt(two / one)), 2),
            }
            for name, one, two in zip(("φ", "θ1", "θ2", "θ3"), achieved, bound, strict=True)
        ],
        "Posterior Cramér–Rao bound along the same rides, with the sensors' noises but a camera without alignment "
        "error, and the filter (told 1° a frame) on such samples.",
    )


def scenarios(report: Report, results: dict[str, list[dict[str, Any]]]) -> None:
    """Roll errors of all scenarios."""
    rows = []
    for scenario, found in results.items():
        figures, claim = SCENARIOS[scenario]
        about = {name: mean([result["ride"][name] for result in found]) for name in found[0]["ride"]}
        fell = sum(result["ended"] == "terminated" for result in found)
        for name in (*FILTERS, ALONE, INTEGRATED, ZERO):
            part = [result["filters"][name] for result in found]
            rows.append(
                {
                    "scenario": scenario,
                    "filter": name,
                    "φ": round(mean([errors["φ"] for errors in part]), 2),
                    f"φ, last {DRIFTED:g} s": round(mean([errors["end"] for errors in part]), 2),
                    "peak of φ": round(mean([errors["peak"] for errors in part]), 1),
                    "θ, mean of three": round(
                        mean([errors.get(f"θ{i}", np.nan) for errors in part for i in (1, 2, 3)]), 2
                    ),
                }
            )
        report.text(
            f"**{scenario}** ({figures}{': ' + claim if claim else ''}): {len(found)} rides, {fell} ended early; "
            f"roll {about['φ rms']:.1f}° RMS, pitch up to {about['χ largest']:.1f}°, "
            f"yaw rate {about['|dψ/dt| mean']:.0f} °/s."
        )
    report.table(
        "Roll in all scenarios",
        rows,
        f"Mean RMS over rides in deg, from {SETTLED:g} s on; one ride of each rider outside of the indoor circle. "
        "*Σ1 with (5)* takes the roll from the platform's gyroscope as the reference does, and the trunk from Σ1.",
    )


def agreements(report: Report, results: dict[str, list[dict[str, Any]]]) -> None:
    """NEES and NIS with the papers' sensors."""
    rows = [
        {"scenario": scenario, "filter": name}
        | {
            key: round(mean([result["consistency"][name][key] for result in found]), 2)
            for key in ("NEES", "NEES of φ", "NIS")
        }
        for scenario, found in results.items()
        for name in CHECKED
    ]
    report.table(
        "Consistency with the papers' sensors",
        rows,
        "Per degree of freedom; 1 if the filter's covariance is right. It knows 2° of white camera noise where there "
        "is 1° of it and an alignment error: on flat ground NIS is below 1, and NEES above it.",
    )


def draw(report: Report, ride: Trajectory, scenario: str) -> None:
    """One ride: roll and relative angles, true and estimated."""
    from ...plots import new_figure

    truth, every = true_angles(ride.truth), estimates(ride)
    figure, axes = new_figure(7.5, 10.0, 5)
    colours = {"Σ2": "#1f5fa8", "Σ1": "#c2571a", INTEGRATED: "#b08d1a", ALONE: "#2c8c5a"}
    axes[0].plot(ride.time, truth["bicycle/roll"] / DEG, color="black", linewidth=1.2, label="true")
    for name in ("Σ2", "Σ1", ALONE):
        axes[0].plot(ride.time, every[name].pose["bicycle/roll"] / DEG, color=colours[name], linewidth=0.9, label=name)
        error = errors_of(every[name].pose, truth)["φ"]
        axes[1].plot(ride.time, error, color=colours[name], linewidth=0.9, label=name)
    axes[0].set(ylabel="φ, deg", title=f"{scenario}, rider {ride.metadata.get('subject')}")
    axes[1].plot(ride.time, truth["two-gyro/pitch"] / DEG, color="#6d737c", linewidth=0.8, label="pitch")
    axes[1].set(ylabel="error of φ, deg")
    for index, ax in enumerate(axes[2:]):
        ax.plot(
            ride.time, truth["two-gyro/relative_angles"][:, index] / DEG, color="black", linewidth=1.2, label="true"
        )
        for name in ("Σ2", INTEGRATED):
            theta = every[name].pose["two-gyro/relative_angles"][:, index] / DEG
            ax.plot(ride.time, theta, color=colours[name], linewidth=0.9, label=name)
        ax.set(ylabel=f"θ{index + 1}, deg")
    for ax in axes[:3]:
        ax.legend(frameon=False, ncols=4, loc="upper right", fontsize=8)
    axes[-1].set_xlabel("time, s")
    report.figure(f"ride-{scenario}", figure, f"{scenario}: {SCENARIOS[scenario][0]}", SCENARIOS[scenario][1])


def mean(values: list[float]) -> float:
    """Mean of what is known."""
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")
