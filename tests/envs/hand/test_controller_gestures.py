"""Motions of the controller against the thesis' formulas and against SciPy's rotations."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from poise.envs.hand.controller_gestures import (
    BOTH_WAYS,
    DOWNWARDS,
    UPWARDS,
    Pointing,
    RateTable,
    Shaking,
    Walk,
    pointing_attitude,
    pointing_direction,
)
from poise.envs.hand.gestures import make_gesture
from poise.envs.hand.planar_motion import Infinity, planar_angle


def draw(config, seed=0, duration=None):
    return make_gesture(config, np.random.default_rng(seed), duration)


def as_matrices(orientation):
    return Rotation.from_quat(orientation[:, [1, 2, 3, 0]]).as_matrix()


def test_walk_has_the_corrected_variance_of_acceleration():
    config = Walk(planar=True)
    assert math.sqrt(config.acceleration_variance) == pytest.approx(30.1, abs=0.05)
    times = np.arange(2.0, 100.0, 0.01)
    squares = [np.mean(draw(config, seed).sample(times).acceleration[:, [0, 2]] ** 2) for seed in range(4)]
    assert np.mean(squares) == pytest.approx(config.acceleration_variance, rel=0.03)


def test_walk_at_the_knots_is_the_recurrence():
    """Second differences of x_k = (Δt/τ − 1) x_{k−2} + (2 − Δt/τ) x_{k−1} + Δt/τ Δx_k, run by SciPy."""
    config = Walk(planar=True, duration=5.0)
    gesture = draw(config, 3)
    acceleration = gesture.knots.acceleration
    velocity = np.cumsum(acceleration, axis=0) * config.interval
    x = np.cumsum(velocity, axis=0) * config.interval
    q = config.interval / config.correlation_time
    pushes = lfilter([1.0, q - 2.0, 1.0 - q], [q], x, axis=0)[5:]
    assert np.std(pushes[:, :2]) == pytest.approx(config.step, rel=0.1)
    assert np.std(pushes[:, 2]) == pytest.approx(config.angle_step, rel=0.1)
    lagged = np.sum(pushes[1:] * pushes[:-1], axis=0) / np.sum(pushes**2, axis=0)
    assert np.abs(lagged).max() < 0.2
    at_knots = gesture.sample(config.rest + config.interval * np.arange(len(acceleration)))
    np.testing.assert_allclose(at_knots.acceleration[:, 0], acceleration[:, 0], atol=1e-9)


def test_walk_in_space_moves_all_six_coordinates_and_planar_motion_stays_in_its_plane():
    times = np.arange(0.0, 20.0, 0.01)
    spatial = draw(Walk(), 1).sample(times)
    assert np.std(spatial.acceleration[200:], axis=0).min() > 25.0
    assert np.std(spatial.angular_velocity[200:], axis=0).min() > 0.1
    for config in (Walk(planar=True), Infinity()):
        motion = draw(config, 1).sample(times)
        assert np.abs(motion.position[:, 1]).max() == 0.0
        south = as_matrices(motion.orientation)[:, :, 2]
        np.testing.assert_allclose(south, np.tile([0.0, -1.0, 0.0], (len(times), 1)), atol=1e-12)
        phi = planar_angle(motion.orientation)
        first = as_matrices(motion.orientation)[:, :, 0]
        np.testing.assert_allclose(first, np.stack([np.cos(phi), 0 * phi, np.sin(phi)], axis=-1), atol=1e-12)


def test_infinity_is_the_figure_of_the_thesis():
    motion = draw(Infinity(rest=0.0, ramp=0.0)).sample(np.arange(0.0, 10.0, 0.01))
    t = motion.time
    np.testing.assert_allclose(motion.position[:, 0], 0.5 * np.sin(math.pi * t), atol=1e-12)
    np.testing.assert_allclose(motion.position[:, 2] - 1.2, 0.25 * np.sin(2 * math.pi * t), atol=1e-12)
    along = motion.velocity / np.linalg.norm(motion.velocity, axis=1, keepdims=True)
    np.testing.assert_allclose(as_matrices(motion.orientation)[:, :, 0], along, atol=1e-9)
    phi = np.degrees(np.unwrap(planar_angle(motion.orientation)))
    assert phi.max() == pytest.approx(45.0, abs=0.5)
    assert phi.min() == pytest.approx(-225.0, abs=0.5)
    assert np.abs(motion.angular_velocity).max() == pytest.approx(9.9, abs=0.1)
    rms = np.sqrt(np.mean(motion.acceleration**2, axis=0))
    np.testing.assert_allclose(rms[[0, 2]], [3.5, 7.0], atol=0.05)


def test_pointing_reaches_every_target():
    config = Pointing()
    gesture = draw(config, 4, 60.0)
    arrivals = config.rest + config.turn * np.arange(len(gesture.targets) - 2)
    motion = gesture.sample(arrivals)
    np.testing.assert_allclose(as_matrices(motion.orientation)[:, :, 1], gesture.targets[: len(arrivals)], atol=1e-9)
    assert np.abs(motion.angular_velocity).max() < 1e-9
    elevation, azimuth = np.arcsin(gesture.targets[:, 2]), np.arctan2(gesture.targets[:, 0], gesture.targets[:, 1])
    assert np.abs([elevation, azimuth]).max() <= config.spread + 1e-9
    assert np.std([elevation, azimuth], axis=1).min() > 0.3
    moving = gesture.sample(np.arange(3.0, 60.0, 0.01))
    np.testing.assert_allclose(np.std(moving.acceleration, axis=0), 5.0, rtol=0.25)


def test_pointing_formulas_are_those_of_the_thesis():
    psi, theta = 0.4, -0.3
    matrix = as_matrices(pointing_attitude(np.array([psi]), np.array([theta])))[0]
    expected = (Rotation.from_euler("z", -psi) * Rotation.from_euler("x", theta)).as_matrix()
    np.testing.assert_allclose(matrix, expected, atol=1e-12)
    np.testing.assert_allclose(matrix[:, 1], pointing_direction(np.array(psi), np.array(theta)), atol=1e-12)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_shaking_has_the_rates_asked_for_and_lulls(seed):
    config = Shaking()
    gesture = draw(config, seed)
    rates = np.linalg.norm(gesture.sample(np.arange(1.0, 100.0, 0.01)).angular_velocity, axis=1)
    assert math.sqrt(np.mean(rates**2)) == pytest.approx(4.3, rel=0.01)
    assert rates.max() == pytest.approx(15.0, rel=0.1)
    lulls = [np.arange(c - 0.15, c + 0.15, 0.01) for c in (13.0, 25.0, 37.0)]
    assert max(np.linalg.norm(gesture.sample(c).angular_velocity, axis=1).max() for c in lulls) < 1.2


def test_rate_table_holds_the_rates_of_the_thesis():
    np.testing.assert_allclose(np.degrees(UPWARDS)[[0, 1, -1]], [80, 160, 800])
    np.testing.assert_allclose(np.degrees(DOWNWARDS), [800, 700, 600, 500, 400, 300, 200, 100])
    np.testing.assert_allclose(np.degrees(BOTH_WAYS)[[0, 1, -1]], [-325, -300, 350])
    config = RateTable(rates=(1.0, -2.0), hold=3.0, ramp=0.5, offset=(0.2, 0.0, 0.0))
    gesture = draw(config, 2)
    motion = gesture.sample(np.array([0.5, 2.0, 4.4, 5.5, 7.9]))
    np.testing.assert_allclose(motion.angular_velocity[:, 2], [0.0, 1.0, 1.0, -2.0, -2.0])
    np.testing.assert_allclose(np.linalg.norm(motion.acceleration, axis=1), 0.2 * np.array([0, 1, 1, 4, 4]), atol=1e-12)
    assert config.duration == 8.0
    still = draw(RateTable(rates=()), 0).sample(np.arange(0.0, 5.0, 0.1))
    assert np.abs(still.velocity).max() == 0.0


def test_bad_numbers_are_refused():
    with pytest.raises(ValueError, match="interval must be positive and below correlation_time"):
        Walk(interval=2.0)
    with pytest.raises(ValueError, match="hold must be positive"):
        RateTable(hold=0.0)
    with pytest.raises(ValueError, match="attitude"):
        RateTable(attitude=(0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
@pytest.mark.parametrize(
    ("kind", "names"),
    [
        (Pointing, ("spread", "turn")),
        (Infinity, ("width", "height", "period")),
        (Shaking, ("rate", "peak", "cycle")),
    ],
)
def test_numbers_that_a_motion_divides_by_are_positive(kind, names, value):
    for name in names:
        with pytest.raises(ValueError, match=f"{name} must be positive and finite"):
            kind(**{name: value})
