"""A bicycle as one multibody in PyBullet: rear frame, front assembly, two wheels, crank; tyres and chain around it.

The base is the rear frame and its body frame is the bicycle frame: origin on the ground under the rear hub when
upright, x forward, y left, z up. A rider adds further links to the same tree.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ....filters.core import rotation
from ...physics.momentum import newton_euler
from ...physics.multibody import Multibody
from ...physics.urdf import Tree, box_shape, rod_shape
from ...physics.world import BASE, Physics
from ...sensors.ideal import BodyState
from ..course.terrain import FlatGround, Ground
from .drivetrain import Drivetrain
from .forces import bicycle_forces, bicycle_state
from .parameters import AIR_DENSITY, BicycleParameters, RigidPart
from .shapes import Outline, bicycle_shapes
from .tyre import Tyre, TyreForce, TyreParameters, tyre_force_of

WHEELS = ("rear_wheel", "front_wheel")
BICYCLE_LINKS = ("rear_frame", "rear_wheel", "front_assembly", "front_wheel", "crank")


class BicycleState(NamedTuple):
    """State of the bicycle as numbers; angles in rad, Z-Y-X, roll to the right and steering to the left positive."""

    time: float
    x: float
    """m: origin of the bicycle frame (near the rear contact), world"""
    y: float
    z: float
    roll: float
    pitch: float
    """nose down positive"""
    yaw: float
    """heading, counter-clockwise from east"""
    roll_rate: float
    pitch_rate: float
    yaw_rate: float
    speed: float
    """m/s of the frame's origin along the heading"""
    steer: float
    steer_rate: float
    crank: float
    """0 with the left pedal in front, growing when pedalling forward (0 without a crank)"""
    crank_rate: float
    wheel_rate: float
    """rad/s of the rear wheel"""

    @property
    def numbers(self) -> np.ndarray:
        """What follows the time ``(15,)``, as compiled functions take it."""
        return np.array(self[1:])


ROLL, ROLL_RATE, SPEED, WHEEL_RATE = (
    BicycleState._fields.index(name) - 1 for name in ("roll", "roll_rate", "speed", "wheel_rate")
)
"""places in :attr:`BicycleState.numbers`"""


@dataclass(frozen=True)
class BicycleMemory:
    """State of the bicycle in addition to PyBullet's state."""

    bristles: tuple[tuple[float, float], ...]
    drivetrain: tuple[float, float, float] | None
    contacts: tuple[tuple[float, ...], ...]
    """of the tyres in the last step, see :func:`.bicycle_forces`"""


def bicycle_tree(bicycle: BicycleParameters) -> Tree:
    """Links and joints of a bicycle; the joints are called steer = ``front_assembly``, and as the wheels and crank."""
    tree, shapes = Tree(bicycle.name), bicycle_shapes(outline(bicycle), rod_shape, box_shape)
    frame, front = bicycle.rear_frame, bicycle.front_assembly
    steer = bicycle.steer_origin
    tree.link("rear_frame", frame.mass, frame.tensor, frame.centre, shapes["rear_frame"])
    tree.link("front_assembly", front.mass, front.tensor, np.array(front.centre) - steer, shapes["front_assembly"])
    tree.joint("rear_frame", "front_assembly", steer, bicycle.steer_axis)
    for name, wheel, x, parent, origin in (
        ("rear_wheel", bicycle.rear_wheel, 0.0, "rear_frame", np.zeros(3)),
        ("front_wheel", bicycle.front_wheel, bicycle.wheelbase, "front_assembly", steer),
    ):
        across = wheel.inertia_diameter
        tree.link(name, wheel.mass, (across, wheel.inertia_axle, across), (0.0, 0.0, 0.0), shapes[name])
        tree.joint(parent, name, np.array([x, 0.0, wheel.radius]) - origin, (0.0, 1.0, 0.0))
    if bicycle.drive is not None:
        drive = bicycle.drive
        tree.link("crank", drive.mass, drive.inertia, (0.0, 0.0, 0.0), shapes["crank"])
        tree.joint("rear_frame", "crank", drive.axle, (0.0, 1.0, 0.0))
    return tree


