r"""Arrays of uniaxial accelerometers: geometry, readings, the quantities they determine, and their noise.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval; chapters 2 (spatial) and 3 (planar). Sensor i at r_i from the reference point B, along the unit vector e_i, reads

    a_i = e_iᵀ(b̈ − Qᵀg) + (r_i × e_i)ᵀ α + (Σ_i e_i)ᵀ ξ(ω)               a = A z,   A = [A_P  A_T  A_C]

with all vectors in body axes; b̈ − Qᵀg is the specific force at B (+9.81 m/s² on an axis that points up at rest). In
the vertical plane (body axes x, y; angle φ counter-clockwise; E the quarter turn that carries x to y)

    a_i = e_iᵀ(b̈ − Qᵀg) + e_iᵀE r_i α − e_iᵀr_i ω²                        z = [(b̈ − Qᵀg)ᵀ, α, ω²]ᵀ

Errata: (2.9), (2.10) have a wrong index of r; Σ_i below (2.11) is transposed; (3.9), (3.10) swap the columns of α and
ω² and lose the sign of ω²; in (3.10) b̈ must be in body axes. ẑ = A⁺â has the covariance σ_a² B.
"""

# ruff: noqa: N802 — matrices keep the letters of the source

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from ..core.backend import Array, constant, namespace
from ..core.matrices import times
from ..core.quantity import Channel
from ..core.rotation import cross
from .products import centripetal, products

Rows = tuple[tuple[float, ...], ...]


def _frozen(matrix: np.ndarray) -> np.ndarray:
    matrix.flags.writeable = False
    return matrix


