"""Training of a preset, on simulation or on recordings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.recipes.rides import held_out
from ...filters.support.optional import extra
from .data import SequenceData, taught, with_errors
from .estimator import LearnedEstimator
from .fit import FitResult, fit
from .gains.gain_filter import GainFilter
from .gains.gain_head import GainHead
from .head import AngleHead, Head
from .inputs.front_end import FrontEnd
from .networks.gru import GruNetwork
from .networks.modules import GruModule
from .presets import Preset, seeds_of
from .rides import ride_data

with extra("learn"):
    import torch

COPIES = 4
"""of each recording that a teacher explains"""


def train_preset(
    preset: Preset,
    seed: int,
    folder: str | Path,
    *,
    recordings: list[Trajectory] | None = None,
    teacher: bool = False,
    replicate: int = 0,
    start: str | Path | None = None,
    resume: bool = False,
    processes: int = 1,
    say: Callable[[str], object] | None = None,
) -> FitResult:
    """Train a network; the same arguments on the same machine give the same weights, interrupted or not.

    Args:
        preset: what and how.
        seed: root seed of data, weights and order.
        folder: where data sets, checkpoints and the TensorBoard log go.
        recordings: to train on instead of simulated episodes; of five or more the last fifth chooses the best epoch.
        teacher: learn from the smoother of the corrected filter instead of the recordings' truth, each recording
            :data:`COPIES` times with further errors of its sensors.
        replicate: number of a repetition on the same data with other initial weights and another order.
        start: weights to start from; None: from scratch.
        resume: continue from the checkpoint in ``folder``.
        processes: how many episodes are simulated at a time; the weights do not depend on it.
        say: called with a line an epoch; None for a silent training.

    Raises:
        ValueError: see :func:`.fit.fit`; a recording lacks a channel or the truth.
    """
    front_end: Any = preset.front_end()
    head: Any = preset.head()
    train_seed, validation_seed, _, _ = seeds_of(seed)
    if start is not None:
        started(start, front_end, head)  # raises, before anything is simulated

    def simulated(root: int, share: float, words: str) -> SequenceData:
        if preset.rides is not None:
            label = "" if say is None else f"{words} rides"
            source = preset.rides if root == train_seed else held_out(preset.rides)
            some = replace(source, rides=max(2, round(share * source.rides)))
            return ride_data(some, root, front_end, head, processes=processes, label=label)
        parts = [
            SequenceData.from_recipe(
                *(preset.recipe(name), root, max(1, round(share * count)), front_end, head),
                cache=folder,
                progress="" if say is None else f"{words} {name}",
                processes=processes,
            )
            for name, count in preset.sources.items()
        ]
        return SequenceData.together(parts)

    data = validation = None
    if teacher and (preset.filter is None or not recordings):
        raise ValueError("a teacher needs recordings, and a preset that corrects a filter")
    if recordings and teacher:
        generator = np.random.default_rng(train_seed)
        lessons = [taught(each, str(preset.filter)) for each in recordings]
        copies = [[with_errors(each, generator) for _ in range(COPIES)] for each in lessons]
        data = SequenceData.from_trajectories([each for own in copies for each in own], front_end, head)
        validation = SequenceData.from_trajectories(lessons, front_end, head)
    elif recordings:
        kept = max(1, len(recordings) * 4 // 5) if len(recordings) >= 5 else len(recordings)
        data = SequenceData.from_trajectories(recordings[:kept], front_end, head)
        if recordings[kept:]:
            validation = SequenceData.from_trajectories(recordings[kept:], front_end, head)
    data = simulated(train_seed, 1.0, "simulate") if data is None else data
    validation = simulated(validation_seed, preset.validation, "held out") if validation is None else validation
    return fit_preset(
        *(preset, seed, folder, data, validation), replicate=replicate, start=start, resume=resume, say=say
    )


def fit_preset(
    preset: Preset,
    seed: int,
    folder: str | Path | None,
    data: SequenceData,
    validation: SequenceData,
    *,
    replicate: int = 0,
    start: str | Path | None = None,
    resume: bool = False,
    say: Callable[[str], object] | None = None,
) -> FitResult:
    """Train the network of a preset on data that were made with its front end and head; see :func:`train_preset`."""
    front_end: Any = preset.front_end()
    head: Any = preset.head()
    number = (seeds_of(seed)[2] + replicate) % 2**31
    if start is None:
        module, config = preset.module(front_end.size, head.size, number), preset.fit
    else:
        module, config = GruModule.of(started(start, front_end, head), preset.scale), preset.refined
    config = replace(config, seed=number)
    if isinstance(head, GainHead) and start is None and not resume:
        constants = head.begin(module, data, number)
        if say is not None:
            say(f"best constant log factors: {dict(zip(head.gains, constants.round(2).tolist(), strict=True))}")
    if isinstance(head, AngleHead) and preset.filter is None and start is None:
        # a network that stands alone starts as the mean
        usual = data.target[data.mask].mean(axis=0) / np.array(head.scale)
        module.output.bias.data.copy_(torch.from_numpy(usual.astype(np.float32)))
    result = fit(module, front_end, head, data, validation, config, folder=folder, resume=resume, say=say)
    if isinstance(head, GainHead):
        made: Any = GainFilter(result.estimator.network, front_end, head)
        result = result._replace(estimator=made)
    return result


def started(start: str | Path, front_end: FrontEnd, head: Head) -> GruNetwork:
    """The network of the weights that a training starts from.

    Raises:
        FileNotFoundError: there are no such weights.
        ValueError: they are damaged, not of a recurrent network, or of another front end or head.
    """
    network = LearnedEstimator.load(start).network
    network = getattr(network, "network", network)
    if not isinstance(network, GruNetwork):
        raise ValueError(f"start must be weights of a recurrent network, got a {network.kind} in {start}")
    if (network.features, network.outputs) != (front_end.size, head.size):
        raise ValueError(
            f"start must have {front_end.size} features and {head.size} outputs, "
            f"got {network.features} and {network.outputs} in {start}"
        )
    return network
