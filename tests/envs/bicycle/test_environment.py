"""The environment: Gymnasium's rules, sensors against truth, scenarios, snapshots, falls, bad input."""

from __future__ import annotations

import itertools
import math
import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from poise.envs.bicycle.anthropometry import SUBJECTS, RiderBody
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.paper_sensors import BICYCLE_IMU_PLACE, BICYCLE_IMU_TILT, SUITES, pitched
from poise.envs.bicycle.parameters import BENCHMARK
from poise.envs.bicycle.ride_truth import BODIES, ISB, QUANTITIES, isb_yxy, isb_zxy
from poise.envs.bicycle.scenarios import list_scenarios, scenario
from poise.envs.sensors import STANDARD_GRAVITY
from poise.filters import rotation


def make(**options):
    defaults = {"fidelity": "lumped", "duration": 3.0}
    return RiderBicycleEnv(**{**defaults, **options})


def ride(env, seed=0, steps=None):
    """Observations and infos of an episode."""
    observation, info = env.reset(seed=seed)
    observations, infos = [observation], [info]
    while steps is None or len(infos) <= steps:
        observation, _, terminated, truncated, info = env.step(env.neutral_action)
        observations.append(observation)
        infos.append(info)
        if terminated or truncated:
            break
    return observations, infos


def stack(infos, part, name):
    return np.array([info[part][name] for info in infos])


@pytest.mark.filterwarnings("ignore:.*symmetric and normalized")
def test_gymnasium_accepts_it():
    env = make(suite="all", duration=0.2)
    check_env(env, skip_render_check=True)
    env.close()


def test_it_is_registered():
    env = gymnasium.make("poise/RiderBicycle-v0", scenario="slow", fidelity="lumped", duration=0.2)
    _, info = env.reset(seed=3)
    assert set(info["pose"]) == set(QUANTITIES)
    env.close()


def test_info_has_one_structure():
    env = make(suite="all", duration=0.3)
    _, infos = ride(env)
    env.close()
    shapes = [{(p, n): np.shape(v) for p in ("pose", "truth") for n, v in info[p].items()} for info in infos]
    assert all(each == shapes[0] for each in shapes)
    for name, quantity in QUANTITIES.items():
        assert shapes[0]["pose", name] == (quantity.size,)
    assert len(infos) == 31
    assert [info["time"] for info in infos] == pytest.approx(np.arange(31) / 100.0, abs=1e-9)


@pytest.mark.parametrize("suite", [name for name in SUITES if name != "two-gyro-fixture"])
def test_suites_have_their_channels_and_rates(suite):
    env = make(suite=suite, duration=0.2)
    observation, _ = env.reset(seed=0)
    names, rate = SUITES[suite]
    assert tuple(observation)[:-1] == names
    assert env.rate == rate
    assert env.observation_space.contains(observation)
    env.close()


def test_same_seed_same_ride_and_sensors_do_not_matter():
    first, second = make(suite="all", duration=0.6), make(suite="two-gyro", sensors="ideal", duration=0.6)
    a, infos_a = ride(first, seed=5)
    _, infos_b = ride(second, seed=5)
    c, infos_c = ride(first, seed=5)
    for name in QUANTITIES:
        assert np.array_equal(stack(infos_a, "pose", name), stack(infos_b, "pose", name)), name
        assert np.array_equal(stack(infos_a, "pose", name), stack(infos_c, "pose", name)), name
    for left, right in zip(a, c, strict=True):
        assert all(np.array_equal(left[name], right[name]) for name in left)
    assert not np.array_equal(infos_a[-1]["pose"]["bicycle/yaw"], ride(first, seed=6)[1][-1]["pose"]["bicycle/yaw"])
    first.close()
    second.close()


@pytest.mark.parametrize("quick", [True, False], ids=["kept", "ridden again"])
def test_snapshot_and_restore_are_bitwise(quick):
    env, other = make(suite="all", duration=2.0), make(suite="all", duration=2.0)
    ride(env, seed=1, steps=70)
    snapshot = env.snapshot()
    rest = [env.step(env.neutral_action) for _ in range(80)]
    if quick:
        again = env
    else:
        again, snapshot = other, pickle.loads(pickle.dumps(snapshot))
        again.reset(seed=9)
    again.restore(snapshot)
    for before, after in zip(rest, [again.step(env.neutral_action) for _ in range(80)], strict=True):
        assert all(np.array_equal(before[0][name], after[0][name]) for name in before[0])
        assert before[1] == after[1]
        assert all(np.array_equal(v, after[4]["truth"][name]) for name, v in before[4]["truth"].items())
    env.close()
    other.close()


