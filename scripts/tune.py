"""Tune the gains of a filter on simulated motions: constants, or a policy that sets them while the filter runs."""

from __future__ import annotations

import csv
import itertools
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
import tyro

from ..baselines.gain_policy.compared.runs import CURVE, SETS
from ..filters.support.files import write_json, write_text
from ..filters.support.parallel import progress_bar
from ..filters.support.seeds import child_seed
from .experiment import SIMULATED, Run, command_line, open_run, recorded_sets, start_run, versions
from .output import Output
from .targets import check_file

if TYPE_CHECKING:
    from ..baselines.gain_policy.agents.learners import Trained
    from ..baselines.gain_policy.config import AgentName, TrainingConfig
    from ..baselines.gain_policy.constant_gains import ConstantGains
    from ..baselines.gain_policy.policy import GainPolicy
    from ..envs.data.trajectory import Trajectory
    from ..filters.adaptation.tuned import TunedFilter
    from ..filters.core.quantity import Quantity

QUICK_STEPS = 100_000
"""Decisions with ``--preset quick``."""
TEST_SEED, VALIDATION_SEED = 1, 2
"""Children of the root seeds for trajectories that training never sees."""
PACKAGES = ("numpy", "numba", "torch", "stable-baselines3", "sb3-contrib", "optuna", "scipy")
"""Packages whose versions the card names."""
NAMES = {"constant": "best constant", "oracle": "hindsight constant (knows the truth)"}
"""Gains as tables of contenders call them."""
SEARCHES = ("constant", "optuna")
"""Agents that do not act while the filter runs."""


