"""A training that is killed at any moment goes on to the same weights."""

from __future__ import annotations

import hashlib
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.learned.fit import CHECKPOINT

KILLS = 10
TRAINING = """
import sys
from pathlib import Path
import numpy as np
from poise.baselines.learned.config import FitConfig
from poise.baselines.learned.data import SequenceData
from poise.baselines.learned.fit import CHECKPOINT, fit
from poise.baselines.learned.head import TiltHead
from poise.baselines.learned.inputs.level_frame import LevelFrame
from poise.baselines.learned.networks.modules import GruModule

folder, rng, end = Path(sys.argv[1]), np.random.default_rng(0), LevelFrame()
target = np.concatenate([rng.normal(0.0, 0.05, (24, 100, 2)), np.ones((24, 100, 1))], axis=-1)
parts = (rng.standard_normal((24, 100, end.size)), target, np.ones((24, 100, 0)))
arrays = [part.astype(np.float32) for part in parts]
data = SequenceData(*arrays, np.ones((24, 100), bool), tuple(map(str, range(24))))
config = FitConfig(epochs=40, batch=8, window=25)
module = GruModule(end.size, 2, 24, scale=0.1, noise=0.1)
print("begin", flush=True)
resume = (folder / CHECKPOINT).is_file()
say = lambda line: print(line, flush=True)
result = fit(module, end, TiltHead(), data, data, config, folder=folder, resume=resume, say=say)
result.estimator.save(folder / "done", {"name": "done"})
"""


def started(folder: Path) -> subprocess.Popen[str]:
    """A training that has begun."""
    process = subprocess.Popen([sys.executable, "-c", TRAINING, str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "begin"
    return process


def finished(folder: Path) -> str:
    """Digest of the weights of a training that may go on to its end."""
    process = started(folder)
    process.communicate(timeout=900)
    assert process.returncode == 0
    return hashlib.sha256((folder / "done.safetensors").read_bytes()).hexdigest()


@pytest.mark.slow
def test_kills_at_random_moments_change_nothing(tmp_path: Path) -> None:
    whole = finished(tmp_path / "whole")
    rng, killed = np.random.default_rng(0), 0
    for _ in range(KILLS):
        process = started(tmp_path / "parts")
        assert process.stdout is not None
        # at any moment of any epoch, however busy the machine is
        for _ in range(rng.integers(0, 5)):
            process.stdout.readline()
        time.sleep(rng.uniform(0.0, 0.1))
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            killed += 1
        process.wait(timeout=60)
    assert killed >= KILLS // 2
    assert (tmp_path / "parts" / CHECKPOINT).is_file()
    assert finished(tmp_path / "parts") == whole
