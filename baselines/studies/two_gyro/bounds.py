"""Figure 4 and section IV of the two-gyroscope paper: posterior Cramér–Rao bounds of the roll, and observability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from ....filters.analysis.bounds import posterior_bound
from ....filters.analysis.observability import trajectory_observability
from ....filters.bicycle.two_gyro.truth import true_states
from ....filters.core.quantity import DEG
from ...plots import BLUE, GREEN, GREY, VERMILION, legend_above, time_figure
from ..claims import Claim
from ..kit import Study
from ..report import Report
from .motion import MOTIONS, Errors, Motion, filter_of, simulate, turning

DT = 0.02
"""s"""
STUDY = Errors(bias=0.1 * DEG)
"""0.1 °/s a gyroscope sample, 1° a frame at every sample, biases of 0.1 °/s; the paper gives no numbers"""
TIMES = (2, 5, 10, 20, 60, 120)
"""s"""
YAW_RATES = (5.0, 10.0, 15.0, 20.0)
"""°/s, figure 4(c)"""
SETTINGS = {
    "biases 0.1 °/s, moving body": STUDY,
    "biases 0.1 °/s, still body": STUDY,
    "biases known": replace(STUDY, bias=1e-6 * DEG, bias_drift=1e-6 * DEG),
    "biases known, body gyroscope 0.02 °/s": replace(
        STUDY, bias=1e-6 * DEG, bias_drift=1e-6 * DEG, body_gyroscope=0.02 * DEG
    ),
}
"""Settings of figure 4(c), which hold the paper's claim or not."""
UNSEEN, MOTION = "unobservable", "motion of 40 s"
Model = Literal["sigma1", "sigma2"]
NAMES: dict[str, Model] = {"Σ2": "sigma2", "Σ1": "sigma1"}


def bound(motion: Motion, model: Model, duration: float, errors: Errors = STUDY) -> np.ndarray:
    """Bounds ``(T, 4)`` on the standard deviations of φ and θ, deg."""
    equations = filter_of(errors, DT, model)
    ride = simulate(motion, duration, DT)
    covariance = posterior_bound(equations, true_states(ride.truth, equations), ride.measurements)
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)[:, :4]) / DEG


def moved(rate: float, still: bool) -> Motion:
    """A steady turn at ``rate`` (°/s), with a body that moves or does not."""
    return replace(MOTIONS["frozen"], yaw=turning(rate * DEG).yaw) if still else turning(rate * DEG)


def at(values: np.ndarray, times: Sequence[float]) -> list[float]:
    """Values at times, s."""
    return [float(values[round(time / DT)]) for time in times]


def bounds(report: Report) -> None:
    """Figure 4 and its claims."""
    curves = {
        f"{case} {name}": bound(MOTIONS[motion], model, 120.0)
        for case, motion in (("(a)", "sine"), ("(b)", "straight"))
        for name, model in NAMES.items()
    }
    report.table(
        "Bound of the roll: yaw rate sinusoidal (a) or zero (b)",
        [
            {"case": name}
            | {f"{time} s": round(value, 2) for time, value in zip(TIMES, at(curve[:, 0], TIMES), strict=True)}
            | {"θ, 120 s": round(float(curve[-1, 1:].max()), 3)}
            for name, curve in curves.items()
        ],
        "Standard deviation of φ in deg; prior 5°. (a) yaw rate 20 sin(0.1 π t) °/s, (b) none.",
    )
    rates, claims = constant_rates()
    report.table(
        "Bound of the roll: constant yaw rates (c)",
        rates,
        "Standard deviation of φ in deg at 2 / 10 / 60 s, and the last of 5 °/s over that of 20 °/s. A bound that goes "
        "with 1 / yaw rate has a ratio of 4: early σ_y √(12 T / t³) over the yaw rate, late cos φ σ_b over it.",
    )
    last = {name: float(curve[-1, 0]) for name, curve in curves.items()}
    apart = max(abs(curves["(b) Σ2"][:, 0] / curves["(b) Σ1"][:, 0] - 1.0))
    report.claims(
        "Bounds: what figure 4 says, and what holds",
        [
            Claim.less("(a) Σ2 converges while the platform turns: at most a tenth of the prior", last["(a) Σ2"], 0.5),
            Claim.less("(a) Σ1 does not converge while the platform turns: more than the prior", 5.0, last["(a) Σ1"]),
            Claim.less("(b) without turning Σ2 is as good as Σ1, within 2 %", 100.0 * apart, 2.0, "%"),
            Claim.less(
                "(b) without turning neither converges: more than the prior", 5.0, min(last["(b) Σ2"], last["(b) Σ1"])
            ),
            *claims,
        ],
    )
    report.figure(
        "figure-4", figure_4(curves), "Figure 4: bounds of the roll", "Logarithmic, where the paper is linear."
    )


