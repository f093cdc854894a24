"""Joints and closed loops of a multibody: read and drive one-axis joints, hold points of two links together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...filters.core import rotation
from ...filters.support.optional import extra
from .world import Physics, Vector, floats

with extra("sim"):
    import pybullet


def joint_states(physics: Physics, body: int, links: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Positions and rates ``(n,)`` of the one-axis joints above ``links``, rad and rad/s (m and m/s)."""
    rows = pybullet.getJointStates(body, list(links), physicsClientId=physics.client)
    return np.array([row[0] for row in rows]), np.array([row[1] for row in rows])


def set_joint_state(physics: Physics, body: int, link: int, position: float, rate: float = 0.0) -> None:
    """Put the joint above ``link`` at a position with a rate."""
    pybullet.resetJointState(body, link, float(position), float(rate), physicsClientId=physics.client)


def set_joint_torques(physics: Physics, body: int, links: Sequence[int], torques: Vector) -> None:
    """Act on the one-axis joints above ``links`` with these torques (N·m; forces, N) during the next step."""
    pybullet.setJointMotorControlArray(
        body, list(links), pybullet.TORQUE_CONTROL, forces=floats(torques), physicsClientId=physics.client
    )


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
