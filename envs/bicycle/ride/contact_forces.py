"""Forces between rider and bicycle, from the rider's motion by Newton–Euler, without PyBullet's joint sensors.

The seat force follows from the rate of change of the rider's momentum, gravity, and the forces on hands and feet. Three
load cells under the saddle share its vertical force and horizontal moments by statics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ....filters.compile.cache import jit
from ...physics.kinematics import move_links
from ...physics.momentum import newton_euler
from ..rider.rider import Rider

CELLS_LONG, CELLS_WIDE, CELLS_BEHIND = 0.20, 0.12, 0.043
"""m: Lx from rear to front cell, Ly between the rear ones, Lm from these to the post (force-inertial table I)"""


class Contact(NamedTuple):
    """Forces of the rider on the bicycle, world axes."""

    seat_force: np.ndarray
    """(..., 3) N"""
    seat_moment: np.ndarray
    """(..., 3) N·m about the saddle point"""
    hands: np.ndarray
    """(..., 2, 3) N, left and right, on the handlebar"""
    feet: np.ndarray
    """(..., 2, 3) N, left and right, on the pedals"""


@dataclass(frozen=True)
class LoadCells:
    """Three vertical load cells under a saddle; by default those of the force-inertial paper.

    Raises:
        ValueError: the cells lie on one line.
    """

    x: tuple[float, float, float] = (CELLS_LONG - CELLS_BEHIND, -CELLS_BEHIND, -CELLS_BEHIND)
    """m from the saddle point: front, rear left, rear right"""
    y: tuple[float, float, float] = (0.0, 0.5 * CELLS_WIDE, -0.5 * CELLS_WIDE)
    """m"""

    def __post_init__(self) -> None:
        if abs(np.linalg.det(self.matrix)) < 1e-6:
            raise ValueError(f"the three cells must not lie on one line, got x {self.x} and y {self.y}")

    @property
    def matrix(self) -> np.ndarray:
        """Forces of the cells → (vertical force, moment about x, moment about y) ``(3, 3)``."""
        return np.array([np.ones(3), self.y, -np.array(self.x)])

    def share(self, force: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """Upward forces ``(..., 3)`` of the cells on the saddle, N.

        Args:
            force: ``(..., 3)`` of the saddle's support on the rider, bicycle axes, N; only z counts.
            moment: ``(..., 3)`` about the saddle point, N·m; only x and y count.
        """
        wanted = np.stack([force[..., 2], moment[..., 0], moment[..., 1]], axis=-1)
        return wanted @ np.linalg.inv(self.matrix).T


def contact(
    rider: Rider, states: np.ndarray, pushes: np.ndarray, steps: int, last_only: bool = False, rows: Sequence[int] = ()
) -> tuple[Contact, np.ndarray]:
    """Forces at n samples, and the motion of some links.

    Args:
        rider: masses and inertias, and whether hands and feet are held by constraints.
        states: ``(n · steps + 1, …)`` of :mod:`poise.envs.physics.kinematics` before and after all physics steps.
        pushes: ``(n · steps, 4, 3)`` of hands and feet in each of them, see :meth:`.Rider.raw_forces`.
        steps: physics steps per sample.
        last_only: the forces in the last physics step of each sample, instead of their mean over all of them in
            bicycle axes, turned into the world at the end.
        rows: of the links in frames, the base's 0.

    Returns:
        The forces, and frames ``(n, 2, rows, 18)`` before and after the last physics step of each sample.
    """
    physics, count, bodies = rider.bicycle.physics, len(pushes) // steps, np.array(rider.mass_links) + 1
    found, frames = np.empty((count, 6, 3)), np.empty((count, 2, len(rows), 18))
    sampled_contact(
        rider.bicycle.body.tree, states, pushes, rider.full, (bodies, rider.masses, rider.moments), rider.holds,
        rider.saddle_arm, physics.time_step, physics.gravity, steps, steps - 1 if last_only else 0,
        np.array(rows, int), found, frames,
    )  # fmt: skip
    return Contact(found[:, 0], found[:, 1], found[:, 2:4], found[:, 4:]), frames


@jit
def sampled_contact(  # type: ignore[no-untyped-def]
    tree, states, pushes, full, bodies, holds, saddle, duration, gravity, steps, first, wanted, found, kept
):
    """:func:`contact`, compiled.

    Args:
        tree: of :mod:`poise.envs.physics.kinematics`.
        states: as there.
        pushes: as there; in world axes (``full``) or in bicycle axes.
        full: likewise.
        bodies: rows of the rider's masses in the frames, masses and moments of inertia, see :func:`.newton_euler`.
        holds: :attr:`.Rider.holds`.
        saddle: :attr:`.Rider.saddle_arm`.
        duration: of a physics step, s.
        gravity: m/s².
        steps: physics steps per sample.
        first: of those of a sample from which on the mean is taken.
        wanted: rows of the frames that are kept.
        found: ``(n, 6, 3)``, overwritten: force and moment of the seat, hands, feet.
        kept: ``(n, 2, wanted, 18)``, overwritten.
    """
    (rows, masses, moments), (links, arms, axes) = bodies, holds
    frames = np.empty((2, tree.shape[0] + 1, 18))
    before, after = frames[0], frames[1]
    move_links(tree, states[0], after)
    vectors, mean, frame = np.empty((6, 3)), np.empty((6, 3)), np.empty((3, 3))
    for sample in range(found.shape[0]):
        mean[:] = 0.0
        for step in range(sample * steps, (sample + 1) * steps):
            before, after = after, before
            move_links(tree, states[step + 1], after)
            if step < sample * steps + first:
                continue
            bicycle_axes(before[0], axes, frame)
            for tip in range(4):
                for axis in range(3):
                    vectors[2 + tip, axis] = pushes[step, tip, axis]
            if not full:
                turn(pushes[step], frame, vectors[2:])
            point = place_on(before[0], saddle)
            force, moment = newton_euler(before, after, rows, masses, moments, point, duration, gravity)
            fx, fy, fz = force
            mx, my, mz = moment
            for tip in range(4):
                # reactions of handlebar and pedals
                px, py, pz = vectors[2 + tip]
                x, y, z = place_on(before[links[tip, 0] + 1], arms[tip])
                x, y, z = x - point[0], y - point[1], z - point[2]
                fx, fy, fz = fx + px, fy + py, fz + pz
                mx, my, mz = mx + y * pz - z * py, my + z * px - x * pz, mz + x * py - y * px
            vectors[0, 0], vectors[0, 1], vectors[0, 2] = -fx, -fy, -fz
            vectors[1, 0], vectors[1, 1], vectors[1, 2] = -mx, -my, -mz
            bicycle_axes(after[0], axes, frame)
            for row in range(6):
                for axis in range(3):
                    for i in range(3):
                        mean[row, axis] += frame[i, axis] * vectors[row, i] / (steps - first)
        # the last of these axes are those at the sample
        turn(mean, frame, found[sample])
        for index in range(wanted.shape[0]):
            for column in range(18):
                kept[sample, 0, index, column] = before[wanted[index], column]
                kept[sample, 1, index, column] = after[wanted[index], column]


@jit
def bicycle_axes(base, axes, found):  # type: ignore[no-untyped-def]
    """Rotation matrix ``(3, 3)`` from bicycle axes to the world, overwritten, of the base's frame ``(18,)``."""
    for i in range(3):
        for j in range(3):
            found[i, j] = base[3 + 3 * i] * axes[0, j] + base[4 + 3 * i] * axes[1, j] + base[5 + 3 * i] * axes[2, j]


@jit
def turn(vectors, matrix, found):  # type: ignore[no-untyped-def]
    """Rows of ``vectors`` ``(k, 3)`` turned by a matrix ``(3, 3)``, written into ``found``."""
    for row in range(vectors.shape[0]):
        x, y, z = vectors[row, 0], vectors[row, 1], vectors[row, 2]
        for i in range(3):
            found[row, i] = matrix[i, 0] * x + matrix[i, 1] * y + matrix[i, 2] * z


@jit
def place_on(frame, arm):  # type: ignore[no-untyped-def]
    """World place, three numbers (m), of a point given from a link's centre in its principal axes."""
    x, y, z = arm[0], arm[1], arm[2]
    return (
        frame[0] + frame[3] * x + frame[4] * y + frame[5] * z,
        frame[1] + frame[6] * x + frame[7] * y + frame[8] * z,
        frame[2] + frame[9] * x + frame[10] * y + frame[11] * z,
    )
