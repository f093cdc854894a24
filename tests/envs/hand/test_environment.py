import pickle

import numpy as np
import pytest

from poise.envs.base import pose_error
from poise.envs.hand.arm.arm import Arm
from poise.envs.hand.arm.driver import ArmDriver
from poise.envs.hand.drivers import KinematicDriver
from poise.envs.hand.environment import HandMotionEnv
from poise.envs.hand.gestures import Turn, make_gesture
from poise.envs.hand.sensing import HandVariation, simulate_hand
from poise.envs.record import record
from poise.envs.sensors.ideal import STANDARD_GRAVITY, BodyState
from poise.envs.sensors.suite import imu_suite
from poise.filters.core import metrics, rotation
from poise.filters.core.quantity import ORIENTATION, RELATIVE_ORIENTATION, UP

DRIVES = ("dynamic", "kinematic")
PERFECT = Arm(anticipation=1.0, noise=0.0, table=None)
"""Foresees all that it does, so that its compliance does not show"""


def with_arm(kind: str) -> dict[str, Arm]:
    """The argument of an environment whose dynamic drive differs little from the kinematic one."""
    return {"arm": PERFECT} if kind == "dynamic" else {}


def play(env, steps, seed=None):
    """Everything an agent could see in ``steps`` steps of seeded estimates."""
    if seed is not None:
        env.reset(seed=seed)
    generator = np.random.default_rng(0)
    return [env.step(generator.uniform(-1, 1, 4).astype(np.float32)) for _ in range(steps)]


def assert_same(left, right):
    if isinstance(left, dict):
        assert left.keys() == right.keys()
        for key in left:
            assert_same(left[key], right[key])
    elif isinstance(left, tuple | list):
        for a, b in zip(left, right, strict=True):
            assert_same(a, b)
    else:
        np.testing.assert_array_equal(left, right)


@pytest.mark.parametrize("quantity", [ORIENTATION, RELATIVE_ORIENTATION, UP])
def test_reward_is_the_error_of_the_metrics(quantity):
    generator = np.random.default_rng(0)
    for _ in range(50):
        estimate, truth = generator.normal(size=(2, quantity.size))
        expected = float(metrics.error(quantity, estimate, truth / np.linalg.norm(truth)))
        assert pose_error(quantity, estimate, truth / np.linalg.norm(truth)) == pytest.approx(expected, abs=1e-12)


def test_reward_judges_the_estimate_of_the_last_observation():
    with HandMotionEnv("fast", "kinematic", duration=5.0) as env:
        _, info = env.reset(seed=0)
        for _ in range(300):
            _, reward, _, _, info = env.step(-3.0 * info["pose"]["orientation"])
            assert -1e-9 < reward <= 0.0
        _, reward, *_ = env.step(rotation.multiply(rotation.exp(np.array([0.3, 0, 0])), info["pose"]["orientation"]))
        assert reward == pytest.approx(-0.3)


def test_inclination_alone_forgives_the_heading():
    with HandMotionEnv("fast", "kinematic", duration=3.0, score="relative_orientation") as env:
        _, info = env.reset(seed=0)
        turned = rotation.multiply(rotation.exp(np.array([0, 0, 2.0])), info["pose"]["orientation"])
        assert env.step(turned)[1] == pytest.approx(0.0, abs=1e-7)


def test_zeros_count_as_no_rotation_and_bad_actions_are_refused():
    with (
        HandMotionEnv("fast", "kinematic", duration=3.0) as one,
        HandMotionEnv("fast", "kinematic", duration=3.0) as two,
    ):
        one.reset(seed=0)
        two.reset(seed=0)
        assert one.step(np.zeros(4))[1] == two.step(two.neutral_action)[1]
        with pytest.raises(ValueError, match="4 finite numbers"):
            one.step(np.array([1.0, np.nan, 0.0, 0.0]))
        with pytest.raises(ValueError, match="4 finite numbers"):
            one.step(np.zeros(3))


