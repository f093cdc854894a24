r"""Constraints of limbs that end at handlebar and pedals: C1–C3 and C5–C7, angles C4 and C8, and initial angles.

Whole-body paper, equations (11)–(19), in the paper's axes (x forward, y up, z to the right), vectors in the bicycle's
axes. Long axes of limbs point to the proximal joint (ISB): an upper segment of length l ends at −l y from its joint.
Residuals are divided by segment lengths and dimensionless (in metres in the paper).

Differences from the paper: the swivel constraint C7 of the knee is published about the bicycle's upward y axis, where
the swivel is not observable at some crank positions; about the forward x axis it always is. C8 is published with the
small-angle form l_z γ / l_sp of asin(l_z sin γ / l_sp), an error of 7° at γ = 80°.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from ...core.backend import Array, constant, expand, namespace
from ...core.matrices import times
from ...core.rotation import cross, euler_axes, euler_matrix, euler_yxy, euler_zxy, norm, normalize, skew


class Limb(NamedTuple):
    """Constraint residuals of a limb with derivatives by the angles of trunk (arms only) and proximal joint."""

    residuals: Array
    """``(..., 3)`` constraint residuals: length, hinge, swivel; dimensionless"""
    by_trunk: Array | None
    """``(..., 3, 3)`` rows by constraint, columns by trunk angle; None for legs"""
    by_joint: Array
    """``(..., 3, 3)`` likewise by the angles of shoulder or hip"""


def arm(trunk: Array, shoulder: Array, pivot: Array, joint: Array, hand: Array, upper: float, lower: float) -> Limb:
    """C1–C3: the forearm reaches the hand, the elbow is a hinge, the arm's plane contains the bicycle's z (elbows out).

    Args:
        trunk: ``(..., 3)`` Z-X-Y angles Θ of the trunk.
        shoulder: ``(..., 3)`` Y-X-Y angles Φ.
        pivot: ``(3,)`` point about which the trunk rotates, m.
        joint: ``(3,)`` shoulder joint in the trunk's frame from there, m.
        hand: ``(..., 3)`` position of the hand, m.
        upper: length of the upper arm, m.
        lower: elbow to hand, m.
    """
    xp = namespace(trunk, shoulder)
    # matrices to the bicycle's axes, and the rotation axes of the angles: d(R v) = −[R v]× J dΘ
    R, J = euler_matrix("zxy", trunk), euler_axes("zxy", trunk)
    RH, JH = R @ euler_matrix("yxy", shoulder), R @ euler_axes("yxy", shoulder)
    offset = times(R, joint)
    u = expand(-upper, 1) * RH[..., :, 1]
    z = RH[..., :, 2]
    # f: from the hand to the elbow, whose length is the forearm's (C1)
    f = pivot + offset + u - hand
    normal = constant([0.0, 0.0, 1.0], trunk)
    du, dz = (-skew(u) @ JH, -skew(z) @ JH)
    by_joint = _gradients(f, u, z, normal, du, du, dz, upper, lower)
    du, dz = -skew(u) @ J, -skew(z) @ J
    # the trunk moves the shoulder joint; the angles of the shoulder do not
    df = du - skew(offset) @ J
    by_trunk = _gradients(f, u, z, normal, du, df, dz, upper, lower)
    return Limb(xp.stack(_values(f, u, z, normal, upper, lower), axis=-1), by_trunk, by_joint)


def leg(hip: Array, joint: Array, foot: Array, upper: float, lower: float, axis: str) -> Limb:
    """C5–C7: shank and foot reach the pedal, the knee is a hinge, the leg's plane contains an axis of the bicycle.

    Args:
        hip: ``(..., 3)`` Z-X-Y angles Ψ.
        joint: ``(3,)`` hip joint, m.
        foot: ``(..., 3)`` pedal, m.
        upper: length of the thigh, m.
        lower: knee to pedal, m.
        axis: ``"x"`` or ``"y"`` (as published), in the plane of C7.
    """
    xp = namespace(hip)
    R, J = euler_matrix("zxy", hip), euler_axes("zxy", hip)
    u = expand(-upper, 1) * R[..., :, 1]
    z = R[..., :, 2]
    # f: from the pedal to the knee, whose length is that of shank and foot (C5)
    f = joint + u - foot
    normal = constant([1.0, 0.0, 0.0] if axis == "x" else [0.0, 1.0, 0.0], hip)
    du, dz = -skew(u) @ J, -skew(z) @ J
    by_joint = _gradients(f, u, z, normal, du, du, dz, upper, lower)
    return Limb(xp.stack(_values(f, u, z, normal, upper, lower), axis=-1), None, by_joint)


def _values(f: Array, u: Array, z: Array, normal: Array, upper: float, lower: float) -> list[Array]:
    xp = namespace(f)
    hinge = xp.sum(z * f, axis=-1) / lower
    swivel = xp.sum(cross(-u, f) * normal, axis=-1) / (upper * lower)
    return [norm(f)[..., 0] / lower - 1.0, hinge, swivel]


def _gradients(
    f: Array, u: Array, z: Array, normal: Array, du: Array, df: Array, dz: Array, upper: float, lower: float
) -> Array:
    """Derivatives of :func:`_values` by angles: rows d‖f‖, d(z·f), d((−u × f)·n)."""
    xp = namespace(f)

    def by(vector: Array, matrix: Array) -> Array:
        return (vector[..., None, :] @ matrix)[..., 0, :]

    normal = normal + 0.0 * f
    length = by(f, df) / (norm(f) * expand(lower, 1))
    hinge = (by(f, dz) + by(z, df)) / expand(lower, 1)
    swivel = -(by(cross(f, normal), du) + by(cross(normal, u), df)) / expand(upper * lower, 1)
    return xp.stack([length, hinge, swivel], axis=-2)


def _bend(distance: Array, upper: float, lower: float) -> Array:
    """Exterior angle ``(...)`` between two segments whose ends are ``distance`` ``(..., 1)`` apart."""
    xp = namespace(distance)
    cosine = (upper * upper + lower * lower - distance[..., 0] ** 2) / (2.0 * upper * lower)
    one = 1.0 + 0.0 * cosine
    # inaccurate lengths may put the end out of reach: then straight or folded
    cosine = xp.where(xp.greater(cosine, 1.0), one, xp.where(xp.less(cosine, -1.0), -one, cosine))
    return xp.pi - xp.acos(cosine)


def elbow_flexion(trunk: Array, pivot: Array, joint: Array, hand: Array, upper: float, lower: float) -> Array:
    """C4 (14): flexion α ``(...)`` of the elbow, 0 if straight; arguments as for :func:`arm`."""
    reach = pivot + times(euler_matrix("zxy", trunk), joint) - hand
    return _bend(norm(reach), upper, lower)


def knee_flexion(
    joint: Array, foot: Array, upper: float, shank: float, foot_length: float, ankle: float, published: bool = False
) -> Array:
    """C8 (18), (19): flexion β ``(...)`` of the knee, 0 if straight.

    Args:
        joint: ``(3,)`` hip joint, m.
        foot: ``(..., 3)`` pedal, m.
        upper: length of the thigh, m.
        shank: knee to ankle, l_s, m.
        foot_length: ankle to pedal, l_z, m.
        ankle: exterior angle γ of the fixed ankle, 0 with the foot in line with the shank, rad.
        published: with the published small-angle form.
    """
    xp = namespace(foot)
    one = 1.0 + 0.0 * foot[..., 0]
    sine, cosine = foot_length * xp.sin(ankle * one), shank + foot_length * xp.cos(ankle * one)
    lower = xp.sqrt(sine * sine + cosine * cosine)
    turned = foot_length * ankle / lower if published else xp.atan2(sine, cosine)
    return _bend(norm(joint - foot), upper, lower) + turned


# ---- initial angles: inverse kinematics of limbs whose two ends are known -------------------------------------------


def limb_frame(
    root: Array,
    tip: Array,
    upper: float,
    lower: float,
    outward: Array,
    kind: Literal["arm", "leg"],
    swivel: Array = 0.0,
) -> tuple[Array, Array]:
    """Frame of the upper segment and position of the hinge between the segments.

    With D = |tip − root| and a along it, the hinge lies at root + l₁ (cos A a + sin A (cos σ e + sin σ a × e)), where
    cos A = (l₁² + D² − l₂²) / (2 l₁ D) and e is the component of ``outward`` normal to a. For a tip out of reach the
    limb is straight.

    Args:
        root: ``(..., 3)`` proximal joint, m.
        tip: ``(..., 3)`` hand or pedal, m.
        upper: l₁, m.
        lower: l₂ from hinge to tip, m.
        outward: ``(..., 3)`` direction in which elbow or knee points.
        kind: elbows and knees bend in opposite directions.
        swivel: σ about the line from root to tip, rad.

    Returns:
        Matrix ``(..., 3, 3)``, segment to the frame of the arguments, and hinge ``(..., 3)``.
    """
    xp = namespace(root, tip)
    line = tip - root
    distance = norm(line)
    a = line / distance
    out = outward + 0.0 * a
    e = normalize(out - a * xp.sum(a * out, axis=-1, keepdims=True))
    b = cross(a, e)
    upper1, lower1 = expand(upper, 1), expand(lower, 1)
    cosine = (upper1 * upper1 + distance * distance - lower1 * lower1) / (2.0 * upper1 * distance)
    most = 0.999 + 0.0 * cosine
    cosine = xp.where(xp.greater(cosine, most), most, xp.where(xp.less(cosine, -most), -most, cosine))
    sine = xp.sqrt(1.0 - cosine * cosine)
    turn = expand(swivel, 1) + 0.0 * cosine
    u = upper1 * (cosine * a + sine * (xp.cos(turn) * e + xp.sin(turn) * b))
    hinge = root + u
    y = -u / upper1
    z = normalize(cross(u, tip - hinge))
    z = z if kind == "arm" else -z
    return xp.stack([cross(y, z), y, z], axis=-1), hinge


def shoulder_angles(trunk: Array, frame: Array) -> Array:
    """Y-X-Y angles Φ ``(..., 3)`` of an upper arm relative to the trunk, from their matrices to the bicycle."""
    return euler_yxy(trunk.mT @ frame)


def hip_angles(frame: Array) -> Array:
    """Z-X-Y angles Ψ ``(..., 3)`` of a thigh, given as a matrix to the bicycle's frame."""
    return euler_zxy(frame)
