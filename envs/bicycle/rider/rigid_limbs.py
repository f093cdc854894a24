"""Where hands and feet hold the bicycle, and their forces if arms and legs are rigid parts of trunk and pelvis."""

from __future__ import annotations

import numpy as np

from ....filters.compile.cache import jit
from ....filters.core import rotation
from ...physics.kinematics import add_force
from ..frame.bicycle import Bicycle
from .posture import Posture


def holds(bicycle: Bicycle, posture: Posture) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Links ``(4, 2)``, arms and axes of :func:`push_between` for a person on a bicycle: left and right hand and foot.

    Hands act on the handlebar and, oppositely, on the trunk; feet on the pedals and on the pelvis.
    """
    links, physics = bicycle.links, bicycle.physics
    held = [links["front_assembly"]] * 2 + [links["crank"]] * 2
    holding = [links["trunk"]] * 2 + [links["pelvis"]] * 2
    arms = []
    for link, arm in zip(held, (*posture.grip_arms, *posture.pedal_arms), strict=True):
        centre, axes = physics.inertial_frame(bicycle.body.body, link)
        arms.append(rotation.rotate_back(axes, arm - centre))
    axes = rotation.to_matrix(rotation.conjugate(physics.inertial_frame(bicycle.body.body)[1]))
    return np.array([held, holding]).T.copy(), np.array(arms), axes


@jit
def push_between(tree, frames, links, arms, axes, pushes, forces):  # type: ignore[no-untyped-def]
    """Add forces between pairs of links to the generalised forces.

    Args:
        tree: ``(n, TREE_COLUMNS)`` of :mod:`poise.envs.physics.kinematics`.
        frames: ``(n + 1, 18)`` now.
        links: ``(k, 2)``: on the first the force acts, on the second its reaction.
        arms: ``(k, 3)`` where, from the first one's centre of mass, its principal axes, m.
        axes: ``(3, 3)`` matrix of the base's body axes to its principal axes.
        pushes: ``(k, 3)`` in the base's body axes, N.
        forces: ``(6 + n,)``, added to.
    """
    base = frames[0, 3:12].reshape(3, 3)
    for index in range(links.shape[0]):
        here = frames[links[index, 0] + 1]
        point, force = np.zeros(3), np.zeros(3)
        for i in range(3):
            point[i] = here[i]
            for j in range(3):
                point[i] += here[3 + 3 * i + j] * arms[index, j]
                for k in range(3):
                    force[i] += base[i, k] * axes[k, j] * pushes[index, j]
        add_force(tree, frames, links[index, 0], force, point, forces)
        add_force(tree, frames, links[index, 1], -force, point, forces)
