"""Lists of measured errors that `poise list` prints: of the shipped benchmark, and of the cards of trained weights."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ...filters.core.offline import SUFFIX

Rows = list[dict[str, Any]]
BEST = 12
"""Rows of the short table of errors."""


def benchmark(metric: str = "inclination") -> Rows:
    """Every estimator's mean error on every data set of the shipped benchmark, deg; heading where north is known."""
    from ...baselines.comparison.recommendation import dataset_errors, load_results

    recordings = load_results()["recordings"]
    names = list(dict.fromkeys(one["dataset"] for one in recordings))
    means = dataset_errors(recordings, metric)
    shown = [name for name in names if any(name in errors for errors in means.values())]
    return [{"name": name, **{each: errors.get(each) for each in shown}} for name, errors in means.items()]


def benchmark_best() -> Rows:
    """The first rows of :func:`benchmark` that have an error on every data set."""
    return [row for row in benchmark() if None not in row.values()][:BEST]


def benchmark_limits() -> Rows:
    """Where every estimator that runs online is nearest to the best of these, and where it falls behind most."""
    rows = [row for row in benchmark() if not row["name"].endswith(SUFFIX)]
    sets = [name for name in rows[0] if name != "name"]
    best = {each: min(row[each] for row in rows if row.get(each) is not None) for each in sets}
    found = []
    for row in rows:
        ratios = {each: row[each] / best[each] for each in sets if row.get(each) is not None}
        holds, fails = min(ratios, key=lambda each: ratios[each]), max(ratios, key=lambda each: ratios[each])
        found.append(
            {
                "name": row["name"],
                "holds best on": f"{holds} ({row[holds]:.2f}°, {ratios[holds]:.1f} × the best)",
                "falls behind most on": f"{fails} ({row[fails]:.2f}°, {ratios[fails]:.1f} × the best)",
            }
        )
    return found


def riders(table: str = "error") -> Rows:
    """A table of the shipped benchmark's riders, see :func:`.by_group`."""
    from ...baselines.comparison.recommendation import load_results
    from ...baselines.comparison.rider_tables import by_group

    numbers = load_results().get("riders", [])
    papers = dict.fromkeys(each["paper"] for each in numbers)
    return [
        {"name": cells.pop("method"), "sensors of": paper, **cells}
        for paper in papers
        for cells in by_group(numbers, paper, table)
    ]


def riders_best() -> Rows:
    """The mean errors of what is told apart most easily: the mean, the filter of each paper, and its networks."""
    kept = ("always the mean", "{}", "{}-consistent", "{}+network", "gru-{}")
    return [row for row in riders("mean") if row["name"] in [name.format(row["sensors of"]) for name in kept]]


def learned(trained: Iterable[Path] = ()) -> Rows:
    """Every network of a preset: its error on simulated episodes that it never saw, deg, from its card.

    ``trained`` are files of weights, or folders of them; none for those that are shipped.
    """
    from ...baselines.weights_io import SUFFIX as WEIGHTS
    from ...baselines.weights_io import list_weights, load_weights

    files = [file for path in trained for file in (sorted(path.rglob(f"*{WEIGHTS}")) if path.is_dir() else [path])]
    found: dict[tuple[str, str], list[tuple[str, dict[str, float]]]] = {}
    for weights in files if trained else list_weights():
        card = load_weights(weights)[1]
        for group, errors in card.get("test", {}).items():
            means = {name: float(each["mean_deg"]) for name, each in errors.items()}
            found.setdefault((card["name"], group), []).append((card.get("command", ""), means))
    rows: Rows = []
    for (name, group), trainings in found.items():
        # in the order of their commands: seed, then number of the replicate
        own = [f"{means[name]:.2f}" for _, means in sorted(trainings, key=lambda each: each[0])]
        others = {other: error for other, error in trainings[0][1].items() if other != name}
        best = min(others, key=others.__getitem__)
        rows.append(
            {"name": name, "episodes": group, "error": ", ".join(own), "best other": f"{best} {others[best]:.2f}"}
        )
    return rows
