r"""Angular rate from an array of accelerometers alone.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval; chapter 2 and appendix A; equation numbers are the thesis'. The readings â give the angular acceleration α̂ and
the products ξ̂ of angular rates, ẑ = A⁺â, which determine the rate in two ways:

    ω_TI = ω̂_{k−1} + ½ Δt (α̂_{k−1} + α̂_k)                                   time integration (2.15): drifts
    N = sm(ξ̂₂) + diag(ξ̂₁) + (1ᵀξ̂₁) 1,   ω_PR = ± √(λ_max(N)/2) v_max(N)      polynomial roots (2.17): imprecise at rest

with the sign that agrees with ω_TI. The weighted method is ω̂ = D ω_TI + (1 − D) ω_PR, D = diag(w), with weights of
minimum variance (2.48). With covariances divided by σ_a², J = ∂ω_PR/∂ξ and primes for the previous sample,

    J = |ω|⁻² (1 − ¾ ωωᵀ/|ω|²) Ψ,   Ψ = [ω1ᵀ + diag(ω)  sm(ω)],   C = J B_C Jᵀ,   M = Δt J B_TCᵀ
    S = (1 − D') J' B_TCᵀ,   T = ¼ Δt² (2 B_T + B_T D' + D' B_T) + ½ Δt (S + Sᵀ)
    w_i = (C − ½ M)_ii / (Σ' + T − M + C)_ii
    Σ = D (Σ' + T) D + ½ (1 − D) M D + ½ D Mᵀ (1 − D) + (1 − D) C (1 − D)                                        (2.44)

Errata: J has the opposite sign in (2.39); Ψ in (2.41) mixes ω_TI and ω_PR; (2.27), (2.32) and (2.34) omit S, the
correlation of the last estimate with the last ξ̂. The first estimate is known and has no error of α̂, contrary to
w₀ = 1. ``variant`` selects where J is evaluated: ``integrated`` at ω_TI, ``corrected`` at ω_PR as the thesis intends;
``published`` has these errata. Near rest the magnitude of ω_PR does not fall below √|δξ|. J at ω_PR is then too small,
and the weight falls just where ω_PR carries no information; ω_TI has no such lower limit. Weights are clipped to
[0, 1], since values above 1 occur. Where J is not defined (below :data:`SLOWEST`) the weight is 1.

K. Parsa's method (appendix A) corrects ω_TI by one Gauss–Newton step towards ξ̂ and integrates from the result. Its
normal matrix is singular only at ω = 0, not wherever one component vanishes (2.55).

The thesis does not model biases, but they dominate real data: near rest, where the roots carry no information, a
constant error of α̂ is integrated. With ``bias_noise`` above 0 (an addition to the thesis) the weighted method also
estimates it, axis by axis, like a Kalman filter of (ω, β) with Σ as the variance of ω. With p = cov(ω, β), u = var β,

    ω_TI ← ω_TI − Δt β̂,   Σ' ← Σ' + diag(Δt² u − 2 Δt p),   p ← p − Δt u,   u ← u + Δt u₀/τ
    β̂ ← β̂ + k (ω_PR − ω_TI),   k = p / (Σ' + T − M + C)_ii,   u ← u − k p,   p ← w p

Scale and alignment errors are not estimated. The first rate must be known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from ..core.backend import Array, constant, expand, namespace
from ..core.matrices import diagonal_matrix, solve_positive, times
from ..core.model import Recurrence
from ..core.quantity import ANGULAR_RATE, GYROSCOPE, Channel, Measurement, Quantity
from ..support.parameters import check_positive
from .array import OCTA, AccelerometerArray
from .files import ArrayEquations
from .products import product_jacobian, products, symmetric
from .symmetric_matrix import largest_eigenpair

Method = Literal["weighted", "time-integration", "polynomial-roots", "parsa"]
Variant = Literal["integrated", "corrected", "published"]

COVARIANCE = Quantity("angular_rate_covariance", "vector", 9, "rad²/s²")
"""Σ of the weighted method, row-major."""
WEIGHTS = Quantity("array-rate/weights", "vector", 3, "1")
"""w of the weighted method: 1 is time integration, 0 polynomial roots."""

SLOWEST = 1e-4
"""rad/s: below this |ω| polynomial roots are not used"""
RIDGE = 1e-9
"""rad²/s², added to the normal matrix of Parsa's method, which is singular at ω = 0 only"""
UNIT = np.eye(3)