def constant_rates() -> tuple[list[dict[str, Any]], list[Claim]]:
    """Figure 4(c) in numbers, and whether its curves overlap."""
    rows, claims = [], []
    for setting, errors in SETTINGS.items():
        row: dict[str, Any] = {"setting": setting}
        early, last = [], []
        for rate in YAW_RATES:
            deviation = bound(moved(rate, "still" in setting), "sigma2", 60.0, errors)[:, 0]
            row[f"{rate:g} °/s"] = " / ".join(f"{value:.2g}" for value in at(deviation, (2, 10, 60)))
            early.append(deviation[round(2.0 / DT)])
            last.append(deviation[-1])
        row["5 : 20 °/s at 60 s"] = round(float(last[0] / last[-1]), 2)
        rows.append(row)
        product = float(last[0] * YAW_RATES[0] / (last[-1] * YAW_RATES[-1]))
        statement = f"(c) {setting}: bounds go with 1 / yaw rate: times the rate, that of 5 is that of 20 °/s at 60 s"
        claims.append(Claim.within(statement, product, 0.8, 1.25, "times"))
        for time, values in (("2 s", early), ("60 s", last)):
            ratio = float(values[0] / values[-1])
            claims.append(
                Claim.within(f"(c) {setting}: bounds of 5 to 20 °/s overlap at {time}", ratio, 0.7, 1.3, "times")
            )
    return rows, claims


def figure_4(curves: dict[str, np.ndarray]) -> Any:
    """Three panels as in the paper, logarithmic."""
    figure, axes = time_figure(7.5, 8.0, 3)
    colours = (BLUE, VERMILION, GREEN, GREY)
    time = DT * np.arange(len(curves["(a) Σ2"]))
    for ax, case, title in zip(
        axes[:2], ("(a)", "(b)"), ("(a) yaw rate 20 sin(0.1 π t) °/s", "(b) no yaw rate"), strict=True
    ):
        for name, colour, style in zip(NAMES, colours, ("-", "--"), strict=False):
            ax.plot(time, curves[f"{case} {name}"][:, 0], style, color=colour, label=name)
        ax.set_title(title, loc="left", fontsize=10)
    for rate, colour in zip(YAW_RATES, colours, strict=True):
        axes[2].plot(time, bound(turning(rate * DEG), "sigma2", 120.0)[:, 0], color=colour, label=f"{rate:g} °/s")
    axes[2].set_title("(c) Σ2 at constant yaw rates", loc="left", fontsize=10)
    for ax in axes:
        ax.set(yscale="log", ylabel="σ of φ, deg")
        legend_above(ax)
    return figure


def observability(study: Study, report: Report) -> None:
    """Ranks by Lie derivatives, exact, and along trajectories."""
    claims = []
    try:
        from .observability import ranks

        found = study.cached("ranks", ranks)
    except ImportError:
        report.text("Exact ranks need the package sympy, which is not installed.")
    else:
        published, closed = found["+ L_f5 f0 (as published)"], found["h, L_f0, L_f5, L_f0 f1"]
        claims = [
            Claim("(20)–(22): the published gradients have rank 9", f"{published} of 9", published == 9),
            Claim("With ∇L_f0 f1 h instead of ∇L_f5 f0 h they have rank 9", f"{closed} of 9", closed == 9),
        ]
        rows = [{"gradients stacked (Σ2)": name, "rank": rank, "of": 9} for name, rank in found.items()]
        report.table("Generic rank by Lie derivatives", rows, "Exact, in rational numbers.")
    rows = []
    for label, motion, model in (
        ("moving body, varying yaw rate", "circle", "Σ2"),
        ("moving body, sinusoidal yaw rate", "sine", "Σ2"),
        ("nothing moves, constant yaw rate", "frozen", "Σ2"),
        ("moving body, no yaw rate", "straight", "Σ2"),
        ("moving body, varying yaw rate", "circle", "Σ1"),
        ("moving body, no yaw rate", "straight", "Σ1"),
    ):
        equations = filter_of(replace(STUDY, bias_time=1e15), DT, NAMES[model])
        ride = simulate(MOTIONS[motion], 40.0, DT)
        seen = trajectory_observability(equations, true_states(ride.truth, equations), ride.measurements)
        deviation = seen.deviations()[0] / DEG
        rows.append(
            {
                MOTION: label,
                "model": model,
                "rank": seen.rank(),
                "of": equations.error_size,
                "σ of φ without prior, deg": round(float(deviation), 2) if np.isfinite(deviation) else UNSEEN,
            }
        )
    claims += rank_claims(rows)
    report.table(
        "Rank along a trajectory",
        rows,
        "Singular values of the observability matrix with constant biases. Lie derivatives suppose that inputs may "
        "vary freely; along a trajectory they are what they are.",
    )
    report.claims(
        "Observability: what holds",
        claims,
        "What the published gradients miss is a common rate about the vertical in both gyroscopes, δb_z^p = 1 with "
        "δb^h = R_PHᵀ [0, tan φ, 1], not the roll.",
    )


def rank_claims(rows: Sequence[dict[str, Any]]) -> list[Claim]:
    """What section IV-A says of Σ1, and of Σ2 with and without a yaw rate."""

    def said(statement: str, model: str, start: str, whole: bool) -> Claim:
        part = [row for row in rows if row["model"] == model and row[MOTION].startswith(start)]
        ranks = ", ".join(f"{row['rank']} of {row['of']}" for row in part)
        unseen = all(row["σ of φ without prior, deg"] == UNSEEN for row in part)
        return Claim(statement, f"rank {ranks}", all(row["rank"] == row["of"] for row in part) if whole else unseen)

    return [
        said("Σ2 observes every state while body and yaw rate move", "Σ2", "moving body, varying", True),
        said("Σ2 observes every state with a sinusoidal yaw rate", "Σ2", "moving body, sinusoidal", True),
        said("Without a yaw rate Σ2 does not observe φ", "Σ2", "moving body, no yaw", False),
        said("Σ1 never observes φ", "Σ1", "moving body", False),
    ]
