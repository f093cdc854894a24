import numpy as np
import pytest

from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.envs.record import record
from poise.envs.replay import ReplayEnv
from poise.filters.core import rotation


@pytest.fixture(scope="module")
def trajectory():
    return simulate_hand("fast", 4, "xsens-mtw-awinda", magnetometer=25.0)


def without(trajectory, *names):
    return trajectory.replace(truth={name: value for name, value in trajectory.truth.items() if name not in names})


def test_replayed_and_recorded_again_is_the_same_trajectory(trajectory):
    again = record(ReplayEnv(trajectory), seed=0)
    np.testing.assert_array_equal(again.time, trajectory.time)
    assert set(again.truth) == set(trajectory.truth)
    for name, values in trajectory.truth.items():
        np.testing.assert_array_equal(again.truth[name], values)
    for name, values in trajectory.measurements.items():
        # not through the float32 of observations
        np.testing.assert_array_equal(again.measurements[name], values)


@pytest.mark.parametrize("jitter", [0.0, 5e-4])
def test_time_is_kept_over_gaps_and_jitter(trajectory, jitter):
    """2.5 s are missing in the middle: an episode of 9.5 s ends after 9.5 s; the gap is neither sampled nor scored."""
    rows = np.flatnonzero((trajectory.time < 4.0) | (trajectory.time >= 6.5))
    noise = jitter * np.random.default_rng(0).uniform(-1.0, 1.0, len(rows))
    gappy = trajectory.replace(
        time=trajectory.time[rows] + noise,
        measurements={name: values[rows] for name, values in trajectory.measurements.items()},
        truth={name: values[rows] for name, values in trajectory.truth.items()},
        mask=trajectory.mask[rows],
    )
    env = ReplayEnv(gappy, duration=9.5)
    _, info = env.reset(seed=0)
    start, lost, unscored = info["time"], 0, 0
    for step in range(1, 951):
        observation, reward, _, truncated, info = env.step(env.neutral_action)
        assert info["time"] - start == pytest.approx(step / 100.0, abs=2e-3)
        lost += not observation["new_sample"][0]
        if not info["scored"]:
            unscored += 1
            assert np.isnan(info["truth"]["position"]).all()
        assert reward <= 0.0
    assert truncated
    assert lost == unscored == 250
    plain = record(ReplayEnv(trajectory, duration=9.5), seed=0).measurements["imu/gyr"]
    kept = record(ReplayEnv(gappy, duration=9.5), seed=0).measurements["imu/gyr"]
    seen = np.isfinite(kept[:, 0])
    np.testing.assert_array_equal(kept[seen], plain[seen])


def test_a_path_is_loaded(trajectory, tmp_path):
    path = trajectory.save(tmp_path / "episode.h5")
    assert len(record(ReplayEnv(path), seed=0)) == len(trajectory)


def test_window_and_random_start(trajectory):
    env = ReplayEnv(trajectory, duration=2.0, random_start=True)
    starts = set()
    for seed in range(8):
        _, info = env.reset(seed=seed)
        starts.add(info["time"])
        assert len(record(env, seed=seed)) == 201
    assert len(starts) > 4
    _, info = env.reset(seed=0, options={"start": 300})
    assert info["time"] == pytest.approx(3.0)
    _, info = ReplayEnv(trajectory, duration=2.0).reset(seed=5)
    assert info["time"] == 0.0
    env.reset(options={"start": 990})
    steps = 0
    while not env.step(env.neutral_action)[3]:
        steps += 1
    assert steps == 9


def test_perfect_estimates_earn_nothing_and_others_pay(trajectory):
    env = ReplayEnv(trajectory, score="orientation")
    _, info = env.reset(seed=0)
    for _ in range(100):
        _, reward, _, _, info = env.step(info["pose"]["orientation"])
        assert reward == pytest.approx(0.0, abs=1e-7)
    assert env.step(rotation.multiply(info["pose"]["orientation"], rotation.exp(np.array([0, 0.5, 0]))))[
        1
    ] == pytest.approx(-0.5)


