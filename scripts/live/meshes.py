"""Triangle meshes of simple solids and of the road under a bicycle, in NumPy alone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from ...filters.core import rotation

Colour = tuple[float, float, float]
"""Red, green, blue from 0 to 1."""
SIDES = 14
"""Faces around a rod or a tyre."""
Z = np.array([0.0, 0.0, 1.0])
LEVEL = 0.02
"""m: a path whose height varies less is drawn on the plane"""
HALF_WIDTH = 0.6
"""m: of the road"""
SPACING = 0.08
"""m between cross-sections of the road: a bump of 0.5 m has six"""
BEYOND = 1.3
"""m of road before the first and after the last place of the rear wheel: the front wheel needs them"""


class Mesh(NamedTuple):
    """Triangles of one colour.

    Attributes:
        vertices: ``(n, 3)`` m.
        faces: ``(m, 3)`` numbers of vertices, counter-clockwise from outside.
        colour: of all of them.
    """

    vertices: np.ndarray
    faces: np.ndarray
    colour: Colour


def box(centre: Sequence[float] | np.ndarray, sides: Sequence[float] | np.ndarray, colour: Colour) -> Mesh:
    """A box with its sides (m) along the axes."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    squares = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Mesh(np.asarray(centre, float) + corners * np.asarray(sides, float), _triangles(squares), colour)


def rod(
    start: Sequence[float] | np.ndarray,
    end: Sequence[float] | np.ndarray,
    radius: float,
    colour: Colour,
    end_radius: float | None = None,
) -> Mesh:
    """A cylinder between two points (m), or a cone's part where the radius at the end differs."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    along = rotation.normalize(end - start)
    side = np.cross(along, Z if abs(along[2]) < 0.9 else np.array([1.0, 0.0, 0.0]))
    side = rotation.normalize(side)
    angles = np.linspace(0.0, 2.0 * math.pi, SIDES, endpoint=False)[:, None]
    ring = np.cos(angles) * side + np.sin(angles) * np.cross(along, side)
    last = radius if end_radius is None else end_radius
    vertices = np.concatenate([start + radius * ring, end + last * ring, start[None], end[None]])
    around = [(i, (i + 1) % SIDES) for i in range(SIDES)]
    squares = [(i, j, j + SIDES, i + SIDES) for i, j in around]
    caps = [(2 * SIDES, j, i) for i, j in around] + [(2 * SIDES + 1, i + SIDES, j + SIDES) for i, j in around]
    return Mesh(vertices, np.concatenate([_triangles(squares), np.array(caps)]), colour)


def ball(centre: Sequence[float] | np.ndarray, radius: float, colour: Colour, rings: int = 9) -> Mesh:
    """A sphere (m)."""
    heights = np.linspace(-0.5 * math.pi, 0.5 * math.pi, rings)
    around = np.linspace(0.0, 2.0 * math.pi, SIDES, endpoint=False)
    unit = np.array(
        [[math.cos(h) * math.cos(a), math.cos(h) * math.sin(a), math.sin(h)] for h in heights for a in around]
    )
    squares = [
        (SIDES * r + i, SIDES * r + (i + 1) % SIDES, SIDES * (r + 1) + (i + 1) % SIDES, SIDES * (r + 1) + i)
        for r in range(rings - 1)
        for i in range(SIDES)
    ]
    return Mesh(np.asarray(centre, float) + radius * unit, _triangles(squares), colour)


def tyre(radius: float, tube: float, colour: Colour, segments: int = 36) -> Mesh:
    """A ring about the y axis: ``radius`` to its outside, ``tube`` of its cross-section, m."""
    turn = np.linspace(0.0, 2.0 * math.pi, segments, endpoint=False)
    across = np.linspace(0.0, 2.0 * math.pi, SIDES, endpoint=False)
    middle = radius - tube
    vertices = np.array(
        [
            [
                (middle + tube * math.cos(b)) * math.cos(a),
                tube * math.sin(b),
                (middle + tube * math.cos(b)) * math.sin(a),
            ]
            for a in turn
            for b in across
        ]
    )
    squares = [
        (
            SIDES * i + j,
            SIDES * i + (j + 1) % SIDES,
            SIDES * ((i + 1) % segments) + (j + 1) % SIDES,
            SIDES * ((i + 1) % segments) + j,
        )
        for i in range(segments)
        for j in range(SIDES)
    ]
    return Mesh(vertices, _triangles(squares), colour)


def by_colour(meshes: Iterable[Mesh]) -> list[Mesh]:
    """The same triangles in one mesh a colour."""
    groups: dict[Colour, list[Mesh]] = {}
    for mesh in meshes:
        groups.setdefault(mesh.colour, []).append(mesh)
    joined = []
    for colour, group in groups.items():
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in group)])
        faces = [mesh.faces + start for mesh, start in zip(group, starts, strict=False)]
        joined.append(Mesh(np.concatenate([mesh.vertices for mesh in group]), np.concatenate(faces), colour))
    return joined


def volume(mesh: Mesh) -> float:
    """Enclosed volume, m³; positive if all faces look outwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6.0)


def _triangles(squares: Sequence[tuple[int, int, int, int]]) -> np.ndarray:
    return np.array([triangle for a, b, c, d in squares for triangle in ((a, b, c), (a, c, d))])


def is_hilly(path: np.ndarray) -> bool:
    """Whether a path ``(n, 3)`` of the rear wheel's contact, m, leaves the plane."""
    known = path[np.isfinite(path).all(axis=1)]
    return bool(len(known) > 1 and np.ptp(known[:, 2]) > LEVEL)


def road_mesh(path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A strip along a path with walls down to its lowest point.

    Args:
        path: ``(n, 3)`` places of the rear wheel's contact, m, world; NaN where unknown.

    Returns:
        Vertices ``(v, 3)``, m, and triangles ``(f, 3)``; empty where the bicycle did not move.
    """
    middle = sections(path[np.isfinite(path).all(axis=1)])
    if len(middle) < 2:
        return np.zeros((0, 3)), np.zeros((0, 3), int)
    along = np.gradient(middle[:, :2], axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    left = np.pad(HALF_WIDTH * np.stack([-along[:, 1], along[:, 0]], axis=1), ((0, 0), (0, 1)))
    down = np.array([0.0, 0.0, 1.0]) * (middle[:, 2:] - middle[:, 2].min())
    # across: foot of the left wall, left edge, right edge, foot of the right wall
    vertices = np.stack([middle + left - down, middle + left, middle - left, middle - left - down], axis=1)
    first = 4 * np.arange(len(middle) - 1)[:, None] + np.arange(3)
    quads = np.stack([first, first + 1, first + 5, first + 4], axis=-1).reshape(-1, 4)
    return vertices.reshape(-1, 3), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def sections(path: np.ndarray) -> np.ndarray:
    """Points ``(k, 3)`` of a path that are :data:`SPACING` apart or more, continued at both ends."""
    kept = [0] if len(path) else []
    for index in range(1, len(path)):
        if np.linalg.norm(path[index, :2] - path[kept[-1], :2]) >= SPACING:
            kept.append(index)
    if len(kept) < 2:
        return path[kept]
    points = path[kept]
    ends = []
    for end, before in ((points[0], points[1]), (points[-1], points[-2])):
        step = end - before
        ends.append(end + BEYOND * np.append(step[:2] / np.linalg.norm(step[:2]), 0.0))
    return np.concatenate([ends[:1], points, ends[1:]])
