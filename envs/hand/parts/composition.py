"""A motion with parts laid over it: each displaces and turns the body a little, in its own axes or in the world's.

All derivatives of the composed motion follow from those of its parts, so truth stays exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from ....filters.core import rotation
from ...sensors.ideal import BodyState
from ..motion import Gesture, RandomFunction, euler_motion
from ..smooth import Jet, column, product, window


class Offset(NamedTuple):
    """Displacement of the body.

    Attributes:
        position: jet ``(T, 3)``, m.
        angles: jet ``(T, 3)`` of yaw, pitch and roll about the body's own axes, rad; None: no turn.
    """

    position: Jet
    angles: Jet | None = None


class Part(Protocol):
    """Something that displaces and turns a body as time goes."""

    @property
    def in_world(self) -> bool:
        """Whether the displacement is in world axes, else in body axes. Turns are always about body axes."""
        ...

    def sample(self, times: np.ndarray) -> Offset:
        """The offset at ``times`` ``(T,)``, s."""
        ...


def added(jets: Sequence[Jet]) -> Jet:
    """Sum of jets of one shape."""
    value, first, second = (sum(parts[1:], start=parts[0]) for parts in zip(*jets, strict=True))
    return value, first, second


def displaced(body: BodyState, position: Jet, angles: Jet | None = None) -> BodyState:
    """The state of a frame that moves relative to a body.

    With r, R, ω, α of the body and p of the frame in body axes: velocity v + R ṗ + ω × R p, acceleration
    a + R p̈ + 2 ω × R ṗ + α × R p + ω × (ω × R p), and for the turn ω + R ω', α + R α' + ω × R ω'.

    Args:
        body: with both accelerations.
        position: jet ``(T, 3)``, m, body axes.
        angles: jet ``(T, 3)`` of yaw, pitch and roll, rad; None: no turn.
    """
    assert body.acceleration is not None
    assert body.angular_acceleration is not None
    turning, turning_faster = body.angular_velocity, body.angular_acceleration
    lever, moving, moving_faster = (rotation.rotate(body.orientation, part) for part in position)
    swing = rotation.cross(turning, lever)
    state = body._replace(
        position=body.position + lever,
        velocity=body.velocity + moving + swing,
        acceleration=body.acceleration
        + moving_faster
        + rotation.cross(turning, 2.0 * moving + swing)
        + rotation.cross(turning_faster, lever),
    )
    if angles is None:
        return state
    turn, rate, rate_change = euler_motion(angles)
    rate, rate_change = rotation.rotate(body.orientation, rate), rotation.rotate(body.orientation, rate_change)
    return state._replace(
        orientation=rotation.multiply(body.orientation, turn),
        angular_velocity=turning + rate,
        angular_acceleration=turning_faster + rate_change + rotation.cross(turning, rate),
    )


@dataclass(frozen=True)
class ComposedGesture:
    """A gesture with parts laid over it.

    Attributes:
        base: the motion below.
        parts: offsets; those in the same axes add up.
    """

    base: Gesture
    parts: tuple[Part, ...]

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.base.duration

    def sample(self, times: np.ndarray) -> BodyState:
        """The motion at ``times`` ``(T,)``, s."""
        times = np.asarray(times, dtype=float)
        if (np.diff(times) < 0.0).any():
            ascending, ranks = np.unique(times, return_inverse=True)
            return self.sample(ascending).at(ranks)
        state = self.base.sample(times)
        offsets = [(part.in_world, part.sample(times)) for part in self.parts]
        world = [offset.position for in_world, offset in offsets if in_world]
        if world:
            shift, speed, change = added(world)
            assert state.acceleration is not None
            state = state._replace(
                position=state.position + shift,
                velocity=state.velocity + speed,
                acceleration=state.acceleration + change,
            )
        own = [offset.position for in_world, offset in offsets if not in_world]
        turns = [offset.angles for _, offset in offsets if offset.angles is not None]
        if own or turns:
            nothing = np.zeros((len(times), 3))
            position = added(own) if own else (nothing, nothing, nothing)
            state = displaced(state, position, added(turns) if turns else None)
        return state


Intervals = tuple[tuple[float, float], ...]
"""(start, end) of each, s, in the order of time, not overlapping."""


def gate(times: np.ndarray, intervals: Intervals, ramp: float) -> Jet:
    """One inside the intervals, zero outside, smooth; a jet ``(T, 1)``. Ramps lie inside, a third of it at most."""
    whole = np.zeros((3, len(times)))
    for start, end in intervals:
        near = np.flatnonzero((times > start) & (times < end))
        if len(near):
            part = window(times[near], start, end, min(ramp, (end - start) / 3.0))
            for order in range(3):
                whole[order, near] = part[order]
    return column((whole[0], whole[1], whole[2]))


@dataclass(frozen=True)
class Gated:
    """Random functions that act in some intervals only.

    Attributes:
        intervals: when they act.
        ramp: rise and fall, s.
        position: displacement ``(T, 3)`` once sampled, m.
        angles: yaw, pitch and roll likewise, rad; None: no turn.
        in_world: as for :class:`Part`.
    """

    intervals: Intervals
    ramp: float
    position: RandomFunction
    angles: RandomFunction | None = None
    in_world: bool = False

    def sample(self, times: np.ndarray) -> Offset:
        """The offset at ``times`` ``(T,)``, s."""
        opening = gate(times, self.intervals, self.ramp)
        angles = None if self.angles is None else product(opening, self.angles.sample(times))
        return Offset(product(opening, self.position.sample(times)), angles)
