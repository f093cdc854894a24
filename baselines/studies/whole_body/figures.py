"""Figures 8, 10 and 11 of the whole-body paper, and its table I beside the simulated sensors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....envs.bicycle.sensors.devices import MODEL_605_ACCELEROMETER, MODEL_605_GYROSCOPE, SLIM_GYROSCOPE, Device
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.whole_body.filter import WholeBody
from ....filters.bicycle.whole_body.linkage import true_angles
from ....filters.core.quantity import DEG, STANDARD_GRAVITY
from ...plots import TRUTH_COLOR, legend_above, new_figure, time_figure
from ..report import Report
from ..ride_figures import DRAWN, draw_angle, true_angle
from ..ride_study import SPACING, RideStudy, Variant

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = ("φ", "θ2", "φr2", "αr", "ψr1", "βr")
"""Angles of figures 6 and 8"""
CONSTRAINTS = ("C1", "C2", "C3")
UNITS: tuple[tuple[str, Device, float, str, tuple[str, str, str, str]], ...] = (
    ("605 gyroscope", MODEL_605_GYROSCOPE, DEG, "°/s", ("< 0.007", "100 Hz", "< 1", "0.05")),
    (
        "605 accelerometer",
        MODEL_605_ACCELEROMETER,
        1e-3 * STANDARD_GRAVITY,
        "mg",
        ("< 0.08", "100 Hz", "< 15", "< 0.1"),
    ),
    ("slimAHRS gyroscope", SLIM_GYROSCOPE, DEG, "°/s", ("< 0.1", "40 Hz", "0.056 (200 °/h)", "–")),
)
"""Sensor, its simulated errors, unit in SI, its name; published resolution, bandwidth, bias and noise density"""
COLUMNS = ("resolution", "bandwidth", "bias", "density (/√Hz)")


def table_i(report: Report) -> None:
    """Specifications of the inertial sensors as published, and what is simulated."""
    rows = []
    for name, device, unit, label, published in UNITS:
        noise = device.noise
        bias = max(noise.bias_instability, noise.turn_on_bias) / unit
        ours = (
            f"{noise.resolution / unit:.2g}",
            f"{noise.bandwidth:g} Hz",
            f"{bias:.2g}",
            f"{noise.white_noise / unit:.2g}",
        )
        for source, values in (("published", published), ("simulated", ours)):
            rows.append({"sensor": name, "unit": label, "source": source, **dict(zip(COLUMNS, values, strict=True))})
    note = (
        "Simulated biases are standard deviations: of the accelerometer a third of the published limit, of the 605 "
        "gyroscope what drifts after its offset was measured at rest, as force-inertial (14) says. The density of the "
        "slimAHRS gyroscope is not published."
    )
    report.table("Table I: inertial sensors", rows, note)


def table_ii(report: Report) -> None:
    """Parameters of the model as published, and what is simulated or assumed by the filter."""
    own, model = RiderGeometry(), WholeBody.for_rider(RiderGeometry())
    rows = (
        ("ξ, deg", 10.0, own.bicycle_imu_tilt / DEG),
        ("p_x, m", 0.37, own.bicycle_imu[0]),
        ("p_y, m", 0.71, own.bicycle_imu[2]),
        ("g, m/s²", 9.8, model.gravity),
        ("γ, deg", 80.0, own.ankle_angle / DEG),
        ("τ_ϑ, s", 1.0, model.yaw_acceleration_time),
        ("τ_x, τ_y, τ_z, s", 1.0, model.relative_acceleration_time),
    )
    named = [{"parameter": name, "published": value, "here": float(f"{ours:.4g}")} for name, value, ours in rows]
    report.table(
        "Table II: parameters of the model", named, "Lengths of the riders are not published; see the geometry."
    )


def residual_figure(results: Sequence[dict[str, Any]]) -> Figure:
    """Figure 10: sizes of the right arm's constraint residuals over time, mean and deviation over rides."""
    figure, axes = new_figure(7.5, 5.0, 3)
    length = min(len(each["residuals"]["C1"]) for each in results)
    time = SPACING * np.arange(length)
    for ax, name in zip(axes, CONSTRAINTS, strict=True):
        values = np.abs([each["residuals"][name][:length] for each in results])
        # nothing is known before the first sample
        mean = values.mean(axis=0)
        ax.plot(time, mean, color=DRAWN[-1], linewidth=0.9)
        if len(values) > 1:
            ax.plot(time, mean + values.std(axis=0, ddof=1), "--", color=DRAWN[-1], linewidth=0.7)
        ax.set(ylabel=f"|{name}|", ylim=(0.0, None))
        if name == "C2":
            ax.axhline(0.05, color=TRUTH_COLOR, linewidth=0.7, linestyle=":")
    axes[-1].set_xlabel(
        "time, s (solid: mean over rides, dashed: plus one standard deviation, dotted: 0.05 of the paper)"
    )
    return figure


def bump_figure(study: RideStudy, path: Path, unguarded: Variant) -> Figure:
    """Figure 11: vertical accelerometer of the bicycle over two bumps, and θ2 with and without the shock guard."""
    ride = study.load(path)
    truth = true_angles(ride.truth)
    first = next(iter(study.variants.values()))
    errors = {
        name: study.errors(study.estimate(ride, variant).pose, truth)["θ2"]
        for name, variant in (("without guard", unguarded), ("filter", first))
    }
    figure, (top, below) = time_figure(7.5, 4.2, 2)
    top.plot(ride.time, ride.measurements["bicycle_imu/acc"][:, 2] / STANDARD_GRAVITY, color=DRAWN[-1], linewidth=0.7)
    top.set_ylabel("accelerometer\nup, g", fontsize=8.5)
    draw_angle(below, ride.time, true_angle(study, truth, "θ2"), errors, "θ2")
    legend_above(below)
    return figure
