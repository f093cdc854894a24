"""Base class of the environments whose agent tunes a filter while it runs."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces

from ..filters.adaptation.gains import acted_gains, gain_sizes, tunable_filter
from ..filters.adaptation.named_features import features_of
from ..filters.adaptation.tuned import TunedFilter
from ..filters.core.kalman import KalmanFilter
from .data.trajectory import Trajectory
from .drawn import DrawnEnv, Scene, Shown, finite_action
from .gain_episode import PRIVILEGED, GainEpisode
from .gain_reward import GainReward, RewardKind, errors_of, scored_quantities

Drawn = tuple[Hashable, Callable[[], Trajectory]]
"""Key that identifies a trajectory (None: it is never drawn again), and the function that makes it."""
KEPT = 16
"""episodes that an environment keeps in memory"""


class GainTuningEnv(DrawnEnv):
    """Base class of the gain-tuning environments; subclasses provide the trajectories.

    Args:
        filter: name of a Kalman filter with gains (:func:`poise.list_estimators`), or such a filter; it must read a
            gyroscope. It is configured with the rider and bicycle, or the device, in the metadata of the trajectory.
        gains: names of the gains to be tuned, in the order of the action; None for those that suit exploration
            (:func:`poise.filters.adaptation.gains.acted_gains`).
        quantity: output of the filter whose error counts, or several, whose root mean square does; None for ``up``,
            or the filter's first output.
        interval: time from decision to decision, s, rounded to samples.
        reward: ``error``, ``improvement`` or ``relative``, see the subclasses.
        consistency: weight of the consistency term of the reward, rad (relative rewards: without unit).
        reference: action of the constant gains that ``improvement`` and ``relative`` compare with; None for the
            published tuning.
        error_scale: deg; errors far above it count by their logarithm in relative rewards.
        smoothing: s; the gains follow the actions with this time constant, which averages the noise of an agent's
            exploration; 0: at once.
        privileged: whether observations end with privileged information from the truth, for the critic of a training.
        render_mode: ``human`` (a window), ``rgb_array`` or None.

    Raises:
        ValueError: an unknown filter, gain, quantity or kind of reward, or a number out of its range.
    """

    _episode_fields: ClassVar[tuple[str, ...]] = (
        *("trajectory", "tuned", "episode", "_step", "_state", "_estimates", "_last_error"),
    )
    """Attributes that belong to an episode."""

    def __init__(
        self,
        filter: str | KalmanFilter = "external-acceleration",
        *,
        gains: Sequence[str] | None = None,
        quantity: str | Sequence[str] | None = None,
        interval: float = 0.1,
        reward: RewardKind = "relative",
        consistency: float = 0.0,
        reference: Sequence[float] | None = None,
        error_scale: float = 5.0,
        smoothing: float = 1.0,
        privileged: bool = False,
        render_mode: str | None = None,
    ) -> None:
        self.reward = GainReward(reward, float(consistency), math.radians(error_scale))
        super().__init__(render_mode, 1.0 / interval if interval > 0.0 else 1.0)
        if not 0.0 <= smoothing < math.inf:
            raise ValueError(f"smoothing must be 0 or more seconds, got {smoothing}")
        kalman = tunable_filter(filter)
        names = acted_gains(kalman) if gains is None else tuple(gains)
        self.tuned = TunedFilter.of(kalman, names, features_of(kalman, interval), float(smoothing))
        self._published = self.tuned.kalman
        self.quantities = scored_quantities(self.tuned.kalman, quantity)
        size, actions = self.tuned.observation_size, self.tuned.actions
        self.reference = np.zeros(actions) if reference is None else np.asarray(reference, dtype=float)
        if self.reference.shape != (actions,) or not (np.abs(self.reference) <= 1.0).all():
            raise ValueError(f"reference must hold {actions} numbers in [-1, 1], got {reference!r}")
        self.privileged = privileged
        bounds = np.ones(size, np.float32)
        if privileged:
            bounds = np.append(bounds, np.full(PRIVILEGED, np.inf, np.float32))
        self.observation_space = spaces.Box(-bounds, bounds, dtype=np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (actions,), np.float32)
        self.neutral_action = np.zeros(actions, np.float32)
        self.trajectory: Trajectory | None = None
        self._episodes: OrderedDict[Hashable, GainEpisode] = OrderedDict()

    def draw(self, generator: np.random.Generator) -> Drawn:
        """Choose the trajectory of the next episode; all randomness from ``generator``."""
        raise NotImplementedError

    def next_episode(self, generator: np.random.Generator, kept: int = KEPT) -> GainEpisode:
        """Draw the next episode; the last ``kept`` of those that may be drawn again stay in memory."""
        key, make = self.draw(generator)
        found = self._episodes.get(key) if key is not None else None
        if found is None:
            found = self.episode_over(make())
        if key is not None:
            self._episodes[key] = found
            self._episodes.move_to_end(key)
            while len(self._episodes) > kept:
                self._episodes.popitem(last=False)
        return found

    def episode_over(self, trajectory: Trajectory) -> GainEpisode:
        """An episode over a trajectory.

        Raises:
            ValueError: see :meth:`.GainEpisode.of`.
        """
        reference = self.reference if self.reward.needs_reference or self.privileged else None
        tuned = replace(self.tuned, kalman=self._published)
        return GainEpisode.of(trajectory, tuned, self.quantities, self.reward, reference)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin a new trajectory; the filter has seen nothing yet.

        Raises:
            ValueError: an unknown option (there are none), or a trajectory that lacks a channel of the filter.
        """
        super().reset(seed=seed)
        self.checked_options(options)
        self.episode = self.next_episode(self.np_random)
        self.trajectory = self.episode.trajectory
        self.tuned = replace(self.tuned, kalman=self.episode.kalman)
        self._step, self._last_error = 0, math.nan
        self._state = self.tuned.init({name: values[0] for name, values in self.episode.samples.items()})
        self._estimates = {output.name: np.full(output.size, np.nan) for output in self.tuned.kalman.outputs}
        self._show(0)
        return self._observe(), self._info(math.nan)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Run the filter over one interval with the gains of ``action``.

        Raises:
            ValueError: the action has a wrong shape or is not finite.
            RuntimeError: :meth:`reset` was not called, or the episode is over.
        """
        if self.trajectory is None or self._step + self.tuned.interval_samples > len(self.trajectory):
            raise RuntimeError("call reset first: there is no episode, or it is over")
        chosen, _ = finite_action(action, (self.tuned.actions,))
        episode, samples = self.episode, slice(self._step, self._step + self.tuned.interval_samples)
        chunk = {name: values[samples] for name, values in episode.samples.items()}
        estimate, self._state = self.tuned.advance(self.tuned.decide(self._state, chosen), chunk)
        self._step = samples.stop
        errors = errors_of(self.quantities, estimate.pose, episode.truth[samples])
        scored = self.reward.scored(
            *(errors[:, None], self.trajectory.mask[samples, None], episode.reference[samples, None]),
            *(np.array([episode.weight]), np.asarray(estimate.nis)[:, None], self.tuned.kalman.model.residual_size),
        )
        truncated = self._step + self.tuned.interval_samples > len(self.trajectory)
        self._estimates = {name: np.array(estimate.pose[name][-1]) for name in self._estimates}
        self._last_error = float(errors[-1])
        self._show(self._step // self.tuned.interval_samples)
        return self._observe(), float(scored.reward[0]), False, truncated, self._info(float(scored.mean_error[0]))

    def make_scene(self, gui: bool) -> Scene:
        """A device above the ground, and the axes of the filter's estimate."""
        from .rendering import DeviceScene

        return DeviceScene(gui=gui)

    def shown(self) -> Shown | None:
        """Truth of the last sample, and the filter's attitude (its first output where it has none)."""
        if self.trajectory is None:
            return None
        truth = {name: values[max(self._step - 1, 0)] for name, values in self.trajectory.truth.items()}
        wanted = (self.quantities[0].name, "up", "orientation", "relative_orientation")
        known = [name for name in wanted if name in self._estimates and self._estimates[name].size in (3, 4)]
        return Shown(truth, truth, self._estimates[known[0]] if known else np.zeros(3))

    def save_episode(self) -> dict[str, Any] | None:
        """Trajectory, filter and position in it; None where there is no episode."""
        return None if self.trajectory is None else {name: getattr(self, name) for name in self._episode_fields}

    def restore_episode(self, saved: dict[str, Any]) -> None:
        """Undo :meth:`save_episode`."""
        for name, value in saved.items():
            setattr(self, name, value)

    def _observe(self) -> np.ndarray:
        seen = self.tuned.observe(self._state)
        if not self.privileged:
            return seen
        known = self.episode.privileged(self._step // self.tuned.interval_samples, self._last_error)
        return np.concatenate([seen, known])

    def _info(self, mean_error: float) -> dict[str, Any]:
        assert self.trajectory is not None
        row = max(self._step - 1, 0)
        ends = np.cumsum([quantity.size for quantity in self.quantities])
        parts = np.split(self.episode.truth[row].copy(), ends[:-1])
        sizes = gain_sizes(self.tuned.kalman.model, self.tuned.gains(self._state.action))
        return {
            "time": float(self.trajectory.time[row]),
            "pose": {quantity.name: part for quantity, part in zip(self.quantities, parts, strict=True)},
            "truth": {name: np.array(values[row]) for name, values in self.trajectory.truth.items()},
            "estimate": {name: values.copy() for name, values in self._estimates.items()},
            "error_deg": math.degrees(mean_error),
            "gains": {name: float(size) for name, size in sizes.items()},
        }
