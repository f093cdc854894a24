"""A rider who sits, holds, pedals, steers and sways: joint torques on the links of :mod:`.rider.links`.

``full``: hands and feet are held to handlebar and pedals by point-to-point constraints. The arms steer and the legs
pedal by joint torques that produce the desired forces at the tips (virtual work). The remaining constraint forces
follow from the motion. ``lumped``: legs and arms are rigid parts of pelvis and trunk; the same forces of the hands act
on the handlebar and, oppositely, on the trunk, and those of the feet on the pedals and on the pelvis.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from ....filters.core import rotation
from ...physics.kinematics import BASE_SIZE
from ...physics.multibody import connect_points, constraint_forces
from ...physics.urdf import Tree
from ...sensors.ideal import STANDARD_GRAVITY
from ..frame.bicycle import ROLL, ROLL_RATE, Bicycle, BicycleState
from ..frame.parameters import BicycleParameters
from .body_motion import STANDING, row_at
from .effort import reach_of
from .leg_loads import legs_at_crank
from .limb_tables import LimbTables, abductions
from .links import (
    LUMPED_MASSES,
    SEAT_JOINTS,
    SLIDES,
    TRUNK_JOINTS,
    add_full_rider,
    add_lumped_rider,
    limb_joints,
    segment_links,
)
from .muscles import (
    HANDS_AND_FEET,
    MUSCLES,
    RESTING,
    SWIVEL,
    SWUNG,
    TARGET,
    WANTED,
    Build,
    act,
    act_on_bicycle,
    plan,
    tense,
)
from .posture import LIMBS, Posture
from .rigid_limbs import holds
from .saddle import AHEAD, ARMS_ON_HANDS, balanced_hand_load, resting_load, seat_contact
from .standing import StandingForces, stance
from .style import RiderMotion

Fidelity = Literal["full", "lumped"]
LIMB_DAMPING = 0.3
"""N·m·s/rad of every joint of a limb"""
USUAL_HAND_LOAD = 60.0
"""N: with it a rider of 1.76 m and 68 kg is balanced on the saddle; other loads of a style are meant relative to it"""


RiderMemory = tuple[float, ...]
"""State of a rider between physics steps, see :mod:`.muscles`."""


class Rider:
    """A rider on one bicycle.

    Args:
        posture: the person fitted to the bicycle, see :func:`poise.envs.bicycle.rider.posture.sit`.
        fidelity: ``full`` or ``lumped``.
        stands: whether the rider may leave the saddle.

    Raises:
        ValueError: an unknown fidelity, or a bicycle on which this person cannot stand.
    """

    def __init__(self, posture: Posture, fidelity: Fidelity = "full", stands: bool = False) -> None:
        if fidelity not in ("full", "lumped"):
            raise ValueError(f"fidelity must be 'full' or 'lumped', got {fidelity!r}")
        self.posture, self.fidelity = posture, fidelity
        self.full = fidelity == "full"
        self._stance = stance(posture) if stands else None
        axis, arms = posture.bicycle.steer_axis, posture.grip_arms
        self._grip_arm = float(np.linalg.norm(np.cross(axis, arms[0])))
        # direction in which each hand moves when the bar turns to the left, at straight steering
        pulls = [np.cross(axis, arm) / self._grip_arm for arm in arms]
        self._pulls = np.array([(pull, np.cross(axis, pull)) for pull in pulls])
        segments = posture.segments()
        upper, lower = (segments[part] for part in ("upper_arm", "forearm"))
        # what an elbow carries of an arm whose shoulder and hand are held
        share = -upper.mass * upper.centre[2] / posture.arm.upper + lower.mass * (
            1.0 - lower.centre[2] / posture.arm.tip[1]
        )
        self._elbow_weight = STANDARD_GRAVITY * float(share)
        self._axis = axis
        self._load_scale = balanced_hand_load(posture) / USUAL_HAND_LOAD
        self.constraints: list[int] = []

    @property
    def ridden(self) -> BicycleParameters:
        """The bicycle; a lumped rider's crank has the inertia of the legs that turn with it."""
        bicycle = self.posture.bicycle
        if self.full or bicycle.drive is None:
            return bicycle
        x, y, z = bicycle.drive.inertia
        legs = legs_at_crank(self.posture)
        return replace(bicycle, drive=replace(bicycle.drive, inertia=(x + 0.5 * legs, y + legs, z + 0.5 * legs)))

    def extend(self, tree: Tree) -> None:
        """Add the rider's links to a bicycle's tree."""
        (add_full_rider if self.full else add_lumped_rider)(tree, self.posture, self._stance is not None)

    def mount(self, bicycle: Bicycle) -> None:
        """Look up the links after the bicycle with this rider has been loaded."""
        self.bicycle, body = bicycle, bicycle.body
        self.trunk_links = body.index(TRUNK_JOINTS)
        self.limb_links = [body.index(limb_joints(name)) for name in LIMBS] if self.full else []
        self.joints = [*self.trunk_links, *(link for links in self.limb_links for link in links)]
        self.seat = body.index(SEAT_JOINTS)
        self.slides = body.index(SLIDES) if self._stance is not None else []
        self.driven = [*self.joints, *self.seat, *self.slides]
        names = segment_links() if self.full else LUMPED_MASSES
        self.mass_links = body.index(names)
        self.masses = np.array([body.masses[name] for name in names])
        self.moments = np.array([body.moments[name] for name in names])
        self.holds = holds(bicycle, self.posture)
        """links, arms and axes of :func:`.push_between`: left and right hand and foot"""
        centre, _ = bicycle.physics.inertial_frame(body.body)
        self.saddle_arm = self.holds[2] @ (np.array(self.posture.bicycle.saddle) - centre)
        """(3,) m: saddle point from the base's centre in its principal axes"""
        self._links = np.array([*self.seat, *self.joints, *self.slides])
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

        Raises:
            ValueError: a motion with phases out of the saddle, of a rider who may not leave it.
        """
        if motion.stands and self._stance is None:
            raise ValueError(f"the style {motion.style.name!r} needs a rider who may stand")
        self.motion, self._began = motion, self.bicycle.physics.time
        body, physics = self.bicycle.body, self.bicycle.physics
        hand_load = self._load_scale * motion.style.hand_load
        # the weight of rigid arms does not reach the hands by itself
        arm_weight = 0.0 if self.full else 0.5 * ARMS_ON_HANDS * self.posture.body.mass
        load = resting_load(self.posture, hand_load)
        self.saddle = seat_contact(load, AHEAD * self.posture.body.mass / load)
        trunk, first_swivel, _ = motion.at(0.0, 0.0, 0.0)
        target = [self.posture.flexion + float(trunk[0]), float(trunk[1]), float(trunk[2])]
        for link, angle in zip(self.trunk_links, target, strict=True):
            body.set_joint(link, angle)
        for constraint in self.constraints:
            body.release(constraint)
        self.constraints = []
        tables = LimbTables(self.posture, target, first_swivel, physics.gravity)
        bike, limbs = self.posture.bicycle, (self.posture.arm, self.posture.leg)
        self._standing: StandingForces | None = None
        if self._stance is not None and motion.stands:
            swing = motion.style.swing
            self._standing = StandingForces(self.posture, self._stance, swing, physics.gravity, self.full)
        build = Build(
            self._reach,
            self.saddle,
            self.posture.flexion,
            bike.rear_wheel.radius,
            self._grip_arm,
            hand_load + arm_weight,
            self._elbow_weight,
            self._pulls,
            self._axis,
            np.array([(limb.upper, *limb.tip) for limb in limbs]),
            tables.table,
            tables.legs,
            tables.middle,
        )
        self._numbers, self._arrays, self._legs = build.numbers, build.arrays, tables.legs
        if self._standing is not None and self._stance is not None:
            x, y, z = self._reach.grip
            ahead, above = self._stance.ahead, self._stance.above
            reach = self._reach._replace(grip=(x - ahead, y, z), lumbar=self._reach.lumbar + above)
            self._moved = build._replace(reach=reach).numbers - self._numbers
            """what a standing rider adds to the numbers"""
        self._memory = np.zeros(MUSCLES + 2 * len(self.joints))
        self._memory[TARGET], self._memory[WANTED] = target, first_swivel
        abductions(tables.table, tables.middle, 0.0, crank, self._memory[TARGET], first_swivel, self._memory[SWIVEL])
        if not self.full:
            return
        step = 1e-5
        angles, later = tables.angles(crank), tables.angles(crank + step * crank_rate)
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
        """Wanted lean of the trunk relative to the bicycle, rad, right positive; without what a swing adds to it."""
        return float(self._memory[1] + self._memory[SWUNG][0])

    def unswung(self, seen: np.ndarray) -> np.ndarray:
        """The bicycle as it would be without the rider's own swing, which a pilot does not steer against.

        Args:
            seen: :attr:`.BicycleState.numbers` of the bicycle now.
        """
        if self._standing is None:
            return seen
        found = seen.copy()
        found[[ROLL, ROLL_RATE]] -= self._memory[SWUNG]
        return found

    def plan(self, seen: np.ndarray, curvature: float, steer_torque: float, drive: float, foot: float = 0.0) -> None:
        """Compute muscle torques for the next control period.

        Args:
            seen: :attr:`.BicycleState.numbers` of the bicycle now.
            curvature: of the path a little ahead, 1/m, left positive.
            steer_torque: N·m on the handlebar, left positive.
            drive: desired propulsive force at the wheel, N, without braking.
            foot: :attr:`.Foot.engaged`.
        """
        motion, bicycle = self.motion, self.bicycle
        since = motion.checked(bicycle.physics.time - self._began)
        plan(
            self._numbers, self._arrays, motion.table, motion.habits, since, curvature, seen, foot, steer_torque,
            drive, bicycle.chain, bicycle.body.state, self._links, self._memory,
        )  # fmt: skip
        if self._standing is not None:
            self._stand(self._standing, BicycleState(0.0, *seen.tolist()), since, drive)

    def _stand(self, standing: StandingForces, s: BicycleState, since: float, drive: float) -> None:
        """Go on from :meth:`plan` as a rider who gets up."""
        self._memory[SWUNG] = 0.0
        level = standing.level(float(row_at(self.motion.table, since)[STANDING]), s.speed)
        if level <= 0.0:
            return
        state, ratio = self.bicycle.body.state, self.bicycle.ratio
        places = BASE_SIZE + self._links[[0, 1, 2, -2, -1]]
        pelvis = np.stack([state[places], state[places + (len(state) - BASE_SIZE) // 2]])
        torque = max(0.0, drive) * self.posture.bicycle.rear_wheel.radius * ratio
        ridden = (s.steer, s.crank, s.crank_rate, s.wheel_rate, 0.0 if drive == RESTING else ratio)
        standing.hold(level, ridden, torque, self._legs, pelvis, self._memory)
        numbers = self._numbers + level * self._moved
        tense(numbers, self._arrays, s.steer, s.steer_rate, s.crank, state, self._links, self._memory)

    def act(self) -> None:
        """Add what muscles and saddle do in the next step to the forces on the bodies.

        To be called after :meth:`plan`.
        """
        body = self.bicycle.body
        act(self._numbers, body.tree, body.state, body.frames, self._links, self.holds, self._memory, body.forces)

    def act_on_bicycle(self, brake: float) -> None:
        """:meth:`act` and :meth:`.Bicycle.act` with brakes (N) in one call, where nothing else acts in this step."""
        body = self.bicycle.body
        state, frames, late = body.motion()
        act_on_bicycle(
            self._numbers, body.tree, state, frames, late, self._links, self.holds, self._memory, self.bicycle.acting,
            brake, body.forces,
        )  # fmt: skip
        body.apply()

    def grips(self) -> np.ndarray:
        """Positions ``(2, 3)`` of left and right hand now, world, m."""
        link = self.bicycle.links["front_assembly"]
        front = self.bicycle.physics.state(self.bicycle.body.body, link)
        return front.position + rotation.rotate(front.orientation, self.posture.grip_arms)

    def pedals(self) -> np.ndarray:
        """Positions ``(2, 3)`` of left and right pedal now, world, m."""
        crank = self.bicycle.physics.state(self.bicycle.body.body, self.bicycle.links["crank"])
        return crank.position + rotation.rotate(crank.orientation, self.posture.pedal_arms)

    def raw_forces(self) -> list[float]:
        """Forces ``(12,)`` of hands and feet in the last step, N: in world axes (full) or in bicycle axes (lumped)."""
        if not self.full:
            return self._memory[HANDS_AND_FEET].tolist()
        left_hand, right_hand, left_foot, right_foot = constraint_forces(self.bicycle.physics, self.constraints)
        return [*left_hand, *right_hand, *left_foot, *right_foot]

    @property
    def swivel(self) -> list[float]:
        """Wanted swivel of left arm, right arm, left leg and right leg, rad."""
        return self._memory[WANTED].tolist()

    @property
    def torques(self) -> list[float]:
        """N·m on the rider's joints in the last step, in the order of :attr:`joints`."""
        return self._memory[MUSCLES + len(self.joints) :].tolist()

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
        return tuple(self._memory.tolist())

    def restore(self, memory: RiderMemory) -> None:
        """Undo :meth:`save`."""
        self._memory[:] = memory
