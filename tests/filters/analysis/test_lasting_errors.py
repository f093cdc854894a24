"""Bounds with time-correlated errors: equal to plain ones without such errors, and to closed forms where any exist."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.studies.two_gyro.motion import MOTIONS, Errors, filter_of, simulate
from poise.filters.analysis.bounds import posterior_bound
from poise.filters.analysis.lasting_errors import Lasting, fitted_process, lasting_and_white, lasting_bound
from poise.filters.bicycle.two_gyro.truth import true_states
from poise.filters.core.quantity import DEG


def test_errors_of_no_size_change_nothing_and_a_gyroscope_bias_is_the_models_own():
    model, ride = filter_of(Errors(), 0.02), simulate(MOTIONS["circle"], 4.0, 0.02)
    x = true_states(ride.truth, model)
    plain = posterior_bound(model, x, ride.measurements)
    none = [Lasting((0.0,) * 3, channel="trunk_imu/gyr"), Lasting((0.0,), frequency=2.0, rows=np.eye(3)[:, :1])]
    np.testing.assert_allclose(lasting_bound(model, lambda _: x, ride.measurements, none), plain, atol=1e-12)

    # a constant bias of the body's gyroscope, as a time-correlated error instead of a state (axes: x, −y, −z)
    size = 0.3 * DEG
    known = filter_of(Errors(bias=1e-9, bias_drift=1e-12), 0.02)
    state = filter_of(Errors(bias=size, bias_drift=1e-12, bias_time=1e9), 0.02)
    platform = (Lasting((size,) * 3, channel="bicycle_imu/gyr"), Lasting((size,) * 3, channel="trunk_imu/gyr"))
    found = lasting_bound(known, lambda _: x, ride.measurements, platform)
    expected = posterior_bound(state, x, ride.measurements)
    np.testing.assert_allclose(found[:, :4, :4], expected[:, :4, :4], rtol=2e-3, atol=1e-9)


def test_an_output_that_is_off_keeps_the_error():
    model, ride = filter_of(Errors(bias=1e-9, bias_drift=1e-12), 0.02), simulate(MOTIONS["straight"], 4.0, 0.02)
    x, off = true_states(ride.truth, model), 1.0 * DEG
    wide = np.diag([*[1.0] * 4, *[1e-18] * 5])
    errors = [Lasting((off,) * 3, rows=np.eye(3))]
    white = (0.1 * DEG) ** 2 * np.eye(3)
    found = lasting_bound(model, lambda _: x, ride.measurements, errors, white=white, prior=wide)
    # θ₁ is about the axis of roll: no rate depends on it, while the motion of the body tells θ₂ and θ₃
    assert np.sqrt(found[-1, 1, 1]) == pytest.approx(off, rel=0.01)
    assert np.sqrt(found[-1, 2, 2]) < 0.2 * off


def test_a_part_that_lasts_is_told_from_white_noise():
    rng, dt = np.random.default_rng(3), 0.01
    process = Lasting((1.0,), frequency=6.0, damping=0.4)
    keep, stationary, _ = process.step(dt)
    root = np.linalg.cholesky(stationary - keep @ stationary @ keep.T)
    states = [np.linalg.cholesky(stationary) @ rng.standard_normal(2)]
    for noise in rng.standard_normal((20_000, 2)):
        states.append(keep @ states[-1] + root @ noise)
    slow = np.array(states)[:, :1]
    assert slow.std() == pytest.approx(1.0, rel=0.1)
    values = np.concatenate([3.0 + slow, 0.5 * slow + 0.2 * rng.standard_normal(slow.shape)], axis=-1)
    values[::7, 1] = np.nan
    (mean, moving, _, other), whites = lasting_and_white(values, dt)
    assert mean.std[0] == pytest.approx(3.0, rel=0.05)
    assert moving.std[0] == pytest.approx(1.0, rel=0.1)
    assert moving.frequency == pytest.approx(6.0, rel=0.25)
    assert moving.damping == pytest.approx(0.4, rel=0.4)
    assert not moving.returns
    rate = fitted_process(np.array(states)[:, 1], dt)
    assert rate == (pytest.approx(6.0, rel=0.25), pytest.approx(0.4, rel=0.4), True)
    assert other.std[0] == pytest.approx(0.5, rel=0.15)
    assert whites[1] == pytest.approx(0.2, rel=0.15)
    with pytest.raises(ValueError, match="values need at least 40 that are finite"):
        lasting_and_white(values[:30], dt)
