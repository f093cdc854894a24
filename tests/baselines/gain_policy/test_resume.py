"""A training that was stopped anywhere gives, resumed, the policy of one that was not; whatever is wrong is said."""

import dataclasses
import io
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from poise.baselines import checkpoint
from poise.baselines.gain_policy.config import TrainingConfig
from poise.baselines.gain_policy.constant_gains import policy_errors
from poise.baselines.gain_policy.training import CHECKPOINT, train_policy
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter

CONFIG = TrainingConfig(
    filter="bounded-motion",
    gains=("velocity",),
    total_timesteps=1280,
    n_envs=16,
    n_steps=16,
    batch_size=64,
    n_epochs=2,
    gain_search=0,
    warm_start=4,
    net_arch=(8,),
    learning_rate=3e-3,
)
UPDATES = 5
KALMAN = tunable_filter("bounded-motion")


class StoppedError(Exception):
    """Stands for whatever ends a process."""


@pytest.fixture(scope="module")
def trajectories():
    return HandTrajectories(("slow", "fast"), duration=6.0, rates=(50.0, 100.0)).draw_many(0, 6)


@pytest.fixture(scope="module")
def folder_of_uninterrupted(tmp_path_factory):
    return tmp_path_factory.mktemp("whole")


@pytest.fixture(scope="module")
def uninterrupted(trajectories, folder_of_uninterrupted):
    return train(trajectories, folder_of_uninterrupted)


def train(trajectories, folder, *, config=CONFIG, resume=False, report=None, looked=lambda: None):
    def validate(policy):
        looked()
        return float(policy_errors(KALMAN, policy, trajectories[:2]).mean())

    return train_policy(
        config, trajectories=trajectories, folder=folder, resume=resume, report=report, validate=validate
    )


def stopping(count):
    """A function that raises when it is called the ``count``-th time."""
    calls = []

    def stop(*_):
        calls.append(None)
        if len(calls) == count:
            raise StoppedError

    return stop


def assert_same(one, two):
    for first, second in zip(one.layers, two.layers, strict=True):
        np.testing.assert_array_equal(first[0], second[0])
        np.testing.assert_array_equal(first[1], second[1])
    for name in ("steps", "chosen_steps", "constant_action"):
        assert one.card[name] == two.card[name]


@pytest.mark.parametrize("stops", [(1,), (UPDATES,), (2, 1, 1)])
def test_stopped_after_any_update_it_gives_the_same_policy(trajectories, uninterrupted, tmp_path, stops):
    for count, stop in enumerate(stops):
        with pytest.raises(StoppedError):
            train(trajectories, tmp_path, resume=count > 0, report=stopping(stop))
    assert_same(train(trajectories, tmp_path, resume=True), uninterrupted)


@pytest.mark.parametrize("stop", [2, 5])
def test_stopped_in_a_validation_it_gives_the_same_policy(trajectories, uninterrupted, tmp_path, stop):
    with pytest.raises(StoppedError):
        train(trajectories, tmp_path, looked=stopping(stop))
    assert_same(train(trajectories, tmp_path, resume=True), uninterrupted)


@pytest.mark.parametrize("call", [5, 6])
def test_stopped_while_a_checkpoint_is_written_it_gives_the_same_policy(
    trajectories, uninterrupted, tmp_path, monkeypatch, call
):
    """Calls of ``os.replace`` alternate between keeping the checkpoint before and placing the new one."""
    stop, replace = stopping(call), os.replace

    def stopped_replace(*paths):
        stop()
        replace(*paths)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", stopped_replace)
        with pytest.raises(StoppedError):
            train(trajectories, tmp_path)
    assert {path.suffix for path in tmp_path.iterdir() if path.is_file()} == {".pt"}
    assert_same(train(trajectories, tmp_path, resume=True), uninterrupted)


def test_a_finished_training_gives_its_policy_again(trajectories, uninterrupted, folder_of_uninterrupted):
    assert_same(train(trajectories, folder_of_uninterrupted, resume=True), uninterrupted)


def test_a_longer_training_continues_a_shorter_one(trajectories, tmp_path):
    train(trajectories, tmp_path, config=dataclasses.replace(CONFIG, total_timesteps=512))
    steps = []
    longer = train(trajectories, tmp_path, resume=True, report=lambda progress: steps.append(progress["steps"]))
    assert steps[0] == 768
    assert longer.card["steps"] == CONFIG.total_timesteps
    assert list(tmp_path.rglob("events.out.tfevents*"))


