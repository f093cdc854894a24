"""Late, jittered and lost samples against the motion itself, block by block and from snapshots."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.hand.gestures import GESTURES, make_gesture
from poise.envs.sensors.ideal import interval_readings
from poise.envs.sensors.late import readings_at, state_at
from poise.envs.sensors.suite import imu_suite
from poise.envs.sensors.timing import TIMINGS, Clock, Timing, timing_of
from poise.filters.core import rotation

RATE = 100.0
GESTURE = make_gesture(GESTURES["severe"], np.random.default_rng(4), 12.0)
TIMES = np.arange(1, 1001) / RATE
STATES = GESTURE.sample(TIMES)


def measured(timing, blocks=(1000,), seed=2, **options):
    """Measurements of an IMU, in blocks."""
    suite = imu_suite(options.pop("preset", "ideal"), RATE, (0.1, 0.0, 0.02), timing=timing, **options)
    suite.reset(np.random.default_rng(seed))
    parts, start = [], 0
    for size in blocks:
        parts.append(suite.simulate(STATES.at(slice(start, start + size))).measurements)
        start += size
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def test_states_between_steps_are_those_of_the_motion():
    times = np.random.default_rng(0).uniform(0.1, 9.9, 500)
    found, true = state_at(STATES, times), GESTURE.sample(times)
    np.testing.assert_allclose(found.position, true.position, atol=2e-5)
    np.testing.assert_allclose(found.velocity, true.velocity, atol=5e-3)
    apart = rotation.angle(rotation.multiply(rotation.conjugate(found.orientation), true.orientation))
    assert np.max(apart) < 1e-4
    np.testing.assert_allclose(found.angular_velocity, true.angular_velocity, atol=2e-2)
    np.testing.assert_allclose(state_at(STATES, TIMES[1:]).position, STATES.position[1:], atol=1e-12)


def test_a_delayed_sample_is_the_mean_over_the_earlier_interval():
    lag = 0.0137
    read = measured(Timing(delay=lag))
    after, before = GESTURE.sample(TIMES - lag), GESTURE.sample(TIMES - lag - 1.0 / RATE)
    rate, _ = interval_readings(before, after)
    assert np.isnan(read["imu/gyr"][:3]).all()
    np.testing.assert_allclose(read["imu/gyr"][3:], rate[3:], atol=0.01)
    punctual = measured(None)["imu/gyr"]
    assert np.nanmax(np.abs(read["imu/gyr"] - punctual)) > 0.3


def test_a_delay_of_whole_steps_shifts_the_samples():
    read, punctual = measured(Timing(delay=0.02)), measured(None)
    for name, values in read.items():
        np.testing.assert_allclose(values[3:], punctual[name][1:-2], atol=1e-9)


def test_delayed_strapdown_ends_at_the_delayed_attitude():
    lag = 0.0074
    read = measured(Timing(delay=lag))
    attitude = GESTURE.sample(TIMES[1:2] - lag).orientation[0]
    for rate in read["imu/gyr"][2:]:
        attitude = rotation.multiply(attitude, rotation.exp(rate / RATE))
    apart = rotation.multiply(rotation.conjugate(attitude), GESTURE.sample(TIMES[-1:] - lag).orientation[0])
    assert rotation.angle(apart) < 1e-3


@pytest.mark.parametrize("timing", [*TIMINGS, "everything"])
@pytest.mark.parametrize("sampling", ["interval", "instant"])
def test_blocks_give_the_numbers_of_the_whole(timing, sampling):
    if timing == "everything":
        timing = Timing(delay=0.013, jitter=0.004, clock_drift=5e-3, burst_rate=0.5)
    whole = measured(timing, sampling=sampling, preset="xsens-mtw-awinda", magnetometer=25.0)
    parts = measured(timing, (1, 1, 3, 45, 400, 550), sampling=sampling, preset="xsens-mtw-awinda", magnetometer=25.0)
    for name, values in whole.items():
        np.testing.assert_allclose(parts[name], values, rtol=0.0, atol=1e-12)


def test_saved_states_go_on_exactly():
    timing = Timing(delay=0.013, jitter=0.004, clock_drift=5e-3, burst_rate=0.5)

    def made(seed):
        suite = imu_suite("bosch-bmi160", RATE, timing=timing, magnetics=None)
        suite.reset(np.random.default_rng(seed))
        return suite

    one, other = made(1), made(7)
    one.simulate(STATES.at(slice(0, 100)))
    state = one.save()
    ahead = one.simulate(STATES.at(slice(100, 400))).measurements
    for suite in (one, other):
        suite.restore(state)
        again = suite.simulate(STATES.at(slice(100, 400))).measurements
        for name, values in ahead.items():
            np.testing.assert_array_equal(again[name], values)


def test_no_errors_of_timing_leave_the_numbers_as_they_are():
    plain, late = measured(None, preset="bosch-bmi160"), measured("wireless", preset="bosch-bmi160", noise_scale=0.0)
    ideal = measured(None, preset="bosch-bmi160", noise_scale=0.0)
    for name, values in measured("punctual", preset="bosch-bmi160").items():
        np.testing.assert_array_equal(values, plain[name])
        np.testing.assert_array_equal(late[name], ideal[name])


def test_packets_hold_all_channels_of_a_device():
    read = measured(Timing(burst_rate=1.0, burst_duration=0.1))
    gone = {name: np.isnan(values[1:, 0]) for name, values in read.items()}
    np.testing.assert_array_equal(gone["imu/gyr"], gone["imu/acc"])
    assert 0.02 < np.mean(gone["imu/gyr"]) < 0.3


def test_lags_have_their_sizes():
    lag, lost = Clock(Timing(delay=0.01, jitter=0.002), RATE, np.random.default_rng(0)).advance(np.arange(20_000))
    assert np.min(lag) >= 0.01
    assert np.max(lag) <= 0.0161
    assert np.sqrt(np.mean((lag - 0.01) ** 2)) == pytest.approx(0.002, rel=0.05)
    assert not np.any(lost)


@pytest.mark.parametrize("seed", [3, 4])
def test_a_drifting_clock_slips_when_a_step_has_added_up(seed):
    clock = Clock(Timing(delay=0.004, clock_drift=1e-3), RATE, np.random.default_rng(seed))
    drift = clock.save().drift
    assert (drift > 0.0) == (seed == 3)
    lag, lost = clock.advance(np.arange(100_000))
    np.testing.assert_allclose(lag[:300], 0.004 + drift * np.arange(300) / RATE)
    assert np.min(lag) >= 0.0
    assert np.max(lag) <= 0.0141
    # a slow clock may use up the delay first
    slips = abs(drift) * 100_000 - (0.4 if drift < 0.0 else 0.0)
    assert np.sum(np.abs(np.diff(lag)) > 0.5 / RATE) == pytest.approx(slips, abs=1.0)
    assert np.sum(lost) == (0 if drift > 0.0 else pytest.approx(slips, abs=1.0))


def test_late_readings_go_the_short_way_round():
    known, wanted = np.array([0.0, 1.0]), np.array([0.5])
    angle = readings_at(known, np.array([[3.1], [-3.1]]), wanted, "angle")
    assert abs(angle[0, 0]) == pytest.approx(np.pi)
    turn = rotation.exp(np.array([0.0, 0.0, 0.4]))
    middle = readings_at(known, np.stack([[1.0, 0.0, 0.0, 0.0], -turn]), wanted, "rotation")
    np.testing.assert_allclose(middle[0], rotation.exp(np.array([0.0, 0.0, 0.2])), atol=1e-12)


def test_bad_timings_are_named():
    with pytest.raises(ValueError, match=r"delay must be in \[0, inf\), got -1"):
        Timing(delay=-1.0)
    with pytest.raises(ValueError, match=r"clock_drift must be in \[0, 1\), got 1"):
        Timing(clock_drift=1.0)
    with pytest.raises(ValueError, match="burst_duration must be positive and finite, got 0"):
        Timing(burst_duration=0.0)
    with pytest.raises(ValueError, match="unknown timing 'late'"):
        timing_of("late", "imu")
    with pytest.raises(ValueError, match=r"timing must be of sites among \['imu'\], got \['seat'\]"):
        imu_suite(timing={"seat": "wired"})
