"""Parts of an error state that never meet: how they are found, and that their recursions are that of the whole."""

import re
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from poise.filters.bicycle.whole_body.filter import WholeBody
from poise.filters.compile.printer import print_model
from poise.filters.compile.sparsity import can_differ_from_zero, find_parts, whole
from poise.filters.compile.trace import Tape
from poise.filters.core.backend import constant, namespace, rows
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.model import Model
from poise.filters.core.quantity import Channel, Quantity
from poise.filters.imu.mekf import MEKF


def bools(size, *entries):
    matrix = np.eye(size, dtype=bool)
    for i, j in entries:
        matrix[i, j] = True
    return matrix


def test_states_meet_through_every_matrix():
    nothing, H = bools(5), np.eye(5, dtype=bool)
    assert [part.states for part in find_parts(nothing, nothing, nothing, H, nothing)] == [(i,) for i in range(5)]
    linked = bools(5, (3, 0))
    for matrices in ((linked, nothing, nothing), (nothing, linked, nothing), (nothing, nothing, linked.T)):
        parts = find_parts(*matrices, H, nothing)
        assert [part.states for part in parts] == [(0, 3), (1,), (2,), (4,)]
        assert [part.rows for part in parts] == [(0, 3), (1,), (2,), (4,)]
    # one row touches two states; noise couples two rows
    one = H.copy()
    one[2, 4] = True
    assert [part.states for part in find_parts(nothing, nothing, nothing, one, nothing)] == [(0,), (1,), (2, 4), (3,)]
    parts = find_parts(nothing, nothing, nothing, H, bools(5, (1, 4)))
    assert [part.states for part in parts] == [(0,), (1, 4), (2,), (3,)]
    assert [part.uncorrelated for part in parts] == [True, False, True, True]


def test_patterns_are_told_in_places_of_the_part():
    F = bools(4, (1, 3))
    H = np.array([[False, True, False, True], [True, False, False, False], [False] * 4])
    part = find_parts(F, bools(4), bools(4), H, bools(3))[1]
    assert (part.states, part.rows) == ((1, 3), (0,))
    assert part.transition == ((0, 1), (1,))
    assert part.jacobian == ((0, 1),)
    everything = whole(F, H, bools(3))
    assert everything.transition == ((0,), (1, 3), (2,), (3,))
    # a row that touches nothing has to be somewhere
    assert find_parts(F, bools(4), bools(4), H, bools(3))[0].rows == (1, 2)


def test_zeros_of_traced_matrices_are_seen():
    x = Tape().inputs("x", 2)
    matrix = np.array([[x[0], 0.0 * x[1]], [0.0, 1.0 + 0.0 * x[0]]], dtype=object)
    np.testing.assert_array_equal(can_differ_from_zero(matrix), [[True, False], [False, True]])


def test_the_whole_body_filter_has_the_parts_that_its_page_names():
    text = print_model(WholeBody())
    parts = [[int(i) for i in found.split(",")] for found in re.findall(r"^s\d = np.array\(\[([^\]]*)\]", text, re.M)]
    assert parts == [[0, 1], [*range(2, 11), 14, 15, 16], [11, 12, 13], [17, 18, 19]]
    assert "gather" not in print_model(MEKF()).split("def run(")[1]


@dataclass(frozen=True)
class Apart(Model):
    """States 0 and 2 (read by rows 0 and 3, whose noise is correlated) never meet states 1 and 3 (rows 1 and 2)."""

    noise: float = 0.3

    channels: ClassVar = (Channel("one/value", 4, "1"),)
    outputs: ClassVar = (Quantity("state", "vector", 4, "1"),)
    state_size: ClassVar = 4
    error_size: ClassVar = 4
    residual_size: ClassVar = 4

    def prior(self, z):
        y = z["one/value"]
        return y, constant([[1, 0, 0.2, 0], [0, 2, 0, 0], [0.2, 0, 1, 0], [0, 0, 0, 1]], y) + 0.0 * y[..., None]

    def predict(self, x, z, previous):
        one, half = 1.0 + 0.0 * x[..., 0], 0.5 * namespace(x).cos(x[..., 1])
        F = rows([[one, 0.0, 0.1, 0.0], [0.0, 0.9, 0.0, half], [0.0, 0.0, one, 0.0], [0.0, 0.2, 0.0, 0.8]])
        Q = rows([[0.1 * one, 0, 0.01, 0], [0, 0.2, 0, 0], [0.01, 0, 0.1, 0], [0, 0, 0, 0.1]])
        return (F @ x[..., None])[..., 0], F, Q

    def residual(self, x, z):
        one = 1.0 + 0.0 * x[..., 0]
        H = rows([[one, 0, 0.5, 0], [0, 1.0, 0, 0], [0, 0.3, 0, 1.0], [0, 0, 1.0, 0]])
        R = rows([[self.noise * one, 0, 0, 0.1], [0, 0.4, 0, 0], [0, 0, 0.5, 0], [0.1, 0, 0, 0.6]])
        return z["one/value"] - (H @ x[..., None])[..., 0], H, R

    def pose(self, x):
        return {"state": x}


def test_the_parts_are_the_whole():
    rng = np.random.default_rng(0)
    values = rng.standard_normal((60, 3, 4))
    values[1:][rng.random((59, 3, 4)) < 0.3] = np.nan
    data = {"one/value": values}
    kalman = KalmanFilter(Apart())
    arrays = replace(kalman, compiled=False)
    assert "gather" in print_model(Apart()).split("def run(")[1]
    fast, state = kalman.run_from(None, data)
    slow, same = arrays.run_from(None, data)
    np.testing.assert_allclose(state.covariance, same.covariance, atol=1e-12)
    for one, other in zip((fast.pose["state"], *fast[1:]), (slow.pose["state"], *slow[1:]), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)
    # a covariance that links the parts, made by hand in one sequence of the batch, is carried on
    linked = state.covariance.copy()
    linked[1, 0, 1] = linked[1, 1, 0] = 0.05
    fast, _ = kalman.run_from(state._replace(covariance=linked), data)
    slow, _ = arrays.run_from(same._replace(covariance=linked), data)
    assert np.abs(fast.covariance[0, 1, 0, 1]) > 1e-4
    assert np.all(fast.covariance[:, [0, 2], 0, 1] == 0.0)
    for one, other in zip((fast.pose["state"], *fast[1:]), (slow.pose["state"], *slow[1:]), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)
