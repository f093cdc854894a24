"""Train a learned estimator; weights, model card, arguments and versions are written to a run folder."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from ..filters.support.names import look_up
from ..filters.support.rows import jsonable
from .experiment import command_line, known_recordings, open_run, versions
from .output import Output
from .targets import check_file

if TYPE_CHECKING:
    import pandas

    from ..baselines.learned.fit import FitResult
    from ..baselines.learned.presets import Preset
    from ..envs.data.trajectory import Trajectory

CONTENDERS = ("bounded-motion", "vqf", "mahony", "tilt", "gyroscope-integration")
"""What a network for one inertial sensor is compared with on the test episodes."""
NINE = ("bounded-motion-9", "mekf-9", "vqf-9", "mahony-9")
"""The same for one with a magnetometer."""
GESTURES = ("slow", "fast", "severe", "mixed")
"""Gestures of the hand-motion environment on which it is tested besides episodes of its recipes."""
OPTIONS = (
    *("quick", "seed", "replicate", "episodes", "epochs", "units", "recipe", "recordings", "teacher", "start"),
    "test_episodes",
)
"""Arguments that the weights and their card depend on."""


@dataclass
class Args:
    """Arguments of ``poise train``."""

    preset: tyro.conf.Positional[str] = "bounded-motion+network"
    """preset to train (`poise list presets`); `poise tune` trains gain policies"""
    quick: bool = False
    """a small version: some minutes"""
    seed: int = 0
    """root seed of episodes, weights and order"""
    replicate: int = 0
    """number of a repetition on the same data, with other initial weights and another order"""
    episodes: int | None = None
    """simulated training episodes, or rides, in all, instead of the preset's"""
    epochs: int | None = None
    """passes over the episodes, instead of the preset's"""
    units: int | None = None
    """units of the network, instead of the preset's"""
    recipe: str | None = None
    """recipe to train on instead of the preset's, by name (`poise list recipes`) or as a JSON file"""
    recordings: tuple[Path, ...] = ()
    """files or folders of recordings to train on instead of simulated episodes; of five or more the last fifth
    chooses the best epoch"""
    teacher: Literal["truth", "smoother"] = "truth"
    """labels of the recordings: their truth, or the smoother of the corrected filter, which needs none"""
    start: Path | None = None
    """weights to start from, such as those of a training on simulation"""
    calibrate: Path | None = None
    """weights of a preset for rides, to find their covariance anew on held-out rides without any training"""
    test_episodes: int | None = None
    """simulated episodes to test the finished network on (default: 48, with --quick 8)"""
    processes: int = 2
    """number of parallel processes that simulate episodes; the weights do not depend on it"""
    resume: Path | None = None
    """run folder of an interrupted training; the other arguments must be the same"""
    export: Path | None = None
    """additional file for the weights"""
    runs: Path = Path("runs")
    """parent of the run folder"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Train, test, and write weights with their card."""
    from ..baselines.checkpoint import has_checkpoint
    from ..baselines.learned.fit import CHECKPOINT
    from ..baselines.learned.training import started, train_preset

    start = process_times()
    check_file("export", args.export, args.recordings)
    preset = chosen(args)
    if args.calibrate is not None:
        return recalibrate(args, preset)
    if args.start is not None:
        started(args.start, preset.front_end(), preset.head())  # raises, before there is a run
    own = known_recordings(args.recordings) if args.recordings else None
    folder = open_run("train", args, may_differ=("test_episodes", "processes"))
    with Output("train", args) as out:
        result = train_preset(
            *(preset, args.seed, folder.folder),
            recordings=own,
            teacher=args.teacher == "smoother",
            replicate=args.replicate,
            start=args.start,
            resume=args.resume is not None and has_checkpoint(folder.folder / CHECKPOINT),
            processes=args.processes,
            say=out.say,
        )
        spent = [round(now - before) for now, before in zip(process_times(), start, strict=True)]
        table = test(result, preset, args, out)
        folder.write_results(table)
        card = card_of(args, preset, result, table) | {
            "training_seconds": {"wall": spent[0], "processor": spent[1], "resumed": args.resume is not None}
        }
        path = result.estimator.save(folder.folder / args.preset.replace("+", "_"), card)
        out.say(f"weights: {path}")
        if args.export is not None:
            out.say(f"weights: {result.estimator.save(args.export, card)}")
        columns = means(table)
        rows = [
            {"estimator": name, **{group: each[name]["mean_deg"] for group, each in columns.items() if name in each}}
            for name in table["estimator"].unique()
        ]
        out.table(rows, "Error on unseen simulated episodes, mean of RMS, deg")
        out.add(run=str(folder.folder), card=card)
    return 0


