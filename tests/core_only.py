"""What works without PyBullet, torch and stable-baselines3: run with any Python that has the core of poise.

``python tests/core_only.py`` needs no test framework, so that it can check a wheel in an environment of its own;
``--block`` pretends that the packages of the extras are not installed. A recording in POISE_DATA is used too.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
import tempfile
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from pathlib import Path

BLOCKED = ("pybullet", "pybullet_data", "torch", "tensorboard", "stable_baselines3", "ahrs", "imufusion", "vqf")


class Absent:
    """Finder that knows nothing of the packages that extras bring."""

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: object = None) -> ModuleSpec | None:
        if name.split(".")[0] in BLOCKED:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return None


if "--block" in sys.argv:
    sys.meta_path.insert(0, Absent())  # type: ignore[arg-type]

import gymnasium  # noqa: E402
import numpy as np  # noqa: E402

import poise  # noqa: E402
from poise.scripts.main import main  # noqa: E402

README = Path(__file__).resolve().parents[1] / "README.md"
FAST = ("external-acceleration", "mahony", "tilt")
SHIPPED = ("gru", "external-acceleration+policy")


def sample(channel: str, size: int, length: int) -> np.ndarray:
    """Readings ``(length, size)`` of something that hardly moves."""
    still = np.zeros(size)
    if size == 3 and channel.endswith("/acc"):
        still[2] = 9.81
    elif channel.endswith("/mag"):
        still[:] = (0.0, 20.0, -45.0)
    elif channel.endswith("/orientation"):
        still[0] = 1.0
    elif channel == "wheel/speed":
        still[:] = 3.0
    return still + np.random.default_rng(0).normal(0.0, 1e-3, (length, size))


def every_filter_runs() -> None:
    """In its array form, which needs no compilation; the compiled form of some."""
    for name, info in poise.list_estimators().items():
        if info.kind == "external" or name in SHIPPED:
            continue
        estimator = poise.make_estimator(name)
        if info.kind != "learned" and hasattr(estimator, "compiled") and name not in FAST:
            estimator = poise.make_estimator(name, compiled=False)
        data = {channel.name: sample(channel.name, channel.size, 12) for channel in estimator.channels}
        estimate = poise.run(estimator, data, dt=estimator.dt)
        assert set(estimate.pose) == set(info.outputs), (name, set(estimate.pose), info.outputs)
        assert all(len(values) == 12 for values in estimate.pose.values()), name


def moved_by_hand(folder: Path) -> poise.Trajectory:
    """A kinematic motion, recorded, kept in a file and evaluated with what is shipped."""
    env = gymnasium.make("poise/HandMotion-v0", drive="kinematic", gesture="fast", duration=4.0)
    trajectory = poise.record(env, seed=0)
    loaded = poise.load_recording(trajectory.save(folder / "hand.h5"))
    assert all((loaded.measurements[name] == values).all() for name, values in trajectory.measurements.items())
    table = poise.evaluate([*SHIPPED, *FAST], loaded)
    errors = table[table["metric"] == "inclination"].set_index("estimator")["value"]
    assert set(errors.index) == {*SHIPPED, *FAST}
    assert errors["gru"] < 2.0 < errors["tilt"], errors
    return loaded


def an_agent_acts(trajectory: poise.Trajectory) -> None:
    """Replay and gain-tuning environments on a recording."""
    for env_id in ("poise/Replay-v0", "poise/ReplayGain-v0"):
        env = gymnasium.make(env_id, trajectory=trajectory)
        env.reset(seed=0)
        env.action_space.seed(0)
        rewards = [float(env.step(env.action_space.sample())[1]) for _ in range(5)]
        assert np.isfinite(rewards).all(), (env_id, rewards)


def recordings_are_evaluated(folder: Path) -> None:
    """Those of a user, by the command."""
    data = os.environ.get("POISE_DATA")
    paths = sorted(Path(data).rglob("*.mat"))[:1] if data else []
    words = ["evaluate", *map(str, paths or [folder / "hand.h5"]), "--estimators", "gru", *FAST, "--runs", str(folder)]
    status, out, err = command(*words, "--json")
    assert status == 0, err
    assert '"estimator": "gru"' in out


def command(*words: str) -> tuple[int, str, str]:
    """Exit status and both outputs of ``poise``."""
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        status = main(words)
    return status, out.getvalue(), err.getvalue()


def the_readme_is_right() -> None:
    """Its example of a user's own recording, as it stands there."""
    section = README.read_text(encoding="utf-8").split("## Your own recording")[1].split("\n## ")[0]
    (code,) = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(code, "README.md", "exec"), {"__name__": "example"})
    assert out.getvalue()


def the_rest_says_what_it_needs() -> None:
    """One line that names the extra; an ImportError from Python."""
    status, out, err = command("list", "environments")
    assert status == 0, err
    assert "pip install 'poise[sim]'" in out
    for words, extra in (
        (("record", "rider-bicycle", "--episodes", "1"), "sim"),
        (("train", "gru"), "learn"),
    ):
        status, _, err = command(*words)
        assert status == 2, err
        assert f"is not installed: pip install 'poise[{extra}]'" in err.splitlines()[-1]
    for env_id in ("poise/RiderBicycle-v0", "poise/BicycleFixture-v0"):
        assert "pip install 'poise[sim]'" in complaint(env_id)
    skipped = poise.evaluate(["tilt", "vqf"], poise.record(hand(), seed=1)).attrs["skipped"]
    assert "pip install 'poise[compare]'" in skipped[0][2]


def complaint(env_id: str) -> str:
    """What is said instead of making an environment."""
    try:
        gymnasium.make(env_id)
    except ImportError as error:
        return str(error)
    return ""


def hand() -> gymnasium.Env:
    """A short motion."""
    return gymnasium.make("poise/HandMotion-v0", drive="kinematic", duration=1.0)


def check() -> None:
    """Check one after the other."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.chdir(folder)
        every_filter_runs()
        an_agent_acts(moved_by_hand(folder))
        recordings_are_evaluated(folder)
        the_readme_is_right()
        the_rest_says_what_it_needs()
    found = sorted(name for name in BLOCKED if name in sys.modules)
    assert not found, f"loaded: {found}"
    print(f"poise {poise.__version__} on Python {sys.version.split()[0]}: the core works alone")


if __name__ == "__main__":
    check()
