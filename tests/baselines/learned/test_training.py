"""Training learns, repeats itself bit by bit, goes on after an interruption and survives bad numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from poise.baselines.learned import training
from poise.baselines.learned.dataset import LearnedDataset
from poise.baselines.learned.gravity_aligned_frame import FEATURES
from poise.baselines.learned.gru_module import GruModule, inclination_loss
from poise.baselines.learned.training import Trainer, TrainingConfig, train, validation_error
from poise.filters.core.metrics import direction_error
from poise.scripts.main import main

SMALL = TrainingConfig(epochs=2, batch=8, window=20, units=8, learning_rate=1e-2)


def leaning(count: int, length: int = 40, seed: int = 0) -> LearnedDataset:
    """Frames that lean by a constant angle, of which a noisy velocity tells: the task with a known answer."""
    rng = np.random.default_rng(seed)
    tilt = rng.uniform(-0.1, 0.1, (count, 1, 2))
    features = 0.1 * rng.standard_normal((count, length, FEATURES.size))
    features[..., 3:5] += 5.0 * tilt
    vertical = np.concatenate([tilt, np.ones_like(tilt[..., :1])], axis=-1)
    vertical = np.repeat(vertical / np.linalg.norm(vertical, axis=-1, keepdims=True), length, axis=1)
    scored = np.ones((count, length), bool)
    names = tuple(f"leaning-{index}" for index in range(count))
    return LearnedDataset(features.astype(np.float32), vertical.astype(np.float32), scored, names)


@pytest.fixture(scope="module")
def data() -> tuple[LearnedDataset, LearnedDataset]:
    return leaning(64), leaning(32, seed=1)


def test_the_loss_is_the_error_of_tables() -> None:
    rng = np.random.default_rng(0)
    tilt, vertical = torch.from_numpy(rng.normal(0, 0.1, (3, 50, 2))), torch.from_numpy(rng.normal(0, 1, (3, 50, 3)))
    known = torch.from_numpy(rng.random((3, 50)) < 0.7)
    known[2] = False
    estimate = np.concatenate([tilt.numpy(), np.ones((3, 50, 1))], axis=-1)
    error = direction_error(estimate, vertical.numpy())
    expected = np.mean([np.sqrt(np.mean(error[index][known[index]] ** 2)) for index in range(2)])
    assert float(inclination_loss(tilt, vertical, known)) == pytest.approx(expected, rel=1e-12)


def test_the_loss_has_finite_gradients_everywhere() -> None:
    tilt = torch.zeros(2, 5, 2, requires_grad=True)
    vertical = torch.tensor([0.0, 0.0, 1.0]).repeat(2, 5, 1)
    for known in (torch.ones(2, 5, dtype=torch.bool), torch.zeros(2, 5, dtype=torch.bool)):
        loss = inclination_loss(tilt, vertical, known)
        loss.backward()
        assert float(loss.detach()) == 0.0
        assert tilt.grad is not None
        assert torch.isfinite(tilt.grad).all()


def test_a_constant_lean_is_learned(data: tuple[LearnedDataset, LearnedDataset], tmp_path: Path) -> None:
    config = replace(SMALL, epochs=25)
    before = np.rad2deg(validation_error(GruModule(8, 0), data[1]))
    result = train(config, tmp_path, dataset=data[0], validation=data[1])
    after = result.history[result.best_epoch - 1]["validation_deg"]
    assert before > 3.0
    assert after < 0.25 * before


def test_equal_seeds_give_equal_weights(data: tuple[LearnedDataset, LearnedDataset], tmp_path: Path) -> None:
    first, second, other = (
        train(replace(SMALL, seed=seed), tmp_path / name, dataset=data[0], validation=data[1])
        for name, seed in (("a", 0), ("b", 0), ("c", 1))
    )
    assert first.history == second.history
    for name, array in first.arrays.items():
        np.testing.assert_array_equal(array, second.arrays[name])
    assert any(not np.array_equal(array, other.arrays[name]) for name, array in first.arrays.items())


def test_training_leaves_the_global_generator_and_threads_alone(
    data: tuple[LearnedDataset, LearnedDataset], tmp_path: Path
) -> None:
    state, threads = torch.random.get_rng_state(), torch.get_num_threads()
    train(replace(SMALL, epochs=1), tmp_path, dataset=data[0], validation=data[1])
    assert torch.equal(torch.random.get_rng_state(), state)
    assert torch.get_num_threads() == threads


def test_an_interrupted_training_goes_on_bit_by_bit(
    data: tuple[LearnedDataset, LearnedDataset], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = replace(SMALL, epochs=3)
    whole = train(config, tmp_path / "whole", dataset=data[0], validation=data[1])

    def interrupt(folder: Path) -> Any:
        def log(entry: dict[str, float] | None) -> None:
            if entry is not None:
                raise KeyboardInterrupt

        return log

    with monkeypatch.context() as patch:
        patch.setattr(training, "open_log", interrupt)
        with pytest.raises(KeyboardInterrupt):
            train(config, tmp_path / "parts", dataset=data[0], validation=data[1])
    resumed = train(config, tmp_path / "parts", dataset=data[0], validation=data[1], resume=True)
    assert resumed.history == whole.history
    for name, array in whole.arrays.items():
        np.testing.assert_array_equal(array, resumed.arrays[name])


def test_only_the_same_training_is_resumed(data: tuple[LearnedDataset, LearnedDataset], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="nothing to resume"):
        train(SMALL, tmp_path, dataset=data[0], validation=data[1], resume=True)
    train(replace(SMALL, epochs=1), tmp_path, dataset=data[0], validation=data[1])
    with pytest.raises(ValueError, match=r"started with config\.epochs 1, not 2"):
        train(SMALL, tmp_path, dataset=data[0], validation=data[1], resume=True)
    with pytest.raises(ValueError, match="started with data"):
        train(replace(SMALL, epochs=1), tmp_path, dataset=leaning(32), validation=data[1], resume=True)


def test_bad_numbers_change_nothing_and_end_a_training_at_last(data: tuple[LearnedDataset, LearnedDataset]) -> None:
    trainer = Trainer(SMALL, data[0], 0)
    before = trainer.module.arrays()
    for _ in range(training.MOST_BAD_STEPS - 1):
        assert not trainer.descend(trainer.module.output.weight.sum() * float("nan"))
    for name, array in trainer.module.arrays().items():
        np.testing.assert_array_equal(array, before[name])
    assert trainer.descend((trainer.module.output.weight**2).sum() + trainer.module.output.bias.sum())
    for _ in range(training.MOST_BAD_STEPS - 1):
        trainer.descend(trainer.module.output.weight.sum() * float("inf"))
    with pytest.raises(RuntimeError, match="not finite in 10 updates"):
        trainer.descend(trainer.module.output.weight.sum() * float("inf"))


def test_a_sequence_with_nan_does_not_spoil_the_others(tmp_path: Path) -> None:
    bad = leaning(17)
    bad.features[3] = np.nan
    result = train(replace(SMALL, epochs=1, batch=4), tmp_path, dataset=bad, validation=leaning(4, seed=1))
    assert 0.0 < result.history[0]["skipped"] < 8.0
    assert all(np.isfinite(array).all() for array in result.arrays.values())


def test_senseless_configurations_are_refused() -> None:
    for name, value in (("epochs", 0), ("units", 0), ("learning_rate", 0.0), ("warmup", 1.0), ("clip", -1.0)):
        with pytest.raises(ValueError, match=name):
            replace(SMALL, **{name: value})


def test_the_command_leaves_weights_that_load(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from poise.baselines.learned.estimator import LearnedEstimator
    from poise.baselines.weights_io import load_weights

    words = ["train", "gru", "--episodes", "2", "--epochs", "1", "--units", "8", "--test-episodes", "1"]
    assert main([*words, "--runs", str(tmp_path / "runs"), "--export", str(tmp_path / "mine")]) == 0
    assert "Inclination error" in capsys.readouterr().out
    (folder,) = (tmp_path / "runs" / "train").iterdir()
    for name in ("args.json", "versions.json", "results.csv", "checkpoint.pt", "gru.safetensors", "gru.json"):
        assert (folder / name).is_file(), name
    arrays, card = load_weights(tmp_path / "mine")
    assert card["command"].startswith("poise train gru --preset quick --seed 0 --episodes 2 --epochs 1 --units 8")
    assert card["test_inclination"]["randomised"]["gru"]["mean_deg"] > 0.0
    assert LearnedEstimator.load(tmp_path / "mine").network.size == 8
    assert main([*words, "--runs", str(tmp_path / "runs"), "--resume", str(folder)]) == 0
    again, _ = load_weights(folder / "gru.safetensors")
    np.testing.assert_array_equal(again["output.weight"], arrays["output.weight"])


@pytest.mark.slow
def test_the_quick_training_improves_on_its_front_end(tmp_path: Path) -> None:
    from poise.baselines.weights_io import load_weights

    assert main(["train", "gru", "--runs", str(tmp_path), "--export", str(tmp_path / "mine")]) == 0
    tested = load_weights(tmp_path / "mine")[1]["test_inclination"]["randomised"]
    assert tested["gru"]["mean_deg"] < 0.95 * tested["gru (front end alone)"]["mean_deg"]
