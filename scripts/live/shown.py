"""Motion that is shown: of a finished recording, of an environment that is played, of a stream of samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...baselines.gain_policy.adaptive import AdaptiveEstimator
from ...baselines.online import OnlineEstimator
from ...baselines.registry import list_estimators, make_estimator
from ...baselines.run import fitted, run_on
from ...envs.data.trajectory import Trajectory
from ...envs.gain_env import GainTuningEnv
from ...filters.adaptation.gains import filter_name, gain_sizes
from ...filters.bicycle.geometry import RiderGeometry
from ...filters.core.estimator import Estimator
from ...filters.core.model import equations_of
from ...filters.support.optional import MissingExtraError
from .curves import Curves
from .motion import Block, Device, Motion, Rider, Subject, joined
from .online import Timed

if TYPE_CHECKING:
    from ...envs.base import PoseEnv

DRAWN = 50.0
"""Hz at which motion is drawn; estimators run at the rate of the samples."""
KEPT = 60.0
"""s of a live motion that are kept."""
USUAL = {"imu/gyr": ("bounded-motion", "vqf", "tilt"), "bicycle_imu/gyr": ("whole-body", "two-gyro")}
USUAL |= {"array/acc": ("array-orientation", "planar-orientation")}
"""Channel → estimators that are shown where none are named, as far as their channels and packages are there."""


def usual_estimators(channels: Sequence[str]) -> tuple[str, ...]:
    """Names of the estimators that are shown of a recording with these channels."""
    known, found = list_estimators(), []
    for channel, names in USUAL.items():
        for name in names if channel in channels else ():
            if set(known[name].channels) <= set(channels):
                try:
                    make_estimator(name)
                except MissingExtraError:
                    continue
                found.append(name)
    return tuple(found)


def made_estimators(names: Sequence[str], trajectory: Trajectory) -> dict[str, Estimator[Any]]:
    """Estimators by name, configured for a trajectory.

    Raises:
        ValueError: an unknown name, or the trajectory lacks a channel.
    """
    made = {name: fitted(name, trajectory) for name in dict.fromkeys(names)}
    for name, estimator in made.items():
        lacking = [each.name for each in estimator.channels if each.name not in trajectory.measurements]
        if lacking:
            raise ValueError(f"{name} needs {', '.join(lacking)}, which {trajectory.name!r} lacks")
    return made


def subject_of(trajectory: Trajectory, made: Mapping[str, Estimator[Any]]) -> Subject:
    """What a trajectory is one of: a rider on a bicycle, or a device; ``made``: label → estimator."""
    outputs = {label: tuple(estimator.outputs) for label, estimator in made.items()}
    if "bicycle/orientation" in trajectory.truth or "bicycle_imu/gyr" in trajectory.measurements:
        return Rider(RiderGeometry.of(trajectory.metadata), outputs)
    return Device(outputs, trajectory.dt)


def with_derived(truth: Mapping[str, np.ndarray], made: Mapping[str, Estimator[Any]]) -> dict[str, np.ndarray]:
    """The truth with what the equations of the estimators derive from it."""
    found: dict[str, np.ndarray] = {}
    for estimator in made.values():
        derive = getattr(equations_of(estimator), "truth", None)
        if callable(derive) and truth:
            found |= derive(truth)
    return {**found, **truth}


def drawn_stride(dt: float) -> int:
    """How many samples ``dt`` seconds apart go to one that is drawn."""
    return max(1, round(1.0 / (DRAWN * dt)))


def finished(trajectory: Trajectory, names: Sequence[str]) -> tuple[Subject, Motion]:
    """A recording with estimates, drawn at 50 Hz or its own rate.

    Raises:
        ValueError: an unknown estimator, or the recording lacks a channel of it.
    """
    grid = trajectory.on_grid()
    made = made_estimators(names, grid)
    subject = subject_of(grid, made)
    poses = {label: run_on(estimator, grid).pose for label, estimator in made.items()}
    truth = dict(grid.truth)
    if "orientation" not in truth and "up" in grid.quantities:
        truth["up"] = grid.truth_of("up")
    block = Block(grid.time, with_derived(truth, made), grid.measurements, poses)
    motion = subject.motion(block)
    motion = replace(motion, curves=motion.curves | gain_curves(made, grid))
    return subject, motion.rows(slice(None, None, drawn_stride(grid.dt)))


def gain_curves(made: Mapping[str, Estimator[Any]], trajectory: Trajectory) -> Curves:
    """The constants that policies and rules set, over time; see :data:`Curves`."""
    found: Curves = {}
    for label, estimator in made.items():
        if isinstance(estimator, AdaptiveEstimator):
            actions = estimator.run_with_actions(None, trajectory.measurements)[2]
            model = estimator.filter.model
            for gain, size in gain_sizes(model, estimator.tuned.gains(actions)).items():
                name = model.gains[gain].parameter
                found.setdefault(f"{name}, set while it runs", {})[label] = np.asarray(size, float)
    return found


@dataclass
class LiveMotion:
    """Motion that grows by samples, with estimators that run sample by sample.

    Attributes:
        subject: what moves.
        online: label → estimator at the rate of the samples.
        dt: sampling interval, s.
        kept: s of motion that are kept.
        motion: so far; None before the first sample.
    """

    subject: Subject
    online: Mapping[str, OnlineEstimator]
    dt: float
    kept: float = KEPT
    motion: Motion | None = field(default=None, init=False)
    _count: int = field(default=0, init=False)

    def add(self, samples: Sequence[Timed], truth: Mapping[str, np.ndarray] | None = None) -> None:
        """Estimate and append samples, in the order of time, with their truth, quantity → ``(n, size)``.

        Raises:
            ValueError: a sample lacks a channel of an estimator.
        """
        if not samples:
            return
        steps = {
            label: [online.step(sample.measurement, sample.restart).pose for sample in samples]
            for label, online in self.online.items()
        }
        poses = {
            label: {name: np.array([pose[name] for pose in rows]) for name in rows[0]} for label, rows in steps.items()
        }
        made = {label: online.estimator for label, online in self.online.items()}
        channels = samples[0].measurement
        block = Block(
            np.array([sample.time for sample in samples]),
            with_derived(truth or {}, made),
            {name: np.array([sample.measurement[name] for sample in samples]) for name in channels},
            poses,
        )
        stride = drawn_stride(self.dt)
        added = self.subject.motion(block).rows(slice(-self._count % stride, None, stride))
        self._count += len(samples)
        whole = added if self.motion is None else joined(self.motion, added)
        first = int(np.searchsorted(whole.time, block.time[-1] - self.kept))
        self.motion = whole.rows(slice(first, None))


def live_motion(names: Sequence[str], trajectory: Trajectory) -> LiveMotion:
    """A live motion like a trajectory, whose samples are not yet part of it.

    The trajectory has one or more samples, with the channels, truth, sampling interval and metadata to come.

    Raises:
        ValueError: an unknown estimator, one that needs the whole recording, or a channel is lacking.
    """
    made = made_estimators(names, trajectory)
    online = {name: OnlineEstimator(each).warm_up() for name, each in made.items()}
    return LiveMotion(subject_of(trajectory, made), online, trajectory.dt)


class PlayedEnvironment:
    """An environment that is stepped without an agent; its samples and truth, a block at a time.

    Args:
        env: of this package.
        seed: of the first episode.
    """

    def __init__(self, env: Any, seed: int) -> None:
        self.env: PoseEnv = env.unwrapped
        if not hasattr(self.env, "measurement"):
            named = env.spec.id if env.spec is not None else env
            raise ValueError(f"{named} is not an environment whose agent estimates a pose")
        _, self._info = self.env.reset(seed=seed)
        self._begin = self._info["time"]
        self._last = self.over = False

    def block(self, until: float) -> tuple[list[Timed], dict[str, np.ndarray]]:
        """Samples up to a time after the first one, s, and their truth."""
        samples, rows = [], []
        while not self.over and self._info["time"] - self._begin <= until:
            samples.append(Timed(self._info["time"], self.env.measurement(), False, False))
            rows.append({**self._info["pose"], **self._info["truth"]})
            self.over = self._last
            if not self.over:
                _, _, terminated, truncated, self._info = self.env.step(self.env.neutral_action)
                self._last = terminated or truncated
        return samples, {name: np.array([row[name] for row in rows]) for name in rows[0]} if rows else {}


def tuned_episode(env: Any, seed: int) -> Trajectory | None:
    """The motion of an episode of gain tuning; None of another environment."""
    if not isinstance(env.unwrapped, GainTuningEnv):
        return None
    env.reset(seed=seed)
    assert env.unwrapped.trajectory is not None  # after a reset
    trajectory = env.unwrapped.trajectory.on_grid()
    return trajectory.replace(metadata=trajectory.metadata | {"rate": 1.0 / trajectory.dt})


def tuned_estimators(env: Any) -> tuple[str, ...]:
    """The filter whose gains an environment tunes, and it with each policy or rule; none of another environment."""
    if not isinstance(env.unwrapped, GainTuningEnv):
        return ()
    name = filter_name(env.unwrapped.tuned.kalman)
    adaptive = [each for each, info in list_estimators().items() if info.kind == "adaptive"]
    return (name, *(each for each in adaptive if each.split("+")[0] == name))
