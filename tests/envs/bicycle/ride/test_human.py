"""Human pilots: delays, prediction, noise from a counter, memory, and steering that grows as a bicycle slows down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from poise.envs.bicycle.course.path import Path
from poise.envs.bicycle.frame.bicycle import BicycleState
from poise.envs.bicycle.frame.bicycles import BICYCLES
from poise.envs.bicycle.frame.whipple import whipple_model
from poise.envs.bicycle.ride.human import HumanNoise, HumanPilot, leaning_trunk
from poise.envs.bicycle.ride.human_steering import human_of, steady_turn
from poise.envs.bicycle.ride.internal_model import RIGID, delays, lean_matrices, rider_model, steering_reaction
from poise.envs.bicycle.ride.pilot import PILOTS, check_pilot, pilot_parameters
from poise.envs.bicycle.ride.ride import Ride
from poise.envs.bicycle.rider.anthropometry import SUBJECTS, RiderBody
from poise.envs.bicycle.rider.posture import sit
from poise.envs.bicycle.rider.style import STYLES, RiderMotion

POSTURE = sit(BICYCLES["mountain-bike"], SUBJECTS[0])
LOADED = POSTURE.bicycle.with_load(POSTURE.load())
STRAIGHT = Path(np.zeros(2))


def ride(pilot, speed, style="still", **options):
    motion = RiderMotion(STYLES[style], np.random.default_rng(0))
    options = {"fidelity": "lumped", "noise": np.random.SeedSequence(1), **options}
    return Ride(POSTURE, motion, STRAIGHT, lambda _: speed, pilot=pilot, **options)


def steering(pilot, speed, seconds, style="still"):
    """Steering angles after two seconds, rad."""
    angles = []
    with ride(pilot, speed, style) as on:
        for step in range(round(500 * seconds)):
            on.step()
            if step > 1000 and step % 5 == 0:
                angles.append(on.bicycle.state().steer)
        assert not on.fallen
    return np.array(angles)


def test_model_of_a_rigid_rider_is_whipples():
    for speed in (0.6, 3.0, 6.0):
        mass, damping, stiffness = lean_matrices(LOADED, RIGID, 9.81, speed)
        model = whipple_model(LOADED, 9.81)
        np.testing.assert_allclose(mass[:2, :2], model.M)
        np.testing.assert_allclose(damping[:2, :2], speed * model.C1)
        np.testing.assert_allclose(stiffness[:2, :2], model.stiffness(speed))
        pilot = HumanPilot(LOADED, PILOTS["expert"], np.random.SeedSequence(0))
        roll, _, torque = steady_turn(human_of(*pilot._human), speed, 0.1, 0.0)
        np.testing.assert_allclose((roll, torque), model.steady_turn(speed, 0.1))


def test_a_steady_turn_rests_in_the_model():
    """With the torque of the steady turn nothing moves, leaning or not."""
    trunk = leaning_trunk(POSTURE, False, 0.0)
    pilot = replace(PILOTS["skilled"], arm_damping=0.0)
    A, B = rider_model(LOADED, pilot, trunk, 9.81, 3.0)
    human = human_of(*HumanPilot(LOADED, pilot, np.random.SeedSequence(0), trunk)._human)
    for steer, lean in ((0.1, 0.0), (0.0, 0.1), (-0.05, 0.08)):
        roll, leaning, torque = steady_turn(human, 3.0, steer, lean)
        state = np.zeros(12)
        state[[0, 1, 6, 10]] = roll, steer, torque, leaning
        rate = A @ state + B @ (torque, 0.0, lean)
        np.testing.assert_allclose(rate[[0, 1, 2, 3, 6, 7, 10, 11]], 0.0, atol=1e-9)


@pytest.mark.parametrize("body", [SUBJECTS[0], RiderBody(1.60, 60.0, True)], ids=["tall", "short"])
def test_a_bar_feels_the_arms_and_not_the_trunk(body):
    """1 N·m in place of the pilot's torque, during 0.2 s, turns the bar as the internal model says."""
    posture, speed, steps, ended = sit(BICYCLES["mountain-bike"], body), 3.0, 100, []
    loaded = posture.bicycle.with_load(posture.load())
    with Ride(posture, RiderMotion(STYLES["still"], np.random.default_rng(0)), STRAIGHT, lambda _: speed) as on:
        for _ in range(1000):
            on.step()
        saved, plan = on.save(), on.rider.plan
        for torque in (0.0, 1.0):
            on.restore(saved)
            on.rider.plan = lambda seen, curvature, _, *rest, torque=torque: plan(seen, curvature, torque, *rest)
            for _ in range(steps):
                on.step()
            ended.append(on.bicycle.state().steer)
    trunk = leaning_trunk(posture, True, 0.0)
    A, _ = rider_model(loaded, replace(PILOTS["skilled"], arm_damping=0.0), trunk, 9.81, speed)
    mass, _, _ = lean_matrices(loaded, trunk, 9.81, speed)
    pushed = np.zeros((13, 13))
    pushed[:12, :12] = A
    pushed[[2, 3, 11], 12] = np.linalg.solve(mass, (0.0, 1.0, -steering_reaction(loaded, trunk)))
    assert ended[1] - ended[0] == pytest.approx(expm(pushed * steps / 500.0)[1, 12], rel=0.1)