@dataclass
class Args:
    """Arguments of ``poise tune``."""

    filter: tyro.conf.Positional[str] = "external-acceleration"
    """filter whose gains are tuned: any Kalman filter of ``poise list estimators`` that reads a gyroscope"""
    agent: Literal["ppo", "recurrent-ppo", "sac", "td3", "analytic", "constant", "optuna"] = "ppo"
    """what sets the gains: a policy of ppo, recurrent-ppo, sac or td3, or one trained by the exact gradient
    (analytic); or the best constant gains, by an even search (constant) or by Optuna"""
    preset: Literal["quick", "shipped"] = "quick"
    """quick: a minute or two, as a test; shipped: as long as the trainings of the weights in
    the package, whose cards name the commit that repeats them"""
    quick: bool = False
    """the preset quick, by the name that it has in other commands"""
    policy: str | None = None
    """file or shipped name of a policy of this filter: nothing is trained, only its limit of the gyroscope bias
    is found, on the motions of the preset, which must be of the kinds that it was trained on"""
    seed: int = 0
    """root seed of motions, sensors and training"""
    steps: int | None = None
    """decisions to train on, instead of the preset's"""
    trajectories: int | None = None
    """simulated trajectories of a minute to train on, instead of the preset's"""
    networks: int = 1
    """networks whose mean is the policy, each trained on motions and with weights of its own seed; not for
    recurrent-ppo nor the searches"""
    trials: int = 100
    """gains that Optuna tries"""
    recipe: str | None = None
    """recipe of hand motions to train and test on, by name or as a JSON file, at 100 Hz (default: the motions of the
    shipped policies)"""
    test_trajectories: int = 32
    """simulated trajectories that training never sees, for the comparison"""
    test_seed: int = 0
    """root seed of these; equal for all seeds of training, so that their runs can be compared"""
    recordings: tuple[Path, ...] = ()
    """files or folders of recordings with known orientation to compare on, each folder a table; never trained on"""
    report: tuple[Path, ...] = ()
    """no training: tables and figures of these finished run folders, with intervals over seeds"""
    resume: Path | None = None
    """run folder of an interrupted training; the other arguments must be the same"""
    export: Path | None = None
    """additional file for the weights"""
    runs: Path = Path("runs")
    """parent of the run folder"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Tune, compare with the published tuning and the best constant gains, and write what was found."""
    if args.report:
        return compare(args)
    if args.quick and args.preset == "shipped":
        raise ValueError("quick cannot be given with the preset shipped")
    if args.policy is not None and (args.agent in SEARCHES or args.resume is not None):
        raise ValueError("policy cannot be given with a search of constant gains, nor with resume: nothing is trained")
    from ..baselines.gain_policy.compared.contenders import rows_of
    from ..baselines.gain_policy.config import check_simulated
    from ..baselines.gain_policy.policy import GainPolicy
    from ..envs.gain_episode import check_scored
    from ..envs.gain_reward import scored_quantities
    from ..filters.adaptation.gains import tunable_filter
    from ..filters.adaptation.tuned import TunedFilter

    check_file("export", args.export, args.recordings)
    check_networks(args)
    if args.agent == "optuna" and args.trials < 1:
        raise ValueError(f"trials must be at least 1, got {args.trials}")
    config = training_config(args)
    tuned = TunedFilter.of(tunable_filter(args.filter), config.gains)
    check_simulated(config, tuned)
    scored = scored_quantities(tuned.kalman, config.quantities or None)
    quantity = replace(scored[0], name=", ".join(each.name for each in scored))
    given = None if args.policy is None else loaded(args.policy, tuned)
    recorded = recorded_sets(args.recordings)
    for each in itertools.chain.from_iterable(recorded.values()):
        check_scored(each, tuned, scored)
    folder = open_run(
        "tune", args, may_differ=("quick", "steps", "test_trajectories", "test_seed", "recordings", "report")
    )
    unseen = config.motions.draw_many(child_seed(args.test_seed, TEST_SEED), args.test_trajectories)
    sets = {SIMULATED: unseen, **recorded}
    with Output("tune", args) as out:
        constant = searched(args, config, tuned, out)
        candidates: dict[str, Trained] = {
            "published": GainPolicy.neutral(tuned),
            "constant": GainPolicy.constant(tuned, constant.action),
        }
        if given is not None:
            candidates["policy without limit"] = replace(given, bias_limit=math.inf)
            candidates["policy"] = limited(given, config, tuned)
        elif args.agent not in SEARCHES:
            candidates["policy"] = train(args, folder, constant.action)
        errors = errors_of(tuned, candidates, sets, constant, config.quantities or None)
        write_json(folder.folder / SETS, {group: [each.name for each in some] for group, some in sets.items()})
        folder.write_results(results(errors, sets, quantity))
        summary = {
            name: {group: round(float(np.degrees(np.mean(found[name]))), 4) for group, found in errors.items()}
            for name in [*candidates, "oracle"]
        }
        for group, found in errors.items():
            named = {NAMES.get(each, each): values for each, values in found.items()}
            out.table(
                rows_of(named), f"Error of {args.filter} ({quantity.name}) on {group} trajectories, RMS of each, deg"
            )
        final = candidates["constant" if args.agent in SEARCHES else "policy"]
        card = card_of(args, final, constant, summary)
        out.say(f"weights: {final.save(folder.folder / 'policy', card)}")
        if args.export is not None:
            out.say(f"weights: {final.save(args.export, card)}")
        out.add(run=str(folder.folder), card=card)
    return 0


def compare(args: Args) -> int:
    """Tables and figures of finished runs."""
    from ..baselines.gain_policy.compared.runs import TuneRun, comparison, curves_figure, profiles_figure
    from ..baselines.plots import save

    runs = [TuneRun.read(folder) for folder in args.report]
    rows = comparison(runs, args.seed)
    folder = start_run("tune-report", args, args.seed, args.runs)
    with Output("tune", args) as out:
        out.table(rows, "Agents over their seeds of training; intervals of 95 %")
        figures = {f"profiles-{group}": profiles_figure(runs, group) for group in runs[0].sets}
        if (curves := curves_figure(runs)) is not None:
            figures["curves"] = curves
        for name, figure in figures.items():
            save(figure, folder.figures / f"{name}.png")
        pictures = "\n\n".join(f"![{name}](figures/{name}.png)" for name in figures)
        out.sections["Figures"] = pictures
        out.report(folder.write_report("Agents that tune filters", out.sections))
    return 0


def check_networks(args: Args) -> None:
    """Refuse a number of networks that no training can have.

    Raises:
        ValueError: it is not positive, or more than one of what cannot be averaged.
    """
    if args.networks < 1:
        raise ValueError(f"networks must be at least 1, got {args.networks}")
    if args.networks > 1 and (args.policy is not None or args.agent in (*SEARCHES, "recurrent-ppo")):
        of = "a finished policy" if args.policy is not None else f"the agent {args.agent}"
        raise ValueError(f"networks must be 1 for {of}, got {args.networks}")


