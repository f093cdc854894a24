"""Training of a network: reproducible bit by bit on one machine, also after an interruption."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...filters.support.optional import extra
from ..checkpoint import load_checkpoint, save_checkpoint
from .calibration import Calibration, calibrated
from .config import FitConfig
from .data import SequenceData
from .estimator import LearnedEstimator
from .head import AngleHead, Head
from .inputs.filter_features import standardisation
from .inputs.front_end import FrontEnd
from .networks.modules import TorchNetwork
from .networks.unlikeness import WithUnlikeness

with extra("learn"):
    import torch
    from torch import nn

CHECKPOINT = "checkpoint.pt"
MOST_BAD_STEPS = 10
"""Updates without a finite loss and gradient, one after the other, that end a training."""


class FitResult(NamedTuple):
    """What a training gives.

    Attributes:
        estimator: with the weights of the best epoch.
        history: one dictionary an epoch: ``epoch``, ``training`` and ``validation`` loss, ``validation_deg`` (mean over
            parts of the root mean square error), ``skipped`` updates.
        best_epoch: the one with the lowest validation loss; 0: the weights before the first.
        calibration: of the covariance, on what is held out; None of a head that has none.
    """

    estimator: LearnedEstimator
    history: list[dict[str, float]]
    best_epoch: int
    calibration: Calibration | None


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch use one thread: sums then have one order, and small matrices gain nothing from more."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def fit(
    module: nn.Module,
    front_end: FrontEnd,
    head: Head,
    data: SequenceData,
    validation: SequenceData,
    config: FitConfig | None = None,
    *,
    folder: str | Path | None = None,
    resume: bool = False,
    context: int = 1,
    say: Callable[[str], object] | None = None,
) -> FitResult:
    """Train a network to an estimator.

    Args:
        module: maps features ``(B, N, F)`` to outputs ``(B, N, O)``; one that remembers takes and gives its memory too
            (:class:`.modules.TorchNetwork`). It is changed in place and ends with the weights of the best epoch.
        front_end: what it sees.
        head: what its outputs mean, and the loss.
        data: what to train on, made with the same front end and head.
        validation: what to choose the best epoch on; motions and riders that ``data`` does not hold.
        config: how.
        folder: where checkpoints and the TensorBoard log go; None keeps nothing.
        resume: continue from the checkpoint in ``folder``, bit by bit as if there had been no interruption.
        context: updates that a module without memory sees at once.
        say: called with a line an epoch; None for a silent training.

    Raises:
        ValueError: the module does not take float32 features on the CPU, gives other shapes than the head takes or
            numbers that are not finite, or has nothing to train; there is nothing to resume, or it was started with
            another configuration, other data or another version of the package; a data set scores nothing, scores
            numbers that are not finite, or has other features than the front end.
        RuntimeError: loss or gradients were not finite several times in a row, or in all of an epoch.
    """
    config = FitConfig() if config is None else config
    for name, part in (("data", data), ("validation", validation)):
        if not part.mask.any():
            raise ValueError(f"{name} scores nothing: the truth of its {len(part)} sequences is unknown everywhere")
        if part.features.shape[-1] != front_end.size:
            raise ValueError(
                f"{name} must have the {front_end.size} features of the front end, got {part.features.shape[-1]}"
            )
        check_finite(name, part, head)
    if resume and folder is None:
        raise ValueError("resume needs the folder of the interrupted training")
    if isinstance(head, AngleHead):
        # a covariance of other weights is none of these
        head = replace(head, deviations=(), growth=(), power=1)
    home = None if folder is None else Path(folder)
    if home is not None:
        home.mkdir(parents=True, exist_ok=True)
    with one_thread(), torch.random.fork_rng(devices=[]):
        trainer = Trainer(module, head, config, data, context)
        if resume and home is not None:
            trainer.restore(home / CHECKPOINT)
        else:
            trainer.begin(data, validation)
        log = (lambda entry: None) if home is None else open_log(home)
        try:
            while trainer.epoch < config.epochs:
                trainer.train_epoch(data, validation)
                if home is not None:
                    trainer.save(home / CHECKPOINT)
                entry = trainer.history[-1]
                log(entry)
                if say is not None:
                    say(
                        f"epoch {trainer.epoch}/{config.epochs}: training {entry['training']:.4g}, "
                        f"held out {entry['validation']:.4g} ({entry['validation_deg']:.3f}°)"
                    )
        finally:
            log(None)
        module.load_state_dict(trainer.best)
    module.eval()
    network: Any = module.export() if hasattr(module, "export") else trainer.network  # type: ignore[operator]
    calibration = None
    if isinstance(head, AngleHead):
        network = WithUnlikeness.of(network, *standardisation(data.features, data.mask))
        with one_thread():
            head, calibration = calibrated(network, head, validation)
    estimator = LearnedEstimator(network, front_end, head)
    return FitResult(estimator, trainer.history, trainer.best_epoch, calibration)


def check_finite(name: str, data: SequenceData, head: Head) -> None:
    """Refuse data that score what is not a number; in sequences of a head's own making NaN is a missing sample.

    Raises:
        ValueError: names the array and the sequence.
    """
    for field in ("features",) if hasattr(head, "sequence") else ("features", "target"):
        bad = (data.mask & ~np.isfinite(getattr(data, field)).all(axis=-1)).any(axis=1)
        if bad.any():
            where = data.names[int(np.argmax(bad))]
            raise ValueError(f"{name} holds numbers that are not finite where it is scored: {field} of {where}")


class Trainer:
    """Everything that changes during a training.

    Args:
        module: the network.
        head: its loss.
        config: how it is trained.
        data: tells how many updates there will be, and the shapes.
        context: see :func:`fit`.
    """

    def __init__(self, module: nn.Module, head: Head, config: FitConfig, data: SequenceData, context: int) -> None:
        self.module, self.head, self.config = module, head, config
        settings = {"config": asdict(config), "head": head.describe(), "data": data.digest()}
        self.key = {**settings, "module": repr(module)}
        if not any(parameter.requires_grad for parameter in module.parameters()):
            raise ValueError("module has no parameter that can be trained")
        own = getattr(module, "standardised", None)
        self.network = TorchNetwork(module, data.features.shape[-1], head.size, context, own)
        self.optimizer = torch.optim.AdamW(
            module.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        batches = len(data) // min(config.batch, len(data))
        self.updates = config.epochs * batches * math.ceil(data.features.shape[1] / config.window)
        self.update = self.bad_steps = self.epoch = self.best_epoch = 0
        self.history: list[dict[str, float]] = []
        self.best_loss = math.inf
        self.best: dict[str, Any] = copy.deepcopy(module.state_dict())

    def begin(self, data: SequenceData, validation: SequenceData) -> None:
        """Take the scales of the features if they are not known, check the shapes, score the network as it is."""
        if not self.network.standardised.known:
            self.network.standardised.fit(*standardisation(data.features, data.mask))
        check_module(self, torch.from_numpy(data.features[:2, :3]))
        self.best = copy.deepcopy(self.module.state_dict())
        self.best_loss, _ = validation_loss(self, validation)
        if not math.isfinite(self.best_loss):
            raise ValueError("module gives numbers that are not finite before it is trained")

    def forward(self, features: torch.Tensor, memory: Any) -> tuple[torch.Tensor, Any]:
        """The module on features as they are."""
        if not hasattr(self.module, "standardised"):
            features = self.network.standardised(features)
        if self.network.remembers:
            raw_output, memory = self.module(features, memory)
            return raw_output, memory
        return self.module(features), None

    def learning_rate(self) -> float:
        """Rate of the next update: linear rise, then a cosine."""
        rise = self.config.warmup * self.updates
        if self.update < rise:
            return self.config.learning_rate * (self.update + 1.0) / (rise + 1.0)
        rest = max(1.0, self.updates - rise)
        return 0.5 * self.config.learning_rate * (1.0 + math.cos(math.pi * (self.update - rise) / rest))

    def train_epoch(self, data: SequenceData, validation: SequenceData) -> None:
        """One pass over the data, and a look at what is held out."""
        generator = np.random.default_rng((self.config.seed, self.epoch))
        torch.manual_seed(int(generator.integers(2**31)))
        self.module.train()
        total, count, skipped = 0.0, 0, 0
        memory: Any = None
        for window in data.windows(self.config.batch, self.config.window, generator, self.head):
            features, target, spread, mask = (torch.from_numpy(np.ascontiguousarray(part)) for part in window[:4])
            raw_output, last = self.forward(features, None if window.first else memory)
            memory = None if last is None else last.detach()
            if not mask.any():
                continue
            loss = self.head.loss(raw_output, target, spread, mask)
            if self.descend(loss):
                total, count = total + loss.item(), count + 1
            else:
                skipped += 1
                memory = None if memory is None else torch.nan_to_num(memory)
        if skipped and not count:
            raise RuntimeError(f"loss or gradients were not finite in all {skipped} updates of epoch {self.epoch + 1}")
        held_out, parts = validation_loss(self, validation)
        degrees = math.degrees(float(parts.mean()))
        self.epoch += 1
        if held_out < self.best_loss:
            self.best, self.best_epoch = copy.deepcopy(self.module.state_dict()), self.epoch
            self.best_loss = held_out
        entry = {"training": total / max(count, 1), "validation": held_out, "validation_deg": degrees}
        self.history.append({"epoch": float(self.epoch), **entry, "skipped": float(skipped)})

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

    def save(self, path: Path) -> None:
        """Write a checkpoint."""
        state = {
            "module": self.module.state_dict(),
            "standardised": self.network.standardised.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "counters": [self.update, self.bad_steps, self.epoch, self.best_epoch],
            "best_loss": self.best_loss,
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
        self.network.standardised.load_state_dict(state["standardised"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.update, self.bad_steps, self.epoch, self.best_epoch = state["counters"]
        self.best_loss, self.history, self.best = state["best_loss"], state["history"], state["best"]


def check_module(trainer: Trainer, features: torch.Tensor) -> None:
    """Let the module see a few updates ``(B, N, F)``, and the next ones with what it remembers.

    Raises:
        ValueError: it fails, or gives something else than a head and an estimator need.
    """
    size, memory = trainer.head.size, None
    takes = f"module must take float32 features (B, N, {features.shape[-1]}) on the CPU"
    remembered = getattr(trainer.module, "memory_size", None)
    if remembered is not None:
        takes += f" and memory (B, {remembered}) or None, and give (output, memory)"
    trainer.module.eval()
    for _ in range(2):
        try:
            with torch.no_grad():
                output, memory = trainer.forward(features, memory)
        except (RuntimeError, TypeError, ValueError, AttributeError, NotImplementedError) as reason:
            raise ValueError(f"{takes}, but it fails: {reason}") from reason
        found = [output] if remembered is None else [output, memory]
        if not all(isinstance(each, torch.Tensor) for each in found):
            raise ValueError(
                f"{takes}; one that remembers needs an attribute memory_size and a memory that is one tensor, "
                f"got {', '.join(type(each).__name__ for each in found)}"
            )
        shapes = [tuple(each.shape) for each in found]
        wanted = [(*features.shape[:2], size), (len(features), remembered)][: len(found)]
        if shapes != wanted:
            raise ValueError(f"module must give {wanted} for features {tuple(features.shape)}, got {shapes}")


def whole_sequences(trainer: Trainer, data: SequenceData) -> Iterator[tuple[slice, torch.Tensor]]:
    """Outputs ``(B, N, O)`` of all sequences, 64 at a time: which these are, and what the network says."""
    size, length = 64, 1000
    trainer.module.eval()
    for start in range(0, len(data), size):
        part = slice(start, start + size)
        memory, raw_output = None, []
        features = torch.from_numpy(data.features[part])
        with torch.no_grad():
            for begin in range(0, features.shape[1], length):
                output, memory = trainer.forward(features[:, begin : begin + length], memory)
                raw_output.append(output)
        yield part, torch.cat(raw_output, dim=1)


def validation_loss(trainer: Trainer, data: SequenceData) -> tuple[float, np.ndarray]:
    """Loss of whole sequences, without gradients, and the root mean square error of each part, rad.

    The loss is infinite where an output that is scored is not finite; means leave such samples out.
    """
    total, count, squares, scored = 0.0, 0, 0.0, 0
    for part, outputs in whole_sequences(trainer, data):
        mask = torch.from_numpy(data.mask[part])
        total += 0.0 if bool(torch.isfinite(outputs[mask]).all()) else math.inf
        target, spread = torch.from_numpy(data.target[part]), torch.from_numpy(data.spread[part])
        counted = int(mask.any(dim=1).sum())
        if not counted:
            continue
        with torch.no_grad():
            total += float(trainer.head.loss(outputs, target, spread, mask)) * counted
            error = trainer.head.errors(outputs, target, spread)
        squares = squares + (error * error)[mask].sum(dim=0).double()
        count, scored = count + counted, scored + int(mask.sum())
    return total / max(count, 1), np.sqrt(np.atleast_1d(np.asarray(squares)) / max(scored, 1))


def open_log(folder: Path) -> Callable[[dict[str, float] | None], None]:
    """A function that writes an epoch to TensorBoard, and closes the log when it gets None."""
    from torch.utils.tensorboard import SummaryWriter

    writer = SummaryWriter(str(folder))

    def log(entry: dict[str, float] | None) -> None:
        if entry is None:
            writer.close()
            return
        for name in ("training", "validation", "validation_deg", "skipped"):
            writer.add_scalar(name, entry[name], int(entry["epoch"]))
        writer.flush()

    return log
