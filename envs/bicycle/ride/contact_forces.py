"""Forces between rider and bicycle, from the rider's motion by Newton–Euler, without PyBullet's joint sensors.

The seat force follows from the rate of change of the rider's momentum, gravity, and the forces on hands and feet. Three
load cells under the saddle share its vertical force and horizontal moments by statics.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ....filters.core import rotation
from ...physics.multibody import CentreMotion, newton_euler
from ..frame.bicycle import Bicycle
from ..rider.rider import Rider

CELLS_LONG, CELLS_WIDE, CELLS_BEHIND = 0.20, 0.12, 0.043
"""m: Lx from rear to front cell, Ly between the rear ones, Lm from these to the post (force-inertial table I)"""


class Contact(NamedTuple):
    """Forces of the rider on the bicycle in the last physics step, world axes."""

    seat_force: np.ndarray
    """(3,) N"""
    seat_moment: np.ndarray
    """(3,) N·m about the saddle point"""
    hands: np.ndarray
    """(2, 3) N, left and right, on the handlebar"""
    feet: np.ndarray
    """(2, 3) N, left and right, on the pedals"""


@dataclass(frozen=True)
class LoadCells:
    """Three vertical load cells under a saddle; by default those of the force-inertial paper.

    Raises:
        ValueError: the cells lie on one line.
    """

    x: tuple[float, float, float] = (CELLS_LONG - CELLS_BEHIND, -CELLS_BEHIND, -CELLS_BEHIND)
    """m from the saddle point: front, rear left, rear right"""
    y: tuple[float, float, float] = (0.0, 0.5 * CELLS_WIDE, -0.5 * CELLS_WIDE)
    """m"""

    def __post_init__(self) -> None:
        if abs(np.linalg.det(self.matrix)) < 1e-6:
            raise ValueError(f"the three cells must not lie on one line, got x {self.x} and y {self.y}")

    @property
    def matrix(self) -> np.ndarray:
        """Forces of the cells → (vertical force, moment about x, moment about y) ``(3, 3)``."""
        return np.array([np.ones(3), self.y, -np.array(self.x)])

    def share(self, force: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """Upward forces ``(..., 3)`` of the cells on the saddle, N.

        Args:
            force: ``(..., 3)`` of the saddle's support on the rider, bicycle axes, N; only z counts.
            moment: ``(..., 3)`` about the saddle point, N·m; only x and y count.
        """
        wanted = np.stack([force[..., 2], moment[..., 0], moment[..., 1]], axis=-1)
        return wanted @ np.linalg.inv(self.matrix).T


def rider_motion(rider: Rider) -> CentreMotion:
    """Motion of the links that carry the rider's mass."""
    return rider.bicycle.body.centre_motion(rider.mass_links)


def saddle_point(bicycle: Bicycle) -> np.ndarray:
    """The saddle point ``(3,)`` now, world, m."""
    frame = bicycle.physics.state(bicycle.body.body)
    return frame.position + rotation.rotate(frame.orientation, np.array(bicycle.parameters.saddle))


def contact(
    rider: Rider,
    before: CentreMotion,
    after: CentreMotion,
    saddle: np.ndarray,
    hands: tuple[np.ndarray, np.ndarray],
    feet: tuple[np.ndarray, np.ndarray],
) -> Contact:
    """Forces in one physics step.

    Args:
        rider: masses and inertias.
        before: the rider's motion before the step.
        after: after it.
        saddle: ``(3,)`` saddle point before the step, world.
        hands: forces ``(2, 3)`` on the handlebar in the step and their points of action before it, world.
        feet: likewise on the pedals.
    """
    physics = rider.bicycle.physics
    force, moment = newton_euler(before, after, rider.masses, rider.moments, saddle, physics.time_step, physics.gravity)
    for forces, places in (hands, feet):
        # reactions of handlebar and pedals
        force = force + forces.sum(axis=0)
        moment = moment + rotation.cross(places - saddle, forces).sum(axis=0)
    return Contact(-force, -moment, hands[0], feet[0])
