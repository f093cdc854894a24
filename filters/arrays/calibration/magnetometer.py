r"""Hard and soft iron of a magnetometer from readings in many attitudes, and its alignment with the device.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval; section 4.3. Raw readings v in a field of constant strength lie on an ellipsoid,

    (v − v₀)ᵀ E (v − v₀) = 1,    m̂ = √E (v − v₀)                                                       (4.11)–(4.15)

√E is the symmetric root, which is correct up to a rotation. The alignment determines this rotation: R_OM and the unit
field m in the world minimise Σ |R_OM m̂_k − Q_kᵀ m|² (4.16)–(4.21) over reference attitudes Q_k. Alternating closed
forms give m ∝ Σ Q_k R m̂_k, and R by Procrustes. |m| = 1 is imposed, since the data are unit vectors.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from ...core import rotation
from .frame import nearest_rotation

FEWEST = 30
"""Smallest number of samples for a fit."""
COVERAGE = 0.02
"""Smallest mean square of the directions along any axis; 1/3 for a uniform distribution."""
TURNS = 200
STARTS = 12


class Ellipsoid(NamedTuple):
    """Result of :func:`fit_ellipsoid`."""

    centre: np.ndarray
    """``(3,)`` v₀, raw units: hard iron"""
    root: np.ndarray
    """``(3, 3)`` √E, symmetric, 1/raw unit: soft iron, scale"""
    residual: float
    """root mean square of |√E (v − v₀)| − 1"""


class Alignment(NamedTuple):
    """Result of :func:`align_magnetometer`."""

    matrix: np.ndarray
    """``(3, 3)`` rotation R_OM: magnetometer to device"""
    field: np.ndarray
    """``(3,)`` unit vector of the field in the world"""
    residual: float
    """root mean square angle, rad"""


def fit_ellipsoid(raw: np.ndarray) -> Ellipsoid:
    """Fit the ellipsoid: a linear least squares quadric, then Gauss–Newton on the distance from the unit sphere.

    Args:
        raw: ``(T, 3)`` readings in many attitudes; rows with NaN are left out.

    Raises:
        ValueError: a wrong shape, too few samples, attitudes that do not cover the sphere, or readings not on an
            ellipsoid.
    """
    raw = np.asarray(raw, dtype=float)
    if raw.ndim != 2 or raw.shape[1] != 3:
        raise ValueError(f"raw must have shape (T, 3), got {raw.shape}")
    raw = raw[np.isfinite(raw).all(axis=1)]
    if len(raw) < FEWEST:
        raise ValueError(f"at least {FEWEST} samples are needed, got {len(raw)}")
    middle = raw.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((raw - middle) ** 2, axis=1))))
    spread = np.linalg.eigvalsh(np.cov((raw - middle).T))
    if not size > 0.0 or spread[0] < 1e-3 * spread[-1]:
        raise ValueError("the readings lie in a plane: turn the device about more than one axis")
    x = (raw - middle) / size
    quadric = _linear_quadric(x)
    centre, root = _gauss_newton(x, *quadric)
    unit = (x - centre) @ root
    length = np.linalg.norm(unit, axis=1)
    directions = unit / length[:, None]
    thinnest = np.linalg.eigvalsh(directions.T @ directions / len(directions))[0]
    if thinnest < COVERAGE:
        raise ValueError(
            f"the attitudes cover too little of the sphere (mean square {thinnest:.3f} along one axis, at least "
            f"{COVERAGE} is needed): turn the device about all axes"
        )
    residual = float(np.sqrt(np.mean((length - 1.0) ** 2)))
    if residual > 0.2:
        raise ValueError(f"the readings do not lie on an ellipsoid: relative residual {residual:.2f}")
    return Ellipsoid(middle + size * centre, root / size, residual)


def _linear_quadric(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre and symmetric root of the quadric xᵀAx + 2bᵀx = 1 that fits best."""
    a, b, c = x.T
    columns = np.stack([a * a, b * b, c * c, 2 * b * c, 2 * c * a, 2 * a * b, 2 * a, 2 * b, 2 * c], axis=-1)
    values = np.linalg.svd(columns, compute_uv=False)
    if values[-1] < 1e-6 * values[0]:
        raise ValueError("the attitudes do not determine an ellipsoid: turn the device about all axes")
    p = np.linalg.lstsq(columns, np.ones(len(x)), rcond=None)[0]
    A = np.array([[p[0], p[5], p[4]], [p[5], p[1], p[3]], [p[4], p[3], p[2]]])
    if abs(np.linalg.det(A)) < 1e-12:
        raise ValueError("the readings do not lie on an ellipsoid: the fitted quadric has no centre")
    centre = -np.linalg.solve(A, p[6:])
    E = A / (1.0 + centre @ A @ centre)
    values, vectors = np.linalg.eigh(E)
    if not values[0] > 0.0:
        raise ValueError("the readings do not lie on an ellipsoid: the fitted quadric is open (a hyperboloid)")
    return centre, vectors @ np.diag(np.sqrt(values)) @ vectors.T


