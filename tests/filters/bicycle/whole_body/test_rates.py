"""Angle rates of trunk, hips and shoulders: the paper's fixtures, sympy's frames, finite differences."""

import numpy as np
import pytest
import sympy as sp
from scipy.spatial.transform import Rotation
from sympy.physics.mechanics import ReferenceFrame, dynamicsymbols

from poise.filters.bicycle.whole_body.rates import RATES, advance, yxy_rates, zxy_rates
from poise.filters.core import rotation

CHILD = np.array([0.1, -0.2, 0.3])


def random_angles(rng, sequence):
    angles = rng.uniform(-1.0, 1.0, 3)
    return angles + np.array([0.0, -1.5, 0.0]) * (sequence == "yxy")


def test_numbers_of_an_independent_computation():
    turn = Rotation.from_euler("Z", 10.0, degrees=True)
    found = zxy_rates(np.array([0.3, 0.2, -0.4]), CHILD, turn.apply([0.4, 0.5, -0.6])).rates
    np.testing.assert_allclose(found, [1.012084, -0.484144, -0.718992], atol=5e-7)
    found = yxy_rates(np.array([0.6, -1.4, 0.1]), CHILD, np.array([0.4, 0.5, -0.6])).rates
    np.testing.assert_allclose(found, [-0.160766, -0.539469, -0.523084], atol=5e-7)


@pytest.mark.parametrize("sequence", ["zxy", "yxy"])
def test_against_sympy_frames(sequence):
    """A child frame turned by Euler angles of known rates: the formula gives the rates back from the gyroscopes."""
    angles = dynamicsymbols("a b c")
    parent_rate = sp.symbols("q1:4")
    ground, parent, child = ReferenceFrame("N"), ReferenceFrame("P"), ReferenceFrame("C")
    parent.orient_axis(ground, ground.x, 0)
    parent.set_ang_vel(ground, sum(q * axis for q, axis in zip(parent_rate, parent, strict=True)))
    child.orient_body_fixed(parent, angles, sequence.upper())
    vector = child.ang_vel_in(parent).express(child) + parent.ang_vel_in(ground).express(child)
    t = dynamicsymbols._t
    rates = sp.symbols("r1:4")
    expression = vector.to_matrix(child).subs(dict(zip([a.diff(t) for a in angles], rates, strict=True)))
    gyroscope = sp.lambdify([*angles, *rates, *parent_rate], list(expression))
    matrix = sp.lambdify(angles, parent.dcm(child))
    rng = np.random.default_rng(0)
    for _ in range(5):
        e, wanted, q = random_angles(rng, sequence), rng.standard_normal(3), rng.standard_normal(3)
        found = RATES[sequence](e, np.array(gyroscope(*e, *wanted, *q), dtype=float), q)
        np.testing.assert_allclose(found.rates, wanted, atol=1e-12)
        np.testing.assert_allclose(rotation.euler_matrix(sequence, e), matrix(*e), atol=1e-14)


@pytest.mark.parametrize("sequence", ["zxy", "yxy"])
def test_derivatives(sequence):
    rng = np.random.default_rng(1)
    e, w, q = random_angles(rng, sequence), rng.standard_normal(3), rng.standard_normal(3)
    found, h = RATES[sequence](e, w, q), 1e-6
    for i in range(3):
        step = h * np.eye(3)[i]
        for matrix, plus, minus in (
            (found.by_angles, (e + step, w, q), (e - step, w, q)),
            (found.by_child, (e, w + step, q), (e, w - step, q)),
            (found.by_parent, (e, w, q + step), (e, w, q - step)),
        ):
            slope = (RATES[sequence](*plus).rates - RATES[sequence](*minus).rates) / (2.0 * h)
            np.testing.assert_allclose(matrix[:, i], slope, atol=1e-8)
    end, by, _ = advance(sequence, e, w, q, 0.05)
    slopes = [
        (advance(sequence, e + s, w, q, 0.05)[0] - advance(sequence, e - s, w, q, 0.05)[0]) / 2e-6
        for s in 1e-6 * np.eye(3)
    ]
    np.testing.assert_allclose(by, np.transpose(slopes), atol=1e-8)
    assert not np.allclose(end, e)


@pytest.mark.parametrize("sequence", ["zxy", "yxy"])
def test_the_midpoint_rule_turns_as_the_gyroscopes_do(sequence):
    """Constant rates of child and parent for a second, against SciPy's exponentials."""
    rng = np.random.default_rng(2)
    e, w, q = random_angles(rng, sequence), 0.5 * rng.standard_normal(3), 0.5 * rng.standard_normal(3)
    first = Rotation.from_matrix(rotation.euler_matrix(sequence, e))
    exact = Rotation.from_rotvec(-q) * first * Rotation.from_rotvec(w)
    for _ in range(1000):
        e = advance(sequence, e, w, q, 0.001)[0]
    np.testing.assert_allclose(rotation.euler_matrix(sequence, e), exact.as_matrix(), atol=1e-6)


def test_euler_angles_and_axes():
    rng = np.random.default_rng(3)
    e = rng.uniform(-1.2, 1.2, (20, 3))
    matrix = Rotation.from_euler("ZXY", e).as_matrix()
    np.testing.assert_allclose(rotation.euler_matrix("zxy", e), matrix, atol=1e-14)
    np.testing.assert_allclose(rotation.euler_zxy(matrix), e, atol=1e-12)
    e[:, 1] -= 1.5
    matrix = Rotation.from_euler("YXY", e).as_matrix()
    np.testing.assert_allclose(rotation.euler_yxy(matrix), e, atol=1e-12)
    e[:, 1] *= -1.0
    np.testing.assert_allclose(rotation.euler_yxy(Rotation.from_euler("YXY", e).as_matrix(), 1.0), e, atol=1e-12)
    for sequence in ("zxy", "yxy"):
        R, J, h = rotation.euler_matrix(sequence, e[0]), rotation.euler_axes(sequence, e[0]), 1e-6
        for i in range(3):
            step = h * np.eye(3)[i]
            dR = (rotation.euler_matrix(sequence, e[0] + step) - rotation.euler_matrix(sequence, e[0] - step)) / (2 * h)
            np.testing.assert_allclose(dR, rotation.skew(J[:, i]) @ R, atol=1e-9)