@pytest.mark.parametrize(("fidelity", "name"), [("full", "outdoor"), ("lumped", "indoor_circle")])
def test_a_reset_is_a_new_environment_bitwise(fidelity, name):
    """Another motion in the same world, the same motion again from its kept start, a new world: one and the same."""
    options = {"fidelity": fidelity, "scenario": name, "suite": "all", "duration": 2.0}
    env, fresh = make(**options), make(**options)
    ride(env, seed=1, steps=30)
    wanted = ride(fresh, seed=2, steps=100)
    world = env._ride
    for _ in ("another motion", "the same motion"):
        observations, infos = ride(env, seed=2, steps=100)
        assert env._ride is world
        for here, there in zip(observations, wanted[0], strict=True):
            assert all(np.array_equal(here[channel], there[channel]) for channel in there)
        for here, there in zip(infos, wanted[1], strict=True):
            for part in ("pose", "truth"):
                assert all(np.array_equal(here[part][key], there[part][key]) for key in there[part])
    env.reset(seed=2, options={"subject": 4})
    assert env._ride is not world
    env.close()
    fresh.close()


def test_snapshots_of_two_environments_do_not_mix():
    first, second = make(duration=1.0), make(duration=1.0)
    ride(first, seed=1, steps=20)
    foreign = first.snapshot()
    ride(second, seed=2, steps=5)
    second.restore(foreign)
    wanted = [second.step(second.neutral_action)[4] for _ in range(30)]
    second.snapshot()
    second.restore(foreign)
    again = [second.step(second.neutral_action)[4] for _ in range(30)]
    for before, after in zip(wanted, again, strict=True):
        assert all(np.array_equal(before["pose"][name], after["pose"][name]) for name in QUANTITIES)
    first.close()
    second.close()


RIDE_HASH = """
import hashlib
from poise.envs.bicycle.environment import RiderBicycleEnv
env = RiderBicycleEnv(fidelity="full", suite="all", duration=0.5)
digest = hashlib.sha256()
observation, info = env.reset(seed=11)
for _ in range(50):
    observation, _, _, _, info = env.step(env.neutral_action)
    for values in (*observation.values(), *info["pose"].values(), *info["truth"].values()):
        digest.update(values.tobytes())
print(digest.hexdigest())
"""


def test_two_processes_agree_bitwise():
    runs = [subprocess.run([sys.executable, "-c", RIDE_HASH], capture_output=True, text=True, check=True) for _ in "ab"]
    hashes = [run.stdout.split()[-1] for run in runs]
    assert hashes[0] == hashes[1]
    assert len(hashes[0]) == 64


def strapdown_errors(duration, **options):
    """Position (m) and attitude (rad) error after integrating the bicycle's ideal IMU."""
    channels = ["bicycle_imu/gyr", "bicycle_imu/acc"]
    env = make(suite=channels, sensors="ideal", duration=duration, **options)
    observations, infos = ride(env, seed=2)
    env.close()
    mounting, lever, dt = np.array(pitched(BICYCLE_IMU_TILT)), np.array(BICYCLE_IMU_PLACE), 1.0 / env.rate
    frame, omega = stack(infos, "pose", "bicycle/orientation"), stack(infos, "truth", "bicycle/angular_rate")
    places = stack(infos, "truth", "bicycle/position") + rotation.rotate(frame, lever)
    swing = rotation.rotate(frame, np.cross(omega, lever))
    q, v, p = rotation.multiply(frame[0], mounting), stack(infos, "truth", "bicycle/velocity")[0] + swing[0], places[0]
    for observation in observations[1:]:
        turn = observation["bicycle_imu/gyr"].astype(float) * dt
        middle = rotation.multiply(q, rotation.exp(0.5 * turn))
        change = rotation.rotate(middle, observation["bicycle_imu/acc"].astype(float)) - [0.0, 0.0, STANDARD_GRAVITY]
        p = p + v * dt + 0.5 * change * dt**2
        v = v + change * dt
        q = rotation.multiply(q, rotation.exp(turn))
    last = rotation.multiply(frame[-1], mounting)
    return np.linalg.norm(p - places[-1]), rotation.angle(rotation.multiply(rotation.conjugate(last), q))


