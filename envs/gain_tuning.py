"""Environments whose agent tunes a filter while it runs: ``poise/HandMotionGain-v0``, ``poise/ReplayGain-v0``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from gymnasium import spaces

from ..filters.adaptation.features import InnovationFeatures
from ..filters.adaptation.gains import gain_sizes, tunable_filter
from ..filters.adaptation.tuned import TunedFilter, TunedState
from ..filters.core.kalman import KalmanFilter
from ..filters.core.metrics import error
from ..filters.core.quantity import Estimate, Quantity
from .base import renamed
from .data.formats.load import load_recording
from .data.trajectory import Trajectory
from .drawn import DrawnEnv, Scene, Shown
from .hand.gestures import GestureConfig
from .hand.trajectories import HandTrajectories
from .recipes.hand import HandRecipe
from .recipes.registry import hand_recipe
from .sensors.presets import SensorPreset

RewardKind = Literal["error", "improvement"]
NIS_FLOOR = 1e-6
"""Smallest mean NIS of the consistency term."""


class GainTuningEnv(DrawnEnv):
    """Base class of the gain-tuning environments; subclasses provide the trajectories.

    Args:
        filter: name of a Kalman filter with gains (:func:`poise.list_estimators`), or such a filter; it must read a
            gyroscope. It is configured with the rider and bicycle, or the device,
            in the metadata of the trajectory.
        gains: names of the gains to be tuned, in the order of the action; None for all.
        quantity: output of the filter whose error counts; None for ``up``, or the filter's first output.
        interval: time from decision to decision, s, rounded to samples.
        reward: ``error`` or ``improvement``, see the subclasses.
        consistency: weight of the consistency term of the reward, rad.
        render_mode: ``human`` (a window), ``rgb_array`` or None.

    Raises:
        ValueError: an unknown filter, gain, quantity or kind of reward, or a number out of its range.
    """

    _episode_fields: ClassVar[tuple[str, ...]] = (
        *("trajectory", "tuned", "_measurements", "_truth", "_reference", "_step", "_state", "_estimates"),
    )
    """Attributes that belong to an episode."""

    def __init__(
        self,
        filter: str | KalmanFilter = "external-acceleration",
        *,
        gains: Sequence[str] | None = None,
        quantity: str | None = None,
        interval: float = 0.1,
        reward: RewardKind = "error",
        consistency: float = 0.0,
        render_mode: str | None = None,
    ) -> None:
        if reward not in ("error", "improvement"):
            raise ValueError(f"reward must be 'error' or 'improvement', got {reward!r}")
        if not 0.0 <= consistency < math.inf:
            raise ValueError(f"consistency must be a weight of 0 or more, got {consistency}")
        super().__init__(render_mode, 1.0 / interval if interval > 0.0 else 1.0)
        names = None if gains is None else tuple(gains)
        self.tuned = TunedFilter.of(tunable_filter(filter), names, InnovationFeatures(interval))
        self._published = self.tuned.kalman
        self.quantity = scored_quantity(self.tuned.kalman, quantity)
        self.reward_kind, self.consistency = reward, float(consistency)
        size, actions = self.tuned.observation_size, self.tuned.actions
        self.observation_space = spaces.Box(-1.0, 1.0, (size,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (actions,), np.float32)
        self.neutral_action = np.zeros(actions, np.float32)
        self.trajectory: Trajectory | None = None

    def next_trajectory(self) -> Trajectory:
        """The trajectory of the next episode; all randomness from ``self.np_random``."""
        raise NotImplementedError

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin a new trajectory; the filter has seen nothing yet.

        Raises:
            ValueError: an unknown option (there are none), or a trajectory that lacks a channel of the filter.
        """
        super().reset(seed=seed)
        self.checked_options(options)
        self.trajectory = trajectory = self.next_trajectory()
        channels = [channel.name for channel in self.tuned.kalman.channels]
        missing = [name for name in channels if name not in trajectory.measurements]
        if missing:
            raise ValueError(f"trajectory {trajectory.name!r} lacks the channels {missing} that the filter reads")
        kalman = self._published.with_dt(trajectory.dt)
        kalman = replace(kalman, model=kalman.model.configured(trajectory.metadata))
        self.tuned = replace(self.tuned, kalman=kalman)
        self._measurements = {name: trajectory.measurements[name] for name in channels}
        self._truth = true_values(trajectory, self.quantity, kalman)
        self._reference = None
        if self.reward_kind == "improvement":
            estimate = self.tuned.kalman.run(self._measurements)
            self._reference = error(self.quantity, estimate.pose[self.quantity.name], self._truth)
        self._step = 0
        self._state = self.tuned.init({name: values[0] for name, values in self._measurements.items()})
        self._estimates = {output.name: np.full(output.size, np.nan) for output in self.tuned.kalman.outputs}
        self._show(0)
        return self.tuned.observe(self._state), self._info(math.nan)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Run the filter over one interval with the gains of ``action``.

        Raises:
            ValueError: the action has a wrong shape or is not finite.
            RuntimeError: :meth:`reset` was not called, or the episode is over.
        """
        if self.trajectory is None or self._step + self.tuned.interval_samples > len(self.trajectory):
            raise RuntimeError("call reset first: there is no episode, or it is over")
        chosen = np.asarray(action, dtype=float)
        if chosen.shape != self.action_space.shape or not np.isfinite(chosen).all():
            raise ValueError(f"action must hold {self.tuned.actions} finite numbers, got {action!r}")
        samples = slice(self._step, self._step + self.tuned.interval_samples)
        chunk = {name: values[samples] for name, values in self._measurements.items()}
        estimate, self._state = self.tuned.advance(self.tuned.decide(self._state, chosen), chunk)
        self._step = samples.stop
        errors = error(self.quantity, estimate.pose[self.quantity.name], self._truth[samples])
        scored = self.trajectory.mask[samples]
        mean_error = interval_mean(errors, scored)
        reward = -mean_error if math.isfinite(mean_error) else 0.0
        if self._reference is not None:
            reference = interval_mean(self._reference[samples], scored)
            reward += reference if math.isfinite(reference) else 0.0
        if self.consistency:
            reward -= self.consistency * inconsistency(estimate, self.tuned.kalman.model.residual_size)
        truncated = self._step + self.tuned.interval_samples > len(self.trajectory)
        self._estimates = {name: np.array(estimate.pose[name][-1]) for name in self._estimates}
        self._show(self._step // self.tuned.interval_samples)
        return self.tuned.observe(self._state), reward, False, truncated, self._info(mean_error)

    def make_scene(self, gui: bool) -> Scene:
        """A device above the ground, and the axes of the filter's estimate."""
        from .rendering import DeviceScene

        return DeviceScene(gui=gui)

    def shown(self) -> Shown | None:
        """Truth of the last sample, and the filter's attitude (its first output where it has none)."""
        if self.trajectory is None:
            return None
        truth = {name: values[max(self._step - 1, 0)] for name, values in self.trajectory.truth.items()}
        wanted = (self.quantity.name, "up", "orientation", "relative_orientation")
        known = [name for name in wanted if name in self._estimates and self._estimates[name].size in (3, 4)]
        return Shown(truth, truth, self._estimates[known[0]] if known else np.zeros(3))

    def save_episode(self) -> dict[str, Any] | None:
        """Trajectory, filter and position in it; None where there is no episode."""
        return None if self.trajectory is None else {name: getattr(self, name) for name in self._episode_fields}

    def restore_episode(self, saved: dict[str, Any]) -> None:
        """Undo :meth:`save_episode`."""
        for name, value in saved.items():
            setattr(self, name, value)

    def _info(self, mean_error: float) -> dict[str, Any]:
        assert self.trajectory is not None
        row = max(self._step - 1, 0)
        pose = self._truth[row]
        sizes = gain_sizes(self.tuned.kalman.model, self.tuned.gains(self._state.action))
        return {
            "time": float(self.trajectory.time[row]),
            "pose": {self.quantity.name: np.array(pose)},
            "truth": {name: np.array(values[row]) for name, values in self.trajectory.truth.items()},
            "estimate": {name: values.copy() for name, values in self._estimates.items()},
            "error_deg": math.degrees(mean_error),
            "gains": {name: float(size) for name, size in sizes.items()},
        }