def polynomial_roots(xi: Array) -> Array:
    """ω_PR ``(..., 3)`` from products ξ ``(..., 6)``, up to its sign: the ω that comes closest to ξ (2.17).

    The eigenvector of the largest eigenvalue is the global minimum. Where no eigenvalue is positive, ω_PR is 0.
    """
    xp = namespace(xi)
    trace = xp.sum(xi[..., :3], axis=-1)[..., None, None]
    N = symmetric(xi[..., 3:]) + diagonal_matrix(xi[..., :3]) + trace * constant(UNIT, xi)
    value, vector = largest_eigenpair(N)
    positive = xp.greater(value, 0.0)
    length = xp.sqrt(0.5 * xp.where(positive, value, 1.0 + 0.0 * value))
    return xp.where(positive, length, 0.0 * length)[..., None] * vector


def roots_jacobian(rate: Array) -> Array:
    """J = ∂ω_PR/∂ξ ``(..., 3, 6)`` at exact products of ``rate`` ``(..., 3)``; it grows as 1/|ω|, 0 at rest."""
    xp = namespace(rate)
    square = _square_length(rate)
    Z = constant(UNIT, rate) - 0.75 * rate[..., :, None] * rate[..., None, :] / square
    return Z / square @ xp.concat([rate[..., :, None] + diagonal_matrix(rate), symmetric(rate)], axis=-1)


def published_jacobian(xi: Array, integrated: Array, roots: Array) -> Array:
    """Z⁻¹ Ψ as published in (2.41) and (2.42): wrong sign, at noisy ξ, with both rates in Ψ."""
    xp = namespace(xi)
    square = xp.sum(xi[..., :3] ** 2, axis=-1) + 2.0 * xp.sum(xi[..., 3:] ** 2, axis=-1)
    square = xp.where(xp.greater(square, SLOWEST**4), square, SLOWEST**4 + 0.0 * square)[..., None, None]
    trace = xp.sum(xi[..., :3], axis=-1)[..., None, None]
    Z = 0.75 * (symmetric(xi[..., 3:]) + diagonal_matrix(xi[..., :3])) - trace * constant(UNIT, xi)
    return Z / square @ xp.concat([integrated[..., :, None] + diagonal_matrix(integrated), symmetric(roots)], axis=-1)


def _square_length(rate: Array) -> Array:
    """|ω|² ``(..., 1, 1)``, at least that of :data:`SLOWEST`."""
    xp = namespace(rate)
    square = xp.sum(rate * rate, axis=-1)[..., None, None]
    return xp.where(xp.greater(square, SLOWEST**2), square, SLOWEST**2 + 0.0 * square)


def parsa_step(rate: Array, xi: Array) -> Array:
    """ω + (∂ξ/∂ω)⁺ (ξ̂ − ξ(ω)) ``(..., 3)``, equation (A.4)."""
    K = product_jacobian(rate)
    right = K.mT @ (xi - products(rate))[..., None]
    return rate + solve_positive(K.mT @ K + RIDGE * constant(UNIT, rate), right[..., 0])


