r"""Products of angular rates ξ(ω), which determine the centripetal accelerations of an array.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval; chapter 2. ω × (ω × r) = Σᵀ ξ with

    ξ = [ω_x², ω_y², ω_z², ω_yω_z, ω_zω_x, ω_xω_y]ᵀ,   Σᵀ = [diag(r) − r 1ᵀ   sm(r)]

Erratum: below (2.11) Σᵀ is transposed. All functions broadcast over leading dimensions and work on
arrays and traced expressions.
"""

from __future__ import annotations

from ..core.backend import Array, namespace, rows


def symmetric(x: Array) -> Array:
    """sm(x) ``(..., 3, 3)``: symmetric, zero diagonal, with sm(x) y = sm(y) x; ``x`` is ``(..., 3)``."""
    a, b, c = x[..., 0], x[..., 1], x[..., 2]
    zero = 0.0 * a
    return rows([[zero, c, b], [c, zero, a], [b, a, zero]])


def products(rate: Array) -> Array:
    """ξ ``(..., 6)`` of the angular rate ``(..., 3)`` in rad/s: squares, then ω_yω_z, ω_zω_x, ω_xω_y, in rad²/s²."""
    xp = namespace(rate)
    x, y, z = rate[..., 0], rate[..., 1], rate[..., 2]
    return xp.stack([x * x, y * y, z * z, y * z, z * x, x * y], axis=-1)


def product_jacobian(rate: Array) -> Array:
    """∂ξ/∂ω ``(..., 6, 3)`` = [2 diag(ω)  sm(ω)]ᵀ at the angular rate ``(..., 3)``."""
    x, y, z = rate[..., 0], rate[..., 1], rate[..., 2]
    zero = 0.0 * x
    squares = [[2.0 * x, zero, zero], [zero, 2.0 * y, zero], [zero, zero, 2.0 * z]]
    return rows([*squares, [zero, z, y], [z, zero, x], [y, x, zero]])


def centripetal(position: Array) -> Array:
    """Σᵀ ``(..., 3, 6)`` of a position ``(..., 3)`` in m: Σᵀ ξ = ω × (ω × r)."""
    x, y, z = position[..., 0], position[..., 1], position[..., 2]
    zero = 0.0 * x
    return rows([[zero, -x, -x, zero, z, y], [-y, zero, -y, z, zero, x], [-z, -z, zero, y, x, zero]])
