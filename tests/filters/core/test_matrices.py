"""Small systems in straight-line form, against LAPACK."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from poise.filters.core.matrices import solve_positive


@pytest.mark.parametrize("n", [1, 2, 4, 5])
def test_positive_systems_are_solved_as_lapack_does(n: int) -> None:
    rng = np.random.default_rng(n)
    root = rng.standard_normal((20, n + 3, n))
    matrix, right = root.mT @ root, rng.standard_normal((20, n))
    expected = np.linalg.solve(matrix, right[..., None])[..., 0]
    np.testing.assert_allclose(solve_positive(matrix, right), expected, rtol=1e-9, atol=1e-11)
    tensors = solve_positive(torch.from_numpy(matrix), torch.from_numpy(right))
    np.testing.assert_allclose(tensors.numpy(), expected, rtol=1e-9, atol=1e-11)
    lower = np.tril(matrix)
    np.testing.assert_allclose(solve_positive(lower, right), expected, rtol=1e-9, atol=1e-11)


def test_a_singular_system_has_no_finite_solution() -> None:
    with np.errstate(all="ignore"):
        assert not np.isfinite(solve_positive(np.ones((2, 2)), np.array([1.0, 2.0]))).any()
