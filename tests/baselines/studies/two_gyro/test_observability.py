"""Ranks of the two-gyroscope paper's observability argument, exact, and the vector fields against the filter."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from poise.baselines.studies.two_gyro import observability as study
from poise.filters.analysis.observability import exact_rank, lie_gradients
from poise.filters.bicycle.two_gyro.filter import TwoGyro


def test_ranks():
    assert list(study.ranks().values()) == [7, 8, 8, 8, 9, 9]


def test_what_the_published_gradients_miss():
    """A common rate about the vertical in both gyroscopes is their null vector; it is seen by L_f0 f1 h."""
    fields, output, state = study.equations()
    angles, values = study.point()
    v = study.symbols()
    _, printed = exact_rank(lie_gradients(fields, output, state, study.PUBLISHED), angles, values)
    _, added = exact_rank(lie_gradients(fields, output, state, [("f0", "f1")]), angles, values)
    turns = [sympy.rot_axis1(-v["t1"]), sympy.rot_axis2(-v["t2"]), sympy.rot_axis3(-v["t3"])]
    relative = turns[0] * turns[1] * turns[2]
    vertical = relative.T * sympy.Matrix([0, sympy.sin(v["phi"]) / sympy.cos(v["phi"]), 1])
    vector = sympy.Matrix.vstack(sympy.zeros(4, 1), vertical, sympy.Matrix([0, 1]))
    _, exact = exact_rank(vector, angles, values)
    assert printed * exact == sympy.zeros(12, 1)
    assert added * exact != sympy.zeros(3, 1)


def test_roll_needs_a_turning_platform():
    fields, output, state = study.equations()
    still = {study.symbols()["p3"]: 0}
    words = [(), ("f0",), ("f4",), ("f0", "f1"), ("f0", "f4"), ("f0", "f0")]
    assert lie_gradients(fields, output, state, words)[:, 0].subs(still) == sympy.zeros(18, 1)
    assert lie_gradients(fields, output, state, [("f5",)])[:, 0].subs(still) != sympy.zeros(3, 1)


def test_fields_are_those_of_the_filter():
    rng = np.random.default_rng(0)
    fields, _, state = study.equations()
    model = TwoGyro(dt=1.0, integration="euler", imu_tilt=0.0, body_bias_time=11.0, platform_bias_time=13.0)
    x, body, platform = rng.uniform(-0.6, 0.6, len(state)), rng.normal(size=3), rng.normal(size=3)
    inputs = {"f0": 1.0, "f1": body[0], "f2": body[1], "f3": body[2], "f4": platform[0], "f5": platform[2]}
    v = study.symbols()
    rate = sum((fields[key] * value for key, value in inputs.items()), sympy.zeros(len(state), 1))
    values = dict(zip(state, x, strict=True)) | {v["qh"]: 1 / 11.0, v["qp"]: 1 / 13.0}
    expected = np.array(rate.subs(values), dtype=float)[:, 0]
    signs = np.array([1.0, -1.0, -1.0])
    sample = {"bicycle_imu/gyr": platform * signs, "trunk_imu/gyr": body * signs}
    np.testing.assert_allclose(model.predict(x, sample, sample)[0] - x, expected, atol=1e-12)


def test_wrong_words_are_refused():
    fields, output, state = study.equations()
    with pytest.raises(ValueError, match="words must consist of"):
        lie_gradients(fields, output, state, [("f9",)])
    with pytest.raises(ValueError, match="are missing"):
        exact_rank(lie_gradients(fields, output, state, [("f0",)]), {}, {})
