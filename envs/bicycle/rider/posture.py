"""Posture of a person on a bicycle: saddle height, trunk flexion, joints, limbs and their masses."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from ....filters.core import rotation
from ..frame.parameters import BicycleParameters, Mass, RigidPart, join
from .anthropometry import RiderBody, hanging
from .limbs import Limb, reach_to, three_turns

SIDES = ("left", "right")
SIGNS = {"left": 1.0, "right": -1.0}
LIMBS = ("arm_left", "arm_right", "leg_left", "leg_right")
SEGMENTS = {"arm": ("upper_arm", "forearm"), "leg": ("thigh", "shank")}
"""of a limb, the upper one first"""

LEG_REACH = 0.955
"""part of the straight leg at the farthest pedal"""
ARM_REACH = 0.84
"""part of the straight arm at the handlebar"""
ANKLE_ANGLE = math.radians(80.0)
"""between the shank's line and the line from ankle to pedal; the papers' γ"""
ANKLE_TO_PEDAL = 0.15
"""m, for a person of the tables' stature"""
HIP_ABOVE_SADDLE = 0.08
"""m, likewise"""
TRUNK_IMU = (-0.10, 0.0, 0.27)
"""m: sixth thoracic vertebra in the trunk frame, likewise"""
HEAD_AHEAD = 0.03
"""m: centre of mass of the head ahead of the trunk's long axis; assumed"""
KNEE_OUT = np.array([1.0, 0.0, 0.0])
POINTS = 49
CRANKS = np.linspace(0.0, 2.0 * math.pi, POINTS)
"""rad at which whatever depends on the crank is tabulated"""
AT_REST = np.zeros(3)
"""Displacement of the pelvis: rad of forward tip and of tip to the right, m off the saddle"""


def segments_of(limb: str) -> tuple[str, str]:
    """Names of a limb's segments, such as ``thigh_left`` and ``shank_left``."""
    kind, side = limb.split("_")
    upper, lower = SEGMENTS[kind]
    return f"{upper}_{side}", f"{lower}_{side}"


def rising_root(function: Callable[[float], float], low: float, high: float, message: str) -> float:
    """Where a rising function passes zero."""
    if not function(low) < 0.0 < function(high):
        raise ValueError(message)
    return float(brentq(function, low, high, xtol=1e-15))


