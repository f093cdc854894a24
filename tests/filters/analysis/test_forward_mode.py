"""Scalars with gradients: against symbolic derivatives, on every kind of array."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
import torch

from poise.filters.analysis import forward_mode as fm

CASES = {
    "sum": (lambda a, b: 2.0 + a - 3.0 * b + a - (1.0 - b), lambda a, b: 2 + a - 3 * b + a - (1 - b)),
    "product": (lambda a, b: a * b * a * 0.5, lambda a, b: a * b * a / 2),
    "quotient": (lambda a, b: 1.0 / a - a / b / 4.0, lambda a, b: 1 / a - a / b / 4),
    "sine": (lambda a, b: fm.sin(a * b), lambda a, b: sympy.sin(a * b)),
    "cosine": (lambda a, b: fm.cos(a - b), lambda a, b: sympy.cos(a - b)),
    "angle": (lambda a, b: fm.atan2(a * a, -b), lambda a, b: sympy.atan2(a * a, -b)),
    "angle of one": (
        lambda a, b: fm.atan2(a, 2.0) + fm.atan2(2.0, b),
        lambda a, b: sympy.atan2(a, 2) + sympy.atan2(2, b),
    ),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("kind", ["numpy", "torch"])
def test_values_and_gradients_are_those_of_sympy(name, kind):
    ours, symbolic = CASES[name]
    a, b = sympy.symbols("a b")
    formula = symbolic(a, b)
    wanted = [sympy.lambdify((a, b), each) for each in (formula, formula.diff(a), formula.diff(b))]
    x = np.random.default_rng(0).uniform(0.3, 1.5, (4, 3, 2))
    data = torch.from_numpy(x) if kind == "torch" else x
    found = ours(*fm.variables(data))
    np.testing.assert_allclose(found.value, wanted[0](x[..., 0], x[..., 1]), rtol=1e-13)
    expected = np.stack(
        [wanted[1](x[..., 0], x[..., 1]) + 0.0 * x[..., 0], wanted[2](x[..., 0], x[..., 1]) + 0.0 * x[..., 0]], -1
    )
    np.testing.assert_allclose(found.gradient, expected, rtol=1e-12)


def test_what_is_no_variable_has_no_gradient():
    x = np.ones((2, 3))
    assert np.all(fm.gradient(2.0, x) == 0.0)
    assert fm.value(fm.variables(x)[0]) is not None
    assert fm.value(1.5) == 1.5
    np.testing.assert_allclose(fm.atan2(1.0, np.array([1.0])), np.pi / 4.0)


def test_parameters_may_be_arrays():
    """An array on the left does not take the operation over."""
    x = np.random.default_rng(1).normal(size=(5, 2))
    scale = np.arange(1.0, 6.0)
    found = scale * fm.variables(x)[1] + scale
    np.testing.assert_allclose(found.value, scale * x[:, 1] + scale)
    np.testing.assert_allclose(found.gradient, scale[:, None] * [0.0, 1.0])
