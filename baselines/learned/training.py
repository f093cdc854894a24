"""Training of a preset, on simulation or on recordings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.recipes.rides import held_out
from ...filters.support.optional import extra
from .calibration import Calibration, calibrated
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
    if start is not None:
        started(start, front_end, head)  # raises, before anything is simulated
    make_data = partial(simulated, preset, seed, folder=folder, processes=processes, show=say is not None)
    data = validation = None
    if teacher and (preset.filter is None or not recordings):
        raise ValueError("a teacher needs recordings, and a preset that corrects a filter")
    if recordings and teacher:
        generator = np.random.default_rng(seeds_of(seed)[0])
        lessons = [taught(each, str(preset.filter)) for each in recordings]
        copies = [[with_errors(each, generator) for _ in range(COPIES)] for each in lessons]
        data = SequenceData.from_trajectories([each for own in copies for each in own], front_end, head)
        validation = SequenceData.from_trajectories(lessons, front_end, head)
    elif recordings:
        kept = max(1, len(recordings) * 4 // 5) if len(recordings) >= 5 else len(recordings)
        data = SequenceData.from_trajectories(recordings[:kept], front_end, head)
        if recordings[kept:]:
            validation = SequenceData.from_trajectories(recordings[kept:], front_end, head)
    data = make_data(held=False) if data is None else data
    validation = make_data(held=True) if validation is None else validation
    return fit_preset(
        *(preset, seed, folder, data, validation), replicate=replicate, start=start, resume=resume, say=say
    )


def simulated(
    preset: Preset, seed: int, *, held: bool, folder: str | Path | None, processes: int, show: bool
) -> SequenceData:
    """The simulated episodes of a preset, those to train on or those held out for the best epoch and the covariance."""
    front_end, head = preset.front_end(), preset.head()
    root = seeds_of(seed)[1 if held else 0]
    share, words = (preset.validation, "held out") if held else (1.0, "simulate")
    if preset.rides is not None:
        source = held_out(preset.rides) if held else preset.rides
        some = replace(source, rides=max(2, round(share * source.rides)))
        label = f"{words} rides" if show else ""
        return ride_data(some, root, front_end, head, processes=processes, label=label)
    parts = [
        SequenceData.from_recipe(
            *(preset.recipe(name), root, max(1, round(share * count)), front_end, head),
            cache=folder,
            progress=f"{words} {name}" if show else "",
            processes=processes,
        )
        for name, count in preset.sources.items()
    ]
    return SequenceData.together(parts)


def calibrate_weights(
    preset: Preset, seed: int, weights: str | Path, *, processes: int = 1, show: bool = False
) -> tuple[LearnedEstimator, Calibration]:
    """Trained weights with the covariance that a training of their preset gives them today; the weights stay.

    Args:
        preset: that they were trained by.
        seed: root seed of their training, so that held-out riders are others than those trained on.
        weights: file, or name of shipped weights.
        processes: how many rides are simulated at a time; the numbers do not depend on it.
        show: progress bars.

    Raises:
        FileNotFoundError: there are no such weights.
        ValueError: they are damaged, state no covariance, or are of another preset.
    """
    made, front_end, head = LearnedEstimator.load(weights), preset.front_end(), preset.head()
    if not isinstance(head, AngleHead):
        raise ValueError(f"only networks of riders have a covariance to calibrate, got {preset.summary!r}")
    theirs = replace(made.head, deviations=(), growth=(), power=1) if isinstance(made.head, AngleHead) else None
    same = theirs is not None and theirs.describe() == head.describe()
    if not same or made.front_end.describe() != front_end.describe():
        raise ValueError(f"{weights} has another front end or head than the preset {preset.summary!r}")
    data = simulated(preset, seed, held=True, folder=None, processes=processes, show=show)
    calibrated_head, found = calibrated(made.network, head, data)
    return replace(made, head=calibrated_head), found


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
        # a network that stands alone starts as the mean direction
        known = data.target[data.mask].astype(float)
        usual = np.arctan2(np.sin(known).mean(axis=0), np.cos(known).mean(axis=0)) / np.array(head.scale)
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