def test_strapdown_returns_to_the_truth():
    position, attitude = strapdown_errors(5.0, fidelity="full", scenario="straight")
    assert position < 0.01
    assert math.degrees(attitude) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("name", ["indoor_circle", "outdoor"])
def test_strapdown_over_thirty_seconds(name):
    position, attitude = strapdown_errors(30.0, fidelity="full", scenario=name)
    assert position < 0.01
    assert math.degrees(attitude) < 0.01


def test_sensors_read_what_is_true():
    env = make(suite="all", sensors="ideal", fidelity="full", duration=2.0)
    observations, infos = ride(env)
    env.close()
    for observation, info in list(zip(observations, infos, strict=True))[1:]:
        pose, truth = info["pose"], info["truth"]
        assert observation["seat/load_cells"].sum() == pytest.approx(-truth["seat/force"][2], rel=1e-4)
        hands = np.concatenate([truth["handlebar/force_left"], truth["handlebar/force_right"]])
        np.testing.assert_allclose(observation["handlebar/force"], hands, rtol=1e-4, atol=1e-3)
        assert np.linalg.norm(observation["seat/wrench"][:3]) == pytest.approx(
            np.linalg.norm(truth["seat/force"]), rel=1e-4
        )
        assert observation["steer/angle"][0] == pytest.approx(pose["bicycle/steer"][0], abs=1e-6)
        assert observation["wheel/speed"][0] == pytest.approx(pose["bicycle/speed"][0], abs=0.05)
        total = truth["seat/force"] + hands[:3] + hands[3:] + truth["pedal/force_left"] + truth["pedal/force_right"]
        assert total[2] == pytest.approx(-SUBJECTS[0].mass * STANDARD_GRAVITY, rel=0.3)
    middle = [
        0.5 * (a["truth"]["trunk/angular_rate"] + b["truth"]["trunk/angular_rate"])
        for a, b in itertools.pairwise(infos)
    ]
    read = [observation["trunk_imu/gyr"] for observation in observations[1:]]
    np.testing.assert_allclose(read, middle, atol=0.02)


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
    env = make(fidelity="full", duration=3.0, scenario="straight")
    _, infos = ride(env)
    env.close()
    trunk = np.degrees(stack(infos, "pose", "trunk/angles"))
    assert -50.0 < trunk[:, 0].mean() < -20.0
    knee = np.degrees(stack(infos, "pose", "knee_left/flexion"))
    assert 20.0 < knee.min() < 60.0
    assert 95.0 < knee.max() < 130.0
    elbow = np.degrees(stack(infos, "pose", "elbow_right/flexion"))
    assert 30.0 < elbow.mean() < 100.0
    heights = {
        body: rotation.rotate(stack(infos, "pose", f"{body}/orientation"), np.array([0.0, 0.0, 1.0]))[:, 2]
        for body in BODIES
    }
    assert heights["bicycle"].min() > 0.95
    assert heights["thigh_left"].min() > 0.1


@pytest.mark.parametrize("name", list_scenarios())
def test_scenarios_are_ridden_upright(name):
    duration = 15.0 if name in ("bumps", "pitch") else 7.0
    env = make(scenario=name, duration=duration, subject=3, suite=["bicycle_imu/acc"])
    observations, infos = ride(env, seed=4)
    env.close()
    assert len(infos) == 100 * duration + 1
    assert np.abs(stack(infos, "pose", "bicycle/roll")).max() < 0.6
    pitch = np.degrees(np.abs(stack(infos, "pose", "bicycle/pitch"))).max()
    force = np.abs([observation["bicycle_imu/acc"] for observation in observations]).max()
    assert (pitch > 14.0) == (name == "pitch")
    if name == "bumps":
        assert force == pytest.approx(2.0 * STANDARD_GRAVITY)  # saturated


@pytest.mark.parametrize("seed", [100, 101, 103, 104])
def test_outdoor_rides_begin_at_a_speed_for_their_first_turn(seed):
    env = make(scenario="outdoor", subject=seed % 5, duration=4.0, suite=["wheel/speed"])
    _, infos = ride(env, seed=seed)
    env.close()
    assert len(infos) == 401
    assert np.abs(stack(infos, "pose", "bicycle/roll")).max() < 0.4