class HandMotionGainEnv(GainTuningEnv):
    r"""An agent tunes the gains of an attitude filter while a hand moves an inertial sensor.

    Every episode draws a motion, a sensor with its errors, and its mounting. A step runs the filter over ``interval``
    seconds (several samples) with the gains of the action. Nothing that the agent sees contains the truth.

    ## Action space

    ``Box(-1, 1, (k,), float32)``, one number for each gain; 0 is the published tuning exactly, and between 0 and ±1
    the logarithm of the constant is changed linearly, variances by up to 10^±1.5.

    | filter | gains (constant that is scaled) |
    |---|---|
    | ``external-acceleration`` | ``process`` (σ_G), ``measurement`` (σ_A), ``c_a`` (10⁻³ to 0.5) |
    | ``bounded-motion`` | ``process`` (σ_g), ``bias`` (σ_b), ``velocity`` (σ_V) |

    c_a is never so large that a gyroscope error of 1 °/s could lock the filter out (:mod:`.gains`).

    ## Observation space

    ``Box(-1, 1, (n,), float32)``: statistics of the whitened innovations, the sensors and the estimated external
    acceleration over five time scales up to 16 s, the time since the start, and the last action
    (:class:`poise.filters.adaptation.features.InnovationFeatures`; ``env.unwrapped.tuned.features.names``).

    ## Reward

    ``error``: minus the mean error of ``quantity`` over the interval, rad (:func:`poise.filters.core.metrics.error`).
    ``improvement``: that of the published tuning, run beside it, minus the agent's: the same optimal policy with far
    less variance. Samples without truth or outside the evaluation mask do not count. With ``consistency`` w, minus
    w·|ln(mean NIS / m)| of the m innovations of the interval.

    ## Start and end

    The filter is not yet initialised, so the first observation carries no information. Truncated when the motion is
    over; never terminated.

    ## info

    The same at reset and at every step, as of the last sample taken: ``time`` (s), ``pose`` (true ``quantity``),
    ``truth`` (all that is known), ``estimate`` (outputs of the filter; NaN before it started), ``error_deg`` (mean
    over the interval; NaN at reset), ``gains`` (name → scaled constant).

    ## Arguments

    Those of :class:`GainTuningEnv`, and ``gesture``, ``rate`` (Hz), ``sensors`` (preset), each a single one or
    several to draw from, ``noise_scale`` (factor on the sensor's errors, or lowest and highest), ``duration`` (s),
    ``mounting``, ``drive``; see :class:`poise.envs.hand.trajectories.HandTrajectories`. The dynamic drive takes
    several times as long. Or ``recipe``, a :class:`poise.envs.recipes.hand.HandRecipe`, its name or JSON file, in
    place of them all (:func:`poise.envs.recipes.registry.recipe`).

    ## Version history

    v0: first release.
    """

    @renamed(grade="noise_scale")
    def __init__(
        self,
        filter: str | KalmanFilter = "external-acceleration",
        *,
        gesture: str | GestureConfig | Sequence[str | GestureConfig] = "mixed",
        rate: float | Sequence[float] = 100.0,
        sensors: str | SensorPreset | Sequence[str | SensorPreset] = "xsens-mtw-awinda",
        noise_scale: float | tuple[float, float] = 1.0,
        duration: float = 60.0,
        mounting: Literal["random", "aligned"] = "random",
        drive: Literal["kinematic", "dynamic"] = "kinematic",
        recipe: str | Path | HandRecipe | None = None,
        **common: Any,
    ) -> None:
        super().__init__(filter, **common)
        self.recipe = None if recipe is None else hand_recipe(recipe)
        self.motions = HandTrajectories(
            gestures=gesture,  # type: ignore[arg-type]
            rates=rate,  # type: ignore[arg-type]
            sensors=sensors,  # type: ignore[arg-type]
            noise_scale=noise_scale,  # type: ignore[arg-type]
            duration=duration,
            mounting=mounting,
            drive=drive,
        )
        rates = self.motions.rates if self.recipe is None else self.recipe.rates
        shortest = duration if self.recipe is None else self.recipe.duration
        longest = max(1.0 / rate * self.tuned.features.interval_samples(1.0 / rate) for rate in rates)
        if shortest < longest:
            raise ValueError(f"duration must be one interval at least ({longest:g} s), got {shortest}")

    def next_trajectory(self) -> Trajectory:
        """A new motion and new errors."""
        generator = self.np_random.spawn(1)[0]
        if self.recipe is None:
            return self.motions.draw(generator)
        return self.recipe.draw(int(generator.integers(2**32)))


