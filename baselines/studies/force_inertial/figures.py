"""Figures 6, 8, 10 and 11 of the force/inertial paper, and its table I beside what is simulated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ....envs.bicycle.sensors.devices import (
    DRIFT_TIME,
    LOAD_CELL,
    MODEL_605_ACCELEROMETER,
    MODEL_605_GYROSCOPE,
    SEAT_WRENCH,
    STRAIN_GAUGES,
)
from ....filters.bicycle.force_inertial.filter import ForceInertial
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.core.quantity import DEG, STANDARD_GRAVITY
from ...plots import TRUTH_COLOR, legend_above, time_figure
from ..claims import Claim
from ..report import Report
from ..ride_figures import DRAWN, offset_shares, ride_figure, spread_claims, spread_figure
from ..ride_study import RideStudy, Variant
from .states import from_the_truth, smoothed_torques

WRONG = (35.0, -35.0)
"""deg: φ_h at the start is off by so much"""


def course_figures(
    study: RideStudy, report: Report, paths: Sequence[Path], results: list[dict[str, Any]], course: str
) -> list[Claim]:
    """Figures 6, 8, 10 and 11 of a course; returns what figure 8 says."""
    angles = list(study.angles)
    ride_figure(study, report, paths[0], f"Figure 6: angles of one ride, {course}")
    if len(results) > 1:
        report.figure(f"figure-8-{course}", spread_figure(results, angles), f"Figure 8: errors over time, {course}")
    report.figure(f"figure-10-{course}", convergence_figure(study, paths[0]), f"Figure 10: wrong starts, {course}")
    report.figure(
        f"figure-11-{course}", torque_figure(study, paths[0]), f"Figure 11: torques over time, {course}", TORQUE
    )
    if len(results) < 2:
        return []
    worst, ours, exact = offset_shares(results, angles, study.followed[0])
    statement = f"Exact sensors leave more than half of the mean error of {worst}: the rider makes it"
    return [*spread_claims(results, angles, "Figure 8"), Claim.less(statement, ours, exact, factor=2.0)]


TORQUE = "At the true pose, smoothed over 0.2 s: what seat and hands read, and what both models require."


def convergence_figure(study: RideStudy, path: Path) -> Any:
    """φ_h over the first 8 s, true and estimated from starts that are wrong by more than 30°."""
    ride = study.load(path)
    samples = {channel.name: ride.measurements[channel.name] for channel in ForceInertial.channels}
    truth, kalman = dict(study.truth(ride.truth)), study.estimator(ride, Variant())
    figure, (ax,) = time_figure(7.5, 3.0)
    shown = ride.time[1:] - ride.time[0] <= 8.0
    time = ride.time[1:][shown]
    true = truth["force-inertial/trunk_angles"][1:, 0][shown] / DEG
    ax.plot(time, true, color=TRUTH_COLOR, linewidth=1.2, label="truth")
    for off, color in zip(WRONG, DRAWN[1::2], strict=True):
        pose = from_the_truth(kalman, samples, truth, off * DEG)
        found = pose["force-inertial/trunk_angles"][:, 0][shown] / DEG
        # the wrong start itself, before the first update
        ax.plot([ride.time[0], *time], [true[0] + off, *found], color=color, linewidth=0.9, label=f"start {off:+g}°")
    ax.set(ylabel="φ_h, deg")
    legend_above(ax)
    return figure


def torque_figure(study: RideStudy, path: Path) -> Any:
    """Both torques over 15 s: read, dynamic and static model."""
    ride = study.load(path)
    samples = {channel.name: ride.measurements[channel.name] for channel in ForceInertial.channels}
    model = study.estimator(ride, Variant()).model
    named = smoothed_torques(model, samples, dict(study.truth(ride.truth)))
    figure, axes = time_figure(7.5, 4.6, 2)
    start = min(5.0, 0.25 * float(ride.time[-1]))
    # averages over 0.2 s do not reach to the end
    part = (ride.time >= start) & (ride.time <= min(start + 15.0, ride.time[-1] - 0.2))
    colors = {"read": TRUTH_COLOR, "static": DRAWN[1], "dynamic": DRAWN[-1]}
    for index, (ax, label) in enumerate(zip(axes, ("τ_φh, N·m", "τ_θ, N·m"), strict=True)):
        for name, color in colors.items():
            width = 1.2 if name == "read" else 0.9
            ax.plot(ride.time[part], named[name][part, index], color=color, linewidth=width, label=name)
        ax.set_ylabel(label)
        legend_above(ax)
    return figure


RATE = 50.0
"""Hz, section II-A"""


def table_i(report: Report) -> None:
    """Published parameters beside those of the simulated bicycle, and the noises, which the paper does not give."""
    own = RiderGeometry()
    lengths: tuple[tuple[str, float | None, float | None], ...] = (
        ("α, deg", 10.0, own.bicycle_imu_tilt / DEG),
        ("γ, deg", 20.0, own.post_tilt / DEG),
        ("g, m/s²", 9.8, STANDARD_GRAVITY),
        ("l_s, m", 0.26, own.saddle[0]),
        ("h_s, m", 0.38, own.saddle[2]),
        ("l_b, m", 0.45, None),
        ("h_b, m", 0.66, None),
        ("p_x, m", 0.37, own.bicycle_imu[0]),
        ("p_z, m", 0.71, own.bicycle_imu[2]),
        ("L_1, m", 0.13, own.post_length),
        ("L_x, m", 0.20, own.cells_long),
        ("L_y, m", 0.12, own.cells_wide),
        ("L_m, m", 0.043, own.cells_behind),
        ("τ, s", 1800.0, DRIFT_TIME),
    )
    root = math.sqrt(RATE)
    noises = (
        ("gyroscopes, °/s a sample", None, MODEL_605_GYROSCOPE.noise.white_noise * root / DEG),
        ("σ of the gyroscopes' bias, °/s", None, MODEL_605_GYROSCOPE.noise.bias_instability / DEG),
        ("accelerometers, m/s² a sample", None, MODEL_605_ACCELEROMETER.noise.white_noise * root),
        ("seat force, N a sample", None, SEAT_WRENCH.noise.white_noise * root),
        ("zero of the seat force, N", None, SEAT_WRENCH.noise.turn_on_bias),
        ("load cells, N a sample", None, LOAD_CELL.noise.white_noise * root),
        ("handlebar force, N a sample", None, STRAIN_GAUGES.noise.white_noise * root),
        ("zero of the handlebar force, N", None, STRAIN_GAUGES.noise.turn_on_bias),
    )
    rows = [
        {"parameter": name, "published": published, "simulated": None if ours is None else float(f"{ours:.3g}")}
        for name, published, ours in (*lengths, *noises)
    ]
    note = (
        "l_b and h_b, the place of the bicycle's centre of mass, enter no equation of the filter. The published saddle "
        "is lower than the unit on the frame (h_s below p_z); the simulated one is where a rider can sit. The paper "
        "gives none of the noises; those here are standard deviations of the simulated sensors."
    )
    report.table("Table I: parameters", rows, note)
