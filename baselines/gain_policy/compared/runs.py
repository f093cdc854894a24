"""Agents compared over seeds: tables and figures from run folders of ``poise tune`` or a script, and nothing else.

A score is the share of the published gains' error that a policy saves on a trajectory: 0 as published, 1 without error.
Runs of one filter are comparable where they were tested on the same trajectories.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...statistics import DRAWS, bootstrap_interval, interquartile_mean, mean_score, performance_profile
from ...statistics import probability_of_improvement as improvement

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SETS, CURVE = "sets.json", "curve.csv"
"""Files of a run folder: group → names of its test trajectories; progress of the training."""
PLAIN = "plain_ppo"
"""Command of the run folders of ``docs/examples/plain_ppo.py``, which hold the same."""
PUBLISHED, CONSTANT, POLICY = "published", "constant", "policy"
"""Rows of the results of a run: the reference of scores, the reference of improvement, and what the agent found."""
CURVE_DRAWS, CURVE_POINTS = 300, 50
"""Bootstrap draws of each point of a learning curve, and points of a curve."""


@dataclass(frozen=True)
class TuneRun:
    """What a run folder holds."""

    folder: Path
    filter: str
    agent: str
    seed: int
    sets: dict[str, list[str]]
    errors: dict[str, dict[str, float]]
    """Gains → trajectory → error, deg."""
    curve: list[dict[str, float]]
    """Steps, and share of the reference's error that the training saved."""

    @classmethod
    def read(cls, folder: str | Path) -> TuneRun:
        """Read a finished run.

        Raises:
            FileNotFoundError: the folder, or a file of it, is missing.
            ValueError: it is the folder of another command, or a file is damaged.
        """
        folder = Path(folder)
        for name in ("args.json", SETS, "results.csv"):
            if not (folder / name).is_file():
                raise FileNotFoundError(f"{folder} is not a finished run of poise tune: it has no {name}")
        try:
            started = json.loads((folder / "args.json").read_text(encoding="utf-8"))
            sets = json.loads((folder / SETS).read_text(encoding="utf-8"))
            args = started["args"]
            errors: dict[str, dict[str, float]] = {}
            with (folder / "results.csv").open(encoding="utf-8", newline="") as file:
                for row in csv.DictReader(file):
                    errors.setdefault(row["estimator"], {})[row["trajectory"]] = float(row["value"])
            curve = []
            if (folder / CURVE).is_file():
                with (folder / CURVE).open(encoding="utf-8", newline="") as file:
                    curve = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
            if started["command"] not in ("tune", PLAIN):
                raise ValueError(f"it is of the command {started['command']!r}")
            return cls(folder, args["filter"], args["agent"], int(started["seed"]), sets, errors, curve)
        except (KeyError, TypeError, ValueError) as reason:
            raise ValueError(f"{folder} is not a run of poise tune: {reason}") from None


def scores_of_runs(runs: Sequence[TuneRun], gains: str, group: str) -> np.ndarray:
    """Scores ``(runs, trajectories)`` of some gains.

    Raises:
        ValueError: the runs were tested on different trajectories, or lack these gains.
    """
    names = runs[0].sets.get(group, [])
    for run in runs:
        if run.sets.get(group, []) != names:
            raise ValueError(f"{run.folder} was tested on other trajectories ({group}) than {runs[0].folder}")
        if gains not in run.errors:
            raise ValueError(f"{run.folder} has no results of {gains!r}, only of {sorted(run.errors)}")
    return np.array([[1.0 - run.errors[gains][name] / run.errors[PUBLISHED][name] for name in names] for run in runs])


def agents_of(runs: Sequence[TuneRun]) -> dict[tuple[str, str], list[TuneRun]]:
    """Filter and agent → its runs, in the order of their seeds.

    Raises:
        ValueError: there is no run, or an agent has two of the same seed.
    """
    if not runs:
        raise ValueError("there must be at least one run of poise tune, got none")
    found: dict[tuple[str, str], list[TuneRun]] = {}
    for run in sorted(runs, key=lambda each: (each.filter, each.agent, each.seed)):
        found.setdefault((run.filter, run.agent), []).append(run)
    for (filter, agent), some in found.items():
        seeds = [run.seed for run in some]
        if len(set(seeds)) < len(seeds):
            raise ValueError(f"runs of {agent} on {filter} must differ in their seeds, got {seeds}")
    return found


