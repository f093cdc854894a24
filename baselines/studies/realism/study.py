"""``poise realism``: simulated motion beside recordings and publications, part by part."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ....envs.recipes.registry import recipe
from ...plots import AMBER, BLUE, GREEN, PINK, SKY, VERMILION, legend_above, new_figure
from ..kit import Study
from ..report import Report, result
from .containment import DRAWN, HIGH, LOW, Summary, containment_rows, simulated_summaries, summary, totals
from .motion import SHARE_OF_RATE, UNITS
from .points import points
from .ranks import ranked
from .roles import ROLES, Recorded, by_recipe
from .simulators import hand_motion, ride_motion, roads, sensors, steering

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CONTAINED = (
    f"Every recording is compared at 0.45 of its own sampling rate; inside is between {LOW:g} and {HIGH:g} % of the "
    "simulated episodes. The range shown is that at the widest bandwidth."
)
RANKED = (
    "Mean over trajectories of the RMS error of the inclination, deg. τ is Kendall's rank correlation of the "
    "estimators' order; its interval is 5 to 95 % over bootstrap draws of episodes and recordings."
)


@dataclass(frozen=True)
class Settings:
    """How much is simulated."""

    episodes: int = 60
    """of each recipe of hands"""
    rides: int = 20
    """of each recipe of riders"""

    def __post_init__(self) -> None:
        for name in ("episodes", "rides"):
            if getattr(self, name) < 2:
                raise ValueError(f"{name} must be at least 2, got {getattr(self, name)}")

    def of(self, kind: str) -> int:
        """Episodes of a recipe of a kind."""
        return self.rides if kind == "rider" else self.episodes


def containment(study: Study, report: Report, settings: Settings, groups: Sequence[Recorded]) -> None:
    """Statistics and spectra of every group of recordings beside its recipe."""
    if not groups:
        return
    report.text(CONTAINED, "Recordings inside of recipes")
    whole = []
    for name, places in by_recipe(groups).items():
        made = recipe(name)
        recordings = {site: recorded_summaries(members) for site, members in places.items()}
        each_one = [each for found in recordings.values() for summaries in found.values() for each in summaries]
        widths = sorted({width for each in each_one for width in each.statistics})
        rate = max(each.rate for each in each_one)
        episodes = simulated_summaries(study, made, settings.of(made.kind), list(places), widths, rate)
        for site, simulated in episodes.items():
            if made.kind == "rider":
                falls = sum(each.fell for each in simulated)
                report.text(f"{falls} of {len(simulated)} rides of the recipe {name} ended in a fall.")
            for label, summaries in recordings[site].items():
                rows = containment_rows(summaries, simulated)
                report.table(f"{label} in {name} at {site}", rows)
                whole.append({"recordings": label, "recipe": name, "episodes": len(simulated)} | totals(rows))
                report.numbers(results(label, summaries))
            drawn = spectra(simulated, recordings[site])
            report.figure(f"spectra {name} {site}", drawn, f"Spectra: recipe {name} at {site}")
            report.numbers(results(f"{name} {site}", simulated))
    report.table("Statistics of recordings inside of recipes", whole)


def recorded_summaries(groups: Sequence[Recorded]) -> dict[str, list[Summary]]:
    """Group, with its role if that is called otherwise → summaries of its recordings."""
    found: dict[str, list[Summary]] = {}
    for group in groups:
        label = group.group if group.group == group.role else f"{group.group} ({group.role})"
        found.setdefault(label, []).extend(
            summary(each, "imu", [SHARE_OF_RATE / each.dt], "orientation") for each in group.load()
        )
    return found


def results(label: str, summaries: Sequence[Summary]) -> list[dict[str, Any]]:
    """Rows of ``results.csv``, at the widest bandwidth of each."""
    return [
        result("truth", f"{label}/{each.name}", "motion", name, value, UNITS[name] or "1")
        for each in summaries
        for name, value in each.statistics[max(each.statistics)].items()
        if np.isfinite(value)
    ]


def ranks(study: Study, report: Report, settings: Settings, groups: Sequence[Recorded]) -> None:
    """Order of the estimators on every group of recordings and on its recipe."""
    rows = []
    for group in groups:
        found, name = ranked(study, settings.episodes, group), ROLES[group.role].recipe
        if found is None:
            continue
        names, simulated, recorded, tau, low, high = found
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            means = (np.nanmean(simulated, axis=0), np.nanmean(recorded, axis=0))
        order = np.argsort(means[1])
        report.table(
            f"Estimators on {group.group} ({group.role}) and {name}",
            [{"estimator": names[i], group.group: means[1][i], f"recipe {name}": means[0][i]} for i in order],
            f"τ = {tau:.2f} ({low:.2f} … {high:.2f}) over {len(recorded)} recordings and {len(simulated)} episodes.",
        )
        rows.append({"recordings": group.group, "recipe": name, "τ": tau, "from": low, "to": high})
    if rows:
        report.table("Rank agreement of the estimators", rows, RANKED)


Part = Callable[[Study, Report, Settings, Sequence[Recorded]], None]
PARTS: Mapping[str, Part] = {
    "points": lambda study, report, settings, groups: points(study, report, settings.episodes, settings.rides, groups),
    "gestures": lambda study, report, settings, groups: hand_motion(study, report, settings.episodes, groups),
    "rides": lambda study, report, settings, groups: ride_motion(study, report, settings.rides, groups),
    "steering": lambda study, report, settings, groups: steering(study, report, max(2, settings.rides // 4)),
    "roads": lambda study, report, settings, groups: roads(study, report),
    "sensors": lambda study, report, settings, groups: sensors(report),
    "motion": containment,
    "ranks": ranks,
}
"""Name → part of the report."""


def realism(
    study: Study, report: Report, settings: Settings, groups: Sequence[Recorded], parts: Sequence[str] = ()
) -> None:
    """Report the chosen parts of :data:`PARTS`; all if none is named."""
    for name, part in PARTS.items():
        if not parts or name in parts:
            part(study, report, settings, groups)


AXES = {"gyr": "angular rate, (rad/s)²/Hz", "acc": "acceleration, (m/s²)²/Hz", "force": "specific force, (m/s²)²/Hz"}
COLOURS = (VERMILION, GREEN, PINK, AMBER, SKY)


def spectra(simulated: Sequence[Summary], recorded: Mapping[str, Sequence[Summary]]) -> Figure:
    """Power spectral densities of one recipe and site: range and median of episodes, and every recording by group."""
    known = all("acc" in each.spectra for group in (simulated, *recorded.values()) for each in group)
    shown = ("gyr", "acc" if known else "force")
    figure, axes = new_figure(7.5, 6.5, rows=2)
    middle = np.sqrt(DRAWN[:-1] * DRAWN[1:])
    for ax, signal in zip(axes, shown, strict=True):
        densities = np.array([each.spectra[signal] for each in simulated], dtype=float)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            low, median, high = np.nanpercentile(densities, [LOW, 50.0, HIGH], axis=0)
        there = np.isfinite(median)
        name = f"simulated, {LOW:g} to {HIGH:g} % of {len(simulated)}"
        ax.fill_between(middle[there], low[there], high[there], color=BLUE, alpha=0.18, linewidth=0, label=name)
        ax.plot(middle[there], median[there], color=BLUE, linewidth=1.4, label="median")
        for index, (group, summaries) in enumerate(recorded.items()):
            for number, each in enumerate(summaries):
                density = np.array(each.spectra[signal], dtype=float)
                there = np.isfinite(density) & (middle < 0.5 * each.rate)
                colour = COLOURS[index % len(COLOURS)]
                label = group if number == 0 else None
                ax.plot(middle[there], density[there], color=colour, linewidth=0.8, alpha=0.8, label=label)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_ylabel(AXES[signal])
        ax.yaxis.label.set_size(8.5)
    axes[-1].set_xlabel("frequency, Hz")
    legend_above(axes[0])
    figure.align_ylabels(axes)
    return figure