@dataclass(frozen=True)
class Posture:
    """A person fitted to a bicycle; positions in the bicycle frame unless said otherwise, m."""

    body: RiderBody
    bicycle: BicycleParameters
    """with the saddle moved to the person's height"""
    flexion: float
    """rad: forward lean of the trunk"""
    lumbar: np.ndarray
    """(3,) joint between pelvis and trunk; origin of the trunk frame, whose z runs up the trunk"""
    hip: np.ndarray
    """(3,) left hip joint"""
    shoulder: np.ndarray
    """(3,) left shoulder joint, in the trunk frame"""
    arm: Limb
    leg: Limb

    @property
    def trunk_imu(self) -> tuple[float, float, float]:
        """Position of the trunk's IMU in the trunk frame, m."""
        x, y, z = (self.body.scale * part for part in TRUNK_IMU)
        return x, y, z

    @property
    def neck(self) -> tuple[float, float, float]:
        """Joint between trunk and neck, under the cervicale (C7), in the trunk frame, m."""
        return 0.0, 0.0, self._notch + self.body.vertex_height - self.body.crown_height

    @property
    def head_centre(self) -> tuple[float, float, float]:
        """Centre of mass of the head from the joint of the neck, in the head frame, m."""
        return HEAD_AHEAD, 0.0, self.body.crown_height - self.body.segment("head").centre

    @property
    def _notch(self) -> float:
        """Height of the suprasternal notch in the trunk frame, m."""
        upper = sum(self.body.segment(name).length for name in ("middle_trunk", "upper_trunk"))
        return 0.5 * self.body.segment("lower_trunk").length + upper

    def limb(self, name: str) -> Limb:
        """Shape of the limb ``arm_left`` and so on."""
        return self.arm if name.startswith("arm") else self.leg

    def pedal(self, side: str, crank: np.ndarray | float) -> np.ndarray:
        """Pedal ``(..., 3)`` at a crank angle (rad; 0 with the left pedal in front)."""
        drive = self.bicycle.drive
        assert drive is not None
        sign, angle = SIGNS[side], np.asarray(crank, dtype=float)
        along, down = drive.crank_length * np.cos(angle), drive.crank_length * np.sin(angle)
        across = np.full_like(along, drive.pedal_offset)
        return np.array(drive.axle) + sign * np.stack([along, across, -down], axis=-1)

    @property
    def grip_arms(self) -> np.ndarray:
        """Left and right hand ``(2, 3)`` from a point of the steering axis, at straight steering, m."""
        return np.stack([self._grip_arm(side) for side in SIDES])

    @property
    def pedal_arms(self) -> np.ndarray:
        """Left and right pedal ``(2, 3)`` from the crank's axle, with the left one in front, m."""
        assert self.bicycle.drive is not None
        return np.stack([self.pedal(side, 0.0) - np.array(self.bicycle.drive.axle) for side in SIDES])

    def _grip_arm(self, side: str) -> np.ndarray:
        return np.array(self.bicycle.grip) * (1.0, SIGNS[side], 1.0) - self.bicycle.steer_origin

    def grip(self, side: str, steer: np.ndarray | float) -> np.ndarray:
        """Hand's position ``(..., 3)`` at a steering angle (rad, left positive)."""
        origin, axis = self.bicycle.steer_origin, self.bicycle.steer_axis
        angle = np.asarray(steer, dtype=float)[..., None]
        return origin + rotation.rotate(rotation.exp(axis * angle), self._grip_arm(side))

    def elbow_out(self, side: str, trunk: np.ndarray) -> np.ndarray:
        """Direction ``(..., 3)`` in which the elbow points, trunk axes: sideways in the bicycle frame."""
        return rotation.rotate_back(trunk, np.array([0.0, SIGNS[side], 0.0]))

    def moved(self, place: np.ndarray, pelvis: np.ndarray) -> np.ndarray:
        """Where a point of the pelvis is ``(..., 3)`` when that has moved on the saddle.

        Args:
            place: ``(3,)`` at rest, m.
            pelvis: ``(..., 3)`` rad of forward tip and of tip to the right, m off the saddle; of a rider who stands up
                ``(..., 5)``: then m ahead of the saddle and to the left of it.
        """
        saddle, up = np.array(self.bicycle.saddle), pelvis[..., 2:3] * (0.0, 0.0, 1.0)
        moved = saddle + rotation.rotate(two_turns(pelvis), place - saddle + up)
        if pelvis.shape[-1] > len(AT_REST):
            moved = moved + pelvis[..., 3:] @ np.eye(3)[:2]
        return moved

    def arm_target(
        self, side: str, steer: np.ndarray | float, trunk: np.ndarray, pelvis: np.ndarray = AT_REST
    ) -> np.ndarray:
        """Grip from the shoulder ``(..., 3)`` in trunk axes.

        Args:
            side: ``left`` or ``right``.
            steer: rad.
            trunk: ``(..., 4)`` orientation of the trunk in the bicycle.
            pelvis: as of :meth:`moved`.
        """
        shoulder = self.shoulder * (1.0, SIGNS[side], 1.0)
        return rotation.rotate_back(trunk, self.grip(side, steer) - self.moved(self.lumbar, pelvis)) - shoulder

    def leg_target(self, side: str, crank: np.ndarray | float, pelvis: np.ndarray = AT_REST) -> np.ndarray:
        """Pedal from the hip ``(..., 3)`` in bicycle axes; ``pelvis`` as of :meth:`moved`."""
        return self.pedal(side, crank) - self.moved(self.hip * (1.0, SIGNS[side], 1.0), pelvis)

    def pelvis(self) -> Mass:
        """Pelvis in the bicycle frame."""
        segment = self.body.segment("lower_trunk")
        return hanging(segment, self.lumbar + np.array([0.0, 0.0, 0.5 * segment.length]))

    def trunk(self) -> Mass:
        """Trunk above the lumbar joint, and head, in the trunk frame."""
        z = 0.5 * self.body.segment("lower_trunk").length
        parts = []
        for name in ("middle_trunk", "upper_trunk"):
            segment = self.body.segment(name)
            z += segment.length
            parts.append(hanging(segment, np.array([0.0, 0.0, z])))
        parts.append(hanging(self.body.segment("head"), np.array([HEAD_AHEAD, 0.0, z + self.body.vertex_height])))
        return join(parts)

    def segments(self) -> dict[str, Mass]:
        """Upper arm, forearm with hand, thigh, and shank with foot, each in its frame from the proximal joint."""
        body, foot = self.body, self.body.segment("foot")
        forearm, shank = body.segment("forearm"), body.segment("shank")
        wrist = np.array([0.0, 0.0, -forearm.length])
        ankle = np.array([0.0, 0.0, -shank.length])
        tip = np.array([self.leg.tip[0], 0.0, self.leg.tip[1]])
        forward, sideways, along = foot.moments
        # the foot's long axis points forward
        shoe = Mass(foot.mass, ankle + 0.35 * (tip - ankle), np.diag([along, sideways, forward]))
        return {
            "upper_arm": hanging(body.segment("upper_arm"), np.zeros(3)),
            "forearm": join([hanging(forearm, np.zeros(3)), hanging(body.segment("hand"), wrist)]),
            "thigh": hanging(body.segment("thigh"), np.zeros(3)),
            "shank": join([hanging(shank, np.zeros(3)), shoe]),
        }

    def limbs_at(self, crank: float) -> dict[str, Mass]:
        """Arms (in the trunk frame) and legs (in the bicycle frame) at a crank angle, straight steering."""
        trunk, segments, found = self.trunk_orientation(), self.segments(), {}
        for name in LIMBS:
            kind, side = name.split("_")
            flip = np.array([1.0, SIGNS[side], 1.0])
            if kind == "arm":
                root = self.shoulder * flip
                posture = reach_to(self.arm, self.arm_target(side, 0.0, trunk), self.elbow_out(side, trunk))
            else:
                root = self.hip * flip
                posture = reach_to(self.leg, self.leg_target(side, crank), KNEE_OUT)
            upper, lower = (segments[part] for part in SEGMENTS[kind])
            below = placed(lower, root + posture.hinge, posture.lower)
            found[name] = join([placed(upper, root, posture.upper), below])
        return found

    def trunk_orientation(self) -> np.ndarray:
        """The trunk in the bicycle frame ``(4,)`` in the posture at rest."""
        return three_turns(np.array(self.flexion), np.array(0.0), np.array(0.0))

    def load(self) -> RigidPart:
        """The whole rider as a rigid load: the mean of the two level crank positions."""
        trunk, parts = self.trunk_orientation(), [self.pelvis()]
        parts.append(placed(self.trunk(), self.lumbar, trunk))
        for crank in (0.0, math.pi):
            for name, mass in self.limbs_at(crank).items():
                where = placed(mass, self.lumbar, trunk) if name.startswith("arm") else mass
                parts.append(Mass(0.5 * where.mass, where.centre, 0.5 * where.tensor))
        return RigidPart.of(join(parts))


