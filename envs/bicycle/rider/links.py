"""The rider's links on the bicycle's tree, and their shapes."""

from __future__ import annotations

import numpy as np

from ...physics.urdf import Tree, ball_shape, box_shape, rod_shape
from ..frame.parameters import Mass, join
from .posture import LIMBS, SEGMENTS, SIGNS, Posture, segments_of

PIVOT_MASS, PIVOT_INERTIA = 1e-3, (1e-4, 1e-4, 1e-4)
"""kg, kg·m² of the links between two of a joint's three axes: negligible"""
SHIRT, TROUSERS, SKIN, SHOE = (0.15, 0.35, 0.65), (0.18, 0.18, 0.22), (0.85, 0.65, 0.52), (0.1, 0.1, 0.1)
AXES = {"y": (0.0, 1.0, 0.0), "x": (1.0, 0.0, 0.0), "z": (0.0, 0.0, 1.0)}
SEAT_JOINTS = ("pelvis_y", "pelvis_x", "pelvis")
"""the pelvis tips forwards and to the right about the saddle point, and rises off it"""
SLIDES = ("pelvis_along", "pelvis_across")
"""the pelvis of a rider who stands up also moves along and across the bicycle"""
TRUNK_JOINTS = ("trunk_y", "trunk_x", "trunk")
LUMPED_MASSES = ("pelvis", "trunk")


def limb_joints(limb: str) -> tuple[str, str, str, str]:
    """Names of the links below a limb's four joints, such as ``thigh_left_y``, …, ``shank_left``."""
    upper, lower = segments_of(limb)
    return f"{upper}_y", f"{upper}_x", upper, lower


def segment_links() -> tuple[str, ...]:
    """Names of the links that carry the rider's mass, pelvis first."""
    return "pelvis", "trunk", *(name for limb in LIMBS for name in limb_joints(limb)[2:])


def _three_joints(tree: Tree, parent: str, child: str, origin: np.ndarray, mass: Mass, shapes: list[str]) -> None:
    """Attach a link by three joints about y, x and z with a common centre."""
    for axis in ("y", "x"):
        tree.link(f"{child}_{axis}", PIVOT_MASS, PIVOT_INERTIA, (0.0, 0.0, 0.0))
        tree.joint(parent, f"{child}_{axis}", origin, AXES[axis])
        parent, origin = f"{child}_{axis}", np.zeros(3)
    tree.link(child, mass.mass, mass.tensor, mass.centre, shapes)
    tree.joint(parent, child, origin, AXES["z"])


def _seat(tree: Tree, posture: Posture, pelvis: Mass, slides: bool) -> None:
    """Set a pelvis (in the bicycle frame) on the saddle; its link frame begins at the saddle point."""
    parent, origin = "rear_frame", np.array(posture.bicycle.saddle)
    for name, axis in zip(SLIDES, "xy", strict=True) if slides else ():
        tree.link(name, PIVOT_MASS, PIVOT_INERTIA, (0.0, 0.0, 0.0))
        tree.joint(parent, name, origin, AXES[axis], slides=True)
        parent, origin = name, np.zeros(3)
    for name, axis in zip(SEAT_JOINTS[:2], "yx", strict=True):
        tree.link(name, PIVOT_MASS, PIVOT_INERTIA, (0.0, 0.0, 0.0))
        tree.joint(parent, name, origin, AXES[axis])
        parent, origin = name, np.zeros(3)
    centre = pelvis.centre - posture.bicycle.saddle
    tree.link("pelvis", pelvis.mass, pelvis.tensor, centre, pelvis_shapes(posture))
    tree.joint(parent, "pelvis", origin, AXES["z"], slides=True)


def add_full_rider(tree: Tree, posture: Posture, slides: bool) -> None:
    """Pelvis that rests on the saddle, trunk, and four limbs whose ends are still free; ``slides``: :data:`SLIDES`."""
    segments, saddle = posture.segments(), np.array(posture.bicycle.saddle)
    _seat(tree, posture, posture.pelvis(), slides)
    _three_joints(tree, "pelvis", "trunk", posture.lumbar - saddle, posture.trunk(), trunk_shapes(posture))
    shapes = limb_shapes(posture)
    for name in LIMBS:
        kind, side = name.split("_")
        flip = np.array([1.0, SIGNS[side], 1.0])
        upper, lower = SEGMENTS[kind]
        parent, root = ("trunk", posture.shoulder) if kind == "arm" else ("pelvis", posture.hip - saddle)
        _three_joints(tree, parent, f"{upper}_{side}", root * flip, segments[upper], shapes[upper])
        mass = segments[lower]
        tree.link(f"{lower}_{side}", mass.mass, mass.tensor, mass.centre, shapes[lower])
        below = np.array([0.0, 0.0, -posture.limb(name).upper])
        tree.joint(f"{upper}_{side}", f"{lower}_{side}", below, AXES["y"])


