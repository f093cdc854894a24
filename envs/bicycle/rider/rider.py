"""A rider who sits, holds, pedals, steers and sways: joint torques on the links of :mod:`.rider.links`.

``full``: hands and feet are held to handlebar and pedals by point-to-point constraints. The arms steer and the legs
pedal by joint torques that produce the desired forces at the tips (virtual work). The remaining constraint forces
follow from the motion. ``lumped``: legs and arms are rigid parts of pelvis and trunk; the hands' forces act on the
handlebar and, oppositely, on the trunk, and the pedalling torque acts between frame and crank.
"""

from __future__ import annotations

import math
from collections.abc import Callable
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
from .limb_tables import SHOULDERS_FOLLOW, LimbTables
from .limbs import tip_torques
from .links import LUMPED_MASSES, TRUNK_JOINTS, add_full_rider, add_lumped_rider, limb_joints, segment_links
from .posture import LIMBS, SIDES, SIGNS, Posture
from .saddle import Saddle, balanced_hand_load, resting_load
from .style import RiderMotion

Fidelity = Literal["full", "lumped"]
TRUNK_STIFFNESS, TRUNK_DAMPING = 900.0, 90.0
"""N·m/rad and N·m·s/rad of the lumbar joint's muscles"""
LIMB_DAMPING = 0.3
"""N·m·s/rad of every joint of a limb"""
SWIVEL_STIFFNESS, SWIVEL_DAMPING = 60.0, 2.0
"""N·m/rad, N·m·s/rad: hold elbows and knees in their plane"""
AROUND = 0.2
"""a foot pushes down with the cosine of the crank angle, where that is positive, and along its circle with this"""
MEAN_STROKE = 2.0 * (0.25 + AROUND)
"""mean of both feet's turning force over a turn"""
PUSHED_BACK, STRONGEST_PULL = 15.0, 150.0
"""N·m by which the pedals may tilt the rider backwards before the hands pull against it; N of each hand at most"""
KEEPING_UP = 4.0
"""N·m/(rad/s) on the crank, towards the wheel's pace"""
LEAN_SUPPORT, LEAST_PRESS, MOST_PRESS = 1.0, 0.2, 3.0
"""1: part of the leaning trunk's weight moment that the hands prop; parts of their load that the outer hand keeps, and
that the inner one takes at most"""
LARGEST_PEDAL_FORCE = 400.0
"""N downwards: more would lift the rider off the saddle"""
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
    crank_torque: float
    hands: tuple[tuple[float, float, float], ...]
    braced: float


