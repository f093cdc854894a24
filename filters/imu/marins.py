r"""Quaternion by Gauss–Newton from accelerometer and magnetometer, then a Kalman filter with the gyroscope.

J. L. Marins, X. Yun, E. R. Bachmann, R. B. McGhee, M. J. Zyda, "An Extended Kalman Filter for Quaternion-Based
Orientation Estimation Using MARG Sensors", IROS 2001, in the form in which P. He compares with it (thesis, Université
Laval, section 5.1.12; equation numbers are the thesis').

First step: with the unit vectors y_F = [vertical, field] in the world, y_B in the sensor's axes, and the matrix of a
quaternion of any length M(q) = (w² − u·u) 1 + 2 u uᵀ + 2 w [u]× (5.40), four steps of

    ε = y_F − [M y_B1; M y_B2],   J = −∂[M y_B]/∂q,   q ← q − (JᵀJ)⁻¹ Jᵀ ε             (5.41)–(5.43)

from the predicted quaternion. The result is normalised and has the sign of the prediction. Both vectors have the same
weight, so an acceleration of the hand affects the result as much as the field does.

Second step: a Kalman filter with the state [ω; q] that measures both (5.47),

    ω̇ = (−ω + w) / τ,  w white noise,     q̇ = ½ q ⊗ [0; ω]                             (5.45), (5.46)

discretised exactly for ω: φ = e^(−Δt/τ), variance σ_Ω² (1 − φ²) with the stationary standard deviation σ_Ω;
q is rotated by the rotation vector Δt ω.

Errata: (5.45) is driven by the angular rate itself instead of white noise, and (5.46) multiplies by a scalar-first
[0; ω] where q has its scalar last. The vertical points *up*, since an accelerometer at rest reads +g upwards.
Quaternions are scalar-first here, and the world is x east, y north, z up.

The thesis gives neither τ nor noises. Accuracy depends strongly on σ_q. At 0.01 the filter trusts the first step and
has the large errors that the thesis reports. At 0.5, which corresponds to the effect of an acceleration of 5 m/s² on
the first step, it is comparable to the filter of the thesis in a horizontal field. In a steep field the two vectors are
nearly antiparallel, and their inconsistency leaves a bias.

The gyroscope bias is not estimated. Disturbed fields and sustained accelerations affect the estimate directly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from ..core.backend import Array, constant, expand, namespace
from ..core.matrices import block_diagonal, block_matrix, covariance_of, identity, solve_positive, times, vector_of
from ..core.model import Gain, Model, checked_quaternion
from ..core.quantity import (
    ACCELEROMETER,
    ANGULAR_RATE,
    GYROSCOPE,
    MAGNETOMETER,
    ORIENTATION,
    UP,
    Channel,
    Measurement,
    Quantity,
)
from ..core.rotation import cross, exp, multiply, normalize, rotate, rotate_back, up_in_body
from ..support.parameters import check_positive
from .magnetic_heading import align, field_direction, known

STEPS = 4
"""Number of Gauss–Newton steps; the thesis uses 3 to 4."""


@dataclass(frozen=True)
class Marins(Model):
    """Reference method of the thesis: a quaternion from two vectors, then a Kalman filter with a linear measurement.

    State: ω (3), q (4), unit field in the world (3). The error state is the first seven, additive. The
    first step is skipped where a sample of accelerometer or magnetometer is missing.

    Raises:
        ValueError: an unknown start or field, a start that is not a unit quaternion, or a standard deviation or time
            constant that is not positive.
    """

    start: Literal["samples", "given"] = "samples"
    """``samples``: at rest, from the first samples; ``given``: :attr:`start_orientation`"""
    field: Literal["start", "given"] = "start"
    """``start``: the dip is that of the first samples; ``given``: :attr:`dip`"""
    quaternion_std: float = 0.5
    """σ_q of each element of the first step's quaternion; 0.01 trusts the first step, 0.5 covers 5 m/s²"""
    gyroscope_std: float = 0.1
    """σ_ω, rad/s per sample (section 5.3.2)"""
    rate_std: float = 3.0
    """σ_Ω, rad/s: of the angular rate of the motion"""
    rate_time: float = 0.5
    """τ, s; the thesis gives none"""
    orientation_prior: float = 0.05
    """standard deviation of each element of the quaternion at the start"""
    start_orientation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    """unit quaternion, sensor to world, if the start is given"""
    declination: float = 0.0
    """of the magnetic field, rad, positive east"""
    dip: float = 0.0
    """below the horizontal, rad, if the field is given"""

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER, MAGNETOMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (ORIENTATION, UP, ANGULAR_RATE)
    state_size: ClassVar[int] = 10
    error_size: ClassVar[int] = 7
    residual_size: ClassVar[int] = 7
    gains: ClassVar[dict[str, Gain]] = {
        "process": Gain("rate_std", description="process variance σ_Ω² of the angular rate"),
        "measurement": Gain("quaternion_std", description="variance σ_q² of the first step"),
    }

    def __post_init__(self) -> None:
        """Check the start and the positive parameters."""
        super().__post_init__()
        object.__setattr__(self, "start_orientation", checked_quaternion("start_orientation", self.start_orientation))
        check_positive(self, "quaternion_std", "gyroscope_std", "rate_std", "rate_time")

    @property
    def supposed_field(self) -> int:
        """The unit field in the world, unless it is given."""
        return 7 if self.field == "start" else -1

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """At rest: inclination from the accelerometer, heading from the field; ω₀ is the gyroscope's sample."""
        xp, field, rate = namespace(z["imu/mag"]), z["imu/mag"], z["imu/gyr"]
        q = align(z["imu/acc"], field, self.declination)
        if self.start == "given":
            q = 0.0 * q + vector_of(self.start_orientation, 0.0 * q[..., :1])
        world = rotate(q, normalize(field))
        if self.field == "given":
            world = field_direction(self.declination, self.dip, q)
        x = xp.concat([rate, q, world], axis=-1)
        deviations = [self.gyroscope_std] * 3 + [self.orientation_prior] * 4
        return x, covariance_of(deviations, 0.0 * x[..., :1])

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Equations (5.45), (5.46), corrected."""
        xp = namespace(x)
        rate, q = x[..., :3], x[..., 3:7]
        turn = expand(self.dt, 1) * rate
        turned = multiply(q, exp(turn))
        zero = 0.0 * x[..., :1]
        decay = xp.exp(zero - expand(self.dt / self.rate_time, 1))
        # a change of ω acts in the middle of the rotation: exact to second order in Δt ω
        half = exp(0.5 * turn)
        axes = (multiply(multiply(multiply(q, half), _basis(index, q)), half) for index in (1, 2, 3))
        lever = _columns([0.5 * expand(self.dt, 1) * axis for axis in axes])
        right = _columns([multiply(_basis(index, q), exp(turn)) for index in range(4)])
        three, none = identity(3, x), 0.0 * lever
        F = block_matrix([[decay[..., None] * three, none.mT], [lever, right]])
        power = expand(self.rate_std**2, 1) * (1.0 - decay * decay)
        Q = block_diagonal([power[..., None] * three, 0.0 * right])
        return xp.concat([decay * rate, turned, x[..., 7:]], axis=-1), F, Q

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """State measured directly (5.47): the gyroscope, and the quaternion of the first step."""
        xp, q, world = namespace(x), x[..., 3:7], x[..., 7:10]
        up = constant([0.0, 0.0, 1.0], x) + 0.0 * world
        (force, there), (field, also) = known(z["imu/acc"]), known(z["imu/mag"])
        complete = xp.logical_and(there, also)
        # expected vectors replace missing samples, because parallel vectors have no solution
        force = normalize(xp.where(complete, force, rotate_back(normalize(q), up)))
        field = normalize(xp.where(complete, field, rotate_back(normalize(q), world)))
        found = solve_orientation(normalize(q), (up, world), (force, field))
        r = xp.concat([z["imu/gyr"] - x[..., :3], xp.where(complete, found - q, xp.nan + 0.0 * q)], axis=-1)
        deviations = [self.gyroscope_std] * 3 + [self.quaternion_std] * 4
        return r, identity(7, x), covariance_of(deviations, 0.0 * x[..., :1])

    def retract(self, x: Array, dx: Array) -> Array:
        """Additive."""
        return namespace(x).concat([x[..., :7] + dx, x[..., 7:]], axis=-1)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Normalise the quaternion."""
        return namespace(x).concat([x[..., :3], normalize(x[..., 3:7]), x[..., 7:]], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Orientation, inclination vector and angular rate."""
        return {"orientation": x[..., 3:7], "up": up_in_body(x[..., 3:7]), "angular_rate": x[..., :3]}


def solve_orientation(q: Array, world: tuple[Array, Array], body: tuple[Array, Array]) -> Array:
    """The unit quaternion that best rotates two body vectors onto two world vectors, by four steps from ``q``.

    Equations (5.41)–(5.43). The length of the quaternion is not constrained during the steps.

    Args:
        q: initial value, ``(..., 4)``; must be near the solution, as the steps converge to the nearest one.
        world: two vectors in the world, ``(..., 3)``.
        body: the same in the body's axes.

    Returns:
        ``(..., 4)`` with the sign of ``q``; not finite where the vectors are parallel.
    """
    xp, start = namespace(q), q
    for _ in range(STEPS):
        blocks, errors = [], []
        for seen, target in zip(body, world, strict=True):
            w, u = q[..., :1], q[..., 1:]
            along = xp.sum(u * seen, axis=-1, keepdims=True)
            turned = (w * w - xp.sum(u * u, axis=-1, keepdims=True)) * seen + 2.0 * along * u
            errors.append(target - turned - 2.0 * w * cross(u, seen))
            blocks.append(matrix_jacobian(q, seen))
        jacobian, error = xp.concat(blocks, axis=-2), xp.concat(errors, axis=-1)
        normal = jacobian.mT @ jacobian
        q = q + solve_positive(normal, times(jacobian.mT, error))
    q = normalize(q)
    aligned = xp.sum(q * start, axis=-1, keepdims=True)
    return xp.where(xp.less(aligned, 0.0), -q, q)


def matrix_jacobian(q: Array, v: Array) -> Array:
    """∂(M(q) v)/∂q ``(..., 3, 4)`` of the quaternion's matrix (5.40), for any length.

    M v = (w² − u·u) v + 2 (u·v) u + 2 w u × v.
    """
    xp = namespace(q, v)
    w, u = q[..., :1], q[..., 1:]
    along = xp.sum(u * v, axis=-1, keepdims=True)
    columns = [2.0 * (w * v + cross(u, v))]
    for index in range(3):
        axis = 0.0 * v + constant([float(index == i) for i in range(3)], v)
        part, seen = u[..., index : index + 1], v[..., index : index + 1]
        columns.append(2.0 * (seen * u + along * axis - part * v + w * cross(axis, v)))
    return _columns(columns)


def _columns(vectors: list[Array]) -> Array:
    return namespace(*vectors).stack(vectors, axis=-1)


def _basis(index: int, like: Array) -> Array:
    """The quaternion with a one at ``index``, in the batch shape of ``like`` ``(..., 4)``."""
    return 0.0 * like + constant([float(index == i) for i in range(4)], like)
