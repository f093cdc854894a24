"""Fast, exact access to a multibody in PyBullet, including closed loops, for use in every physics step.

Everything here belongs to *centre-of-mass frames* (principal axes), which PyBullet keeps in double precision. Numbers
leave this file with quaternions scalar first. A multibody is read once between two changes of the world; the frames of
its links follow by compiled kinematics (:mod:`.kinematics`).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from operator import itemgetter

import numpy as np

from ...filters.core import rotation
from ...filters.support.optional import extra
from .kinematics import BASE_SIZE, TREE_COLUMNS, add_force, move_links
from .world import BASE, Physics, Vector, floats

with extra("sim"):
    import pybullet

Tuple3 = tuple[float, float, float]
FIRST, SECOND = itemgetter(0), itemgetter(1)


class Multibody:
    """A loaded multibody with its links by name.

    Args:
        physics: the world.
        body: its number there.
    """

    def __init__(self, physics: Physics, body: int) -> None:
        self.physics, self.body = physics, body
        self.links = physics.links(body)
        self.masses: dict[str, float] = {}
        self.moments: dict[str, np.ndarray] = {}
        for name, link in self.links.items():
            dynamics = pybullet.getDynamicsInfo(body, link, physicsClientId=physics.client)
            self.masses[name] = float(dynamics[0])
            self.moments[name] = np.array(dynamics[2])
        self._all = list(range(len(self.links) - 1))
        self.tree = self._tree()
        """(n, TREE_COLUMNS) of :mod:`.kinematics`"""
        count = len(self._all)
        self._state, self._frames = np.zeros(BASE_SIZE + 2 * count), np.zeros((count + 1, 18))
        self.forces = np.zeros(6 + count)
        """generalised forces (6 + n,) of :mod:`.kinematics` that :meth:`apply` hands to PyBullet for the next step"""
        self._pack, self._bytes = struct.Struct(f"{BASE_SIZE + 2 * count}d").pack_into, self._state.data
        self._read_at = self._moved_at = -1

    def _tree(self) -> np.ndarray:
        tree = np.zeros((len(self._all), TREE_COLUMNS))
        for link, row in enumerate(tree):
            info = pybullet.getJointInfo(self.body, link, physicsClientId=self.physics.client)
            offset, axes = self.physics.inertial_frame(self.body, link)
            if info[2] == pybullet.JOINT_SPHERICAL:
                raise ValueError(
                    f"joints must turn about one axis or slide along it, {info[1].decode()!r} is spherical"
                )
            # PyBullet turns the parent's coordinates into the child's
            turn = rotation.conjugate(rotation.from_xyzw(np.array(info[15])))
            row[:5] = info[16], info[2] == pybullet.JOINT_PRISMATIC, *info[13]
            row[5:14] = rotation.to_matrix(turn).ravel()
            row[14:17], row[17:20] = info[14], rotation.rotate_back(axes, offset)
        return tree

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return sum(self.masses.values())

    def index(self, names: Sequence[str]) -> list[int]:
        """Numbers of links, for the fast calls below."""
        return [self.links[name] for name in names]

    @property
    def state(self) -> np.ndarray:
        """State ``(13 + 2 n,)`` of :mod:`.kinematics` now; overwritten when it is read after a change."""
        physics = self.physics
        if self._read_at != physics.changes:
            position, orientation, velocity, turning = physics.base_tuples(self.body)
            rows = pybullet.getJointStates(self.body, self._all, physics.client)
            angles, rates = map(FIRST, rows), map(SECOND, rows)
            self._pack(self._bytes, 0, *position, *orientation, *velocity, *turning, *angles, *rates)
            self._read_at = physics.changes
        return self._state

    @property
    def frames(self) -> np.ndarray:
        """Frames ``(n + 1, 18)`` of :mod:`.kinematics` now, base first; overwritten likewise."""
        if self._moved_at != self.physics.changes:
            move_links(self.tree, self.state, self._frames)
            self._moved_at = self.physics.changes
        return self._frames

    def motion(self) -> tuple[np.ndarray, np.ndarray, bool]:
        """:attr:`state`, :attr:`frames`, and whether the caller must still move these, by :func:`.move_links`."""
        late = self._moved_at != self.physics.changes
        self._moved_at = self.physics.changes
        return self.state, self._frames, late

    def joint_tuples(self, links: Sequence[int]) -> list[tuple[float, float]]:
        """Angle (rad) and rate (rad/s) of the joints above ``links``."""
        angles, rates = self.state[BASE_SIZE:].reshape(2, -1).tolist()
        return [(angles[link], rates[link]) for link in links]

    def set_joint(self, link: int, angle: float, rate: float = 0.0) -> None:
        """Put the joint above ``link`` at an angle with a rate."""
        self.physics.changes += 1
        pybullet.resetJointState(self.body, link, angle, rate, physicsClientId=self.physics.client)

    def set_joint_damping(self, link: int, damping: float) -> None:
        """Viscous damping of the joint above ``link``, N·m·s/rad, integrated implicitly by PyBullet."""
        pybullet.changeDynamics(self.body, link, jointDamping=damping, physicsClientId=self.physics.client)

    def apply(self) -> None:
        """Let :attr:`forces` act during the next step, and begin anew with zeros."""
        client, values, centre = self.physics.client, self.forces.tolist(), self.state[:3].tolist()
        pybullet.applyExternalForce(self.body, BASE, values[:3], centre, pybullet.WORLD_FRAME, client)
        pybullet.applyExternalTorque(self.body, BASE, values[3:6], pybullet.WORLD_FRAME, client)
        pybullet.setJointMotorControlArray(
            self.body, self._all, pybullet.TORQUE_CONTROL, forces=values[6:], physicsClientId=client
        )
        self.forces.fill(0.0)

    def release(self, constraint: int) -> None:
        """Remove a constraint between points."""
        pybullet.removeConstraint(constraint, physicsClientId=self.physics.client)

    def push(self, link: int, force: Vector, point: Vector) -> None:
        """Add to :attr:`forces` a force (N) on a link at a point (m), world axes."""
        add_force(self.tree, self.frames, link, (*force,), (*point,), self.forces)


def connect_points(
    physics: Physics, parent: tuple[int, int], parent_point: Vector, child: tuple[int, int], child_point: Vector
) -> int:
    """Hold two points of two links together, each given by (body, link) and place ``(3,)`` m in the link's body frame.

    Returns:
        The constraint's number, for :func:`constraint_forces`.
    """
    pivots = []
    for (body, link), point in ((parent, parent_point), (child, child_point)):
        offset, axes = physics.inertial_frame(body, link)
        # PyBullet counts pivots from the frame of principal axes
        pivots.append(floats(rotation.rotate_back(axes, np.asarray(point, dtype=float) - offset)))
    constraint = pybullet.createConstraint(
        *parent, *child, pybullet.JOINT_POINT2POINT, [0.0, 0.0, 0.0], *pivots, physicsClientId=physics.client
    )
    pybullet.changeConstraint(constraint, maxForce=5e4, physicsClientId=physics.client)
    return int(constraint)


def constraint_forces(physics: Physics, constraints: Sequence[int]) -> list[Tuple3]:
    """Force on the child of each point-to-point constraint during the last step, N, world axes."""
    client, state = physics.client, pybullet.getConstraintState
    return [state(each, client) for each in constraints]
