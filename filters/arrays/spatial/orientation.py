r"""Orientation from an array of accelerometers, a magnetometer and, where the array requires it, a gyroscope.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval; chapter 5. Equation numbers are the thesis'.

The state holds the rows q₁, q₂, q₃ of the rotation matrix Q (body to world), the angular acceleration α and the angular
rate ω (body axes); the angular jerk is white noise γ:

    q_i ← Φ q_i,  Φ = exp(−Δt [ω]×),   α ← α + Δt γ,   ω ← ω + Δt α + ½ Δt² γ

With G the magnitude of gravity, m the unit magnetic field in the world, R_BO the mounting of the magnetometer and
A = [A_P A_T A_C] the array, the expected readings are

    array          G A_P q₃ + A_T α + A_C ξ(ω)
    gyroscope      ω
    magnetometer   R_BOᵀ Qᵀ m
    zeros          q₁·q₁ − 1, q₂·q₂ − 1, q₃·q₃ − 1, q₂·q₃, q₃·q₁, q₁·q₂          (orthogonality as a measurement)

and R = blkdiag(σ_b² A_P A_Pᵀ + σ_a² 1, σ_ω² 1, σ_m² 1, σ_s² 1). The essential parameter is σ_b: the acceleration of
the hand is white noise common to all accelerometers, so R reflects how little information on gravity they contain.

Differences from the thesis:

* (5.17), (5.25), (5.30): gravity has the wrong sign unless g is the *upward* vector, as in the thesis' experiments.
  ``gravity_sign=-1`` is as published and diverges.
* (5.29): the derivative of q_i⁺ by ω is +Δt [q_i]×, not −Δt [q_i]×. ``coupling_sign=-1`` is as published; the error has
  little effect with a gyroscope, but the filter diverges without one.
* (5.25): R_BOᵀ, as in (5.23) and (5.30).
* ``exact_rotation`` and ``orthonormalise`` (both on by default) are additions. The first-order Φ = 1 − Δt [ω]× of the
  thesis stretches the rows at every step, and the orthogonality measurements pull them back at changing points of
  linearisation. The covariance becomes overconfident, and the error grows with time. The exponential, and the nearest
  rotation matrix after every update, more than halve the error over 100 s. The thesis' filter has both options off.
* (5.66), (5.67), the virtual controller: the thesis gives no K_d; 2 s⁻¹ is our choice.

The axes of the thesis vary (z down or y up). Here the world is x east, y north, z up, and an accelerometer at rest
reads +G on an axis that points up. Magnetometer samples are scaled to length one, so their unit does not matter. The
thesis gives neither initial state nor P₀.

The biases of gyroscope and accelerometers are not estimated; with real arrays they dominate the error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from ...core.backend import Array, constant, expand, namespace
from ...core.matrices import block_diagonal, block_matrix, covariance_of, identity, times, vector_of
from ...core.model import Gain, Model, checked_quaternion
from ...core.quantity import (
    ANGULAR_RATE,
    EXTERNAL_ACCELERATION,
    GRAVITY,
    GYROSCOPE,
    MAGNETOMETER,
    ORIENTATION,
    UP,
    Channel,
    Measurement,
    Quantity,
)
from ...core.rotation import exp_matrix, from_matrix, nearest_matrix, normalize, rotate, skew, to_matrix
from ...imu.magnetic_heading import align, field_direction, known
from ...support.parameters import check_positive
from ..array import ARRAYS, AccelerometerArray, recorded_channel
from ..files import ArrayEquations
from ..products import product_jacobian, products
from .virtual_controller import VIRTUAL_POSITION, advance

ORTHOGONAL_PAIRS = ((1, 2), (2, 0), (0, 1))


@dataclass(frozen=True)
class ArrayOrientation(ArrayEquations, Model):
    """The extended Kalman filter of chapter 5, its tilt-sensor and integration variants, and the virtual controller.

    State: rows of Q (9), α (3), ω (3), unit field in the world (3), velocity and position of the virtual controller
    (6, world), external acceleration (3, body). The error state is the first 15.

    The channel of the readings is ``array/acc``, one number per sensor. A single triaxial accelerometer along the body
    axes uses ``imu/acc`` instead, so that recordings of any IMU can be used.

    Raises:
        ValueError: an unknown array, method, start or field; a planar array; integration without a gyroscope; a start
            or mounting that is not a unit quaternion; virtual dampings that are not positive.
    """

    array: AccelerometerArray | str = "controller"
    """an array, or the name of one: controller, octa, triaxial"""
    gyroscope: bool = True
    """whether there is a gyroscope; only an array of rank 12 (octa) works without one"""
    method: Literal["fusion", "tilt", "integration"] = "fusion"
    """``tilt`` assumes no acceleration of the hand (σ_b = 0) and ignores the gyroscope; ``integration`` uses only the
    gyroscope and orthogonality"""
    exact_rotation: bool = True
    """propagate by the exponential instead of the first-order rotation (5.26)"""
    orthonormalise: bool = True
    """replace Q by the nearest rotation matrix after every update"""
    start: Literal["samples", "given"] = "samples"
    """``samples``: at rest, from the first readings and field; ``given``: :attr:`start_orientation`"""
    field: Literal["start", "given"] = "start"
    """``start``: the dip is that of the first samples; ``given``: :attr:`dip`"""
    jerk_std: float = 30.0
    """σ_γ, rad/s³ per sample; the thesis gives none, 10 to 1000 makes no difference"""
    acceleration_std: float = 5.0
    """σ_b, m/s²: acceleration of the hand, each axis; the thesis gives none, less than 2 doubles the error"""
    array_std: float = 0.981
    """σ_a, m/s² per sample (section 5.3.2: 0.1 g)"""
    gyroscope_std: float = 0.1
    """σ_ω, rad/s per sample (section 5.3.2)"""
    magnetometer_std: float = 0.01
    """σ_m per sample, of a field of length one (section 5.3.2: 1 %)"""
    orthogonality_std: float = 0.01
    """σ_s; the thesis gives none, 10⁻³ over-constrains"""
    orientation_prior: float = 0.01
    """standard deviation of every element of Q at the start; 1 if the start is uncertain"""
    angular_acceleration_prior: float = 1.0
    """rad/s²"""
    rate_prior: float = 0.316
    """rad/s"""
    start_orientation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    """unit quaternion, body to world, if the start is given"""
    magnetometer_mounting: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    """R_BO as a unit quaternion: magnetometer axes to body axes"""
    declination: float = 0.0
    """of the magnetic field, rad, positive east"""
    dip: float = 0.0
    """below the horizontal, rad, if the field is given"""
    position_damping: float = 2.0
    """K_d,b of the virtual controller, 1/s; our choice: motion below 0.3 Hz is lost, and a constant error of 0.2 m/s²
    (1.2° of tilt) leads to an offset of 5 cm"""
    velocity_damping: float = 2.0
    """K_d,v of the virtual controller, 1/s; our choice"""
    gravity: float = GRAVITY
    """g, m/s²"""
    gravity_sign: float = 1.0
    """−1: gravity as published in (5.17), (5.25), (5.30), to show the erratum"""
    coupling_sign: float = 1.0
    """−1: ∂q⁺/∂ω as published in (5.29), to show the erratum"""

    outputs: ClassVar[tuple[Quantity, ...]] = (ORIENTATION, UP, ANGULAR_RATE, EXTERNAL_ACCELERATION, VIRTUAL_POSITION)
    state_size: ClassVar[int] = 27
    error_size: ClassVar[int] = 15
    gains: ClassVar[dict[str, Gain]] = {
        "process": Gain("jerk_std", description="process variance σ_γ²"),
        "measurement": Gain("acceleration_std", description="variance σ_b² of the acceleration of the hand"),
        "heading": Gain("magnetometer_std", description="measurement variance σ_m²"),
    }

    def __post_init__(self) -> None:
        """Look up the array and check the combination of options."""
        super().__post_init__()
        if isinstance(self.array, str):
            if self.array not in ARRAYS:
                raise ValueError(f"array must be an AccelerometerArray or one of {sorted(ARRAYS)}, got {self.array!r}")
            object.__setattr__(self, "array", ARRAYS[self.array])
        if self.geometry.dimension != 3:
            raise ValueError(f"array must be spatial, got the planar array {self.geometry.name!r}")
        if self.method == "integration" and not self.gyroscope:
            raise ValueError("gyroscope must be True where method is 'integration': nothing else is integrated")
        for name in ("start_orientation", "magnetometer_mounting"):
            object.__setattr__(self, name, checked_quaternion(name, getattr(self, name)))
        check_positive(self, "position_damping", "velocity_damping")

    @property
    def geometry(self) -> AccelerometerArray:
        """The array."""
        assert isinstance(self.array, AccelerometerArray)
        return self.array

    @property
    def readings(self) -> Channel:
        """Channel of the accelerometers."""
        return recorded_channel(self.geometry)

    @property
    def has_rate_rows(self) -> bool:
        """Whether the gyroscope is used as a measurement."""
        return self.gyroscope and self.method != "tilt"

    @property
    def channels(self) -> tuple[Channel, ...]:  # type: ignore[override]
        """Channels, depending on array and method."""
        return (*((GYROSCOPE,) if self.has_rate_rows else ()), self.readings, MAGNETOMETER)

    @property
    def residual_size(self) -> int:  # type: ignore[override]
        """Rows of the residual."""
        vectors = 0 if self.method == "integration" else self.geometry.size + 3
        return vectors + 3 * self.has_rate_rows + 6

    @property
    def supposed_field(self) -> int:
        """The unit field in the world, unless it is given."""
        return 15 if self.field == "start" else -1

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """At rest: inclination from readings, heading from the field; or as given. α₀ = 0, ω₀ from the gyroscope."""
        readings, mag = z[self.readings.name], z["imu/mag"]
        field = rotate(vector_of(self.magnetometer_mounting, 0.0 * mag[..., :1]), mag)
        xp = namespace(readings)
        zero = 0.0 * field + 0.0 * xp.sum(readings, axis=-1)[..., None]
        q = align(times(constant(self._mean, readings), readings), field, self.declination)
        if self.start == "given":
            q = 0.0 * q + vector_of(self.start_orientation, 0.0 * q[..., :1])
        world = rotate(q, normalize(field))
        if self.field == "given":
            world = field_direction(self.declination, self.dip, q)
        rate = z["imu/gyr"] if self.has_rate_rows else zero
        matrix = to_matrix(q)
        rows = [matrix[..., index, :] + zero for index in range(3)]
        x = xp.concat([*rows, zero, rate, world, zero, zero, zero], axis=-1)
        deviations = [self.orientation_prior] * 9 + [self.angular_acceleration_prior] * 3 + [self.rate_prior] * 3
        return x, covariance_of(deviations, zero[..., :1])

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """Equations (5.26)–(5.29): the rows rotate with the body, α and ω are driven by white jerk."""
        xp = namespace(x)
        Q, alpha, rate = self._matrix(x), x[..., 9:12], x[..., 12:15]
        dt, dt2 = expand(self.dt, 1), expand(self.dt, 2)
        unit = identity(3, x)
        none = 0.0 * unit
        # q_i ← Φ q_i (5.26): rotation of the rows of Q into the new body axes
        turn = dt * rate
        back = exp_matrix(-turn) if self.exact_rotation else unit - skew(turn)
        turned = Q @ back.mT
        # derivative of a rotated row by ω: evaluated in the middle of the interval, then rotated by the second half
        if self.exact_rotation:
            half = exp_matrix(-0.5 * turn)
            middle = Q @ half.mT
            lever = [half @ skew(middle[..., row, :]) for row in range(3)]
        else:
            lever = [skew(Q[..., row, :]) for row in range(3)]
        lever = [expand(self.coupling_sign * self.dt, 2) * block for block in lever]
        # F (5.28), (5.29): Φ on the diagonal and ∂q_i⁺/∂ω = Δt [q_i]× for each row; α stays, ω gains Δt α
        F = block_matrix(
            [[*(back if row == column else none for column in range(3)), none, lever[row]] for row in range(3)]
            + [[none, none, none, unit, none], [none, none, none, dt2 * unit, unit]]
        )
        # V = J σ_γ² Jᵀ with J = [0 0 0 Δt ½Δt²]ᵀ: white jerk γ drives α and ω
        power = expand(self.jerk_std**2, 2) * unit
        jerk = [none, none, none, expand(self.dt, 2) * unit, expand(0.5 * self.dt**2, 2) * unit]
        V = block_matrix([[a @ power @ b for b in jerk] for a in jerk])
        rows = [turned[..., index, :] for index in range(3)]
        return xp.concat([*rows, alpha, rate + dt * alpha, x[..., 15:]], axis=-1), F, V

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """Measured less expected, equations (5.30)–(5.34)."""
        xp = namespace(x)
        unit = identity(3, x)
        none, zero3 = 0.0 * unit, 0.0 * x[..., :3]
        r, H, R = [], [], []
        if self.method != "integration":
            # array (5.30): G A_P q₃ + A_T α + A_C ξ(ω); its covariance contains σ_b, common to all accelerometers
            P, T, C = (constant(matrix, x) for matrix in (self.geometry.A_P, self.geometry.A_T, self.geometry.A_C))
            gravity = expand(self.gravity_sign * self.gravity, 2)
            rate = x[..., 12:15]
            expected = P @ (gravity * x[..., 6:9, None]) + T @ x[..., 9:12, None] + C @ products(rate)[..., None]
            r.append(z[self.readings.name] - expected[..., 0])
            nothing = (P @ none) + 0.0
            H.append([nothing, nothing, gravity * (P @ unit), T @ unit, C @ product_jacobian(rate)])
            shared = 0.0 if self.method == "tilt" else expand(self.acceleration_std**2, 2)
            R.append(shared * (P @ P.mT) + expand(self.array_std**2, 2) * identity(self.geometry.size, x))
        if self.has_rate_rows:
            # gyroscope: ω
            r.append(z["imu/gyr"] - x[..., 12:15])
            H.append([none, none, none, none, unit])
            R.append(expand(self.gyroscope_std**2, 2) * unit)
        if self.method != "integration":
            # magnetometer (5.23): R_BOᵀ Qᵀ m, linear in each row of Q
            field, there = known(z["imu/mag"])
            to_sensor = to_matrix(vector_of(self.magnetometer_mounting, 0.0 * x[..., :1])).mT + 0.0 * unit
            world = x[..., 15:18]
            expected = to_sensor @ (self._matrix(x).mT @ world[..., None])
            r.append(xp.where(there, normalize(field), xp.nan + zero3) - expected[..., 0])
            H.append([*(world[..., i, None, None] * to_sensor for i in range(3)), none, none])
            R.append(expand(self.magnetometer_std**2, 2) * unit)
        # orthogonality (5.31), (5.32): six zeros
        zeros, jacobian = _orthogonality(xp, x)
        r.append(-zeros)
        H.append([jacobian, 0.0 * jacobian[..., :6]])
        R.append(expand(self.orthogonality_std**2, 2) * identity(6, x))
        return xp.concat(r, axis=-1), block_matrix(H), block_diagonal(R)

    def retract(self, x: Array, dx: Array) -> Array:
        """Additive."""
        return namespace(x).concat([x[..., :15] + dx, x[..., 15:]], axis=-1)

    def finish(self, x: Array, z: Measurement) -> Array:
        """Optional nearest rotation matrix; external acceleration, zero where a reading is missing; (5.66), (5.67)."""
        xp = namespace(x)
        Q = self._matrix(x)
        Q = nearest_matrix(Q) if self.orthonormalise else Q
        readings = z[self.readings.name]
        there = xp.all(xp.isfinite(readings), axis=-1)[..., None]
        readings = xp.where(there, readings, xp.zeros_like(readings))
        # readings without rotational terms, averaged to the specific force at the reference point; less gravity: b̈
        T, C, mean = (constant(matrix, x) for matrix in (self.geometry.A_T, self.geometry.A_C, self._mean))
        turning = T @ x[..., 9:12, None] + C @ products(x[..., 12:15])[..., None]
        force = (mean @ (readings[..., None] - turning))[..., 0]
        external = force - expand(self.gravity, 1) * Q[..., 2, :]
        external = xp.where(there, external, xp.zeros_like(external))
        virtual = advance(
            x[..., 18:24],
            times(Q, external),
            self.dt,
            velocity_damping=self.velocity_damping,
            position_damping=self.position_damping,
        )
        rows = [Q[..., index, :] for index in range(3)]
        return xp.concat([*rows, x[..., 9:18], virtual, external], axis=-1)

    def pose(self, x: Array) -> dict[str, Array]:
        """Orientation (nearest rotation matrix), inclination vector, angular rate, acceleration, virtual position."""
        Q = self._matrix(x)
        Q = Q if self.orthonormalise else nearest_matrix(Q)
        return {
            "orientation": from_matrix(Q),
            "up": normalize(Q[..., 2, :]),
            "angular_rate": x[..., 12:15],
            "external_acceleration": x[..., 24:27],
            "virtual_position": x[..., 21:24],
        }

    @property
    def _mean(self) -> np.ndarray:
        """A_P⁺ ``(3, m)``: specific force at the reference point from readings without rotational terms."""
        return np.linalg.pinv(self.geometry.A_P)

    @staticmethod
    def _matrix(x: Array) -> Array:
        return namespace(x).stack([x[..., 0:3], x[..., 3:6], x[..., 6:9]], axis=-2)


def _orthogonality(xp: Any, x: Array) -> tuple[Array, Array]:
    """s(q) ``(..., 6)`` and its Jacobian by the nine elements ``(..., 6, 9)``, equations (5.31), (5.32)."""
    rows = [x[..., 3 * index : 3 * index + 3] for index in range(3)]
    none = 0.0 * rows[0]
    values = [xp.sum(row * row, axis=-1) - 1.0 for row in rows]
    jacobian = [
        xp.concat([2.0 * row if i == index else none for i in range(3)], axis=-1) for index, row in enumerate(rows)
    ]
    for first, second in ORTHOGONAL_PAIRS:
        values.append(xp.sum(rows[first] * rows[second], axis=-1))
        parts = [none, none, none]
        parts[first], parts[second] = rows[second], rows[first]
        jacobian.append(xp.concat(parts, axis=-1))
    return xp.stack(values, axis=-1), xp.stack(jacobian, axis=-2)
