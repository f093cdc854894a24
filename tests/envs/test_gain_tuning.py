"""Environments in which an agent tunes a filter: what is theirs beyond the contract of all environments."""

from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from poise.envs.gain_tuning import GainTuningEnv, HandMotionGainEnv, ReplayGainEnv
from poise.envs.hand.trajectories import HandTrajectories
from poise.envs.recipes.registry import recipe, save_recipe
from poise.filters.adaptation.features import InnovationFeatures
from poise.filters.adaptation.gains import (
    DECADES,
    gain_ranges,
    gain_sizes,
    log_gains,
    tunable_filter,
)
from poise.filters.adaptation.tuned import TunedFilter
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.metrics import direction_error
from poise.filters.imu.bounded_motion import BoundedMotion
from poise.filters.imu.external_acceleration import (
    FOLLOWED_DRIFT,
    LARGEST_C_A,
    LARGEST_NOISE,
    ExternalAcceleration,
    followable_c_a,
)

FILTERS = ("external-acceleration", "bounded-motion")


@pytest.fixture(scope="module")
def trajectory():
    return HandTrajectories(duration=6.0).draw_many(5, 1)[0]


def play(env, policy, seed=0):
    """Rewards and infos of one episode."""
    observation, info = env.reset(seed=seed)
    rewards, infos, over = [], [info], False
    while not over:
        observation, reward, terminated, truncated, info = env.step(policy(observation))
        rewards.append(reward)
        infos.append(info)
        over = terminated or truncated
        assert env.observation_space.contains(observation)
    return rewards, infos


@pytest.mark.parametrize("name", FILTERS)
def test_zero_action_is_the_published_tuning_bit_by_bit(name, trajectory):
    env = ReplayGainEnv(trajectory, name)
    _, infos = play(env, lambda observation: env.neutral_action)
    plain = tunable_filter(name).with_dt(trajectory.dt).run(trajectory.measurements)
    ticks = env.tuned.interval_samples * np.arange(1, len(infos)) - 1
    for output in env.tuned.kalman.outputs:
        said = np.stack([info["estimate"][output.name] for info in infos[1:]])
        np.testing.assert_array_equal(said, plain.pose[output.name][ticks])
    errors = direction_error(plain.pose["up"], trajectory.truth_of("up"))
    means = errors[: len(ticks) * env.tuned.interval_samples].reshape(len(ticks), -1).mean(axis=1)
    np.testing.assert_allclose([info["error_deg"] for info in infos[1:]], np.degrees(means), rtol=1e-12)


@pytest.mark.parametrize("name", FILTERS)
def test_reward_is_minus_the_error_or_the_improvement(name, trajectory):
    def choose(observation):
        return np.array([0.5, -0.5, 0.2], np.float32)

    gains = tuple(tunable_filter(name).gains)
    errors, infos = play(ReplayGainEnv(trajectory, name, gains=gains, reward="error"), choose)
    np.testing.assert_allclose(errors, [-np.radians(info["error_deg"]) for info in infos[1:]], rtol=1e-12)
    neutral = np.zeros(3, np.float32)
    published, _ = play(ReplayGainEnv(trajectory, name, gains=gains, reward="error"), lambda observation: neutral)
    better, _ = play(ReplayGainEnv(trajectory, name, gains=gains, reward="improvement"), choose)
    np.testing.assert_allclose(better, np.subtract(errors, published), atol=1e-12)
    for reward in ("improvement", "relative"):
        nothing, _ = play(ReplayGainEnv(trajectory, name, gains=gains, reward=reward), lambda observation: neutral)
        assert not np.any(nothing)


def test_by_default_an_agent_sets_what_suits_exploration_and_the_gains_follow(trajectory):
    env = ReplayGainEnv(trajectory)
    assert [part.gain for part in env.tuned.ranges] == ["measurement"]
    assert env.reward.kind == "relative"
    env.reset(seed=0)
    *_, info = env.step(np.array([1.0]))
    share = -np.expm1(-0.1 / 1.0)
    published = env.tuned.kalman.model.accelerometer_noise
    assert info["gains"]["measurement"] == pytest.approx(published * (LARGEST_NOISE / published) ** share)


def test_consistency_costs(trajectory):
    plain, _ = play(ReplayGainEnv(trajectory), lambda observation: np.zeros(1))
    strict, _ = play(ReplayGainEnv(trajectory, consistency=0.1), lambda observation: np.zeros(1))
    assert np.all(np.array(strict) <= np.array(plain))
    assert np.mean(strict) < np.mean(plain)