def two_turns(pelvis: np.ndarray) -> np.ndarray:
    """Orientation ``(..., 4)`` of the pelvis in the bicycle from its displacement ``(..., 3)``."""
    return three_turns(pelvis[..., 0], pelvis[..., 1], np.zeros(pelvis.shape[:-1]))


def placed(mass: Mass, origin: np.ndarray, orientation: np.ndarray) -> Mass:
    """The same body seen from another frame, in which its frame has this origin and orientation."""
    R = rotation.to_matrix(orientation)
    return Mass(mass.mass, origin + R @ mass.centre, R @ mass.tensor @ R.T)


def sit(bicycle: BicycleParameters, body: RiderBody) -> Posture:
    """Fit a person: saddle along the seat tube to the leg's length, trunk flexion to the arm's.

    Raises:
        ValueError: the bicycle has no crank, or pedals or handlebar cannot be reached in any reasonable posture.
    """
    if bicycle.drive is None:
        raise ValueError(f"a rider needs pedals: the bicycle {bicycle.name!r} has none")
    scale = body.scale
    forearm, shank = body.segment("forearm"), body.segment("shank")
    foot = ANKLE_TO_PEDAL * scale
    leg = Limb(
        body.segment("thigh").length, (foot * math.sin(ANKLE_ANGLE), -shank.length - foot * math.cos(ANKLE_ANGLE)), 1.0
    )
    arm = Limb(body.segment("upper_arm").length, (0.0, -forearm.length), -1.0)
    axle = np.array(bicycle.drive.axle)
    tube = np.array(bicycle.saddle) - axle
    tube /= np.linalg.norm(tube)
    above = np.array([0.0, body.hip_half_width, HIP_ABOVE_SADDLE * scale])
    pedal = axle + np.array([0.0, bicycle.drive.pedal_offset, 0.0])

    def stretch(height: float) -> float:
        across = axle + height * tube + above - pedal
        # the farthest pedal lies straight beyond the axle, seen from the side
        farthest = math.hypot(math.hypot(across[0], across[2]) + bicycle.drive.crank_length, across[1])  # type: ignore[union-attr]
        return float(farthest / leg.reach - LEG_REACH)

    height = rising_root(
        stretch, 0.35, 1.0, f"{body.name} of {body.stature} m cannot reach the pedals of {bicycle.name!r}"
    )
    saddle = axle + height * tube
    fitted = replace(bicycle, saddle=(float(saddle[0]), 0.0, float(saddle[2])))
    lower = body.segment("lower_trunk").length
    lumbar = saddle + np.array([0.0, 0.0, HIP_ABOVE_SADDLE * scale + 0.5 * lower])
    notch = 0.5 * lower + body.segment("middle_trunk").length + body.segment("upper_trunk").length
    shoulder = np.array([0.0, body.shoulder_half_width, notch - 0.035 * scale])
    posture = Posture(body, fitted, 0.0, lumbar, saddle + above, shoulder, arm, leg)

    def bent(flexion: float) -> float:
        trunk = replace(posture, flexion=flexion).trunk_orientation()
        return float(ARM_REACH - np.linalg.norm(posture.arm_target("left", 0.0, trunk)) / arm.reach)

    message = f"{body.name} of {body.stature} m cannot reach the handlebar of {bicycle.name!r}"
    return replace(posture, flexion=rising_root(bent, math.radians(2.0), math.radians(75.0), message))