@dataclass(frozen=True)
class ArrayRate(ArrayEquations, Recurrence):
    """The weighted method and three others for comparison.

    State: ω (3); for the weighted method also Σ/σ_a² (9), w (3), (S + Sᵀ)/σ_a² (9), β̂ (3), p/σ_a² and u/σ_a² (3 each).
    Where a reading is missing, the last valid readings are integrated.

    Raises:
        ValueError: an unknown method, variant or start, or an array that does not determine α and ξ.
    """

    array: AccelerometerArray = OCTA
    """the accelerometer array; it must have full rank (as OCTA), which requires at least twelve accelerometers"""
    method: Method = "weighted"
    """``polynomial-roots`` takes the sign of its own last value, ``parsa`` and ``weighted`` that of ω_TI"""
    variant: Variant = "integrated"
    """of the weighted method: where J is evaluated, see the module docstring"""
    start: Literal["known", "gyroscope"] = "known"
    """where the first rate comes from: ``initial_rate``, or the first sample of ``imu/gyr``"""
    initial_rate: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """ω₀, rad/s, body axes; from rest by default"""
    initial_noise: float = 0.0
    """standard deviation of ω₀, rad/s; if this and ``bias_noise`` are 0, the rate does not depend on σ_a"""
    accelerometer_noise: float = 0.1
    """σ_a, m/s² per sample: scales the covariance; 0.022 is OCTA's data sheet, 0.1 covers calibration errors"""
    bias_noise: float = 0.1
    """standard deviation of the constant errors of the readings, m/s²; 0 is the thesis' method, without biases"""
    bias_time: float = 4e4
    """s: time in which the biases change by ``bias_noise``"""

    full_outputs: ClassVar[tuple[Quantity, ...]] = (ANGULAR_RATE, COVARIANCE, WEIGHTS)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "accelerometer_noise", "bias_time")
        if self.array.dimension != 3 or self.array.rank < 12:
            raise ValueError(
                f"array {self.array.name!r} must be spatial and of rank 12 to determine the angular rate alone, "
                f"got dimension {self.array.dimension}, rank {self.array.rank}"
            )

    @property
    def channels(self) -> tuple[Channel, ...]:  # type: ignore[override]
        """The readings of the array; the gyroscope too if it gives the first rate."""
        return (self.array.channel, GYROSCOPE) if self.start == "gyroscope" else (self.array.channel,)

    @property
    def outputs(self) -> tuple[Quantity, ...]:  # type: ignore[override]
        """The rate; for the weighted method also its covariance and the weights."""
        return self.full_outputs if self.method == "weighted" else self.full_outputs[:1]

    @property
    def state_size(self) -> int:  # type: ignore[override]
        """Size of the state."""
        return 33 if self.method == "weighted" else 3

    def prior(self, z: Measurement) -> Array:
        """The known rate, w = 1, S = 0; NaN before the first complete readings."""
        a = z[self.array.channel.name]
        xp, zero = namespace(a), 0.0 * a[..., :3]
        start = [zero[..., :1] + expand(value, 1) for value in self.initial_rate]
        rate = z[GYROSCOPE.name] if self.start == "gyroscope" else xp.concat(start, axis=-1)
        rate = xp.where(xp.all(xp.isfinite(a), axis=-1)[..., None], rate, xp.nan)
        if self.method != "weighted":
            return rate
        variance = zero[..., :1] + expand(self.initial_noise**2 / self.accelerometer_noise**2, 1)
        bias = zero + expand(self._bias_ratio(self.bias_noise), 1) * self._spread(a)
        covariance = variance * constant(UNIT.ravel(), a)
        # with w₀ = 1, (2.32) assumes that ω₀ shares the error of α̂₀, but ω₀ is known independently: S₀ cancels this
        none = 0.0 if self.variant == "published" else -expand(self.dt, 1)
        shared = zero[..., :1] + none * constant(self.array.B_T.ravel(), a)
        return xp.concat([rate, covariance, zero + 1.0, shared, zero, zero, bias], axis=-1)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """ω_TI (2.15), and Σ' + T."""
        xp, dt, name = namespace(x), expand(self.dt, 1), self.array.channel.name
        solve = constant(self.array.pseudo_inverse[self.array.blocks["T"]], x)
        rate = x[..., :3] + 0.5 * dt * times(solve, previous[name] + z[name])
        if self.method != "weighted":
            return rate
        B, weights = constant(self.array.B_T, x), x[..., 12:15]
        T = 0.25 * dt**2 * _flat(2.0 * B + B * weights[..., None, :] + weights[..., :, None] * B)
        bias, shared, own = x[..., 24:27], x[..., 27:30], x[..., 30:]
        known = x[..., 3:12] + T + 0.5 * dt * x[..., 15:24] + _flat(diagonal_matrix(dt**2 * own - 2.0 * dt * shared))
        drift = dt * expand(self._bias_ratio(self.bias_noise) / self.bias_time, 1) * self._spread(x)
        return xp.concat([rate - dt * bias, known, x[..., 12:27], shared - dt * own, own + drift], axis=-1)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Combine with polynomial roots; without readings keep the integrated rate."""
        if self.method == "time-integration":
            return x
        xp, a = namespace(x), z[self.array.channel.name]
        there = xp.all(xp.isfinite(a), axis=-1)[..., None]
        a = xp.where(there, a, 0.0 * xp.where(xp.isfinite(a), a, xp.zeros_like(a)))
        xi = times(constant(self.array.pseudo_inverse[self.array.blocks["C"]], x), a)
        rate = x[..., :3]
        if self.method == "parsa":
            return xp.where(there, parsa_step(rate, xi), x)
        roots = polynomial_roots(xi)
        roots = xp.where(xp.less(xp.sum(roots * rate, axis=-1)[..., None], 0.0), -roots, roots)
        if self.method == "polynomial-roots":
            return xp.where(there, roots, x)
        alone = xp.concat([x[..., :12], 1.0 + 0.0 * rate, 0.0 * x[..., 15:24], x[..., 24:]], axis=-1)
        return xp.where(there, self._combine(x, xi, roots), alone)

    def pose(self, x: Array) -> dict[str, Array]:
        """The quantities of ``outputs``."""
        if self.method != "weighted":
            return {ANGULAR_RATE.name: x}
        covariance = expand(self.accelerometer_noise**2, 1) * x[..., 3:12]
        return {ANGULAR_RATE.name: x[..., :3], COVARIANCE.name: covariance, WEIGHTS.name: x[..., 12:15]}

    def _combine(self, x: Array, xi: Array, roots: Array) -> Array:
        """Equations (2.48), (2.14), (2.44), on covariances over σ_a²."""
        xp, rate, dt = namespace(x), x[..., :3], expand(self.dt, 2)
        at = rate if self.variant == "integrated" else roots
        J = published_jacobian(xi, rate, roots) if self.variant == "published" else roots_jacobian(at)
        B_C, B_CT = constant(self.array.B_C, x), constant(self.array.B_TC.T, x)
        # C = J B_C Jᵀ and M = Δt J B_TCᵀ of the module docstring; ``known`` is Σ' + T
        C, JB, known = J @ B_C @ J.mT, J @ B_CT, xp.reshape(x[..., 3:12], (*x.shape[:-1], 3, 3))
        M = dt * JB
        # w_i (2.48): minimum variance per axis, clipped to [0, 1]
        top = _diagonal_of(C) - 0.5 * _diagonal_of(M)
        bottom = _diagonal_of(known - M + C)
        moving = xp.greater(xp.sum(at * at, axis=-1)[..., None], SLOWEST**2)
        usable = xp.logical_and(moving, xp.greater(bottom, 0.0))
        one = 1.0 + 0.0 * rate
        weights = xp.where(usable, top / xp.where(usable, bottom, one), one)
        weights = xp.minimum(xp.maximum(weights, 0.0 * one), one)
        # Σ (2.44) of the mean with these weights, and S for the next sample
        w, v = weights[..., :, None], 1.0 - weights[..., :, None]
        crossed = 0.5 * v * M * w.mT
        covariance = w * known * w.mT + crossed + crossed.mT + v * C * v.mT
        S = 0.0 * JB if self.variant == "published" else v * JB
        fused = weights * rate + (1.0 - weights) * roots
        after = self._correct_bias(x, roots - rate, _diagonal_of(known), xp.where(usable, bottom, 0.0 * one), weights)
        return xp.concat([fused, _flat(covariance), weights, _flat(S + S.mT), *after], axis=-1)

    def _correct_bias(self, x: Array, r: Array, known: Array, bottom: Array, weights: Array) -> tuple[Array, ...]:
        """β̂, p and u after the innovation r of variance ``bottom`` (0: none)."""
        xp, bias, shared, own = namespace(x), x[..., 24:27], x[..., 27:30], x[..., 30:]
        known = xp.maximum(known, 0.0 * known)
        # M and S are first order in the errors: without these two bounds (p² ≤ Σ u, k p ≤ u) u may become negative.
        some = xp.greater(known * own, 0.0)
        largest = xp.where(some, xp.sqrt(xp.where(some, known * own, 1.0 + 0.0 * known)), 0.0 * known)
        shared = xp.minimum(xp.maximum(shared, -largest), largest)
        variance = xp.maximum(bottom, known)
        usable = xp.logical_and(xp.greater(bottom, 0.0), xp.greater(variance, 0.0))
        gain = xp.where(usable, shared / xp.where(usable, variance, 1.0 + 0.0 * variance), 0.0 * shared)
        return bias + gain * r, weights * shared, own - gain * shared

    def _bias_ratio(self, deviation: Array) -> Array:
        return deviation**2 / self.accelerometer_noise**2

    def _spread(self, like: Array) -> Array:
        """Variances of α̂ per unit variance of the readings."""
        return constant(np.diag(self.array.B_T), like)


def _flat(matrix: Array) -> Array:
    return namespace(matrix).reshape(matrix, (*matrix.shape[:-2], 9))


def _diagonal_of(matrix: Array) -> Array:
    return namespace(matrix).stack([matrix[..., i, i] for i in range(3)], axis=-1)
