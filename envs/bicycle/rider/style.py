"""Riding styles from mild to aggressive: sway, lean into turns, elbows and knees, unsteady hands."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

START = 2.0
"""s over which the movements set in"""
WAVES = 4
LARGEST_LEAN = 0.4
"""rad into a turn, to the bicycle"""


@dataclass(frozen=True)
class RiderStyle:
    """Parameters of a riding style; choices of this project within observed ranges.

    Raises:
        ValueError: a negative amplitude, or an implausible sway.
    """

    name: str
    lean: float
    """rad: standard deviation of sideways sway"""
    flexion: float
    """rad: of bending and straightening"""
    twist: float
    """rad: of turning the shoulders"""
    turn_lean: float
    """rad·m: lean into a turn, relative to the bicycle, times the path's curvature"""
    levelling: float
    """1: share of the bicycle's roll that the trunk compensates, so that the shoulders stay level"""
    swivel: float = math.radians(3.0)
    """rad: standard deviation of the swivel of elbows and knees and of its slow variation"""
    hand_load: float = 60.0
    """N that each hand leans on the handlebar, besides the arm's weight: about a fifth of the rider's weight in all.
    Of a rider of 1.76 m and 68 kg; others lean so that their weight rests on the same part of the saddle.

    The papers report no handlebar forces; with less, a trunk bent as far forward as theirs lifts the saddle's rear.
    """
    unsteadiness: float = 0.15
    """N·m: standard deviation of the hands' unsteady torque"""

    def __post_init__(self) -> None:
        for name in ("lean", "flexion", "twist", "swivel", "hand_load", "unsteadiness"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must not be negative, got {getattr(self, name)}")
        if max(self.lean, self.flexion, self.twist) > 0.2:
            raise ValueError("lean, flexion and twist must be at most 0.2 rad: a rider could not stay in the saddle")


STYLES = {
    style.name: style
    for style in (
        RiderStyle("still", 0.0, 0.0, 0.0, 0.0, 0.0, swivel=0.0, unsteadiness=0.0),
        RiderStyle("mild", 0.02, 0.015, 0.02, 0.25, 0.3),
        RiderStyle("normal", 0.035, 0.025, 0.035, 0.6, 0.5),
        RiderStyle("aggressive", 0.06, 0.04, 0.06, 0.8, 0.6, unsteadiness=0.25),
    )
}
"""The styles by name."""


def rider_style(style: str | RiderStyle) -> RiderStyle:
    """A style by name, or as given.

    Raises:
        ValueError: there is none of that name.
    """
    if isinstance(style, RiderStyle):
        return style
    if style not in STYLES:
        raise ValueError(f"style must be one of {list(STYLES)} or a RiderStyle, got {style!r}")
    return STYLES[style]


class RiderMotion:
    """Intended motion of one rider: smooth random functions of time.

    Args:
        style: habits.
        rng: draws frequencies and phases.
    """

    def __init__(self, style: RiderStyle, rng: np.random.Generator) -> None:
        self.style = style
        # rows: flexion, lean, twist, four swivels, hands
        low, high = np.array([0.08] * 3 + [0.03] * 4 + [0.4]), np.array([0.9] * 3 + [0.3] * 4 + [2.0])
        size = (len(low), WAVES)
        self._frequencies = 2.0 * math.pi * np.exp(rng.uniform(np.log(low)[:, None], np.log(high)[:, None], size))
        self._phases = rng.uniform(0.0, 2.0 * math.pi, size)
        deviations = np.array([style.flexion, style.lean, style.twist, *[style.swivel] * 4, style.unsteadiness])
        shares = rng.dirichlet(np.full(WAVES, 3.0), len(low))
        self._amplitudes = np.sqrt(2.0 * shares) * deviations[:, None]
        self._offsets = np.zeros(len(low))
        self._offsets[3:7] = style.swivel * rng.standard_normal(4)

    def at(self, time: float, curvature: float, roll: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Intentions at a time.

        Args:
            time: s since the start.
            curvature: of the path a little ahead, 1/m, left positive.
            roll: of the bicycle, rad, right positive.

        Returns:
            Change ``(3,)`` of the trunk's flexion, lean (right positive) and twist to the bicycle, rad; swivel
            ``(4,)`` of left arm, right arm, left leg, right leg, rad; unsteady steer torque, N·m.
        """
        waves = (self._amplitudes * np.sin(self._frequencies * time + self._phases)).sum(axis=1)
        onset = min(1.0, time / START)
        onset = onset * onset * (3.0 - 2.0 * onset)
        values = onset * waves + self._offsets
        trunk = values[:3]
        turn = max(-LARGEST_LEAN, min(LARGEST_LEAN, self.style.turn_lean * curvature))
        trunk[1] += onset * (-turn - self.style.levelling * roll)
        return trunk, values[3:7], float(values[7])