@pytest.mark.parametrize("kind", DRIVES)
def test_drives_give_the_same_in_blocks_of_their_own_and_after_restoring(kind):
    drawn = make_gesture("fast", np.random.default_rng(2))
    drive = ArmDriver(100.0) if kind == "dynamic" else KinematicDriver(100.0)
    drive.start(drawn, 1.1, np.random.default_rng(4))
    drive.advance(200)
    saved = pickle.loads(pickle.dumps(drive.save()))
    first = drive.advance(50)
    drive.restore(saved)
    second = drive.advance(50)
    np.testing.assert_array_equal(np.asarray(first.now.position), np.asarray(second.now.position))
    np.testing.assert_array_equal(np.asarray(first.now.orientation), np.asarray(second.now.orientation))


def strapdown(trajectory, dt):
    """Integrate gyroscope and accelerometer from the first true state."""
    q, v, p = (trajectory.truth[name][0] for name in ("orientation", "velocity", "position"))
    for gyr, acc in zip(trajectory.measurements["imu/gyr"][1:], trajectory.measurements["imu/acc"][1:], strict=True):
        middle = rotation.multiply(q, rotation.exp(0.5 * gyr * dt))
        new = v + dt * (rotation.rotate(middle, acc) - [0.0, 0.0, STANDARD_GRAVITY])
        p, v = p + 0.5 * dt * (v + new), new
        q = rotation.multiply(q, rotation.exp(gyr * dt))
    return q, p


@pytest.mark.parametrize("kind", DRIVES)
@pytest.mark.parametrize("gesture", ["slow", "fast"])
def test_strapdown_integration_returns_the_truth(gesture, kind):
    place = {"lever_arm": (0.05, -0.02, 0.03), "mounting": rotation.exp(np.array([0.4, -1.0, 2.0]))}
    with HandMotionEnv(gesture, kind, "ideal", duration=30.0, magnetometer=False, **place) as env:
        trajectory = record(env, seed=1)
    q, p = strapdown(trajectory, 0.01)
    error = rotation.angle(rotation.multiply(q, rotation.conjugate(trajectory.truth["orientation"][-1])))
    assert np.degrees(error) < 0.01
    assert np.linalg.norm(p - trajectory.truth["position"][-1]) < 0.01


@pytest.mark.parametrize("kind", DRIVES)
@pytest.mark.parametrize("sampling", ["interval", "instant"])
def test_turn_reads_the_centripetal_acceleration(kind, sampling):
    turn = Turn(rate=-2.5, radius=0.6, tilt=0.0)
    with HandMotionEnv(
        turn, kind, "ideal", duration=6.0, sampling=sampling, lever_arm=(0, 0, 0.1), **with_arm(kind)
    ) as env:
        trajectory = record(env, seed=0)
    # half a turn a tick shortens the chord: the mean of a turning vector
    mean = 1.0 if sampling == "instant" else np.sinc(2.5 * 0.005 / np.pi)
    expected = mean * 2.5**2 * 0.6
    late = trajectory.time > 3.0
    acc, gyr = (trajectory.measurements[name][late] for name in ("imu/acc", "imu/gyr"))
    tolerance = 3e-3 if kind == "dynamic" else 1e-5
    np.testing.assert_allclose(np.linalg.norm(acc[:, :2], axis=1), expected, rtol=tolerance)
    np.testing.assert_allclose(acc[:, 2], STANDARD_GRAVITY, rtol=1e-5)
    np.testing.assert_allclose(gyr, [[0.0, 0.0, -2.5]] * late.sum(), atol=1e-5)
    external = np.linalg.norm(trajectory.truth["external_acceleration"][late], axis=1)
    np.testing.assert_allclose(external, expected, rtol=tolerance)


def test_truth_is_what_ideal_sensors_read():
    with HandMotionEnv("fast", "dynamic", "ideal", duration=5.0, lever_arm=(0.1, 0.0, 0.0)) as env:
        trajectory = record(env, seed=3)
    np.testing.assert_allclose(trajectory.truth["angular_rate"], trajectory.measurements["imu/gyr"], atol=1e-5)
    middle = rotation.multiply(trajectory.truth["orientation"], rotation.exp(-0.005 * trajectory.truth["angular_rate"]))
    external = trajectory.measurements["imu/acc"] - STANDARD_GRAVITY * rotation.up_in_body(middle)
    np.testing.assert_allclose(trajectory.truth["external_acceleration"], external, atol=1e-4)
    np.testing.assert_allclose(trajectory.truth["up"], rotation.up_in_body(trajectory.truth["orientation"]))


