"""The command that trains networks: what it hands on to the training."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from poise.baselines.learned import training
from poise.baselines.learned.fit import CHECKPOINT
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
