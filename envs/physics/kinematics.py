"""Forward kinematics of a tree of links, compiled: from the state of the base and of the joints to all centres of mass.

PyBullet gives the state of the base and of all joints in three short calls. Everything else that a physics step needs,
and that a log keeps, follows from them here, instead of from a long tuple per link.

A *state* ``(13 + 2 n,)`` of a tree of n links holds position (m), quaternion (w, x, y, z), velocity (m/s) and angular
velocity (rad/s) of the base's centre of mass, then n joint positions (rad or m) and n joint rates. *Frames*
``(n + 1, 18)``, base first, hold of each centre-of-mass frame its position (m), rotation matrix (row by row, to world
axes), velocity (m/s) and angular velocity (rad/s), world axes. *Generalised forces* ``(6 + n,)`` are force (N) and
moment (N·m) on the base's centre of mass, world axes, then the torques (N·m) or forces (N) of the joints.
"""

from __future__ import annotations

import numpy as np

from ...filters.compile.cache import jit
from ...filters.core import rotation

BASE_SIZE = 13
"""numbers of a state that belong to the base"""
POSITION, VELOCITY, TURNING = slice(0, 3), slice(12, 15), slice(15, 18)
"""columns of frames, see also :func:`orientations`"""
TREE_COLUMNS = 20
"""columns of a tree ``(n, 20)``: index of the parent (−1: the base); 1 if the joint slides, 0 if it turns; its axis, in
the child's frame; rotation matrix of the child at zero, in the parent's frame; the joint in the parent's frame, m; the
child's centre from the joint, in the child's frame, m. All frames are those of principal axes in centres of mass."""


def orientations(frames: np.ndarray) -> np.ndarray:
    """Quaternions ``(..., 4)`` of frames ``(..., 18)``: principal axes to world."""
    return rotation.from_matrix(frames[..., 3:12].reshape(*frames.shape[:-1], 3, 3))


@jit
def move_links(tree, state, frames):  # type: ignore[no-untyped-def]
    """Write the frames of one state.

    Args:
        tree: ``(n, TREE_COLUMNS)``; parents come before their children.
        state: ``(13 + 2 n,)``.
        frames: ``(n + 1, 18)``, overwritten.
    """
    n = tree.shape[0]
    base = frames[0]
    base[0], base[1], base[2] = state[0], state[1], state[2]
    w, x, y, z = state[3], state[4], state[5], state[6]
    base[3], base[4], base[5] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    base[6], base[7], base[8] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    base[9], base[10], base[11] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    for i in range(6):
        base[12 + i] = state[7 + i]
    zero, turn = np.empty((3, 3)), np.empty((3, 3))
    for link in range(n):
        row, up, here = tree[link], frames[int(tree[link, 0]) + 1], frames[link + 1]
        angle, rate = state[13 + link], state[13 + n + link]
        ax, ay, az = row[2], row[3], row[4]
        # orientation at zero, then the turn about the axis (Rodrigues' formula)
        for i in range(3):
            for j in range(3):
                zero[i, j] = up[3 + 3 * i] * row[5 + j] + up[4 + 3 * i] * row[8 + j] + up[5 + 3 * i] * row[11 + j]
        slides = row[1] == 1.0
        if slides:
            for i in range(3):
                for j in range(3):
                    here[3 + 3 * i + j] = zero[i, j]
        else:
            c, s = np.cos(angle), np.sin(angle)
            d = 1.0 - c
            turn[0, 0], turn[0, 1], turn[0, 2] = c + d * ax * ax, d * ax * ay - s * az, d * ax * az + s * ay
            turn[1, 0], turn[1, 1], turn[1, 2] = d * ax * ay + s * az, c + d * ay * ay, d * ay * az - s * ax
            turn[2, 0], turn[2, 1], turn[2, 2] = d * ax * az - s * ay, d * ay * az + s * ax, c + d * az * az
            for i in range(3):
                for j in range(3):
                    here[3 + 3 * i + j] = zero[i, 0] * turn[0, j] + zero[i, 1] * turn[1, j] + zero[i, 2] * turn[2, j]
        # axis and lever arms in world axes
        along = slide_x = slide_y = slide_z = 0.0
        if slides:
            along = angle
            slide_x, slide_y, slide_z = ax * rate, ay * rate, az * rate
        cx, cy, cz = row[17] + along * ax, row[18] + along * ay, row[19] + along * az
        px = up[3] * row[14] + up[4] * row[15] + up[5] * row[16]
        py = up[6] * row[14] + up[7] * row[15] + up[8] * row[16]
        pz = up[9] * row[14] + up[10] * row[15] + up[11] * row[16]
        qx = here[3] * cx + here[4] * cy + here[5] * cz
        qy = here[6] * cx + here[7] * cy + here[8] * cz
        qz = here[9] * cx + here[10] * cy + here[11] * cz
        here[0], here[1], here[2] = up[0] + px + qx, up[1] + py + qy, up[2] + pz + qz
        # a turning joint adds its rate about its axis; a sliding one adds it along
        ux, uy, uz = up[15], up[16], up[17]
        wx, wy, wz = ux, uy, uz
        if not slides:
            wx += (here[3] * ax + here[4] * ay + here[5] * az) * rate
            wy += (here[6] * ax + here[7] * ay + here[8] * az) * rate
            wz += (here[9] * ax + here[10] * ay + here[11] * az) * rate
        here[15], here[16], here[17] = wx, wy, wz
        here[12] = up[12] + uy * pz - uz * py + wy * qz - wz * qy
        here[13] = up[13] + uz * px - ux * pz + wz * qx - wx * qz
        here[14] = up[14] + ux * py - uy * px + wx * qy - wy * qx
        if slides:
            here[12] += here[3] * slide_x + here[4] * slide_y + here[5] * slide_z
            here[13] += here[6] * slide_x + here[7] * slide_y + here[8] * slide_z
            here[14] += here[9] * slide_x + here[10] * slide_y + here[11] * slide_z


