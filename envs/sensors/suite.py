"""Named sensors on moving bodies, each with its own rate: :class:`SensorSuite`, and :func:`imu_suite` for one IMU."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ...filters.core.quantity import STANDARD_GRAVITY, Channel
from ...filters.support.seeds import named_generator
from .ideal import BodyState, Mounting, Sampling, magnetic_field, mounted, vector
from .kinds import SiteMotion, sensor_kind
from .late import Past
from .magnetics import BICYCLE, MagneticField, Magnetics, magnetics_of
from .noise import NoiseProcess, NoiseState
from .observation import Sensing
from .presets import SensorPreset, sensor_preset
from .sensor import FIXED, Placement, Sensor, due
from .timing import Clock, ClockKey, ClockState, Timings, check_sites, make_clocks, timing_of

Bodies = BodyState | Mapping[str, BodyState]
"""States of bodies by name, or of the only one."""


@dataclass
class SuiteState:
    """All memory of a :class:`SensorSuite`."""

    step: int
    noise: list[NoiseState]
    last: dict[Placement, BodyState]
    held: dict[str, np.ndarray]
    clocks: dict[ClockKey, ClockState]
    past: Past
    magnetic_field: MagneticField | None


class Sensed(NamedTuple):
    """Measurements of T time steps, with biases and motions of the sensors.

    Attributes:
        measurements: channel → ``(T, size)``, NaN where not sampled or lost.
        truth: name → ``(T, size)``: the true bias of the last sample at each time step, see :attr:`.Sensor.truth_name`.
        motions: placement → its motion at its own samples.
    """

    measurements: dict[str, np.ndarray]
    truth: dict[str, np.ndarray]
    motions: dict[Placement, SiteMotion]


class SensorSuite(Sensing):
    """Sensors that are sampled together.

    The sample of a time step describes the interval that ends there. A sensor slower than the suite is sampled at the
    first time step at or after each multiple of its own interval, beginning with step 0; its interval reaches back to
    its own last sample. Where a device is late (:class:`.Timing`), the sample describes an earlier interval, while
    biases and truth still belong to the time step. At step 0 there is no interval yet, so gyroscopes and accelerometers
    with ``sampling="interval"`` start at their second sample, unless :meth:`simulate` is given the states ``before``.

    Args:
        sensors: in the order of ``new_sample``.
        rate: time steps per second, Hz.
        gravity: m/s².
        field: magnetic field in the world (east, north, up), ``(3,)``, µT; None for that of :func:`.magnetic_field`.
        magnetics: disturbances of that field, or their name (:data:`.MAGNETICS`); None for none.

    Raises:
        ValueError: no sensors, equal names, an infinite full scale, a sensor faster than the suite, or an unknown name.
    """

    def __init__(
        self,
        sensors: Sequence[Sensor],
        rate: float,
        *,
        gravity: float = STANDARD_GRAVITY,
        field: Sequence[float] | np.ndarray | None = None,
        magnetics: str | Magnetics | None = None,
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
        self.magnetics = magnetics_of(magnetics)
        limits = {sensor.channel.name: sensor.limit for sensor in sensors}
        super().__init__([sensor.channel for sensor in sensors], limits)
        self._noise: list[NoiseProcess] = []
        self._last: dict[Placement, BodyState] = {}
        self._clocks: dict[ClockKey, Clock] = {}
        self._past = Past()
        self._magnetic_field: MagneticField | None = None
        self._step = 0

    def reset(self, rng: np.random.Generator) -> None:
        """Begin an episode: draw what is constant in it and forget the last one.

        Each sensor draws from a separate child, so sensors added at the end do not change the others.
        """
        super().reset(rng)
        children = rng.spawn(len(self.sensors))
        self._noise = [sensor.errors(child) for sensor, child in zip(self.sensors, children, strict=True)]
        # descendants by name: errors do not depend on timing and field
        base = children[0]
        self._clocks = make_clocks((sensor.clock for sensor in self.sensors), self.rate, base)
        calm = self.magnetics.calm
        self._magnetic_field = (
            None if calm else MagneticField(self.magnetics, self.field, named_generator(base, "field"))
        )
        self._last.clear()
        self._past = Past()
        self._step = 0

    def simulate(
        self, bodies: Bodies, surroundings: Any = None, before: Bodies | None = None, reference: Placement | None = None
    ) -> Sensed:
        """Measure at the next T time steps.

        Args:
            bodies: states ``(T, …)`` of each body, by name, or of the only one.
            surroundings: what kinds of sensors that do not sense a motion need, see
                :attr:`poise.envs.sensors.kinds.SensorKind.reading`; for the kind ``given`` a mapping of channel names
                to ideal readings ``(T, size)``.
            before: states ``(T, …)`` at the beginning of each interval. ``interval``: used at the first sample of an
                episode only; ``instant``: states one physics step before, needed where accelerations are unknown.
            reference: a placement whose motion is wanted, whether or not it bears a sensor.

        Raises:
            ValueError: a body or reading is missing, or time does not advance.
            RuntimeError: :meth:`reset` was not called.
        """
        self._check_ready()
        first = bodies if isinstance(bodies, BodyState) else next(iter(bodies.values()), None)
        some = next(iter((surroundings or {}).values())) if first is None else first.time
        length = len(np.atleast_1d(some))
        steps = self._step + np.arange(length)
        self._step += length
        lags = {clock: process.advance(steps) for clock, process in self._clocks.items()}
        seen: dict[Placement, tuple[SiteMotion, np.ndarray]] = {}

        def motion_of(placement: Placement) -> tuple[SiteMotion | None, np.ndarray]:
            """Motion of a placement, None if it has no samples, and the rows of these."""
            if placement not in seen:
                body, _, _, rate, clock = placement
                rows = due(rate, steps, self.rate)
                states, earlier = pick(bodies, body), None if before is None else pick(before, body)
                if clock is None:
                    states, earlier = states.at(rows), None if earlier is None else earlier.at(rows)
                else:
                    lag, lost = lags[clock]
                    reach, rows = self._clocks[clock].reach, rows[~lost[rows]]
                    states, earlier, rows = self._past.states(placement, states, earlier, rows, lag, reach)
                if not len(rows):
                    return None, rows
                seen[placement] = self._motion(placement, states, earlier, surroundings), rows
            return seen[placement]

        if reference is not None:
            motion_of(reference)
        measurements, truth = {}, {}
        for sensor, noise in zip(self.sensors, self._noise, strict=True):
            name, size, kind, placement = sensor.channel.name, sensor.channel.size, sensor.sensing, sensor.placement
            force = None
            if placement is None:
                values = self._handed(name, surroundings) if kind.reading is None else kind.reading(surroundings)
                values = checked(name, values, (length, size))
                rows = due(sensor.rate, steps, self.rate)
                if sensor.clock is None:
                    values = values[rows]
                else:
                    lag, lost = lags[sensor.clock]
                    reach, rows, times = self._clocks[sensor.clock].reach, rows[~lost[rows]], steps / self.rate
                    values, rows = self._past.readings(name, times, values, rows, lag, reach, sensor.form)
            else:
                motion, rows = motion_of(placement)
                if motion is None:
                    values = np.zeros((0, size))
                else:
                    if self._magnetic_field is not None and kind.name not in ("gyroscope", "accelerometer"):
                        motion = self._disturbed(motion, sensor, motion_of)
                    values = checked(name, kind.reading(motion), (None, size))  # type: ignore[misc]
                    if sensor.noise.g_sensitivity:
                        force = motion.specific_force[-len(values) :] if len(values) else np.zeros((0, 3))
                        values = values[len(values) - len(force) :]
                    rows = rows[len(rows) - len(values) :]
            start = noise.bias
            measured, biases = noise.sequence(values, force)
            measurements[name] = np.full((length, size), np.nan)
            measurements[name][rows] = measured
            latest = np.searchsorted(rows, np.arange(length), side="right")
            truth[sensor.truth_name] = np.concatenate([start[None], biases])[latest]
        return Sensed(measurements, truth, {placement: motion for placement, (motion, _) in seen.items()})

    def _disturbed(
        self, motion: SiteMotion, sensor: Sensor, motion_of: Callable[[Placement], tuple[SiteMotion | None, np.ndarray]]
    ) -> SiteMotion:
        """The motion of a sensor, with the disturbed field of its place."""
        field, carrier = self._magnetic_field, None
        assert field is not None
        if self.magnetics.frame:
            bicycle, _ = motion_of((BICYCLE, FIXED, sensor.sampling, float(sensor.rate), sensor.clock))
            carrier = None if bicycle is None else bicycle.now
        return replace(motion, disturbed=lambda states: field.at(states, sensor.site, carrier))

    def _motion(
        self, placement: Placement, states: BodyState, earlier: BodyState | None, surroundings: Any
    ) -> SiteMotion:
        """Motion of a placement at its next samples; the last of them is kept for the interval that follows."""
        body, mounting, sampling, _, _ = placement
        now = mounted(states, mounting)
        if sampling == "instant":
            earlier = None if earlier is None else mounted(earlier, mounting)
            return SiteMotion(now, now, earlier, sampling, self.gravity, self.field, surroundings)
        last = self._last.get(placement)
        if last is None and earlier is not None:
            last = mounted(earlier.at(slice(0, 1)), mounting)
        path = BodyState(*now[:5])
        if last is not None:
            path = BodyState(*(np.concatenate([a, b]) for a, b in zip(last[:5], now[:5], strict=True)))
        stopped = np.flatnonzero(~(np.diff(path.time) > 0.0))
        if len(stopped):
            before, after = np.asarray(path.time)[stopped[0] : stopped[0] + 2]
            raise ValueError(f"time of body {body!r} must advance: {after:g} s does not lie after {before:g} s")
        self._last[placement] = path.at(slice(-1, None))
        return SiteMotion(now, path, None, sampling, self.gravity, self.field, surroundings)

    def save(self) -> SuiteState:
        """A copy of all memory."""
        self._check_ready()
        return SuiteState(
            self._step,
            [noise.save() for noise in self._noise],
            dict(self._last),
            super().save(),
            {key: clock.save() for key, clock in self._clocks.items()},
            copy.copy(self._past),
            copy.deepcopy(self._magnetic_field),
        )

    def restore(self, state: SuiteState) -> None:
        """Continue from a saved state, exactly (in this suite or in another one of the same sensors)."""
        if len(state.noise) != len(self.sensors):
            raise ValueError(f"state must be of {len(self.sensors)} sensors, got {len(state.noise)}")
        if not self._noise:
            self.reset(np.random.default_rng(0))
        self._step, self._last = state.step, dict(state.last)
        for noise, saved in zip(self._noise, state.noise, strict=True):
            noise.restore(saved)
        for key, clock in self._clocks.items():
            clock.restore(state.clocks[key])
        self._past, self._magnetic_field = copy.copy(state.past), copy.deepcopy(state.magnetic_field)
        super().restore(state.held)

    def describe(self) -> dict[str, Any]:
        """Everything about the suite, for JSON."""
        return {
            "rate": self.rate,
            "gravity": self.gravity,
            "field": list(self.field),
            "sensors": [sensor.describe() for sensor in self.sensors],
            **({} if self.magnetics.calm else {"magnetics": self.magnetics.describe()}),
        }

    def _check_ready(self) -> None:
        if not self._noise:
            raise RuntimeError("call reset(rng) first: the errors of an episode are drawn there")

    def _handed(self, name: str, surroundings: Any) -> np.ndarray:
        if not isinstance(surroundings, Mapping) or name not in surroundings:
            found = sorted(surroundings) if isinstance(surroundings, Mapping) else surroundings
            raise ValueError(f"surroundings must hold the reading {name!r}, got {found}")
        return surroundings[name]


def checked(name: str, values: Any, shape: tuple[int | None, int]) -> np.ndarray:
    """Readings ``(T, size)`` as floats; any T where the first entry of ``shape`` is None.

    Raises:
        ValueError: another shape.
    """
    array = np.asarray(values, dtype=float)
    if array.ndim != 2 or array.shape[1] != shape[1] or shape[0] not in (None, len(array)):
        raise ValueError(f"readings of {name!r} must have shape {shape}, got {array.shape}")
    return array


def pick(bodies: Bodies, name: str) -> BodyState:
    """The state of the body ``name``.

    Raises:
        ValueError: there is none.
    """
    if isinstance(bodies, BodyState):
        return bodies
    if name not in bodies:
        raise ValueError(f"bodies must hold {name!r}, got {sorted(bodies)}")
    return bodies[name]


def imu_suite(
    preset: str | SensorPreset = "ideal",
    rate: float = 100.0,
    lever_arm: Sequence[float] = (0.0, 0.0, 0.0),
    mounting: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
    magnetometer: bool | float = False,
    *,
    sampling: Sampling = "interval",
    noise_scale: float = 1.0,
    step_rate: float | None = None,
    site: str = "imu",
    body: str = "body",
    gravity: float = STANDARD_GRAVITY,
    field: Sequence[float] | np.ndarray | None = None,
    timing: Timings | None = None,
    magnetics: str | Magnetics | None = None,
) -> SensorSuite:
    """One inertial measurement unit: channels ``imu/gyr`` (rad/s), ``imu/acc`` (m/s²) and, if wanted, ``imu/mag`` (µT).

    Args:
        preset: name of a device (:func:`list_sensor_presets`) or a preset; its ``others`` get channels of their own.
        rate: samples per second, Hz.
        lever_arm: ``(3,)`` m, from the body frame's origin to the sensor, body axes.
        mounting: ``(4,)`` unit quaternion w, x, y, z, sensor axes to body axes.
        magnetometer: False for none, True for one at ``rate``, or its own rate in Hz.
        sampling: ``interval`` or ``instant``.
        noise_scale: factor on all errors; 0 for an ideal sensor with the preset's full scale.
        step_rate: time steps of the suite per second, Hz; None for ``rate``.
        site: first part of the channel names.
        body: name of the body.
        gravity: m/s².
        field: magnetic field ``(3,)`` in the world (east, north, up), µT; None for a default.
        timing: of the device, or its name (:data:`.TIMINGS`); None for that of the preset.
        magnetics: disturbances of the field, or their name (:data:`.MAGNETICS`); None for none.

    Raises:
        ValueError: an argument out of its range; or a magnetometer is wanted and the preset has none.
    """
    device = sensor_preset(preset) if isinstance(preset, str) else preset
    where = Mounting(tuple(lever_arm), tuple(mounting))
    rates = {"gyroscope": rate, "accelerometer": rate}
    if magnetometer is not False:
        if device.magnetometer is None:
            raise ValueError(f"magnetometer must be False: the preset {device.name!r} has none")
        rates["magnetometer"] = rate if magnetometer is True else float(magnetometer)
    rates |= dict.fromkeys(device.others, rate)
    check_sites(timing, {site})
    late = (device.timing if timing is None else timing_of(timing, site)).scaled(noise_scale)
    sensors = []
    for name, its_rate in rates.items():
        kind, noise = sensor_kind(name), device.noise_of(name)
        assert noise is not None
        channel = Channel(f"{site}/{kind.suffix}", kind.size or 1, kind.unit)
        errors = noise.scaled(noise_scale)
        sensors.append(Sensor(channel, name, its_rate, errors, body, where, sampling, device.name, timing=late))
    steps, field_errors = rate if step_rate is None else step_rate, magnetics_of(magnetics).scaled(noise_scale)
    return SensorSuite(sensors, steps, gravity=gravity, field=field, magnetics=field_errors)