@dataclass(frozen=True)
class AccelerometerArray:
    """Uniaxial accelerometers on a rigid body that moves in space.

    A frozen value: as a field of a filter it is part of the structure of the filter. Lists and arrays are accepted.

    Raises:
        ValueError: rows of another length than 3, numbers that are not finite, an axis that is not a unit vector,
            different numbers of axes and positions, or no sensor at all.
    """

    positions: Rows
    """one row per sensor, m, body axes, from any origin"""
    axes: Rows
    """one row per sensor: unit vector of the sensitive axis, body axes"""
    name: str = "array"
    reference: tuple[float, ...] = ()
    """reference point B of the acceleration, m, same origin as the positions; empty for the origin"""

    dimension: ClassVar[int] = 3
    components: ClassVar[tuple[str, ...]] = (
        *("force_x", "force_y", "force_z"),
        *("alpha_x", "alpha_y", "alpha_z"),
        *("omega_xx", "omega_yy", "omega_zz", "omega_yz", "omega_zx", "omega_xy"),
    )
    """names of the entries of z"""
    blocks: ClassVar[Mapping[str, slice]] = {"P": slice(0, 3), "T": slice(3, 6), "C": slice(6, 12)}
    """entries of z: specific force (P), angular acceleration (T), products of angular rates (C)"""

    def __post_init__(self) -> None:
        for name in ("positions", "axes"):
            object.__setattr__(self, name, _checked_rows(name, getattr(self, name), self.dimension))
        if len(self.positions) != len(self.axes):
            raise ValueError(f"axes must have a row for each of {len(self.positions)} positions, got {len(self.axes)}")
        for index, axis in enumerate(self.axes):
            if abs(math.hypot(*axis) - 1.0) > 1e-6:
                raise ValueError(f"axes must be unit vectors, row {index} is {axis} of length {math.hypot(*axis):g}")
        reference = _checked_rows("reference", [self.reference or (0.0,) * self.dimension], self.dimension)[0]
        object.__setattr__(self, "reference", reference)

    @property
    def size(self) -> int:
        """Number of sensors, m."""
        return len(self.axes)

    @property
    def channel(self) -> Channel:
        """Channel of the readings: ``array/acc``, m/s² along each axis."""
        return Channel("array/acc", self.size, "m/s²")

    @cached_property
    def r(self) -> np.ndarray:
        """Positions from the reference point, ``(m, dimension)``, m."""
        return _frozen(np.array(self.positions) - np.array(self.reference))

    @cached_property
    def e(self) -> np.ndarray:
        """Axes, ``(m, dimension)``."""
        return _frozen(np.array(self.axes))

    @cached_property
    def spatial(self) -> AccelerometerArray:
        """The same sensors in space, their reference point as origin; those of a planar array lie in x and y."""
        padding = ((0, 0), (0, 3 - self.dimension))
        return AccelerometerArray(np.pad(self.r, padding).tolist(), np.pad(self.e, padding).tolist(), self.name)

    @cached_property
    def A_P(self) -> np.ndarray:
        """Columns of the specific force at the reference point: e_iᵀ, ``(m, 3)``."""
        return self.e

    @cached_property
    def A_T(self) -> np.ndarray:
        """Columns of the angular acceleration: (r_i × e_i)ᵀ, ``(m, 3)``, m."""
        return _frozen(cross(self.r, self.e))

    @cached_property
    def A_C(self) -> np.ndarray:
        """Columns of ξ(ω): (Σ_i e_i)ᵀ, ``(m, 6)``, m."""
        return _frozen((self.e[:, None, :] @ centripetal(self.r))[:, 0])

    @cached_property
    def A(self) -> np.ndarray:
        """[A_P A_T A_C], ``(m, 12)`` (planar: ``(m, 4)``)."""
        return _frozen(np.concatenate([self.A_P, self.A_T, self.A_C], axis=1))

    @cached_property
    def pseudo_inverse(self) -> np.ndarray:
        """A⁺, ``(12, m)``: the minimum-norm z where the array does not determine all entries."""
        return _frozen(np.linalg.pinv(self.A))

    @cached_property
    def B(self) -> np.ndarray:
        """Covariance of A⁺â per unit of σ_a²: (AᵀA)⁻¹, or the pseudo-inverse where that does not exist."""
        return _frozen(self.pseudo_inverse @ self.pseudo_inverse.T)

    @property
    def B_P(self) -> np.ndarray:
        """Block of :attr:`B` for the specific force."""
        return self._block("P", "P")

    @property
    def B_T(self) -> np.ndarray:
        """Block of :attr:`B` for the angular acceleration."""
        return self._block("T", "T")

    @property
    def B_C(self) -> np.ndarray:
        """Block of :attr:`B` for the products of angular rates."""
        return self._block("C", "C")

    @property
    def B_TC(self) -> np.ndarray:
        """Block of :attr:`B`: covariance of the angular acceleration with the products."""
        return self._block("T", "C")

    def _block(self, first: str, second: str) -> np.ndarray:
        return self.B[self.blocks[first], self.blocks[second]]

    @cached_property
    def rank(self) -> int:
        """Rank of A: number of combinations of z that the readings determine."""
        return int(np.linalg.matrix_rank(self.A))

    @property
    def condition_number(self) -> float:
        """Largest over smallest singular value of A; infinite where A does not determine all of z."""
        values = np.linalg.svd(self.A, compute_uv=False)
        return float(values[0] / values[-1]) if self.rank == self.A.shape[1] else math.inf

    @property
    def redundancy(self) -> int:
        """Number of independent consistency checks (sensors minus rank); with 0 a fault cannot be detected."""
        return self.size - self.rank

    @cached_property
    def determined(self) -> np.ndarray:
        """Which entries of z a single set of readings determines, ``(12,)`` bool."""
        kept = np.diag(self.pseudo_inverse @ self.A)
        return _frozen(kept > 1.0 - 1e-9)

    @property
    def noise_gains(self) -> np.ndarray:
        """Standard deviation of each entry of ẑ per unit of σ_a, ``(12,)``; infinite where it is not determined."""
        return np.where(self.determined, np.sqrt(np.diag(self.B)), np.inf)

    def readings(self, force: Array, angular_acceleration: Array, angular_rate: Array) -> Array:
        """Ideal readings ``(..., m)``, m/s².

        Args:
            force: b̈ − Qᵀg at the reference point, body axes, ``(..., 3)``, m/s².
            angular_acceleration: α, body axes, ``(..., 3)``, rad/s² (planar: ``(..., 1)``).
            angular_rate: ω, body axes, ``(..., 3)``, rad/s (planar: ``(..., 1)``).
        """
        xp = namespace(force, angular_acceleration, angular_rate)
        z = xp.concat([force, angular_acceleration, self.square(angular_rate)], axis=-1)
        return times(constant(self.A, z), z)

    def solve(self, readings: Array) -> tuple[Array, Array, Array]:
        """Specific force, angular acceleration and products of angular rates ``(..., 3 | 3 | 6)``: ẑ = A⁺â.

        Raises:
            ValueError: the array does not determine them (its rank is too low).
        """
        if self.rank < self.A.shape[1]:
            open_ = [name for name, known in zip(self.components, self.determined, strict=True) if not known]
            raise ValueError(
                f"array {self.name!r} has rank {self.rank} of {self.A.shape[1]}: {open_} are not determined"
            )
        z = times(constant(self.pseudo_inverse, readings), readings)
        return z[..., self.blocks["P"]], z[..., self.blocks["T"]], z[..., self.blocks["C"]]

    @staticmethod
    def square(angular_rate: Array) -> Array:
        """Function of the angular rate in z: ξ(ω) ``(..., 6)`` (planar: ω² ``(..., 1)``)."""
        return products(angular_rate)

    def about(self, reference: Sequence[float]) -> Self:
        """The same sensors with another reference point, m, in the origin and axes of the positions."""
        return type(self)(self.positions, self.axes, self.name, tuple(map(float, reference)))

    def describe(self) -> dict[str, Any]:
        """Complete description for JSON; the inverse is :func:`.arrays.files.read_array`."""
        return {
            "name": self.name,
            "positions": [list(row) for row in self.positions],
            "axes": [list(row) for row in self.axes],
            "reference": list(self.reference),
        }


