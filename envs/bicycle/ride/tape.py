"""Physics steps of one ride, kept so that several recorders of different rates read them: a ride is ridden once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .ride import Ride


class RiderStep(NamedTuple):
    """What the rider did in one physics step."""

    torques: list[float]
    """N·m of the rider's muscles in it"""
    swivel: list[float]
    """rad, wanted swivels of the limbs"""
    time: float
    """s of the physics after it"""
    fallen: bool


class PhysicsStep(NamedTuple):
    """What a recorder needs of one physics step."""

    state: np.ndarray
    """state of the bodies after it, see :attr:`poise.envs.physics.multibody.Multibody.state`"""
    forces: list[float]
    """of hands and feet in it, see :meth:`.Rider.raw_forces`"""
    rider: RiderStep


def rider_step(ride: Ride) -> RiderStep:
    """The rider in the physics step that the ride took last, in numbers that later ones do not change."""
    return RiderStep(ride.rider.torques, ride.rider.swivel, ride.physics.time, ride.fallen)


class Tape:
    """A ride from its start, ridden on when a step is wanted that is not there yet.

    Args:
        ride: at its start; nobody else may step it.
    """

    def __init__(self, ride: Ride) -> None:
        self.ride, self.start = ride, ride.bicycle.body.state.copy()
        self._steps: list[PhysicsStep] = []

    def step(self, number: int) -> PhysicsStep:
        """The physics step of this number; the first is 0."""
        while len(self._steps) <= number:
            ride = self.ride
            ride.step()
            self._steps.append(PhysicsStep(ride.bicycle.body.state.copy(), ride.rider.raw_forces(), rider_step(ride)))
        return self._steps[number]

    def state(self, number: int) -> np.ndarray:
        """State of the bodies before the physics step of this number."""
        return self.step(number - 1).state if number else self.start
