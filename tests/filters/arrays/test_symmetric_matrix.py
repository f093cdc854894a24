"""The straight-line eigenvalue against LAPACK, from random to degenerate matrices."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from poise.filters.arrays.symmetric_matrix import largest_eigenpair
from poise.filters.compile.trace import Tape
from poise.filters.core.matrices import diagonal_matrix

from ..compile.emitted import emitted

COUNT = 20_000


def turned(eigenvalues: np.ndarray, seed: int) -> np.ndarray:
    frames, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(len(eigenvalues), 3, 3)))
    matrix = np.einsum("nij,nj,nkj->nik", frames, eigenvalues, frames)
    return 0.5 * (matrix + matrix.mT)


def matrices(kind: str) -> np.ndarray:
    rng = np.random.default_rng(1)
    if kind == "random":
        matrix = rng.normal(size=(COUNT, 3, 3))
        return matrix + matrix.mT
    if kind == "two smaller ones equal":
        rate = rng.normal(size=(COUNT, 3))
        return rate[:, :, None] * rate[:, None] + np.sum(rate**2, axis=1)[:, None, None] * np.eye(3)
    if kind == "two larger ones nearly equal":
        gap = 10.0 ** rng.uniform(-18, -1, COUNT)
        return turned(np.stack([np.ones(COUNT), 1.0 + gap, rng.uniform(-1, 1, COUNT)], axis=-1), 2)
    if kind == "all nearly equal":
        return turned(1.0 + 10.0 ** rng.uniform(-17, -3, (COUNT, 3)), 3)
    if kind == "of any size":
        return turned(10.0 ** rng.uniform(-120, 120, (COUNT, 3)) * rng.choice([-1.0, 1.0], (COUNT, 3)), 4)
    return np.zeros((4, 3, 3)) + np.array([0.0, 1.0, -1.0, 1e-300])[:, None, None] * np.diag([1.0, 2.0, 2.0])


@pytest.mark.parametrize(
    "kind",
    [
        *("random", "two smaller ones equal", "two larger ones nearly equal"),
        *("all nearly equal", "of any size", "diagonal, zero"),
    ],
)
def test_value_and_vector_are_exact_to_rounding(kind: str) -> None:
    matrix = matrices(kind)
    value, vector = largest_eigenpair(matrix)
    spectrum = np.linalg.eigvalsh(matrix)
    size = np.maximum(np.abs(spectrum).max(axis=-1), 1e-300)
    assert np.abs((value - spectrum[:, -1]) / size).max() < 5e-15
    residual = (matrix @ vector[..., None])[..., 0] - value[:, None] * vector
    assert (np.linalg.norm(residual, axis=-1) / size).max() < 5e-15
    np.testing.assert_allclose(np.linalg.norm(vector, axis=-1), 1.0, rtol=5e-15)


def test_separate_eigenvectors_are_those_of_lapack() -> None:
    matrix = turned(np.tile([1.0, -3.0, 2.0], (1000, 1)), 5)
    _, vector = largest_eigenpair(matrix)
    expected = np.linalg.eigh(matrix)[1][:, :, -1]
    np.testing.assert_allclose(np.abs(np.sum(vector * expected, axis=-1)), 1.0, rtol=1e-14)


def test_what_is_not_finite_stays_so() -> None:
    value, vector = largest_eigenpair(np.full((3, 3), np.nan))
    assert np.isnan(value)
    assert np.isnan(vector).all()


def test_tensors_traces_and_gradients() -> None:
    matrix = matrices("random")[:5].reshape(5, 3, 3)
    value, vector = largest_eigenpair(matrix)
    tensor = torch.from_numpy(matrix).requires_grad_()
    of_torch = largest_eigenpair(tensor)
    np.testing.assert_allclose(of_torch[0].detach(), value, rtol=1e-13)
    np.testing.assert_allclose(of_torch[1].detach(), vector, atol=1e-13)
    of_torch[0].sum().backward()
    # dλ = vᵀ dA v; only the upper triangle is read, so an element beside the diagonal counts twice there
    outer = vector[:, :, None] * vector[:, None]
    np.testing.assert_allclose(tensor.grad, np.triu(outer) + np.triu(outer, 1), atol=1e-12)
    zero = torch.zeros(3, 3, dtype=torch.float64, requires_grad=True)
    torch.stack([largest_eigenpair(zero)[0], *largest_eigenpair(zero)[1]]).sum().backward()
    assert bool(torch.isfinite(zero.grad).all())

    traced = largest_eigenpair(Tape().inputs("a", 9).reshape(3, 3))
    outputs = {"out": np.array([traced[0], *traced[1]], dtype=object)}
    call = emitted({"a": (9,), "out": (4,)}, outputs)
    for index in range(5):
        out = np.zeros(4)
        call(matrix[index].ravel(), out)
        np.testing.assert_allclose(out, [value[index], *vector[index]], atol=1e-13)


def test_diagonal() -> None:
    np.testing.assert_array_equal(diagonal_matrix(np.array([[1.0, 2.0, 3.0]])), np.diag([1.0, 2.0, 3.0])[None])
