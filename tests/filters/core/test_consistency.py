"""NEES and NIS against draws from the distribution that they should have."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.stats import chi2

from poise.filters.core.consistency import consistency, nees


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def test_nees_of_a_consistent_filter_lies_within_its_bounds(rng):
    root = rng.standard_normal((3, 3))
    covariance = root @ root.T + np.eye(3)
    errors = rng.multivariate_normal(np.zeros(3), covariance, size=4000)
    values = nees(errors, np.broadcast_to(covariance, (4000, 3, 3)))
    np.testing.assert_allclose(values, np.einsum("ni,ij,nj->n", errors, np.linalg.inv(covariance), errors))
    np.testing.assert_allclose(nees(torch.tensor(errors), torch.tensor(covariance)), values)
    found = consistency(values, 3)
    assert found.consistent
    assert found.samples == 4000
    assert not consistency(nees(errors, covariance / 1.2), 3).consistent
    assert not consistency(nees(errors, covariance * 1.2), 3).consistent


def test_bounds_hold_their_level_and_ticks_without_measurement_are_left_out(rng):
    inside = [consistency(rng.chisquare(6, 10), 6, level=0.9).consistent for _ in range(1000)]
    assert 0.87 < np.mean(inside) < 0.93
    degrees = np.array([3.0, 0.0, 6.0, 3.0])
    found = consistency(np.array([3.0, 0.0, 12.0, np.nan]), degrees)
    assert found.ratio == pytest.approx(15 / 9)
    assert (found.lower, found.upper) == pytest.approx(tuple(chi2.ppf([0.025, 0.975], 9) / 9))
    assert consistency(np.zeros(3), 0).samples == 0
    with pytest.raises(ValueError, match="level"):
        consistency(np.ones(3), 3, level=95)
    with pytest.raises(ValueError, match="degrees"):
        consistency(np.ones(3), -1)
