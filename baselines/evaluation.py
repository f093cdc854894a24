"""Evaluation of estimators on trajectories: one long table of errors."""

from __future__ import annotations

import os
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from ..envs.data.formats.load import load_recordings
from ..envs.data.plausibility.sites import sites
from ..envs.data.reference_clock import measured
from ..envs.data.trajectory import REFERENCE_CLOCK, Trajectory
from ..filters.core.estimator import Estimator
from ..filters.core.offline import SUFFIX, Offline
from ..filters.core.quantity import ORIENTATION
from ..filters.support.parallel import progress_bar
from ..filters.support.rows import RESULT
from .measures import measures
from .registry import list_estimators, make_estimator
from .run import fitted, report_findings, run_on, without_estimate
from .scoring import (
    LARGEST_NORTH,
    ONBOARD,
    Row,
    StandIn,
    automatic_reference,
    errors,
    family,
    heading_offset,
    reference_pose,
    with_up,
    without_truth,
)
from .sensor_bound import inclination_bound

if TYPE_CHECKING:
    from .error_table import ErrorTable

Estimators = str | Estimator[Any] | Sequence[str | Estimator[Any]] | Mapping[str, str | Estimator[Any]]
Trajectories = Trajectory | str | Path | Iterable[Trajectory | str | Path]
ReferenceClock = Literal["recorded", "corrected"]

AUTO = "auto"
LARGEST_NIS = {"bounded-motion": 5.0}
"""Family → NIS per degree of freedom that no valid recording reaches (0.5 at most in 27 of four benchmarks). The noise
parameters of other filters make their NIS unsuitable for this check."""


def evaluate(
    estimators: Estimators,
    trajectories: Trajectories,
    *,
    reference: str | Estimator[Any] | None = None,
    reference_clock: ReferenceClock = "recorded",
    offline: bool = False,
    check: bool = True,
    detailed: bool = False,
    progress: bool = False,
) -> ErrorTable:
    """Run every estimator over every trajectory and tabulate the errors over the evaluation mask.

    Args:
        estimators: names (see :func:`poise.list_estimators`), estimators, or a mapping label → name or estimator.
            Each runs at the clock of each trajectory (:func:`poise.run`); those given by name are configured with the
            rider, bicycle or device that its metadata describe.
        trajectories: trajectories, or paths of recordings. Recordings of one name get the part of their path that
            distinguishes them.
        reference: what replaces a missing truth: an estimator, ``"onboard"`` for the
            orientation that the device computed, or ``"auto"`` for ``mekf-9`` or ``bounded-motion``, depending on the
            channels. Such rows name it in ``metric`` (``inclination to mekf-9``): they show agreement, not
            error. None or ``"auto"`` compares every estimator with every other (:func:`.error_table.agreement`).
        reference_clock: ``"recorded"`` takes the truth as it is; ``"corrected"`` moves it by the offset between its
            clock and the gyroscope's, which loaders measure (``metadata["reference_clock_offset"]``).
        offline: also run the smoother of every estimator that has one, as ``<label> (offline)``.
        check: warn of implausible recordings (:func:`poise.check_recording`).
        detailed: also measure the largest error, settling, drift, NEES, the bounds of NIS, and the ratio of the
            inclination error to what the errors of simulated sensors alone leave (:func:`.measures`).
        progress: show a progress bar.

    Returns:
        A data frame with the columns estimator, trajectory, quantity, metric, value, unit: root mean square errors
        (``inclination``, ``heading``, ``total`` in deg, ``distance`` in the quantity's unit), the share of samples of
        the mask with an estimate (``valid``), and for filters with a covariance the normalised innovation squared per
        degree of freedom (``nis``; 1 if consistent). In ``frame.attrs``: ``skipped``, (estimator, trajectory, reason)
        of what could not be run; ``references``, trajectory → what stood in for its truth; ``reference_clock``.

    Raises:
        ValueError: an unknown estimator or option, no estimator or no trajectory, two trajectories or estimators of
            one name, or nothing could be run.
        FileNotFoundError: a recording that is not there.

    Warns:
        UserWarning: for every finding about a recording, and for what could not be run.
    """
    from .error_table import ErrorTable

    if reference_clock not in get_args(ReferenceClock):
        raise ValueError(f"reference_clock must be one of {get_args(ReferenceClock)}, got {reference_clock!r}")
    if not isinstance(reference, str | Estimator | None):
        raise ValueError(f"reference must be a name or an estimator, got {reference!r}")
    contenders = named_estimators(estimators)
    if offline:
        contenders |= smoothers(contenders)
    loaded = named_trajectories(trajectories)
    if not contenders or not loaded:
        raise ValueError(f"evaluate needs estimators and trajectories, got {len(contenders)} and {len(loaded)}")
    known = (AUTO, ONBOARD, *list_estimators())
    for name in (*contenders.values(), reference):
        if isinstance(name, str) and name.removesuffix(SUFFIX) not in known:
            make_estimator(name)  # raises, with the names that there are
    rows: list[tuple[Any, ...]] = []
    skipped: list[tuple[str, str, str]] = []
    references: dict[str, str] = {}
    bar = progress_bar(len(loaded) * len(contenders), "evaluate", "run", show=progress)
    for trajectory in loaded:
        if check:
            report_findings(trajectory)
        one = Evaluation(trajectory, contenders, reference, reference_clock, detailed)
        for label in contenders:
            bar.set_postfix_str(f"{label} on {trajectory.name}")
            one.run(label)
            bar.update()
        rows += [(label, trajectory.name, *row) for label, found in one.rows().items() for row in found]
        skipped += [(label, trajectory.name, reason) for label, reason in one.skipped.items()]
        if one.reference is not None:
            references[trajectory.name] = one.reference[0]
    bar.close()
    for label, name, reason in skipped:
        warnings.warn(f"{label} was not run on {name}: {reason}", stacklevel=2)
    if not rows:
        alike: dict[str, list[str]] = {}
        for label, _, reason in skipped:
            alike.setdefault(reason, []).append(label)
        reasons = (f"{', '.join(dict.fromkeys(labels))}: {reason}" for reason, labels in alike.items())
        raise ValueError(f"nothing could be run: {'; '.join(reasons)}")
    frame = ErrorTable(rows, columns=list(RESULT))
    frame.attrs |= {"skipped": skipped, "references": references, "reference_clock": reference_clock}
    return frame