def test_drives_agree_with_each_other():
    recorded = []
    for kind in DRIVES:
        with HandMotionEnv("fast", kind, "ideal", duration=8.0, **with_arm(kind)) as env:
            recorded.append(record(env, seed=3))
    for name in ("imu/gyr", "imu/acc", "imu/mag"):
        left, right = (trajectory.measurements[name] for trajectory in recorded)
        # the engine is of first order: half a millisecond behind
        assert np.sqrt(np.mean((left - right) ** 2)) < 0.02 * np.std(right)


@pytest.mark.parametrize("kind", DRIVES)
def test_other_sensors_see_the_same_motion(kind):
    recorded = []
    for sensors in ("ideal", "bosch-bmi160"):
        with HandMotionEnv("fast", kind, sensors, duration=3.0) as env:
            recorded.append(record(env, seed=3))
    for name in ("position", "orientation", "external_acceleration"):
        np.testing.assert_array_equal(recorded[0].truth[name], recorded[1].truth[name])
    assert np.abs(recorded[0].measurements["imu/gyr"] - recorded[1].measurements["imu/gyr"]).max() > 1e-3


@pytest.mark.parametrize("kind", DRIVES)
@pytest.mark.parametrize("same_env", [True, False])
def test_snapshots_continue_bitwise(kind, same_env):
    arguments = {"gesture": "fast", "drive": kind, "duration": 4.0, "randomise": True}
    with HandMotionEnv(**arguments) as env, HandMotionEnv(**arguments) as other:
        play(env, 173, seed=5)
        snapshot = pickle.loads(pickle.dumps(env.snapshot()))
        first = play(env, 200)
        then = env.reset()
        target = env if same_env else other
        target.restore(snapshot)
        assert_same(play(target, 200), first)
        assert_same(target.reset(), then)


def test_simulated_hand_is_the_recorded_kinematic_environment():
    with HandMotionEnv("mixed", "kinematic", duration=20.0, lever_arm=(0.1, 0, 0)) as env:
        recorded = record(env, seed=7)
    simulated = simulate_hand("mixed", 7, duration=20.0, lever_arm=(0.1, 0, 0))
    np.testing.assert_array_equal(simulated.time, recorded.time)
    for name, values in recorded.truth.items():
        np.testing.assert_allclose(simulated.truth[name], values, atol=1e-12, err_msg=name)
    for name, values in recorded.measurements.items():
        np.testing.assert_allclose(simulated.measurements[name], values, rtol=1e-6, atol=1e-6, err_msg=name)


def test_variation_changes_mounting_and_mass_but_not_the_gesture():
    base = {"gesture": "fast", "drive": "kinematic", "sensors": "ideal", "duration": 3.0}
    ends = []
    for randomise in (False, True, HandVariation(lever_arm=0.0, mounting=0.3, mass=0.0)):
        with HandMotionEnv(**base, randomise=randomise) as env:
            ends.append(record(env, seed=1).truth)
    assert 0.001 < np.linalg.norm(ends[1]["position"][0] - ends[0]["position"][0]) < 0.2
    np.testing.assert_allclose(ends[2]["position"], ends[0]["position"])
    rates = [np.linalg.norm(truth["angular_rate"], axis=1) for truth in ends]
    np.testing.assert_allclose(rates[1], rates[0], atol=1e-9)


def test_episodes_last_as_long_as_the_gesture_or_the_duration():
    for duration, steps in ((None, 1000), (2.5, 250)):
        with HandMotionEnv("fast", "kinematic", duration=duration) as env:
            trajectory = record(env, seed=0)
            assert trajectory.metadata["ended"] == "truncated"
            assert len(trajectory) == steps + 1
            with pytest.raises(RuntimeError, match="call reset"):
                env.step(env.neutral_action)


def test_gesture_of_one_episode_by_reset_option():
    with HandMotionEnv("rest", "kinematic", "ideal") as env:
        assert len(record(env, seed=0)) == 1001
        _, info = env.reset(seed=0, options={"gesture": "turn"})
        for _ in range(1500):
            *_, info = env.step(env.neutral_action)
        assert np.linalg.norm(info["truth"]["angular_rate"]) > 0.9
        env.reset()
        assert env.step(env.neutral_action)[4]["truth"]["velocity"].any() == np.False_


