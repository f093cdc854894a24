"""The head on its neck: published response to turns of the trunk, gaze, consistent derivatives, memory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE
from poise.envs.bicycle.rider.anthropometry import SUBJECTS
from poise.envs.bicycle.rider.body_motion import (
    ACROSS,
    LOOKS_AHEAD,
    TABLE_RATE,
    gaze_shifts,
    row_at,
    rows_at,
    scans,
    turn_time,
)
from poise.envs.bicycle.rider.head import HeadMotion
from poise.envs.bicycle.rider.posture import sit
from poise.envs.bicycle.rider.style import MOST_TURNED, STYLES, RiderMotion, RiderStyle
from poise.envs.sensors.ideal import BodyState
from poise.filters.core import rotation

POSTURE = sit(MOUNTAIN_BIKE, SUBJECTS[1])
RATE = 500.0
AHEAD = np.zeros((5000, 2))


def trunk(turn, seconds=8.0, rate=RATE):
    """A trunk in its posture that turns about the joint of the neck by ``turn(time)``, rotation vectors."""
    time = np.arange(1, round(seconds * rate) + 1) / rate

    def orientation(t):
        return rotation.multiply(rotation.exp(turn(t)), POSTURE.trunk_orientation())

    step = 1e-4
    before, now, after = (orientation(time + each) for each in (-step, 0.0, step))
    omega = rotation.log(rotation.multiply(after, rotation.conjugate(before))) / (2.0 * step)
    late = rotation.log(rotation.multiply(after, rotation.conjugate(now))) / step
    early = rotation.log(rotation.multiply(now, rotation.conjugate(before))) / step
    alpha = (late - early) / step
    arm = rotation.rotate(now, np.array(POSTURE.neck))
    swing = rotation.cross(omega, arm)
    return BodyState(time, -arm, now, -swing, omega, -rotation.cross(alpha, arm) - rotation.cross(omega, swing), alpha)


def gain(frequency, axis):
    """Amplitude of the head's turn in space relative to the trunk's, at a frequency in Hz."""
    turning = 0.01 * np.eye(3)[axis]
    head = HeadMotion(POSTURE, AHEAD, RATE).carry(
        trunk(lambda t: np.sin(2.0 * np.pi * frequency * t)[:, None] * turning)
    )
    found = rotation.log(head.orientation)[2000:, axis] / 0.01
    phase = 2.0 * np.pi * frequency * head.time[2000:]
    parts = np.linalg.lstsq(np.stack([np.sin(phase), np.cos(phase), 0.0 * phase + 1.0], axis=1), found, rcond=None)[0]
    return float(np.hypot(*parts[:2]))


@pytest.mark.parametrize("axis", [0, 1])
def test_the_response_has_the_published_peak(axis):
    """Peng, Hain and Peterson 1996: 1.1 dB at 2.9 Hz; steadier than the trunk below 2 and above 3.5 Hz."""
    assert 20.0 * np.log10(gain(2.9, axis)) == pytest.approx(1.1, abs=0.15)
    assert gain(2.9, axis) > max(gain(2.4, axis), gain(3.4, axis))
    assert gain(0.5, axis) == pytest.approx(1.0 / 1.821, abs=0.06)
    assert gain(5.0, axis) < 0.6
    assert gain(10.0, axis) < 0.2


def test_the_head_follows_slow_turns_of_the_path():
    head = HeadMotion(POSTURE, AHEAD, RATE).carry(trunk(lambda t: 0.4 * t[:, None] * np.array([0.0, 0.0, 1.0])))
    behind = 0.4 * head.time[-1] - rotation.log(head.orientation[-1])[2]
    assert np.degrees(behind) == pytest.approx(5.2, abs=0.5)


def test_rates_and_accelerations_are_derivatives():
    gaze = np.sin(np.arange(500) / TABLE_RATE)[:, None] * np.array([0.6, 0.3])
    moved = trunk(
        lambda t: np.stack([0.2 * np.sin(3.0 * t), 0.1 * np.sin(9.0 * t), 0.3 * np.sin(2.0 * t)], axis=1), 4.0
    )
    head = HeadMotion(POSTURE, gaze, RATE).carry(moved)
    inner, turn = slice(1, -1), rotation.multiply(head.orientation[2:], rotation.conjugate(head.orientation[:-2]))
    np.testing.assert_allclose(rotation.log(turn) * 0.5 * RATE, head.angular_velocity[inner], atol=1e-3)
    spin = (head.angular_velocity[2:] - head.angular_velocity[:-2]) * 0.5 * RATE
    assert np.sqrt(np.mean((spin - head.angular_acceleration[inner]) ** 2)) < 0.1
    np.testing.assert_allclose(head.position, 0.0, atol=1e-12)


def test_in_parts_it_is_the_same_bit_for_bit():
    style, whole = STYLES["aggressive"], trunk(lambda t: 0.1 * np.sin(5.0 * t)[:, None] * np.ones(3), 2.0)
    gaze = RiderMotion(style, np.random.default_rng(0), 10.0).gaze
    once, parts = HeadMotion(POSTURE, gaze, RATE), HeadMotion(POSTURE, gaze, RATE)
    expected = once.carry(whole)
    parts.carry(whole.at(slice(0, 300)))
    saved = parts.state
    parts.carry(whole.at(slice(300, 400)))
    parts.state = saved
    for found, one in zip(parts.carry(whole.at(slice(300, None))), expected, strict=True):
        np.testing.assert_array_equal(found, one[300:])


def test_gaze_moves_as_the_style_says():
    time = np.arange(0.0, 2000.0, 1.0 / TABLE_RATE)
    looks = gaze_shifts(np.random.default_rng(0), time, 0.3, 3.0)
    assert looks.std(axis=0) == pytest.approx([0.3 * np.sqrt(0.9), 0.3 * np.sqrt(0.9) * 0.4], rel=0.1)
    assert np.abs(np.diff(looks[:, 0])).max() * TABLE_RATE < np.radians(400.0)
    for style in STYLES.values():
        assert np.abs(RiderMotion(style, np.random.default_rng(1), 60.0).gaze).max() <= MOST_TURNED
    assert not RiderMotion(STYLES["still"], np.random.default_rng(1), 60.0).gaze.any()
    with pytest.raises(ValueError, match="gaze must not be negative"):
        RiderStyle("odd", 0.0, 0.0, 0.0, 0.0, 0.0, gaze=-1.0)


def test_most_looks_go_to_the_other_side_than_the_last():
    time = np.arange(0.0, 2000.0, 1.0 / TABLE_RATE)
    yaw = gaze_shifts(np.random.default_rng(0), time, 0.8, 3.0)[:, 0].round(9)
    held = yaw[1:][np.diff(yaw) == 0.0]
    looks = held[np.concatenate([[True], np.diff(held) != 0.0])]
    aside = np.sign(looks[looks != 0.0])
    assert np.mean(aside[1:] != aside[:-1]) == pytest.approx(ACROSS, abs=0.05)
    assert np.mean(looks == 0.0) == pytest.approx(LOOKS_AHEAD, abs=0.05)


def test_the_head_turns_at_its_own_pace_in_scans():
    time = np.arange(0.0, 300.0, 1.0 / TABLE_RATE)
    yaw = scans(np.random.default_rng(0), time, 0.9, 60.0)
    moving = np.flatnonzero(np.diff((np.diff(yaw) != 0.0).astype(int)))
    begin, end = moving[:2]
    assert (end - begin) / TABLE_RATE == pytest.approx(turn_time(yaw[end]), abs=3.0 / TABLE_RATE)


def test_an_acceleration_that_is_kept_from_the_head_does_not_pitch_it():
    shaken = trunk(lambda t: 0.0 * t[:, None] * np.ones(3), 4.0)
    forward = 2.0 * np.sin(2.0 * np.pi * 4.0 * shaken.time)
    velocity = np.cumsum(forward) / RATE
    shaken = shaken._replace(
        velocity=velocity[:, None] * np.array([1.0, 0.0, 0.0]),
        acceleration=forward[:, None] * np.array([1.0, 0.0, 0.0]),
    )
    passive, half, steady = (
        HeadMotion(POSTURE, AHEAD, RATE, steadied).carry(shaken).angular_velocity[:, 1] for steadied in (0.0, 0.5, 1.0)
    )
    np.testing.assert_allclose(half, 0.5 * passive, rtol=0.02, atol=1e-3)
    np.testing.assert_allclose(steady, 0.0, atol=1e-12)
    assert np.degrees(passive.std()) > 5.0


def test_scans_of_crossings_turn_the_head_alone():
    style = STYLES["aggressive"]
    scanning, ahead = (RiderMotion(each, np.random.default_rng(1), 600.0) for each in (style, replace(style, scan=0.0)))
    np.testing.assert_array_equal(scanning.table, ahead.table)
    np.testing.assert_array_equal(scanning.habits, ahead.habits)
    # before the limit of the neck
    added = MOST_TURNED * (np.arctanh(scanning.gaze / MOST_TURNED) - np.arctanh(ahead.gaze / MOST_TURNED))
    np.testing.assert_allclose(added[:, 1], 0.0, atol=1e-12)
    begun = np.count_nonzero(np.diff((np.abs(added[:, 0]) > 0.3).astype(int)) == 1)
    # two in ten fall into another one
    assert 0.7 < begun * style.scan_interval / 600.0 < 1.05


def test_many_rows_are_read_as_one():
    table = np.random.default_rng(0).standard_normal((200, 2))
    times = np.linspace(0.0, 3.9, 77)
    values, rates, _ = rows_at(table, times)
    np.testing.assert_allclose(values, [row_at(table, time) for time in times], atol=1e-12)
    later, _, _ = rows_at(table, times + 1e-7)
    np.testing.assert_allclose((later - values) / 1e-7, rates, atol=0.01)
