"""Consistency of a filter's covariance with its errors: NEES, NIS and their chi-square bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .backend import Array, namespace, to_numpy
from .metrics import scored


def nees(error_vector: Array, covariance: Array) -> Array:
    """Normalised estimation error squared ``(...)``: ``eᵀ P⁻¹ e``.

    With an innovation and its covariance it is the normalised innovation squared (NIS). If the filter is consistent
    it is chi-square distributed with n degrees of freedom (Y. Bar-Shalom, X. R. Li, T. Kirubarajan, "Estimation with
    Applications to Tracking and Navigation", 2001, section 5.4).

    Args:
        error_vector: ``(..., n)``, in the coordinates of the covariance.
        covariance: ``(..., n, n)``, positive definite.
    """
    xp = namespace(error_vector, covariance)
    solved = xp.linalg.solve(covariance, error_vector[..., None])[..., 0]
    return xp.sum(error_vector * solved, axis=-1)


@dataclass(frozen=True)
class Consistency:
    """Average NEES or NIS for each degree of freedom against its chi-square bounds.

    Attributes:
        ratio: average divided by the degrees of freedom: 1 if consistent, larger if the filter is overconfident.
        lower: bound that a consistent filter falls below with probability ``(1 - level) / 2``.
        upper: bound that it exceeds with the same probability.
        samples: number of averaged values.
    """

    ratio: float
    lower: float
    upper: float
    samples: int

    @property
    def consistent(self) -> bool:
        """Whether the ratio lies within the bounds."""
        return self.lower <= self.ratio <= self.upper


def consistency(squared: Any, degrees: Any, mask: Any = None, level: float = 0.95) -> Consistency:
    """Average NEES or NIS values and give the bounds of a consistent filter.

    The bounds assume independent values: NIS over time (innovations are white if the filter is optimal), or NEES of
    independent runs. NEES of one run over time is correlated, and the bounds are then too narrow.

    Args:
        squared: NEES or NIS, any shape; values that are not finite are left out.
        degrees: degrees of freedom, a number or an array that broadcasts to ``squared``; samples with 0 (no
            measurement) are left out.
        mask: bool, leading shape of ``squared``; None takes all.
        level: probability between the bounds.

    Returns:
        Ratio and bounds; all NaN with 0 samples if nothing is left.

    Raises:
        ValueError: ``level`` is not between 0 and 1, ``degrees`` negative, or ``mask`` does not fit.
    """
    from scipy.stats import chi2

    if not 0.0 < level < 1.0:
        raise ValueError(f"level must lie between 0 and 1, got {level}")
    values = np.asarray(to_numpy(squared), dtype=float)
    freedom = np.broadcast_to(np.asarray(to_numpy(degrees), dtype=float), values.shape)
    if (freedom < 0.0).any():
        raise ValueError(f"degrees must not be negative, got {freedom.min()}")
    used = scored(values, mask) & (freedom > 0.0)
    total = freedom[used].sum()
    if not used.any():
        return Consistency(float("nan"), float("nan"), float("nan"), 0)
    lower, upper = chi2.ppf([(1.0 - level) / 2.0, (1.0 + level) / 2.0], total) / total
    return Consistency(float(values[used].sum() / total), float(lower), float(upper), int(used.sum()))
