import numpy as np
import pytest

from poise.envs.hand.arm.arm import Arm
from poise.envs.hand.arm.driver import ArmDriver
from poise.envs.hand.drivers import Device
from poise.envs.hand.environment import HandMotionEnv
from poise.envs.hand.gestures import Rest, make_gesture
from poise.envs.sensors.ideal import STANDARD_GRAVITY, BodyState
from poise.filters.core import rotation

QUIET = Arm(noise=0.0, table=None)


class Falling:
    """A hand that means to move down at constant speed after a second."""

    duration = 4.0

    def __init__(self, speed=0.5):
        self.speed = speed

    def sample(self, times):
        since = np.maximum(times - 1.0, 0.0)
        still = np.zeros((len(times), 3))
        down = np.array([0.0, 0.0, -1.0])
        level = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1))
        place = [0.0, 0.0, 1.2] + self.speed * since[:, None] * down
        return BodyState(times, place, level, self.speed * (since[:, None] > 0.0) * down, still, still, still)


def follow(arm, gesture, *, seed=None, factor=1.0, rate=100.0, device=None):
    drive = ArmDriver(rate, device, arm)
    drive.start(gesture, factor, None if seed is None else np.random.default_rng(seed))
    states = drive.advance(round(gesture.duration * rate)).now
    wanted = gesture.sample(states.time)
    offset = states.position - wanted.position
    turn = rotation.log(rotation.multiply(states.orientation, rotation.conjugate(wanted.orientation)))
    return states, offset, turn


@pytest.mark.parametrize("name", ["slow", "fast", "severe", "mixed"])
def test_an_arm_that_foresees_everything_follows(name):
    gesture = make_gesture(name, np.random.default_rng(2), 12.0)
    _, offset, turn = follow(Arm(anticipation=1.0, noise=0.0, table=None), gesture)
    # the integrator is of first order: half a step of 0.5 ms behind
    assert np.abs(offset).max() < 1e-3
    assert np.degrees(np.abs(turn)).max() < 0.5


def test_compliance_is_millimetres_at_fast_motion_and_grows_as_the_arm_softens():
    gesture = make_gesture("fast", np.random.default_rng(2), 10.0)
    sizes = []
    for stiffness in (150.0, 300.0, 600.0):
        _, offset, _ = follow(Arm(stiffness=stiffness, noise=0.0, table=None), gesture)
        sizes.append(np.sqrt(np.mean(np.sum(offset**2, axis=1))))
    assert sizes[0] > sizes[1] > sizes[2]
    assert 1e-3 < sizes[1] < 5e-3


def test_slow_motion_deflects_by_the_unforeseen_force_over_the_stiffness():
    gesture = make_gesture("slow", np.random.default_rng(2), 20.0)
    arm = Arm(noise=0.0, table=None, reflex=0.0, damping=0.1, stiffness=500.0)
    states, offset, _ = follow(arm, gesture)
    force = (1.0 - arm.anticipation) * (0.25 + arm.hand_mass) * gesture.sample(states.time).acceleration
    moving = (states.time > 2.0) & (states.time < 18.0)
    error = offset[moving] + force[moving] / arm.stiffness
    assert np.sqrt(np.mean(error**2)) < 0.3 * np.sqrt(np.mean(force[moving] ** 2)) / arm.stiffness


def test_a_heavier_device_sags():
    gesture = Rest(duration=6.0).draw(np.random.default_rng(0))
    _, offset, _ = follow(QUIET, gesture, factor=1.5)
    # reflexes add to the muscles
    expected = 0.5 * 0.25 * STANDARD_GRAVITY / (QUIET.stiffness * (1.0 + QUIET.reflex))
    np.testing.assert_allclose(offset[-1], [0.0, 0.0, -expected], atol=1e-6)


def test_noise_makes_a_still_hand_tremble():
    gesture = Rest(duration=30.0).draw(np.random.default_rng(0))
    states, offset, turn = follow(Arm(table=None), gesture, seed=0)
    speed = np.sqrt(np.mean(np.sum(states.velocity[100:] ** 2, axis=1)))
    assert 1e-3 < speed < 0.05
    assert 1e-4 < np.abs(offset).max() < 5e-3
    assert 0.05 < np.degrees(np.abs(turn)).max() < 2.0
    again, *_ = follow(Arm(table=None), gesture, seed=0)
    np.testing.assert_array_equal(again.position, states.position)


def test_a_free_device_keeps_energy_and_momentum_to_first_order():
    weak = Arm(hand_mass=1e-6, hand_radius=1e-3, stiffness=1e-9, wrist_stiffness=1e-9, damping=0.0, noise=0.0)
    device, losses = Device(), []
    for step in (2e-4, 1e-4):
        drive = ArmDriver(1000.0, device, weak, gravity=0.0, longest_step=step)
        drive.start(Rest(duration=2.0).draw(np.random.default_rng(0)))
        drive._state = np.concatenate([drive._state[:10], [3.0, 5.0, 2.0]])
        states = drive.advance(2000).now
        body = rotation.rotate_back(states.orientation, states.angular_velocity)
        momentum = rotation.rotate(states.orientation, body * np.array(device.inertia))
        energy = 0.5 * np.sum(body**2 * np.array(device.inertia), axis=1)
        losses.append([np.ptp(energy) / energy[0], np.ptp(momentum, axis=0).max() / np.linalg.norm(momentum[0])])
        # it tumbles
        assert np.ptp(body, axis=0).max() > 0.5
    assert max(losses[1]) < 0.02
    np.testing.assert_allclose(np.array(losses[1]) / losses[0], 0.5, atol=0.05)


def test_a_hand_that_moves_down_puts_the_device_on_the_table():
    arm = Arm(noise=0.0, table=0.25)
    states, offset, _ = follow(arm, Falling(), rate=1000.0)
    top = 1.2 - 0.25
    height = states.position[:, 2] - 0.5 * Device().size[2]
    # pressed into four corners of 30 kN/m by some hundred newtons at the end
    assert top - 5e-3 < height.min() < top
    impact = np.abs(np.diff(states.velocity[:, 2])).max() * 1000.0
    assert impact > 30.0
    pressed = arm.stiffness * (1.0 + arm.reflex) * offset[-1, 2]
    depth = top - height[-1]
    assert 4.0 * arm.table_stiffness * depth == pytest.approx(pressed, rel=0.1)


def test_friction_stops_what_lies_on_the_table():
    class Sliding(Falling):
        def sample(self, times):
            state = super().sample(np.minimum(times, 1.8))
            since = np.maximum(times - 2.5, 0.0)
            return state._replace(time=times, position=state.position + 0.02 * since[:, None] * np.array([1.0, 0, 0]))

    rubbing = [follow(Arm(noise=0.0, friction=friction), Sliding())[0] for friction in (0.0, 2.0)]
    assert rubbing[0].position[-1, 0] > 0.02
    assert rubbing[1].position[-1, 0] < rubbing[0].position[-1, 0] - 1e-3


def test_bad_arms_are_refused_by_name():
    for name, value in (("stiffness", 0.0), ("noise", -1.0), ("delay", 0.0), ("table", -0.1)):
        with pytest.raises(ValueError, match=name):
            Arm(**{name: value})
    with pytest.raises(ValueError, match="arm has no effect with drive='kinematic'"):
        HandMotionEnv("fast", arm=Arm())
