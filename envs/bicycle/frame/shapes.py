"""Shapes of a bicycle by link, for whoever draws them: a URDF for PyBullet, or the meshes of the viewer."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

PAINT = (0.72, 0.13, 0.14)
STEEL = (0.58, 0.60, 0.63)
RUBBER = (0.13, 0.13, 0.14)
SPOKES, TUBE = 8, 0.022
"""of a wheel, and radius of its tyre's cross-section, m"""
Draw = Callable[..., Any]
"""Makes a shape: a rod of (start, end, radius, colour), a box of (centre, sides, colour), a tyre of (radius, tube,
colour) about the y axis; m."""


class Outline(NamedTuple):
    """What is seen of a bicycle: the left grip stands for both, radii are of rear and front wheel; m."""

    saddle: Sequence[float]
    crank_axle: Sequence[float]
    steer_axis: Sequence[float]
    steer_origin: Sequence[float]
    grip: Sequence[float]
    wheelbase: float
    radii: tuple[float, float]
    crank_length: float
    pedal_offset: float


def bicycle_shapes(seen: Outline, rod: Draw, box: Draw, tyre: Draw | None = None) -> dict[str, list[Any]]:
    """Link → shapes in the link's frame; tyres are rings of rods if there is no function for them."""
    saddle, axle, axis, origin, grip = (np.array(part) for part in seen[:5])
    hub, fork = np.array([0.0, 0.0, seen.radii[0]]), np.array([seen.wheelbase, 0.0, seen.radii[1]])
    # where the steering axis passes the saddle's height, a hand above the front tyre, and the height of the hands
    head, crown, middle = (
        origin + axis * (height - origin[2]) / axis[2]
        for height in (saddle[2] - 0.05, 2.0 * seen.radii[1] + 0.06, grip[2])
    )
    clamp = axle + 0.88 * (saddle - axle)
    frame = [
        rod(axle, clamp, 0.017, PAINT),
        rod(clamp, saddle, 0.013, STEEL),
        rod(axle, crown, 0.021, PAINT),
        rod(clamp, head, 0.017, PAINT),
        rod(crown, head, 0.022, PAINT),
        box(np.add(saddle, (0.02, 0.0, 0.015)), (0.27, 0.06, 0.035), RUBBER),
        box(np.add(saddle, (-0.06, 0.0, 0.02)), (0.11, 0.14, 0.035), RUBBER),
    ]
    front = [rod(crown - origin, middle - origin, 0.017, STEEL)]
    crank = [rod((0.0, -0.06, 0.0), (0.0, 0.06, 0.0), 0.02, STEEL)]
    crank.append(rod((0.0, -0.052, 0.0), (0.0, -0.046, 0.0), 0.09, STEEL))
    for sign in (1.0, -1.0):
        side, hand = np.array([0.0, sign * 0.05, 0.0]), grip * (1.0, sign, 1.0) - origin
        frame.append(rod(axle + side, hub + side, 0.010, PAINT))
        frame.append(rod(clamp, hub + side, 0.009, PAINT))
        front.append(rod(crown + side - origin, fork + side - origin, 0.013, STEEL))
        front.append(rod(middle - origin, hand + side, 0.012, STEEL))
        front.append(rod(hand - side, hand + side, 0.018, RUBBER))
        pedal = sign * seen.crank_length
        crank.append(rod((0.0, sign * 0.06, 0.0), (pedal, sign * 0.06, 0.0), 0.011, STEEL))
        crank.append(box((pedal, sign * seen.pedal_offset, 0.0), (0.09, 0.09, 0.02), RUBBER))
    rear, before = (wheel_shapes(radius, rod, tyre) for radius in seen.radii)
    return {"rear_frame": frame, "front_assembly": front, "rear_wheel": rear, "front_wheel": before, "crank": crank}


def wheel_shapes(radius: float, rod: Draw, tyre: Draw | None) -> list[Any]:
    """Tyre, hub and spokes about the y axis."""
    angles = np.linspace(0.0, 2.0 * math.pi, 4 * SPOKES + 1)
    rim = (radius - TUBE) * np.stack([np.cos(angles), 0.0 * angles, np.sin(angles)], axis=1)
    if tyre is None:
        shapes = [rod(one, other, TUBE, RUBBER) for one, other in itertools.pairwise(rim)]
    else:
        shapes = [tyre(radius, TUBE, RUBBER)]
    spokes = [rod(-end, end, 0.003, STEEL) for end in rim[: 2 * SPOKES : 2]]
    return [*shapes, *spokes, rod((0.0, -0.05, 0.0), (0.0, 0.05, 0.0), 0.02, STEEL)]
