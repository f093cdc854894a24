"""Random motions of a hand with exact derivatives.

A *configuration* (frozen dataclass: :class:`Rest`, :class:`Trial`, :class:`Turn`, :class:`Mixed`) describes how the
motion is distributed; ``configuration.draw(generator, duration)`` draws one :class:`Gesture`, an analytic function of
time. ``slow``, ``fast`` and ``severe`` reproduce the levels of external acceleration of tests A, B and C of J. K. Lee,
E. J. Park, S. N. Robinovitch, "Estimation of Attitude and External Acceleration Using Inertial Sensor Measurement
During Various Dynamic Conditions", IEEE Trans. Instrum. Meas. 61(8), 2012, doi 10.1109/TIM.2012.2187245; the frequency
bands and angles are ours, the paper gives none. World: x east, y north, z up; quaternions w, x, y, z, body to world.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Protocol

import numpy as np

from ...filters.core import rotation
from ...filters.support.names import look_up
from .controller_gestures import Pointing, RateTable, Shaking, Walk
from .everyday import EVERYDAY
from .motion import Gesture, Segment, SegmentedGesture, TurnGesture, match_levels
from .planar_motion import Infinity

MOST_DRAWS = 200
"""Attempts to draw a trial with a small enough ratio of peak to mean; one in five succeeds for ``fast``."""


class GestureConfig(Protocol):
    """The distribution of a gesture."""

    @property
    def duration(self) -> float:
        """Length where none is asked for, s."""
        ...

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> Gesture:
        """Draw a gesture of ``duration`` seconds (None: the configuration's own)."""
        ...


def _start(generator: np.random.Generator, tilt: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Quaternion of the heading and first Z-Y-X angles; ``tilt`` None spreads the attitude over all rotations."""
    if tilt is None:
        return rotation.random(generator), np.zeros(3)
    yaw = generator.uniform(-np.pi, np.pi)
    return rotation.from_euler_zyx(yaw, 0.0 * yaw, 0.0 * yaw), np.array([0.0, *generator.normal(0.0, tilt, 2)])


@dataclass(frozen=True)
class Rest:
    """A device that lies still.

    Attributes:
        duration: length, s.
        tilt: standard deviation of roll and pitch, rad; None: any attitude is equally likely.
    """

    duration: float = 10.0
    tilt: float | None = None

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> SegmentedGesture:
        """Draw the attitude."""
        heading, angles = _start(generator, self.tilt)
        return SegmentedGesture(self.duration if duration is None else duration, heading, angles)


@dataclass(frozen=True)
class Trial:
    """Random motion in given intervals with given mean and peak of |a|; a longer duration repeats the trial, redrawn.

    Attributes:
        duration: length of one trial, s.
        intervals: (start, end, strength) of each interval of motion: s, s, relative amplitude.
        mean_acceleration: mean of |a| over the whole trial, rests included, m/s².
        peak_acceleration: largest |a| of the trial, m/s².
        position_band: frequencies of the position, Hz.
        angle_band: frequencies of the Z-Y-X angles, Hz.
        angle_rms: root mean square of each angle while moving, rad.
        tilt: standard deviation of roll and pitch at rest, rad (None: start in any attitude).
        ramp: rise and fall of the motion at both ends of an interval, s.
    """

    duration: float
    intervals: tuple[tuple[float, float, float], ...]
    mean_acceleration: float
    peak_acceleration: float
    position_band: tuple[float, float]
    angle_band: tuple[float, float]
    angle_rms: float
    tilt: float | None = np.deg2rad(15.0)
    ramp: float = 0.3

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> SegmentedGesture:
        """Draw random functions and scale them until mean and peak of |a| are those of the configuration."""
        duration = self.duration if duration is None else duration
        heading, first_angles = _start(generator, self.tilt)
        segments: list[Segment] = []
        angles = first_angles
        for cycle in range(max(1, int(np.ceil(duration / self.duration - 1e-9)))):
            trial, angles = self._draw_trial(generator, angles)
            segments += [segment.delayed(cycle * self.duration) for segment in trial]
        return SegmentedGesture(duration, heading, first_angles, tuple(segments))

    def _draw_trial(self, generator: np.random.Generator, angles: np.ndarray) -> tuple[list[Segment], np.ndarray]:
        """Segments of one trial that starts at ``angles``, and the angles at its end."""
        for _ in range(MOST_DRAWS):
            segments = []
            rest_angles = angles
            for start, end, strength in self.intervals:
                target = rest_angles + generator.normal(0.0, 0.5, 3) * [1.0, 0.0, 0.0]
                target[1:] = generator.normal(0.0, np.pi if self.tilt is None else self.tilt, 2)
                segments.append(
                    Segment.draw(
                        generator,
                        start=start,
                        end=end,
                        ramp=self.ramp,
                        position_band=self.position_band,
                        angle_band=self.angle_band,
                        position_rms=strength,
                        angle_rms=self.angle_rms * min(1.0, strength),
                        turn=target - rest_angles,
                    )
                )
                rest_angles = target
            matched = match_levels(segments, self.duration, self.mean_acceleration, self.peak_acceleration)
            if matched is not None:
                return matched, rest_angles
        ratio = self.peak_acceleration / self.mean_acceleration
        raise ValueError(f"motion in {self.intervals} is always more peaked than peak / mean = {ratio:.2f}")


@dataclass(frozen=True)
class Turn:
    """A turn about a vertical axis at constant rate after a start at rest.

    Attributes:
        duration: length, s.
        rate: angular rate once spun up, rad/s; None: 1 to 4 rad/s either way.
        radius: distance of the body from the axis, m; None: 0.2 to 0.8 m.
        rest: time at rest before, s.
        ramp: time of spinning up, s.
        tilt: standard deviation of roll and pitch of the body, rad (None: any attitude).
    """

    duration: float = 20.0
    rate: float | None = None
    radius: float | None = None
    rest: float = 1.0
    ramp: float = 1.0
    tilt: float | None = np.deg2rad(15.0)

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> TurnGesture:
        """Draw attitude, and rate and radius where they are not given."""
        heading, angles = _start(generator, self.tilt)
        attitude = rotation.multiply(heading, rotation.from_euler_zyx(*angles))
        rate = generator.uniform(1.0, 4.0) * generator.choice([-1.0, 1.0])
        radius, azimuth = generator.uniform(0.2, 0.8), generator.uniform(-np.pi, np.pi)
        return TurnGesture(
            duration=self.duration if duration is None else duration,
            attitude=attitude,
            rate=float(rate if self.rate is None else self.rate),
            radius=float(radius if self.radius is None else self.radius),
            azimuth=float(azimuth),
            rest=self.rest,
            ramp=self.ramp,
        )


SLOW = Trial(
    duration=30.0,
    intervals=((1.0, 29.5, 1.0),),
    mean_acceleration=0.40,
    peak_acceleration=1.83,
    position_band=(0.3, 1.2),
    angle_band=(0.1, 0.6),
    angle_rms=np.deg2rad(18.0),
    ramp=0.5,
)
"""Test A of Lee et al. 2012: mean and peak from its section IV."""

FAST = Trial(
    duration=10.0,
    intervals=((1.3, 3.7, 1.0), (5.3, 7.8, 1.0)),
    mean_acceleration=3.06,
    peak_acceleration=16.71,
    position_band=(0.8, 3.5),
    angle_band=(0.3, 1.2),
    angle_rms=np.deg2rad(28.0),
)
"""Test B: accelerated from 1.3 to 3.7 s and from 5.3 to 7.8 s."""

SEVERE = Trial(
    duration=30.0,
    intervals=((7.5, 15.5, 1.0), (16.9, 22.7, 1.0), (23.0, 25.4, 1.0), (26.2, 29.2, 0.3)),
    mean_acceleration=6.29,
    peak_acceleration=37.22,
    position_band=(0.8, 3.5),
    angle_band=(0.3, 2.0),
    angle_rms=np.deg2rad(40.0),
)
"""Test C: accelerated from 7.5 to 15.5, 16.9 to 22.7 and 23.0 to 25.4 s, weaker motion after it."""


@dataclass(frozen=True)
class Mixed:
    """Motion of changing kind and strength over all attitudes, of any length: what learned estimators train on.

    Segments of random length follow each other: rests, and motions whose bands are those of ``slow``, ``fast`` or
    ``severe`` and whose strength is spread around theirs; some only turn, some only translate. Each motion also carries
    the body to a new attitude, up to a half-turn away.

    Attributes:
        duration: length where none is asked for, s.
        rest: time at rest at the start, s.
        lengths: shortest and longest segment, s.
        rest_share: probability that a segment is a rest.
        spread: standard deviation of the logarithm of a segment's strength.
        single_share: probability that a motion only turns, and that it only translates.
    """

    duration: float = 60.0
    rest: float = 1.0
    lengths: tuple[float, float] = (1.5, 8.0)
    rest_share: float = 0.2
    spread: float = 0.5
    single_share: float = 0.12

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> SegmentedGesture:
        """Draw segments until the duration is filled."""
        duration = self.duration if duration is None else duration
        heading, angles, axes = rotation.random(generator), np.zeros(3), rotation.random(generator)
        kinds = (SLOW, FAST, SEVERE)
        segments = []
        start = self.rest
        while start < duration:
            end = start + generator.uniform(*self.lengths)
            kind = kinds[generator.integers(len(kinds))]
            strength, swing = np.exp(generator.normal(0.0, self.spread, 2))
            choice = generator.random()
            move, turn = choice >= self.single_share, not self.single_share <= choice < 2.0 * self.single_share
            moving_share = sum(stop - begin for begin, stop, _ in kind.intervals) / kind.duration
            segment = Segment.draw(
                generator,
                start=start,
                end=end,
                ramp=min(0.5, 0.25 * (end - start)),
                position_band=kind.position_band,
                angle_band=kind.angle_band,
                acceleration_rms=strength * move * kind.mean_acceleration / moving_share / np.sqrt(3.0),
                angle_rms=float(kind.angle_rms * min(swing, 1.3) * turn),
                turn=generator.uniform(-np.pi, np.pi, 3) * turn,
            )
            if generator.random() >= self.rest_share:
                segments.append(segment)
            start = end
        return SegmentedGesture(duration, heading, angles, tuple(segments), axes)


GESTURES: Mapping[str, GestureConfig] = MappingProxyType(
    {
        "rest": Rest(),
        "slow": SLOW,
        "fast": FAST,
        "severe": SEVERE,
        "turn": Turn(),
        "mixed": Mixed(),
        "walk": Walk(),
        "pointing": Pointing(),
        "shaking": Shaking(),
        "rate-table": RateTable(),
        "planar-walk": Walk(planar=True),
        "infinity": Infinity(),
        **EVERYDAY,
    }
)
"""Name → configuration; ``planar-walk`` and ``infinity`` stay in the vertical plane."""


def gesture_config(gesture: str | GestureConfig) -> GestureConfig:
    """Return the configuration of a name, or the configuration itself.

    Raises:
        ValueError: unknown name, or not a configuration.
    """
    if isinstance(gesture, str):
        return look_up("gesture", gesture, GESTURES)
    if not callable(getattr(gesture, "draw", None)):
        raise ValueError(
            f"a gesture must be one of {', '.join(GESTURES)} or a configuration with draw, got {gesture!r}"
        )
    return gesture


def make_gesture(
    gesture: str | GestureConfig, generator: np.random.Generator, duration: float | None = None
) -> Gesture:
    """Draw a gesture by name (:data:`GESTURES`) or configuration, ``duration`` s long; None: that of the configuration.

    Raises:
        ValueError: unknown name or a duration that is not positive.
    """
    if duration is not None and not duration > 0.0:
        raise ValueError(f"duration must be positive, got {duration}")
    return gesture_config(gesture).draw(generator, duration)


def gesture_name(gesture: str | GestureConfig) -> str:
    """The registered name of a gesture, or its configuration spelt out."""
    if isinstance(gesture, str):
        return gesture
    for name, config in GESTURES.items():
        if config == gesture:
            return name
    return repr(gesture) if fields(gesture) else type(gesture).__name__  # type: ignore[arg-type]