def test_unscored_and_unknown_ticks_do_not_count(trajectory):
    mask = np.ones(len(trajectory), bool)
    mask[:300] = False
    truth = {"up": trajectory.truth_of("up").copy()}
    truth["up"][300:-10] = np.nan
    rewards, infos = play(ReplayGainEnv(trajectory.replace(mask=mask, truth=truth)), lambda observation: np.ones(1))
    assert rewards[:-1] == [0.0] * (len(rewards) - 1)
    assert rewards[-1] != 0.0
    assert np.isfinite([info["error_deg"] for info in infos]).tolist() == [False] * (len(infos) - 1) + [True]


def test_the_agent_sees_nothing_of_the_truth(trajectory):
    other = trajectory.replace(truth={"up": np.roll(trajectory.truth_of("up"), 1, axis=1)})
    seen = []
    for item in (trajectory, other):
        env = ReplayGainEnv(item)
        observations = [env.reset()[0]]
        observations += [env.step(np.array([0.1]))[0] for _ in range(20)]
        seen.append(observations)
    np.testing.assert_array_equal(seen[0], seen[1])


def test_the_interval_is_kept_at_any_rate():
    for rate, ticks in ((50.0, 5), (100.0, 10), (286.0, 29)):
        env = HandMotionGainEnv(rate=rate, duration=2.0)
        _, infos = play(env, lambda observation: np.zeros(1))
        assert env.tuned.interval_samples == ticks
        assert np.allclose(np.diff([info["time"] for info in infos[1:]]), ticks / rate)
    assert TunedFilter.of(tunable_filter("bounded-motion"), None, InnovationFeatures(1e-3)).interval_samples == 1


def test_motion_and_setting_follow_the_seed():
    options = {"gesture": ("slow", "fast"), "rate": (50.0, 100.0), "noise_scale": (0.5, 2.0), "duration": 3.0}
    one, two = HandMotionGainEnv(**options), HandMotionGainEnv(**options)
    settings = set()
    for seed in range(8):
        one.reset(seed=seed)
        two.reset(seed=seed)
        assert one.trajectory.metadata == two.trajectory.metadata
        np.testing.assert_array_equal(one.trajectory.measurements["imu/acc"], two.trajectory.measurements["imu/acc"])
        settings.add((one.trajectory.metadata["gesture"], one.trajectory.metadata["rate"]))
    assert len(settings) > 2


def test_the_dynamic_drive_is_nearly_the_same_motion():
    kinematic, dynamic = (
        HandTrajectories(duration=2.0, drive=kind).draw_many(0, 1)[0] for kind in ("kinematic", "dynamic")
    )
    # an arm lags and trembles by tenths of a degree
    assert 0.01 < np.degrees(np.max(direction_error(kinematic.truth_of("up"), dynamic.truth_of("up")))) < 2.0
    env = HandMotionGainEnv(duration=1.0, drive="dynamic")
    play(env, lambda observation: np.zeros(1))


def test_replay_draws_parts_of_several_trajectories():
    both = HandTrajectories(duration=5.0, rates=(50.0, 100.0)).draw_many(3, 4)
    env = ReplayGainEnv(both, duration=1.0)
    env.reset(seed=0)
    starts = set()
    for _ in range(20):
        _, info = env.reset()
        starts.add((env.trajectory.name, info["time"]))
        assert len(env.trajectory) == round(1.0 / env.trajectory.dt)
    assert len(starts) > 10


def test_replay_draws_only_parts_that_can_be_scored(trajectory):
    truth = {"up": trajectory.truth["up"].copy()}
    truth["up"][150:] = np.nan
    lost = trajectory.measurements["imu/acc"].copy()
    lost[:60] = np.nan
    # Truth until 1.5 s, forces from 0.6 s on: parts of 0.5 s must end after 0.6 s and begin before 1.5 s.
    some = trajectory.replace(truth=truth, measurements={**trajectory.measurements, "imu/acc": lost})
    options = {"trajectory": some, "duration": 0.5, "reward": "error"}
    env, many, starts = ReplayGainEnv(**options), gym.make_vec("poise/ReplayGain-v0", 4, **options), set()
    for seed in range(40):
        rewards, _ = play(env, lambda observation: np.ones(1), seed)
        starts.add(round(100 * env.trajectory.time[0]))
        assert any(rewards)
    assert 10 < min(starts) < 25
    assert 130 < max(starts) < 150
    for seed in range(4):
        many.reset(seed=seed)
        assert sum(many.step(np.ones((4, 1)))[1] for _ in range(5)).all()
    with pytest.raises(ValueError, match=r"no part of .* of 0.05 s has a sample of every channel"):
        ReplayGainEnv(some.replace(mask=some.time < 0.5), duration=0.05, interval=0.05)


