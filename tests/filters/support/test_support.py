"""Seeds, names, versions, processes, kept results and optional packages."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from poise.filters.support import parallel, version
from poise.filters.support.names import look_up, unknown
from poise.filters.support.optional import EXTRAS, extra
from poise.filters.support.resume import is_kept, keep, kept, refuse_changes
from poise.filters.support.seeds import child_seed, child_seeds, named_seed, root_seed


def test_child_seeds_are_those_of_numpy() -> None:
    children = np.random.SeedSequence(7).spawn(5)
    assert child_seeds(7, 5) == tuple(int(child.generate_state(1)[0]) for child in children)
    assert child_seed(7, 4) == child_seeds(7, 5)[4]
    assert child_seeds(7, 2) == child_seeds(7, 5)[:2]


def test_named_seeds_depend_on_root_and_names() -> None:
    # Kept results of studies rest on these numbers.
    assert named_seed(0, "outdoor", 1, 2) == 2825038369
    assert len({named_seed(root, *names) for root in (0, 1) for names in (("a", 1), ("a", 2), ("a1",))}) == 6


def test_a_missing_root_seed_is_drawn() -> None:
    assert root_seed(5) == 5
    assert root_seed(None) != root_seed(None)


def test_an_unknown_name_gets_the_nearest_one_and_all() -> None:
    assert unknown("paper", "two-gyr", {"two-gyro": 1, "x": 2}) == (
        "unknown paper 'two-gyr', did you mean 'two-gyro'? (papers: two-gyro, x)"
    )
    assert unknown("paper", "zzz", ["x"], "no such article").startswith("no such article 'zzz' (papers: x)")
    assert look_up("paper", "x", {"x": 2}) == 2
    with pytest.raises(ValueError, match=r"unknown paper 'zzz' \(papers: x\)"):
        look_up("paper", "zzz", {"x": 2})


def test_the_code_version_follows_the_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for layer in ("filters", "envs", "baselines"):
        (tmp_path / layer / "__pycache__").mkdir(parents=True)
        (tmp_path / layer / "a.py").write_text("x = 1\n")
    monkeypatch.setattr(version, "ROOT", tmp_path)

    def codes() -> tuple[str, str]:
        version.code_version.cache_clear()
        return version.code_version(), version.code_version("filters", "envs")

    try:
        before = codes()
        (tmp_path / "filters" / "__pycache__" / "a.pyc").write_bytes(b"\0")
        (tmp_path / "baselines" / "w.safetensors").write_bytes(b"\0")
        assert codes() == before
        (tmp_path / "baselines" / "a.py").write_text("x = 2\n")
        after = codes()
        assert after[0] != before[0]
        assert after[1] == before[1]
    finally:
        version.code_version.cache_clear()


def test_a_kept_result_is_valid_for_its_key_and_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, key = tmp_path / "sub" / "0000.json", {"function": "f", "arguments": (1, "a")}
    assert not is_kept(path, key)
    keep(path, key, {"rms": 1.5})
    assert is_kept(path, key)
    assert kept(path) == {"rms": 1.5}
    assert not is_kept(path, {**key, "arguments": (2, "a")})
    monkeypatch.setattr("poise.filters.support.resume.code_version", lambda: "another")
    assert not is_kept(path, key)
    path.write_text("{half")
    assert not is_kept(path, key)


def test_resuming_with_other_settings_is_refused() -> None:
    refuse_changes("runs/x", {"seed": 1, "quick": True}, {"seed": 1, "quick": False}, ["seed"])
    with pytest.raises(ValueError, match="runs/x was started with quick True, not False"):
        refuse_changes("runs/x", {"seed": 1, "quick": True}, {"seed": 1, "quick": False})


def test_results_do_not_depend_on_the_number_of_processes() -> None:
    jobs = [(index, 2) for index in range(5)]
    assert sorted(parallel.in_parallel(pow, jobs)) == [0, 1, 4, 9, 16]
    assert sorted(parallel.in_parallel(pow, jobs, 2)) == [0, 1, 4, 9, 16]
    with pytest.raises(ValueError, match="processes must be at least 1, got 0"):
        list(parallel.in_parallel(pow, jobs, 0))


def test_bars_appear_on_terminals_only(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    for stream, shown in ((io.StringIO(), False), (Terminal(), True)):
        monkeypatch.setattr(sys, "stderr", stream)
        assert list(parallel.in_parallel(pow, [(2, 3)], label="powers")) == [8]
        assert ("powers" in stream.getvalue()) is shown


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({}, 2),
        ({"OMP_NUM_THREADS": "1"}, 1),
        ({"OMP_NUM_THREADS": "1,2"}, 1),
        ({"NUMBA_NUM_THREADS": "1"}, 1),
        ({"OMP_NUM_THREADS": "8"}, 2),
        ({"OMP_NUM_THREADS": "0"}, 2),
        ({"OMP_NUM_THREADS": "many"}, 2),
    ],
)
def test_processors_are_those_that_the_process_may_use(
    environment: dict[str, str], expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {3, 5}, raising=False)
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert parallel.processors() == expected


@pytest.mark.parametrize(("name", "module"), [("sim", "pybullet"), ("learn", "torch"), ("rl", "stable_baselines3")])
def test_a_missing_extra_says_how_to_install_it(name: str, module: str) -> None:
    code = f"""
import sys
sys.modules[{module!r}] = None
from poise.filters.support.optional import extra
with extra({name!r}):
    import {module}
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    error, message = done.stderr.splitlines()[-1].split(": ", 1)
    assert error.endswith("MissingExtraError")
    assert message == f"{module} is not installed: pip install 'poise[{name}]'"


def test_other_missing_modules_stay_what_they_are() -> None:
    assert "numpy" not in set().union(*EXTRAS.values())
    with pytest.raises(ModuleNotFoundError, match="no_such_module"), extra("sim"):
        import no_such_module  # type: ignore[import-not-found]  # noqa: F401


def test_a_seed_that_is_no_whole_number_is_named() -> None:
    assert root_seed(np.int64(3)) == 3
    for seed in ("a", 1.5, -1):
        with pytest.raises(ValueError, match=f"seed must be None or a whole number of at least 0, got {seed!r}"):
            root_seed(seed)  # type: ignore[arg-type]