class Evaluation:
    """Results of all estimators on one trajectory, or the reasons why they could not be run."""

    def __init__(
        self,
        trajectory: Trajectory,
        contenders: Mapping[str, str | Estimator[Any]],
        reference: str | Estimator[Any] | None,
        clock: ReferenceClock,
        detailed: bool = False,
    ) -> None:
        self.contenders, self.detailed = contenders, detailed
        self.skipped: dict[str, str] = {}
        self.reference: StandIn | None = None
        self.everyone = reference is None or reference == AUTO
        self.estimates: dict[str, tuple[Estimator[Any], Any]] = {}
        try:
            if clock == "corrected":
                known = REFERENCE_CLOCK in trajectory.metadata
                trajectory = (trajectory if known else measured(trajectory)).reference_clock_corrected()
            trajectory = trajectory.on_grid()
        except ValueError as reason:
            self.skipped = dict.fromkeys(contenders, str(reason))
        if not self.skipped and not trajectory.mask.any():
            self.skipped = dict.fromkeys(contenders, "no sample is scored: its mask is true nowhere")
        self.trajectory = known_truth(trajectory)
        self.blind = without_truth(self.trajectory)
        if self.blind and not without_truth(trajectory) and not self.skipped:
            warnings.warn(f"{trajectory.name}: its truth is known at no sample that is scored", stacklevel=4)
        if self.blind and reference is not None and not self.skipped:
            chosen = automatic_reference(trajectory) if reference == AUTO else reference
            if chosen is not None:
                label = chosen if isinstance(chosen, str) else label_of(chosen)
                try:
                    self.reference = reference_pose(chosen, label, trajectory)
                except (ValueError, ImportError) as reason:
                    warnings.warn(f"{reason}; estimators are compared with each other", stacklevel=4)
                    self.everyone = True

    def run(self, label: str) -> None:
        """Run one estimator; if it raises an error on these data, the error is the reason for its omission."""
        if label in self.skipped:
            return
        try:
            estimator = fitted(self.contenders[label], self.trajectory)
            names = [channel.name for channel in estimator.channels]
            lacking = [name for name in names if name not in self.trajectory.measurements]
            if lacking:
                there = sites(self.trajectory)
                # Of a recording of several sensors one must be chosen (imu_of, or --site).
                hint = (
                    f" (sensors there: {', '.join(there)})"
                    if lacking[0].startswith("imu/") and there != ["imu"]
                    else ""
                )
                self.skipped[label] = f"no channel {', '.join(lacking)}{hint}"
                return
            estimate = run_on(estimator, self.trajectory)
            reason = without_estimate(estimator, self.trajectory.measurements, estimate)
            if reason:
                self.skipped[label] = reason
                return
            self.estimates[label] = (estimator, estimate)
        except Exception as reason:  # user code may raise anything; the results of the others must be kept
            kind = "" if isinstance(reason, ValueError | ImportError) else f"{type(reason).__name__}: "
            self.skipped[label] = f"{kind}{reason}"

    @cached_property
    def bound(self) -> float | None:
        """Bound of the inclination error, deg, where the errors of the sensors are known."""
        return inclination_bound(self.trajectory)

    def rows(self) -> dict[str, list[Row]]:
        """Label → rows of the table."""
        others: list[StandIn] = []
        if self.blind:
            others = [] if self.reference is None else [self.reference]
            known = {label for label, _ in others}
            if self.everyone:
                poses = {label: with_up(estimate.pose) for label, (_, estimate) in self.estimates.items()}
                others += [(label, pose) for label, pose in poses.items() if label not in known]
        found = {}
        for label, (estimator, estimate) in self.estimates.items():
            # Agreement of an estimator with itself carries no information.
            found[label] = errors(estimator, estimate, self.trajectory, [one for one in others if one[0] != label])
            if self.detailed:
                bound = None if isinstance(estimator, Offline) else self.bound
                found[label] += measures(estimator, estimate, self.trajectory, bound)
            nis = next((value for _, metric, value, _ in found[label] if metric == "nis"), 0.0)
            if nis > LARGEST_NIS.get(family(label), float("inf")):
                warnings.warn(
                    f"{self.trajectory.name}: the innovations of {label} are {nis:.3g} times as large (squared) as it "
                    "expects; likely causes: wrong units or signs, or a motion that goes far away (a vehicle)",
                    stacklevel=3,
                )
        self.check_north()
        return found

    def check_north(self) -> None:
        """Warn if the headings of all estimators differ from that of the truth by the same angle."""
        oriented = [label for label, (_, one) in self.estimates.items() if ORIENTATION.name in one.pose]
        offsets = [heading_offset(self.estimates[label][1], self.trajectory) for label in oriented]
        known = [offset for offset in offsets if offset is not None]
        if known and len(known) == len(offsets) and max(known) - min(known) < LARGEST_NORTH:
            warnings.warn(
                f"{self.trajectory.name}: the heading of the truth differs from that of {', '.join(oriented)} by a "
                f"constant {known[0]:.0f}°; likely cause: the x axis of the reference does not point east. Their "
                "heading and total errors are this offset",
                stacklevel=4,
            )


