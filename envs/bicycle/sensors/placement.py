"""Errors in placing inertial sensors: where each really sits and how it is turned, drawn once a ride."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ....filters.core import rotation
from ...sensors.ideal import Mounting

PLACED = ("bicycle_imu", "trunk_imu", "upper_arm_right", "upper_arm_left", "thigh_right", "thigh_left", "head_imu")
"""sites of inertial sensors in the order in which their errors are drawn"""


@dataclass(frozen=True)
class PlacementErrors:
    """Standard deviations of placement; the values are assumed.

    Sensors on people are strapped on by eye and palpation and turn with the shape of the segment; those on a frame are
    measured with a ruler.

    Raises:
        ValueError: a deviation that is negative or not finite.
    """

    worn_shift: float = 0.015
    """m along each axis of the segment"""
    worn_turn: float = math.radians(5.0)
    """rad about each axis of the segment"""
    fixed_shift: float = 0.005
    """m along each axis of the bicycle"""
    fixed_turn: float = math.radians(1.0)
    """rad about each axis of the bicycle"""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value < math.inf:
                raise ValueError(f"{name} must not be negative and be finite, got {value}")

    @property
    def none(self) -> bool:
        """Whether every sensor sits where it should."""
        return not any(vars(self).values())

    def draw(self, sites: Mapping[str, Mounting], rng: np.random.Generator) -> dict[str, Mounting]:
        """Where the sensors of :data:`PLACED` really are; the errors of one site do not depend on the others."""
        drawn = dict(zip(PLACED, rng.standard_normal((len(PLACED), 6)), strict=True))
        found = {}
        for name, site in sites.items():
            shift, turn = (
                (self.fixed_shift, self.fixed_turn) if name == "bicycle_imu" else (self.worn_shift, self.worn_turn)
            )
            lever = np.array(site.lever_arm) + shift * drawn[name][:3]
            axes = rotation.multiply(rotation.exp(turn * drawn[name][3:]), np.array(site.rotation))
            found[name] = Mounting(tuple(lever.tolist()), tuple(axes.tolist()))
        return found


def placement_errors(errors: float | PlacementErrors) -> PlacementErrors:
    """Placement errors as given, or the default ones times a factor.

    Raises:
        ValueError: a factor that is negative or not finite.
    """
    if isinstance(errors, PlacementErrors):
        return errors
    if not 0.0 <= errors < math.inf:
        raise ValueError(f"placement_errors must be PlacementErrors or a finite factor of at least 0, got {errors}")
    return PlacementErrors(**{name: errors * value for name, value in vars(PlacementErrors()).items()})
