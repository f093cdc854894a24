"""Figures 6, 8, 10 and 11 of the force/inertial paper."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ....filters.bicycle.force_inertial.filter import ForceInertial
from ....filters.core.quantity import DEG
from ...plots import TRUTH_COLOR, legend_above, new_figure
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


def convergence_figure(study: RideStudy, path: Path, seconds: float = 8.0) -> Any:
    """φ_h over the first seconds, true and estimated from starts that are wrong by more than 30°."""
    ride = study.load(path)
    samples = {channel.name: ride.measurements[channel.name] for channel in ForceInertial.channels}
    truth, kalman = dict(study.truth(ride.truth)), study.estimator(ride, Variant())
    figure, (ax,) = new_figure(7.5, 3.0)
    shown = ride.time[1:] - ride.time[0] <= seconds
    time = ride.time[1:][shown]
    true = truth["force-inertial/trunk_angles"][1:, 0][shown] / DEG
    ax.plot(time, true, color=TRUTH_COLOR, linewidth=1.2, label="truth")
    for off, color in zip(WRONG, DRAWN[1::2], strict=True):
        pose = from_the_truth(kalman, samples, truth, off * DEG)
        found = pose["force-inertial/trunk_angles"][:, 0][shown] / DEG
        # the wrong start itself, before the first update
        ax.plot([ride.time[0], *time], [true[0] + off, *found], color=color, linewidth=0.9, label=f"start {off:+g}°")
    ax.set(xlabel="time, s", ylabel="φ_h, deg")
    legend_above(ax)
    return figure


def torque_figure(study: RideStudy, path: Path, begin: float = 5.0, seconds: float = 15.0) -> Any:
    """Both torques: read, dynamic and static model."""
    ride = study.load(path)
    samples = {channel.name: ride.measurements[channel.name] for channel in ForceInertial.channels}
    model = study.estimator(ride, Variant()).model
    named = smoothed_torques(model, samples, dict(study.truth(ride.truth)))
    figure, axes = new_figure(7.5, 4.6, 2)
    start = min(begin, 0.25 * float(ride.time[-1]))
    # averages over 0.2 s do not reach to the end
    part = (ride.time >= start) & (ride.time <= min(start + seconds, ride.time[-1] - 0.2))
    colors = {"read": TRUTH_COLOR, "static": DRAWN[1], "dynamic": DRAWN[-1]}
    for index, (ax, label) in enumerate(zip(axes, ("τ_φh, N·m", "τ_θ, N·m"), strict=True)):
        for name, color in colors.items():
            width = 1.2 if name == "read" else 0.9
            ax.plot(ride.time[part], named[name][part, index], color=color, linewidth=width, label=name)
        ax.set_ylabel(label)
        legend_above(ax)
    axes[-1].set_xlabel("time, s")
    return figure
