"""Triangle meshes of simple solids (trimesh, which the viewer's server brings) and of the road under a bicycle."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...filters.support.optional import extra

with extra("view"):
    import trimesh
    from trimesh import creation

Colour = tuple[float, float, float]
"""Red, green, blue from 0 to 1."""
Point = Sequence[float] | np.ndarray
SIDES = 14
"""Faces around a rod or a tyre."""
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


def box(centre: Point, sides: Point, colour: Colour) -> Mesh:
    """A block with edges along the axes; ``sides`` are its whole lengths, m."""
    return _placed(creation.box(sides), centre, colour)


def rod(start: Point, end: Point, radius: float, colour: Colour, end_radius: float | None = None) -> Mesh:
    """A round rod, or a cone that ends with another radius, m."""
    along = np.subtract(end, start)
    length = float(np.linalg.norm(along))
    outline = [(0.0, 0.0), (radius, 0.0), (radius if end_radius is None else end_radius, length), (0.0, length)]
    made = creation.revolve(outline, sections=SIDES)
    made.apply_transform(trimesh.geometry.align_vectors([0.0, 0.0, 1.0], along))
    return _placed(made, start, colour)


def ball(centre: Point, radius: float, colour: Colour, rings: int = 9) -> Mesh:
    """A sphere."""
    return _placed(creation.uv_sphere(radius=radius, count=[rings, SIDES]), centre, colour)


def tyre(radius: float, tube: float, colour: Colour) -> Mesh:
    """A ring about the y axis: ``radius`` to its outside, ``tube`` of its cross-section, m."""
    made = creation.torus(radius - tube, tube, major_sections=36, minor_sections=SIDES)
    made.apply_transform(trimesh.geometry.align_vectors([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]))
    return _placed(made, np.zeros(3), colour)


def by_colour(meshes: Iterable[Mesh]) -> list[Mesh]:
    """The same triangles in one mesh a colour."""
    groups: dict[Colour, list[Mesh]] = {}
    for mesh in meshes:
        groups.setdefault(mesh.colour, []).append(mesh)
    return [
        Mesh(*trimesh.util.append_faces([each.vertices for each in group], [each.faces for each in group]), colour)
        for colour, group in groups.items()
    ]


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


def _placed(made: Any, centre: Point, colour: Colour) -> Mesh:
    return Mesh(np.asarray(made.vertices) + np.asarray(centre, float), np.asarray(made.faces), colour)
