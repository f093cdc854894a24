"""All that may set the gains of one filter, on the same trajectories: constants, rules, a bank, policies, bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.gain_episode import filter_for
from ....filters.adaptation.multiple_model import bank_of
from ....filters.adaptation.tuned import TunedFilter
from ....filters.support.seeds import child_seed
from ...registry import TRAINED
from ...run import fitted, run_on
from ...statistics import Interval, bootstrap_interval
from ..constant_gains import constant_errors, left_out_errors, policy_errors
from ..policy import GainPolicy
from ..rules import RULES, ruled
from .oracles import pose_error, schedule_error, windowed_oracle

POINTS = 32
"""Constant actions that hindsight and oracles choose from, besides the published and the best one."""
WINDOW = 1.0
"""s: window of the oracle."""
BANK = ("process", "measurement", "constraint")
"""Gains in which the bank of tunings differs, as far as the filter has them; two at most."""
REFERENCE = "best constant"
"""Contender that the others are compared with."""
OTHERS = "best constant of the other trajectories"
"""Contender of recordings: each is scored by the constants that are best on all others (leave one out)."""


def applicable_rules(tuned: TunedFilter) -> tuple[str, ...]:
    """Names of the rules for a filter: by its channels and gains."""
    channels = {channel.name for channel in tuned.kalman.channels}
    names = ["innovation"]
    if "bicycle_imu/gyr" in channels:
        names += ["pitch-rate", "turning"]
    if "imu/acc" in channels:
        names.append("acceleration")
    return tuple(names)


def contenders(
    tuned: TunedFilter,
    trajectories: Sequence[Trajectory],
    constant: np.ndarray,
    *,
    policies: Mapping[str, GainPolicy] | None = None,
    twins: Sequence[Trajectory] = (),
    leave_out: bool = False,
    quantity: str | None = None,
    points: int = POINTS,
    seed: int = 0,
) -> dict[str, np.ndarray]:
    """Contender → root mean square error on each trajectory ``(n,)``, rad.

    Bounds that need the truth are named ``… (knows the truth)``.

    Args:
        tuned: the filter with the actions of the policies.
        trajectories: to compare on.
        constant: best constant action ``(k,)`` of training trajectories.
        policies: name → policy.
        twins: of each trajectory another draw of errors on the same motion, for the cross-realisation oracle.
        leave_out: also the best constants of all other trajectories, of :data:`POINTS`.
        quantity: output that is scored; None for ``up``, or the first.
        points: constant actions of the bounds.
        seed: of these and of the random gains.
    """
    from scipy.stats import qmc

    spread = 2.0 * qmc.Sobol(tuned.actions, rng=np.random.default_rng(child_seed(seed, 0))).random(points) - 1.0
    grid = np.concatenate([np.zeros((1, tuned.actions)), np.asarray(constant)[None], spread])
    tried = np.stack([constant_errors(tuned, trajectories, action, quantity) for action in grid])
    found: dict[str, Any] = {"random gains": [], "published": tried[0], REFERENCE: tried[1]}
    if leave_out and len(trajectories) > 1:
        found[OTHERS] = left_out_errors(tried)
    rng, random = np.random.default_rng(child_seed(seed, 1)), []
    rules: dict[str, list[float]] = {name: [] for name in applicable_rules(tuned)}
    mixed: list[float] = []
    gain = "constraint" if "constraint" in tuned.kalman.gains else "measurement"
    chosen = [name for name in BANK if name in tuned.kalman.gains][-2:]
    bounds: dict[str, list[float]] = {"oracle of windows": [], "oracle of another draw": []}
    for index, trajectory in enumerate(trajectories):
        kalman = filter_for(tuned.kalman, trajectory)
        interval = tuned.features.interval_samples(trajectory.dt)
        actions = rng.uniform(-1.0, 1.0, (len(trajectory) // interval + 1, tuned.actions))
        drawn = np.repeat(actions, interval, axis=0)[: len(trajectory)]
        random.append(schedule_error(tuned, trajectory, drawn, quantity))
        for name, errors in rules.items():
            estimator = ruled(kalman, gain, RULES[name])
            errors.append(pose_error(kalman, estimator.run(trajectory.measurements).pose, trajectory, quantity))
        bank = bank_of(kalman, chosen)
        mixed.append(pose_error(kalman, bank.run(trajectory.measurements).pose, trajectory, quantity))
        schedule = windowed_oracle(tuned, trajectory, grid, WINDOW, quantity)
        bounds["oracle of windows"].append(schedule_error(tuned, trajectory, schedule, quantity))
        if twins:
            other = windowed_oracle(tuned, twins[index], grid, WINDOW, quantity)
            bounds["oracle of another draw"].append(schedule_error(tuned, trajectory, other, quantity))
    found["random gains"] = random
    for name, errors in rules.items():
        found["innovation-adaptive" if name == "innovation" else f"rule: {name}"] = errors
    found["multiple model"] = mixed
    learned = f"{tuned.name}+noise"
    if learned in TRAINED:
        poses = [run_on(fitted(learned, trajectory), trajectory).pose for trajectory in trajectories]
        found["learned noises"] = [
            pose_error(tuned.kalman, pose, trajectory, quantity)
            for pose, trajectory in zip(poses, trajectories, strict=True)
        ]
    for name, policy in (policies or {}).items():
        found[name] = policy_errors(tuned.kalman, policy, trajectories, quantity)
    found["hindsight constant (knows the truth)"] = tried.min(axis=0)
    for name, errors in bounds.items():
        if errors:
            found[f"{name} (knows the truth)"] = errors
    return {name: np.asarray(errors) for name, errors in found.items()}


def improvement(errors: np.ndarray, reference: np.ndarray, seed: int = 0) -> Interval:
    """Share of the reference's mean error that is saved, with an interval over trajectories that are drawn anew."""
    table = np.stack([errors, reference], axis=-1)

    def saved(*columns: np.ndarray) -> float:
        mine, theirs = (column.mean() for column in columns)
        return float(1.0 - mine / theirs)

    return bootstrap_interval(saved, table[None, :, 0], table[None, :, 1], seed=seed, tasks_too=True)


def rows_of(found: Mapping[str, np.ndarray]) -> list[dict[str, Any]]:
    """Table of contenders: mean, median and largest error, deg, and the improvement over the best constants.

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
                **{column: percent(improvement(errors, found[each])) for column, each in references.items()},
            }
        )
    return rows


def percent(interval: Interval) -> str:
    """``25 % (4 to 37)``."""
    value, low, high = (round(100 * number) for number in interval)
    return f"{value} % ({low} to {high})"
