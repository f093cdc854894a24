"""Chapter 2 of the thesis on the game controller, beside ours: angular rate of an array without a gyroscope."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...plots import new_figure
from ..kit import Study
from ..report import OVER_MOTIONS, Report
from .rate import CALIBRATED, DURATION, ERRORS, PRINTED, rate_curves, rate_errors, rate_table, weight_table

NAMES = {
    "weighted, sound": "weighted",
    "weighted, sound, with biases": None,
    "Parsa": "parsa",
    "polynomial roots": "polynomial-roots",
}
"""Way of the study → key of the printed table"""


def angular_rates(study: Study, report: Report) -> None:
    """Table 2.1 and Figures 2.9 to 2.13."""
    seeds, duration = (2, 40.0) if study.quick else (10, DURATION)
    errors = [CALIBRATED, next(iter(ERRORS))] if study.quick else list(ERRORS)
    jobs = [(study.seed_of("shaking", index), kind, duration) for kind in errors for index in range(seeds)]
    rows = [row for found in study.map("angular rate", rate_errors, jobs) for row in found]
    compared: list[dict[str, Any]] = []
    for way, key in NAMES.items():
        ours = [row["rms"] for row in rows if row["way"] == way and row["errors"] == CALIBRATED]
        compared.append(
            {
                "method": way,
                "quantity": "rms of |ω̂ − ω|",
                "printed": None if key is None else mean_and_range(PRINTED[key]),
                "values": ours,
                "unit": "rad/s",
            }
        )
    report.compare(
        "Table 2.1: angular rate of a shaken OCTA",
        compared,
        f"Printed: mean and range of six runs of the real device. Ours: {seeds} simulated motions of {duration:g} "
        "s with "
        f"the errors *{CALIBRATED}* that a calibration leaves. The ranking is the thesis'. Its size needs such errors: "
        "the white noise of the data sheet alone gives a twentieth of it (next table).",
        interval=OVER_MOTIONS,
    )
    table = [{"errors": row["errors"]} | {k: v for k, v in row.items() if k != "errors"} for row in rate_table(rows)]
    report.table(
        "Angular rate by method and errors",
        table,
        "Rms in rad/s: mean, smallest and largest over the motions. *As printed* and *corrected* evaluate the "
        "Jacobian at "
        "the polynomial roots, *sound* at the integrated rate; *with biases* estimates constant errors too and is "
        "ours.",
    )
    report.table(
        "Figures 2.12 and 2.13: mean weight of the integration by angular rate",
        weight_table(rows),
        "All weights are near one, as in Figure 2.12. That they grow with the rate (Figure 2.13) does not come "
        "back: in "
        "the sound form they fall, as a covariance of the roots that goes with 1/|ω|² demands.",
    )
    curves = study.cached("angular rate curves", rate_curves, study.seed_of("shaking", 0))
    figure, (top, below) = new_figure(7.5, 4.6, 2)
    time = curves["time"]
    top.plot(time, curves["true"], color="black", linewidth=2.2, alpha=0.6, label="true")
    for name, values in curves.items():
        if name not in ("time", "true", "weight"):
            top.plot(time, values, linewidth=0.8, label=name)
    limit = 1.8 * float(np.abs(curves["true"]).max())
    top.set_ylim(-limit, limit)
    top.set_ylabel("ω_x, rad/s")
    top.legend(fontsize=6.5, ncols=3, loc="upper right")
    below.plot(time, curves["weight"], color="#1f5fa8", linewidth=0.8)
    below.set_ylabel("weight w_x")
    below.set_ylim(0.0, 1.05)
    below.set_xlabel("time, s")
    report.figure(
        "angular-rate",
        figure,
        "Figures 2.9 to 2.12: angular rate and weights",
        "Integration drifts, polynomial roots and Parsa take the wrong sign at times; the weighted method does not.",
    )


def mean_and_range(values: Sequence[float]) -> str:
    """Printed numbers in short."""
    return f"{np.mean(values):.2f} ({min(values):.2f} … {max(values):.2f})"
