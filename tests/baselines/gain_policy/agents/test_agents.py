"""Every agent learns, exports what it trained, and continues exactly where it was stopped."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from poise.baselines.gain_policy.agents.learners import policy_errors_of
from poise.baselines.gain_policy.agents.recurrent import RecurrentGainPolicy
from poise.baselines.gain_policy.config import OffPolicySettings, TrainingConfig, config_of
from poise.baselines.gain_policy.training import CHECKPOINT, PolicyTraining, train_policy, training_key
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.tuned import TunedFilter

SMALL = TrainingConfig(
    filter="bounded-motion",
    gains=("velocity", "process"),
    total_timesteps=768,
    gain_search=0,
    warm_start=0,
    net_arch=(8,),
    n_steps=16,
    lstm_units=8,
    smoothing=0.3,
    off_policy=OffPolicySettings(buffer_size=512, learning_starts=64, gradient_steps=1, batch_size=32),
)
AGENTS = ["ppo", "recurrent-ppo", "sac", "td3"]
KALMAN = tunable_filter("bounded-motion")


def config(agent, **changes):
    given = dataclasses.replace(config_of(agent, SMALL), n_envs=8, batch_size=32, n_epochs=2)
    return dataclasses.replace(given, **changes)


@pytest.fixture(scope="module")
def trajectories():
    return HandTrajectories(("slow", "fast"), duration=4.0, rates=(50.0, 100.0)).draw_many(0, 5)


def arrays(policy):
    if isinstance(policy, RecurrentGainPolicy):
        return [*policy.cell, *policy.output]
    return [array for layer in policy.layers for array in layer]


def assert_same(one, two):
    for first, second in zip(arrays(one), arrays(two), strict=True):
        np.testing.assert_array_equal(first, second)


class StoppedError(Exception):
    """Stands for whatever ends a process."""


def train(agent, trajectories, folder, stop=None, resume=False):
    seen = []

    def report(progress):
        seen.append(progress["steps"])
        if stop is not None and progress["steps"] >= stop:
            raise StoppedError

    def validate(policy):
        return float(policy_errors_of(KALMAN, policy, trajectories[:2]).mean())

    return train_policy(
        config(agent), trajectories=trajectories, folder=folder, resume=resume, report=report, validate=validate
    )


@pytest.fixture(scope="module")
def trained(trajectories, tmp_path_factory):
    """Agent → its policy, and the folder of its training."""

    @cache
    def once(agent):
        folder = tmp_path_factory.mktemp(agent)
        return train(agent, trajectories, folder), folder

    return once


@pytest.mark.parametrize("agent", AGENTS)
def test_stopped_and_resumed_it_is_the_same_policy(agent, trained, trajectories, tmp_path):
    whole, _ = trained(agent)
    with pytest.raises(StoppedError):
        train(agent, trajectories, tmp_path, stop=512)
    resumed = train(agent, trajectories, tmp_path, resume=True)
    assert_same(whole, resumed)
    assert whole.card["chosen_steps"] == resumed.card["chosen_steps"]
    assert whole.card["training"]["agent"] == agent


@pytest.mark.parametrize("agent", AGENTS)
def test_the_exported_policy_acts_as_the_model(agent, trajectories):
    import torch

    settings = config(agent, total_timesteps=128)
    tuned = TunedFilter.of(KALMAN, settings.gains, smoothing=settings.smoothing)
    start = np.array([0.4, -0.3])
    training = PolicyTraining(settings, tuned, trajectories, start, None, {}, None, None)
    training.begin()
    training.model.learn(128, reset_num_timesteps=False)
    training.env.training = False
    policy, observation = training.exported(), training.env.reset()
    recurrent = isinstance(policy, RecurrentGainPolicy)
    memory, state, begins = policy.begin(8) if recurrent else None, None, np.ones(8, bool)
    for _ in range(12):
        seen = training.env.get_original_obs()[:, : tuned.observation_size]
        with torch.no_grad():
            action, state = training.model.predict(observation, state, begins, deterministic=True)
        mine, memory = policy(seen, memory) if recurrent else (policy(seen), None)
        np.testing.assert_allclose(mine, action, atol=2e-4)  # float32 against double
        observation, _, begins, _ = training.env.step(action)
    assert np.isfinite(policy_errors_of(KALMAN, policy, trajectories)).all()


@pytest.mark.parametrize("agent", AGENTS)
def test_before_it_learned_it_acts_about_the_start(agent, trajectories):
    settings = config(agent)
    tuned = TunedFilter.of(KALMAN, settings.gains, smoothing=settings.smoothing)
    training = PolicyTraining(settings, tuned, trajectories, np.array([0.5, -0.5]), None, {}, None, None)
    training.begin()
    policy = training.exported()
    seen = np.zeros((3, tuned.observation_size))
    action = policy(seen, policy.begin(3))[0] if isinstance(policy, RecurrentGainPolicy) else policy(seen)
    np.testing.assert_allclose(action, np.tile([0.5, -0.5], (3, 1)), atol=0.15)


def test_a_checkpoint_of_another_agent_or_without_replay_is_refused(trained, trajectories):
    _, folder = trained("sac")
    kept = (folder / CHECKPOINT).read_bytes()
    with pytest.raises(ValueError, match=r"was started with config\.agent sac, not td3"):
        train("td3", trajectories, folder, resume=True)
    assert (folder / CHECKPOINT).read_bytes() == kept


def test_a_recurrent_policy_is_saved_without_code(trained, trajectories, tmp_path):
    policy, _ = trained("recurrent-ppo")
    read = RecurrentGainPolicy.load(policy.save(tmp_path / "mine"), policy.tuned)
    assert read.tuned.smoothing == 0.3
    errors = [policy_errors_of(KALMAN, each, trajectories) for each in (policy, read)]
    np.testing.assert_allclose(*errors, rtol=1e-4)
    other = TunedFilter.of(KALMAN, ("velocity",))
    with pytest.raises(ValueError, match="is for filter, features and actions"):
        RecurrentGainPolicy.load(tmp_path / "mine", other)


@pytest.mark.parametrize("agent", ["ppo", "sac"])
def test_pose_errors_and_gains_are_logged(agent, trained):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    (log,) = trained(agent)[1].glob("tensorboard*")
    events = EventAccumulator(str(log)).Reload()
    assert {"pose/error_deg", "gains/velocity", "gains/process"} <= set(events.Tags()["scalars"])
    assert all(0.0 < each.value < 90.0 for each in events.Scalars("pose/error_deg"))


def test_the_key_names_the_agent(trajectories):
    tuned = TunedFilter.of(KALMAN, SMALL.gains)
    keys = [training_key(config(agent), tuned, trajectories) for agent in AGENTS]
    assert [key["config"]["agent"] for key in keys] == AGENTS


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: TrainingConfig(agent="dqn"), "agent must be one of"),
        (lambda: TrainingConfig(smoothing=-1.0), "smoothing must be 0 or more"),
        (lambda: OffPolicySettings(buffer_size=0), "buffer_size must be at least 1"),
        (lambda: OffPolicySettings(learning_starts=-1), "learning_starts must be 0 or more"),
        (lambda: OffPolicySettings(noise=0.0), "noise must be positive"),
    ],
)
def test_wrong_settings_are_explained(make, words):
    with pytest.raises(ValueError, match=words):
        make()
