"""Estimators × trajectories → one long table of errors. No estimator is a special case."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..envs.data.formats.load import load_recording
from ..envs.data.trajectory import Trajectory
from ..filters.core import rotation
from ..filters.core.consistency import consistency
from ..filters.core.estimator import Estimator, run
from ..filters.core.metrics import score
from ..filters.core.model import Equations, equations_of
from ..filters.core.quantity import ORIENTATION, RELATIVE_ORIENTATION, UP, Estimate, Quantity
from ..filters.support.parallel import progress_bar
from .registry import make_estimator

if TYPE_CHECKING:
    import pandas

COLUMNS = ("estimator", "trajectory", "quantity", "metric", "value", "unit")
"""Columns of the table, one number a row."""

Estimators = str | Estimator[Any] | Sequence[str | Estimator[Any]] | Mapping[str, str | Estimator[Any]]
Trajectories = Trajectory | str | Path | Iterable[Trajectory | str | Path]


def evaluate(
    estimators: Estimators,
    trajectories: Trajectories,
    *,
    reference: str | Estimator[Any] | None = None,
    progress: bool = False,
) -> pandas.DataFrame:
    """Run every estimator over every trajectory and tabulate the errors over the scored ticks.

    Args:
        estimators: names (see :func:`poise.list_estimators`), estimators, or a mapping label → name or estimator.
            Each is adjusted to the sampling interval of each trajectory; those that are named are configured with the
            rider, bicycle or device that its metadata describe (:func:`poise.make_estimator`).
        trajectories: trajectories, or paths of recordings.
        reference: estimator that stands in for the truth of trajectories that know none. Such rows name it in
            ``metric`` (``inclination to mekf-9``): they show agreement, not error.
        progress: show a progress bar.

    Returns:
        A data frame with the columns estimator, trajectory, quantity, metric, value, unit: root mean square errors
        (``inclination``, ``heading``, ``total`` in deg, ``distance`` in the quantity's unit), the share of scored ticks
        with an estimate (``valid``), and for filters with a covariance the normalised innovation squared per degree of
        freedom (``nis``; 1 if consistent). ``frame.attrs["skipped"]`` lists (estimator, trajectory, reason) of pairs
        that could not be run: a channel that the trajectory lacks, or a package that is not installed.

    Raises:
        ValueError: an unknown estimator, no estimator or no trajectory, two trajectories or estimators of one name.
        FileNotFoundError: a recording that is not there.
    """
    import pandas

    contenders = named_estimators(estimators)
    paths = [trajectories] if isinstance(trajectories, Trajectory | str | Path) else list(trajectories)
    if not contenders or not paths:
        raise ValueError(f"evaluate needs estimators and trajectories, got {len(contenders)} and {len(paths)}")
    rows: list[tuple[Any, ...]] = []
    skipped: list[tuple[str, str, str]] = []
    seen: set[str] = set()
    bar = progress_bar(len(paths) * len(contenders), "evaluate", "run", show=progress)
    for path in paths:
        trajectory = path if isinstance(path, Trajectory) else load_recording(path)
        if trajectory.name in seen:
            raise ValueError(f"two trajectories are named {trajectory.name!r}; give them different names")
        seen.add(trajectory.name)
        stand_in = None if trajectory.truth or reference is None else reference_truth(reference, trajectory)
        for label, contender in contenders.items():
            bar.set_postfix_str(f"{label} on {trajectory.name}")
            try:
                estimator = fitted(contender, trajectory)
            except ImportError as reason:
                skipped.append((label, trajectory.name, str(reason)))
                bar.update()
                continue
            missing = [channel.name for channel in estimator.channels if channel.name not in trajectory.measurements]
            if missing:
                skipped.append((label, trajectory.name, f"no channel {', '.join(missing)}"))
            else:
                estimate = run(estimator, trajectory.measurements)
                # That the stand-in agrees with itself says nothing.
                other = None if stand_in is not None and stand_in[0] == label else stand_in
                for quantity, metric, value, unit in errors(estimator, estimate, trajectory, other):
                    rows.append((label, trajectory.name, quantity, metric, value, unit))
            bar.update()
    bar.close()
    frame = pandas.DataFrame(rows, columns=list(COLUMNS))
    frame.attrs["skipped"] = skipped
    return frame


def named_estimators(estimators: Estimators) -> dict[str, str | Estimator[Any]]:
    """Label → name or estimator; unlabelled estimators are named after their model.

    Raises:
        ValueError: two of one label.
    """
    if isinstance(estimators, Mapping):
        return dict(estimators)
    items = list(estimators) if isinstance(estimators, list | tuple) else [estimators]
    labels = [item if isinstance(item, str) else label_of(item) for item in items]  # type: ignore[arg-type]
    twice = sorted({label for label in labels if labels.count(label) > 1})
    if twice:
        raise ValueError(f"several estimators are named {twice}; pass a mapping label → estimator")
    return dict(zip(labels, items, strict=True))  # type: ignore[arg-type]


def label_of(estimator: Estimator[Any]) -> str:
    """The name an estimator has of itself, or that of its model's class."""
    name = getattr(estimator, "name", None)
    return str(name) if name else type(getattr(estimator, "model", estimator)).__name__


def fitted(contender: str | Estimator[Any], trajectory: Trajectory) -> Estimator[Any]:
    """An estimator at the trajectory's sampling interval; one that is named is configured with its metadata."""
    if isinstance(contender, str):
        return make_estimator(contender, dt=trajectory.dt, metadata=trajectory.metadata)
    return at_interval(contender, trajectory.dt)


def at_interval(contender: str | Estimator[Any], dt: float) -> Estimator[Any]:
    """An estimator for samples ``dt`` seconds apart."""
    if isinstance(contender, str):
        return make_estimator(contender, dt=dt)
    return contender if abs(contender.dt - dt) <= 1e-6 * dt else contender.with_dt(dt)


def has_truth(trajectory: Trajectory) -> bool:
    """Whether the trajectory knows where up is."""
    return UP.name in trajectory.quantities


def reference_truth(reference: str | Estimator[Any], trajectory: Trajectory) -> tuple[str, dict[str, np.ndarray]]:
    """Label and pose of the estimator that stands in for the truth.

    Raises:
        ValueError: the trajectory lacks a channel that the reference needs.
    """
    estimator = at_interval(reference, trajectory.dt)
    label = reference if isinstance(reference, str) else label_of(reference)
    return label, with_up(run(estimator, trajectory.measurements).pose)


def with_up(pose: Mapping[str, Any]) -> dict[str, Any]:
    """The pose with ``up``, which every orientation contains."""
    for name in (ORIENTATION.name, RELATIVE_ORIENTATION.name):
        if UP.name not in pose and name in pose:
            return {**pose, UP.name: rotation.up_in_body(pose[name])}
    return dict(pose)


def errors(
    estimator: Estimator[Any],
    estimate: Estimate,
    trajectory: Trajectory,
    stand_in: tuple[str, dict[str, np.ndarray]] | None = None,
) -> list[tuple[str, str, float, str]]:
    """Rows (quantity, metric, value, unit) of one run."""
    pose = with_up(estimate.pose)
    equations = equations_of(estimator)
    derived = equations.truth(trajectory.truth) if isinstance(equations, Equations) else {}
    if derived:
        trajectory = trajectory.replace(truth={**derived, **trajectory.truth})
    outputs = {quantity.name: quantity for quantity in (UP, *estimator.outputs)}
    rows: list[tuple[str, str, float, str]] = []
    for name, quantity in outputs.items():
        truth, suffix = truth_of(quantity, trajectory, stand_in)
        # The inclination of an orientation is scored once, as that of its upward vertical.
        if truth is None or name not in pose or name == RELATIVE_ORIENTATION.name:
            continue
        for metric, (value, unit) in score(quantity, pose[name], truth, trajectory.mask).items():
            if quantity.kind != "rotation" or metric not in ("inclination", "valid"):
                rows.append((name, metric + (suffix if metric != "valid" else ""), value, unit))
    if estimate.nis is not None and estimate.innovation is not None:
        degrees = (np.asarray(estimate.innovation) != 0.0).sum(axis=-1)
        rows.append(("innovation", "nis", consistency(estimate.nis, degrees, trajectory.mask).ratio, "1"))
    return rows


def truth_of(
    quantity: Quantity, trajectory: Trajectory, stand_in: tuple[str, dict[str, np.ndarray]] | None
) -> tuple[np.ndarray | None, str]:
    """What an estimate is compared with, and what to add to the name of the metric."""
    if quantity.name in trajectory.quantities:
        return trajectory.truth_of(quantity.name), ""
    if stand_in is not None and quantity.name in stand_in[1] and quantity.kind in ("direction", "rotation"):
        return stand_in[1][quantity.name], f" to {stand_in[0]}"
    return None, ""


def summary(table: pandas.DataFrame, metric: str = "inclination", groups: Mapping[str, str] | None = None) -> Any:
    """Means over trajectories as a wide table: a row an estimator, a column a group, best estimators first.

    Args:
        table: from :func:`evaluate`, with one quantity that has this metric.
        metric: which metric.
        groups: trajectory → group; by default every trajectory is its own. The column ``mean`` is over trajectories.
    """
    chosen = table[table["metric"] == metric]
    labels = chosen["trajectory"].map(lambda name: (groups or {}).get(name, name))
    wide = chosen.assign(group=labels).pivot_table(index="estimator", columns="group", values="value", sort=False)
    wide["mean"] = chosen.groupby("estimator")["value"].mean()
    return wide.sort_values("mean")
