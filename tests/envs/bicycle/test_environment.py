"""The environment: Gymnasium's rules, sensors against truth, scenarios, snapshots, falls, bad input."""

from __future__ import annotations

import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import poise
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.frame.parameters import BENCHMARK
from poise.envs.bicycle.ride.truth import QUANTITIES
from poise.envs.bicycle.rider.anthropometry import SUBJECTS, RiderBody
from poise.envs.bicycle.sensors.measured_geometry import rider_geometry
from poise.envs.bicycle.sensors.suites import SUITES


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


def test_geometry_is_that_of_the_rider_in_the_saddle():
    env = make(subject=0, duration=0.2)
    assert env.ride is None
    assert env.geometry.rider_mass == SUBJECTS[0].mass
    env.reset(seed=0, options={"subject": 4})
    assert env.geometry == rider_geometry(env.ride.rider.posture, env._worn.sites)
    assert env.geometry.rider_mass == SUBJECTS[4].mass
    env.close()


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
        for part in ("pose", "truth"):
            assert all(np.array_equal(v, after[4][part][name]) for name, v in before[4][part].items())
    env.close()
    other.close()


@pytest.mark.parametrize(("fidelity", "name"), [("full", "outdoor"), ("lumped", "indoor_circle")])
def test_a_reset_is_a_new_environment_bitwise(fidelity, name):
    """Another motion in the same world, the same motion again from its kept start, a new world: one and the same."""
    options = {"fidelity": fidelity, "scenario": name, "suite": "all", "duration": 2.0}
    env, fresh = make(**options), make(**options)
    ride(env, seed=1, steps=30)
    wanted = ride(fresh, seed=2, steps=100)
    world = env.ride
    for _ in ("another motion", "the same motion"):
        observations, infos = ride(env, seed=2, steps=100)
        assert env.ride is world
        for here, there in zip(observations, wanted[0], strict=True):
            assert all(np.array_equal(here[channel], there[channel]) for channel in there)
        for here, there in zip(infos, wanted[1], strict=True):
            for part in ("pose", "truth"):
                assert all(np.array_equal(here[part][key], there[part][key]) for key in there[part])
    env.reset(seed=2, options={"subject": 4})
    assert env.ride is not world
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
from poise.envs.bicycle.sensors.measured_geometry import rider_geometry
env = RiderBicycleEnv(fidelity="full", suite="all", duration=0.5)
digest = hashlib.sha256()
observation, info = env.reset(seed=11)
for _ in range(50):
    observation, _, _, _, info = env.step(env.neutral_action)
    for values in (*observation.values(), *info["pose"].values(), *info["truth"].values()):
        digest.update(values.tobytes())
print(digest.hexdigest())
"""


def test_two_processes_agree_bitwise(capsys):
    other = subprocess.run([sys.executable, "-c", RIDE_HASH], capture_output=True, text=True, check=True)
    exec(RIDE_HASH, {})
    here = capsys.readouterr().out.split()[-1]
    assert other.stdout.split()[-1] == here
    assert len(here) == 64


@pytest.mark.parametrize("fidelity", ["full", "lumped"])
def test_time_zero_is_one_instant_whatever_the_rate_of_the_sensors(fidelity):
    rides = []
    for rate in (50.0, 100.0, 250.0 / 3.0, 250.0):
        env = make(rate=rate, duration=0.5, suite="two-gyro", fidelity=fidelity)
        rides.append(poise.record(env, seed=3))
        env.close()
    fastest = rides[-1]
    for ride in rides:
        assert ride.time[0] == 0.0
        shared = np.isin(np.round(fastest.time, 6), np.round(ride.time, 6))
        assert shared.sum() >= 6
        place = ride.truth["bicycle/position"][np.isin(np.round(ride.time, 6), np.round(fastest.time, 6))]
        assert np.array_equal(place, fastest.truth["bicycle/position"][shared])


def test_a_fall_terminates():
    env = make(duration=10.0, suite="two-gyro")
    env.reset(seed=0)
    env.ride.pilot.update = lambda *arguments: (0.0, 0.0)
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
        ({"noise_scale": -1.0}, "noise_scale"),
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


def test_an_ideal_wheel_tells_the_true_speed() -> None:
    """The radius that the sensor is told is the one on which the tyre rolls, or speeds would be wrong by per cents."""
    env = RiderBicycleEnv("straight", 2, suite=["wheel/speed"], sensors="ideal", fidelity="lumped", duration=3.0)
    ride = poise.record(env, seed=0)
    env.close()
    told, true = ride.measurements["wheel/speed"].mean(), ride.truth["bicycle/speed"].mean()
    assert told == pytest.approx(true, rel=2e-3)


def test_sites_may_be_late_and_the_frame_of_steel():
    timing = {"relative": "camera", "seat": "wireless", "trunk_imu": "wireless", "steer": "wired"}
    channels = ["bicycle_imu/gyr", "bicycle_imu/mag", "trunk_imu/mag", "relative/orientation", "seat/load_cells"]
    options = {"suite": [*channels, "steer/angle", "wheel/speed"], "sensors": "ideal", "rate": 100.0, "duration": 1.0}
    late, plain = (
        poise.record(env, seed=4) for env in (make(**options, timing=timing, magnetics="steel-frame"), make(**options))
    )
    for name in QUANTITIES:
        np.testing.assert_array_equal(late.truth[name], plain.truth[name])
    np.testing.assert_array_equal(late.measurements["bicycle_imu/gyr"], plain.measurements["bicycle_imu/gyr"])
    np.testing.assert_array_equal(late.measurements["wheel/speed"], plain.measurements["wheel/speed"])
    # a camera's picture is 60 to 85 ms old, an encoder's count 3 ms
    old = np.isfinite(late.measurements["relative/orientation"]).all(axis=1)
    assert not old[:6].any()
    assert old[9:].mean() > 0.5
    steer, lag = plain.measurements["steer/angle"][:, 0], 0.0025 * 100.0
    expected = (1.0 - lag) * steer[1:] + lag * steer[:-1]
    np.testing.assert_allclose(late.measurements["steer/angle"][1:, 0], expected, atol=2e-3)
    disturbed = np.abs(late.measurements["bicycle_imu/mag"] - plain.measurements["bicycle_imu/mag"])
    assert 0.5 < np.max(disturbed) < 40.0
    with pytest.raises(ValueError, match=r"timing must be of sites among .*, got \['seet'\]"):
        make(**options, timing={"seet": "wired"})


def test_a_snapshot_holds_clocks_and_fields():
    env = make(suite="all", timing="wireless", magnetics="street", duration=2.0)
    ride(env, seed=2, steps=70)
    snapshot = env.snapshot()
    ahead, _ = zip(*(env.step(env.neutral_action)[:2] for _ in range(60)), strict=True)
    env.restore(snapshot)
    again, _ = zip(*(env.step(env.neutral_action)[:2] for _ in range(60)), strict=True)
    for one, other in zip(ahead, again, strict=True):
        for name, values in one.items():
            np.testing.assert_array_equal(other[name], values)
    env.close()