def add_lumped_rider(tree: Tree, posture: Posture, slides: bool) -> None:
    """Pelvis with the legs at rest, and trunk with the arms at rest; ``slides``: :data:`SLIDES`."""
    limbs = [posture.limbs_at(crank) for crank in (0.0, np.pi)]

    def mean(kind: str) -> list[Mass]:
        found = [mass for each in limbs for name, mass in each.items() if name.startswith(kind)]
        return [Mass(0.5 * mass.mass, mass.centre, 0.5 * mass.tensor) for mass in found]

    pelvis = join([posture.pelvis(), *mean("leg")])
    _seat(tree, posture, pelvis, slides)
    trunk = join([posture.trunk(), *mean("arm")])
    lumbar = posture.lumbar - posture.bicycle.saddle
    _three_joints(tree, "pelvis", "trunk", lumbar, trunk, trunk_shapes(posture))


def pelvis_shapes(posture: Posture) -> list[str]:
    """Hips, in the pelvis frame."""
    hip, lumbar = (place - posture.bicycle.saddle for place in (posture.hip, posture.lumbar))
    below = lumbar - np.array([0.0, 0.0, 0.02])
    return [rod_shape(hip, hip * (1.0, -1.0, 1.0), 0.085, TROUSERS), ball_shape(below, 0.11, TROUSERS)]


def trunk_shapes(posture: Posture) -> list[str]:
    """Chest, shoulders, neck and head, in the trunk frame."""
    left, scale = posture.shoulder, posture.body.scale
    top = np.array([0.03, 0.0, left[2] + posture.body.vertex_height + 0.03])
    return [
        rod_shape((0.0, 0.0, 0.0), (0.0, 0.0, left[2] - 0.05), 0.115 * scale, SHIRT),
        rod_shape(left, left * (1.0, -1.0, 1.0), 0.06 * scale, SHIRT),
        box_shape((0.0, 0.0, 0.72 * left[2]), (0.17 * scale, 0.30 * scale, 0.5 * left[2]), SHIRT),
        rod_shape((0.0, 0.0, left[2]), top - np.array([0.0, 0.0, 0.15]), 0.05, SKIN),
        ball_shape(top - np.array([0.0, 0.0, 0.11]), 0.105, SKIN),
        box_shape(posture.trunk_imu, (0.02, 0.04, 0.06), (0.9, 0.5, 0.1)),
    ]


def limb_shapes(posture: Posture) -> dict[str, list[str]]:
    """Segment name → shapes in its frame."""
    arm, leg, shank = posture.arm, posture.leg, posture.body.segment("shank")
    ankle, pedal = np.array([0.0, 0.0, -shank.length]), np.array([leg.tip[0], 0.0, leg.tip[1]])
    sole = pedal - ankle
    return {
        "upper_arm": [
            rod_shape((0.0, 0.0, 0.0), (0.0, 0.0, -arm.upper), 0.045, SHIRT),
            ball_shape((0.0, 0.0, -arm.upper), 0.045, SKIN),
        ],
        "forearm": [rod_shape((0.0, 0.0, 0.0), (0.0, 0.0, arm.tip[1]), 0.035, SKIN),
                    ball_shape((0.0, 0.0, arm.tip[1]), 0.045, SKIN)],
        "thigh": [
            rod_shape((0.0, 0.0, 0.0), (0.0, 0.0, -leg.upper), 0.07, TROUSERS),
            ball_shape((0.0, 0.0, -leg.upper), 0.065, TROUSERS),
        ],
        "shank": [
            rod_shape((0.0, 0.0, 0.0), ankle, 0.05, SKIN),
            rod_shape(ankle - 0.2 * sole, pedal + 0.25 * sole, 0.035, SHOE),
            ball_shape(ankle, 0.05, SHOE),
        ],
    }  # fmt: skip