@pytest.mark.slow
@pytest.mark.parametrize("subject", range(5))
@pytest.mark.parametrize("name", list_scenarios())
def test_two_minutes_of_every_scenario_with_every_rider(name, subject):
    env = make(scenario=name, duration=120.0, subject=subject, suite=["wheel/speed"], fidelity="full")
    _, infos = ride(env, seed=subject)
    gaps = env._ride.rider.gaps().max()
    env.close()
    assert len(infos) == 12001
    assert gaps < 1e-3


def test_scenarios_compose():
    course = scenario("slalom+bumps").draw(np.random.default_rng(0), 20.0)
    heights = [course.ground.height_and_slope(*course.path.points[i, :2].tolist())[0] for i in range(0, 2400, 2)]
    assert max(heights) > 0.02
    assert np.abs(course.path.points[:, 3]).max() > 0.05


def test_a_fall_terminates():
    env = make(duration=10.0, suite="two-gyro")
    env.reset(seed=0)
    env._ride.pilot.update = lambda *arguments: (0.0, 0.0)
    for _ in range(1000):
        _, _, terminated, truncated, info = env.step(env.neutral_action)
        if terminated:
            break
    assert terminated
    assert not truncated
    assert abs(info["pose"]["bicycle/roll"][0]) > 0.9
    with pytest.raises(RuntimeError, match="reset"):
        env.step(env.neutral_action)
    env.reset(seed=1)
    assert not env.step(env.neutral_action)[2]
    env.close()


def test_rewards_are_errors_of_the_scored_quantities():
    env = make(score=("bicycle/roll", "trunk/orientation"), duration=0.3)
    _, info = env.reset(seed=0)
    truth = np.concatenate([info["pose"]["bicycle/roll"], info["pose"]["trunk/orientation"]])
    assert env.action_space.shape == (5,)
    assert env.step(truth)[1] == pytest.approx(0.0, abs=1e-6)
    _, info = env.reset(seed=0)
    assert env.step(truth + np.array([0.1, 0, 0, 0, 0]))[1] == pytest.approx(-0.1, abs=1e-6)
    env.close()


@pytest.mark.parametrize("fidelity", ["full", "lumped"])
def test_pictures_show_something(fidelity):
    env = make(fidelity=fidelity, duration=0.2, render_mode="rgb_array")
    env.reset(seed=0)
    image = env.render()
    env.close()
    assert image.dtype == np.uint8
    red = (image[..., 0] > 100) & (image[..., 1] < 60) & (image[..., 2] < 60)
    blue = (image[..., 2] > 90) & (image[..., 0] < 60)
    assert red.sum() > 200  # the frame
    assert blue.sum() > 500  # the shirt


@pytest.mark.slow
def test_halving_the_physics_step_changes_little():
    signals = []
    for physics_rate in (500.0, 1000.0):
        env = make(fidelity="full", sensors="ideal", suite="all", duration=10.0, physics_rate=physics_rate)
        observations, _ = ride(env, seed=3)
        env.close()
        signals.append({name: np.array([o[name] for o in observations[1:]]) for name in observations[0]})
    for name, limit in (("bicycle_imu/gyr", 0.02), ("trunk_imu/gyr", 0.02), ("bicycle_imu/acc", 0.1)):
        assert np.sqrt(np.mean((signals[0][name] - signals[1][name]) ** 2)) < limit, name


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scenario": "moon"}, "scenario"),
        ({"subject": 7}, "subject"),
        ({"subject": RiderBody(1.2, 40.0)}, "reach"),
        ({"style": "wild"}, "style"),
        ({"suite": "nose"}, "two-gyro"),
        ({"suite": ["imu/smell"]}, "channels"),
        ({"sensors": "broken"}, "sensors"),
        ({"grade": -1.0}, "grade"),
        ({"suite": "two-gyro-fixture"}, "disk"),
        ({"rate": 1e6}, "rate"),
        ({"rate": 130.0}, "physics_rate"),
        ({"physics_rate": 600.0}, "physics_rate"),
        ({"duration": 0.0}, "duration"),
        ({"fidelity": "toy"}, "fidelity"),
        ({"bicycle": "tricycle"}, "bicycle"),
        ({"bicycle": BENCHMARK}, "pedals"),
        ({"score": "mood"}, "score"),
        ({"sampling": "instant", "suite": "whole-body"}, "sampling"),
        ({"render_mode": "ascii"}, "render_mode"),
    ],
)
def test_bad_arguments_are_refused_at_construction(options, message):
    with pytest.raises(ValueError, match=message):
        make(**options)
