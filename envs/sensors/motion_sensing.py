"""Ideal readings at one place of a moving body, sample by sample or for a whole motion, with the memory in between."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from . import ideal as sensors
from .ideal import BodyState, Mounting, Sampling

Compute = Callable[..., list[list[float]]]
Memory = tuple[float, list[float], list[float]]
"""Time, orientation and velocity of the sensor at its last sample."""
ZERO = [0.0, 0.0, 0.0]


class StraightLines(NamedTuple):
    """The functions of :mod:`poise.envs.sensors.ideal` for one mounting, on lists of floats (one sample)."""

    place: Compute
    """orientation, velocity, angular velocity of the body → orientation and velocity of the sensor, its rate"""
    interval: Compute
    """time, orientation, velocity of the sensor before; the same after → angular rate, specific force"""
    instant: Compute
    """state of the body with its accelerations → specific force"""
    field: Compute
    """orientation of the sensor → magnetic field"""


@lru_cache(maxsize=256)
def straight_lines(mounting: Mounting, gravity: float, field: tuple[float, ...]) -> StraightLines:
    """Record the readings of a mounting once."""
    unknown = np.zeros(3)

    def place(q, v, w):  # type: ignore[no-untyped-def]
        sensor = sensors.mounted(BodyState(0.0, unknown, q, v, w), mounting)
        return sensor.orientation, sensor.velocity, sensors.rotation.rotate_back(sensor.orientation, w)

    def interval(t0, q0, v0, t1, q1, v1):  # type: ignore[no-untyped-def]
        before = BodyState(t0[0], unknown, q0, v0, unknown)
        return sensors.mean_readings(before, BodyState(t1[0], unknown, q1, v1, unknown), gravity)

    def instant(q, v, w, a, alpha):  # type: ignore[no-untyped-def]
        sensor = sensors.mounted(BodyState(0.0, unknown, q, v, w, a, alpha), mounting)
        return sensors.instant_readings(sensor, gravity=gravity)[1:]

    def magnetic(q):  # type: ignore[no-untyped-def]
        return (sensors.magnetometer_reading(BodyState(0.0, unknown, q, unknown, unknown), field),)

    record = sensors.straight_line
    return StraightLines(
        record(place, q=4, v=3, w=3),
        record(interval, t0=1, q0=4, v0=3, t1=1, q1=4, v1=3),
        record(instant, q=4, v=3, w=3, a=3, alpha=3),
        record(magnetic, q=4),
    )


class MotionSensing:
    """Gyroscope, accelerometer and magnetometer at one place, sampled together.

    Args:
        body: name of the body, for messages.
        mounting: place and axes on the body.
        sampling: ``interval`` or ``instant``.
        rate: samples a second, Hz.
        gravity: m/s².
        field: ``(3,)`` magnetic field in the world, any unit.
        kinds: which of ``gyroscope``, ``accelerometer`` and ``magnetometer`` are there.
    """

    def __init__(
        self,
        body: str,
        mounting: Mounting,
        sampling: Sampling,
        rate: float,
        gravity: float,
        field: tuple[float, ...],
        kinds: Collection[str],
    ) -> None:
        self.body, self.mounting, self.sampling, self.rate = body, mounting, sampling, rate
        self.gravity, self.field = gravity, field
        self.magnetic = "magnetometer" in kinds
        self.inertial = "gyroscope" in kinds or "accelerometer" in kinds
        self._lines = straight_lines(mounting, gravity, field)
        self.reset()

    def reset(self) -> None:
        """Forget the last sample."""
        self.memory: Memory | None = None

    def _place(self, state: BodyState) -> tuple[Memory, list[float]]:
        """Time, orientation and velocity of the sensor, and its angular rate."""
        arrays = (state.orientation, state.velocity, state.angular_velocity)
        orientation, velocity, rate = self._lines.place(*(array.tolist() for array in arrays))
        return (float(state.time), orientation, velocity), rate

    def step(self, state: BodyState, before: BodyState | None = None) -> dict[str, np.ndarray]:
        """Readings at the next sample, by kind ``(3,)``; without those that need an earlier state where none is known.

        Args:
            state: state of the body.
            before: see :meth:`poise.envs.sensors.suite.SensorSuite.sample`.

        Raises:
            ValueError: time does not advance, or accelerations and ``before`` are both unknown (``instant``).
        """
        now, rate = self._place(state)
        ideal: dict[str, list[float]] = {}
        if self.magnetic:
            ideal["magnetometer"] = self._lines.field(now[1])[0]
        if self.inertial:
            if self.sampling == "instant":
                ideal["gyroscope"] = rate
                ideal["accelerometer"] = self._force(state, now, before)
            else:
                if self.memory is None and before is not None:
                    self.memory = self._place(before)[0]
                if self.memory is not None:
                    ideal["gyroscope"], ideal["accelerometer"] = self._mean(self.memory, now)
        self.memory = now
        return {kind: np.array(values) for kind, values in ideal.items()}

    def _force(self, state: BodyState, now: Memory, before: BodyState | None) -> list[float]:
        alpha = state.angular_acceleration
        if state.acceleration is not None and (alpha is not None or not any(self.mounting.lever_arm)):
            arrays = (state.orientation, state.velocity, state.angular_velocity, state.acceleration)
            turning = ZERO if alpha is None else alpha.tolist()
            return self._lines.instant(*(array.tolist() for array in arrays), turning)[0]
        if before is None:
            raise ValueError(sensors.NO_ACCELERATION)
        return self._mean(self._place(before)[0], now)[1]

    def _mean(self, before: Memory, now: Memory) -> list[list[float]]:
        (t0, q0, v0), (t1, q1, v1) = before, now
        if not t1 > t0:
            raise ValueError(f"time of body {self.body!r} must advance: {t1:g} s does not lie after {t0:g} s")
        try:
            return self._lines.interval([t0], q0, v0, [t1], q1, v1)
        except ZeroDivisionError:
            # a turn by exactly 180°: arrays give the right branch in spite of the division
            old, new = (BodyState(t, np.zeros(3), np.array(q), np.array(v), np.zeros(3)) for t, q, v in (before, now))
            with np.errstate(divide="ignore", invalid="ignore"):
                return [part.tolist() for part in sensors.interval_readings(old, new, self.gravity)]

    def sequence(self, states: BodyState, before: BodyState | None = None) -> dict[str, tuple[int, np.ndarray]]:
        """Readings at the next T samples, by kind.

        Args:
            states: states ``(T, …)`` of the body.
            before: see :meth:`poise.envs.sensors.suite.SensorSuite.simulate`.

        Returns:
            Kind → how many samples are skipped at the beginning (1 where an earlier state is needed and none is known)
            and the readings ``(T - skipped, 3)``.

        Raises:
            ValueError: as :meth:`step`.
        """
        none = (0, np.zeros((0, 3)))
        if len(np.atleast_1d(states.time)) == 0:
            return dict.fromkeys(("gyroscope", "accelerometer", "magnetometer"), none)
        placed = sensors.mounted(states, self.mounting)
        ideal = {"magnetometer": (0, sensors.magnetometer_reading(placed, self.field))} if self.magnetic else {}
        if not self.inertial:
            return ideal
        if self.sampling == "instant":
            earlier = None if before is None else sensors.mounted(before, self.mounting)
            rate, force = sensors.instant_readings(placed, earlier, self.gravity)
            ideal |= {"gyroscope": (0, rate), "accelerometer": (0, force)}
        else:
            if self.memory is None and before is not None:
                self.memory = self._place(before.at(0))[0]
            if self.memory is not None:
                placed = joined(self.memory, placed)
            skipped = 1 if self.memory is None else 0
            rate, force = sensors.interval_readings(placed.at(slice(None, -1)), placed.at(slice(1, None)), self.gravity)
            ideal |= {"gyroscope": (skipped, rate), "accelerometer": (skipped, force)}
        self.memory = self._place(states.at(-1))[0]
        return ideal


def joined(memory: Memory, states: BodyState) -> BodyState:
    """Put one remembered state before a motion; what is not remembered (position, accelerations) is dropped."""
    time, orientation, velocity = memory
    unknown = np.zeros((len(states.velocity) + 1, 3))
    return BodyState(
        np.concatenate([[time], states.time]),
        unknown,
        np.concatenate([[orientation], states.orientation]),
        np.concatenate([[velocity], states.velocity]),
        unknown,
    )