class ReplayGainEnv(GainTuningEnv):
    """An agent tunes the gains of an attitude filter over recordings, or any trajectories with a known truth.

    Actions, observations, rewards and info are those of :class:`HandMotionGainEnv`; an episode runs through one
    trajectory, or a part of one.

    ## Start and end

    Each reset draws one of the trajectories and, with a ``duration``, where the episode starts in it. Truncated when
    the part is over (samples that fill no interval are left out); never terminated.

    ## Arguments

    Those of :class:`GainTuningEnv`, and ``trajectory``: a :class:`poise.Trajectory`, the path of a recording, or a
    sequence of such; ``duration``: length of an episode, s (None: the whole trajectory). Without a ``trajectory`` a
    simulated hand motion of a minute stands in, always the same.

    ## Version history

    v0: first release.
    """

    def __init__(
        self,
        trajectory: Trajectory | str | Path | Sequence[Trajectory | str | Path] | None = None,
        filter: str | KalmanFilter = "external-acceleration",
        *,
        duration: float | None = None,
        **common: Any,
    ) -> None:
        super().__init__(filter, **common)
        given = HandTrajectories().draw_many(0, 1) if trajectory is None else trajectory
        items = [given] if isinstance(given, Trajectory | str | Path) else list(given)
        if not items:
            raise ValueError("trajectory must name at least one trajectory, got none")
        loaded = (item if isinstance(item, Trajectory) else load_recording(item) for item in items)
        self.trajectories = tuple(item.on_grid() for item in loaded)
        for item in self.trajectories:
            true_values(item, self.quantity, self.tuned.kalman)
            shortest = self.tuned.features.interval_samples(item.dt)
            length = len(item) if duration is None else math.floor(duration / item.dt + 1e-6)
            if min(length, len(item)) < shortest:
                raise ValueError(f"an episode of {item.name!r} must last one interval at least ({shortest} samples)")
        self.duration = duration

    def next_trajectory(self) -> Trajectory:
        """One of the trajectories, or a part of it."""
        trajectory = self.trajectories[int(self.np_random.integers(len(self.trajectories)))]
        if self.duration is None:
            return trajectory
        length = min(math.floor(self.duration / trajectory.dt + 1e-6), len(trajectory))
        start = int(self.np_random.integers(len(trajectory) - length + 1))
        return trajectory[start : start + length]


