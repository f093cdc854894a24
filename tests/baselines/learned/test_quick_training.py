"""The small version of a training learns visibly, within minutes."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from poise.baselines.weights_io import load_weights
from poise.scripts.main import main


@pytest.mark.slow
def test_the_quick_network_of_hands_learns_within_minutes(tmp_path: Path) -> None:
    start = time.process_time()
    words = ["train", "bounded-motion+network", "--quick", "--processes", "1", "--runs", str(tmp_path / "runs")]
    assert main([*words, "--export", str(tmp_path / "quick")]) == 0
    assert time.process_time() - start < 180.0
    _, card = load_weights(tmp_path / "quick")
    assert card["best_epoch"] >= 1
    carried = card["test"]["carried-varying"]
    assert carried["bounded-motion+network"]["mean_deg"] < 0.95 * carried["bounded-motion"]["mean_deg"]
