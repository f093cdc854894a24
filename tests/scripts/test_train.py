"""The command that trains networks: what it hands on to the training."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poise.baselines.learned import training
from poise.baselines.learned.calibration import calibrated
from poise.baselines.learned.data import SequenceData
from poise.baselines.learned.estimator import LearnedEstimator
from poise.baselines.learned.fit import CHECKPOINT
from poise.baselines.weights_io import WEIGHTS, load_card
from poise.scripts.main import main


def test_a_training_that_was_killed_before_its_first_checkpoint_begins_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bool] = []

    def killed(*args: Any, resume: bool, **options: Any) -> None:
        asked.append(resume)
        raise KeyboardInterrupt

    monkeypatch.setattr(training, "train_preset", killed)
    assert main(["train", "gru", "--runs", str(tmp_path)]) == 130
    (folder,) = (tmp_path / "train").iterdir()
    assert main(["train", "gru", "--resume", str(folder)]) == 130
    (folder / CHECKPOINT).write_bytes(b"")
    assert main(["train", "gru", "--resume", str(folder)]) == 130
    assert asked == [False, False, True]


def test_a_covariance_is_found_anew_and_the_weights_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shipped, rng = WEIGHTS / "two-gyro_network.safetensors", np.random.default_rng(0)
    before = LearnedEstimator.load(shipped)
    features = rng.standard_normal((6, 20, before.front_end.size)).astype(np.float32)
    target = 0.1 * rng.standard_normal((6, 20, 4)).astype(np.float32)
    data = SequenceData(features, target, features[..., :0], np.ones((6, 20), bool), tuple("aabbcc"))
    monkeypatch.setattr(training, "ride_data", lambda *args, **options: data)
    words = ["train", "two-gyro+network", "--runs", str(tmp_path)]
    assert main([*words, "--calibrate", str(shipped), "--export", str(tmp_path / "mine")]) == 0
    found = tmp_path / "mine.safetensors"
    assert found.read_bytes() == shipped.read_bytes()
    card, old = load_card(found), load_card(shipped)
    assert all(card[name] == old[name] for name in ("command", "history", "test", "training", "versions"))
    assert card["calibration"]["rides"] == 3
    assert card["calibrated"]["command"].endswith(f"--calibrate {shipped}")
    assert LearnedEstimator.load(found).head == calibrated(before.network, before.head, data)[0] != before.head
    for wrong, said in (
        (["train", "gru", "--calibrate", "gru"], "only networks of riders"),
        ([*words, "--calibrate", str(WEIGHTS / "whole-body_network.safetensors")], "another front end"),
        ([*words, "--calibrate", str(shipped), "--start", str(shipped)], "takes no --start"),
    ):
        assert main([*wrong, "--runs", str(tmp_path)] if "--runs" not in wrong else wrong) != 0
        assert said in capsys.readouterr().err