def recalibrate(args: Args, preset: Preset) -> int:
    """Write weights, as they are, with a covariance found anew and a card that tells so."""
    from ..baselines.learned.limits import limits_of
    from ..baselines.learned.training import calibrate_weights
    from ..baselines.weights_io import DIGEST, load_card

    weights = Path(str(args.calibrate))
    others = [each for each in ("recordings", "start", "resume") if getattr(args, each)]
    if others:
        raise ValueError(f"--calibrate trains nothing: it takes no --{others[0]}")
    old = load_card(weights)
    folder = open_run("train", args, may_differ=("processes",))
    with Output("train", args) as out:
        made, found = calibrate_weights(preset, args.seed, weights, processes=args.processes, show=not args.json)
        now = jsonable(found._asdict())
        card = {name: value for name, value in old.items() if name != DIGEST} | {
            "calibration": now,
            "limits": limits_of(preset, made, found),
            "calibrated": {"command": command_line("train", args, (*OPTIONS, "calibrate"))} | today(),
        }
        path = made.save(folder.folder / args.preset.replace("+", "_"), card)
        for file in [path] if args.export is None else [path, made.save(args.export, card)]:
            out.say(f"weights: {file}")
        kept = ("rides", "nees", "coverage")
        rows = [
            {"covariance": label, **{name: each.get(name) for name in kept}}
            for label, each in (("before", old.get("calibration") or {}), ("now", now))
        ]
        out.table(rows, "Each held-out ride under the covariance of the others")
        out.add(run=str(folder.folder), card=card)
    return 0


def today() -> dict[str, Any]:
    """Versions and date, for a card."""
    return {"versions": versions(("numpy", "numba", "torch", "scipy")), "date": date.today().isoformat()}


def process_times() -> tuple[float, float]:
    """Seconds of a clock, and of processors spent here and in finished processes that were started here."""
    spent = os.times()
    return time.perf_counter(), spent.user + spent.system + spent.children_user + spent.children_system


def chosen(args: Args) -> Preset:
    """The preset that the arguments ask for.

    Raises:
        ValueError: an unknown name, or a number out of its range.
    """
    from ..baselines.learned.gains.presets import all_presets

    preset: Preset = look_up("preset", args.preset, all_presets())
    preset = preset.quick() if args.quick else preset
    if args.recipe is not None:
        if preset.rides is not None:
            raise ValueError(f"{args.preset} is trained on rides: it takes no recipe, got {args.recipe}")
        preset.recipe(args.recipe)  # raises where it is none of hand motions
        preset = replace(preset, sources={args.recipe: sum(preset.sources.values())})
    if args.episodes is not None:
        whole = sum(preset.sources.values())
        sources = {name: max(1, round(args.episodes * count / whole)) for name, count in preset.sources.items()}
        rides = None if preset.rides is None else replace(preset.rides, rides=args.episodes)
        preset = replace(preset, sources=sources, rides=rides)
    if args.epochs is not None:
        preset = replace(preset, fit=replace(preset.fit, epochs=args.epochs))
    return preset if args.units is None else replace(preset, units=args.units)


def tested(args: Args) -> int:
    """How many episodes the finished network is tested on."""
    return (8 if args.quick else 48) if args.test_episodes is None else args.test_episodes


