"""A ride seen in a mirror: left and right of rider and bicycle exchanged.

World and bodies are reflected in their x-z plane, y → −y. Positions, velocities, accelerations and forces change the
sign of y; angular rates and moments, which are axial, those of x and z; quaternions w, x, y, z become w, −x, y, −z.
Everything of the left side is then the right side's. The mirrored ride obeys the same equations; a magnetic field would
not be the Earth's and is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from ...filters.core import rotation
from ..data.trajectory import Trajectory

POLAR = np.array([1.0, -1.0, 1.0])
AXIAL = -POLAR
TURN = np.array([1.0, -1.0, 1.0, -1.0])
Mirror = Callable[[np.ndarray], np.ndarray]


def times(*signs: float) -> Mirror:
    """Factors on the columns."""
    return lambda values: values * np.array(signs)


def swapped(order: tuple[int, ...], *signs: float) -> Mirror:
    """Columns in another order, then with factors."""
    return lambda values: values[:, list(order)] * np.array(signs)


def shoulder(values: np.ndarray) -> np.ndarray:
    """Y-X-Y angles: a reflection changes all signs, and half a turn brings the elevation back below zero."""
    first, elevation, last = values.T
    return np.stack([rotation.wrap(math.pi - first), elevation, rotation.wrap(-math.pi - last)], axis=1)


def crank(values: np.ndarray) -> np.ndarray:
    """The crank's angle counts from the left pedal in front."""
    return np.asarray(rotation.wrap(values + math.pi))


def joints(values: np.ndarray) -> np.ndarray:
    """Trunk y, x, z, then arm left, arm right, leg left, leg right with y, x, z, hinge; of a lumped rider the trunk."""
    trunk = values[:, :3] * (1.0, -1.0, -1.0)
    if values.shape[1] == 3:
        return trunk
    limbs = values[:, 3:].reshape(-1, 4, 4)[:, [1, 0, 3, 2]] * (1.0, -1.0, -1.0, 1.0)
    return np.concatenate([trunk, limbs.reshape(-1, 16)], axis=1)


POLAR_VECTOR, AXIAL_VECTOR, SAME, OPPOSITE = times(*POLAR), times(*AXIAL), times(1.0), times(-1.0)
ISB = times(1.0, -1.0, -1.0)
MIRRORS: dict[str, Mirror] = {
    "gyr": AXIAL_VECTOR,
    "acc": POLAR_VECTOR,
    "gyroscope_bias": AXIAL_VECTOR,
    "accelerometer_bias": POLAR_VECTOR,
    "orientation": times(*TURN),
    "orientation_bias": AXIAL_VECTOR,
    "angular_rate": AXIAL_VECTOR,
    "lever_arm": POLAR_VECTOR,
    "rotation": times(*TURN),
    **dict.fromkeys(("position", "velocity", "acceleration", "force", "force_left", "force_right"), POLAR_VECTOR),
    "moment": AXIAL_VECTOR,
    "seat/wrench": times(*POLAR, *AXIAL),
    "seat/load_cells": swapped((0, 2, 1), 1.0, 1.0, 1.0),
    "handlebar/force": swapped((3, 4, 5, 0, 1, 2), *POLAR, *POLAR),
    "relative/distances": swapped((1, 0, 2), 1.0, 1.0, 1.0),
    **dict.fromkeys(("wheel/speed", "bicycle/speed", "bicycle/pitch", "wheel/rate", "wheel/angle", "crank/rate"), SAME),
    **dict.fromkeys(("steer/angle", "bicycle/roll", "bicycle/yaw", "bicycle/steer", "steer/rate"), OPPOSITE),
    **dict.fromkeys(("crank/angle", "bicycle/crank"), crank),
    **dict.fromkeys(("trunk/angles", "hip_left/angles", "hip_right/angles"), ISB),
    **dict.fromkeys(("shoulder_left/angles", "shoulder_right/angles"), shoulder),
    "pelvis/angles": times(1.0, -1.0),
    "pelvis/shift": times(1.0, -1.0),
    **dict.fromkeys(("flexion", "pelvis/height"), SAME),
    "joints/angles": joints,
    "joints/torques": joints,
}
"""Name of a channel or quantity, or its last part → what a mirror makes of its values ``(T, size)``."""


def mirrored(ride: Trajectory) -> Trajectory:
    """The ride with left and right exchanged; twice gives the ride back.

    Biases of sensors other than inertial ones are left out: they are those of one draw, see :func:`.redrawn`.

    Raises:
        ValueError: a channel or quantity whose mirror image is not known, a magnetometer's among them.
    """
    truth = {
        name: values
        for name, values in ride.truth.items()
        if not name.endswith("_bias") or name.rpartition("/")[2] in MIRRORS
    }
    metadata = ride.metadata | {"mirrored": not ride.metadata.get("mirrored", False)}
    return ride.replace(measurements=reflected(ride.measurements), truth=reflected(truth), metadata=metadata)


def reflected(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Mirror images by name, in the order of ``arrays``."""
    images = {}
    for name, values in arrays.items():
        mirror = MIRRORS.get(name, MIRRORS.get(name.rpartition("/")[2]))
        if mirror is None:
            raise ValueError(f"the mirror image of {name!r} is not known")
        images[other_side(name)] = mirror(values)
    return {name: images[name] for name in arrays if name in images}


def other_side(name: str) -> str:
    """The name with left and right exchanged."""
    for one, other in (("left", "right"), ("right", "left")):
        if f"_{one}" in name:
            return name.replace(f"_{one}", f"_{other}")
    return name