def test_recordings_are_read_from_files(tmp_path, trajectory):
    path = trajectory.save(tmp_path / "one.h5")
    rewards, _ = play(gym.make("poise/ReplayGain-v0", trajectory=path), lambda observation: np.zeros(1, np.float32))
    assert len(rewards) == len(trajectory) // 10


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"filter": "kalman"}, "filter must be a Kalman filter with gains, got 'kalman'"),
        ({"filter": 3}, "filter must be of type .*KalmanFilter, got 3"),
        ({"gains": ("process", "cheek")}, "gains must be distinct names from"),
        ({"gains": ()}, "gains must be distinct names from"),
        ({"gains": "measurement"}, "gains must be a sequence or None, got 'measurement'"),
        ({"privileged": "yes"}, "privileged must be True or False"),
        ({"noise_scale": -1.0}, "noise_scale must be 0 or more or a sequence"),
        ({"quantity": "position"}, "quantity must be one of"),
        ({"interval": 0.0}, "interval must be positive"),
        ({"reward": "fame"}, "reward must be"),
        ({"consistency": -1.0}, "consistency must be"),
        ({"gesture": "wave"}, "unknown gesture 'wave'"),
        ({"sensors": "nose"}, "unknown sensor preset 'nose'"),
        ({"rate": 0.0}, "rate must be at least 1 Hz"),
        ({"rate": ()}, "rates must not be empty"),
        ({"noise_scale": (2.0, 1.0)}, "noise_scale must be"),
        ({"duration": 0.05}, "duration must be one interval at least"),
        ({"drive": "magnetic"}, "drive must be one of"),
        ({"mounting": "upside-down"}, "mounting must be one of"),
        ({"render_mode": "ascii"}, "render_mode must be None or one of"),
    ],
)
def test_wrong_arguments_are_explained(arguments, words):
    with pytest.raises(ValueError, match=words):
        HandMotionGainEnv(**arguments)


def test_wrong_calls_are_explained(trajectory):
    env = ReplayGainEnv(trajectory, gains=("process", "measurement", "c_a"))
    with pytest.raises(RuntimeError, match="call reset first"):
        env.step(np.zeros(3))
    env.reset()
    for action in (np.zeros(2), np.full(3, np.nan), np.zeros((1, 3))):
        with pytest.raises(ValueError, match="action must hold 3 finite numbers"):
            env.step(action)
    with pytest.raises(ValueError, match="at least one trajectory"):
        ReplayGainEnv([])
    with pytest.raises(ValueError, match="knows no 'up'"):
        ReplayGainEnv(trajectory.replace(truth={}))
    unknown = {name: np.nan * values for name, values in trajectory.measurements.items()}
    with pytest.raises(ValueError, match="has no sample of 'imu/gyr': all are NaN"):
        ReplayGainEnv(trajectory.replace(measurements=unknown))
    for part in ({"truth": {"up": np.nan * trajectory.truth["up"]}}, {"mask": np.zeros(len(trajectory), bool)}):
        with pytest.raises(ValueError, match="has no scored sample with a known 'up'"):
            ReplayGainEnv(trajectory.replace(**part))
    with pytest.raises(ValueError, match="one interval at least"):
        ReplayGainEnv(trajectory[:5])
    with pytest.raises(ValueError, match="lacks the channels"):
        ReplayGainEnv(trajectory.replace(measurements={"imu/gyr": trajectory.measurements["imu/gyr"]})).reset()
    with pytest.raises(NotImplementedError):
        GainTuningEnv().reset()


# ---- what actions mean -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FILTERS)
def test_actions_reach_the_documented_ranges(name):
    model = tunable_filter(name).model
    ranges = gain_ranges(tunable_filter(name))
    for sign in (-1.0, 1.0):
        sizes = gain_sizes(model, log_gains(model, ranges, np.full(len(ranges), sign)))
        for gain, size in sizes.items():
            if (bounds := model.gains[gain].bounds) is not None:
                assert size == pytest.approx(bounds[1] if sign > 0 else bounds[0])
            else:
                published = getattr(model, model.gains[gain].parameter)
                assert (size / published) ** 2 == pytest.approx(10.0 ** (DECADES * sign))
    assert all(not np.any(factor) for factor in log_gains(model, ranges, np.zeros((4, len(ranges)))).values())


def drifted(c_a, process, bias, seconds=120.0):
    """Final error, deg, of a sensor at rest whose gyroscope has a bias from the 20th second on."""
    model = ExternalAcceleration(c_a=c_a, gyroscope_noise=process)
    length = int(seconds * 100)
    gyr = np.zeros((length, 3))
    gyr[2000:, 0] = bias
    acc = np.broadcast_to([0.0, 0.0, model.gravity], gyr.shape)
    up = KalmanFilter(model).run({"imu/gyr": gyr, "imu/acc": acc}).pose["up"]
    return float(np.degrees(direction_error(up[-1], np.array([0.0, 0.0, 1.0]))))


