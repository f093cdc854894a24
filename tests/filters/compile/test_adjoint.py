"""Reverse-mode derivatives of recorded operations against differences, and of the Kalman update against torch."""

from __future__ import annotations

import numpy as np
import pytest

from poise.filters.compile.adjoint import gradient
from poise.filters.compile.adjoint_kernel import correct_back, innovation, invert, propagate_back
from poise.filters.compile.trace import Tape, TracedNamespace

from .emitted import emitted

xp = TracedNamespace


def compiled(function, count: int, unknown: str = ""):
    """Value and gradient of a function of the recorded inputs ``z``, as a plain Python function."""
    tape = Tape()
    z = tape.inputs("z", count)
    value = function(z)
    seed = tape.inputs("g", 1)
    found = gradient([np.array([value], dtype=object)], [seed], list(z), unknown)
    shapes = {"z": (count,), "g": (1,), "value": (1,), "slope": (count,)}
    call = emitted(shapes, {"value": np.array([value], dtype=object), "slope": found})

    def run(numbers, g=1.0):
        result, slope = np.zeros(1), np.zeros(count)
        call(np.asarray(numbers, dtype=float), np.array([g]), result, slope)
        return result[0], slope

    return run


FUNCTIONS = {
    "sum and product": lambda z: z[0] * z[1] - 3.0 * z[0] + z[1] / z[2],
    "used twice": lambda z: (z[0] * z[0] + z[1]) * (z[0] * z[0]) - (-z[1]),
    "powers": lambda z: z[0] ** 3 + z[1] ** -2 + z[2] ** 0.5 + z[0] ** 2,
    "angles": lambda z: xp.sin(z[0]) * xp.cos(z[1]) + xp.tan(0.3 * z[2]) + xp.atan2(z[0], z[1]),
    "inverse": lambda z: xp.asin(0.3 * z[0]) - xp.acos(0.2 * z[1]),
    "roots and logarithms": lambda z: xp.sqrt(z[0] * z[1]) + xp.exp(0.5 * z[2]) * xp.log(z[0]) + xp.abs(-z[1]),
    "choice": lambda z: xp.where(xp.greater(z[0], z[1]), z[0] * z[2], xp.sqrt(z[1])) + xp.minimum(z[0], z[2]),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("seed", range(3))
def test_gradients_equal_differences(name, seed):
    run = compiled(FUNCTIONS[name], 3)
    at = np.random.default_rng(seed).uniform(0.5, 1.8, 3)
    step = 1e-6
    expected = [(run(at + step * e)[0] - run(at - step * e)[0]) / (2.0 * step) for e in np.eye(3)]
    np.testing.assert_allclose(run(at)[1], expected, rtol=2e-8, atol=2e-8)
    np.testing.assert_allclose(run(at, -2.5)[1], -2.5 * run(at)[1], rtol=1e-14)


def test_the_branch_that_was_not_taken_passes_nothing_on():
    run = compiled(lambda z: xp.where(xp.greater(z[0], 0.0), xp.sqrt(z[0]), 2.0 * z[1]), 2)
    np.testing.assert_array_equal(run(np.array([0.0, 1.0]))[1], [0.0, 2.0])
    run = compiled(lambda z: xp.where(xp.isfinite(z[0]), z[0] * z[1], 3.0 * z[1]), 2, unknown="z")
    np.testing.assert_array_equal(run(np.array([np.nan, 2.0]))[1], [0.0, 3.0])


def test_constants_pass_nothing_on():
    tape = Tape()
    z = tape.inputs("z", 2)
    found = gradient([np.array([z[0], 1.0], dtype=object)], [np.array([2.0, 5.0], dtype=object)], list(z))
    assert list(found) == [2.0, 0.0]


@pytest.mark.parametrize("missing", [False, True])
def test_the_update_has_the_derivatives_of_torch(missing):
    torch = pytest.importorskip("torch")
    rng = np.random.default_rng(1)
    e, m = 5, 3
    root, noise = rng.standard_normal((e, e)), rng.standard_normal((m, m))
    P, R = root @ root.T + np.eye(e), noise @ noise.T + np.eye(m)
    H, r = rng.standard_normal((m, e)), rng.standard_normal(m)
    if missing:
        r[1] = np.nan
    gdx, gP, gnis, glog = rng.standard_normal(e), rng.standard_normal((e, e)), 0.7, -0.4
    gP = gP + gP.T
    tensors = [torch.tensor(part, requires_grad=True) for part in (P, H, R, r)]
    there = [0, 2] if missing else [0, 1, 2]
    Pt, Ht, Rt, rt = tensors[0], tensors[1][there], tensors[2][there][:, there], tensors[3][there]
    S = Ht @ Pt @ Ht.T + Rt
    K = torch.linalg.solve(S, Ht @ Pt).T
    after = (torch.eye(e) - K @ Ht) @ Pt @ (torch.eye(e) - K @ Ht).T + K @ Rt @ K.T
    total = (K @ rt * torch.tensor(gdx)).sum() + (after * torch.tensor(gP)).sum()
    (total + gnis * (rt @ torch.linalg.solve(S, rt)) + glog * torch.logdet(S)).backward()

    rows, A, Smat, W = np.zeros(m, np.int64), np.zeros((e, m)), np.zeros((m, m)), np.zeros((m, m))
    y, found = np.zeros(m), [np.zeros(m), np.zeros((m, e)), np.zeros((m, m))]
    count, logarithm = innovation(r, H, R, P, rows, A, Smat, W, y, np.zeros((m, m)))
    assert count == len(there)
    assert logarithm == pytest.approx(torch.logdet(S).item())
    work = np.zeros((e, m)), np.zeros((e, m)), np.zeros((m, m)), np.zeros(m)
    back = gP.copy()
    correct_back(H, P, rows, count, A, W, y, gdx, back, gnis, glog, *found, work)
    expected = [tensors[3].grad, tensors[1].grad, tensors[2].grad]
    for mine, theirs in zip(found, expected, strict=True):
        values = np.nan_to_num(theirs.numpy())
        values = 0.5 * (values + values.T) if values.shape == (m, m) else values
        np.testing.assert_allclose(mine, values, atol=1e-12)
    grad = tensors[0].grad.numpy()
    np.testing.assert_allclose(back, 0.5 * (grad + grad.T), atol=1e-11)


def test_propagation_has_the_derivatives_of_its_formula():
    rng = np.random.default_rng(2)
    F, root, G = rng.standard_normal((4, 4)), rng.standard_normal((4, 4)), rng.standard_normal((4, 4))
    P, G = root @ root.T, G + G.T
    gP, gF = G.copy(), np.zeros((4, 4))
    propagate_back(F, P, gP, gF, np.zeros((4, 4)))
    np.testing.assert_allclose(gF, 2.0 * G @ F @ P, atol=1e-12)
    np.testing.assert_allclose(gP, F.T @ G @ F, atol=1e-12)


def test_inverse_and_determinant():
    rng = np.random.default_rng(3)
    root = rng.standard_normal((4, 4))
    S, W = root @ root.T + np.eye(4), np.zeros((4, 4))
    assert invert(S, 4, W, np.zeros((4, 4))) == pytest.approx(np.linalg.slogdet(S)[1])
    np.testing.assert_allclose(W, np.linalg.inv(S), atol=1e-12)
