"""Train a learned estimator; the run folder keeps weights, card, arguments and versions."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from .experiment import command_line, known_recordings, open_run, versions
from .main import run_command
from .output import Output

if TYPE_CHECKING:
    import pandas

    from ..baselines.learned.estimator import LearnedEstimator
    from ..baselines.learned.training import TrainingConfig, TrainingResult
    from ..envs.data.trajectory import Trajectory

CONTENDERS = ("bounded-motion", "vqf", "mahony", "tilt", "gyroscope-integration")
"""What the network is compared with on the test episodes."""
GESTURES = ("slow", "fast", "severe", "mixed")
"""Gestures of the hand-motion environment on which it is tested besides randomised episodes."""

OPTIONS = ("preset", "seed", "episodes", "epochs", "units", "recipe", "recordings", "test_episodes")
"""Arguments that the weights and their card depend on."""


@dataclass
class Args:
    """Arguments of ``poise train``."""

    network: tyro.conf.Positional[Literal["gru"]] = "gru"
    """what is trained; gain policies are trained by `poise tune`"""
    preset: Literal["quick", "shipped"] = "quick"
    """quick: some minutes, as a test; shipped: the training of the weights in the package"""
    seed: int = 0
    """root seed of episodes, weights and order"""
    episodes: int | None = None
    """simulated training episodes, instead of the preset's"""
    epochs: int | None = None
    """passes over the episodes, instead of the preset's"""
    units: int | None = None
    """units of the network, instead of the preset's"""
    recipe: str | None = None
    """recipe of hand motions to train on, by name (`poise list recipes`) or as a JSON file (default: in the hand and
    carried)"""
    recordings: tuple[Path, ...] = ()
    """files or folders of recordings with known orientation, to train on instead of simulated episodes; of five or
    more the last fifth chooses the best epoch"""
    test_episodes: int = 48
    """simulated episodes that the finished network is tested on"""
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
    from ..baselines.learned.dataset import LearnedDataset
    from ..baselines.learned.estimator import LearnedEstimator
    from ..baselines.learned.gru import GruNetwork
    from ..baselines.learned.training import train
    from ..baselines.weights_io import save_weights

    config = training_config(args)
    dataset = validation = None
    if args.recordings:
        own = known_recordings(args.recordings)
        kept = len(own) - len(own) // 5
        dataset = LearnedDataset.from_trajectories(own[:kept], config.frame)
        if kept < len(own):
            validation = LearnedDataset.from_trajectories(own[kept:], config.frame)
    folder = open_run("train", args, may_differ=("test_episodes",))
    with Output("train", args) as out:
        resume = args.resume is not None
        result = train(config, folder.folder, dataset=dataset, validation=validation, resume=resume, say=out.say)
        estimator = LearnedEstimator(GruNetwork.from_arrays(result.arrays), config.frame)
        table = test(estimator, config, args.test_episodes, out)
        folder.write_results(table)
        card = card_of(args, config, result, table)
        path = save_weights(folder.folder / "gru", result.arrays, card)
        out.say(f"weights: {path}")
        if args.export is not None:
            out.say(f"weights: {save_weights(args.export, result.arrays, card)}")
        columns = means(table)
        rows = [
            {"estimator": name, **{group: each[name]["mean_deg"] for group, each in columns.items() if name in each}}
            for name in table["estimator"].unique()
        ]
        out.table(rows, "Inclination error on unseen simulated episodes, mean of RMS, deg")
        out.add(run=str(folder.folder), card=card)
    return 0


def training_config(args: Args) -> TrainingConfig:
    """The configuration that the arguments ask for."""
    from ..baselines.learned.training import TrainingConfig
    from ..envs.recipes.registry import hand_recipe

    config = TrainingConfig()
    if args.recipe is not None:
        config = replace(config, domain=hand_recipe(args.recipe))
    if args.preset == "quick":
        quick = replace(config.domain, duration=min(60.0, config.domain.duration))
        config = replace(config, episodes=96, validation_episodes=16, epochs=4, units=32, batch=16, domain=quick)
    given = {name: getattr(args, name) for name in ("episodes", "epochs", "units")}
    return replace(config, seed=args.seed, **{name: value for name, value in given.items() if value is not None})


def test(estimator: LearnedEstimator, config: TrainingConfig, episodes: int, out: Output) -> pandas.DataFrame:
    """Errors on episodes that training never saw, beside those of others and of the front end alone."""
    from ..baselines.evaluation import evaluate

    still = replace(
        estimator.network,
        output_weight=0.0 * estimator.network.output_weight,
        output_bias=0.0 * estimator.network.output_bias,
    )
    contenders: dict[str, Any] = {"gru": estimator, "gru (front end alone)": replace(estimator, network=still)}
    contenders |= {name: name for name in CONTENDERS}
    table = evaluate(contenders, test_trajectories(config, episodes), progress=True)
    for name, reason in dict.fromkeys((name, reason) for name, _, reason in table.attrs["skipped"]):
        out.say(f"not compared with {name}: {reason}")
    return table[table["metric"] == "inclination"]


def test_trajectories(config: TrainingConfig, episodes: int) -> list[Trajectory]:
    """Held-out randomised episodes, and hand motions of the environment with a sensor that is not among them."""
    from ..baselines.learned.dataset import simulate
    from ..envs.hand.trajectories import HandTrajectories

    trajectories = list(simulate(config.domain, config.test_seed(), episodes))
    for index, gesture in enumerate(GESTURES):
        hand = HandTrajectories((gesture,), rates=(60.0, 100.0, 200.0), sensors=("paper-hand",), duration=60.0)
        for number, trajectory in enumerate(hand.draw_many(config.test_seed() + 1 + index, max(1, episodes // 6))):
            metadata = {**trajectory.metadata, "name": f"{gesture}-{number}"}
            trajectories.append(trajectory.replace(metadata=metadata))
    return trajectories


def means(table: pandas.DataFrame) -> dict[str, dict[str, dict[str, float]]]:
    """Group of trajectories → estimator → mean and median over its trajectories, deg."""
    groups: dict[str, dict[str, dict[str, float]]] = {}
    kinds = table["trajectory"].str.split("-").str[0]
    for (kind, estimator), values in table.groupby([kinds, "estimator"], sort=False)["value"]:
        row = {"mean_deg": round(float(values.mean()), 4), "median_deg": round(float(values.median()), 4)}
        groups.setdefault(str(kind), {})[str(estimator)] = row
    return groups


def card_of(args: Args, config: TrainingConfig, result: TrainingResult, table: pandas.DataFrame) -> dict[str, Any]:
    """What the weights are and how they came about."""
    best = result.history[result.best_epoch - 1]
    return {
        "name": "gru",
        "description": "inclination from gyroscope and accelerometer: gravity-aligned frame and recurrent network",
        "estimator": "poise.baselines.learned.estimator.LearnedEstimator",
        "units": config.units,
        "front_end": {name: value for name, value in asdict(config.frame).items() if name != "dt"},
        "command": command_line("train", args, OPTIONS),
        "data": "simulated episodes" if not args.recordings else [path.name for path in args.recordings],
        "training": asdict(config),
        "best_epoch": result.best_epoch,
        "validation_deg": round(best["validation_deg"], 4),
        "history": [{name: round(value, 4) for name, value in entry.items()} for entry in result.history],
        "test_inclination": means(table),
        "versions": versions(("numpy", "numba", "torch", "scipy")),
        "date": date.today().isoformat(),
        "licence": "MIT",
    }


if __name__ == "__main__":
    run_command("train")
