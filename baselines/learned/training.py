"""Training of the recurrent estimator: reproducible bit by bit on one machine, also after an interruption."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...envs.recipes.hand import HandRecipe
from ...filters.support.optional import extra
from ...filters.support.seeds import child_seed, child_seeds
from ..checkpoint import load_checkpoint, save_checkpoint
from .dataset import LearnedDataset
from .gravity_aligned_frame import GravityAlignedFrame
from .gru_module import GruModule, inclination_loss

with extra("learn"):
    import torch
    from torch import nn

CHECKPOINT = "checkpoint.pt"
MOST_BAD_STEPS = 10
"""Updates without a finite loss and gradient, one after the other, that end a training."""


@dataclass(frozen=True)
class TrainingConfig:
    """How a network is trained.

    Raises:
        ValueError: a number is out of its range.
    """

    episodes: int = 1000
    """simulated training episodes"""
    validation_episodes: int = 64
    """simulated episodes on which the best epoch is chosen"""
    epochs: int = 14
    """passes over the episodes"""
    batch: int = 32
    """sequences in a batch"""
    window: int = 250
    """intervals through which gradients flow; memory is carried on from window to window"""
    units: int = 64
    """units H of the network"""
    learning_rate: float = 4e-3
    """highest rate, after the warm-up; it falls to zero along a cosine"""
    warmup: float = 0.1
    """share of the updates in which the rate rises"""
    weight_decay: float = 1e-2
    """of AdamW"""
    clip: float = 1.0
    """largest norm of a gradient"""
    seed: int = 0
    """root seed: its children are training data, validation data, initial weights, order and headings"""
    domain: HandRecipe = field(default_factory=HandRecipe)
    """distribution of the episodes"""
    frame: GravityAlignedFrame = field(default_factory=GravityAlignedFrame)
    """front end"""

    def __post_init__(self) -> None:
        for name in ("episodes", "validation_episodes", "epochs", "batch", "window", "units"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        for name in ("learning_rate", "clip"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")
        if not 0.0 <= self.warmup < 1.0:
            raise ValueError(f"warmup must lie in [0, 1), got {self.warmup}")

    def seeds(self) -> tuple[int, int, int, int]:
        """Children of the root seed: training data, validation data, initial weights, order."""
        train, validation, weights, order = child_seeds(self.seed, 4)
        return train, validation, weights, order

    def test_seed(self) -> int:
        """Child of the root seed for episodes that neither training nor the choice of the epoch sees."""
        return child_seed(self.seed, 4)


class TrainingResult(NamedTuple):
    """What a training gives.

    Attributes:
        arrays: the weights of the best epoch, for :class:`~poise.baselines.learned.gru.GruNetwork`.
        history: one dictionary an epoch: ``epoch``, ``training_deg``, ``validation_deg``, ``skipped`` updates.
        best_epoch: the one with the lowest validation error.
    """

    arrays: dict[str, np.ndarray]
    history: list[dict[str, float]]
    best_epoch: int


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch use one thread: sums then have one order, and small matrices gain nothing from more."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def train(
    config: TrainingConfig,
    folder: str | Path,
    *,
    dataset: LearnedDataset | None = None,
    validation: LearnedDataset | None = None,
    resume: bool = False,
    say: Callable[[str], object] | None = None,
) -> TrainingResult:
    """Train a network.

    Args:
        config: how.
        folder: where data sets, checkpoints and the TensorBoard log go.
        dataset: what to train on, instead of simulated episodes.
        validation: what to choose the best epoch on, instead of simulated episodes.
        resume: continue from the checkpoint in ``folder``, bit by bit as if there had been no interruption.
        say: called with a line an epoch, and progress bars are shown; None for a silent training.

    Raises:
        ValueError: there is nothing to resume, or it was started with another configuration, other data or another
            version of the package.
        RuntimeError: loss or gradients were not finite several times in a row.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    train_seed, validation_seed, weights_seed, order_seed = config.seeds()

    def simulated(seed: int, episodes: int, words: str) -> LearnedDataset:
        return LearnedDataset.from_simulation(
            config.domain, seed, episodes, config.frame, cache=folder, progress="" if say is None else words
        )

    dataset = simulated(train_seed, config.episodes, "simulate") if dataset is None else dataset
    if validation is None:
        validation = simulated(validation_seed, config.validation_episodes, "simulate held out")
    with one_thread():
        trainer = Trainer(config, dataset, weights_seed)
        if resume:
            trainer.restore(folder / CHECKPOINT)
        log = open_log(folder)
        try:
            while trainer.epoch < config.epochs:
                entry = trainer.train_epoch(dataset, np.random.default_rng((order_seed, trainer.epoch)))
                entry["validation_deg"] = math.degrees(validation_error(trainer.module, validation))
                trainer.finish_epoch(entry)
                trainer.save(folder / CHECKPOINT)
                log(entry)
                if say is not None:
                    say(
                        f"epoch {trainer.epoch}/{config.epochs}: training {entry['training_deg']:.3f}°, "
                        f"held out {entry['validation_deg']:.3f}°"
                    )
        finally:
            log(None)
    return TrainingResult(trainer.best, trainer.history, trainer.best_epoch)


