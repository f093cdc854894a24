"""Riders who stand on the pedals: nothing on the saddle, the weight on feet and hands, upright."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE
from poise.envs.bicycle.rider.anthropometry import SUBJECTS, rider_body
from poise.envs.bicycle.rider.body_motion import RISE_TIME, STAND_TIME, TABLE_RATE, standing_phases
from poise.envs.bicycle.rider.posture import ARM_REACH, CRANKS, loop_closure_error, sit
from poise.envs.bicycle.rider.standing import LEG_STRETCHED, stance
from poise.envs.bicycle.rider.style import STYLES, RiderMotion, RiderStyle, random_style
from poise.envs.record import record_once
from poise.envs.sensors.ideal import STANDARD_GRAVITY

FORCES = tuple(f"{part}/force_{side}" for part in ("handlebar", "pedal") for side in ("left", "right"))


def ridden(duration, scenario="straight", subject=0, seed=3, **options):
    chosen = {"style": "standing", "suite": ["seat/load_cells"], "sensors": "ideal"} | options
    return record_once(RiderBicycleEnv(scenario, subject, duration=duration, **chosen), seed)


@pytest.mark.parametrize("subject", range(5))
def test_standing_hips_are_higher_and_ahead_and_the_trunk_more_upright(subject):
    seated = sit(MOUNTAIN_BIKE, SUBJECTS[subject])
    found = stance(seated)
    assert found.above > 0.0
    assert found.ahead > 0.1
    assert found.posture.flexion < seated.flexion
    farthest = np.linalg.norm(found.posture.leg_target("left", CRANKS), axis=1).max()
    assert farthest == pytest.approx(LEG_STRETCHED * seated.leg.reach)
    reach = np.linalg.norm(found.posture.arm_target("left", 0.0, found.posture.trunk_orientation()))
    assert reach == pytest.approx(ARM_REACH * seated.arm.reach)


def test_phases_begin_seated_and_have_their_share():
    time = np.arange(0.0, 2000.0, 1.0 / TABLE_RATE)
    phases = standing_phases(np.random.default_rng(0), time, 0.7)
    assert phases[0] == 0.0
    assert phases.min() >= -1e-9
    assert phases.max() <= 1.0 + 1e-9
    assert phases.mean() == pytest.approx(0.7, abs=0.05)
    always = standing_phases(np.random.default_rng(0), time, 1.0)
    assert np.all(always[time > 2.0 * RISE_TIME] == 1.0)
    assert STAND_TIME[0] > 2.0 * RISE_TIME


@pytest.mark.parametrize("fidelity", ["full", "lumped"])
def test_feet_and_hands_carry_a_standing_rider(fidelity):
    ride = ridden(10.0, fidelity=fidelity, style=dataclasses.replace(STYLES["standing"], standing=1.0))
    up = ride.time > 2.0
    truth = {name: values[up] for name, values in ride.truth.items()}
    assert ride.metadata.get("ended") != "terminated"
    seat = truth["seat/force"][:, 2]
    assert np.mean(np.abs(seat) < 5.0) > 0.98
    weight = STANDARD_GRAVITY * rider_body(0).mass
    assert -(seat + sum(truth[name][:, 2] for name in FORCES)).mean() == pytest.approx(weight, rel=0.02)
    # cells carry what the saddle does: next to nothing
    assert np.abs(ride.measurements["seat/load_cells"][up].sum(axis=1)).mean() < 5.0
    assert max(truth[f"pedal/force_{side}"][:, 2].max() for side in ("left", "right")) < 0.0
    assert truth["pelvis/height"].mean() > 0.02
    assert truth["pelvis/shift"][:, 0].mean() > 0.1
    # the bicycle leans to the right while the left foot pushes
    roll = truth["bicycle/roll"][:, 0] - truth["bicycle/roll"].mean()
    assert 2.0 * np.mean(roll * np.cos(truth["bicycle/crank"][:, 0])) > (0.01 if fidelity == "full" else 0.0)
    gaps = loop_closure_error(ride.truth, sit(MOUNTAIN_BIKE, rider_body(0)))
    assert gaps.max() < 2e-3 if fidelity == "full" else gaps[:, 2:].max() < 1e-3


def test_a_rider_who_stands_no_more_sits_as_before():
    ride = ridden(30.0, style=dataclasses.replace(STYLES["standing"], standing=0.6), fidelity="lumped")
    seat, shift = ride.truth["seat/force"][:, 2], ride.truth["pelvis/shift"]
    seated = np.abs(ride.truth["pelvis/height"][:, 0]) < 0.005
    assert ride.metadata.get("ended") != "terminated"
    assert 0.05 < np.mean(seated) < 0.7
    assert seat[seated].mean() < -200.0
    assert np.abs(shift[seated]).mean() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("fidelity", ["full", "lumped"])
@pytest.mark.parametrize("scenario", ["straight", "outdoor", "pitch", "stop-and-go"])
def test_a_standing_rider_stays_up_for_a_minute(scenario, fidelity):
    ride = ridden(60.0, scenario, fidelity=fidelity)
    assert ride.metadata.get("ended") != "terminated"
    # who stops and starts sits for that
    assert np.mean(np.abs(ride.truth["seat/force"][:, 2]) < 5.0) > 0.3


def test_only_styles_that_say_so_stand():
    assert random_style(np.random.default_rng(0)).standing == 0.0
    assert RiderMotion(STYLES["normal"], np.random.default_rng(0), 1.0).table.shape[1] == 8
    assert RiderMotion(STYLES["standing"], np.random.default_rng(0), 1.0).table.shape[1] == 9
    with pytest.raises(ValueError, match="standing"):
        RiderStyle("x", 0.0, 0.0, 0.0, 0.0, 0.0, standing=1.5)