def test_unscored_and_unknown_ticks_earn_nothing(trajectory):
    truth = {name: values.copy() for name, values in trajectory.truth.items()}
    truth["orientation"][50:100] = np.nan
    truth["up"][50:100] = np.nan
    mask = np.ones(len(trajectory), bool)
    mask[:20] = False
    env = ReplayEnv(trajectory.replace(truth=truth, mask=mask))
    _, info = env.reset(seed=0)
    rewards, scored = [], []
    for _ in range(120):
        scored.append(info["scored"])
        _, reward, _, _, info = env.step(np.array([0.1, 0.9, 0.2, 0.1]))
        rewards.append(reward)
        assert info["pose"]["orientation"].shape == (4,)
    rewards = np.array(rewards)
    assert scored == mask[:120].tolist()
    assert not rewards[:20].any()
    assert not rewards[50:100].any()
    assert (rewards[20:50] < 0.0).all()
    assert (rewards[100:] < 0.0).all()


def test_only_what_the_trajectory_knows_is_asked_for(trajectory):
    env = ReplayEnv(without(trajectory, "orientation"))
    assert env.action_space.shape == (3,)
    _, info = env.reset(seed=0)
    assert list(info["pose"]) == ["up"]
    assert env.step(info["pose"]["up"])[1] == pytest.approx(0.0, abs=1e-7)
    np.testing.assert_array_equal(env.neutral_action, [0, 0, 1])
    relative = without(trajectory, "orientation", "up")
    relative = relative.replace(truth=relative.truth | {"relative_orientation": trajectory.truth["orientation"]})
    env = ReplayEnv(relative)
    _, info = env.reset(seed=0)
    assert env.step(rotation.multiply(rotation.exp(np.array([0, 0, 1.0])), info["pose"]["relative_orientation"]))[
        1
    ] == pytest.approx(0.0, abs=1e-7)


def test_what_nobody_could_be_scored_on_is_refused(trajectory):
    nothing = {name: np.full_like(values, np.nan) for name, values in trajectory.measurements.items()}
    with pytest.raises(ValueError, match="has no sample of any channel: all are NaN"):
        ReplayEnv(trajectory.replace(measurements=nothing))
    ReplayEnv(trajectory.replace(measurements=nothing | {"imu/gyr": trajectory.measurements["imu/gyr"]}))
    with pytest.raises(ValueError, match="no scored sample with a known 'orientation' or 'relative_orientation' or"):
        ReplayEnv(trajectory.replace(mask=np.zeros(len(trajectory), bool)))
    unknown = np.full_like(trajectory.truth["orientation"], np.nan)
    partly = trajectory.replace(truth=trajectory.truth | {"orientation": unknown})
    with pytest.raises(ValueError, match=r"no scored sample with a known 'orientation'$"):
        ReplayEnv(partly, score="orientation")
    assert ReplayEnv(partly).action_space.shape == (3,)


def test_snapshots_continue(trajectory):
    env, other = ReplayEnv(trajectory), ReplayEnv(trajectory)
    env.reset(seed=0)
    for _ in range(37):
        env.step(env.neutral_action)
    snapshot = env.snapshot()
    left = [env.step(env.neutral_action) for _ in range(50)]
    other.restore(snapshot)
    for a, b in zip(left, [other.step(other.neutral_action) for _ in range(50)], strict=True):
        assert a[1] == b[1]
        for name in a[0]:
            np.testing.assert_array_equal(a[0][name], b[0][name])


def test_bad_arguments_are_refused(trajectory):
    with pytest.raises(ValueError, match="neither orientation nor up"):
        ReplayEnv(without(trajectory, "orientation", "up"))
    with pytest.raises(ValueError, match="duration must be at most 10 s"):
        ReplayEnv(trajectory, duration=11.0)
    with pytest.raises(ValueError, match="duration must be positive"):
        ReplayEnv(trajectory, duration=0.0)
    with pytest.raises(ValueError, match="two samples"):
        ReplayEnv(trajectory[:1])
    with pytest.raises(ValueError, match="score must be one of"):
        ReplayEnv(without(trajectory, "orientation"), score="orientation")
    env = ReplayEnv(trajectory)
    for start, message in ((1000, "must lie in"), (-1, "must lie in"), (1.5, "must be the index of a sample")):
        with pytest.raises(ValueError, match=message):
            env.reset(options={"start": start})


def test_channels_without_any_sample_have_a_space():
    trajectory = Trajectory(
        np.arange(5) * 0.01,
        {"imu/acc": np.full((5, 3), np.nan), "imu/gyr": np.zeros((5, 3))},
        {"up": np.tile([0.0, 0.0, 1.0], (5, 1))},
    )
    env = ReplayEnv(trajectory)
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert observation["new_sample"].tolist() == [0, 1]
