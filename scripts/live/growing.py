"""Motion that grows while it is shown: of an environment that is simulated, or of lines of samples that arrive."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...baselines.registry import make_estimator
from ...envs.data.trajectory import Trajectory
from ...envs.record import describe
from ...envs.replay import ReplayEnv
from .motion import Motion, Subject
from .online import Timed
from .shown import LiveMotion, PlayedEnvironment, live_motion, tuned_episode, usual_estimators
from .sources import lines_of
from .stream import Counts, clock_of, reader_of, timed_samples

AHEAD = 0.25
"""s of an environment that are simulated at a time."""
PICTURE, MANY = 1.0 / 30.0, 200
"""s, or samples, that are shown together while they arrive."""

Blocks = Iterator[tuple[list[Timed], dict[str, Any], Trajectory | None]]
"""Samples, their truth, and a trajectory with channels, truth, metadata and rate (None before the first sample)."""


def environment_blocks(env: Any, seed: int) -> Blocks:
    """An environment in real time, as fast as it is simulated."""
    tuned = tuned_episode(env, seed)
    played = PlayedEnvironment(env if tuned is None else ReplayEnv(tuned), seed)
    metadata = {**describe(env, seed), "rate": env.unwrapped.rate} if tuned is None else tuned.metadata
    begin, shown, kind = time.monotonic(), 0.0, None
    while not played.over:
        shown = min(time.monotonic() - begin, shown + AHEAD)
        samples, truth = played.block(shown)
        if samples and kind is None:
            first = {name: values[:1] for name, values in truth.items()}
            kind = described(samples[0], first, metadata)
        yield samples, truth, kind
        if not samples:
            time.sleep(0.01)


def described(sample: Timed, truth: dict[str, Any], metadata: dict[str, Any]) -> Trajectory:
    """A trajectory of the first sample, which says what those after it hold."""
    measurements = {name: values[None] for name, values in sample.measurement.items()}
    return Trajectory(np.array([sample.time]), measurements, truth, metadata=metadata)


def line_blocks(args: Any) -> Blocks:
    """Lines of samples as they arrive, by the arguments of ``poise view``."""
    channels = [channel for name in args.estimators for channel in make_estimator(name).channels]
    reader, clock = reader_of(args, channels), clock_of(args.rate)
    lines = lines_of(args.source, udp=args.udp, follow=args.live, baud=args.baud)
    waiting: list[Timed] = []
    kind: Trajectory | None = None
    for sample in timed_samples(lines, reader, clock, Counts()):
        if sample is not None:
            waiting.append(sample)
            if kind is None:
                assert clock.dt is not None
                kind = described(sample, {}, {"rate": 1.0 / clock.dt})
            if len(waiting) < MANY and sample.time - waiting[0].time < PICTURE:
                continue
        yield waiting, {}, kind
        waiting = []
    yield waiting, {}, kind


@contextmanager
def fed(blocks: Blocks, names: Sequence[str]) -> Iterator[tuple[Subject, Motion, Callable[[], Motion | None]]]:
    """A motion that grows by blocks in a thread of its own; it begins with the first samples.

    Raises:
        ValueError: no sample came, an unknown estimator, or a channel is lacking.
    """
    live: LiveMotion | None = None
    for samples, truth, trajectory in blocks:
        if samples and trajectory is not None:
            live = live_motion(names or usual_estimators(tuple(trajectory.measurements)), trajectory)
            live.add(samples, truth)
            break
    if live is None or live.motion is None:
        raise ValueError("no sample came")
    stop = threading.Event()
    failures: list[Exception] = []

    def feed(live: LiveMotion) -> None:
        try:
            for samples, truth, _ in blocks:
                live.add(samples, truth)
                if stop.is_set():
                    return
        except Exception as reason:
            failures.append(reason)

    def newer() -> Motion | None:
        if failures:
            raise failures.pop()
        return live.motion

    thread = threading.Thread(target=feed, args=(live,), daemon=True)
    thread.start()
    try:
        yield live.subject, live.motion, newer
    finally:
        stop.set()
        thread.join(timeout=2.0)