def loop_closure_error(truth: Mapping[str, np.ndarray], posture: Posture) -> np.ndarray:
    """Loop-closure errors at hands and feet, from the truth of a ride alone.

    The chain of the limb's orientations leads to the tip, steering and crank angle to the grip or the pedal.

    Args:
        truth: of a ride, quantity → ``(T, size)``.
        posture: the rider of that ride on that bicycle.

    Returns:
        ``(T, 4)`` m: left and right hand, left and right foot. A lumped rider has none (1e-15) unless an arm is too
        short for what the trunk does.
    """
    frame, trunk = truth["bicycle/orientation"], truth["trunk/orientation"]
    steer, crank = truth["bicycle/steer"][:, 0], truth["bicycle/crank"][:, 0]
    relative = rotation.multiply(rotation.conjugate(frame), trunk)
    moved = ("pelvis/angles", "pelvis/height", "pelvis/shift")
    pelvis = np.concatenate([truth[name] for name in moved if name in truth], axis=1)
    errors = []
    for name in LIMBS:
        kind, side = name.split("_")
        limb = posture.limb(name)
        if kind == "arm":
            root, target = trunk, posture.arm_target(side, steer, relative, pelvis)
        else:
            root, target = frame, posture.leg_target(side, crank, pelvis)
        upper, lower = (truth[f"{part}/orientation"] for part in segments_of(name))
        reached = rotation.rotate(upper, np.array([0.0, 0.0, -limb.upper]))
        reached = reached + rotation.rotate(lower, np.array([limb.tip[0], 0.0, limb.tip[1]]))
        errors.append(np.linalg.norm(rotation.rotate_back(root, reached) - target, axis=1))
    return np.stack(errors, axis=1)
