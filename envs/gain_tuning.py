"""Environments whose agent tunes a filter while it runs: ``poise/HandMotionGain-v0``, ``poise/ReplayGain-v0``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..filters.core.kalman import KalmanFilter
from ..filters.support.seeds import child_seeds, root_seed
from .data.formats.load import load_recording
from .data.trajectory import Trajectory
from .gain_env import Drawn, GainTuningEnv
from .gain_episode import check_scored, scorable_starts
from .gain_vector import GainTuningVectorEnv
from .hand.gestures import GestureConfig
from .hand.trajectories import HandTrajectories
from .recipes.hand import HandRecipe
from .recipes.registry import hand_recipe
from .sensors.presets import SensorPreset


class HandMotionGainEnv(GainTuningEnv):
    r"""An agent tunes the gains of an attitude filter while a hand moves an inertial sensor.

    Every episode draws a motion, a sensor with its errors, and its mounting. A step runs the filter over ``interval``
    seconds (several samples) with the gains of the action. Nothing that the agent sees contains the truth.

    ## Action space

    ``Box(-1, 1, (k,), float32)``, one number for each gain; 0 is the published tuning exactly, and between 0 and ±1
    the logarithm of the constant is changed linearly, variances by a factor of 10^1.5 at most unless a range is given.

    | filter | gains (constant that is scaled) |
    |---|---|
    | ``external-acceleration`` | ``measurement`` (σ_A ≤ 0.3 m/s²); where named, ``process`` (σ_G), ``c_a`` (≤ 0.5) |
    | ``bounded-motion`` | ``process`` (σ_g), ``bias`` (σ_b), ``velocity`` (σ_V) |

    c_a stays below the values at which a gyroscope error of 1 °/s could lock the filter out
    (:mod:`poise.filters.adaptation.gains`). It is set only where ``gains`` names it, because almost every change of it
    increases the error; so is σ_G, because only its ratio to σ_A matters. The gains follow the actions with the time
    constant ``smoothing``, so that noise of unit variance in single decisions changes them by a few tenths of a decade.

    ## Observation space

    ``Box(-1, 1, (n,), float32)``: statistics of the whitened innovations, the sensors and the estimated external
    acceleration over five time scales up to 16 s, the time since the start, and the last action
    (:class:`poise.filters.adaptation.features.InnovationFeatures`; ``env.unwrapped.tuned.features.names``). They do not
    depend on the mounting. A filter of several sensors with known places has the NIS of every row and every number of
    every channel by name instead (:class:`poise.filters.adaptation.named_features.NamedFeatures`).

    ## Reward

    * ``error``: minus the mean error of ``quantity`` over the interval, rad (:func:`poise.filters.core.metrics.error`).
    * ``improvement``: the error of the ``reference`` gains, which run in parallel, minus the agent's. The optimal
      policy is the same, the variance far smaller.
    * ``relative`` (the default): likewise of s ln(1 + e / s) with s = ``error_scale``, divided by the mean of the
      reference over the episode plus 0.2°: easy and hard motions count alike, and a few bad seconds do not dominate.

    ``improvement`` and ``relative`` are zero with the ``reference`` gains. Samples without truth or outside the
    evaluation mask do not count. With ``consistency`` w, minus w·|ln(mean NIS / m)| of the m innovations of the
    interval.

    ## Start and end

    The filter is not yet initialised, so the first observation carries no information. Truncated when the motion is
    over; never terminated.

    ## info

    The same at reset and at every step, as of the last sample taken: ``time`` (s), ``pose`` (true ``quantity``),
    ``truth`` (all that is known), ``estimate`` (outputs of the filter; NaN before it started), ``error_deg`` (mean
    over the interval; NaN at reset), ``gains`` (name → scaled constant).

    ## Arguments

    Those of :class:`.GainTuningEnv`, and those of the motions (:class:`poise.envs.hand.trajectories.HandTrajectories`).

    Args:
        gesture: name of a motion, or a configuration, or several to draw from with equal probability.
        rate: samples per second, Hz, or several to draw from.
        sensors: name of a preset, or a preset, or several to draw from.
        noise_scale: factor on all errors of the sensor, or the lowest and the highest.
        duration: of an episode, s.
        mounting: ``random`` (axes of the sensor drawn from all rotations) or ``aligned`` (those of the body).
        drive: ``kinematic``, or ``dynamic``, which takes several times as long.
        recipe: :class:`poise.envs.recipes.hand.HandRecipe`, its name or JSON file, in place of all of these
            (:func:`poise.envs.recipes.registry.recipe`).
        motions: number of different motions, each as likely as any other; None for a new one in every episode.
        motions_seed: root seed of these.

    ## Version history

    * v0: first release.
    """

    def __init__(
        self,
        filter: str | KalmanFilter = "external-acceleration",
        *,
        gesture: str | GestureConfig | Sequence[str | GestureConfig] = "hand-held",
        rate: float | Sequence[float] = 100.0,
        sensors: str | SensorPreset | Sequence[str | SensorPreset] = "xsens-mtw-awinda",
        noise_scale: float | tuple[float, float] = 1.0,
        duration: float = 60.0,
        mounting: Literal["random", "aligned"] = "random",
        drive: Literal["kinematic", "dynamic"] = "kinematic",
        recipe: str | Path | HandRecipe | None = None,
        motions: int | None = None,
        motions_seed: int = 0,
        **common: Any,
    ) -> None:
        super().__init__(filter, **common)
        if motions is not None and motions < 1:
            raise ValueError(f"motions must be None or at least 1, got {motions}")
        self._seeds = None if motions is None else child_seeds(root_seed(motions_seed), motions)
        self.recipe = None if recipe is None else hand_recipe(recipe)
        self.source = HandTrajectories(
            gestures=gesture,  # type: ignore[arg-type]
            rates=rate,  # type: ignore[arg-type]
            sensors=sensors,  # type: ignore[arg-type]
            noise_scale=noise_scale,  # type: ignore[arg-type]
            duration=duration,
            mounting=mounting,
            drive=drive,
        )
        rates = self.source.rates if self.recipe is None else self.recipe.rates
        shortest = duration if self.recipe is None else self.recipe.duration
        longest = max(1.0 / rate * self.tuned.features.interval_samples(1.0 / rate) for rate in rates)
        if shortest < longest:
            raise ValueError(f"duration must be one interval at least ({longest:g} s), got {shortest}")

    def draw(self, generator: np.random.Generator) -> Drawn:
        """A motion and its errors."""
        own = generator.spawn(1)[0]
        key = None
        if self._seeds is not None:
            key = self._seeds[int(own.integers(len(self._seeds)))]
            own = np.random.default_rng(key)
        return key, partial(self._simulate, own)

    def _simulate(self, generator: np.random.Generator) -> Trajectory:
        if self.recipe is None:
            return self.source.draw(generator)
        return self.recipe.draw(int(generator.integers(2**32)))


class ReplayGainEnv(GainTuningEnv):
    """An agent tunes the gains of an attitude filter over recordings, or any trajectories with a known truth.

    Actions, observations, rewards and info are those of :class:`HandMotionGainEnv`; an episode runs through one
    trajectory, or a part of one.

    ## Start and end

    Each reset draws one of the trajectories and, with a ``duration``, where the episode starts in it, among the parts
    that have samples of every channel of the filter and something to score. Truncated when the part is over (samples
    that fill no interval are left out); never terminated.

    ## Arguments

    Those of :class:`.GainTuningEnv`, and:

    Args:
        trajectory: a :class:`poise.Trajectory`, the path of a recording, or a sequence of such; None for a simulated
            hand motion of a minute, always the same.
        duration: of an episode, s; None for the whole trajectory.

    ## Version history

    * v0: first release.
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
        self.duration = duration
        self._lengths, self._starts = [], []
        for item in self.trajectories:
            check_scored(item, self.tuned, self.quantities)
            shortest = self.tuned.features.interval_samples(item.dt)
            length = len(item) if duration is None else min(math.floor(duration / item.dt + 1e-6), len(item))
            if length < shortest:
                raise ValueError(f"an episode of {item.name!r} must last one interval at least ({shortest} samples)")
            self._lengths.append(length)
            self._starts.append(scorable_starts(item, self.tuned, self.quantities, length))

    def draw(self, generator: np.random.Generator) -> Drawn:
        """One of the trajectories, or a part of it."""
        index = int(generator.integers(len(self.trajectories)))
        starts, length = self._starts[index], self._lengths[index]
        start = 0 if self.duration is None else int(starts[generator.integers(len(starts))])
        return (index, start), partial(self.trajectories[index].__getitem__, slice(start, start + length))


class HandMotionGainVectorEnv(GainTuningVectorEnv):
    """Episodes of :class:`.HandMotionGainEnv` that are computed together."""

    kind = HandMotionGainEnv


class ReplayGainVectorEnv(GainTuningVectorEnv):
    """Episodes of :class:`.ReplayGainEnv` that are computed together."""

    kind = ReplayGainEnv
