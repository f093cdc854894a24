"""Named sensors on moving bodies, each with its own rate: :class:`SensorSuite`, and :func:`imu_suite` for one IMU."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from ...filters.core.quantity import Channel
from .ideal import STANDARD_GRAVITY, BodyState, Mounting, Sampling, magnetic_field, vector
from .motion_sensing import MotionSensing
from .noise import NoiseProcess, NoiseState
from .noise_model import NoiseModel
from .observation import ObservationLayout
from .presets import SensorPreset, sensor_preset
from .sensor import Kind, Sensor, pick


@dataclass
class SuiteState:
    """All memory of a :class:`SensorSuite`."""

    tick: int
    noise: list[NoiseState]
    motion: list[Any]
    held: dict[str, np.ndarray]


class SensorSuite:
    """Sensors that are sampled together.

    The sample of a tick describes the interval that ends there. A sensor slower than the ticks is sampled at the first
    tick at or after each multiple of its own interval, beginning with tick 0; its interval reaches back to its own last
    sample. At tick 0 there is no interval yet, so gyroscopes and accelerometers with ``sampling="interval"`` start at
    their second due tick, unless :meth:`sample` is told the state ``before``.

    Args:
        sensors: in the order of ``fresh``.
        rate: ticks a second, Hz: how often :meth:`sample` is called.
        gravity: m/s².
        field: magnetic field in the world (east, north, up), ``(3,)``, µT; None for that of :func:`magnetic_field`.

    Raises:
        ValueError: no sensors, equal names, an infinite full scale, or a sensor faster than the ticks.
    """

    def __init__(
        self,
        sensors: Sequence[Sensor],
        rate: float,
        *,
        gravity: float = STANDARD_GRAVITY,
        field: Sequence[float] | np.ndarray | None = None,
    ) -> None:
        if not 0.0 < rate < math.inf:
            raise ValueError(f"rate must be positive and finite (Hz), got {rate}")
        for sensor in sensors:
            if sensor.rate > rate * (1.0 + 1e-9):
                raise ValueError(
                    f"rate of {sensor.channel.name!r} must lie in (0, {rate:g}] Hz, the rate of the suite, got "
                    f"{sensor.rate:g} Hz"
                )
        self.sensors, self.rate, self.gravity = tuple(sensors), float(rate), float(gravity)
        self.field = vector("field", magnetic_field() if field is None else field, 3)
        self.channels = tuple(sensor.channel for sensor in sensors)
        limits = {sensor.channel.name: sensor.limit for sensor in sensors}
        self._layout = ObservationLayout(self.channels, limits)
        keys = [sensor.placement for sensor in sensors]
        places = {
            key: MotionSensing(*key, self.gravity, self.field, {s.kind for s in sensors if s.placement == key})
            for key in keys
            if key is not None
        }
        self._motion = list(places.values())
        self._places = [None if key is None else places[key] for key in keys]
        self._missing = {channel.name: np.full(channel.size, np.nan) for channel in self.channels}
        self._noise: list[NoiseProcess] = []
        self._tick = 0

    @property
    def observation_space(self) -> spaces.Dict:
        """Every channel as a float32 Box with finite bounds, and ``fresh``: MultiBinary, one flag a channel."""
        return self._layout.space

    def reset(self, rng: np.random.Generator) -> None:
        """Begin an episode: draw what is constant in it and forget the last one.

        Args:
            rng: every sensor draws from a child of its own, so adding sensors at the end changes nothing before them.
        """
        children = rng.spawn(len(self.sensors))
        self._noise = [sensor.errors(child) for sensor, child in zip(self.sensors, children, strict=True)]
        for place in self._motion:
            place.reset()
        self._layout.reset()
        self._tick = 0

    def sample(
        self,
        bodies: BodyState | Mapping[str, BodyState],
        readings: Mapping[str, np.ndarray] | None = None,
        before: BodyState | Mapping[str, BodyState] | None = None,
    ) -> dict[str, np.ndarray]:
        """Measure at the next tick.

        Args:
            bodies: state of each body now, by name, or of the only one.
            readings: channel name → ``(size,)`` ideal reading of each sensor of kind ``given`` (due or not).
            before: ``interval``: states at the beginning of the interval, used where a sensor has no earlier sample;
                ``instant``: states one physics step before, needed where accelerations are unknown.

        Returns:
            Channel name → ``(size,)``, NaN where not sampled or lost.

        Raises:
            ValueError: a body or reading is missing, or time does not advance.
            RuntimeError: :meth:`reset` was not called.
        """
        self._check_ready()
        tick, self._tick = self._tick, self._tick + 1
        ideal: dict[int, dict[str, np.ndarray]] = {}
        measurement = {}
        for sensor, place, noise in zip(self.sensors, self._places, self._noise, strict=True):
            name = sensor.channel.name
            measurement[name] = self._missing[name].copy()
            if sensor.rate < self.rate and not sensor.due(tick, self.rate):
                continue
            force = None
            if place is None:
                value = self._reading(name, readings, (sensor.channel.size,))
            else:
                if id(place) not in ideal:
                    earlier = None if before is None else pick(before, sensor.body)
                    ideal[id(place)] = place.step(pick(bodies, sensor.body), earlier)
                if sensor.kind not in ideal[id(place)]:
                    continue
                value, force = ideal[id(place)][sensor.kind], ideal[id(place)].get("accelerometer")
            measurement[name] = noise.step(value, force)
        return measurement

    def simulate(
        self,
        bodies: BodyState | Mapping[str, BodyState],
        readings: Mapping[str, np.ndarray] | None = None,
        before: BodyState | Mapping[str, BodyState] | None = None,
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Measure at the next T ticks at once: the same numbers as T calls of :meth:`sample`.

        Args:
            bodies: states ``(T, …)`` of each body, by name, or of the only one.
            readings: channel name → ``(T, size)`` ideal readings of the sensors of kind ``given``.
            before: as for :meth:`sample`; with a time axis ``(T, …)``.

        Returns:
            Measurements: channel name → ``(T, size)``, NaN where not sampled or lost. Truth: name → ``(T, size)``, the
            bias of the last sample at each tick (see :meth:`truth`).

        Raises:
            ValueError, RuntimeError: as :meth:`sample`.
        """
        self._check_ready()
        first = bodies if isinstance(bodies, BodyState) else next(iter(bodies.values()), None)
        some = next(iter((readings or {}).values())) if first is None else first.time
        ticks = self._tick + np.arange(len(np.atleast_1d(some)))
        self._tick += len(ticks)
        ideal: dict[int, tuple[np.ndarray, dict[str, tuple[int, np.ndarray]]]] = {}
        measurements, truth = {}, {}
        for sensor, place, noise in zip(self.sensors, self._places, self._noise, strict=True):
            name, size = sensor.channel.name, sensor.channel.size
            rows, force = np.flatnonzero(sensor.due(ticks, self.rate)), None
            if place is None:
                values = self._reading(name, readings, (len(ticks), size))[rows]
            else:
                if id(place) not in ideal:
                    earlier = None if before is None else pick(before, sensor.body).at(rows)
                    ideal[id(place)] = (rows, place.sequence(pick(bodies, sensor.body).at(rows), earlier))
                skipped, values = ideal[id(place)][1][sensor.kind]
                rows = rows[skipped:]
                force_skipped, force = ideal[id(place)][1].get("accelerometer", (0, None))
                force = None if force is None else force[max(0, skipped - force_skipped) :]
            start = noise.bias
            measured, biases = noise.sequence(values, force)
            measurements[name] = np.full((len(ticks), size), np.nan)
            measurements[name][rows] = measured
            latest = np.searchsorted(rows, np.arange(len(ticks)), side="right")
            truth[sensor.truth_name] = np.concatenate([start[None], biases])[latest]
        return measurements, truth

    def truth(self) -> dict[str, np.ndarray]:
        """True biases of the last samples: name → ``(size,)``, see :attr:`Sensor.truth_name`."""
        self._check_ready()
        return {sensor.truth_name: noise.bias.copy() for sensor, noise in zip(self.sensors, self._noise, strict=True)}

    def to_observation(self, measurement: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Observation of a measurement; see :meth:`ObservationLayout.observe`."""
        return self._layout.observe(measurement)

    def to_measurement(self, observation: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Measurement of an observation; see :meth:`ObservationLayout.to_measurement`."""
        return self._layout.to_measurement(observation)

    def save(self) -> SuiteState:
        """A copy of all memory."""
        self._check_ready()
        return SuiteState(
            self._tick,
            [noise.save() for noise in self._noise],
            [copy.deepcopy(place.memory) for place in self._motion],
            copy.deepcopy(self._layout.held),
        )

    def restore(self, state: SuiteState) -> None:
        """Go on from a saved state, exactly (in this suite or in another one of the same sensors)."""
        if len(state.noise) != len(self.sensors):
            raise ValueError(f"state must be of {len(self.sensors)} sensors, got {len(state.noise)}")
        if not self._noise:
            self.reset(np.random.default_rng(0))
        self._tick = state.tick
        for noise, saved in zip(self._noise, state.noise, strict=True):
            noise.restore(saved)
        for place, memory in zip(self._motion, state.motion, strict=True):
            place.memory = copy.deepcopy(memory)
        self._layout.held = copy.deepcopy(state.held)

    def describe(self) -> dict[str, Any]:
        """Everything about the suite, for JSON."""
        return {
            "rate": self.rate,
            "gravity": self.gravity,
            "field": list(self.field),
            "sensors": [sensor.describe() for sensor in self.sensors],
        }

    def _check_ready(self) -> None:
        if not self._noise:
            raise RuntimeError("call reset(rng) first: the errors of an episode are drawn there")

    def _reading(self, name: str, readings: Mapping[str, np.ndarray] | None, shape: tuple[int, ...]) -> np.ndarray:
        if readings is None or name not in readings:
            raise ValueError(f"readings must hold {name!r}, got {sorted(readings or {})}")
        value = np.asarray(readings[name], dtype=float)
        if value.shape != shape:
            raise ValueError(f"readings[{name!r}] must have shape {shape}, got {value.shape}")
        return value


def imu_suite(
    preset: str | SensorPreset = "ideal",
    rate: float = 100.0,
    lever_arm: Sequence[float] = (0.0, 0.0, 0.0),
    mounting: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
    magnetometer: bool | float = False,
    *,
    sampling: Sampling = "interval",
    grade: float = 1.0,
    tick_rate: float | None = None,
    place: str = "imu",
    body: str = "body",
    gravity: float = STANDARD_GRAVITY,
    field: Sequence[float] | np.ndarray | None = None,
) -> SensorSuite:
    """One inertial measurement unit: channels ``imu/gyr`` (rad/s), ``imu/acc`` (m/s²) and, if wanted, ``imu/mag`` (µT).

    Args:
        preset: name of a device (:func:`list_sensor_presets`) or a preset.
        rate: samples a second, Hz.
        lever_arm: ``(3,)`` m, from the body frame's origin to the sensor, body axes.
        mounting: ``(4,)`` unit quaternion w, x, y, z, sensor axes to body axes.
        magnetometer: False for none, True for one at ``rate``, or its own rate in Hz.
        sampling: ``interval`` or ``instant``.
        grade: all errors times this; 0 for an ideal sensor with the preset's full scale.
        tick_rate: how often the suite is sampled, Hz; None for ``rate``.
        place: first part of the channel names.
        body: name of the body.
        gravity: m/s².
        field: magnetic field ``(3,)`` in the world (east, north, up), µT; None for a default.

    Raises:
        ValueError: an argument out of its range; or a magnetometer is wanted and the preset has none.
    """
    device = sensor_preset(preset) if isinstance(preset, str) else preset
    where = Mounting(tuple(lever_arm), tuple(mounting))

    def sensor(suffix: str, kind: Kind, unit: str, noise: NoiseModel, its_rate: float) -> Sensor:
        channel = Channel(f"{place}/{suffix}", 3, unit)
        return Sensor(channel, kind, its_rate, noise.scaled(grade), body, where, sampling, device.name)

    sensors = [
        sensor("gyr", "gyroscope", "rad/s", device.gyroscope, rate),
        sensor("acc", "accelerometer", "m/s²", device.accelerometer, rate),
    ]
    if magnetometer is not False:
        if device.magnetometer is None:
            raise ValueError(f"magnetometer must be False: the preset {device.name!r} has none")
        its_rate = rate if magnetometer is True else float(magnetometer)
        sensors.append(sensor("mag", "magnetometer", "µT", device.magnetometer, its_rate))
    return SensorSuite(sensors, rate if tick_rate is None else tick_rate, gravity=gravity, field=field)
