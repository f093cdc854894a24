"""Fast, exact access to a multibody in PyBullet, including closed loops, for use in every physics step.

Everything here belongs to *centre-of-mass frames* (principal axes), which PyBullet keeps in double precision. Numbers
leave this file with quaternions scalar first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...filters.core import rotation
from ...filters.support.optional import extra
from .world import BASE, Physics, Vector, floats

with extra("sim"):
    import pybullet

Tuple3 = tuple[float, float, float]
LinkState = tuple[Tuple3, tuple[float, float, float, float], Tuple3, Tuple3]
"""Position, quaternion (w, x, y, z), velocity and angular velocity of a centre-of-mass frame, world axes."""


class CentreMotion(NamedTuple):
    """Motion of the centre-of-mass frames of n links, world axes."""

    position: np.ndarray
    """(..., n, 3) m"""
    orientation: np.ndarray
    """(..., n, 4) principal axes to world"""
    velocity: np.ndarray
    """(..., n, 3) m/s"""
    angular_velocity: np.ndarray
    """(..., n, 3) rad/s"""


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

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return sum(self.masses.values())

    def index(self, names: Sequence[str]) -> list[int]:
        """Numbers of links, for the fast calls below."""
        return [self.links[name] for name in names]

    def link_tuples(self, links: Sequence[int]) -> list[LinkState]:
        """Position, quaternion (w, x, y, z), velocity and angular velocity of links (not the base) as plain tuples."""
        rows = pybullet.getLinkStates(
            self.body, links, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=self.physics.client
        )
        return [(row[0], (row[1][3], *row[1][:3]), row[6], row[7]) for row in rows]

    def centre_motion(self, links: Sequence[int]) -> CentreMotion:
        """Motion of the centre-of-mass frames of links; the base may be among them."""
        moving = [link for link in links if link != BASE]
        rows = iter(self.link_tuples(moving) if moving else ())
        base = self.physics.base_tuples(self.body)
        states = [base if link == BASE else next(rows) for link in links]
        return CentreMotion(*(np.array(field) for field in zip(*states, strict=True)))

    def joint_tuples(self, links: Sequence[int]) -> list[tuple[float, float]]:
        """Angle (rad) and rate (rad/s) of the joints above ``links``."""
        rows = pybullet.getJointStates(self.body, links, physicsClientId=self.physics.client)
        return [(row[0], row[1]) for row in rows]

    def set_joint(self, link: int, angle: float, rate: float = 0.0) -> None:
        """Put the joint above ``link`` at an angle with a rate."""
        pybullet.resetJointState(self.body, link, angle, rate, physicsClientId=self.physics.client)

    def set_joint_damping(self, link: int, damping: float) -> None:
        """Viscous damping of the joint above ``link``, N·m·s/rad, integrated implicitly by PyBullet."""
        pybullet.changeDynamics(self.body, link, jointDamping=damping, physicsClientId=self.physics.client)

    def drive_joints(self, links: Sequence[int], torques: Sequence[float]) -> None:
        """Act on the joints above ``links`` with torques (N·m) during the next step."""
        pybullet.setJointMotorControlArray(
            self.body, links, pybullet.TORQUE_CONTROL, forces=torques, physicsClientId=self.physics.client
        )

    def release(self, constraint: int) -> None:
        """Remove a constraint between points."""
        pybullet.removeConstraint(constraint, physicsClientId=self.physics.client)

    def push(self, link: int, force: Vector, point: Vector) -> None:
        """Act on a link with a force (N) at a point (m), world axes, during the next step."""
        pybullet.applyExternalForce(
            self.body, link, force, point, pybullet.WORLD_FRAME, physicsClientId=self.physics.client
        )


def newton_euler(
    before: CentreMotion,
    after: CentreMotion,
    masses: np.ndarray,
    moments: np.ndarray,
    point: np.ndarray,
    duration: float,
    gravity: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Total wrench of external contacts on some links, from the rate of change of their momentum.

    Force = Σ m (Δv/Δt − g), moment about ``point`` = Σ (x − point) × m (Δv/Δt − g) + Δ(Σ R I Rᵀ ω)/Δt.

    Args:
        before: motion before a physics step.
        after: motion after it; the step's accelerations belong to positions ``before``, as the integrator has it.
        masses: ``(n,)`` kg.
        moments: ``(n, 3)`` principal moments of inertia, kg·m².
        point: ``(..., 3)`` m, world.
        duration: of the step, s.
        gravity: m/s², along −z.

    Returns:
        Force ``(..., 3)`` N and moment ``(..., 3)`` N·m, world axes.
    """
    acceleration = (after.velocity - before.velocity) / duration
    forces = masses[:, None] * (acceleration + np.array((0.0, 0.0, gravity)))
    spin = (spin_momentum(after, moments) - spin_momentum(before, moments)) / duration
    arms = before.position - point[..., None, :]
    return forces.sum(axis=-2), (rotation.cross(arms, forces) + spin).sum(axis=-2)


def spin_momentum(motion: CentreMotion, moments: np.ndarray) -> np.ndarray:
    """Angular momentum ``(..., n, 3)`` of links about their own centres of mass, N·m·s, world axes."""
    rate = rotation.rotate_back(motion.orientation, motion.angular_velocity)
    return rotation.rotate(motion.orientation, moments * rate)


def connect_points(
    physics: Physics,
    parent: tuple[int, int],
    parent_point: Vector,
    child: tuple[int, int],
    child_point: Vector,
    max_force: float = 5e4,
) -> int:
    """Hold two points of two links together.

    Args:
        physics: the world.
        parent: (body, link).
        parent_point: ``(3,)`` m in that link's body frame.
        child: (body, link).
        child_point: ``(3,)`` m in that link's body frame.
        max_force: N.

    Returns:
        The constraint's number, for :func:`constraint_force`.
    """
    pivots = []
    for (body, link), point in ((parent, parent_point), (child, child_point)):
        offset, axes = physics.inertial_frame(body, link)
        # PyBullet counts pivots from the frame of principal axes
        pivots.append(floats(rotation.rotate_back(axes, np.asarray(point, dtype=float) - offset)))
    constraint = pybullet.createConstraint(
        *parent, *child, pybullet.JOINT_POINT2POINT, [0.0, 0.0, 0.0], *pivots, physicsClientId=physics.client
    )
    pybullet.changeConstraint(constraint, maxForce=max_force, physicsClientId=physics.client)
    return int(constraint)


def constraint_force(physics: Physics, constraint: int) -> np.ndarray:
    """Force ``(3,)`` on the child of a point-to-point constraint during the last step, N, world axes."""
    return np.array(pybullet.getConstraintState(constraint, physicsClientId=physics.client)[:3])