def test_noise_is_a_function_of_the_step():
    first, second = (HumanNoise(np.random.SeedSequence(3)) for _ in range(2))
    forward = [first.at(step).copy() for step in range(1100)]
    backward = [second.at(step).copy() for step in reversed(range(1100))][::-1]
    np.testing.assert_array_equal(forward, backward)
    assert np.std(forward) == pytest.approx(1.0, abs=0.05)
    assert np.abs(np.corrcoef(np.array(forward).T) - np.eye(7)).max() < 0.12


def test_delays_are_those_of_the_parameters():
    for pilot in PILOTS.values():
        slow, fast = delays(pilot, 1.0 / 250.0)
        assert slow / 250.0 == pytest.approx(pilot.visual_delay, abs=0.0021)
        assert fast / 250.0 == pytest.approx(pilot.vestibular_delay, abs=0.0021)


def test_nothing_is_done_about_a_push_before_the_senses_report_it():
    """A sudden roll rate is met by torque only after the vestibular delay; the ideal pilot acts at once."""
    novice = PILOTS["novice"]
    quiet = {name: 1e-3 * value for name, value in vars(novice).items() if name.endswith("_noise")}
    quiet = replace(novice, tremor=0.0, **quiet)
    pilot = HumanPilot(LOADED, quiet, np.random.SeedSequence(0))
    pilot.start(STRAIGHT, 3.0)
    torques = []
    for step in range(80):
        time = step / 250.0
        rate = 0.05 if step >= 10 else 0.0
        seen = BicycleState(time, 3.0 * time, *5 * (0.0,), rate, 0.0, 0.0, 3.0, *4 * (0.0,), 9.0)
        torques.append(abs(pilot.update(seen.numbers, 3.0)[0]))
    late = 10 + delays(quiet, 1.0 / 250.0)[1]
    assert max(torques[:late]) < 0.02
    assert max(torques[late + 10 :]) > 0.2


def test_a_human_ride_returns_bit_for_bit():
    with ride("novice", 2.0, "mild") as on:
        for _ in range(600):
            on.step()
        saved, after = on.save(), []
        for _ in range(2):
            for _ in range(700):
                on.step()
            after.append((on.bicycle.state(), on.pilot.save()))
            on.restore(saved)
        assert after[0] == after[1]


def test_another_seed_is_another_ride_and_the_same_the_same():
    def end(seed):
        with ride("skilled", 3.0, noise=np.random.SeedSequence(seed)) as on:
            for _ in range(500):
                on.step()
            return on.bicycle.state()

    assert end(1) == end(1)
    assert end(1) != end(2)


def test_skill_shows_in_the_steering():
    found = [steering(name, 2.0, 12.0).std() for name in ("ideal", "expert", "skilled", "novice")]
    assert found[0] < found[1] < found[2] < found[3]


@pytest.mark.slow
def test_steering_grows_as_the_bicycle_slows_down():
    """From 20 to 5 km/h, one mild rider; the mean of three is 6.0 (docs/realism.md), measured on a treadmill is 6."""
    slow, fast = (steering("skilled", speed, 42.0, "mild").std() for speed in (5.0 / 3.6, 20.0 / 3.6))
    assert 4.0 < slow / fast < 12.0


def test_no_muscle_pulls_beyond_its_limit():
    pilot = HumanPilot(LOADED, replace(PILOTS["skilled"], arm_damping=0.0, motor_noise=0.0), np.random.SeedSequence(0))
    pilot.start(STRAIGHT, 3.0)
    for step in range(250):
        seen = BicycleState(step / 250.0, 0.0, *2 * (0.0,), 0.5, *2 * (0.0,), 2.0, 0.0, 0.0, 3.0, *4 * (0.0,), 9.0)
        torque = abs(pilot.update(seen.numbers, 3.0)[0])
    assert 0.9 < torque / pilot.human.largest_torque < 1.05


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"visual_delay": 0.05}, "vestibular"),
        ({"effort": 0.0}, "effort"),
        ({"roll_noise": -1.0}, "roll_noise"),
        ({"muscle_frequency": float("nan")}, "muscle_frequency"),
    ],
)
def test_impossible_pilots_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(PILOTS["expert"], **change)


def test_names_of_pilots():
    assert pilot_parameters("ideal") is None
    assert check_pilot("random") == "random"
    for ask in (pilot_parameters, check_pilot):
        with pytest.raises(ValueError, match="pilot must be one of"):
            ask("champion")
