r"""Joint angles of a limb whose two ends are known: inverse kinematics, with which the whole-body filter starts.

Axes are the paper's (x forward, y up, z to the right, on both sides); limbs' y points to the proximal joint.
"""

from __future__ import annotations

from typing import Literal

from ...core.backend import Array, expand, namespace
from ...core.rotation import cross, euler_yxy, euler_zxy, norm, normalize


def limb_frame(
    root: Array,
    tip: Array,
    upper: float,
    lower: float,
    outward: Array,
    kind: Literal["arm", "leg"],
    swivel: Array = 0.0,
) -> tuple[Array, Array]:
    """Frame of the upper segment and place of the hinge between the segments.

    With D = |tip − root| and a along it, the hinge lies at root + l₁ (cos A a + sin A (cos σ e + sin σ a × e)), where
    cos A = (l₁² + D² − l₂²) / (2 l₁ D) and e is the part of ``outward`` that is normal to a. A tip out of reach is
    reached for with the straight limb.

    Args:
        root: ``(..., 3)`` proximal joint, m.
        tip: ``(..., 3)`` hand or pedal, m.
        upper: l₁, m.
        lower: l₂ from hinge to tip, m.
        outward: ``(..., 3)`` direction in which elbow or knee stands out.
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
    """Y-X-Y angles Φ ``(..., 3)`` of an upper arm in the trunk, both given as matrices to the bicycle's frame."""
    return euler_yxy(trunk.mT @ frame)


def hip_angles(frame: Array) -> Array:
    """Z-X-Y angles Ψ ``(..., 3)`` of a thigh, given as a matrix to the bicycle's frame."""
    return euler_zxy(frame)