def known_truth(trajectory: Trajectory) -> Trajectory:
    """The trajectory without truth that is known at no sample that is scored."""
    scored = {name: np.isfinite(values[trajectory.mask]).all(axis=1).any() for name, values in trajectory.truth.items()}
    if all(scored.values()):
        return trajectory
    return trajectory.replace(truth={name: values for name, values in trajectory.truth.items() if scored[name]})


def named_trajectories(trajectories: Trajectories) -> list[Trajectory]:
    """Loaded trajectories with distinct names.

    Raises:
        ValueError: two that were given as objects have one name.
        FileNotFoundError: a recording that is not there.
    """
    single = isinstance(trajectories, Trajectory | str | Path)
    try:
        items: list[Any] = [trajectories] if single else list(trajectories)  # type: ignore[arg-type]
    except TypeError:
        items = [None]
    for item in items:
        if not isinstance(item, Trajectory | str | Path):
            raise ValueError(f"trajectories must be trajectories or paths of recordings, got {trajectories!r}")
    loaded: list[Trajectory] = []
    sources: list[Path | None] = []
    for item in items:
        found = [item] if isinstance(item, Trajectory) else load_recordings(item)
        loaded += found
        sources += [None if isinstance(item, Trajectory) else Path(item)] * len(found)
    return distinct(loaded, sources)


