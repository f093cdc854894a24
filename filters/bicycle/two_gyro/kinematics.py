r"""Rates of the angles between a platform and a body on it: equations (3) to (15) of the two-gyroscope paper.

Y. Zhang, K. Chen, J. Yi and colleagues, drift-free attitude of a rigid body on a moving platform from two gyroscopes
and relative measurements. The paper's axes are x forward, y to the right, z down. Its two triples of angles follow
different sequences, although it calls both "X-Y-Z ordered". (3) holds for the first sequence only, (11) for the second:

    platform   R_IP = R_z(ψ) R_y(χ) R_x(φ)          roll φ, pitch χ, yaw ψ
    relative   R_PH = R_x(θ₁) R_y(θ₂) R_z(θ₃)        body to platform

With δω^p and δω^h the true rates of platform and body, each in its own axes,

    dθ/dt = A δω^h + M δω^p,    M = −A R_PHᵀ                                              (11), (13)

holds for any motion: model Σ1. While the platform does not pitch, its rate about y follows from the others,
δω^p_y = tan φ δω^p_z (5). Inserting this into M δω^p gives model Σ2 (15), in which the roll is observable:

    dθ/dt = A δω^h + M [δω^p_x, tan φ δω^p_z, δω^p_z],    dφ/dt = δω^p_x                  (8)

The second equation requires χ = 0, not only a constant pitch, because it neglects sin χ dψ/dt. A pitch rate causes an
error of −M_:2 (dχ/dt) / cos φ in the first one. A Segway pitches and does not roll, so δω^p_x = −tan χ δω^p_z (6) and

    dθ/dt = A δω^h + M [−tan χ δω^p_z, δω^p_y, δω^p_z],    dχ/dt = δω^p_y

Both models are singular at θ₂ = ±90°, and Σ2 at φ (or χ) = ±90°. Arrays are ``(*batch, 3)`` and ``(*batch, 3, 3)``.
"""

from __future__ import annotations

from typing import Literal

from ...core.backend import Array, constant, namespace, rows

SIGNS = (1.0, -1.0, -1.0)
"""Signs of x, y, z (and of rotations about them) between these axes and the sensors' (x forward, y left, z up)."""
Platform = Literal["bicycle", "segway"]
"""``bicycle`` rolls and does not pitch, ``segway`` pitches and does not roll."""


def in_paper_axes(rate: Array) -> Array:
    """A rate ``(..., 3)`` in a sensor's axes (x forward, y left, z up) in the paper's (x forward, y right, z down)."""
    return rate * constant(SIGNS, rate)


def platform_rate(sample: Array, tilt: Array | float) -> Array:
    """Rate of the platform ``(..., 3)``, paper's axes, from a gyroscope that is tilted nose up by ``tilt`` (rad)."""
    xp = namespace(sample, tilt)
    angle = tilt + 0.0 * sample[..., 0]
    c, s = xp.cos(angle), xp.sin(angle)
    x, y, z = sample[..., 0], sample[..., 1], sample[..., 2]
    return xp.stack([c * x - s * z, -y, -(s * x + c * z)], axis=-1)


def body_rate_matrix(theta: Array) -> Array:
    """A of (13), from the body's rate to the rates of the relative angles; its determinant is 1 / cos θ₂."""
    xp = namespace(theta)
    c2, s2, c3, s3 = xp.cos(theta[..., 1]), xp.sin(theta[..., 1]), xp.cos(theta[..., 2]), xp.sin(theta[..., 2])
    return rows([[c3 / c2, -s3 / c2, 0.0], [s3, c3, 0.0], [-c3 * s2 / c2, s3 * s2 / c2, 1.0]])


def platform_rate_matrix(theta: Array) -> Array:
    """M = −A R_PHᵀ of (13), from the platform's rate to the rates of the relative angles."""
    xp = namespace(theta)
    c1, s1, c2, s2 = xp.cos(theta[..., 0]), xp.sin(theta[..., 0]), xp.cos(theta[..., 1]), xp.sin(theta[..., 1])
    return rows([[-1.0, -s1 * s2 / c2, c1 * s2 / c2], [0.0, -c1, -s1], [0.0, s1 / c2, -c1 / c2]])


def body_rate_derivative(theta: Array, rate: Array) -> Array:
    """Derivative of A(θ) ``rate`` by θ; column j is the derivative by θ_j."""
    xp = namespace(theta)
    c2, t2 = xp.cos(theta[..., 1]), xp.tan(theta[..., 1])
    c3, s3 = xp.cos(theta[..., 2]), xp.sin(theta[..., 2])
    # A ω = [p / c₂, q, ω₃ − p t₂]; column 1 is zero, since A does not depend on θ₁
    p = c3 * rate[..., 0] - s3 * rate[..., 1]
    q = s3 * rate[..., 0] + c3 * rate[..., 1]
    return rows([[0.0, p * t2 / c2, -q / c2], [0.0, 0.0, p], [0.0, -p / (c2 * c2), q * t2]])


def platform_rate_derivative(theta: Array, rate: Array) -> Array:
    """Derivative of M(θ) ``rate`` by θ; column j is the derivative by θ_j."""
    xp = namespace(theta)
    c1, s1 = xp.cos(theta[..., 0]), xp.sin(theta[..., 0])
    c2, t2 = xp.cos(theta[..., 1]), xp.tan(theta[..., 1])
    # M ω = [−ω₁ − u t₂, −w, u / c₂]; column 3 is zero, since M does not depend on θ₃
    u = s1 * rate[..., 1] - c1 * rate[..., 2]
    w = c1 * rate[..., 1] + s1 * rate[..., 2]
    return rows([[-w * t2, -u / (c2 * c2), 0.0], [u, 0.0, 0.0], [w / c2, u * t2 / c2, 0.0]])


def substitution(angle: Array, platform: Platform) -> Array:
    """S ``(*batch, 3, 2)``: all three platform rates from two, by (5) or (6).

    Args:
        angle: ``(*batch,)`` φ of a bicycle, χ of a Segway.
        platform: the two rates are about x and z for a bicycle, y and z for a Segway; M S is D of (15).
    """
    tangent = namespace(angle).tan(angle)
    if platform == "bicycle":
        return rows([[1.0, 0.0 * tangent], [0.0, tangent], [0.0, 1.0]])
    return rows([[0.0, -tangent], [1.0, 0.0 * tangent], [0.0, 1.0]])


def substitution_derivative(angle: Array, rate: Array, platform: Platform) -> Array:
    """Derivative ``(*batch, 3)`` of S [·, ``rate``] by the angle, with ``rate`` ``(*batch,)`` about z."""
    xp = namespace(angle)
    slope = rate / xp.cos(angle) ** 2
    zero = 0.0 * slope
    if platform == "bicycle":
        return xp.stack([zero, slope, zero], axis=-1)
    return xp.stack([-slope, zero, zero], axis=-1)


def level_constraint(angle: Array, rate: Array) -> tuple[Array, Array, Array]:
    """The expression of (5) that is zero while a bicycle does not pitch: cos φ δω_y − sin φ δω_z.

    Args:
        angle: ``(*batch, 1)`` φ.
        rate: ``(*batch, 3)`` of the platform.

    Returns:
        The value ``(*batch, 1)``, its derivative by the angle ``(*batch, 1)`` and by the rate ``(*batch, 3)``.
    """
    xp = namespace(angle)
    c, s, y, z = xp.cos(angle), xp.sin(angle), rate[..., 1:2], rate[..., 2:]
    return c * y - s * z, -s * y - c * z, xp.concat([0.0 * c, c, -s], axis=-1)
