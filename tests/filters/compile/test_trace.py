"""The recorder of model code, checked against SymPy and plain NumPy."""

import numpy as np
import pytest
import sympy

from poise.filters.compile.trace import Tape, TracedNamespace
from poise.filters.core import rotation
from poise.filters.core.backend import constant, expand, namespace, rows

from .emitted import emitted


def recorded(function, count):
    """A function of one vector, recorded, printed and compiled."""
    tape = Tape()
    traced = np.asarray(function(tape.inputs("x", count)), dtype=object)
    call = emitted({"x": (count,), "out": traced.shape}, {"out": traced})

    def run(inputs):
        out = np.zeros(traced.shape)
        call(inputs, out)
        return out

    return run


FUNCTIONS = {
    "quaternion product": lambda x: rotation.multiply(x[..., :4], x[..., 4:8]),
    "exponential": lambda x: rotation.exp(x[..., :3]),
    "logarithm": lambda x: rotation.log(rotation.normalize(x[..., :4])),
    "matrix": lambda x: rotation.to_matrix(rotation.normalize(x[..., :4])),
    "from matrix": lambda x: rotation.from_matrix(rotation.to_matrix(rotation.normalize(x[..., :4]))),
    "angles": lambda x: namespace(x).stack(rotation.to_euler_zyx(rotation.normalize(x[..., :4])), axis=-1),
    "skew": lambda x: rotation.skew(x[..., :3]) @ rotation.exp_matrix(x[..., 3:6]),
    "functions": lambda x: namespace(x).stack(
        [
            namespace(x).sin(x[0]) + namespace(x).tan(x[1]) + namespace(x).exp(x[2]) - namespace(x).cos(-x[3]),
            namespace(x).atan2(x[4], x[5]) + namespace(x).floor(3.0 * x[6]) * namespace(x).abs(x[7]) ** 0.5,
            namespace(x).log(1.0 + x[0] * x[0]) + x[1] ** 7 - x[2] ** -3 + (1.0 + x[3] ** 2) ** -0.5,
        ]
    ),
    "choice": lambda x: namespace(x).where(namespace(x).greater(x, 0.2), x, -2.0 * x) ** 3,
    "constants": lambda x: constant([[1.0, 2.0], [3.0, 4.0]], x) @ x[..., :2, None] / (1.0 + x[..., 7:, None] ** 2),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_printed_code_computes_what_numpy_computes(name):
    generator = np.random.default_rng(0)
    run = recorded(FUNCTIONS[name], 8)
    for _ in range(20):
        x = generator.standard_normal(8)
        np.testing.assert_allclose(run(x), FUNCTIONS[name](x), rtol=1e-14, atol=1e-15)


def test_a_traced_product_of_matrices_is_that_of_sympy():
    tape = Tape()
    x = tape.inputs("x", 3)
    traced = rotation.skew(x) @ rotation.skew(x)
    symbols = sympy.symbols("x0:3")
    cross = sympy.Matrix([[0, -symbols[2], symbols[1]], [symbols[2], 0, -symbols[0]], [-symbols[1], symbols[0], 0]])
    values = np.array([0.3, -1.2, 0.7])
    out = np.zeros((3, 3))
    emitted({"x": (3,), "out": (3, 3)}, {"out": traced})(values, out)
    expected = np.array((cross * cross).subs(dict(zip(symbols, values, strict=True))), dtype=float)
    np.testing.assert_allclose(out, expected, rtol=1e-14)


def test_zeros_and_ones_are_folded_and_equal_operations_are_recorded_once():
    tape = Tape()
    (x, y) = tape.inputs("x", 2)
    assert (0.0 * x).value == 0.0
    assert (1.0 * x) is x
    assert (x + 0.0) is x
    assert x.__neg__().__neg__() is x
    assert (x * y) is (x * y)
    assert (0.0 / x).value == 0.0
    skew = rotation.skew(tape.inputs("v", 3))
    assert [entry.value for entry in np.diag(skew)] == [0.0, 0.0, 0.0]


def test_numbers_that_meet_on_a_tape_are_computed_at_once():
    tape = Tape()
    two, three = tape.constant(2.0), tape.constant(3.0)
    results = {  # hashed by identity
        two + three: 5.0,
        two - three: -1.0,
        two * three: 6.0,
        two / three: 2.0 / 3.0,
        -two: -2.0,
        three**3: 27.0,
    }
    assert [result.value for result in results] == list(results.values())


def test_branching_on_values_is_refused_with_an_explanation():
    (x,) = Tape().inputs("x", 1)
    with pytest.raises(TypeError, match=r"xp\.where"):
        bool(TracedNamespace.greater(x, 0.0))
    with pytest.raises(TypeError, match="Python numbers"):
        float(x)
    with pytest.raises(TypeError, match="not supported"):
        max(x, x + 1.0)


def test_parameters_scale_matrices_in_every_kind_of_array():
    tape = Tape()
    (sigma,) = tape.inputs("p", 1)
    assert expand(sigma, 2) is sigma
    assert expand(0.5, 2) == 0.5
    assert expand(np.ones(4), 2).shape == (4, 1, 1)
    assert rows([[np.ones(4), 0.0], [2.0, np.zeros(4)]]).shape == (4, 2, 2)