def distinct(trajectories: Sequence[Trajectory], paths: Sequence[Path | None]) -> list[Trajectory]:
    """The same trajectories; those that share a name are renamed by the differing parts of their paths.

    Raises:
        ValueError: two without a path have one name.
    """
    count = Counter(trajectory.name for trajectory in trajectories)
    shared = {name for name, times in count.items() if times > 1}
    files = [path.resolve() for path, one in zip(paths, trajectories, strict=True) if path and one.name in shared]
    root = Path(os.path.commonpath([file.parent for file in files])) if files else Path()
    named: list[Trajectory] = []
    for path, trajectory in zip(paths, trajectories, strict=True):
        if trajectory.name in shared and path is not None:
            relative = path.resolve().relative_to(root)
            name = relative.with_suffix("").as_posix()
            # One file may hold several sensors, and files may differ in their ending only.
            if relative.stem != trajectory.name:
                name = f"{name}/{trajectory.name}"
            if any(one.name == name for one in named):
                name = f"{relative.as_posix()}"
            trajectory = trajectory.replace(metadata={**trajectory.metadata, "name": name})
        if any(one.name == trajectory.name for one in named):
            raise ValueError(f"two trajectories are named {trajectory.name!r}; give them different names")
        named.append(trajectory)
    return named


def smoothers(contenders: Mapping[str, str | Estimator[Any]]) -> dict[str, str | Estimator[Any]]:
    """Label → smoother of every estimator that has one."""
    found: dict[str, str | Estimator[Any]] = {}
    for label, contender in contenders.items():
        try:
            made = make_estimator(contender) if isinstance(contender, str) else contender
            if hasattr(made, "smooth"):
                found[label + SUFFIX] = contender + SUFFIX if isinstance(contender, str) else Offline(made)
        except (ImportError, ValueError):  # said when the estimator itself is run
            continue
    return found


def named_estimators(estimators: Estimators) -> dict[str, str | Estimator[Any]]:
    """Label → name or estimator; unlabelled estimators are named after their model.

    Raises:
        ValueError: two of one label, or a label other than a text.
    """
    items = list(estimators) if isinstance(estimators, list | tuple) else [estimators]
    for item in estimators.values() if isinstance(estimators, Mapping) else items:
        if not isinstance(item, str | Estimator):
            raise ValueError(f"estimators must be names (poise.list_estimators) or estimators, got {item!r}")
    if isinstance(estimators, Mapping):
        wrong = [label for label in estimators if not isinstance(label, str) or not label]
        if wrong:
            raise ValueError(f"labels of estimators must be texts, got {wrong[0]!r}")
        return dict(estimators)
    labels = [item if isinstance(item, str) else label_of(item) for item in items]  # type: ignore[arg-type]
    twice = sorted({label for label in labels if labels.count(label) > 1})
    if twice:
        raise ValueError(f"several estimators are named {twice}; pass a mapping label → estimator")
    return dict(zip(labels, items, strict=True))  # type: ignore[arg-type]


def label_of(estimator: Estimator[Any]) -> str:
    """The name of an estimator, or that of its model's class."""
    name = getattr(estimator, "name", None)
    return str(name) if name else type(getattr(estimator, "model", estimator)).__name__
