"""What is true, and sensors against it: strapdown, forces, angles, postures, the physics step."""

from __future__ import annotations

import math

import numpy as np
import pytest

from poise.baselines.studies.rides.checks import strapdown_errors
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.ride.truth import BODIES, ISB, continuous_pose, isb_yxy, isb_zxy
from poise.envs.bicycle.rider.anthropometry import SUBJECTS
from poise.envs.record import record
from poise.envs.sensors.ideal import STANDARD_GRAVITY
from poise.filters.core import rotation

IMU = ["bicycle_imu/gyr", "bicycle_imu/acc"]


def recorded(seed=0, **options):
    """An episode."""
    env = RiderBicycleEnv(**options)
    trajectory = record(env, seed=seed)
    env.close()
    return trajectory


def test_strapdown_returns_to_the_truth():
    position, attitude = strapdown_errors(recorded(2, scenario="straight", suite=IMU, sensors="ideal", duration=5.0))
    assert position < 0.01
    assert math.degrees(attitude) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("name", ["indoor_circle", "outdoor"])
def test_strapdown_over_thirty_seconds(name):
    position, attitude = strapdown_errors(recorded(2, scenario=name, suite=IMU, sensors="ideal", duration=30.0))
    assert position < 0.01
    assert math.degrees(attitude) < 0.01


def test_sensors_read_what_is_true():
    ride = recorded(suite="all", sensors="ideal", fidelity="full", duration=2.0)
    read = {name: values[1:] for name, values in ride.measurements.items()}
    true = {name: values[1:] for name, values in ride.truth.items()}
    seat = true["seat/force"]
    hands = np.concatenate([true["handlebar/force_left"], true["handlebar/force_right"]], axis=1)
    np.testing.assert_allclose(read["seat/load_cells"].sum(axis=1), -seat[:, 2], rtol=1e-4)
    np.testing.assert_allclose(read["handlebar/force"], hands, rtol=1e-4, atol=1e-3)
    wrench = np.linalg.norm(read["seat/wrench"][:, :3], axis=1)
    np.testing.assert_allclose(wrench, np.linalg.norm(seat, axis=1), rtol=1e-4)
    np.testing.assert_allclose(read["steer/angle"], true["bicycle/steer"], atol=1e-6)
    np.testing.assert_allclose(read["wheel/speed"], true["bicycle/speed"], atol=0.05)
    total = seat + hands[:, :3] + hands[:, 3:] + true["pedal/force_left"] + true["pedal/force_right"]
    np.testing.assert_allclose(total[:, 2], -SUBJECTS[0].mass * STANDARD_GRAVITY, rtol=0.3)
    rates = ride.truth["trunk/angular_rate"]
    np.testing.assert_allclose(read["trunk_imu/gyr"], 0.5 * (rates[1:] + rates[:-1]), atol=0.02)


def test_angles_rebuild_the_orientations():
    q = rotation.random(np.random.default_rng(0), (50,))

    def turn(angle, axis):
        v = np.zeros((len(angle), 3))
        v[:, axis] = angle
        return rotation.exp_matrix(v)

    R = ISB @ rotation.to_matrix(q) @ ISB.T
    z, x, y = isb_zxy(q).T
    np.testing.assert_allclose(turn(z, 2) @ turn(x, 0) @ turn(y, 1), R, atol=1e-9)
    first, second, third = isb_yxy(q).T
    np.testing.assert_allclose(turn(first, 1) @ turn(second, 0) @ turn(third, 1), R, atol=1e-7)
    assert np.all(second <= 0.0)


def test_postures_are_those_of_a_rider():
    truth = recorded(duration=3.0, scenario="straight").truth
    assert -50.0 < np.degrees(truth["trunk/angles"])[:, 0].mean() < -20.0
    knee = np.degrees(truth["knee_left/flexion"])
    assert 20.0 < knee.min() < 60.0
    assert 95.0 < knee.max() < 130.0
    assert 30.0 < np.degrees(truth["elbow_right/flexion"]).mean() < 100.0
    up = np.array([0.0, 0.0, 1.0])
    heights = {body: rotation.rotate(truth[f"{body}/orientation"], up)[:, 2] for body in BODIES}
    assert heights["bicycle"].min() > 0.95
    assert heights["thigh_left"].min() > 0.1


def test_knees_stay_in_their_plane():
    truth = recorded(2, duration=10.0, scenario="straight", fidelity="full").truth
    for side in ("left", "right"):
        _, abduction, turn = np.degrees(truth[f"hip_{side}/angles"]).T
        assert np.abs(abduction).max() < 20.0
        assert np.abs(turn).max() < 30.0


def test_quaternions_of_the_truth_never_change_sign():
    """Two turns of the circle: a heading that passes 180° is where they would."""
    truth = recorded(scenario="slalom", fidelity="lumped", duration=3.0, style="aggressive").truth
    circle = recorded(scenario="indoor_circle", fidelity="lumped", duration=35.0, suite=["wheel/speed"]).truth
    assert np.ptp(np.unwrap(circle["bicycle/yaw"][:, 0])) > 2.0 * math.pi
    for each in (truth, circle):
        for body in BODIES:
            q = each[f"{body}/orientation"]
            assert q[0, 0] >= 0.0
            assert (q[1:] * q[:-1]).sum(axis=1).min() > 0.9
    assert circle["bicycle/orientation"][:, 0].min() < 0.0


def test_signs_are_carried_from_block_to_block():
    rng = np.random.default_rng(0)
    smooth = rotation.multiply(rotation.random(rng), rotation.exp(np.outer(np.linspace(0.0, 9.0, 40), [0.3, 0.5, 0.8])))
    mixed = {"trunk/orientation": smooth * rng.choice([-1.0, 1.0], (40, 1)), "bicycle/speed": np.ones((40, 1))}
    whole, _ = continuous_pose(mixed, {})
    last, parts = {}, []
    for begin in (0, 1, 17):
        end = {0: 1, 1: 17, 17: 40}[begin]
        part, last = continuous_pose({name: values[begin:end] for name, values in mixed.items()}, last)
        parts.append(part["trunk/orientation"])
    q = whole["trunk/orientation"]
    assert np.array_equal(q, np.concatenate(parts))
    assert np.array_equal(q, smooth * np.sign(smooth[0, 0]))
    assert whole["bicycle/speed"] is mixed["bicycle/speed"]


@pytest.mark.slow
def test_halving_the_physics_step_changes_little():
    signals = [
        recorded(
            3, fidelity="full", sensors="ideal", suite="all", duration=10.0, physics_rate=physics_rate
        ).measurements
        for physics_rate in (500.0, 1000.0)
    ]
    for name, limit in (("bicycle_imu/gyr", 0.02), ("trunk_imu/gyr", 0.02), ("bicycle_imu/acc", 0.1)):
        assert np.sqrt(np.mean((signals[0][name][1:] - signals[1][name][1:]) ** 2)) < limit, name