def comparison(runs: Sequence[TuneRun], seed: int = 0, draws: int = DRAWS) -> list[dict[str, Any]]:
    """One row for each filter, set of trajectories and agent: errors, scores with intervals, improvement.

    Intervals of ``saved`` are those of other seeds of training. ``better than constant`` is the probability that the
    agent saves more than the best constant gains of its training data do on a trajectory, and its interval is that of
    other seeds and trajectories. What it saves more than those has both kinds of interval.

    Args:
        runs: finished runs.
        seed: of the bootstrap.
        draws: of the bootstrap.
    """
    rows = []
    for (filter, agent), some in agents_of(runs).items():
        gains = POLICY if POLICY in some[0].errors else CONSTANT
        for group, names in some[0].sets.items():
            scores, constant = (scores_of_runs(some, each, group) for each in (gains, CONSTANT))
            mean = {
                each: np.mean([run.errors[each][name] for run in some for name in names]) for each in some[0].errors
            }
            saved = bootstrap_interval(interquartile_mean, scores, seed=seed, draws=draws)
            seeds, more = (
                bootstrap_interval(mean_score, scores - constant, seed=seed, draws=draws, tasks_too=tasks)
                for tasks in (False, True)
            )
            better = bootstrap_interval(improvement, scores, constant, seed=seed, draws=draws, tasks_too=True)
            rows.append(
                {
                    "filter": filter,
                    "set": group,
                    "agent": agent,
                    "seeds": len(some),
                    "trajectories": len(names),
                    "published (deg)": round(float(mean[PUBLISHED]), 3),
                    "best constant (deg)": round(float(mean[CONSTANT]), 3),
                    "agent (deg)": round(float(mean[gains]), 3),
                    "worst seed (deg)": round(
                        max(float(np.mean([run.errors[gains][name] for name in names])) for run in some), 3
                    ),
                    "saved, IQM": shown(saved),
                    "saved more than constant": shown(more),
                    "the same, other seeds alone": shown(seeds),
                    "better than constant": shown(better),
                }
            )
    return rows


def shown(interval: Sequence[float]) -> str:
    """``0.31 [0.28, 0.33]``."""
    value, low, high = interval
    return f"{value:.3f} [{low:.3f}, {high:.3f}]"


def profiles_figure(runs: Sequence[TuneRun], group: str) -> Figure:
    """Performance profiles: the share of seeds and trajectories that saves more than a share of the published error."""
    from ...plots import legend_above, new_figure

    found = agents_of(runs)
    filters = list(dict.fromkeys(filter for filter, _ in found))
    figure, axes = new_figure(4.5 * len(filters), 3.2, columns=len(filters))
    thresholds = np.linspace(-0.5, 1.0, 151)
    for ax, filter in zip(axes, filters, strict=True):
        for (owner, agent), some in found.items():
            if owner == filter and group in some[0].sets:
                scores = scores_of_runs(some, POLICY if POLICY in some[0].errors else CONSTANT, group)
                ax.plot(thresholds, performance_profile(scores, thresholds), label=agent)
        ax.set(xlabel=f"saved share of the published error, {filter}", ylabel="share of runs", ylim=(0.0, 1.0))
        ax.axvline(0.0, color="0.7", linewidth=0.8)
        legend_above(ax)
    return figure


def curves_figure(runs: Sequence[TuneRun]) -> Figure | None:
    """Learning curves: interquartile mean over seeds of the reward while training, with the interval of other seeds.

    None where no run has a curve.
    """
    from ...plots import legend_above, new_figure

    found = {key: some for key, some in agents_of(runs).items() if all(run.curve for run in some)}
    if not found:
        return None
    filters = list(dict.fromkeys(filter for filter, _ in found))
    figure, axes = new_figure(4.5 * len(filters), 3.2, columns=len(filters))
    for ax, filter in zip(axes, filters, strict=True):
        for (owner, agent), some in found.items():
            if owner != filter:
                continue
            steps, values = common_curve([run.curve for run in some])
            middle = [bootstrap_interval(interquartile_mean, column[:, None], draws=CURVE_DRAWS) for column in values.T]
            value, low, high = np.array(middle).T
            (line,) = ax.plot(steps, value, label=agent)
            ax.fill_between(steps, low, high, color=line.get_color(), alpha=0.2, lw=0.0)
        ax.set(xlabel="decisions", ylabel=f"reward per decision, {filter}")
        legend_above(ax)
    return figure


def common_curve(curves: Sequence[Sequence[Mapping[str, float]]]) -> tuple[np.ndarray, np.ndarray]:
    """Steps ``(n,)`` that all curves reach, and their gains ``(curves, n)`` there.

    Points without a finished episode are passed over.
    """
    known = [[(row["steps"], row["gain"]) for row in curve if np.isfinite(row["gain"])] for curve in curves]
    arrays = [np.array(points or [(0.0, 0.0)]).T for points in known]
    steps = np.linspace(max(each[0, 0] for each in arrays), min(each[0, -1] for each in arrays), CURVE_POINTS)
    return steps, np.stack([np.interp(steps, *each) for each in arrays])
