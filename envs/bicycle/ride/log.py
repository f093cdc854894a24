"""A ride as arrays: the state after every physics step is kept, everything else is computed for many at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....filters.core import rotation
from ...physics.kinematics import BASE_SIZE, TURNING, carry_frames, orientations
from ...sensors.ideal import BodyState, Sampling
from ..rider.limbs import Limb, LimbPosture, reach_to
from ..rider.posture import KNEE_OUT, LIMBS, segments_of, two_turns
from .contact_forces import Contact, contact
from .ride import Ride
from .tape import RiderStep, Tape, rider_step


@dataclass(frozen=True)
class RideLog:
    """n consecutive samples of a ride; time axis first. World axes unless said otherwise."""

    time: np.ndarray
    """(n,) s of the physics"""
    frames: dict[str, BodyState]
    """link name → motion of its body frame; with accelerations over the last physics step"""
    contact: Contact
    """forces of the rider on the bicycle, over the interval that ends with the sample or in the last physics step"""
    limbs: dict[str, LimbPosture]
    """limb name → posture in its root's frame (trunk, or bicycle for the legs)"""
    trunk_joints: np.ndarray
    """(n, 3) rad of the trunk's joint about y, x, z"""
    pelvis: np.ndarray
    """(n, 3) rad of forward tip and of tip to the right, m off the saddle; (n, 5) of a rider who may stand: m ahead and
    to the left as well"""
    steer: np.ndarray
    """(n,) rad"""
    crank: np.ndarray
    """(n,) rad, not wrapped"""
    wheel: np.ndarray
    """(n,) rad, rear wheel, not wrapped"""
    rates: np.ndarray
    """(n, 3) rad/s of steer, crank and rear wheel"""
    wheel_rate: np.ndarray
    """(n,) rad/s of the rear wheel, as the contact forces over the interval or at the sample"""
    torques: np.ndarray
    """(n, joints) N·m of the rider's muscles"""
    fallen: np.ndarray
    """(n,) bool"""


def in_reach(target: np.ndarray, limb: Limb) -> np.ndarray:
    """The target ``(n, 3)``, or the farthest point towards it: a lumped rider may carry shoulder or hip too far."""
    return target * np.minimum(1.0, 0.9999 * limb.reach / rotation.norm(target))


def limb_root(frames: dict[str, BodyState], limb: str) -> np.ndarray:
    """Orientation ``(n, 4)`` of the frame in which a limb's posture is given."""
    return frames["trunk" if limb.startswith("arm") else "rear_frame"].orientation


