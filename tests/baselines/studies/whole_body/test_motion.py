"""Synthetic rides whose kinematics are exact, and the whole-body filter's consistency on them."""

import numpy as np
import pytest

from poise.baselines.studies.whole_body.consistency import consistencies
from poise.baselines.studies.whole_body.motion import IDEAL, ExactRide, SensorErrors
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.core import rotation

GEOMETRY = RiderGeometry()


def test_rates_turn_the_bodies():
    """Integrating the ideal interval gyroscopes gives the attitude of trunk and bicycle back."""
    ride = ExactRide(GEOMETRY, "outdoor", seed=1)
    recorded = ride.record(4.0, errors=IDEAL, sampling="interval")
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for rate in recorded.measurements["trunk_imu/gyr"][1:]:
        q = rotation.multiply(q, rotation.exp(0.01 * rate))
    ends = [ride.frame(t) @ rotation.euler_matrix("zxy", ride.trunk(t)) for t in (np.array(0.0), np.array(4.0))]
    to_paper = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    turned = to_paper @ rotation.to_matrix(q) @ to_paper.T
    np.testing.assert_allclose(ends[0] @ turned, ends[1], atol=1e-6)


def test_a_standing_bicycle_feels_gravity_and_a_turning_one_no_side_force():
    held = ExactRide(GEOMETRY, "held", seed=2).record(1.0, errors=IDEAL)
    tilt = GEOMETRY.bicycle_imu_tilt
    expected = 9.80665 * np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    np.testing.assert_allclose(held.measurements["bicycle_imu/acc"][5], expected, atol=1e-6)
    ride = ExactRide(GEOMETRY, "indoor", seed=2)
    t = np.linspace(0.0, 20.0, 400)
    assert np.degrees(ride.roll(t)).mean() == pytest.approx(-2.3, abs=0.3)
    assert abs(ride.forces(t)["bicycle_imu"][:, 2].mean()) < 0.1


def test_seeds_decide_everything_and_courses_are_checked():
    one, same, other = (ExactRide(GEOMETRY, seed=seed).record(1.0) for seed in (1, 1, 2))
    for name, values in one.measurements.items():
        np.testing.assert_array_equal(values, same.measurements[name])
    assert not np.allclose(one.measurements["trunk_imu/gyr"], other.measurements["trunk_imu/gyr"])
    assert SensorErrors().without_biases().limb_bias == 0.0
    with pytest.raises(ValueError, match="course must be one of"):
        ExactRide(GEOMETRY, "moon")


def test_the_filter_is_consistent_where_its_model_is_exact():
    """NEES at the end of 50 runs inside its 95 % bounds for each part that does not meet the others, and NIS."""
    found = consistencies(GEOMETRY, runs=50, seed=1, duration=0.8)
    for name in ("roll", "trunk and arms", "right leg", "all"):
        assert found[name].consistent, (name, found[name])
    assert found["NIS"].ratio == pytest.approx(1.0, abs=0.02)
