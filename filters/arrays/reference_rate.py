r"""Angular rate from tracked orientations, as a reference for estimates.

P. He, thesis, Université Laval; sections 2.3.2 and 5.5. The entries of the rotation matrices Q (body to world) are
smoothed by a first-order low-pass run forwards and backwards, then

    Q̇_k = (Q_{k+1} − Q_{k−1}) / (2 Δt),   [ω]× = ½ (QᵀQ̇ − (QᵀQ̇)ᵀ)  in body axes                  (2.50), (5.61)

Errata: (2.51), (2.52) have Q Q̇ᵀ, which is −[ω]× in world axes; (5.61) agrees with the above.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import filtfilt

from ..core.rotation import to_matrix


def reference_rate(orientation: np.ndarray, dt: float, cutoff: float | None = 5.0) -> np.ndarray:
    """Angular rate ``(T, 3)`` in body axes, rad/s; the first and the last row are NaN.

    Args:
        orientation: ``(T, 4)`` unit quaternions w, x, y, z, body to world; signs may change.
        dt: interval, s.
        cutoff: of one pass of the low-pass, Hz (section 5.5: 5 Hz); None does not filter the orientations.

    Raises:
        ValueError: a wrong shape, fewer than three orientations, one that is not finite, or a ``dt`` or ``cutoff``
            that is not positive (and below half the rate).
    """
    orientation = np.asarray(orientation, dtype=float)
    if orientation.ndim != 2 or orientation.shape[1] != 4 or len(orientation) < 3:
        raise ValueError(f"orientation must have shape (T, 4) with T of 3 at least, got {orientation.shape}")
    if not np.isfinite(orientation).all():
        raise ValueError("orientation must be finite: cut the sequence where tracking was lost")
    if not (np.isfinite(dt) and dt > 0.0):
        raise ValueError(f"dt must be positive seconds, got {dt}")
    Q = to_matrix(orientation)
    if cutoff is not None:
        if not 0.0 < cutoff < 0.5 / dt:
            raise ValueError(f"cutoff must lie between 0 and {0.5 / dt:g} Hz, got {cutoff}")
        keep = np.exp(-2.0 * np.pi * cutoff * dt)
        Q = filtfilt([1.0 - keep], [1.0, -keep], Q, axis=0, padlen=min(len(Q) - 1, round(5.0 / (cutoff * dt))))
    derivative = np.full_like(Q, np.nan)
    derivative[1:-1] = (Q[2:] - Q[:-2]) / (2.0 * dt)
    turning = Q.mT @ derivative
    half = 0.5 * (turning - turning.mT)
    return np.stack([half[:, 2, 1], half[:, 0, 2], half[:, 1, 0]], axis=-1)
