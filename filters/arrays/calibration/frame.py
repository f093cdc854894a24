"""The rotation between two frames from axes known in both, such as those of a device and of an optical tracker.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval; appendix B. E_B = R_BO E_O; R_BOᵀ = U Vᵀ from the singular value decomposition of (E_Oᵀ)⁺ E_Bᵀ.

Erratum: (B.4) is a matrix of determinant −1 and not a rotation. Here a fit that is a reflection raises an error,
because one of the two frames (or a list of axes) is then left-handed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class FrameFit(NamedTuple):
    """Result of :func:`align_axes`."""

    matrix: np.ndarray
    """``(3, 3)`` rotation R_BO: v_B = R_BO v_O"""
    singular_values: np.ndarray
    """``(3,)`` singular values, 1 where the angles between axes agree"""
    residual: float
    """root mean square angle between E_B and R_BO E_O, rad"""


def procrustes(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The orthogonal matrix ``(3, 3)`` nearest to ``matrix``, its singular values, and the determinant (±1)."""
    u, values, v = np.linalg.svd(matrix)
    nearest = u @ v
    return nearest, values, float(np.sign(np.linalg.det(nearest)))


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """The rotation nearest to ``matrix`` ``(3, 3)``; a reflection is made a rotation by reversing its weakest axis."""
    u, _, v = np.linalg.svd(matrix)
    u[:, -1] *= np.sign(np.linalg.det(u @ v))
    return u @ v


def align_axes(axes_body: np.ndarray, axes_other: np.ndarray) -> FrameFit:
    """Rotation from another frame to the body, from directions given in both.

    Args:
        axes_body: ``(n, 3)`` unit vectors in body axes, rows of E_Bᵀ.
        axes_other: ``(n, 3)`` the same in the other frame.

    Raises:
        ValueError: different shapes, a row of zeros, directions that lie in a plane, or a fit that is a reflection.
    """
    body, other = np.asarray(axes_body, dtype=float), np.asarray(axes_other, dtype=float)
    if body.ndim != 2 or body.shape[1:] != (3,) or body.shape != other.shape:
        raise ValueError(f"axes must be two arrays of shape (n, 3) with equal n, got {body.shape} and {other.shape}")
    if not (np.isfinite(body).all() and np.isfinite(other).all()):
        raise ValueError("axes must be finite numbers")
    for name, rows in (("axes_body", body), ("axes_other", other)):
        nothing = np.flatnonzero(~rows.any(axis=1))
        if len(nothing):
            raise ValueError(f"{name} must be directions, row {nothing[0] + 1} is zero")
        spread = np.linalg.svd(rows, compute_uv=False)
        if len(spread) < 3 or spread[-1] < 1e-3 * spread[0]:
            raise ValueError(
                f"{name} must span three dimensions (directions that are not in one plane), got {rows.tolist()}"
            )
    transposed, values, determinant = procrustes(np.linalg.pinv(other) @ body)
    if determinant < 0.0:
        raise ValueError(
            "the best fit is a reflection (determinant -1): one of the two frames is left-handed, or an axis has the "
            "wrong sign"
        )
    matrix = transposed.T
    seen = other @ matrix.T
    cosine = np.sum(body * seen, axis=1) / np.linalg.norm(body, axis=1) / np.linalg.norm(seen, axis=1)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    return FrameFit(matrix, values, float(np.sqrt(np.mean(angle**2))))
