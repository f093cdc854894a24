r"""Complete pose in a vertical plane, from accelerometers alone.

P. He, thesis, Université Laval; section 3.3.5 (see :mod:`.planar.orientation` for frames and symbols). The state
x = [φ, ω, α, p, v, b̈] (p, v, b̈ in the plane's axes) is driven by white jerk: γ turns, β moves,

    F, G: triple integrators with the input held                                                   (3.40), (3.41)
    Q = G diag(σ_γ², σ_β², σ_β²) Gᵀ                                                                  (3.43)
    â = A_P Qᵀ(b̈ − g) + A_T α + A_C ω² + δa,   R = σ_a² 1                                            (3.42)
    H = [A_P dQᵀ/dφ (b̈ − g)   2 A_C ω   A_T   0   0   A_P Qᵀ]

Errata: (3.44) gives R as σ_a² (AᵀA)⁻¹, the covariance of ẑ, although raw readings are compared; (3.45) gives the last
block of H as A_P. ``form`` selects either; on smooth motion both are far less accurate. p and v are not observable from
accelerations, and the sign of ω only through α and φ.

In the thesis' model b̈ is a random walk, which cannot be distinguished from gravity. After the start the angle is only
integrated, and drifts. Here b̈ decays, b̈ ← e^{−λΔt} b̈ (``acceleration_decay`` λ; 0 is the thesis' model), which makes
the angle observable. The standard deviation of b̈ is σ_β Δt / √(1 − e^{−2λΔt}), 5 m/s² for the defaults.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, Literal

import numpy as np

from ...core.backend import Array, constant, expand, namespace, rows
from ...core.matrices import diagonal_matrix, times, vector_of
from ...core.model import Gain, Model, with_parameters
from ...core.quantity import Channel, Measurement, Quantity
from .orientation import PLANAR_ANGLE, PlanarEquations

Form = Literal["corrected", "published-noise", "published-jacobian"]

PLANAR_RATE = Quantity("planar/angular_rate", "vector", 1, "rad/s")
"""dφ/dt."""


CHAINS = ((0, 1, 2), (3, 5, 7), (4, 6, 8))
"""places in the state of a coordinate, its first and its second derivative: of φ, and of p by axis"""
ONCE = sum(np.outer(np.eye(9)[low], np.eye(9)[high]) for chain in CHAINS for low, high in pairwise(chain))
TWICE = sum(np.outer(np.eye(9)[chain[0]], np.eye(9)[chain[2]]) for chain in CHAINS)
PUSHES = [[np.eye(9)[:, [place]] for place in chain] for chain in CHAINS]


@dataclass(frozen=True)
class PlanarPose(PlanarEquations, Model):
    """The extended Kalman filter of the complete pose. ``gyroscope_noise`` and ``inertial_acceleration`` do not matter.

    State: φ, ω, α, p (2), v (2), b̈ (2).
    """

    form: Form = "corrected"
    """``published-noise``: R of (3.44); ``published-jacobian``: H of (3.45)"""
    angular_jerk: float = 300.0
    """σ_γ, rad/s³ per sample (the thesis gives none)"""
    jerk: float = 300.0
    """σ_β, m/s³ per axis and sample (the thesis gives none)"""
    acceleration_decay: float = 20.0
    """λ, 1/s: rate of decay of b̈; 0 is the thesis' model, in which the angle is not observable"""
    rate_prior: float = 1.0
    """standard deviation of the first ω, rad/s"""
    angular_acceleration_prior: float = 10.0
    """standard deviation of the first α, rad/s²"""
    acceleration_prior: float = 1.0
    """standard deviation of the first b̈, m/s² per axis; it also determines that of the first tilt angle"""

    outputs: ClassVar[tuple[Quantity, ...]] = (PLANAR_ANGLE, PLANAR_RATE)
    state_size: ClassVar[int] = 9
    error_size: ClassVar[int] = 9
    gains: ClassVar[dict[str, Gain]] = {
        "turn": Gain("angular_jerk", description="process variance σ_γ²"),
        "move": Gain("jerk", description="process variance σ_β²"),
        "measurement": Gain("accelerometer_noise", description="measurement variance σ_a²"),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.form == "published-noise" and not self.array.size == self.array.rank == 4:
            raise ValueError(
                f"form 'published-noise' fits four accelerometers of rank 4, {self.array.name!r} has {self.array.size} "
                f"of rank {self.array.rank}"
            )

    @property
    def channels(self) -> tuple[Channel, ...]:  # type: ignore[override]
        """Readings of the array."""
        return (self.array.channel,)

    @property
    def residual_size(self) -> int:  # type: ignore[override]
        """Size of the residual."""
        return self.array.size

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """Angle of the start, everything else zero; standard deviations of position and velocity are 1 m and 1 m/s."""
        angle, variance = with_parameters(self, {"inertial_acceleration": self.acceleration_prior}).first(z)
        xp, zero = namespace(angle), 0.0 * angle
        rest = [self.rate_prior, self.angular_acceleration_prior, 1.0, 1.0, 1.0, 1.0, *(self.acceleration_prior,) * 2]
        variances = xp.concat([variance, vector_of([value**2 for value in rest], zero)], axis=-1)
        return xp.concat([angle, *(zero,) * 8], axis=-1), diagonal_matrix(variances)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Equations (3.40), (3.41), (3.43)."""
        dt, one = expand(self.dt, 2), 1.0 + 0.0 * x[..., :1, None]
        kept = namespace(x).exp(-dt * expand(self.acceleration_decay, 2) * one)
        chain = one * constant(np.eye(9), x) + dt * constant(ONCE, x) + 0.5 * dt**2 * constant(TWICE, x)
        F = chain - (1.0 - kept) * constant(np.diag([0.0] * 7 + [1.0] * 2), x)
        G = [
            dt**3 / 6.0 * constant(place[0], x) + 0.5 * dt**2 * constant(place[1], x) + dt * constant(place[2], x)
            for place in PUSHES
        ]
        variances = (self.angular_jerk, self.jerk, self.jerk)
        Q = sum(expand(s**2, 2) * g * g.mT for s, g in zip(variances, G, strict=True)) + 0.0 * F
        return times(F, x), F, Q

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """Readings less the expected ones (3.42), H and R."""
        noise = (
            np.linalg.inv(self.array.A.T @ self.array.A) if self.form == "published-noise" else np.eye(self.array.size)
        )
        R = expand(self.accelerometer_noise**2, 2) * constant(noise, x) + 0.0 * x[..., :1, None]
        return z[self.array.channel.name] - self.expected(x), self.slope(x), R

    def expected(self, x: Array) -> Array:
        """Readings h(x) ``(..., m)``, m/s²."""
        z = namespace(x).concat([self._force(x, self._turn_back(x)), x[..., 2:3], x[..., 1:2] ** 2], axis=-1)
        return times(constant(self.array.A, x), z)

    def slope(self, x: Array) -> Array:
        """Jacobian H of h ``(..., m, 9)``."""
        xp, array = namespace(x), self.array
        A_P, one = constant(array.A_P, x), 1.0 + 0.0 * x[..., :1, None]
        c, s = xp.cos(x[..., 0]), xp.sin(x[..., 0])
        turned = A_P @ self._force(x, rows([[-s, c], [-c, -s]]))[..., None]
        last = A_P @ self._turn_back(x) if self.form != "published-jacobian" else A_P * one
        blocks = [turned, 2.0 * constant(array.A_C, x) * x[..., 1:2, None], constant(array.A_T, x) * one]
        return xp.concat([*blocks, *(0.0 * turned,) * 4, last], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Angle and rate."""
        return {PLANAR_ANGLE.name: x[..., :1], PLANAR_RATE.name: x[..., 1:2]}

    def _turn_back(self, x: Array) -> Array:
        """Qᵀ ``(..., 2, 2)``."""
        xp = namespace(x)
        c, s = xp.cos(x[..., 0]), xp.sin(x[..., 0])
        return rows([[c, s], [-s, c]])

    def _force(self, x: Array, matrix: Array) -> Array:
        """The product matrix (b̈ − g) ``(..., 2)``."""
        up = namespace(x).concat([x[..., 7:8], x[..., 8:9] + expand(self.gravity, 1)], axis=-1)
        return times(matrix, up)