def scored_quantity(kalman: KalmanFilter, name: str | None) -> Quantity:
    """The output of a filter whose error counts.

    Raises:
        ValueError: the filter has no such output.
    """
    outputs = {output.name: output for output in kalman.outputs}
    if name is None:
        return outputs.get("up", kalman.outputs[0])
    if name not in outputs:
        raise ValueError(f"quantity must be one of {sorted(outputs)}, got {name!r}")
    return outputs[name]


def true_values(trajectory: Trajectory, quantity: Quantity, kalman: KalmanFilter) -> np.ndarray:
    """The truth ``(T, size)`` of an output: as recorded, or of a paper's own quantity derived from it.

    Raises:
        ValueError: the trajectory does not know it.
    """
    if quantity.name not in trajectory.truth:
        derived = kalman.model.truth(trajectory.truth)
        if quantity.name in derived:
            return derived[quantity.name]
    return trajectory.truth_of(quantity.name)


def interval_mean(errors: np.ndarray, scored: np.ndarray) -> float:
    """Mean of the finite errors ``(T,)`` inside the evaluation mask; NaN where there is none."""
    counted = errors[scored & np.isfinite(errors)]
    return float(counted.mean()) if counted.size else math.nan


def inconsistency(estimate: Estimate, size: int) -> float:
    """|ln(mean NIS / m)| over the samples ``(T,)`` with an innovation; 0 without any."""
    nis = np.asarray(estimate.nis)
    nis = nis[nis > 0.0]
    return abs(math.log(max(float(nis.mean()) / size, NIS_FLOOR))) if nis.size else 0.0


__all__ = ["GainTuningEnv", "HandMotionGainEnv", "ReplayGainEnv", "TunedState"]
