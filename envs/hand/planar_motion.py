"""Motion in the vertical plane of east and up.

The body's x and y axes stay in the plane, its z axis points south; at angle φ = 0 its y axis points up, and φ counts
from east to up. World: x east, y north, z up; quaternions w, x, y, z, body to world.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ...filters.core import rotation
from ...filters.support.parameters import check_positive
from ..sensors.ideal import BodyState
from .smooth import Jet, smoothstep, smoothstep_integral

ORIGIN = (0.0, 0.0, 1.2)
"""Where a hand starts, m."""
OUT_OF_PLANE = np.array([0.0, -1.0, 0.0])
"""The axis of the angle φ in the world."""
UPRIGHT = np.array([math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0])
"""Attitude at φ = 0 in the vertical plane."""


def planar_state(times: np.ndarray, place: Jet, angle: Jet) -> BodyState:
    """The state of a body that moves in the vertical plane at times ``(T,)``, s.

    Its jets are the place east and up ``(T, 2)``, m, and the angle φ ``(T,)``, rad.
    """
    position, velocity, acceleration = (
        np.stack([part[:, 0], np.zeros(len(times)), part[:, 1]], axis=-1) for part in place
    )
    half = 0.5 * angle[0]
    zero = np.zeros(len(times))
    turned = np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1)
    return BodyState(
        times,
        position,
        rotation.multiply(UPRIGHT, turned),
        velocity,
        angle[1][:, None] * OUT_OF_PLANE,
        acceleration,
        angle[2][:, None] * OUT_OF_PLANE,
    )


def planar_angle(orientation: np.ndarray) -> np.ndarray:
    """φ ``(...)`` in [−π, π] of attitudes ``(..., 4)`` in the vertical plane."""
    along = rotation.rotate(orientation, np.array([1.0, 0.0, 0.0]))
    return np.arctan2(along[..., 2], along[..., 0])


@dataclass(frozen=True)
class Infinity:
    """The ∞ of section 3.2: x = a sin(ct), y = b sin(2ct), c = 2π/τ; the body's x axis follows the path.

    The unwrapped φ swings between 45° and −225°. Nothing is random, so the configuration is the motion.

    Attributes:
        duration: length, s.
        width: a, m.
        height: b, m.
        period: τ, s.
        rest: time at rest before, s.
        ramp: duration of the start, s; 0 for the abrupt start of the thesis.
    """

    duration: float = 100.0
    width: float = 0.5
    height: float = 0.25
    period: float = 2.0
    rest: float = 1.0
    ramp: float = 1.0
    planar: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_positive(self, "width", "height", "period")

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> Infinity:
        """The figure; nothing is drawn."""
        return self if duration is None else replace(self, duration=duration)

    def sample(self, times: np.ndarray) -> BodyState:
        """The motion at ``times`` ``(T,)``, s."""
        times = np.asarray(times, dtype=float)
        if self.ramp > 0.0:
            speed, rise, _ = smoothstep(times, self.rest, self.ramp)
            s = smoothstep_integral(times, self.rest, self.ramp)
        else:
            s, speed, rise = (
                np.maximum(times - self.rest, 0.0),
                (times >= self.rest).astype(float),
                np.zeros(len(times)),
            )
        a, b, c = self.width, self.height, 2.0 * math.pi / self.period
        d = 2.0 * c
        sc, cc, sd, cd = np.sin(c * s), np.cos(c * s), np.sin(d * s), np.cos(d * s)
        # derivatives by the path's own time s
        x, y = a * sc, b * sd
        x1, y1 = a * c * cc, b * d * cd
        x2, y2 = -c * c * x, -d * d * y
        x3, y3 = -c * c * x1, -d * d * y1
        square = x1 * x1 + y1 * y1
        bend = x1 * y2 - y1 * x2
        phi1 = bend / square
        phi2 = (x1 * y3 - y1 * x3) / square - 2.0 * phi1 * (x1 * x2 + y1 * y2) / square
        # the tangent swings about straight down by less than half a turn, so this branch never jumps
        phi = rotation.wrap(np.arctan2(y1, x1) + 0.5 * math.pi) - 0.5 * math.pi
        place = np.stack([ORIGIN[0] + x, ORIGIN[2] + y], axis=-1)
        first, second = np.stack([x1, y1], axis=-1), np.stack([x2, y2], axis=-1)
        along, curve = speed[:, None], rise[:, None]
        jet = (place, first * along, second * along**2 + first * curve)
        return planar_state(times, jet, (phi, phi1 * speed, phi2 * speed**2 + phi1 * rise))