class Trainer:
    """Everything that changes during a training.

    Args:
        config: how it is trained.
        dataset: tells how many updates there will be.
        seed: of the initial weights.
    """

    def __init__(self, config: TrainingConfig, dataset: LearnedDataset, seed: int) -> None:
        self.config = config
        self.key = {"config": asdict(config), "data": dataset.digest()}
        self.module = GruModule(config.units, seed)
        self.optimizer = torch.optim.AdamW(
            self.module.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        batches = len(dataset) // min(config.batch, len(dataset))
        windows = math.ceil(dataset.features.shape[1] / config.window)
        self.updates = config.epochs * batches * windows
        self.update = 0
        self.bad_steps = 0
        self.epoch = 0
        self.history: list[dict[str, float]] = []
        self.best: dict[str, np.ndarray] = self.module.arrays()
        self.best_epoch = 0

    def learning_rate(self) -> float:
        """Rate of the next update: linear rise, then a cosine."""
        rise = self.config.warmup * self.updates
        if self.update < rise:
            return self.config.learning_rate * (self.update + 1.0) / (rise + 1.0)
        return (
            0.5 * self.config.learning_rate * (1.0 + math.cos(math.pi * (self.update - rise) / (self.updates - rise)))
        )

    def train_epoch(self, dataset: LearnedDataset, generator: np.random.Generator) -> dict[str, float]:
        """One pass over the data."""
        self.module.train()
        total, count, skipped = 0.0, 0, 0
        memory: torch.Tensor | None = None
        for window in dataset.windows(self.config.batch, self.config.window, generator):
            features, up, mask = (torch.from_numpy(np.ascontiguousarray(part)) for part in window[:3])
            tilt, last = self.module(features, None if window.first else memory)
            memory = last.detach()
            loss = inclination_loss(tilt, up, mask)
            if self.descend(loss):
                total, count = total + loss.item(), count + 1
            else:
                skipped += 1
                memory = torch.nan_to_num(memory)
        return {"training_deg": math.degrees(total / max(count, 1)), "skipped": float(skipped)}

    def descend(self, loss: torch.Tensor) -> bool:
        """One update; False if loss or gradient is not finite, and nothing was changed."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.learning_rate()
        self.update += 1
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        norm = nn.utils.clip_grad_norm_(self.module.parameters(), self.config.clip)
        if not (torch.isfinite(loss) and torch.isfinite(norm)):
            self.bad_steps += 1
            if self.bad_steps >= MOST_BAD_STEPS:
                raise RuntimeError(f"loss or gradients were not finite in {self.bad_steps} updates in a row")
            return False
        self.bad_steps = 0
        self.optimizer.step()
        return True

    def finish_epoch(self, entry: dict[str, float]) -> None:
        """Count the epoch and keep the best weights."""
        self.epoch += 1
        entry["epoch"] = float(self.epoch)
        errors = [before["validation_deg"] for before in self.history]
        if entry["validation_deg"] < min(errors, default=math.inf):
            self.best, self.best_epoch = self.module.arrays(), self.epoch
        self.history.append(entry)

    def save(self, path: Path) -> None:
        """Write a checkpoint."""
        state = {
            "module": self.module.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "counters": [self.update, self.bad_steps, self.epoch, self.best_epoch],
            "history": self.history,
            "best": self.best,
        }
        save_checkpoint(path, self.key, state)

    def restore(self, path: Path) -> None:
        """Continue from a checkpoint.

        Raises:
            ValueError: see :func:`~poise.baselines.checkpoint.load_checkpoint`.
        """
        state = load_checkpoint(path, self.key)
        self.module.load_state_dict(state["module"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.update, self.bad_steps, self.epoch, self.best_epoch = state["counters"]
        self.history, self.best = state["history"], state["best"]


def validation_error(module: GruModule, dataset: LearnedDataset, size: int = 64, length: int = 1000) -> float:
    """The loss of whole sequences, without gradients, rad."""
    module.eval()
    total, count = 0.0, 0
    with torch.no_grad():
        for start in range(0, len(dataset), size):
            part = slice(start, start + size)
            memory, tilts = None, []
            features = torch.from_numpy(dataset.features[part])
            for begin in range(0, features.shape[1], length):
                tilt, memory = module(features[:, begin : begin + length], memory)
                tilts.append(tilt)
            mask = torch.from_numpy(dataset.mask[part])
            loss = inclination_loss(torch.cat(tilts, dim=1), torch.from_numpy(dataset.up[part]), mask)
            counted = int(mask.any(dim=1).sum())
            total, count = total + loss.item() * counted, count + counted
    return total / max(count, 1)


def open_log(folder: Path) -> Callable[[dict[str, float] | None], None]:
    """A function that writes an epoch to TensorBoard, and closes the log when it gets None."""
    from torch.utils.tensorboard import SummaryWriter

    writer = SummaryWriter(str(folder))

    def log(entry: dict[str, float] | None) -> None:
        if entry is None:
            writer.close()
            return
        for name in ("training_deg", "validation_deg", "skipped"):
            writer.add_scalar(name, entry[name], int(entry["epoch"]))
        writer.flush()

    return log
