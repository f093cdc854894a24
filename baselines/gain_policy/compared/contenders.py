"""All that may set the gains of one filter, on the same trajectories: constants, rules, a bank, policies, bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.gain_episode import filter_for
from ....envs.gain_reward import scored_quantities, true_values
from ....filters.adaptation.multiple_model import bank_of
from ....filters.adaptation.rules import RULES
from ....filters.adaptation.tuned import TunedFilter
from ....filters.core.estimator import Estimator, run
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import Estimate
from ....filters.support.seeds import child_seed
from ...measures import consistency_of
from ...registry import RULED, TRAINED, make_estimator
from ...run import fitted, layout_of
from ...statistics import Interval, bootstrap_interval
from ..adaptive import AdaptiveEstimator
from ..constant_gains import left_out_errors
from ..policy import GainPolicy
from ..rules import ruled
from .oracles import Quantities, pose_error, schedule_error, windowed_oracle

POINTS = 32
"""Constant actions that hindsight and oracles choose from, besides the published and the best one."""
WINDOW = 1.0
"""s: window of the oracle."""
BELIEF = ("constraint", "measurement")
"""Gain that rules set, the first that a filter has; else the first that acts."""
OTHER_FORMS = {
    "two-gyro-level": ("balanced-gyro",),
    "platform-gyro": ("balanced-gyro",),
    "force-inertial": ("force-inertial-consistent",),
    "whole-body": ("whole-body-consistent",),
    "odometry-aided": ("balanced-gyro",),
}
"""Filter → filters of this package for the same quantity from its sensors, or some of them."""
BANK = ("process", "measurement", "constraint")
"""Gains in which the bank of tunings differs, as far as the filter has them; two at most."""
REFERENCE = "best constant"
"""Contender that the others are compared with."""
OTHERS = "best constant of the other trajectories"
"""Contender of recordings: each is scored by the constants that are best on all others (leave one out)."""


class Contenders(NamedTuple):
    """Contender → numbers of each trajectory ``(n,)``.

    Attributes:
        errors: root mean square, rad.
        nees: mean normalised estimation error squared a degree of freedom, of those whose covariance is known.
    """

    errors: dict[str, np.ndarray]
    nees: dict[str, np.ndarray]


def applicable_rules(tuned: TunedFilter) -> tuple[str, ...]:
    """Names of the rules for a filter: by its channels and gains."""
    channels = {channel.name for channel in tuned.kalman.channels}
    names = ["innovation"]
    if tuned.name in RULED and "turning" in RULED[tuned.name]:
        names += ["pitch-rate", "turning"]
    if "imu/acc" in channels:
        names.append("acceleration")
    return tuple(names)


def estimators_for(
    tuned: TunedFilter, trajectory: Trajectory, constant: np.ndarray, policies: Mapping[str, GainPolicy]
) -> dict[str, Estimator[Any]]:
    """Contender → estimator, for the rider, vehicle or device of a trajectory; those that need no truth."""
    kalman = replace(filter_for(tuned.kalman, trajectory), keep_covariance=True)
    acted = next((name for name in BELIEF if name in kalman.gains), tuned.ranges[0].gain)
    chosen = [name for name in BANK if name in kalman.gains][-2:] or [part.gain for part in tuned.ranges[:2]]
    found: dict[str, Estimator[Any]] = {
        "published": kalman,
        REFERENCE: AdaptiveEstimator(kalman, GainPolicy.constant(tuned, constant)),
    }
    for name in applicable_rules(tuned):
        label = "innovation-adaptive" if name == "innovation" else f"rule: {name}"
        found[label] = ruled(kalman, acted, RULES[name])
    found["multiple model"] = bank_of(kalman, chosen)
    if (learned := f"{tuned.name}+noise") in TRAINED:
        found["learned noises"] = fitted(learned, trajectory)
    for name in OTHER_FORMS.get(tuned.name, ()):
        found[f"filter: {name}"] = make_estimator(
            name, dt=trajectory.dt, metadata=trajectory.metadata, keep_covariance=True
        )
    return found | {name: AdaptiveEstimator(kalman, policy) for name, policy in policies.items()}


def contenders(
    tuned: TunedFilter,
    trajectories: Sequence[Trajectory],
    constant: np.ndarray,
    *,
    policies: Mapping[str, GainPolicy] | None = None,
    twins: Sequence[Trajectory] = (),
    leave_out: bool = False,
    quantity: Quantities = None,
    points: int = POINTS,
    seed: int = 0,
) -> Contenders:
    """Errors and consistency of all that may set the gains.

    Bounds that need the truth are named ``… (knows the truth)``.

    Args:
        tuned: the filter with the actions of the policies.
        trajectories: to compare on.
        constant: best constant action ``(k,)`` of training trajectories.
        policies: name → policy.
        twins: of each trajectory another draw of errors on the same motion, for the cross-realisation oracle.
        leave_out: also the best constants of all other trajectories, of :data:`POINTS`.
        quantity: outputs that are scored together; None for ``up``, or the first.
        points: constant actions of the bounds.
        seed: of these and of the random gains.
    """
    from scipy.stats import qmc

    spread = 2.0 * qmc.Sobol(tuned.actions, rng=np.random.default_rng(child_seed(seed, 0))).random(points) - 1.0
    grid = np.concatenate([np.zeros((1, tuned.actions)), np.asarray(constant)[None], spread])
    tried = np.array([[schedule_error(tuned, each, action, quantity) for each in trajectories] for action in grid])
    rng = np.random.default_rng(child_seed(seed, 1))
    errors: dict[str, list[float]] = {"random gains": []}
    nees: dict[str, list[float]] = {}
    bounds: dict[str, list[float]] = {"oracle of windows": [], "oracle of another draw": []}
    for index, trajectory in enumerate(trajectories):
        interval = tuned.features.interval_samples(trajectory.dt)
        actions = rng.uniform(-1.0, 1.0, (len(trajectory) // interval + 1, tuned.actions))
        drawn = np.repeat(actions, interval, axis=0)[: len(trajectory)]
        errors["random gains"].append(schedule_error(tuned, trajectory, drawn, quantity))
        for name, estimator in estimators_for(tuned, trajectory, constant, policies or {}).items():
            estimate = run(estimator, trajectory.measurements)._replace(layout=layout_of(estimator))
            errors.setdefault(name, []).append(pose_error(tuned.kalman, estimate.pose, trajectory, quantity))
            nees.setdefault(name, []).append(mean_nees(tuned.kalman, estimate, trajectory, quantity))
        schedule = windowed_oracle(tuned, trajectory, grid, WINDOW, quantity)
        bounds["oracle of windows"].append(schedule_error(tuned, trajectory, schedule, quantity))
        if twins:
            other = windowed_oracle(tuned, twins[index], grid, WINDOW, quantity)
            bounds["oracle of another draw"].append(schedule_error(tuned, trajectory, other, quantity))
    found = {name: np.asarray(each) for name, each in errors.items()}
    if leave_out and len(trajectories) > 1:
        found[OTHERS] = left_out_errors(tried)
    found["hindsight constant (knows the truth)"] = tried.min(axis=0)
    found |= {f"{name} (knows the truth)": np.asarray(each) for name, each in bounds.items() if each}
    known = {name: np.asarray(each) for name, each in nees.items() if np.isfinite(each).all()}
    return Contenders(found, known)


def mean_nees(kalman: KalmanFilter, estimate: Estimate, trajectory: Trajectory, quantity: Quantities) -> float:
    """Mean NEES a degree of freedom of what is scored; NaN where its covariance is not known."""
    found = [
        consistency_of(output, estimate, true_values(trajectory, output, kalman), trajectory.mask)
        for output in scored_quantities(kalman, quantity)
    ]
    values, degrees = zip(*(each or (math.nan, 1) for each in found), strict=True)
    return float(np.average(values, weights=degrees))


def improvement(errors: np.ndarray, reference: np.ndarray, seed: int = 0) -> Interval:
    """Share of the reference's mean error that is saved, with an interval over trajectories that are drawn anew."""
    table = np.stack([errors, reference], axis=-1)

    def saved(*columns: np.ndarray) -> float:
        mine, theirs = (column.mean() for column in columns)
        return float(1.0 - mine / theirs)

    return bootstrap_interval(saved, table[None, :, 0], table[None, :, 1], seed=seed, tasks_too=True)


