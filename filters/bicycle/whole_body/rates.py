r"""Rates of the Euler angles of trunk, hips and shoulders from gyroscopes on both sides of the joint.

Whole-body paper, equations (6), (10) and (15), as published. Erratum: the gyroscope model (5) that they invert has
:math:`R_y^T(\phi)` instead of :math:`R_y^T(\theta_3)` and the yaw rate on the wrong axis. Axes are the paper's (and the
ISB's): x forward, y up, z to the right. With w the child's rate in its own axes and q the parent's in the parent's,

    ė = M(e) w + G(e) q

Trunk and hips turn about Z-X-Y, shoulders about Y-X-Y; singular at a second angle of ±90° and of 0 or 180°.
"""

from __future__ import annotations

from typing import NamedTuple

from ...core.backend import Array, expand, namespace, rows


class Rates(NamedTuple):
    """Rates of three angles and their derivatives."""

    rates: Array
    """``(..., 3)`` rad/s"""
    by_angles: Array
    """``(..., 3, 3)`` derivative by the angles, 1/s"""
    by_child: Array
    """M ``(..., 3, 3)``, derivative by the child's rate"""
    by_parent: Array
    """G ``(..., 3, 3)``, derivative by the parent's rate"""


def zxy_rates(angles: Array, child: Array, parent: Array) -> Rates:
    """Equations (6) of the trunk and (15) of the hips.

    Args:
        angles: ``(..., 3)`` Z-X-Y angles of the child in the parent, rad.
        child: ``(..., 3)`` absolute rate of the child, its axes, rad/s.
        parent: ``(..., 3)`` absolute rate of the parent, its axes, rad/s.
    """
    xp = namespace(angles)
    s, c = xp.sin(angles), xp.cos(angles)
    s1, s2, s3, c1, c2, c3 = (*(s[..., i] for i in range(3)), *(c[..., i] for i in range(3)))
    t2 = s2 / c2
    # the child's rate rotated back by the third angle (k about the first axis, n about the second), the parent's
    # rotated by the first (m, p); then ė of (6) and its derivatives by the angles, child's rate (M) and parent's (G)
    k, n = -s3 * child[..., 0] + c3 * child[..., 2], c3 * child[..., 0] + s3 * child[..., 2]
    m, p = s1 * parent[..., 0] - c1 * parent[..., 1], c1 * parent[..., 0] + s1 * parent[..., 1]
    rates = xp.stack([k / c2 - m * t2 - parent[..., 2], n - p, child[..., 1] - t2 * k + m / c2], axis=-1)
    by_angles = rows(
        [[-p * t2, k * t2 / c2 - m / (c2 * c2), -n / c2], [m, 0.0, k], [p / c2, -k / (c2 * c2) + m * t2 / c2, t2 * n]]
    )
    by_child = rows([[-s3 / c2, 0.0, c3 / c2], [c3, 0.0, s3], [t2 * s3, 1.0, -t2 * c3]])
    by_parent = rows([[-t2 * s1, t2 * c1, -1.0], [-c1, -s1, 0.0], [s1 / c2, -c1 / c2, 0.0]])
    return Rates(rates, by_angles, by_child, by_parent)


def yxy_rates(angles: Array, child: Array, parent: Array) -> Rates:
    """Equation (10) of the shoulders; arguments as for :func:`zxy_rates`, angles Y-X-Y."""
    xp = namespace(angles)
    s, c = xp.sin(angles), xp.cos(angles)
    s1, s2, s3, c1, c2, c3 = (*(s[..., i] for i in range(3)), *(c[..., i] for i in range(3)))
    cot = c2 / s2
    # as above for Y-X-Y: k and n of the child's rate, m and p of the parent's; ė of (10) and its derivatives
    k, n = s3 * child[..., 0] - c3 * child[..., 2], c3 * child[..., 0] + s3 * child[..., 2]
    m, p = s1 * parent[..., 0] + c1 * parent[..., 2], c1 * parent[..., 0] - s1 * parent[..., 2]
    rates = xp.stack([k / s2 + m * cot - parent[..., 1], n - p, child[..., 1] - k * cot - m / s2], axis=-1)
    by_angles = rows(
        [[p * cot, -(k * c2 + m) / (s2 * s2), n / s2], [m, 0.0, -k], [-p / s2, (k + m * c2) / (s2 * s2), -n * cot]]
    )
    by_child = rows([[s3 / s2, 0.0, -c3 / s2], [c3, 0.0, s3], [-s3 * cot, 1.0, c3 * cot]])
    by_parent = rows([[cot * s1, -1.0, cot * c1], [-c1, 0.0, s1], [-s1 / s2, 0.0, -c1 / s2]])
    return Rates(rates, by_angles, by_child, by_parent)


RATES = {"zxy": zxy_rates, "yxy": yxy_rates}


def advance(sequence: str, angles: Array, child: Array, parent: Array, dt: float) -> tuple[Array, Array, Rates]:
    """One step of the midpoint rule with constant rates, and its exact derivative.

    Args:
        sequence: ``"zxy"`` or ``"yxy"``.
        angles: ``(..., 3)`` at the beginning, rad.
        child: ``(..., 3)`` mean rate of the child, rad/s.
        parent: ``(..., 3)`` mean rate of the parent, rad/s.
        dt: s.

    Returns:
        Angles at the end, the derivative ``(..., 3, 3)`` of these by those at the beginning, and the rates in the
        middle.
    """
    function = RATES[sequence]
    first = function(angles, child, parent)
    middle = function(angles + expand(0.5 * dt, 1) * first.rates, child, parent)
    # derivative of e + Δt f(e + Δt/2 f(e)): 1 + Δt f'(middle) (1 + Δt/2 f'(e))
    unit = rows([[1.0 + 0.0 * angles[..., 0], 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    half = unit + expand(0.5 * dt, 2) * first.by_angles
    return angles + expand(dt, 1) * middle.rates, unit + expand(dt, 2) * middle.by_angles @ half, middle