def test_slow_magnetometer_is_marked_as_not_fresh():
    with HandMotionEnv("slow", "kinematic", magnetometer=20.0) as env:
        observation, _ = env.reset(seed=0)
        flags = [observation["new_sample"][2]]
        flags += [env.step(env.neutral_action)[0]["new_sample"][2] for _ in range(100)]
        assert sum(flags) == 21
    assert HandMotionEnv("slow", "kinematic", magnetometer=False).observation_space["new_sample"].n == 2


def test_a_whole_suite_may_be_given():
    suite = imu_suite("ideal", 200.0, (0.1, 0.0, 0.0))
    with HandMotionEnv("turn", "dynamic", suite, duration=1.0) as env:
        assert env.rate == 200.0
        assert len(record(env, seed=0)) == 201
    with pytest.raises(ValueError, match="rate must be None or that of the suite"):
        HandMotionEnv(sensors=suite, rate=100.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"gesture": "wave"}, r"\(gestures: rest, slow"),
        ({"drive": "magic"}, "drive must be"),
        ({"sensors": "nonsense"}, "nonsense"),
        ({"duration": -1.0}, "duration must be positive"),
        ({"rate": 0.0}, "rate"),
        ({"lever_arm": (1.0, 2.0)}, "lever_arm must hold 3"),
        ({"mounting": (1.0, 1.0, 0.0, 0.0)}, "unit quaternion"),
        ({"score": "heading"}, "score must be one of"),
        ({"render_mode": "ascii"}, "render_mode must be"),
        ({"sensors": "adis16470", "magnetometer": True}, "magnetometer"),
    ],
)
def test_bad_arguments_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        HandMotionEnv(**arguments)


def test_bad_reset_options_are_refused():
    with HandMotionEnv() as env:
        with pytest.raises(ValueError, match=r"unknown reset options \['gestur'\]; known are \['gesture'\]"):
            env.reset(options={"gestur": "slow"})
        with pytest.raises(ValueError, match="unknown gesture"):
            env.reset(options={"gesture": "wave"})
        with pytest.raises(RuntimeError, match="call reset"):
            env.step(env.neutral_action)


def test_closed_environments_close_again_and_start_again():
    env = HandMotionEnv("fast", duration=2.0)
    first = play(env, 10, seed=0)
    env.close()
    env.close()
    assert_same(play(env, 10, seed=0), first)
    env.close()


def test_states_of_the_first_tick_reach_back_into_the_rest():
    drive = ArmDriver(100.0)
    drive.start(make_gesture("slow", np.random.default_rng(0)))
    states = drive.advance(3)
    assert isinstance(states.now, BodyState)
    np.testing.assert_allclose(states.now.time, [0.0, 0.01, 0.02])
    np.testing.assert_allclose(states.earlier.time, [-0.0005, 0.0095, 0.0195])


def test_gravity_acts_in_the_attitude_half_way_through_the_interval():
    hand = simulate_hand("shaking", 3, "ideal", duration=4.0)
    truth, force = hand.truth, hand.measurements["imu/acc"][1:]
    half = rotation.exp(0.5 * hand.dt * truth["angular_rate"][1:])
    exact = truth["external_acceleration"][1:] + STANDARD_GRAVITY * rotation.rotate(half, truth["up"][1:])
    np.testing.assert_allclose(force, exact, atol=1e-9)
    # without the turn the sum is wrong by what the docstring of the environment says
    wrong = force - truth["external_acceleration"][1:] - STANDARD_GRAVITY * truth["up"][1:]
    assert 0.3 < np.max(np.linalg.norm(wrong, axis=1)) < 0.8


def test_late_packets_and_a_disturbed_field_are_arguments():
    options = {"gesture": "fast", "duration": 2.0, "drive": "kinematic", "sensors": "xsens-mtw-awinda"}
    env = HandMotionEnv(**options, timing="wireless", magnetics="indoor")
    late, plain = record(env, seed=1), record(HandMotionEnv(**options), seed=1)
    assert late.metadata["sensors"]["sensors"][0]["timing"]["delay"] == 0.02
    for name in ("orientation", "angular_rate", "external_acceleration"):
        np.testing.assert_array_equal(late.truth[name], plain.truth[name])
    assert np.isnan(late.measurements["imu/gyr"][:3]).all()
    with pytest.raises(ValueError, match="timing must be None where a whole suite is given"):
        HandMotionEnv(sensors=env.suite, timing="wired")
