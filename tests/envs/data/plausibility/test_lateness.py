"""Channels that are late and gyroscopes of a wrong scale are named with the number; sound ones are left in peace."""

import numpy as np
import pytest

import poise
from poise.envs.data.plausibility.agreement import agreement
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import rotation


@pytest.fixture(scope="module")
def motions():
    return {seed: poise.record("poise/HandMotion-v0", seed=seed).replace(truth={}) for seed in (0, 3)}


def late(motion, lag, *kinds):
    """Some channels of a motion later by a lag in s."""
    moved = round(lag / motion.dt)
    part = slice(abs(moved), len(motion) - abs(moved))
    return motion.replace(
        measurements={
            name: np.roll(values, moved, axis=0) if name[4:] in kinds else values
            for name, values in motion.measurements.items()
        }
    )[part]


def told(motion):
    return [finding for finding in poise.check_recording(motion) if finding.severity == "warning"]


@pytest.mark.parametrize("lag", [-0.5, -0.1, 0.05, 0.2])
@pytest.mark.parametrize("kind", ["gyr", "acc", "mag"])
@pytest.mark.parametrize("seed", [0, 3])
def test_a_late_channel_is_named_with_its_lag(motions, seed, kind, lag):
    (found,) = poise.check_recording(late(motions[seed], lag, kind))
    # those of phones are so late
    assert found.severity == ("note" if kind == "mag" and lag == 0.05 else "warning")
    assert found.channel == f"imu/{kind}"
    assert f"{'late' if lag > 0.0 else 'early'} against the" in found.what
    assert float(found.what.split(" ms")[0]) == pytest.approx(1e3 * abs(lag), abs=10.0)


@pytest.mark.parametrize("lag", [0.03, 0.3])
def test_a_late_gyroscope_is_named_without_a_magnetometer(motions, lag):
    kept = {name: values for name, values in motions[0].measurements.items() if name != "imu/mag"}
    (found,) = told(late(motions[0].replace(measurements=kept), lag, "gyr"))
    assert found.what.endswith("late against the accelerometer")


@pytest.mark.parametrize("lag", [-0.3, 0.2, 0.3])
@pytest.mark.parametrize("gesture", ["fast", "severe", "mixed"])
def test_a_late_accelerometer_is_named_in_strong_motion(gesture, lag):
    motion = simulate_hand(gesture, seed=1, duration=60.0).replace(truth={})
    (found,) = told(late(motion, lag, "acc"))
    assert found.channel == "imu/acc"
    assert float(found.what.split(" ms")[0]) == pytest.approx(1e3 * abs(lag), abs=30.0)


@pytest.mark.parametrize("scale", [0.7, 0.85, 1.3, 1.5])
@pytest.mark.parametrize("seed", [0, 3])
def test_a_wrong_scale_of_the_gyroscope_is_named(motions, seed, scale):
    gyr = scale * motions[seed].measurements["imu/gyr"]
    (found,) = told(motions[seed].replace(measurements=motions[seed].measurements | {"imu/gyr": gyr}))
    assert float(found.what.split()[1]) == pytest.approx(scale, rel=0.03)


@pytest.mark.parametrize("gesture", ["slow", "fast", "walk", "turn"])
def test_sound_motions_are_left_in_peace(gesture):
    assert told(simulate_hand(gesture, seed=12, duration=15.0)) == []


@pytest.mark.parametrize("lag", [0.0, 0.083])
def test_the_fit_is_exact_on_a_rotation_of_known_rates(lag):
    time = np.arange(4000) / 100.0
    rate = np.stack([np.sin(1.1 * time), 0.8 * np.cos(0.7 * time), 0.5 * np.sin(1.9 * time + 1.0)], axis=1)
    q = np.empty((len(time), 4))
    q[0] = [1.0, 0.0, 0.0, 0.0]
    for t in range(1, len(time)):
        q[t] = rotation.multiply(q[t - 1], rotation.exp(0.01 * rate[t]))
    up = rotation.up_in_body(q)
    moved = np.stack([np.interp(time - lag, time, axis) for axis in rate.T], axis=1)
    found = agreement(1.2 * moved + [0.01, -0.02, 0.015], up, 0.01)
    # a sample describes the interval that it ends, a direction its end
    assert found.lag == pytest.approx(lag + 0.005, abs=0.002)
    assert found.scale == pytest.approx(1 / 1.2, rel=1e-3)
    assert found.explained > 0.999


def test_a_steady_turn_is_no_wrong_scale_of_the_accelerometer():
    time = np.arange(2000) / 100.0
    noise = np.random.default_rng(0).standard_normal((2, len(time), 3))
    spun = {"imu/gyr": [0.0, 0.0, 3.0] + 0.003 * noise[0], "imu/acc": [5.0, 0.0, 9.81] + 0.03 * noise[1]}
    assert not [one for one in told(Trajectory(time, spun)) if "where it is quiet" in one.what]
