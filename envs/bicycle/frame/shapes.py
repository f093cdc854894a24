"""Shapes of a bicycle for rendering, by link."""

from __future__ import annotations

import itertools
import math

import numpy as np

from ...physics.urdf import ball_shape, box_shape, rod_shape
from .parameters import BicycleParameters, WheelParameters

PAINT = (0.75, 0.12, 0.12)
STEEL = (0.55, 0.57, 0.6)
RUBBER = (0.1, 0.1, 0.1)
LEATHER = (0.25, 0.18, 0.12)
SEGMENTS = 28
SPOKES = 6


def wheel_shapes(wheel: WheelParameters) -> list[str]:
    """Tyre as a ring of short rods, and spokes, about the link's y axis."""
    thickness = max(0.014, wheel.crown_radius)
    rim = wheel.radius - thickness
    angles = np.linspace(0.0, 2.0 * math.pi, SEGMENTS + 1)
    points = [(rim * math.cos(angle), 0.0, rim * math.sin(angle)) for angle in angles]
    shapes = [rod_shape(a, b, thickness, RUBBER) for a, b in itertools.pairwise(points)]
    for angle in np.arange(SPOKES) * math.pi / SPOKES:
        end = np.array([rim * math.cos(angle), 0.0, rim * math.sin(angle)])
        shapes.append(rod_shape(-end, end, 0.004, STEEL))
    return [*shapes, rod_shape((0.0, -0.05, 0.0), (0.0, 0.05, 0.0), 0.02, STEEL)]


def bicycle_shapes(bicycle: BicycleParameters) -> dict[str, list[str]]:
    """Link name → shapes in the link's frame."""
    saddle = np.array(bicycle.saddle)
    axle = np.array(bicycle.drive.axle if bicycle.drive is not None else (0.42 * bicycle.wheelbase, 0.0, 0.28))
    hub = np.array([0.0, 0.0, bicycle.rear_wheel.radius])
    axis, origin = bicycle.steer_axis, bicycle.steer_origin
    fork = np.array([bicycle.wheelbase, 0.0, bicycle.front_wheel.radius])
    # where the steering axis passes the saddle's height, and a hand above the front tyre
    head = origin + axis * (saddle[2] - 0.05 - origin[2]) / axis[2]
    crown = origin + axis * (2.0 * bicycle.front_wheel.radius + 0.06 - origin[2]) / axis[2]
    clamp = axle + 0.88 * (saddle - axle)
    side = np.array([0.0, 0.05, 0.0])
    frame = [
        rod_shape(axle, clamp, 0.016, PAINT),
        rod_shape(clamp, saddle, 0.013, STEEL),
        rod_shape(axle, crown, 0.02, PAINT),
        rod_shape(clamp, head, 0.016, PAINT),
        rod_shape(crown, head, 0.02, PAINT),
        box_shape(saddle - (0.02, 0.0, 0.02), (0.26, 0.13, 0.04), LEATHER),
    ]
    for sign in (1.0, -1.0):
        frame += [rod_shape(axle + sign * side, hub + sign * side, 0.01, PAINT)]
        frame += [rod_shape(clamp, hub + sign * side, 0.008, PAINT)]
    left = np.array(bicycle.grip)
    right = left * (1.0, -1.0, 1.0)
    middle = head + axis * (left[2] - head[2]) / axis[2]
    front = [rod_shape(crown - origin, middle - origin, 0.017, STEEL)]
    for sign in (1.0, -1.0):
        front.append(rod_shape(crown + sign * side - origin, fork + sign * side - origin, 0.012, STEEL))
    for grip in (left, right):
        # a straight bar at the height of the hands, reaching a little beyond them
        end = grip + np.array([0.0, math.copysign(0.05, grip[1]), 0.0])
        front += [rod_shape(middle - origin, end - origin, 0.012, STEEL), ball_shape(grip - origin, 0.02, RUBBER)]
    shapes = {
        "rear_frame": frame,
        "front_assembly": front,
        "rear_wheel": wheel_shapes(bicycle.rear_wheel),
        "front_wheel": wheel_shapes(bicycle.front_wheel),
    }
    if bicycle.drive is not None:
        length, offset = bicycle.drive.crank_length, bicycle.drive.pedal_offset
        crank = [rod_shape((0.0, -0.06, 0.0), (0.0, 0.06, 0.0), 0.02, STEEL)]
        for sign in (1.0, -1.0):
            arm = (sign * length, sign * 0.06, 0.0)
            crank.append(rod_shape((0.0, sign * 0.06, 0.0), arm, 0.011, STEEL))
            crank.append(box_shape((sign * length, sign * offset, 0.0), (0.09, 0.09, 0.02), RUBBER))
        shapes["crank"] = crank
    return shapes