def training_config(args: Args) -> TrainingConfig:
    """The configuration that the arguments ask for."""
    from ..baselines.gain_policy.config import config_of, shipped_config

    if args.preset == "shipped":
        config = shipped_config(args.filter)
    else:
        config = replace(shipped_config(args.filter), total_timesteps=QUICK_STEPS, trajectories=48, warm_start=24)
    given: dict[str, Any] = {"total_timesteps": args.steps, "trajectories": args.trajectories}
    if args.recipe is not None:
        from ..envs.recipes.registry import hand_recipe

        given["motions"] = replace(hand_recipe(args.recipe), rates=(100.0, 100.0))
    config = replace(config, seed=args.seed, **{name: value for name, value in given.items() if value is not None})
    return config if args.agent in SEARCHES else config_of(cast("AgentName", args.agent), config)


def searched(args: Args, config: TrainingConfig, tuned: TunedFilter, out: Output) -> ConstantGains:
    """The best constant gains on training trajectories."""
    from ..baselines.gain_policy.constant_gains import best_constant_gains

    motions = config.motions.draw_many(config.seed, min(config.trajectories, 48))
    out.say(f"searching constant gains of {args.filter} on {len(motions)} trajectories")
    if args.agent == "optuna":
        from ..baselines.gain_policy.agents.optuna_search import optuna_constant_gains

        return optuna_constant_gains(tuned, motions, trials=args.trials, seed=args.seed)
    samples, refinements = (config.gain_search,) * 2 if args.preset == "shipped" else (16, 20)
    guesses = () if config.warm_start_centre is None else (config.warm_start_centre,)
    common: dict[str, Any] = {"guesses": guesses, "samples": samples, "refinements": refinements, "seed": args.seed}
    return best_constant_gains(tuned, motions, quantity=config.quantities or None, **common)


def train(args: Args, folder: Run, start: np.ndarray) -> Trained:
    """Train a policy from a constant action; the best look at validation trajectories is kept."""
    from ..baselines.checkpoint import has_checkpoint
    from ..baselines.gain_policy.agents.learners import policy_errors_of
    from ..baselines.gain_policy.networks import train_networks
    from ..baselines.gain_policy.training import CHECKPOINT, train_policy
    from ..filters.adaptation.gains import tunable_filter

    config, kalman = training_config(args), tunable_filter(args.filter)
    # The exact gradient holds back some of its own trajectories.
    count = 0 if config.agent == "analytic" else min(24, config.trajectories)
    unseen = config.motions.draw_many(child_seed(args.seed, VALIDATION_SEED), count)
    curve = Curve(folder.folder / CURVE, resumed=args.resume is not None)
    with progress_bar(args.networks * config.total_timesteps, f"tune {args.filter}", "step") as bar:

        def report(progress: Mapping[str, float]) -> None:
            bar.update(int(progress["steps"]) - bar.n)
            bar.set_postfix(gain=f"{progress['gain']:.3f}")
            curve.add(progress["steps"], progress["gain"])

        common: dict[str, Any] = {
            "start": start,
            "folder": folder.folder,
            "report": report,
            "validate": lambda policy: float(np.mean(policy_errors_of(kalman, policy, unseen))),
        }
        again = args.resume is not None
        if args.networks > 1:
            policy: Trained = train_networks(config, args.networks, resume=again, **common)
        else:
            again = again and has_checkpoint(folder.folder / CHECKPOINT)
            policy = train_policy(config, resume=again, **common)
    curve.write()
    return policy


def loaded(name: str, tuned: TunedFilter) -> GainPolicy:
    """A policy of a filter, by file or shipped name.

    Raises:
        ValueError: it is a policy of another filter, or sets other gains; their ranges are its own.
    """
    from ..baselines.gain_policy.policy import GainPolicy

    policy = GainPolicy.load(name)
    wanted, sets = ([part.gain for part in ranges] for ranges in (tuned.ranges, policy.ranges))
    if policy.filter != tuned.name or sets != wanted:
        raise ValueError(
            f"policy must set the gains {wanted} of {tuned.name}, got {name!r}, which sets {sets} of {policy.filter}"
        )
    return policy