@jit
def add_force(tree, frames, link, force, point, forces):  # type: ignore[no-untyped-def]
    """Add a force that acts on a link to the generalised forces: on the base, and on every joint between base and link.

    To PyBullet this is the same as the force on the link, without the link's position, which it would have to update.

    Args:
        tree: ``(n, TREE_COLUMNS)``.
        frames: ``(n + 1, 18)`` now.
        link: index; −1 for the base.
        force: three numbers, N, world axes.
        point: where it acts, three numbers, m, world.
        forces: ``(6 + n,)``, added to.
    """
    fx, fy, fz = force[0], force[1], force[2]
    while link >= 0:
        row, parent = tree[link], int(tree[link, 0])
        here, up = frames[link + 1], frames[parent + 1]
        ax = here[3] * row[2] + here[4] * row[3] + here[5] * row[4]
        ay = here[6] * row[2] + here[7] * row[3] + here[8] * row[4]
        az = here[9] * row[2] + here[10] * row[3] + here[11] * row[4]
        if row[1] == 1.0:
            forces[6 + link] += ax * fx + ay * fy + az * fz
        else:
            # arm from the joint
            x = point[0] - up[0] - up[3] * row[14] - up[4] * row[15] - up[5] * row[16]
            y = point[1] - up[1] - up[6] * row[14] - up[7] * row[15] - up[8] * row[16]
            z = point[2] - up[2] - up[9] * row[14] - up[10] * row[15] - up[11] * row[16]
            forces[6 + link] += ax * (y * fz - z * fy) + ay * (z * fx - x * fz) + az * (x * fy - y * fx)
        link = parent
    x, y, z = point[0] - frames[0, 0], point[1] - frames[0, 1], point[2] - frames[0, 2]
    forces[0] += fx
    forces[1] += fy
    forces[2] += fz
    forces[3] += y * fz - z * fy
    forces[4] += z * fx - x * fz
    forces[5] += x * fy - y * fx


@jit
def carry_frames(frames, arms, duration, found):  # type: ignore[no-untyped-def]
    """Motion of points of links, such as the origins of their body frames, after physics steps.

    Args:
        frames: ``(n, 2, k, 18)`` before and after each step.
        arms: ``(k, 3)`` of the points from the centres, in principal axes, m.
        duration: of a step, s.
        found: ``(4, k, n, 3)``, overwritten: position (m), velocity (m/s), and over the step acceleration (m/s²) and
            angular acceleration (rad/s²), world axes.
    """
    place, speeds = np.empty(3), np.empty((2, 3))
    for index in range(frames.shape[0]):
        for link in range(frames.shape[2]):
            for side in range(2):
                here = frames[index, side, link]
                for i in range(3):
                    place[i] = here[3 + 3 * i] * arms[link, 0] + here[4 + 3 * i] * arms[link, 1]
                    place[i] += here[5 + 3 * i] * arms[link, 2]
                wx, wy, wz = here[15], here[16], here[17]
                speeds[side, 0] = here[12] + wy * place[2] - wz * place[1]
                speeds[side, 1] = here[13] + wz * place[0] - wx * place[2]
                speeds[side, 2] = here[14] + wx * place[1] - wy * place[0]
            before, after = frames[index, 0, link], frames[index, 1, link]
            for i in range(3):
                found[0, link, index, i], found[1, link, index, i] = after[i] + place[i], speeds[1, i]
                found[2, link, index, i] = (speeds[1, i] - speeds[0, i]) / duration
                found[3, link, index, i] = (after[15 + i] - before[15 + i]) / duration
