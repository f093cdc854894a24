"""Chapter 3 of the thesis on the game controller, beside ours: orientation in a vertical plane."""

from __future__ import annotations

from typing import Any

from ...plots import new_figure
from ..kit import Study
from ..report import OVER_MOTIONS, Report
from . import planar as planar_study
from .planar import MOTIONS, inflation_errors, planar_curves, planar_errors, planar_table, unscented_difference

PRINTED: tuple[tuple[str, str, str, str], ...] = (
    ("planar-walk", "time integration", "largest error (°)", "about 50 (Fig. 3.5)"),
    ("planar-walk", "extended filter", "largest error (°)", "about 10 (Fig. 3.6)"),
    ("planar-walk", "linear filter, literal", "largest error (°)", "200 (Fig. 3.12)"),
    ("infinity", "time integration", "largest error (°)", "drifts (Fig. 3.9)"),
    ("infinity", "extended filter", "largest error (°)", "about 10 (Fig. 3.10)"),
)
SHOWN = ("time integration", "tilt", "extended filter", "complete pose, thesis", "mean, wrapped difference")


def planar(study: Study, report: Report) -> None:
    """Figures 3.5 to 3.15."""
    seeds, duration = (2, 30.0) if study.quick else (10, planar_study.DURATION)
    roots = [study.seed_of("planar", index) for index in range(seeds)]
    jobs = [(seed, motion, duration) for motion in MOTIONS for seed in roots]
    rows = [row for found in study.map("planar", planar_errors, jobs) for row in found]
    compared: list[dict[str, Any]] = []
    for motion, way, quantity, printed in PRINTED:
        values = [row["largest"] for row in rows if row["motion"] == motion and row["way"] == way]
        compared.append(
            {"motion": motion, "method": way, "quantity": quantity, "printed": printed, "values": values, "unit": "deg"}
        )
    report.compare(
        "Figures 3.5 to 3.12: errors of the angle in the plane",
        compared,
        f"{seeds} motions of {duration:g} s. The extended filter stays within 10° in most samples, which is no bound.",
        interval=OVER_MOTIONS,
    )
    report.table(
        "Planar methods",
        planar_table(rows),
        "Mean and linear filter fail as in the thesis only where raw angles are averaged: with the wrapped "
        "difference they "
        "come near the extended filter, so it is the wrap and not linearity. The complete pose of the thesis is poor, "
        "as it finds: nothing in its model tells acceleration from gravity, so the angle is integrated and drifts, on "
        "the ∞ more so with the printed R (3.44) or H (3.45). Where the acceleration is expected to return to zero "
        "(last row, ours) it is the best on the ∞, without a gyroscope.",
    )
    found = study.map("planar inflation", inflation_errors, [(seed, duration) for seed in roots])
    report.table(
        "Extended filter on the ∞ by R",
        planar_table([row for part in found for row in part], "R"),
        "R in (m/s²)². The acceleration of a figure is correlated, which wants a larger R than its variance.",
    )
    difference = study.cached("unscented", unscented_difference, roots[0], "planar-walk")
    report.text(f"Unscented and extended filter differ by {difference:.1e}° at most (thesis: about equal, Fig. 3.12).")
    for motion, number in (("planar-walk", "3.5 and 3.6"), ("infinity", "3.9 and 3.10")):
        curves = study.cached(f"planar curves {motion}", planar_curves, roots[0], motion, duration)
        figure, (ax,) = new_figure(7.5, 3.2)
        for name in SHOWN:
            faint = name == "tilt"
            style: dict[str, Any] = {"linewidth": 0.5 if faint else 1.0, "alpha": 0.4 if faint else 1.0}
            ax.plot(curves["time"], curves[name], label=name, zorder=1 if faint else 2, **style)
        ax.set_ylim(-60.0, 60.0)
        ax.set_xlabel("time, s")
        ax.set_ylabel("error of the angle, °")
        figure.legend(fontsize=7.5, ncols=3, loc="outside lower center")
        report.figure(f"planar-{motion}", figure, f"Figures {number}: errors on {motion}", "Errors beyond 60° are cut.")