class RideRecorder:
    """Advances a ride sample by sample.

    Args:
        ride: the ride.
        steps: physics steps per sample.
        sampling: of the contact forces. ``interval``: their mean in bicycle axes over all physics steps of a sample,
            turned into the world at its end, so that a force sensor on the bicycle reads the mean of what acts on it;
            ``instant``: those of the last physics step.
        tape: of the ride, if other recorders read it too; None rides on without one.
        begin: number of the first physics step on the tape that is recorded.
    """

    def __init__(
        self, ride: Ride, steps: int, sampling: Sampling = "interval", tape: Tape | None = None, begin: int = 0
    ) -> None:
        self.ride, self.steps, self.sampling = ride, steps, sampling
        self._tape, self._next = tape, begin
        rider, links = ride.rider, ride.bicycle.links
        self._names = ["rear_frame", "front_assembly", "crank", "pelvis", "trunk"]
        if rider.full:
            self._names += [part for limb in LIMBS for part in segments_of(limb)]
        self._rows = [links[name] + 1 for name in self._names]
        mounts = [ride.physics.inertial_frame(ride.bicycle.body.body, links[name]) for name in self._names]
        self._mounts = np.stack([centre for centre, _ in mounts]), np.stack([axes for _, axes in mounts])
        self._joints = [links["front_assembly"], links["crank"], links["rear_wheel"], *rider.joints, *rider.seat]
        self._joints += rider.slides
        self._pelvis = slice(3 + len(rider.joints), None)

    def record(self, samples: int) -> RideLog:
        """Ride on for some samples; stops early after the one in which the rider fell."""
        tape, ride, rider, body = self._tape, self.ride, self.ride.rider, self.ride.bicycle.body
        first = body.state if tape is None else tape.state(self._next)
        states = np.empty((samples * self.steps + 1, len(first)))
        states[0] = first
        forces: list[float] = []
        ends, count = list[RiderStep](), 0
        for _ in range(samples):
            for _ in range(self.steps):
                if tape is None:
                    ride.step()
                    forces += rider.raw_forces()
                    states[count + 1] = body.state
                else:
                    step = tape.step(self._next)
                    forces += step.forces
                    states[count + 1] = step.state
                    self._next += 1
                count += 1
            ends.append(rider_step(ride) if tape is None else step.rider)
            if ends[-1].fallen:
                break
        states = states[: count + 1]
        first, rates = BASE_SIZE + np.array(self._joints), (states.shape[1] - BASE_SIZE) // 2
        starts, sampled = states[: -1 : self.steps], states[self.steps :: self.steps]
        turned = sampled[:, first[2]] - starts[:, first[2]]
        pushes, last_only = np.array(forces).reshape(count, 4, 3), self.sampling == "instant"
        return self._compute(
            *contact(rider, states, pushes, self.steps, last_only, self._rows),
            np.stack([sampled[:, first], sampled[:, first + rates]], axis=-1),
            turned,
            *map(np.array, zip(*ends, strict=True)),
        )

    def _frames(self, motion: np.ndarray, time: np.ndarray) -> dict[str, BodyState]:
        """Motion of the body frames after the last steps, with their accelerations in it; ``motion``: of the links."""
        centres, axes = self._mounts
        q = rotation.multiply(orientations(motion[:, 1]), rotation.conjugate(axes))
        found = np.empty((4, len(centres), len(time), 3))
        carry_frames(motion, rotation.rotate_back(axes, -centres), self.ride.physics.time_step, found)
        frames = {}
        for k, name in enumerate(self._names):
            position, velocity, acceleration, spin = found[:, k]
            frames[name] = BodyState(
                time, position, np.ascontiguousarray(q[:, k]), velocity, motion[:, 1, k, TURNING], acceleration, spin
            )
        return frames

    def _compute(
        self,
        found: Contact,
        motion: np.ndarray,
        joints: np.ndarray,
        turned: np.ndarray,
        torques: np.ndarray,
        swivels: np.ndarray,
        time: np.ndarray,
        fallen: np.ndarray,
    ) -> RideLog:
        rider, frames = self.ride.rider, self._frames(motion, time)
        angles, rates = joints[..., 0], joints[..., 1]
        steer, crank, trunk = angles[:, 0], angles[:, 1], angles[:, 3:6]
        limbs, pelvis = {}, angles[:, self._pelvis]
        turn = rotation.conjugate(frames["rear_frame"].orientation)
        trunk_turn = rotation.multiply(turn, frames["trunk"].orientation)
        for index, name in enumerate(LIMBS):
            if rider.full:
                back = rotation.conjugate(limb_root(frames, name))
                upper_turn, lower_turn = (
                    rotation.multiply(back, frames[part].orientation) for part in segments_of(name)
                )
                hinge = rotation.rotate(upper_turn, np.array([0.0, 0.0, -rider.posture.limb(name).upper]))
                limbs[name] = LimbPosture(upper_turn, lower_turn, angles[:, 6 + 4 * index : 10 + 4 * index], hinge)
            else:
                limbs[name] = self._solve(name, steer, crank, trunk_turn, swivels[:, index], pelvis)
        wheel, rates = angles[:, 2], rates[:, :3]
        mean = turned / (self.steps * self.ride.physics.time_step)
        wheel_rate = rates[:, 2] if self.sampling == "instant" else mean
        return RideLog(
            time, frames, found, limbs, trunk, pelvis, steer, crank, wheel, rates, wheel_rate, torques, fallen
        )

    def _solve(
        self, name: str, steer: np.ndarray, crank: np.ndarray, trunk: np.ndarray, swivel: np.ndarray, pelvis: np.ndarray
    ) -> LimbPosture:
        """Posture of a limb by inverse kinematics; ``pelvis``: its displacement ``(n, …)``."""
        posture, side = self.ride.rider.posture, name[4:]
        if name.startswith("leg"):
            tip = two_turns(pelvis)
            target = rotation.rotate_back(tip, posture.leg_target(side, crank, pelvis))
            held = reach_to(posture.leg, in_reach(target, posture.leg), rotation.rotate_back(tip, KNEE_OUT), swivel)
            upper, lower = (rotation.multiply(tip, each) for each in (held.upper, held.lower))
            return LimbPosture(upper, lower, held.angles, rotation.rotate(tip, held.hinge))
        target = in_reach(posture.arm_target(side, steer, trunk, pelvis), posture.arm)
        return reach_to(posture.arm, target, posture.elbow_out(side, trunk), swivel)