def _gauss_newton(x: np.ndarray, centre: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Minimise Σ (|√E (x − v₀)| − 1)² over v₀ and the six entries of √E."""
    upper = np.triu_indices(3)

    def unpack(parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        matrix = np.zeros((3, 3))
        matrix[upper] = parameters[3:]
        return parameters[:3], matrix + np.triu(matrix, 1).T

    def left(parameters: np.ndarray) -> np.ndarray:
        middle, matrix = unpack(parameters)
        return np.linalg.norm((x - middle) @ matrix, axis=1) - 1.0

    fit = least_squares(left, np.concatenate([centre, root[upper]]), method="lm")
    centre, root = unpack(fit.x)
    if not np.linalg.eigvalsh(root)[0] > 0.0:
        raise ValueError("the readings do not lie on an ellipsoid: the refined fit is not positive")
    return centre, root


def align_magnetometer(unit: np.ndarray, orientation: np.ndarray) -> Alignment:
    """Estimate the rotation from magnetometer to device, and the direction of the field.

    Args:
        unit: ``(T, 3)`` readings of length about one (:class:`Ellipsoid`), magnetometer axes.
        orientation: ``(T, 4)`` reference quaternions w, x, y, z, device to world, of the same samples; rows with NaN
            are left out.

    Raises:
        ValueError: different shapes, a quaternion of zeros, too few samples, or attitudes that do not determine the
            rotation.
    """
    unit, orientation = np.asarray(unit, dtype=float), np.asarray(orientation, dtype=float)
    if unit.ndim != 2 or unit.shape[1:] != (3,) or orientation.shape != (len(unit), 4):
        raise ValueError(f"unit and orientation must be (T, 3) and (T, 4), got {unit.shape} and {orientation.shape}")
    good = np.isfinite(unit).all(axis=1) & np.isfinite(orientation).all(axis=1)
    if not rotation.norm(orientation[good]).all():
        raise ValueError("orientation must consist of unit quaternions, one is zero: use NaN if it is unknown")
    unit, orientation = unit[good], rotation.normalize(orientation[good])
    if len(unit) < FEWEST:
        raise ValueError(f"at least {FEWEST} samples with a reference attitude are needed, got {len(unit)}")
    unit = rotation.normalize(unit)
    Q = rotation.to_matrix(orientation)
    # several starting points: the alternating closed forms may end in a local minimum
    generator = np.random.default_rng(0)
    best: tuple[float, np.ndarray, np.ndarray] | None = None
    for start in rotation.to_matrix(rotation.random(generator, (STARTS,))):
        candidate = _alternate(unit, Q, start)
        if best is None or candidate[0] < best[0]:
            best = candidate
    assert best is not None
    _, R, field = best
    body = field @ Q
    _check_determined(unit @ R.T, Q, field)
    angle = np.arccos(np.clip(np.sum((unit @ R.T) * body, axis=1), -1.0, 1.0))
    return Alignment(R, field, float(np.sqrt(np.mean(angle**2))))


def _alternate(unit: np.ndarray, Q: np.ndarray, R: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Cost, rotation and field after alternating closed forms from the rotation ``R``."""
    cost = np.inf
    for _ in range(TURNS):
        field = np.einsum("kij,kj->i", Q, unit @ R.T)
        field /= np.linalg.norm(field)
        body = field @ Q
        R = nearest_rotation(body.T @ unit / len(unit))
        before, cost = cost, float(np.mean(np.sum((unit @ R.T - body) ** 2, axis=1)))
        if before - cost < 1e-15:
            break
    return cost, R, field


def _check_determined(turned: np.ndarray, Q: np.ndarray, field: np.ndarray) -> None:
    """Check that small rotations of R and m change the residual R m̂ − Qᵀm (five unknowns)."""
    tangent = np.linalg.svd(field[None])[2][1:]
    by_turn = -rotation.skew(turned)
    by_field = -np.einsum("kji,tj->kit", Q, tangent)
    values = np.linalg.svd(np.concatenate([by_turn, by_field], axis=-1).reshape(-1, 5), compute_uv=False)
    if values[-1] < 0.02 * values[0]:
        raise ValueError(
            "the attitudes do not determine the alignment of the magnetometer: turn the device about at least two axes"
        )
