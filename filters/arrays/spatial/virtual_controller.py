r"""The virtual controller: a position for display, not an estimate of position.

P. He, thesis, Université Laval, section 5.6. The double integral of the hand's acceleration diverges with
the smallest orientation error. With leaks,

    ḃ = v − K_b b,   v̇ = b̈ − K_v v                                       (5.66), (5.67)

a constant error c of b̈ leads to the offset c / (K_b K_v). Motion below the corner frequencies K / 2π is lost, and the
virtual controller returns to its initial position.
"""

from __future__ import annotations

from ...core.backend import Array, expand, namespace
from ...core.quantity import Quantity

VIRTUAL_POSITION = Quantity("virtual_position", "vector", 3, "m")
"""Displayed position of the virtual controller: a high-passed position, world axes."""


def advance(state: Array, acceleration: Array, dt: Array, *, velocity_damping: Array, position_damping: Array) -> Array:
    """Velocity and position of the virtual controller after one interval, ``(..., 6)``.

    Exact for an acceleration, and then for a velocity (mean of both ends), that is constant over the interval.

    Args:
        state: velocity (m/s) and position (m), world axes, ``(..., 6)``.
        acceleration: b̈ over the interval, world axes, ``(..., 3)``, m/s².
        dt: interval, s.
        velocity_damping: K_v, 1/s, positive.
        position_damping: K_b, 1/s, positive.
    """
    velocity, position = state[..., :3], state[..., 3:6]
    after = _leak(velocity, acceleration, velocity_damping, dt)
    position = _leak(position, 0.5 * (velocity + after), position_damping, dt)
    return namespace(state).concat([after, position], axis=-1)


def _leak(value: Array, drive: Array, damping: Array, dt: Array) -> Array:
    """Solution after ``dt`` of d value / dt = drive − damping value."""
    kept = namespace(value).exp(0.0 * value - expand(damping * dt, 1))
    return kept * value + (1.0 - kept) / expand(damping, 1) * drive
