"""Rules by hand: what they compute, and that they repair the belief in level ground."""

import dataclasses

import numpy as np
import pytest

import poise
from poise.baselines.gain_policy.rules import RULES, ruled
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.gain_episode import filter_for
from poise.envs.gain_reward import true_values
from poise.filters.adaptation.gains import DECADES, tunable_filter
from poise.filters.adaptation.rules import InnovationRule, PitchRateRule, TurningRule
from poise.filters.bicycle.two_gyro.filter import TwoGyro
from poise.filters.core.estimator import run_by_steps
from poise.filters.core.metrics import error

PLATFORM = tunable_filter("platform-gyro")
LEVEL = dataclasses.replace(PLATFORM, model=TwoGyro(model="sigma1", constraint=True))


@pytest.fixture(scope="module")
def ride():
    names = [channel.name for channel in LEVEL.channels]
    return poise.record(RiderBicycleEnv("pitch", 1, suite=names, fidelity="lumped", duration=18.0), seed=0)


def roll_error(estimator, ride):
    """Largest roll error after 10 s, deg."""
    roll = estimator.outputs[0]
    found = estimator.run(ride.measurements).pose[roll.name]
    return np.degrees(error(roll, found, true_values(ride, roll, estimator.filter))[1000:].max())


def test_the_gain_follows_the_peak_of_the_pitch_rate(ride):
    estimator = ruled(filter_for(LEVEL, ride), "constraint", PitchRateRule())
    rates = ride.measurements["bicycle_imu/gyr"][:, 1]
    _, _, actions = estimator.run_with_actions(None, ride.measurements)
    peak, (part,) = 0.0, estimator.policy.ranges
    rule = PitchRateRule()
    for start in range(0, len(rates) - 10, 10):
        peak = max(abs(np.nanmean(rates[start : start + 10])), peak * np.exp(-0.1 / rule.decay))
        wanted = 2.0 * np.log(max(peak / rule.threshold, 1.0)) / part.upper
        assert actions[start + 10, 0] == pytest.approx(min(wanted, 1.0), abs=1e-6)
    assert actions.max() > 0.1
    assert (actions[:10] == 0.0).all()


def test_stepping_equals_running(ride):
    short = {name: values[:150] for name, values in ride.measurements.items()}
    for rule in (PitchRateRule(), InnovationRule(), TurningRule()):
        estimator = ruled(filter_for(PLATFORM, ride), "measurement", rule)
        stepped, roll = run_by_steps(estimator, short), estimator.outputs[0].name
        np.testing.assert_array_equal(stepped.pose[roll], estimator.run(short).pose[roll])


def test_too_large_innovations_raise_the_variance_and_small_ones_lower_it(ride):
    def last_action(noise):
        model = dataclasses.replace(filter_for(PLATFORM, ride).model, pitch_rate_noise=noise)
        estimator = ruled(dataclasses.replace(PLATFORM, model=model), "measurement", InnovationRule())
        return estimator.run_with_actions(None, ride.measurements)[2][400, 0]

    assert last_action(1e-3) > 0.2
    assert last_action(1.0) < -0.2


def test_on_a_ramp_the_rules_keep_the_roll(ride):
    kalman = filter_for(LEVEL, ride)
    by_pitch, by_turning, plain = (
        roll_error(ruled(kalman, "constraint", rule), ride)
        for rule in (PitchRateRule(), TurningRule(), PitchRateRule(threshold=100.0))
    )
    assert by_pitch < 0.5 * plain
    assert by_turning < 0.5 * plain


def test_shaking_without_a_turn_turns_the_belief_off_and_a_calm_turn_strengthens_it():
    # straight ahead on rough ground: the pitch rate has no mean but shakes, and (5) drives the roll to 90 degrees
    time, rng = np.arange(3000) / 100.0, np.random.default_rng(2)
    shaken = np.zeros((3000, 3))
    shaken[:, 1] = np.radians(30.0) * rng.standard_normal(3000)
    shaken[:, 0] = np.radians(1.0) * np.cos(time)
    roll = np.radians(1.0) * np.sin(time)
    plain, by_turning = (
        np.degrees(np.abs(each.run({"bicycle_imu/gyr": shaken}).pose["bicycle/roll"][:, 0] - roll)).max()
        for each in (PLATFORM, ruled(PLATFORM, "measurement", TurningRule()))
    )
    assert plain > 30.0
    assert by_turning < 3.0
    calm = np.broadcast_to(np.radians([0.0, 0.0, 20.0]), (300, 3))
    estimator = ruled(PLATFORM, "measurement", TurningRule())
    (part,) = estimator.policy.ranges
    _, _, actions = estimator.run_with_actions(None, {"bicycle_imu/gyr": calm})
    assert actions[-1, 0] * -part.lower == pytest.approx(TurningRule().smallest)


def test_filters_without_the_gain_are_refused():
    with pytest.raises(ValueError, match="gains must be distinct names"):
        ruled(PLATFORM, "constraint", PitchRateRule())


def test_rules_of_a_single_imu_keep_the_common_range():
    """An agent may raise σ_A of this filter further than the rules, whose constants were chosen within it."""
    kalman = tunable_filter("external-acceleration")
    for name in ("innovation", "acceleration"):
        (part,) = ruled(kalman, "measurement", RULES[name]).policy.ranges
        assert (part.lower, part.upper) == pytest.approx((-DECADES * np.log(10.0), DECADES * np.log(10.0)))
