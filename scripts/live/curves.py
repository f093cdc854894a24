"""Curves beside the picture: errors against the truth, and angles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ...baselines.scoring import with_up
from ...filters.core import metrics, rotation
from ...filters.core.quantity import UP, Quantity

TRUTH = "truth"
"""Label of the truth beside those of estimates."""
Arrays = Mapping[str, np.ndarray]
Curves = dict[str, dict[str, np.ndarray]]
"""What a plot shows → label of the curve → ``(n,)``; angles in degrees."""


def curves_of(truth: Arrays, estimates: Mapping[str, Arrays], outputs: Mapping[str, Sequence[Quantity]]) -> Curves:
    """Errors of the quantities whose truth is known, then angles of truth and estimates; deg where these are angles.

    Truth and estimates hold quantities ``(n, size)``; estimates and their ``outputs`` go by label.
    """
    errors: Curves = {}
    angles: Curves = {}
    truth = with_up(truth)
    for label, estimate in estimates.items():
        pose = with_up(estimate)
        for quantity in {each.name: each for each in (UP, *outputs[label])}.values():
            if quantity.name in pose and quantity.name in truth:
                error = np.asarray(metrics.error(quantity, pose[quantity.name], truth[quantity.name]))
                scale = math.degrees(1.0) if quantity.kind != "vector" else 1.0
                errors.setdefault(_title(quantity), {})[label] = scale * error
        for name, values in angles_of(pose, outputs[label]).items():
            angles.setdefault(name, {})[label] = values
    every = [quantity for each in outputs.values() for quantity in each]
    for name, values in angles_of(truth, every).items():
        if name in angles or not outputs:
            angles[name] = {TRUTH: values, **angles.get(name, {})}
    return errors | angles


def _title(quantity: Quantity) -> str:
    named = "inclination" if quantity.name == UP.name else quantity.name
    unit = "deg" if quantity.kind != "vector" else quantity.unit
    return f"error of {named} ({unit})"


def angles_of(pose: Arrays, outputs: Sequence[Quantity]) -> dict[str, np.ndarray]:
    """Angles of a pose in degrees: roll, pitch and yaw of a device, all angles of a rider."""
    found: dict[str, np.ndarray] = {}
    with np.errstate(invalid="ignore", divide="ignore"):
        turn = next((pose[name] for name in ("orientation", "relative_orientation") if name in pose), None)
        if turn is not None:
            angles: Sequence[np.ndarray] = rotation.to_euler_zyx(np.asarray(turn, float))[::-1]
        else:
            angles = rotation.roll_pitch(np.asarray(pose["up"], float)) if "up" in pose else ()
        for name, values in zip(("roll", "pitch", "yaw"), angles, strict=False):
            found[f"{name} (deg)"] = np.degrees(values)
    for quantity in outputs:
        if quantity.kind == "angle" and quantity.name in pose:
            for index in range(quantity.size):
                name = quantity.name if quantity.size == 1 else f"{quantity.name} {index + 1}"
                found[f"{name} (deg)"] = np.degrees(np.asarray(pose[quantity.name], float)[:, index])
    return found
