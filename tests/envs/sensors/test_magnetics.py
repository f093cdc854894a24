"""Disturbed magnetic fields: statistics, dipoles, iron in sensor axes, blocks, and the spread of recorded ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE
from poise.envs.bicycle.rider.anthropometry import RiderBody
from poise.envs.bicycle.rider.posture import sit
from poise.envs.bicycle.sensors.sites import sensor_sites
from poise.envs.hand.sensing import simulate_hand
from poise.envs.sensors.ideal import BodyState, magnetic_field, mounted
from poise.envs.sensors.magnetics import MAGNETICS, MagneticField, Magnetics, dipole_field, magnetics_of
from poise.envs.sensors.suite import imu_suite
from poise.filters.core import rotation

EARTH = magnetic_field()


def at_rest(position, orientation=(1.0, 0.0, 0.0, 0.0)):
    """States at places, 10 ms apart."""
    position = np.asarray(position, dtype=float)
    zero = np.zeros_like(position)
    turn = np.broadcast_to(np.asarray(orientation), (len(position), 4))
    return BodyState(np.arange(len(position)) / 100.0, position, turn, zero, zero)


def field(magnetics, seed=0):
    return MagneticField(magnetics, EARTH, np.random.default_rng(seed))


def spread(preset, gesture, seed):
    """Standard deviation (µT) of the magnitude that the magnetometer of a motion tracker in a hand reads."""
    read = simulate_hand(gesture, seed, "xsens-mtw-awinda", duration=60.0, magnetics=preset)
    return np.std(np.linalg.norm(read.measurements["imu/mag"], axis=1))


def test_the_varying_field_has_its_size_and_length_and_no_sources():
    magnetics = Magnetics(variation=3.0, variation_length=0.8)
    base = np.random.default_rng(3).uniform(-50.0, 50.0, (400, 3))
    here, there = [], []
    for seed in range(20):
        drawn = field(magnetics, seed)
        here.append(drawn.around(at_rest(base)) - EARTH)
        there.append(drawn.around(at_rest(base + np.array([0.8, 0.0, 0.0]))) - EARTH)
    assert np.std(here) == pytest.approx(3.0, rel=0.05)
    # across the step the correlation falls to (1 - 1/2) exp(-1/2) and exp(-1/2) along it: a field without sources
    along = np.mean(np.array(here)[..., 0] * np.array(there)[..., 0]) / 9.0
    across = np.mean(np.array(here)[..., 1] * np.array(there)[..., 1]) / 9.0
    assert along > across + 0.1
    step, one = 1e-4, field(magnetics)
    divergence = sum(
        (one.around(at_rest(base + step * axis)) - one.around(at_rest(base - step * axis)))[:, index]
        for index, axis in enumerate(np.eye(3))
    )
    assert np.max(np.abs(divergence / (2.0 * step))) < 1e-5


def test_a_dipole_has_its_field_on_axis_and_across():
    moment = np.array([0.0, 0.0, 2.0])
    np.testing.assert_allclose(dipole_field(np.array([0.0, 0.0, 0.5]), moment), [0.0, 0.0, 2.0 * 0.1 * 2.0 / 0.125])
    np.testing.assert_allclose(dipole_field(np.array([0.5, 0.0, 0.0]), moment), [0.0, 0.0, -0.1 * 2.0 / 0.125])
    assert np.all(np.isfinite(dipole_field(np.zeros(3), moment)))


def test_iron_of_a_device_turns_with_it():
    drawn = field(Magnetics(hard_iron=5.0, soft_iron=0.05))
    turn = rotation.exp(np.array([0.3, -0.8, 2.0]))
    one, other = (drawn.at(at_rest(np.zeros((1, 3)), each), "imu") for each in ([1.0, 0.0, 0.0, 0.0], turn))
    assert np.linalg.norm(one - other) > 1.0
    soft, hard = drawn._device("imu")
    read = rotation.rotate_back(turn, other[0])
    np.testing.assert_allclose(read, soft @ rotation.rotate_back(turn, EARTH) + hard, atol=1e-12)
    np.testing.assert_allclose(soft, soft.T)
    assert not np.array_equal(drawn._device("trunk_imu")[1], hard)


def test_an_attached_magnet_has_its_strength():
    _, hard = field(Magnetics(attached_field=38.0))._device("imu")
    assert np.linalg.norm(hard) == pytest.approx(38.0)


def test_passing_magnets_come_as_often_and_as_close_as_asked():
    magnetics = Magnetics(passing_rate=0.1, passing_field=20.0)
    drawn = field(magnetics)
    states = at_rest(np.zeros((60_000, 3)))
    away = np.linalg.norm(drawn.around(states) - EARTH, axis=1)
    times = np.array([event[0] for event in drawn._passing.events])
    assert np.sum(times < 600.0) == pytest.approx(60, abs=25)
    # the closest approach of a lone dipole: between the field across its axis and along it
    alone = [t for t in times[times < 590.0] if np.min(np.abs(np.delete(times, np.searchsorted(times, t)) - t)) > 6.0]
    for t in alone:
        assert 9.0 < np.max(away[int(100 * t) - 3 : int(100 * t) + 4]) < 22.0


def test_a_steel_frame_disturbs_what_is_on_it_and_hardly_what_is_not():
    sites = sensor_sites(sit(MOUNTAIN_BIKE, RiderBody()))
    yaw = rotation.from_euler_zyx(np.linspace(0.0, 6.0, 40), np.zeros(40), np.zeros(40))
    bicycle = BodyState(np.arange(40.0), np.zeros((40, 3)), yaw, np.zeros((40, 3)), np.zeros((40, 3)))
    trunk = bicycle._replace(position=np.broadcast_to([0.3, 0.0, 1.4], (40, 3)))
    near, far = [], []
    for seed in range(30):
        drawn = field(Magnetics(frame=1.0), seed)
        near.append(np.linalg.norm(drawn.at(mounted(bicycle, sites.bicycle_imu), "a", bicycle) - EARTH, axis=1))
        far.append(np.linalg.norm(drawn.at(trunk, "b", bicycle) - EARTH, axis=1))
    assert 1.0 < np.mean(near) < 15.0
    assert np.mean(far) < 0.1 * np.mean(near)
    with pytest.raises(ValueError, match="frame must be 0 without a body 'bicycle'"):
        field(Magnetics(frame=1.0)).at(trunk, "a")


@pytest.mark.parametrize("name", sorted(set(MAGNETICS) - {"steel-frame"}))
def test_blocks_give_the_numbers_of_the_whole_and_saved_states_go_on(name):
    states = at_rest(np.cumsum(np.random.default_rng(0).normal(0.0, 0.01, (400, 3)), axis=0))

    def made():
        suite = imu_suite("xsens-mtw-awinda", 100.0, magnetometer=True, magnetics=name, timing="wired")
        suite.reset(np.random.default_rng(1))
        return suite

    whole, one = made().simulate(states).measurements["imu/mag"], made()
    first = one.simulate(states.at(slice(0, 130))).measurements["imu/mag"]
    saved = one.save()
    for suite in (one, made()):
        suite.restore(saved)
        rest = suite.simulate(states.at(slice(130, None))).measurements["imu/mag"]
        np.testing.assert_allclose(np.concatenate([first, rest]), whole, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("preset", "recorded"),
    [("laboratory", (0.8, 1.3)), ("fixed-magnets", (4.2, 4.2)), ("attached-magnet", (13.8, 13.8))],
)
def test_recorded_spreads_lie_among_the_simulated_ones(preset, recorded):
    # standard deviations of the magnitude in BROAD, over the moving part of each trial of the group, µT
    found = [spread(preset, gesture, seed) for gesture in ("mixed", "fast") for seed in range(6)]
    assert min(found) < min(recorded)
    assert max(recorded) < max(found)


def test_none_is_the_field_of_the_earth_and_scales_with_the_noise():
    calm = simulate_hand("slow", 0, "ideal", duration=2.0, magnetometer=True)
    for magnetics in ("undisturbed", Magnetics(), MAGNETICS["indoor"].scaled(0.0)):
        same = simulate_hand("slow", 0, "ideal", duration=2.0, magnetometer=True, magnetics=magnetics)
        np.testing.assert_array_equal(same.measurements["imu/mag"], calm.measurements["imu/mag"])
    indoor = simulate_hand("slow", 0, "ideal", duration=2.0, magnetometer=True, magnetics="indoor")
    np.testing.assert_array_equal(indoor.measurements["imu/gyr"], calm.measurements["imu/gyr"])
    assert np.max(np.abs(indoor.measurements["imu/mag"] - calm.measurements["imu/mag"])) > 1.0
    assert indoor.metadata["sensors"]["magnetics"]["variation"] == 5.0


def test_bad_disturbances_are_named():
    with pytest.raises(ValueError, match="hard_iron must be not negative and finite, got -1"):
        Magnetics(hard_iron=-1.0)
    with pytest.raises(ValueError, match="variation_length must be positive and finite, got 0"):
        replace(MAGNETICS["indoor"], variation_length=0.0)
    with pytest.raises(ValueError, match="unknown magnetic disturbance 'moon'"):
        magnetics_of("moon")
