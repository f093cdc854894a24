"""Axes of the force/inertial filter: from ours (x forward, y left, z up) to the paper's and back.

The paper's R and B point down (x forward, y right, z down), and the trunk's axes are x up the trunk, y right, z
forward. Either is a half turn, so going back is the same function.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...analysis.forward_mode import Scalar
from ...core import rotation
from ...core.backend import Array, namespace
from .kinematics import Triple

DOWN = np.diag([1.0, -1.0, -1.0])
"""Our vector of the bicycle to the paper's."""
UP_THE_TRUNK = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
"""Our vector of the trunk to the paper's."""


def down(v: Array) -> Triple:
    """A vector ``(..., 3)`` of the bicycle, its IMU or its seat in the paper's axes."""
    return v[..., 0], -v[..., 1], -v[..., 2]


def up_the_trunk(v: Array) -> Triple:
    """A vector ``(..., 3)`` of the trunk in the paper's axes."""
    return v[..., 2], -v[..., 1], v[..., 0]


def from_trunk(x: Scalar, y: Scalar, z: Scalar) -> Array:
    """A vector in the paper's trunk axes back in ours ``(..., 3)``."""
    return namespace(x).stack([z, -y, x], axis=-1)


def true_angles(truth: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The filter's own quantities from the environment's truth.

    Args:
        truth: with ``bicycle/orientation`` and ``trunk/orientation`` ``(T, 4)``, body to world.

    Returns:
        ``force-inertial/trunk_angles`` ``(T, 3)``: φ_h, θ, φ of the trunk against R, which is yawed with the bicycle
        but not rolled, rad.

    Raises:
        ValueError: an orientation is missing.
    """
    for name in ("bicycle/orientation", "trunk/orientation"):
        if name not in truth:
            raise ValueError(f"the truth must hold {name!r}, got {sorted(truth)}")
    bicycle, trunk = truth["bicycle/orientation"], truth["trunk/orientation"]
    yaw = rotation.to_euler_zyx(bicycle)[0]
    level = rotation.from_euler_zyx(yaw, 0.0 * yaw, 0.0 * yaw)
    seen = rotation.to_matrix(rotation.multiply(rotation.conjugate(level), trunk))
    M = DOWN @ seen @ UP_THE_TRUNK.T
    # M = Rx(φ_h) Ry(θ) Rx(φ) with 0 < θ < π
    angles = [
        np.arctan2(M[..., 1, 0], -M[..., 2, 0]),
        np.arctan2(np.hypot(M[..., 1, 0], M[..., 2, 0]), M[..., 0, 0]),
        np.arctan2(M[..., 0, 1], M[..., 0, 2]),
    ]
    return {"force-inertial/trunk_angles": np.stack(angles, axis=-1)}