def _into_trunk(angles, force):  # type: ignore[no-untyped-def]
    """Force in bicycle axes to trunk axes; angles about y, x, z."""
    xp = rotation.namespace(angles)
    c, s, zero = xp.cos(0.5 * angles), xp.sin(0.5 * angles), 0.0 * angles[..., 0]
    turn = rotation.multiply(
        xp.stack([c[..., 0], zero, s[..., 0], zero], axis=-1), xp.stack([c[..., 1], s[..., 1], zero, zero], axis=-1)
    )
    turn = rotation.multiply(turn, xp.stack([c[..., 2], zero, zero, s[..., 2]], axis=-1))
    return (rotation.rotate_back(turn, force),)


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
        self._into_trunk = straight_line(_into_trunk, angles=3, force=3)
        self._limb_torques = [tip_torques(posture.limb(name)) for name in LIMBS]
        axis, origin = posture.bicycle.steer_axis, posture.bicycle.steer_origin
        arm = np.array(posture.bicycle.grip) - origin
        self._grip_arm = float(np.linalg.norm(np.cross(axis, arm)))
        # direction in which each hand moves when the bar turns to the left, at straight steering
        pulls = [np.cross(axis, arm * (1.0, SIGNS[side], 1.0)) / self._grip_arm for side in SIDES]
        self._pulls = [(pull.tolist(), np.cross(axis, pull).tolist()) for pull in pulls]
        trunk = posture.trunk()
        segments = posture.segments()
        upper, lower = (segments[part] for part in ("upper_arm", "forearm"))
        # what an elbow carries of an arm whose shoulder and hand are held
        share = -upper.mass * upper.centre[2] / posture.arm.upper + lower.mass * (
            1.0 - lower.centre[2] / posture.arm.tip[1]
        )
        self._elbow_weight = STANDARD_GRAVITY * float(share)
        self._trunk_moment = trunk.mass * float(trunk.centre[2])
        self._axis = axis.tolist()
        # N along the steering axis, on one hand or off the other, that carry the trunk's moment lying on its side
        self._prop = LEAN_SUPPORT * STANDARD_GRAVITY * self._trunk_moment / (abs(float(arm[1])) * float(axis[2]))
        self._load_scale = balanced_hand_load(posture) / USUAL_HAND_LOAD
        # how far ahead of the lumbar joint the hands press down
        self._press_arm = float(posture.bicycle.grip[0] - posture.lumbar[0])
        assert posture.bicycle.drive is not None
        self._axle_arm = float(posture.bicycle.drive.axle[0] - posture.bicycle.saddle[0])
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
        self.seat = body.links["pelvis"]
        self.driven = [*self.joints, self.seat]
        names = segment_links() if self.full else LUMPED_MASSES
        self.mass_links = body.index(names)
        self.masses = np.array([body.masses[name] for name in names])
        self.moments = np.array([body.moments[name] for name in names])
        self._pressing = self._pressing_lines()
        # abduction holds the swivel
        self._felt = [*self.trunk_links, *(links[1] for links in self.limb_links), self.seat]
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
        self.saddle = Saddle(resting_load(self.posture, self._hand_load, self.full))
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
        self._crank_torque = 0.0
        self._hands = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
        self._braced = 0.0
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
        c, s = math.cos(state.steer), math.sin(state.steer)
        ratio, bicycle = self.bicycle.ratio, self.posture.bicycle
        assert bicycle.drive is not None
        length = bicycle.drive.crank_length
        wanted = max(0.0, drive) * bicycle.rear_wheel.radius * ratio
        push = min(LARGEST_PEDAL_FORCE, wanted / (length * MEAN_STROKE)) if self.full else 0.0
        phases = [state.crank, state.crank + math.pi]
        downwards = [push * max(0.0, math.cos(phase)) for phase in phases]
        # large pedal forces are balanced by pulling at the handlebar
        back = sum(down * (self._axle_arm + length * math.cos(a)) for down, a in zip(downwards, phases, strict=True))
        pulled = min(STRONGEST_PULL, max(0.0, back - PUSHED_BACK) / (len(SIDES) * self._press_arm))
        strength, load = 0.5 * steer_torque / self._grip_arm, self._hand_load
        # a leaning rider loads the inner hand and unloads the outer one, along the steering axis: no steering torque
        prop = self._prop * math.sin(self._trunk_target[1])
        eased = min(0.5 * abs(prop), (1.0 - LEAST_PRESS) * load)
        pressed = min(abs(prop) - eased, (MOST_PRESS - 1.0) * load)
        props = (pressed, -eased) if prop < 0.0 else (-eased, pressed)
        self._braced = self._press_arm * (len(SIDES) * (load - pulled) + (pressed - eased) * self._axis[2])
        hands = []
        for (pull, turned), on in zip(self._pulls, props, strict=True):
            x, y, z = (strength * (c * a + s * b) for a, b in zip(pull, turned, strict=True))
            ax, ay, az = (-on * a for a in self._axis)
            hands.append((x + ax, y + ay, z + az + pulled - load))
        self._hands = hands
        self._wanted_swivel = swivel.tolist()
        if not self.full:
            self._crank_torque = wanted * sum(max(0.0, math.cos(a)) ** 2 + AROUND for a in phases) / MEAN_STROKE
            return
        moved = (swivel - self._first_swivel).tolist()
        self._swivel = self._tables.abductions(state.steer, state.crank, self._trunk_target, moved)
        angles = [pair[0] for pair in self.bicycle.body.joint_tuples(self.joints)]
        trunk = angles[:3]
        torques = [0.0, 0.0, 0.0]
        # muscles also carry the legs' weight around, half of it each
        lift = self._tables.leg_weight(state.crank)
        # and keep the crank at the speed of the wheel, so that the chain stays nearly taut
        lift += max(-15.0, min(15.0, KEEPING_UP * (state.wheel_rate / ratio - state.crank_rate)))
        up = self._into_trunk(trunk, [0.0, 0.0, self._elbow_weight])[0]
        for index, compute in enumerate(self._limb_torques):
            if index < 2:
                force = self._into_trunk(trunk, list(hands[index]))[0]
            else:
                phase, around = phases[index - 2], push * AROUND + 0.5 * lift / length
                force = [-around * math.sin(phase), 0.0, -around * math.cos(phase) - downwards[index - 2]]
            held = up if index < 2 else [0.0, 0.0, 0.0]
            torques += compute(angles[3 + 4 * index : 7 + 4 * index], force, held)[0]
        self._torques = torques

    def act(self) -> tuple[list[float], float]:
        """Torques of the joints in :attr:`driven`, the saddle's force last, and of the crank, for the next step.

        To be called after :meth:`plan`.
        """
        felt = self.bicycle.body.joint_tuples(self._felt)
        torques = list(self._torques) if self.full else [0.0, 0.0, 0.0]
        gravity = self.bicycle.physics.gravity
        for index in range(3):
            angle, rate = felt[index]
            torques[index] += TRUNK_STIFFNESS * (self._trunk_target[index] - angle) - TRUNK_DAMPING * rate
        # feed-forward of the trunk's weight and of the hand forces
        torques[0] -= gravity * self._trunk_moment * math.sin(felt[0][0])
        torques[0] += self._braced
        for index, target in enumerate(self._swivel):
            if self.full:
                angle, rate = felt[3 + index]
                torques[4 + 4 * index] += SWIVEL_STIFFNESS * (target - angle) - SWIVEL_DAMPING * rate
        if not self.full:
            self._press()
        self._applied = torques
        return [*torques, self.saddle.force(*felt[-1])], self._crank_torque

    def _press(self) -> None:
        """Hands of the lumped rider: the same force on the handlebar and, oppositely, on the trunk."""
        body = self.bicycle.body
        front = self.bicycle.links["front_assembly"]
        position, orientation, _, _ = body.link_tuples([front])[0]
        frame = self.bicycle.physics.base_tuples(body.body)[1]
        points, forces = self._pressing(position, orientation, frame, *self._hands)
        for point, force in ((points[:3], forces[:3]), (points[3:], forces[3:])):
            body.push(front, force, point)
            body.push(self.trunk_links[2], [-part for part in force], point)

    def _pressing_lines(self) -> Callable[..., list[list[float]]]:
        """Function of the front assembly's and the frame's principal axes: hands' positions and forces in the world."""
        physics, body = self.bicycle.physics, self.bicycle.body.body
        centre, axes = physics.inertial_frame(body, self.bicycle.links["front_assembly"])
        _, frame_axes = physics.inertial_frame(body)
        arm = np.array(self.posture.bicycle.grip) - self.posture.bicycle.steer_origin
        arms = [rotation.rotate_back(axes, arm * (1.0, SIGNS[side], 1.0) - centre) for side in SIDES]

        def compute(position, front, frame, left, right):  # type: ignore[no-untyped-def]
            xp = rotation.namespace(position)
            frame = rotation.multiply(frame, rotation.conjugate(frame_axes))
            places = xp.concat([position + rotation.rotate(front, each) for each in arms], axis=-1)
            return places, xp.concat([rotation.rotate(frame, force) for force in (left, right)], axis=-1)

        return straight_line(compute, position=3, front=4, frame=4, left=3, right=3)

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

        ``full``: what the constraints carried in the last step; ``lumped``: what is going to act in the next one.
        """
        if self.full:
            forces = np.array([constraint_force(self.bicycle.physics, number) for number in self.constraints[:2]])
            return forces, self.grips()
        frame = self.bicycle.physics.state(self.bicycle.body.body, BASE).orientation
        return rotation.rotate(frame, np.array(self._hands)), self.grips()

    def raw_forces(self) -> list[np.ndarray | tuple[float, float, float]]:
        """Forces in the last step, unturned: hands and feet in world axes (full), hands in bicycle axes (lumped)."""
        if not self.full:
            return list(self._hands)
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
        """Force ``(2, 3)`` of left and right foot on the pedals in the last step and where; none if lumped."""
        if not self.full:
            return np.zeros((2, 3)), np.zeros((2, 3))
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
            self._crank_torque,
            tuple(self._hands),
            self._braced,
        )

    def restore(self, memory: RiderMemory) -> None:
        """Undo :meth:`save`."""
        self._torques, self._trunk_target = list(memory.torques), list(memory.trunk)
        self._swivel, self._crank_torque = list(memory.swivel), memory.crank_torque
        self._wanted_swivel, self._applied = list(memory.wanted_swivel), list(memory.applied)
        self._hands, self._braced = list(memory.hands), memory.braced
