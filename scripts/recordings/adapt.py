"""Compare what can set the gains of a filter: constants, rules, a bank of tunings, policies, bounds."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tyro

from ...filters.support.seeds import child_seed
from ..experiment import SIMULATED, recorded_sets, start_run
from ..output import Output
from ..tune import TEST_SEED

if TYPE_CHECKING:
    from ...baselines.gain_policy.constant_gains import ConstantGains
    from ...envs.data.trajectory import Trajectory
    from ...filters.adaptation.tuned import TunedFilter


@dataclass
class Args:
    """Arguments of ``poise adapt``."""

    filter: tyro.conf.Positional[str] = "external-acceleration"
    """name of a Kalman filter; of rides: two-gyro-level, two-gyro-consistent, platform-gyro, balanced-gyro, whole-body,
    or force-inertial, force-inertial-consistent or odometry-aided, whose sensors then have a lasting fault"""
    quantities: tuple[str, ...] = ()
    """outputs of the filter that are scored together (default: up, or the first)"""
    recordings: tuple[Path, ...] = ()
    """files or folders of recordings with known truth, each folder a table (default: simulated trajectories that no
    policy was trained on)"""
    policies: tuple[str, ...] = ()
    """shipped names or files of policies (default: the filter's shipped one)"""
    trajectories: int = 24
    """number of simulated trajectories to compare on, without recordings"""
    errors: float = 1.0
    """factor on sensor and placement errors of the simulated rides that are compared on; 0.01 leaves the errors
    that gains can reduce"""
    turned: bool = False
    """rides: the other draw of sensors, on which the oracle chooses, has the bicycle's IMU turned otherwise too, which
    no sensor shows"""
    training: int = 24
    """simulated trajectories on which the best constants are searched"""
    points: int = 32
    """constant gains that the bounds choose from"""
    search: int = 32
    """constant gains that the search for the best ones begins with; 24 more follow"""
    folds: int = 0
    """folds of the recordings: also compare policies trained on the recordings of all other folds, by the exact
    gradient; 0: none"""
    ablation: bool = False
    """also print what each policy loses without a group of its observations, and with a gain kept constant"""
    seed: int = 0
    """root seed of simulated trajectories, searches and intervals"""
    runs: Path = Path("runs")
    """parent of the run folder"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Print one table a set of trajectories, and leave the errors of all in a run folder."""
    from ...baselines.gain_policy.compared.ablation import ablation
    from ...baselines.gain_policy.compared.contenders import contenders, rows_of, side_by_side
    from ...baselines.gain_policy.compared.explained import gains_by_motion, gains_figure
    from ...baselines.gain_policy.config import check_simulated, shipped_config
    from ...baselines.gain_policy.constant_gains import best_constant_gains
    from ...baselines.gain_policy.motions import RiddenMotions
    from ...baselines.gain_policy.policy import GainPolicy
    from ...baselines.plots import save
    from ...baselines.weights_io import list_weights
    from ...envs.gain_episode import check_scored
    from ...envs.gain_reward import scored_quantities
    from ...filters.adaptation.gains import tunable_filter
    from ...filters.adaptation.tuned import TunedFilter
    from ..tune import results

    config = shipped_config(args.filter)
    if args.folds and not args.recordings:
        raise ValueError("folds can only be given with recordings, which policies are trained on in turn")
    if args.folds and len(args.quantities) > 1:
        raise ValueError(f"folds train on one quantity, got {list(args.quantities)}")
    if args.errors != 1.0 and (args.recordings or not isinstance(config.motions, RiddenMotions)):
        raise ValueError("errors can only be given for simulated rides: recordings and hand motions keep theirs")
    if args.turned and (args.recordings or not isinstance(config.motions, RiddenMotions)):
        raise ValueError("turned can only be given for simulated rides")
    shipped = f"{args.filter.replace('-', '_')}_policy"
    names = args.policies or tuple(name for name in (shipped,) if name in list_weights())
    policies = {"policy" if name == shipped else f"policy {Path(name).stem}": GainPolicy.load(name) for name in names}
    unlimited = {
        f"{name} without limit": replace(policy, bias_limit=math.inf)
        for name, policy in policies.items()
        if math.isfinite(policy.bias_limit)
    }
    tuned = TunedFilter.of(tunable_filter(args.filter), config.gains)
    check_simulated(config, tuned)
    scored = scored_quantities(tuned.kalman, args.quantities or None)
    quantity = replace(scored[0], name=", ".join(each.name for each in scored))
    sets = recorded_sets(args.recordings)
    for each in itertools.chain.from_iterable(sets.values()):
        check_scored(each, tuned, scored)
    folder = start_run("adapt", args, args.seed, args.runs)
    with Output("adapt", args) as out:
        motions = config.motions.draw_many(config.seed, args.training)
        out.say(f"searching constant gains of {args.filter} on {len(motions)} trajectories")
        guesses = () if config.warm_start_centre is None else (config.warm_start_centre,)
        constant = best_constant_gains(
            tuned,
            motions,
            quantity=args.quantities or None,
            guesses=guesses,
            samples=args.search,
            refinements=24,
            seed=args.seed,
        )
        twins: list[Trajectory] = []
        if not sets:
            sets, twins = simulated(args, config.motions)
        errors = {}
        for group, trajectories in sets.items():
            errors[group], nees = contenders(
                tuned,
                trajectories,
                constant.action,
                policies=policies | unlimited,
                twins=twins,
                quantity=args.quantities or None,
                leave_out=bool(args.recordings),
                points=args.points,
                seed=args.seed,
            )
            if args.folds:
                errors[group] |= left_out(args, tuned, trajectories, constant)
            title = f"Error of {args.filter} ({quantity.name}) on {len(trajectories)} {group} trajectories, deg"
            out.table(rows_of(errors[group], nees), title)
            for name, policy in policies.items():
                explained = gains_by_motion(tuned.kalman, policy, trajectories)
                out.table(explained, f"Factors on the variances by {name}, geometric means of {group} seconds")
                if args.ablation:
                    rows = ablation(tuned.kalman, policy, trajectories, constant.action)
                    out.table(rows, f"Error of {name} without parts of it on {group} trajectories, deg")
        if len(errors) > 1:
            out.table(side_by_side(errors), f"Mean errors of {args.filter} ({quantity.name}), deg, and what is saved")
        for name, policy in policies.items():
            file = folder.figures / f"{name.replace(' ', '-')}.png"
            save(gains_figure(tuned.kalman, policy, sets), file)
            out.say(f"factors over the motion: {file}")
        folder.write_results(results(errors, sets, quantity))
        out.say(f"errors of every trajectory: {folder.folder / 'results.csv'}")
    return 0


def left_out(
    args: Args, tuned: TunedFilter, trajectories: list[Trajectory], constant: ConstantGains
) -> dict[str, np.ndarray]:
    """Contender → errors, rad, of policies that were trained on the other recordings."""
    from ...baselines.gain_policy.compared.left_out import left_out_policy_errors

    # The best of a search in simulation and the first that it tried, which lie evenly in the box.
    actions = np.concatenate([constant.action[None], constant.tried[: args.points]])
    quantity = args.quantities[0] if args.quantities else None
    errors = left_out_policy_errors(tuned, trajectories, actions, args.folds, quantity=quantity, seed=args.seed)
    return {"policy of the other trajectories": errors}


def simulated(args: Args, motions: object) -> tuple[dict[str, list[Trajectory]], list[Trajectory]]:
    """Trajectories that no policy was trained on; of rides also another draw of devices on each."""
    from ...baselines.gain_policy.motions import RiddenMotions
    from ...envs.recipes.rides import drawn

    seed = child_seed(args.seed, TEST_SEED)
    if not isinstance(motions, RiddenMotions):
        return {SIMULATED: motions.draw_many(seed, args.trajectories)}, []  # type: ignore[attr-defined]
    source = replace(motions.source, draws=2, changes=smaller_errors(motions.source.changes, args.errors))
    pairs = [drawn(source, seed, index, args.turned) for index in range(args.trajectories)]
    lasting = [pair for pair in pairs if pair[0].mask.any()]
    # Left and right may be exchanged between the two draws; the schedule of gains does not depend on the side.
    return {SIMULATED: [pair[0] for pair in lasting]}, [pair[1] for pair in lasting]


def smaller_errors(changes: Mapping[str, Any], factor: float) -> dict[str, Any]:
    """Changes of a recipe of rides, with a factor on the errors of sensors and of their placement.

    Raises:
        ValueError: a factor that is not a positive number.
    """
    if not 0.0 < factor < math.inf:
        raise ValueError(f"errors must be a positive factor, got {factor}")
    sensors = dict(changes["sensors"])
    sensors["noise_scale"] = [factor * value for value in sensors["noise_scale"]]
    return {**changes, "placement_errors": factor, "sensors": sensors}
