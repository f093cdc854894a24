"""A rider who sits, holds, pedals, steers and sways: joint torques on the links of :mod:`.rider.links`.

``full``: hands and feet are held to handlebar and pedals by point-to-point constraints. The arms steer and the legs
pedal by joint torques that produce the desired forces at the tips (virtual work). The remaining constraint forces
follow from the motion. ``lumped``: legs and arms are rigid parts of pelvis and trunk; the same forces of the hands act
on the handlebar and, oppositely, on the trunk, and those of the feet on the pedals and on the pelvis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ....filters.core import rotation
from ...physics.multibody import connect_points, constraint_force
from ...physics.straight_line import straight_line
from ...physics.urdf import Tree
from ...physics.world import BASE
from ...sensors.ideal import STANDARD_GRAVITY
from ..frame.bicycle import Bicycle, BicycleState
from .effort import (
    AROUND,
    LARGEST_PEDAL_FORCE,
    MEAN_STROKE,
    Force,
    add_weights,
    hands_against,
    held_down,
    moments_of_feet,
    pedal_push,
    reach_of,
    trunk_support,
)
from .limb_tables import SHOULDERS_FOLLOW, LimbTables
from .limbs import tip_torques
from .links import (
    LUMPED_MASSES,
    SEAT_JOINTS,
    TRUNK_JOINTS,
    add_full_rider,
    add_lumped_rider,
    limb_joints,
    segment_links,
)
from .posture import LIMBS, SIDES, SIGNS, Posture
from .rigid_limbs import RigidLimbs
from .saddle import AHEAD, ARMS_ON_HANDS, balanced_hand_load, press, resting_load, seat_contact
from .style import RiderMotion

Fidelity = Literal["full", "lumped"]
TRUNK_STIFFNESS, TRUNK_DAMPING = 900.0, 90.0
"""N·m/rad and N·m·s/rad of the lumbar joint's muscles"""
LIMB_DAMPING = 0.3
"""N·m·s/rad of every joint of a limb"""
SWIVEL_STIFFNESS, SWIVEL_DAMPING = 60.0, 2.0
"""N·m/rad, N·m·s/rad: hold elbows and knees in their plane"""
HEAVIEST = 3.0
"""1: weight of a lumped rider's legs on the pedals over a bump at most, in parts of that at rest"""
KEEPING_UP = 4.0
"""N·m/(rad/s) on the crank, towards the wheel's pace"""
USUAL_HAND_LOAD = 60.0
"""N: with it a rider of 1.76 m and 68 kg is balanced on the saddle; other loads of a style are meant relative to it"""


@dataclass(frozen=True)
class RiderMemory:
    """State of a rider between physics steps."""

    torques: tuple[float, ...]
    trunk: tuple[float, ...]
    swivel: tuple[float, ...]
    wanted_swivel: tuple[float, ...]
    applied: tuple[float, ...]
    hands: tuple[Force, Force]
    feet: tuple[Force, Force]
    pushes: tuple[Force, Force]
    weights: tuple[Force, Force]
    support: tuple[float, float, float]


def _into_pelvis(angles, force):  # type: ignore[no-untyped-def]
    """Force in bicycle axes to pelvis axes; angles about y, x."""
    xp = rotation.namespace(angles)
    c, s, zero = xp.cos(0.5 * angles), xp.sin(0.5 * angles), 0.0 * angles[..., 0]
    turn = rotation.multiply(
        xp.stack([c[..., 0], zero, s[..., 0], zero], axis=-1), xp.stack([c[..., 1], s[..., 1], zero, zero], axis=-1)
    )
    return (rotation.rotate_back(turn, force),)


def _into_trunk(angles, force):  # type: ignore[no-untyped-def]
    """Force in pelvis axes to trunk axes; angles about y, x, z."""
    xp = rotation.namespace(angles)
    c, s, zero = xp.cos(0.5 * angles[..., 2]), xp.sin(0.5 * angles[..., 2]), 0.0 * angles[..., 0]
    (force,) = _into_pelvis(angles, force)
    return (rotation.rotate_back(xp.stack([c, zero, zero, s], axis=-1), force),)