@pytest.mark.parametrize("process", [1e-3, 3e-3, 1e-2])
def test_no_action_locks_the_filter_out(process):
    """The bound of the closed form is where the filter is lost in simulation, and actions stay below it."""
    limit = followable_c_a(process)
    assert drifted(limit, process, 0.8 * FOLLOWED_DRIFT) < 10.0
    assert drifted(limit, process, 1.5 * FOLLOWED_DRIFT) > 20.0
    kalman = tunable_filter("external-acceleration")
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1.0, 1.0, (1000, 3))
    sizes = gain_sizes(kalman.model, log_gains(kalman.model, gain_ranges(kalman), actions))
    assert np.all(sizes["c_a"] <= followable_c_a(sizes["process"]) + 1e-12)
    assert np.all(sizes["c_a"] <= LARGEST_C_A)


def test_a_tuning_beyond_the_bound_can_still_be_published():
    kalman = KalmanFilter(ExternalAcceleration(c_a=0.7))
    assert not any(log_gains(kalman.model, gain_ranges(kalman), np.zeros(3)).values())


# ---- what the agent sees ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FILTERS)
def test_features_do_not_depend_on_the_mounting(name):
    base = HandTrajectories(duration=8.0, mounting="aligned", lever_arm=0.0, sensors="ideal").draw_many(2, 1)[0]
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    seen = []
    for axes in (np.eye(3), turn):
        measurements = {channel: base.measurements[channel] @ axes.T for channel in ("imu/gyr", "imu/acc")}
        tuned = TunedFilter.of(tunable_filter(name)).with_dt(base.dt)
        state = tuned.init({channel: values[0] for channel, values in measurements.items()})
        for start in range(0, 780, 10):
            _, state = tuned.advance(state, {key: values[start : start + 10] for key, values in measurements.items()})
        seen.append(tuned.observe(state))
    names = InnovationFeatures().names
    # whitening by a Cholesky factor depends on the axes, its length does not
    same = [
        index
        for index, feature in enumerate(names)
        if not feature.startswith(("innovation dev", "innovation mean", "innovation ch"))
    ]
    np.testing.assert_allclose(seen[0][same], seen[1][same], atol=1e-3)


def test_features_tell_rest_from_motion_and_have_names():
    names = InnovationFeatures().names
    tuned = TunedFilter.of(tunable_filter("external-acceleration"), ("measurement",))
    assert len(names) + tuned.actions == tuned.observation_size == HandMotionGainEnv().observation_space.shape[0]
    last = {}
    for gesture in ("rest", "fast"):
        env = HandMotionGainEnv(gesture=gesture, duration=3.0)
        observation, _ = env.reset(seed=1)
        for _ in range(20):
            observation, *_ = env.step(env.neutral_action)
        last[gesture] = dict(zip(names, observation, strict=False))
    for feature in ("gyr deviation 0.3 s", "acc deviation 0.3 s", "acc change 0 s", "norm excess rms 1 s"):
        assert last["fast"][feature] > last["rest"][feature] + 0.3


def test_a_filter_of_ones_own_can_be_tuned():
    env = HandMotionGainEnv(
        KalmanFilter(BoundedMotion(velocity_bound=2.0)), gains=("velocity",), duration=2.0, smoothing=0.0
    )
    _, infos = play(env, lambda observation: np.ones(1))
    assert infos[-1]["gains"] == {"velocity": pytest.approx(2.0 * 10.0 ** (DECADES / 2.0))}


def test_samples_that_are_missing_do_no_harm(trajectory):
    holes = {name: values.copy() for name, values in trajectory.measurements.items()}
    holes["imu/acc"][100:160] = np.nan
    holes["imu/gyr"][::7] = np.nan
    holes["imu/acc"][:5] = np.nan
    rewards, infos = play(ReplayGainEnv(trajectory.replace(measurements=holes)), lambda observation: np.ones(1))
    assert np.isfinite(rewards).all()
    assert np.isfinite(infos[-1]["error_deg"])


def test_episodes_come_from_a_recipe(tmp_path: Path) -> None:
    made = replace(recipe("hand-held"), duration=3.0, rates=(100.0, 100.0))
    env = HandMotionGainEnv(recipe=save_recipe(made, tmp_path / "short.json"))
    env.reset(seed=2)
    first = env.trajectory
    assert first is not None
    assert len(first) == 300
    env.reset(seed=2)
    np.testing.assert_array_equal(env.trajectory.measurements["imu/gyr"], first.measurements["imu/gyr"])
    env.reset()
    assert not np.array_equal(env.trajectory.measurements["imu/gyr"], first.measurements["imu/gyr"])
    with pytest.raises(ValueError, match="recipe must be one of hand motions, but 'rider' is of the kind 'rider'"):
        HandMotionGainEnv(recipe="rider")
    with pytest.raises(ValueError, match="duration must be one interval at least"):
        HandMotionGainEnv(recipe=replace(made, duration=0.05))
