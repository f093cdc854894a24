r"""Strapdown integration of attitude and velocity with its error model, shared by the filters of one moving IMU.

With the samples ω of the gyroscope and f of the accelerometer, which describe the interval that they end,

    q ← q ⊗ exp((ω − b) Δt),   v ← v + Δt (q_mid f q_mid* − g e₃)

where q_mid is the attitude in the middle of the interval. With the error [δθ (world), δb, δv] and R the matrix of q,

    F = [[1, −R Δt, 0], [0, 1, 0], [−[R f]× Δt, 0, 1]],   Q = Δt blkdiag(σ_g² 1, σ_b² 1, σ_a² 1)
"""

from __future__ import annotations

from typing import Any

from ..core.backend import Array, constant, expand, namespace
from ..core.matrices import block_diagonal, block_matrix, identity
from ..core.rotation import exp, multiply, normalize, rotate, skew, to_matrix

UPWARDS = [0.0, 0.0, 1.0]


def advance(q: Array, turn: Array, f: Array, share: Any = 0.5) -> tuple[Array, Array]:
    """Attitude after an interval, and the specific force in the world.

    Args:
        q: attitude before it, ``(..., 4)``, sensor to world.
        turn: rotation vector of the interval ``(..., 3)``, sensor axes, rad.
        f: accelerometer's sample ``(..., 3)``.
        share: fraction of the rotation at the mean time of the accelerometer sample.
    """
    return normalize(multiply(q, exp(turn))), rotate(multiply(q, exp(share * turn)), f)


def accelerated(v: Array, force: Array, dt: Any, gravity: Any) -> Array:
    """Velocity ``(..., 3)`` after an interval with a specific force, both in the world."""
    return v + dt * (force - expand(gravity, 1) * constant(UPWARDS, v))


def transition(q: Array, force: Array, dt: Any, felt: Array, kept: Array) -> Array:
    """F of [δθ, δb, δv], ``(..., 9, 9)``.

    Args:
        q: attitude before the interval, ``(..., 4)``.
        force: specific force in the world, ``(..., 3)``.
        dt: s, with two trailing axes if it is an array.
        felt: ``(..., 1, 1)``, 1 where the velocity was integrated, else 0.
        kept: ``(..., 1, 1)``, 1 where the previous velocity is kept, 0 where it was reset.
    """
    unit = identity(3, q)
    none = 0.0 * unit
    return block_matrix(
        [[unit, -dt * to_matrix(q), none], [none, unit, none], [-felt * dt * skew(force), none, kept * unit]]
    )


def process_noise(turn: Any, bias: Any, velocity: Array) -> Array:
    """Q of [δθ, δb, δv] ``(..., 9, 9)`` from the variances of one interval.

    Args:
        turn: rad², a number or ``(*batch,)``.
        bias: rad²/s², likewise.
        velocity: m²/s², ``(..., 1)``.
    """
    unit = identity(3, velocity)
    return block_diagonal([expand(turn, 2) * unit, expand(bias, 2) * unit, velocity[..., None] * unit])


def corrected(x: Array, dx: Array) -> Array:
    """The state [q, b, v, …] ⊞ [δθ, δb, δv]: the attitude is corrected by a rotation, the rest additively."""
    q = multiply(exp(dx[..., :3]), x[..., :4])
    return namespace(x).concat([q, x[..., 4:10] + dx[..., 3:9], x[..., 10:]], axis=-1)


def clipped_inflation(f: Array, limit: Any, factor: Any) -> Array:
    """Factor on the variance of an increment ``(..., 1)``: ``factor²`` where a component of f exceeds ``limit``."""
    xp = namespace(f)
    clipped = xp.any(xp.greater(xp.abs(f), expand(limit, 1)), axis=-1)[..., None]
    one = 1.0 + 0.0 * f[..., :1]
    return xp.where(clipped, one * expand(factor**2, 1), one)