def limited(policy: GainPolicy, config: TrainingConfig, tuned: TunedFilter) -> GainPolicy:
    """A policy with its limit for the gyroscope bias, found on motions that it was trained on."""
    from ..baselines.gain_policy.known_bias import QUANTILE, WITNESS, bias_limit

    limit = bias_limit(tuned.kalman, config.motions.draw_many(config.seed, config.trajectories))
    origin = policy.card.get("policy", policy.card)
    card = {
        "agent": origin.get("agent"),
        "policy": origin,
        "motions": config.describe()["motions"],
        "bias_limit_by": {"filter": WITNESS, "quantile": QUANTILE, "trajectories": config.trajectories},
    }
    return replace(policy, bias_limit=limit, card=card)


class Curve:
    """The reward per decision over a training, in a file that a resumed training continues.

    Args:
        path: of the file.
        resumed: whether to begin with what the file holds.
    """

    def __init__(self, path: Path, resumed: bool) -> None:
        self.path, self.rows, self.written = path, [], time.monotonic()
        if resumed and path.is_file():
            with path.open(encoding="utf-8", newline="") as file:
                self.rows = [(float(row["steps"]), float(row["gain"])) for row in csv.DictReader(file)]

    def add(self, steps: float, gain: float) -> None:
        """Note a point; later ones, of what was lost in an interruption, go."""
        self.rows = (
            [row for row in self.rows if row[0] < steps] if self.rows and self.rows[-1][0] >= steps else self.rows
        )
        self.rows.append((steps, gain))
        if time.monotonic() - self.written > 10.0:
            self.write()

    def write(self) -> None:
        """Write the file."""
        self.written = time.monotonic()
        write_text(self.path, "steps,gain\n" + "".join(f"{steps:.0f},{gain!r}\n" for steps, gain in self.rows))


def errors_of(
    tuned: TunedFilter,
    candidates: Mapping[str, Trained],
    sets: Mapping[str, Sequence[Trajectory]],
    constant: ConstantGains,
    quantity: str | Sequence[str] | None = None,
    points: int = 32,
) -> dict[str, dict[str, np.ndarray]]:
    """Set of trajectories → gains → error on each trajectory, rad.

    The ``oracle`` takes the best of ``points`` constant gains on each trajectory, chosen with the truth known: a bound,
    not a method.
    """
    from ..baselines.gain_policy.agents.learners import policy_errors_of
    from ..baselines.gain_policy.constant_gains import constant_errors

    # The first that were tried lie evenly in the box; those at the end crowd around the best.
    actions, table = [constant.action, *constant.tried[:points]], {}
    for group, trajectories in sets.items():
        found = {
            name: policy_errors_of(tuned.kalman, policy, trajectories, quantity) for name, policy in candidates.items()
        }
        tried = [constant_errors(tuned, trajectories, action, quantity) for action in actions]
        found["oracle"] = np.min(tried, axis=0)
        table[group] = found
    return table


def results(
    errors: Mapping[str, Mapping[str, np.ndarray]], sets: Mapping[str, Sequence[Trajectory]], quantity: Quantity
) -> list[dict[str, Any]]:
    """The same as rows of results, in degrees, from errors in rad: set of trajectories → gains → error on each."""
    metric = "inclination" if quantity.kind == "direction" else "rmse"
    common = {"quantity": quantity.name, "metric": metric, "unit": "deg"}
    return [
        {"estimator": name, "trajectory": trajectory.name, "value": math.degrees(value), **common}
        for group, found in errors.items()
        for name, values in found.items()
        for trajectory, value in zip(sets[group], values, strict=True)
    ]


def card_of(
    args: Args, policy: Trained, constant: ConstantGains, summary: Mapping[str, Mapping[str, float]]
) -> dict[str, Any]:
    """What the policy is and how it came about."""
    return {
        "name": f"{args.filter.replace('-', '_')}_policy",
        "description": f"sets the gains of the {args.filter} filter while it runs",
        "agent": args.agent,
        "command": command_line(
            "tune", args, ("agent", "preset", "policy", "networks", "seed", "steps", "trajectories", "recipe")
        ),
        "data": "simulated" if args.recipe is None else f"recipe {args.recipe}",
        **policy.card,
        "best_constant": [round(float(value), 4) for value in constant.action],
        "test_error_deg": {name: dict(values) for name, values in summary.items()},
        "versions": versions(PACKAGES),
        "date": date.today().isoformat(),
        "licence": "MIT",
    }