@dataclass(frozen=True)
class PlanarArray(AccelerometerArray):
    """Uniaxial accelerometers on a body that moves in a vertical plane; rows of positions and axes have 2 numbers.

    Raises:
        ValueError: as :class:`AccelerometerArray`.
    """

    dimension: ClassVar[int] = 2
    components: ClassVar[tuple[str, ...]] = ("force_x", "force_y", "alpha", "omega_squared")
    blocks: ClassVar[Mapping[str, slice]] = {"P": slice(0, 2), "T": slice(2, 3), "C": slice(3, 4)}

    @cached_property
    def A_T(self) -> np.ndarray:
        """Column of the angular acceleration: e_iᵀE r_i, ``(m, 1)``, m."""
        quarter_turned = np.stack([-self.r[:, 1], self.r[:, 0]], axis=-1)
        return _frozen(np.sum(self.e * quarter_turned, axis=-1, keepdims=True))

    @cached_property
    def A_C(self) -> np.ndarray:
        """Column of ω²: −e_iᵀr_i, ``(m, 1)``, m."""
        return _frozen(-np.sum(self.e * self.r, axis=-1, keepdims=True))

    @staticmethod
    def square(angular_rate: Array) -> Array:
        """Function of the angular rate in z: ω², ``(..., 1)``."""
        return angular_rate * angular_rate


def _checked_rows(name: str, values: Any, width: int) -> Rows:
    try:
        rows = tuple(tuple(float(number) for number in row) for row in values)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must have {width} numbers in each row, got {values!r}") from None
    if not rows:
        raise ValueError(f"{name} must have a row for each sensor, got none")
    for index, row in enumerate(rows):
        if len(row) != width or not all(math.isfinite(number) for number in row):
            raise ValueError(f"{name} must have {width} finite numbers in each row, row {index} is {row}")
    return rows