class Rider:
    """A rider on one bicycle.

    Args:
        posture: the person fitted to the bicycle, see :func:`poise.envs.bicycle.rider.posture.sit`.
        fidelity: ``full`` or ``lumped``.
    """

    def __init__(self, posture: Posture, fidelity: Fidelity = "full") -> None:
        if fidelity not in ("full", "lumped"):
            raise ValueError(f"fidelity must be 'full' or 'lumped', got {fidelity!r}")
        self.posture, self.fidelity = posture, fidelity
        self.full = fidelity == "full"
        self._into_pelvis = straight_line(_into_pelvis, angles=2, force=3)
        self._into_trunk = straight_line(_into_trunk, angles=3, force=3)
        self._limb_torques = [tip_torques(posture.limb(name)) for name in LIMBS]
        axis, origin = posture.bicycle.steer_axis, posture.bicycle.steer_origin
        arm = np.array(posture.bicycle.grip) - origin
        self._grip_arm = float(np.linalg.norm(np.cross(axis, arm)))
        # direction in which each hand moves when the bar turns to the left, at straight steering
        pulls = [np.cross(axis, arm * (1.0, SIGNS[side], 1.0)) / self._grip_arm for side in SIDES]
        self._pulls = [(pull.tolist(), np.cross(axis, pull).tolist()) for pull in pulls]
        segments = posture.segments()
        upper, lower = (segments[part] for part in ("upper_arm", "forearm"))
        # what an elbow carries of an arm whose shoulder and hand are held
        share = -upper.mass * upper.centre[2] / posture.arm.upper + lower.mass * (
            1.0 - lower.centre[2] / posture.arm.tip[1]
        )
        self._elbow_weight = STANDARD_GRAVITY * float(share)
        self._axis = axis.tolist()
        self._load_scale = balanced_hand_load(posture) / USUAL_HAND_LOAD
        self.constraints: list[int] = []

    def extend(self, tree: Tree) -> None:
        """Add the rider's links to a bicycle's tree."""
        (add_full_rider if self.full else add_lumped_rider)(tree, self.posture)

    def mount(self, bicycle: Bicycle) -> None:
        """Look up the links after the bicycle with this rider has been loaded."""
        self.bicycle, body = bicycle, bicycle.body
        self.trunk_links = body.index(TRUNK_JOINTS)
        self.limb_links = [body.index(limb_joints(name)) for name in LIMBS] if self.full else []
        self.joints = [*self.trunk_links, *(link for links in self.limb_links for link in links)]
        self.seat = body.index(SEAT_JOINTS)
        self.driven = [*self.joints, *self.seat]
        names = segment_links() if self.full else LUMPED_MASSES
        self.mass_links = body.index(names)
        self.masses = np.array([body.masses[name] for name in names])
        self.moments = np.array([body.moments[name] for name in names])
        self._rigid = None if self.full else RigidLimbs(bicycle, self.posture)
        # abduction holds the swivel
        self._felt = [*self.seat, *self.trunk_links, *(links[1] for links in self.limb_links)]
        self._reach = reach_of(self.posture, bicycle.physics.gravity)
        for links in self.limb_links:
            for link in links:
                body.set_joint_damping(link, LIMB_DAMPING)

    def start(self, motion: RiderMotion, crank: float, crank_rate: float) -> None:
        """Take the posture at rest, hands and feet in place with consistent velocities.

        Args:
            motion: intended motion of the rider.
            crank: rad.
            crank_rate: rad/s.
        """
        self.motion, self._began = motion, self.bicycle.physics.time
        body, physics = self.bicycle.body, self.bicycle.physics
        self._hand_load = self._load_scale * motion.style.hand_load
        # the weight of rigid arms does not reach the hands by itself
        self._arm_weight = 0.0 if self.full else 0.5 * ARMS_ON_HANDS * self.posture.body.mass
        load = resting_load(self.posture, self._hand_load)
        self.saddle = seat_contact(load, AHEAD * self.posture.body.mass / load)
        trunk, _, _ = motion.at(0.0, 0.0, 0.0)
        self._trunk_target = [self.posture.flexion + float(trunk[0]), float(trunk[1]), float(trunk[2])]
        for link, angle in zip(self.trunk_links, self._trunk_target, strict=True):
            body.set_joint(link, angle)
        for constraint in self.constraints:
            body.release(constraint)
        self.constraints = []
        self._first_swivel = motion.at(0.0, 0.0, 0.0)[1]
        self._wanted_swivel = self._first_swivel.tolist()
        self._tables = LimbTables(self.posture, self._trunk_target, self._first_swivel, physics.gravity)
        self._swivel = self._tables.abductions(0.0, crank, self._trunk_target, [0.0] * 4)
        self._torques = [0.0] * len(self.joints)
        self._applied = list(self._torques)
        self._hands: tuple[Force, Force] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self._feet = self._pushes = self._weights = self._hands
        self._support = (0.0, 0.0, 0.0)
        if not self.full:
            return
        step = 1e-5
        angles, later = self._tables.angles(crank), self._tables.angles(crank + step * crank_rate)
        for links, now, then in zip(self.limb_links, angles, later, strict=True):
            for link, angle, rate in zip(links, now, (then - now) / step, strict=True):
                body.set_joint(link, float(angle), float(rate))
        for name, links in zip(LIMBS, self.limb_links, strict=True):
            side, limb = name.split("_")[1], self.posture.limb(name)
            if name.startswith("arm"):
                mate = self.bicycle.links["front_assembly"]
                point = self.posture.grip(side, 0.0) - self.posture.bicycle.steer_origin
            else:
                drive = self.posture.bicycle.drive
                assert drive is not None
                mate, point = self.bicycle.links["crank"], self.posture.pedal(side, 0.0) - np.array(drive.axle)
            tip = (limb.tip[0], 0.0, limb.tip[1])
            self.constraints.append(connect_points(physics, (body.body, links[3]), tip, (body.body, mate), point))

    @property
    def intended_lean(self) -> float:
        """Wanted lean of the trunk relative to the bicycle, rad, right positive."""
        return self._trunk_target[1]

    def plan(self, state: BicycleState, curvature: float, steer_torque: float, drive: float) -> None:
        """Compute muscle torques for the next control period.

        Args:
            state: of the bicycle.
            curvature: of the path a little ahead, 1/m, left positive.
            steer_torque: N·m on the handlebar, left positive.
            drive: desired propulsive force at the wheel, N, without braking.
        """
        change, swivel, unsteady = self.motion.at(state.time - self._began, curvature, state.roll)
        follow = SHOULDERS_FOLLOW * max(-0.8, min(0.8, state.steer))
        self._trunk_target = [self.posture.flexion + float(change[0]), float(change[1]), float(change[2]) + follow]
        steer_torque += unsteady
        ratio, bicycle = self.bicycle.ratio, self.posture.bicycle
        assert bicycle.drive is not None
        length = bicycle.drive.crank_length
        wanted = max(0.0, drive) * bicycle.rear_wheel.radius * ratio
        push = min(LARGEST_PEDAL_FORCE, wanted / (length * MEAN_STROKE))
        angles = self.bicycle.body.joint_tuples([*self.seat, *self.joints])
        (pitch, pitching), (roll, rolling), (rise, rising) = angles[:3]
        # muscles also carry the legs' weight around, half of it each
        weights = self._tables.leg_weights(state.crank)
        phases = (state.crank, state.crank + math.pi)
        turning = sum(-math.sin(a) * w[0] - math.cos(a) * w[2] for a, w in zip(phases, weights, strict=True))
        # and keep the crank at the speed of the wheel, so that the chain stays nearly taut
        pace = max(-15.0, min(15.0, KEEPING_UP * (state.wheel_rate / ratio - state.crank_rate)))
        around = push * AROUND + 0.5 * (pace / length - turning)
        draw = held_down(self.saddle, rise, rising)
        active = [pedal_push(push, around, phase, draw) for phase in phases]
        self._pushes, self._weights = (active[0], active[1]), weights
        self._feet = add_weights(active, weights, 1.0)
        rightwards, _ = moments_of_feet(self._reach, state.crank, *self._feet)
        # the legs' own weight is part of the balance at rest; drive, brakes and slopes act on the upper body
        _, forwards = moments_of_feet(self._reach, state.crank, *active)
        forwards -= self._reach.pushed_back * drive
        rightwards += self._reach.trunk_moment * math.sin(self._trunk_target[1])
        difference, common = hands_against(
            self._reach, self.saddle, rightwards, forwards, (pitch, pitching, roll, rolling)
        )
        self._grip_bar(state.steer, 0.5 * steer_torque / self._grip_arm, difference, common)
        self._wanted_swivel = swivel.tolist()
        if not self.full:
            return
        moved = (swivel - self._first_swivel).tolist()
        self._swivel = self._tables.abductions(state.steer, state.crank, self._trunk_target, moved)
        places = [pair[0] for pair in angles[3:]]
        pelvis, trunk = [pitch, roll], places[:3]
        torques = [0.0, 0.0, 0.0]
        up = self._into_trunk(trunk, [0.0, 0.0, self._elbow_weight])[0]
        for index, compute in enumerate(self._limb_torques):
            force = self._into_pelvis(pelvis, self._hands[index] if index < 2 else active[index - 2])[0]
            if index < 2:
                force = self._into_trunk(trunk, force)[0]
            torques += compute(places[3 + 4 * index : 7 + 4 * index], force, up if index < 2 else [0.0, 0.0, 0.0])[0]
        self._torques = torques

    def _grip_bar(self, steer: float, strength: float, difference: float, common: float) -> None:
        """Forces of the hands, and how the trunk bears them.

        Args:
            steer: rad.
            strength: N of each hand that steers.
            difference: N along the steering axis, with the left hand and against the right one.
            common: N upwards with each hand, besides its load downwards.
        """
        c, s = math.cos(steer), math.sin(steer)
        hands: list[Force] = []
        for (pull, turned), along in zip(self._pulls, (difference, -difference), strict=True):
            x, y, z = (strength * (c * a + s * b) + along * u for a, b, u in zip(pull, turned, self._axis, strict=True))
            hands.append((x, y, z + common - self._hand_load - self._arm_weight))
        self._hands = (hands[0], hands[1])
        flexion, lean, _ = self._trunk_target
        self._support = trunk_support(self._reach, *self._hands, flexion, lean)

    def act(self) -> list[float]:
        """Torques of the joints in :attr:`driven` for the next step, the saddle's moments and force last.

        To be called after :meth:`plan`.
        """
        felt = self.bicycle.body.joint_tuples(self._felt)
        (pitch, pitching), (roll, rolling), (rise, rising) = felt[:3]
        torques = list(self._torques) if self.full else [0.0, 0.0, 0.0]
        # the trunk keeps its posture in the bicycle, whatever the pelvis does below it
        c, s = math.cos(self._trunk_target[0]), math.sin(self._trunk_target[0])
        below = ((pitch, pitching), (c * roll, c * rolling), (s * roll, s * rolling))
        for index in range(3):
            angle, rate = felt[3 + index]
            angle, rate = angle + below[index][0], rate + below[index][1]
            torques[index] += TRUNK_STIFFNESS * (self._trunk_target[index] - angle) - TRUNK_DAMPING * rate
            torques[index] += self._support[index]
        for index, target in enumerate(self._swivel):
            if self.full:
                angle, rate = felt[6 + index]
                torques[4 + 4 * index] += SWIVEL_STIFFNESS * (target - angle) - SWIVEL_DAMPING * rate
        seat = press(self.saddle, pitch, pitching, roll, rolling, rise, rising)
        if self._rigid is not None:
            # saddle and pedals share the weight of rigid legs, also over a bump
            self._feet = add_weights(self._pushes, self._weights, min(HEAVIEST, seat[2] / self.saddle.load))
            self._rigid.push(self._hands, self._feet)
        self._applied = torques
        return [*torques, *seat]

    def grips(self) -> np.ndarray:
        """Positions ``(2, 3)`` of left and right hand now, world, m."""
        link = self.bicycle.links["front_assembly"]
        front = self.bicycle.physics.state(self.bicycle.body.body, link)
        arm = np.array(self.posture.bicycle.grip) - self.posture.bicycle.steer_origin
        arms = np.stack([arm * (1.0, SIGNS[side], 1.0) for side in SIDES])
        return front.position + rotation.rotate(front.orientation, arms)

    def pedals(self) -> np.ndarray:
        """Positions ``(2, 3)`` of left and right pedal now, world, m."""
        crank = self.bicycle.physics.state(self.bicycle.body.body, self.bicycle.links["crank"])
        drive = self.posture.bicycle.drive
        assert drive is not None
        arms = np.stack([self.posture.pedal(side, 0.0) - np.array(drive.axle) for side in SIDES])
        return crank.position + rotation.rotate(crank.orientation, arms)

    def hand_forces(self) -> tuple[np.ndarray, np.ndarray]:
        """Force ``(2, 3)`` of left and right hand on the handlebar (N) and where it acts (m), world axes.

        ``full``: what the constraints carried in the last step; ``lumped``: what acted in it.
        """
        if self.full:
            forces = np.array([constraint_force(self.bicycle.physics, number) for number in self.constraints[:2]])
            return forces, self.grips()
        frame = self.bicycle.physics.state(self.bicycle.body.body, BASE).orientation
        return rotation.rotate(frame, np.array(self._hands)), self.grips()

    def raw_forces(self) -> list[np.ndarray | tuple[float, float, float]]:
        """Forces of hands and feet in the last step: in world axes (full) or in bicycle axes (lumped)."""
        if not self.full:
            return [*self._hands, *self._feet]
        return [constraint_force(self.bicycle.physics, number) for number in self.constraints]

    @property
    def swivel(self) -> list[float]:
        """Wanted swivel of left arm, right arm, left leg and right leg, rad."""
        return self._wanted_swivel

    @property
    def torques(self) -> list[float]:
        """N·m on the rider's joints in the last step, in the order of :attr:`joints`."""
        return self._applied

    def foot_forces(self) -> tuple[np.ndarray, np.ndarray]:
        """Force ``(2, 3)`` of left and right foot on the pedals (N) and where it acts (m), as :meth:`hand_forces`."""
        if not self.full:
            frame = self.bicycle.physics.state(self.bicycle.body.body, BASE).orientation
            return rotation.rotate(frame, np.array(self._feet)), self.pedals()
        forces = np.array([constraint_force(self.bicycle.physics, number) for number in self.constraints[2:]])
        return forces, self.pedals()

    def gaps(self) -> np.ndarray:
        """Loop-closure errors ``(4,)`` at hands and feet, m; zeros if lumped."""
        if not self.full:
            return np.zeros(4)
        physics, body = self.bicycle.physics, self.bicycle.body.body
        tips = physics.states(body, [links[3] for links in self.limb_links])
        ends = np.array([(self.posture.limb(name).tip[0], 0.0, self.posture.limb(name).tip[1]) for name in LIMBS])
        places = tips.position + rotation.rotate(tips.orientation, ends)
        return np.linalg.norm(places - np.concatenate([self.grips(), self.pedals()]), axis=1)

    def save(self) -> RiderMemory:
        """Everything besides PyBullet's state."""
        return RiderMemory(
            tuple(self._torques),
            tuple(self._trunk_target),
            tuple(self._swivel),
            tuple(self._wanted_swivel),
            tuple(self._applied),
            self._hands,
            self._feet,
            self._pushes,
            self._weights,
            self._support,
        )

    def restore(self, memory: RiderMemory) -> None:
        """Undo :meth:`save`."""
        self._torques, self._trunk_target = list(memory.torques), list(memory.trunk)
        self._swivel = list(memory.swivel)
        self._wanted_swivel, self._applied = list(memory.wanted_swivel), list(memory.applied)
        self._hands, self._feet, self._support = memory.hands, memory.feet, memory.support
        self._pushes, self._weights = memory.pushes, memory.weights
