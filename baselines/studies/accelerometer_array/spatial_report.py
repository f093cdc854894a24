"""Chapter 5 of the thesis on the game controller, beside ours: orientation of controller and OCTA."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...plots import new_figure
from ..kit import Study
from ..report import OVER_MOTIONS, Report
from . import spatial as spatial_study
from .spatial import STEEP, attitude_curves, attitude_errors, attitude_table, cone, wrong_start

QUICK_OCTA = (
    "proposed, sound, with gyroscope",
    "proposed, sound, no gyroscope",
    "integration of the array's rate",
    "Marins, σ_q = 0.01, array's rate",
)
STEEP_WAYS = (spatial_study.PROPOSED, "Marins, σ_q = 0.5", "Marins, σ_q = 0.01")
LINES = ("#1f5fa8", "#c2571a", "#2c8c5a", "#b08d1a", "#7a4fa3", "#6d737c", "#b03060")
FIGURES = {"controller": ("5.6 and 5.7", "5.8"), "octa": ("5.9 and 5.10", "5.11")}
PRINTED = {
    ("controller", "proposed, sound"): "within ±3",
    ("octa", "proposed, sound, with gyroscope"): None,
    ("octa", "proposed, sound, no gyroscope"): "within ±3",
}


def spatial(study: Study, report: Report) -> None:
    """Tables and figures of the pointing simulation."""
    seeds, duration = (2, 30.0) if study.quick else (10, spatial_study.DURATION)
    roots = [study.seed_of("pointing", index) for index in range(seeds)]
    jobs: list[tuple[Any, ...]] = [("controller", seed, duration, 0.0, ()) for seed in roots]
    jobs += [("octa", seed, duration, 0.0, QUICK_OCTA if study.quick else ()) for seed in roots]
    rows = [row for found in study.map("pointing", attitude_errors, jobs) for row in found]
    compared = []
    for (device, way), printed in PRINTED.items():
        found = [row for row in rows if row["device"] == device and row["way"] == way]
        for angle in ("pitch", "azimuth"):
            for key, label, says in ((f"{angle}_max", "largest error", printed), (angle, "rms error", None)):
                values = [row[key] for row in found]
                compared.append(
                    {"device": device, "method": way, "quantity": f"{angle}, {label}", "printed": says}
                    | {"values": values, "unit": "deg"}
                )
    report.compare(
        "Figures 5.6 to 5.10 and Table 5.1, simulation: the proposed method",
        compared,
        f"{seeds} motions of {duration:g} s. With the exact transition and the "
        "nearest "
        "rotation the ±3° of the figures come back for the controller and for OCTA with a gyroscope. OCTA without "
        "gyroscope does not reach ±3° at σ_a = 0.1 g, in any form and with any noise tried.",
        interval=OVER_MOTIONS,
    )
    report.table(
        "Figures 5.6 to 5.10: every method",
        attitude_table(rows),
        "Degrees: rms means over the motions, the largest error over all of them, the share of samples within ±3° in "
        "pitch and azimuth, and the rms error of the whole rotation, which the thesis does not show. Tilt sensor and a "
        "Marins filter that believes its first step are as bad as in the thesis; weighted by the acceleration "
        "(σ_q = 0.5) Marins rivals the proposed filter on this horizontal field. A wrong sign of F hides behind a "
        "gyroscope and is fatal without; the printed sign of gravity tips over after some tens of seconds.",
    )
    _inclined(study, report, roots[: 2 if study.quick else 5], duration)
    for device in FIGURES:
        curves = study.cached(f"pointing curves {device}", attitude_curves, device, roots[0], duration)
        _figures(report, device, curves)


def _inclined(study: Study, report: Report, roots: list[int], duration: float) -> None:
    """A steep field, a wrong start, and the cone (5.63)."""
    jobs = [("controller", seed, duration, STEEP, STEEP_WAYS) for seed in roots]
    rows = [row for found in study.map("pointing, steep field", attitude_errors, jobs) for row in found]
    report.table(
        "Inclined field, 70° below the horizon",
        attitude_table(rows),
        "Not in the thesis. A horizontal field makes pitch and azimuth nearly directly visible and hides errors "
        "of roll. "
        "In a steep one Marins keeps a bias, as it splits the disagreement of two nearly antiparallel vectors.",
    )
    starts = study.map("wrong start", wrong_start, [(seed,) for seed in roots])
    labels = [label for label in starts[0] if label != "seed"]
    report.table(
        "Start rolled by 40°",
        [
            {
                "filter": label,
                "5 to 20 s": float(np.mean([found[label][0] for found in starts])),
                "last 20 of 60 s": float(np.mean([found[label][1] for found in starts])),
            }
            for label in labels
        ],
        "Total error in degrees, rms, means over the motions. Gravity is weak information at σ_b = 5 m/s²: initialise "
        "well, or open the prior (`orientation_prior=1`).",
    )
    shares = study.map("cone", cone, [(seed, duration) for seed in roots])
    report.table(
        "Figure 5.22: share of samples beyond the cone (5.63)",
        [{"bound": name, "share": float(np.mean([found[name] for found in shares]))} for name in shares[0]],
        "For one reading the right bound is the arcsine; the thesis prints the arctangent. A filter has memory "
        "and lags, "
        "so neither is strict, not even for the tilt variant.",
    )


def _figures(report: Report, device: str, curves: dict[str, Any]) -> None:
    errors_name, path_name = FIGURES[device]
    figure, axes = new_figure(7.5, 7.0, 4)
    time = curves["time"]
    for row, (angle, true) in enumerate((("pitch", curves["pitch"]), ("azimuth", curves["azimuth"]))):
        top, below = axes[2 * row], axes[2 * row + 1]
        top.plot(time, true, color="black", linewidth=1.0, label="true")
        top.plot(time, curves["found"][row], color=LINES[0], linewidth=1.0, linestyle="--", label="proposed")
        top.set_ylabel(f"{angle}, °")
        drawn = list(zip(LINES, curves["errors"].items(), strict=False))
        for place, (colour, (name, both)) in enumerate(drawn):
            first = place == 0
            style: dict[str, Any] = {"linewidth": 1.4 if first else 0.8, "alpha": 1.0 if first else 0.65}
            below.plot(time, both[row], color=colour, label=name, zorder=3 if first else 2, **style)
        below.set_ylim(-30.0, 30.0)
        below.set_ylabel(f"error of {angle}, °")
    axes[0].legend(loc="upper right", fontsize=7, ncols=2)
    figure.legend(*axes[1].get_legend_handles_labels(), loc="outside lower center", fontsize=7.5, ncols=3)
    axes[-1].set_xlabel("time, s")
    report.figure(
        f"pointing-{device}",
        figure,
        f"Figures {errors_name}: pitch and azimuth of the {device}",
        "Errors beyond 30° are cut.",
    )
    figure, (ax,) = new_figure(5.0, 4.6)
    limit = math.degrees(math.pi / 4.0)
    ax.plot([-limit, limit, limit, -limit, -limit], [-limit, -limit, limit, limit, -limit], "k:", linewidth=0.8)
    ax.plot(curves["azimuth"], curves["pitch"], color="black", linewidth=0.9, label="true")
    ax.plot(curves["found"][1], curves["found"][0], color=LINES[0], linewidth=0.9, linestyle="--", label="proposed")
    ax.set_xlabel("azimuth, °")
    ax.set_ylabel("pitch, °")
    ax.set_aspect("equal")
    ax.legend(loc="upper right", fontsize=8)
    report.figure(
        f"path-{device}", figure, f"Figure {path_name}: where the {device} points", "Dotted: targets' limits."
    )
