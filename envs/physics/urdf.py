"""Write a multibody as URDF text: links with inertia and shapes, one-axis joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...filters.core import rotation
from .world import Vector, principal_axes

Colour = tuple[float, float, float]


def _row(values: Vector) -> str:
    return " ".join(repr(float(value)) for value in values)


def _roll_pitch_yaw(quaternion: np.ndarray) -> str:
    yaw, pitch, roll = rotation.to_euler_zyx(quaternion)
    return _row((float(roll), float(pitch), float(yaw)))


def _along(direction: np.ndarray) -> np.ndarray:
    """A quaternion that turns z to a unit vector."""
    x, y, z = direction.tolist()
    if z < -0.999999:
        return np.array([0.0, 1.0, 0.0, 0.0])
    return rotation.normalize(np.array([1.0 + z, -y, x, 0.0]))


def rod_shape(start: Vector, end: Vector, radius: float, colour: Colour) -> str:
    """A cylinder from ``start`` to ``end`` (m, link frame) to draw."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    length = float(np.linalg.norm(b - a))
    pose = f'xyz="{_row(0.5 * (a + b))}" rpy="{_roll_pitch_yaw(_along((b - a) / length))}"'
    return _shape(pose, f'<cylinder radius="{float(radius)!r}" length="{length!r}"/>', colour)


def ball_shape(centre: Vector, radius: float, colour: Colour) -> str:
    """A sphere (m, link frame) to draw."""
    return _shape(f'xyz="{_row(centre)}"', f'<sphere radius="{float(radius)!r}"/>', colour)


def box_shape(centre: Vector, sides: Vector, colour: Colour) -> str:
    """A box with its sides along the link's axes (m) to draw."""
    return _shape(f'xyz="{_row(centre)}"', f'<box size="{_row(sides)}"/>', colour)


def _shape(pose: str, geometry: str, colour: Colour) -> str:
    name = "colour_" + "_".join(str(round(255 * part)) for part in colour)
    material = f'<material name="{name}"><color rgba="{_row((*colour, 1.0))}"/></material>'
    return f"<visual><origin {pose}/><geometry>{geometry}</geometry>{material}</visual>"


class Tree:
    """Links and joints, collected to a URDF text. The first link is the base.

    Link frames are parallel in the zero position: a joint has an origin but no turn.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._links: list[tuple[str, Sequence[str]]] = []
        self._joints: list[str] = []

    def link(self, name: str, mass: float, inertia: Vector, centre: Vector, shapes: Sequence[str] = ()) -> None:
        """Add a link.

        Args:
            name: its name.
            mass: kg.
            inertia: ``(3,)`` or ``(3, 3)`` about the centre of mass, link axes, kg·m².
            centre: ``(3,)`` centre of mass in the link frame, m.
            shapes: what to draw.
        """
        moments, axes = principal_axes(inertia)
        xx, yy, zz = np.asarray(moments, dtype=float).tolist()
        head = (
            f'<link name="{name}"><inertial><origin xyz="{_row(centre)}" rpy="{_roll_pitch_yaw(axes)}"/>'
            f'<mass value="{float(mass)!r}"/>'
            f'<inertia ixx="{xx!r}" iyy="{yy!r}" izz="{zz!r}" ixy="0" ixz="0" iyz="0"/></inertial>'
        )
        self._links.append((head, shapes))

    def joint(
        self, parent: str, child: str, origin: Vector, axis: Vector | None = None, *, slides: bool = False
    ) -> None:
        """Hang ``child`` on ``parent`` at ``origin`` (m, parent frame); it turns about ``axis`` or slides along it.

        Without an axis it is fixed.
        """
        kind = "fixed" if axis is None else "prismatic" if slides else "continuous"
        turn = "" if axis is None else f'<axis xyz="{_row(axis)}"/>'
        if slides:
            # PyBullet takes a lower limit above the upper one for none
            turn += '<limit lower="1" upper="-1" effort="1e9" velocity="1e9"/>'
        self._joints.append(
            f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{_row(origin)}"/>{turn}</joint>'
        )

    def text(self, *, shapes: bool = True) -> str:
        """The URDF, in short lines: PyBullet reads no more than 8 KiB of a line.

        Shapes are there to be drawn; they take most of the time of loading.
        """
        links = [line for head, drawn in self._links for line in (head, *(drawn if shapes else ()), "</link>")]
        return "\n".join([f'<robot name="{self.name}">', *links, *self._joints, "</robot>"])
