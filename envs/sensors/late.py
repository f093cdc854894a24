"""What there was between time steps: motions and readings at any earlier time, for samples that come late."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...filters.core import rotation
from .ideal import BodyState
from .noise import Form

ROUNDING = 1e-9
"""s"""


def state_at(knots: BodyState, times: np.ndarray) -> BodyState:
    """Motion at times between those at which it is known.

    Rates are the quadratics that have the known values at both ends of a step and the known increment as their
    integral; positions and attitudes are their integrals, so that they meet the known ones exactly.

    Args:
        knots: states ``(n, …)`` at rising times, two at least.
        times: ``(m,)`` s, within those of the knots.

    Returns:
        States ``(m, …)``; with the accelerations where the knots know them.
    """
    known = np.asarray(knots.time)
    right = np.clip(np.searchsorted(known, times, side="left"), 1, len(known) - 1)
    a, b = knots.at(right - 1), knots.at(right)
    h = np.asarray(b.time - a.time)[:, None]
    s = (np.asarray(times) - a.time)[:, None] / h

    def rate(first: np.ndarray, last: np.ndarray, increment: np.ndarray) -> np.ndarray:
        excess = increment / h - 0.5 * (first + last)
        return first + (last - first) * s + 6.0 * s * (1.0 - s) * excess

    def integral(first: np.ndarray, last: np.ndarray, increment: np.ndarray) -> np.ndarray:
        excess = increment / h - 0.5 * (first + last)
        return h * (first * s + 0.5 * (last - first) * s**2 + s**2 * (3.0 - 2.0 * s) * excess)

    moved = b.position - a.position
    # angular rates in the axes of the first end, in which small rotations add
    first, last = (rotation.rotate_back(a.orientation, each.angular_velocity) for each in (a, b))
    step = rotation.multiply(rotation.conjugate(a.orientation), b.orientation)
    turned = rotation.log(rotation.positive(step))
    # bodies whose rates are not known have zeros: they turn evenly
    unknown = ~np.any((first != 0.0) | (last != 0.0), axis=-1, keepdims=True)
    first, last = (np.where(unknown, turned / h, each) for each in (first, last))
    turn = rotation.exp(integral(first, last, turned))
    acceleration = angular = None
    if knots.acceleration is not None and knots.angular_acceleration is not None:
        acceleration = rate(a.acceleration, b.acceleration, b.velocity - a.velocity)  # type: ignore[arg-type]
        angular = rate(
            a.angular_acceleration,  # type: ignore[arg-type]
            b.angular_acceleration,  # type: ignore[arg-type]
            b.angular_velocity - a.angular_velocity,
        )
    return BodyState(
        np.asarray(times, dtype=float),
        a.position + integral(a.velocity, b.velocity, moved),
        rotation.multiply(a.orientation, turn),
        rate(a.velocity, b.velocity, moved),
        rotation.rotate(a.orientation, rate(first, last, turned)),
        acceleration,
        angular,
    )


def readings_at(known: np.ndarray, values: np.ndarray, times: np.ndarray, form: Form = "additive") -> np.ndarray:
    """Ideal readings at times between those at which they are known, along straight lines.

    Args:
        known: ``(n,)`` s, rising.
        values: ``(n, size)`` readings then.
        times: ``(m,)`` s, within ``known``.
        form: of the readings: angles go the short way round, quaternions are normalised.

    Returns:
        ``(m, size)``.
    """
    right = np.clip(np.searchsorted(known, times, side="left"), 1, len(known) - 1)
    a, b = values[right - 1], values[right]
    s = ((times - known[right - 1]) / (known[right] - known[right - 1]))[:, None]
    if form == "angle":
        return rotation.wrap(a + s * rotation.wrap(b - a))
    if form == "rotation":
        b = np.where(np.sum(a * b, axis=-1, keepdims=True) < 0.0, -b, b)
        return rotation.positive(rotation.normalize(a + s * (b - a)))
    return a + s * (b - a)


class Past:
    """The last motions and readings, from which late samples are interpolated across blocks of time steps.

    A copy is a saved state: what is kept is replaced, never changed.
    """

    def __init__(self) -> None:
        self._kept: dict[Any, Any] = {}

    def __copy__(self) -> Past:
        """The same memory."""
        made = Past()
        made._kept = dict(self._kept)
        return made

    def states(
        self, key: Any, states: BodyState, earlier: BodyState | None, rows: np.ndarray, lag: np.ndarray, reach: int
    ) -> tuple[BodyState, BodyState | None, np.ndarray]:
        """Motion of a body when late samples are sensed.

        Args:
            key: of the memory.
            states: motion ``(T, …)`` at the next time steps.
            earlier: states ``(T, …)`` one physics step before each, where accelerations are unknown.
            rows: ``(m,)`` time steps with a sample.
            lag: ``(T,)`` s, of what a sample describes.
            reach: time steps to remember.

        Returns:
            States of the samples, those one physics step before them or None, and their rows: what was sensed before
            the first time step is not known, so these rows are left out.
        """
        known = BodyState(*(None if one is None else np.asarray(one) for one in states))  # type: ignore[arg-type]
        if key in self._kept:
            pairs = zip(self._kept[key], known, strict=True)
            known = BodyState(*(None if one is None else np.concatenate([past, one]) for past, one in pairs))  # type: ignore[arg-type]
        self._kept[key] = known.at(slice(-reach, None))
        clock = np.asarray(states.time)
        step = 0.0 if earlier is None else float(clock[0] - np.asarray(earlier.time)[0])
        times = clock[rows] - lag[rows]
        inside = times - step >= np.asarray(known.time)[0] - ROUNDING
        rows, times = rows[inside], times[inside]
        if len(np.asarray(known.time)) < 2 or not len(rows):
            return states.at(rows), None if earlier is None else earlier.at(rows), rows
        return state_at(known, times), None if earlier is None else state_at(known, times - step), rows

    def readings(
        self, key: Any, times: np.ndarray, values: np.ndarray, rows: np.ndarray, lag: np.ndarray, reach: int, form: Form
    ) -> tuple[np.ndarray, np.ndarray]:
        """Ideal readings when late samples are sensed, and their rows.

        Args:
            key: of the memory.
            times: ``(T,)`` s of the next time steps.
            values: ``(T, size)`` ideal readings then.
            rows: ``(m,)`` time steps with a sample.
            lag: ``(T,)`` s, of what a sample describes.
            reach: time steps to remember.
            form: see :func:`readings_at`.
        """
        known = times
        if key in self._kept:
            known, values = (np.concatenate(pair) for pair in zip(self._kept[key], (known, values), strict=True))
        self._kept[key] = known[-reach:], values[-reach:]
        rows = rows[times[rows] - lag[rows] >= known[0] - ROUNDING]
        if len(known) < 2:
            return values[rows], rows
        return readings_at(known, values, times[rows] - lag[rows], form), rows