def outline(bicycle: BicycleParameters) -> Outline:
    """What is seen of a bicycle; without a drive, cranks that nobody sees."""
    drive, radii = bicycle.drive, (bicycle.rear_wheel.radius, bicycle.front_wheel.radius)
    axle = (0.42 * bicycle.wheelbase, 0.0, 0.28) if drive is None else drive.axle
    cranks = (0.17, 0.12) if drive is None else (drive.crank_length, drive.pedal_offset)
    steer = (bicycle.steer_axis.tolist(), bicycle.steer_origin.tolist())
    return Outline(bicycle.saddle, axle, *steer, bicycle.grip, bicycle.wheelbase, radii, *cranks)


class Bicycle:
    """A bicycle in a world.

    Args:
        physics: the world.
        parameters: the bicycle.
        ground: what it rolls on; None for a level plane at height 0.
        tyre: its tyres.
        load: what sits on it when starting, for the tyres' static deflection: mass and centre of the rider.
        extend: adds further links (a rider) to the tree before it is loaded.
    """

    def __init__(
        self,
        physics: Physics,
        parameters: BicycleParameters,
        ground: Ground | None = None,
        tyre: TyreParameters | None = None,
        *,
        load: RigidPart | None = None,
        extend: Callable[[Tree], None] | None = None,
    ) -> None:
        self.physics, self.parameters = physics, parameters
        tree = bicycle_tree(parameters)
        if extend is not None:
            extend(tree)
        self.body = Multibody(physics, physics.load_urdf(tree.text(shapes=physics.gui)))
        wheels = (parameters.rear_wheel, parameters.front_wheel)
        self._bristles = np.zeros((2, 2))
        self.tyres = [
            Tyre(wheel.radius, wheel.crown_radius, tyre or TyreParameters(), parameters.rolling_resistance, memory)
            for wheel, memory in zip(wheels, self._bristles, strict=True)
        ]
        self._tyres = np.stack([each.numbers for each in self.tyres])
        self.drivetrain = None if parameters.drive is None else Drivetrain(parameters.drive)
        self.links = self.body.links
        self._turned = [self.links[name] for name in ("front_assembly", *WHEELS, "crank") if name in self.links]
        self._wheels = self._turned[1:3]
        self._numbers = np.array([*self._wheels, self._turned[0], self.links.get("crank", BASE)])
        self.chain = np.zeros(5) if self.drivetrain is None else self.drivetrain.chain
        """of :func:`.chain_torque`; zeros without a crank"""
        self._contacts = np.zeros((2, 7))
        centre, axes = physics.inertial_frame(self.body.body)
        self._frame = np.concatenate([rotation.to_matrix(rotation.conjugate(axes)).ravel(), -centre])
        self.own_links = [self.links[name] for name in BICYCLE_LINKS if name in self.links]
        own = [name for name in BICYCLE_LINKS if name in self.links]
        self.own_masses = np.array([self.body.masses[name] for name in own])
        self.own_moments = np.array([self.body.moments[name] for name in own])
        whole = parameters.with_load(*(() if load is None else (load,)))
        centres = np.array([part.centre for part in whole.parts])
        masses = np.array([part.mass for part in whole.parts])
        self._total_mass = float(masses.sum())
        self._centre = masses @ centres / self._total_mass
        drag, weight = 0.5 * AIR_DENSITY * parameters.drag_area, self._total_mass * physics.gravity
        self._body = np.array([drag, weight, self._centre[0], self._centre[2], parameters.wheelbase])
        self.lay(ground)

    @property
    def tyre_forces(self) -> list[TyreForce]:
        """Of rear and front tyre in the last step."""
        return [tyre_force_of(contact) for contact in self._contacts]

    @property
    def ratio(self) -> float:
        """Revolutions of the rear wheel per revolution of the crank (0 without a crank)."""
        return 0.0 if self.drivetrain is None else self.drivetrain.ratio

    def lay(self, ground: Ground | None) -> None:
        """Put another ground (None: a level plane at height 0) under the wheels; :meth:`start` anew afterwards."""
        self.ground: Ground = FlatGround() if ground is None else ground
        self.acting = (
            self._numbers, self._body, self._tyres, self.ground.table, self.physics.time_step, self.chain,
            self._bristles, self._contacts,
        )  # fmt: skip
        """what :func:`.bicycle_forces` takes between the frames and the brake"""

    def static_loads(self) -> tuple[float, float]:
        """Weight (N) on the rear and the front tyre, at rest on level ground with the tyres' deflection."""
        weight, wheelbase = self._total_mass * self.physics.gravity, self.parameters.wheelbase
        front, pitch = 0.0, 0.0
        for _ in range(5):
            # a softer end sinks deeper and takes more of the load
            front = weight * (self._centre[0] + pitch * self._centre[2]) / wheelbase
            sinking = [
                load / tyre.parameters.stiffness for load, tyre in zip((weight - front, front), self.tyres, strict=True)
            ]
            pitch = (sinking[1] - sinking[0]) / wheelbase
        return float(weight - front), float(front)

    def start(
        self,
        speed: float = 0.0,
        position: tuple[float, float] = (0.0, 0.0),
        heading: float = 0.0,
        roll: float = 0.0,
        roll_rate: float = 0.0,
        steer: float = 0.0,
        steer_rate: float = 0.0,
        crank: float = 0.0,
    ) -> None:
        """Place the bicycle at static tyre deflection, rolling without slip, the chain just taut.

        Args:
            speed: m/s.
            position: of the rear contact, m, world.
            heading: rad, counter-clockwise from east.
            roll: rad, right positive; the bicycle rolls about the line through its contacts.
            roll_rate: rad/s.
            steer: rad, left positive. A large steering angle would also pitch the bicycle; that is left to settle.
            steer_rate: rad/s.
            crank: rad.
        """
        bike = self.parameters
        c, s = math.cos(heading), math.sin(heading)
        ground, heights, rates = [], [], []
        wheels = (bike.rear_wheel, bike.front_wheel)
        for x, load, tyre, wheel in zip((0.0, bike.wheelbase), self.static_loads(), self.tyres, wheels, strict=True):
            sinking = load / tyre.parameters.stiffness
            ground.append(self.ground.height_and_slope(position[0] + c * x, position[1] + s * x)[0])
            heights.append(ground[-1] - sinking)
            rates.append(speed / wheel.radius)
            tyre.bristles = (0.0, 0.0)
        climb = math.atan2(ground[1] - ground[0], bike.wheelbase)
        pitch = -math.atan2(heights[1] - heights[0], bike.wheelbase)
        orientation = rotation.from_euler_zyx(np.array(heading), np.array(pitch), np.array(roll))
        # the frame sits pitched on its tyres, but moves along the ground
        forward = np.array([c * math.cos(climb), s * math.cos(climb), math.sin(climb)])
        origin = np.array([*position, heights[0]])
        self.physics.set_state(
            self.body.body, BodyState(self.physics.time, origin, orientation, speed * forward, roll_rate * forward)
        )
        for link in range(self.physics.link_count(self.body.body)):
            self.body.set_joint(link, 0.0)
        self.body.set_joint(self.links["front_assembly"], steer, steer_rate)
        for name, rate in zip(WHEELS, rates, strict=True):
            self.body.set_joint(self.links[name], 0.0, rate)
        if self.drivetrain is not None:
            ratio = self.drivetrain.gear_for(rates[0])
            self.body.set_joint(self.links["crank"], crank, rates[0] / ratio)
            self.drivetrain.engage(crank, 0.0, ratio)
        self._contacts[:] = 0.0

    def act(
        self,
        steer_torque: float = 0.0,
        wheel_torque: float = 0.0,
        crank_torque: float = 0.0,
        joints: Sequence[int] = (),
        torques: Sequence[float] = (),
        brake: float = 0.0,
    ) -> None:
        """Apply tyre forces, chain, brakes, air drag and joint torques for the next step.

        Args:
            steer_torque: N·m between rear frame and front assembly, left positive.
            wheel_torque: N·m between rear frame and rear wheel, forward positive, besides the chain's.
            crank_torque: N·m between rear frame and crank, forward positive, besides the chain's.
            joints: further joints to drive (a rider's), by the links below them.
            torques: N·m on these.
            brake: wanted force (N, not negative) of both brakes at the ground.
        """
        body = self.body
        forces, first = body.forces, 6
        bicycle_forces(body.tree, body.state, body.frames, *self.acting, brake, forces)
        if steer_torque or wheel_torque or crank_torque:
            rear, _, front, crank = self._numbers.tolist()
            for link, torque in ((front, steer_torque), (rear, wheel_torque), (crank, crank_torque)):
                if torque:
                    forces[first + link] += torque
        if len(joints):
            forces[first + np.asarray(joints)] += torques
        body.apply()

    def shift(self, wheel_rate: float) -> None:
        """Change the gear if the cadence requires it; ``wheel_rate``: of the rear wheel now, rad/s."""
        if self.drivetrain is None:
            return
        time = self.physics.time
        ratio = self.drivetrain.next_gear(time, wheel_rate)
        if ratio is not None:
            (wheel, _), (crank, _) = self.body.joint_tuples([self._wheels[0], self._turned[3]])
            self.drivetrain.shift(time, crank, wheel, ratio)

    def state(self) -> BicycleState:
        """Present state of the bicycle."""
        seen = np.zeros(15)
        self.look(seen)
        return BicycleState(self.physics.time, *seen.tolist())

    def look(self, seen: np.ndarray) -> None:
        """Write :attr:`BicycleState.numbers` of the present state into ``seen`` ``(15,)``."""
        body = self.body
        bicycle_state(body.frames, body.state, self._numbers, self._frame, seen)

    def ground_wrench(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force (N) of the ground on both tyres in the last step and its moment (N·m) about ``point``, world axes."""
        forces = np.array([tyre.force for tyre in self.tyre_forces])
        arms = np.array([tyre.point for tyre in self.tyre_forces]) - point
        return forces.sum(axis=0), rotation.cross(arms, forces).sum(axis=0)

    def own_wrench(self, before: np.ndarray, after: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Wrench of all external forces on the bicycle's own links in the last step, see :func:`newton_euler`.

        ``before`` and ``after`` it the body has the frames ``(n + 1, 18)``; moments are about a point ``(3,)``, m,
        world.
        """
        rows, physics = np.array(self.own_links) + 1, self.physics
        force, moment = newton_euler(
            before, after, rows, self.own_masses, self.own_moments, point, physics.time_step, physics.gravity
        )
        return np.array(force), np.array(moment)

    def save(self) -> BicycleMemory:
        """Tyre and chain memory; the rest is in :meth:`Physics.save`."""
        drivetrain = None if self.drivetrain is None else self.drivetrain.save()
        return BicycleMemory(
            tuple(tyre.bristles for tyre in self.tyres), drivetrain, tuple(map(tuple, self._contacts.tolist()))
        )

    def restore(self, memory: BicycleMemory) -> None:
        """Undo :meth:`save`."""
        self._bristles[:], self._contacts[:] = memory.bristles, memory.contacts
        if self.drivetrain is not None and memory.drivetrain is not None:
            self.drivetrain.restore(memory.drivetrain)
