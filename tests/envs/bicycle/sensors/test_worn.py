"""Sensors as they are worn: placement errors of each ride, soft tissue, and what the truth says about both."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.sensors.placement import PLACED, PlacementErrors, placement_errors
from poise.envs.bicycle.sensors.single_imu import imu_of
from poise.envs.record import record
from poise.envs.sensors.ideal import Mounting
from poise.filters.core import rotation

SUITE = ["bicycle_imu/gyr", "trunk_imu/gyr", "trunk_imu/acc", "bicycle_imu/acc"]


def ride(seed=0, **options):
    env = RiderBicycleEnv("slow", suite=SUITE, duration=2.0, fidelity="lumped", **options)
    try:
        return record(env, seed=seed), env.geometry
    finally:
        env.close()


def test_ideal_sensors_sit_exactly_where_they_should():
    found, geometry = ride(sensors="ideal")
    np.testing.assert_array_equal(found.truth["trunk_imu/lever_arm"], np.tile(geometry.trunk_imu, (len(found), 1)))
    np.testing.assert_array_equal(found.truth["trunk_imu/rotation"], np.tile([1.0, 0.0, 0.0, 0.0], (len(found), 1)))


def test_soft_tissue_moves_the_sensor_and_leaves_the_truth_of_the_bones():
    worn, firm = ride()[0], ride(soft_tissue=0.0)[0]
    np.testing.assert_array_equal(worn.truth["trunk/orientation"], firm.truth["trunk/orientation"])
    np.testing.assert_array_equal(worn.measurements["bicycle_imu/gyr"], firm.measurements["bicycle_imu/gyr"])
    difference = (worn.measurements["trunk_imu/gyr"] - firm.measurements["trunk_imu/gyr"])[1:]
    assert 0.005 < difference.std() < 0.5
    # what the gyroscope reads besides the bone's rate is how the truth says that it turns on the bone
    turn = worn.truth["trunk_imu/rotation"]
    rate = rotation.log(rotation.multiply(rotation.conjugate(turn[:-1]), turn[1:])) / worn.dt
    assert np.abs(difference - rate).max() < 0.01
    moved = worn.truth["trunk_imu/lever_arm"] - firm.truth["trunk_imu/lever_arm"]
    assert 1e-5 < np.abs(moved).max() < 0.02


def test_placement_errors_differ_from_ride_to_ride_and_filters_do_not_know_them():
    (first, geometry), (again, _), (other, same) = (
        ride(seed, placement_errors=1.0, sensors="ideal") for seed in (0, 0, 1)
    )
    assert geometry == same
    shift, turn = first.truth["trunk_imu/lever_arm"], first.truth["trunk_imu/rotation"]
    np.testing.assert_array_equal(shift, again.truth["trunk_imu/lever_arm"])
    assert np.abs(shift - other.truth["trunk_imu/lever_arm"]).max() > 1e-3
    assert 1e-3 < np.abs(shift[0] - geometry.trunk_imu).max() < 0.06
    assert 1.0 < np.degrees(rotation.angle(turn[0])) < 20.0
    # an ideal IMU reads its true axes, and its own truth has them
    imu = imu_of(first, "trunk_imu")
    expected = rotation.multiply(first.truth["trunk/orientation"], turn)
    assert (
        np.abs(rotation.angle(rotation.multiply(rotation.conjugate(imu.truth["orientation"]), expected))).max() < 1e-9
    )
    turned = rotation.log(rotation.multiply(rotation.conjugate(expected[:-1]), expected[1:])) / first.dt
    np.testing.assert_allclose(imu.measurements["imu/gyr"][1:], turned, atol=1e-6)


def test_without_errors_the_noise_of_a_seed_stays():
    plain, placed = ride(soft_tissue=0.0)[0], ride(soft_tissue=0.0, placement_errors=0.0)[0]
    for name, values in plain.measurements.items():
        np.testing.assert_array_equal(values, placed.measurements[name])


def test_a_snapshot_keeps_places_and_tissue():
    env = RiderBicycleEnv("slow", suite=SUITE, duration=3.0, fidelity="lumped", placement_errors=1.0)
    env.reset(seed=4)
    action = env.neutral_action
    for _ in range(80):
        env.step(action)
    saved = env.snapshot()
    expected = [env.step(action) for _ in range(60)]
    env.reset(seed=5)
    env.restore(saved)
    for observation, *_, info in expected:
        found, *_, found_info = env.step(action)
        np.testing.assert_equal(found, observation)
        np.testing.assert_equal(found_info["truth"], info["truth"])
    env.close()


def test_draws_have_their_deviations_and_do_not_depend_on_the_suite():
    errors = PlacementErrors()
    site = Mounting((0.1, 0.0, 0.2))
    draws = [errors.draw(dict.fromkeys(PLACED, site), np.random.default_rng(seed)) for seed in range(400)]
    for name, shift, turn in (("trunk_imu", 0.015, 5.0), ("bicycle_imu", 0.005, 1.0)):
        places = np.array([draw[name].lever_arm for draw in draws]) - site.lever_arm
        assert places.std() == pytest.approx(shift, rel=0.1)
        angles = np.degrees([rotation.log(np.array(draw[name].rotation)) for draw in draws])
        assert angles.std() == pytest.approx(turn, rel=0.1)
    alone = errors.draw({"thigh_left": site}, np.random.default_rng(7))
    assert alone["thigh_left"] == draws[7]["thigh_left"]
    assert draws[7]["thigh_left"] != draws[7]["thigh_right"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PlacementErrors(worn_turn=-1.0), "worn_turn must not be negative"),
        (lambda: placement_errors(float("nan")), "placement_errors must be .* factor of at least 0, got nan"),
        (lambda: RiderBicycleEnv(placement_errors=-1.0), "placement_errors"),
        (lambda: RiderBicycleEnv(soft_tissue=-1.0), "soft_tissue must not be negative"),
    ],
)
def test_impossible_errors_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