def rows_of(found: Mapping[str, np.ndarray], nees: Mapping[str, np.ndarray] | None = None) -> list[dict[str, Any]]:
    """Table of contenders: mean, median and largest error, deg, NEES, and the improvement over the best constants.

    The columns of what is saved compare with the constants of training trajectories and, where they are among the
    contenders, with those of the other trajectories.
    """
    references = {"saved": REFERENCE} | ({"saved of the others'": OTHERS} if OTHERS in found else {})
    rows = []
    for name, errors in found.items():
        known = np.degrees(errors)
        rows.append(
            {
                "gains by": name,
                "mean": float(known.mean()),
                "median": float(np.median(known)),
                "largest": float(known.max()),
                **({} if nees is None else {"NEES": float(nees[name].mean()) if name in nees else math.nan}),
                **{column: percent(improvement(errors, found[each])) for column, each in references.items()},
            }
        )
    return rows


def side_by_side(sets: Mapping[str, Mapping[str, np.ndarray]]) -> list[dict[str, Any]]:
    """Several sets of trajectories beside each other: mean errors, deg, and what is saved of the reference's.

    What is saved is that of the best constants of the other trajectories, where they are among the contenders.

    Args:
        sets: name → contender → errors ``(n,)``, rad.
    """
    rows: dict[str, dict[str, Any]] = {}
    for group, found in sets.items():
        reference = found[OTHERS if OTHERS in found else REFERENCE]
        for name, errors in found.items():
            row = rows.setdefault(name, {"gains by": name})
            row[f"{group} ({len(errors)})"] = float(np.degrees(errors).mean())
            row[f"saved, {group}"] = percent(improvement(errors, reference))
    return list(rows.values())


def percent(interval: Interval) -> str:
    """``25 % (4 to 37)``."""
    value, low, high = (round(100 * number) for number in interval)
    return f"{value} % ({low} to {high})"
