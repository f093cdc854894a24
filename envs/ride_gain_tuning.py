"""``poise/RiderBicycleGain-v0``: an agent tunes the filter of one IMU while a rider rides."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from ..filters.core.kalman import KalmanFilter
from ..filters.support.seeds import child_seeds, root_seed
from .bicycle.course.scenarios import Scenario
from .bicycle.environment import RiderBicycleEnv
from .bicycle.rider.anthropometry import RiderBody
from .bicycle.rider.rider import Fidelity
from .bicycle.rider.style import RiderStyle
from .bicycle.sensors.single_imu import SITES, imu_of
from .data.trajectory import Trajectory
from .drawn import Scene, Shown
from .episodes import EpisodeStore
from .gain_env import Drawn, GainTuningEnv
from .gain_vector import GainTuningVectorEnv
from .record import record
from .sensors.ideal import Sampling

Scenarios = str | Scenario | Sequence[str | Scenario]


class RiderBicycleGainEnv(GainTuningEnv):
    """An agent tunes the gains of a filter on a ride: of one IMU's attitude, or of rider and bicycle.

    Every episode is a ride of ``poise/RiderBicycle-v0`` with its sensor errors, one of ``rides`` different ones: a step
    runs the filter over ``interval`` seconds (several samples) with the gains of the action. A bicycle is difficult for
    filters with an accelerometer: it leans into its turns, so that the mean specific force points along the bicycle's
    upward axis, not along the vertical. Observations do not contain the truth, and actions do not change the ride.

    ## Action Space

    ``Box(-1, 1, (k,), float32)``, one number for each gain, as of :class:`poise.envs.gain_tuning.HandMotionGainEnv`
    (:mod:`poise.filters.adaptation.gains` has the ranges).

    | filter | gains (constant that is scaled) |
    |---|---|
    | ``external-acceleration`` | ``measurement`` (σ_A); where named, ``process`` (σ_G), ``c_a`` |
    | ``bounded-motion`` | ``process`` (σ_g), ``bias`` (σ_b), ``velocity`` (σ_V) |
    | ``two-gyro``, ``force-inertial``, ``whole-body``, ``odometry-aided`` … | ``env.unwrapped.tuned.kalman.gains`` |

    A filter of one IMU reads ``imu/gyr`` and ``imu/acc`` of the chosen ``site``. A filter of rides reads the channels
    of the ride that it needs, and is configured with rider and bicycle of every episode.

    ## Observation Space

    ``Box(-1, 1, (n,), float32)``. A filter of one IMU: as of :class:`poise.envs.gain_tuning.HandMotionGainEnv`. A
    filter of rides: the NIS of every row of its measurement, and mean and variation of every number of its sensors
    (rates, accelerations, speed …) by name, over five time scales up to 16 s, the time since the start, and the last
    action (:class:`poise.filters.adaptation.named_features.NamedFeatures`; ``env.unwrapped.tuned.features.names``).

    ## Rewards

    As of :class:`poise.envs.gain_tuning.HandMotionGainEnv`; ``quantity`` may name several of a paper's angles.

    ## Starting State

    Riding, as in ``poise/RiderBicycle-v0``; the filter is not yet initialised, so the first observation carries no
    information.

    ## Episode End

    Truncated when the ride is over, or early where the rider fell (no preset scenario makes them fall); never
    terminated. Samples of an incomplete last interval are left out.

    ## Info

    As of :class:`poise.envs.gain_tuning.HandMotionGainEnv`; ``truth`` is that of the sensor, mounting included
    (:func:`poise.envs.bicycle.sensors.single_imu.imu_of`), with a filter of rides all that ``poise/RiderBicycle-v0``
    knows.

    ## Cost

    A ride is simulated when it is first drawn and kept in the user's cache folder (``POISE_CACHE`` names another one),
    so that later resets, also those of other processes and sessions, read it. With ``rides=None`` every reset
    simulates a ride. The folder keeps at most 1 GB of the rides used last, and none of another version of the code.

    ## Arguments

    Args:
        filter: name of a Kalman filter with gains (:func:`poise.list_estimators`), or such a filter.
        site: ``bicycle_imu`` or ``trunk_imu``; of no effect with a filter of rides.
        scenario: of the rides, one or several to draw from with equal probability.
        subject: 0…4, ``"random"`` for a new rider in every episode, or a rider.
        style: how the rider moves; None for that of the scenario.
        sensors: ``paper``, ``ideal``, or a device (:func:`poise.envs.sensors.presets.list_sensor_presets`).
        rate: samples per second, Hz.
        duration: of an episode, s.
        fidelity: ``lumped`` (cheap; arms and legs are rigid parts of trunk and pelvis) or
            ``full``.
        physics_rate: physics steps per second, Hz; a multiple of 250 Hz and of ``rate``.
        noise_scale: factor on all sensor errors.
        sampling: ``interval`` or ``instant``.
        rides: number of different rides, each as likely as any other; None for a new one in every episode.
        rides_seed: root seed of these rides; evaluate with another one than in training.
        common: ``gains``, ``quantity``, ``interval`` (s), ``reward``, ``consistency``, ``smoothing`` (s) of
            :class:`poise.envs.gain_env.GainTuningEnv`, and ``render_mode``.

    Raises:
        ValueError: an unknown site, filter, scenario or rider, or a number out of its range.

    ## Version History

    * v0: first release.
    """

    _episode_fields = (*GainTuningEnv._episode_fields, "_ridden", "_present")

    def __init__(
        self,
        filter: str | KalmanFilter = "external-acceleration",
        site: str = "bicycle_imu",
        scenario: Scenarios = "outdoor",
        subject: int | str | RiderBody = "random",
        *,
        style: str | RiderStyle | None = None,
        sensors: str = "paper",
        rate: float = 100.0,
        duration: float = 20.0,
        fidelity: Fidelity = "lumped",
        physics_rate: float = 500.0,
        noise_scale: float = 1.0,
        sampling: Sampling = "interval",
        rides: int | None = 200,
        rides_seed: int = 0,
        **common: Any,
    ) -> None:
        super().__init__(filter, **common)
        if rides is not None and rides < 1:
            raise ValueError(f"rides must be None or at least 1, got {rides}")
        if site not in SITES:
            raise ValueError(f"site must be one of {list(SITES)}, got {site!r}")
        self.site = site
        names = [channel.name for channel in self.tuned.kalman.channels]
        self.of_rides = not all(name.startswith("imu/") for name in names)
        if not self.of_rides:
            kinds = dict.fromkeys((*(name.removeprefix("imu/") for name in names), "gyr", "acc"))
            names = [f"{site}/{kind}" for kind in kinds]
        scenarios = [scenario] if isinstance(scenario, str | Scenario) else list(scenario)
        if not scenarios:
            raise ValueError("scenario must name at least one scenario, got none")
        self._present: tuple[tuple[int, int], Trajectory] | None = None
        self._seeds = None if rides is None else child_seeds(root_seed(rides_seed), rides)
        settings = (subject, style, names, sensors, rate, duration, fidelity, physics_rate, noise_scale, sampling)
        self._store = EpisodeStore("rides", (scenarios, *settings))
        self.rides = tuple(
            RiderBicycleEnv(
                each,
                subject,
                style,
                names,
                sensors,
                rate,
                duration,
                fidelity,
                physics_rate=physics_rate,
                noise_scale=noise_scale,
                sampling=sampling,
            )
            for each in scenarios
        )
        longest = self.tuned.features.interval_samples(1.0 / rate) / rate
        if duration < longest:
            raise ValueError(f"duration must be one interval at least ({longest:g} s), got {duration}")

    def draw(self, generator: np.random.Generator) -> Drawn:
        """A ride and its sensor errors."""
        own = generator.spawn(1)[0]
        number = int(own.integers(len(self.rides)))
        if self._seeds is None:
            key, seed = None, int(own.integers(2**32))
        else:
            seed = self._seeds[int(own.integers(len(self._seeds)))]
            key = (number, seed)
        self._ridden = number, seed
        # another person or another ground: the scene is recreated on demand
        super().close()
        return key, partial(self._ride, number, seed)

    def _ride(self, number: int, seed: int) -> Trajectory:
        """A ride, kept where rides are limited; what the filter reads of it."""
        ridden = self._whole(number, seed)
        return ridden if self.of_rides else imu_of(ridden, self.site)

    def _whole(self, number: int, seed: int) -> Trajectory:
        """A ride with all that is known of it; a ride that is never drawn again is kept while it lasts."""
        simulate = partial(record, self.rides[number], seed=seed)
        if self._seeds is not None:
            return self._store.episode((number, seed), simulate)
        if self._present is None or self._present[0] != (number, seed):
            self._present = (number, seed), simulate()
        return self._present[1]

    def make_scene(self, gui: bool) -> Scene:
        """Rider, bicycle and ground of the episode."""
        from .bicycle.course.scene import RideScene

        number, seed = self._ridden
        ride = self.rides[number]
        # a ride that was read has no world yet
        ride.reset(seed=seed)
        return RideScene(*ride.scenery, gui=gui)

    def shown(self) -> Shown | None:
        """The whole ride."""
        shown = super().shown()
        if shown is None:
            return None
        truth = {name: values[max(self._step - 1, 0)] for name, values in self._whole(*self._ridden).truth.items()}
        return Shown(truth, truth, shown.estimate)

    def close(self) -> None:
        """Close the worlds of the rides; may be called twice."""
        super().close()
        for ride in self.rides:
            ride.close()


class RiderBicycleGainVectorEnv(GainTuningVectorEnv):
    """Episodes of :class:`RiderBicycleGainEnv` that are computed together."""

    kind = RiderBicycleGainEnv