@pytest.fixture(scope="module")
def stopped(trajectories, tmp_path_factory):
    """A folder with a checkpoint and the one before it."""
    folder = tmp_path_factory.mktemp("stopped")
    with pytest.raises(StoppedError):
        train(trajectories, folder, report=stopping(4))
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def put(folder, files):
    for name, data in files.items():
        (folder / name).write_bytes(data)


def test_nothing_to_resume_is_an_error_and_no_fresh_start(trajectories, tmp_path):
    with pytest.raises(ValueError, match=f"nothing to resume: no {CHECKPOINT} in"):
        train(trajectories, tmp_path, resume=True)
    with pytest.raises(ValueError, match="needs a folder"):
        train_policy(CONFIG, resume=True)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"seed": 5}, "started with config.seed 0, not 5"),
        ({"gamma": 0.5}, "started with config.gamma 0.995, not 0.5"),
    ],
)
def test_a_checkpoint_of_another_configuration_is_refused(trajectories, stopped, tmp_path, changed, words):
    put(tmp_path, stopped)
    with pytest.raises(ValueError, match=words):
        train(trajectories, tmp_path, config=dataclasses.replace(CONFIG, **changed), resume=True)


def test_a_checkpoint_of_other_trajectories_or_another_filter_is_refused(trajectories, stopped, tmp_path):
    put(tmp_path, stopped)
    with pytest.raises(ValueError, match="started with trajectories "):
        train(trajectories[:-1], tmp_path, resume=True)
    other = dataclasses.replace(KALMAN, model=dataclasses.replace(KALMAN.model, velocity_bound=1.0))
    with pytest.raises(ValueError, match="started with filter KalmanFilter"):
        train_policy(CONFIG, kalman=other, trajectories=trajectories, folder=tmp_path, resume=True)


def test_a_checkpoint_of_another_version_is_refused(trajectories, stopped, tmp_path, monkeypatch):
    put(tmp_path, stopped)
    monkeypatch.setattr(checkpoint, "code_version", lambda: "0.0.0")
    with pytest.raises(ValueError, match=r"started with code .*, not 0\.0\.0"):
        train(trajectories, tmp_path, resume=True)


def damaged(data):
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


@pytest.mark.parametrize("damage", [damaged, lambda data: data[: len(data) // 2], lambda data: b"", lambda data: b"{}"])
def test_a_damaged_checkpoint_is_said_and_the_one_before_serves(trajectories, stopped, uninterrupted, tmp_path, damage):
    put(tmp_path, stopped | {CHECKPOINT: damage(stopped[CHECKPOINT])})
    with pytest.warns(UserWarning, match="is damaged or is not a checkpoint"):
        assert_same(train(trajectories, tmp_path, resume=True), uninterrupted)
    put(tmp_path, {name: damage(data) for name, data in stopped.items()})
    with (
        pytest.warns(UserWarning, match="is damaged or is not a checkpoint"),
        pytest.raises(ValueError, match=r"no checkpoint in .* can be read"),
    ):
        train(trajectories, tmp_path, resume=True)


class Trap:
    """A pickle that runs code when it is read."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def archive(state):
    """A file of torch in memory."""
    import torch

    data = io.BytesIO()
    torch.save({"key": "{}", "state": state}, data)
    return data.getvalue()


def test_a_foreign_pickle_runs_no_code(trajectories, tmp_path):
    witness = tmp_path / "witness"
    for write in (
        lambda path: path.write_bytes(pickle.dumps(Trap(witness))),
        lambda path: path.write_bytes(archive(Trap(witness))),
        lambda path: path.write_bytes(checkpoint.sealed(archive(Trap(witness)))),
    ):
        write(tmp_path / CHECKPOINT)
        with pytest.warns(UserWarning, match="not a checkpoint"), pytest.raises(ValueError, match="can be read"):
            train(trajectories, tmp_path, resume=True)
    assert not witness.exists()


SCRIPT = """
import sys
from test_resume import CONFIG, HandTrajectories, train
motions = HandTrajectories(("slow", "fast"), duration=6.0, rates=(50.0, 100.0)).draw_many(0, 6)
policy = train(motions, sys.argv[1], resume=sys.argv[2] == "resume")
"""


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.3, 0.7, 1.1])
def test_killed_it_gives_the_same_policy(trajectories, uninterrupted, tmp_path, seconds):
    environment = {**os.environ, "PYTHONPATH": f"{Path(__file__).parent}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    process = subprocess.Popen([sys.executable, "-c", SCRIPT, str(tmp_path), "new"], env=environment)
    while not (tmp_path / CHECKPOINT).is_file():
        assert process.poll() is None
        time.sleep(0.01)
    time.sleep(seconds)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert_same(train(trajectories, tmp_path, resume=True), uninterrupted)