def test(result: FitResult, preset: Preset, args: Args, out: Output) -> pandas.DataFrame:
    """Errors on episodes that training never saw, beside those of others."""
    import pandas

    from ..baselines.evaluation import evaluate

    contenders: dict[str, Any] = {args.preset: result.estimator}
    corrected = preset.filter or preset.paper or CONTENDERS[0]
    published = NINE if preset.magnetic else CONTENDERS
    others = published if preset.rides is None else (corrected.removesuffix("-consistent"),)
    contenders |= {name: name for name in dict.fromkeys([corrected, *others])}
    if preset.rides is not None:
        groups, tables = test_rides(preset, args.seed, tested(args)), []
        for group, rides in groups.items():
            for ride in rides:
                # only what is named is configured for the rider by itself
                own = {
                    label: each if isinstance(each, str) else each.configured(ride.metadata)
                    for label, each in contenders.items()
                }
                tables.append(evaluate(own, ride, check=False))
                tables[-1]["trajectory"] = f"{group}:" + tables[-1]["trajectory"].astype(str)
        table = pandas.concat(tables)
        angles = {quantity.name for quantity in result.estimator.outputs}
        return table[table["quantity"].isin(angles) & (table["metric"] == "angle")]
    table = evaluate(contenders, test_trajectories(preset, args.seed, tested(args)), progress=True)
    for name, reason in dict.fromkeys((name, reason) for name, _, reason in table.attrs["skipped"]):
        out.say(f"not compared with {name}: {reason}")
    return table[table["metric"] == ("heading" if preset.magnetic else "inclination")]


def test_trajectories(preset: Preset, seed: int, episodes: int) -> list[Trajectory]:
    """Held-out episodes of the recipes, and hand motions of the environment with a sensor that is not among them."""
    from ..baselines.learned.data import simulate
    from ..baselines.learned.presets import seeds_of
    from ..envs.hand.trajectories import HandTrajectories

    root = seeds_of(seed)[3]
    trajectories = []
    for name in preset.sources:
        for index, each in enumerate(simulate(preset.recipe(name), root, max(1, episodes // len(preset.sources)))):
            trajectories.append(each.replace(metadata={**each.metadata, "name": f"{name}:{index}"}))
    # their sensor has no magnetometer
    for index, gesture in enumerate(() if preset.magnetic else GESTURES):
        hand = HandTrajectories((gesture,), rates=(60.0, 100.0, 200.0), sensors=("paper-hand",), duration=60.0)
        for number, trajectory in enumerate(hand.draw_many(root + 1 + index, max(1, episodes // 4))):
            metadata = {**trajectory.metadata, "name": f"{gesture}:{number}"}
            trajectories.append(trajectory.replace(metadata=metadata))
    return trajectories


def test_rides(preset: Preset, seed: int, rides: int) -> dict[str, list[Trajectory]]:
    """Rides of riders that training never saw: as those of the training, in other scenarios, of aggressive riders."""
    from ..baselines.learned.presets import seeds_of
    from ..baselines.learned.rides import UNSEEN, unseen_rides

    assert preset.rides is not None
    root, source = seeds_of(seed)[3], replace(preset.rides, rides=max(1, rides // 3), draws=2)
    return {
        group: [
            each.replace(metadata={**each.metadata, "name": f"{index}-{number}"})
            for index, number, each in unseen_rides(source, root, group)
        ]
        for group in UNSEEN
    }


def means(table: pandas.DataFrame) -> dict[str, dict[str, dict[str, float]]]:
    """Group of trajectories → estimator → mean and median over its trajectories, deg."""
    groups: dict[str, dict[str, dict[str, float]]] = {}
    kinds = table["trajectory"].str.split(":").str[0]
    for (kind, estimator), values in table.groupby([kinds, "estimator"], sort=False)["value"]:
        row = {"mean_deg": round(float(values.mean()), 4), "median_deg": round(float(values.median()), 4)}
        groups.setdefault(str(kind), {})[str(estimator)] = row
    return groups


def card_of(args: Args, preset: Preset, result: FitResult, table: pandas.DataFrame) -> dict[str, Any]:
    """What the weights are and how they came about."""
    from ..baselines.learned.limits import limits_of

    return {
        "name": args.preset,
        "description": preset.summary,
        "estimator": f"poise.{type(result.estimator).__module__.split('poise.')[-1]}.{type(result.estimator).__name__}",
        "command": command_line("train", args, OPTIONS),
        "data": preset.describe()["rides"] or dict(preset.sources)
        if not args.recordings
        else [path.name for path in args.recordings],
        "training": preset.describe(),
        "best_epoch": result.best_epoch,
        "calibration": None if result.calibration is None else jsonable(result.calibration._asdict()),
        "limits": limits_of(preset, result.estimator, result.calibration),
        "history": jsonable([{name: round(value, 6) for name, value in entry.items()} for entry in result.history]),
        "test": means(table),
        **today(),
        "licence": "MIT",
    }
