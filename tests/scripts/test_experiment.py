"""What a run leaves behind: folder, arguments, versions, results, report; and the tables that show rows."""

from __future__ import annotations

import csv
import dataclasses
import enum
import json
import math
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.support import rows
from poise.scripts import experiment, output


class Grade(enum.Enum):
    GOOD = 1


@dataclasses.dataclass(frozen=True)
class Noise:
    gyro: float = 0.01


@dataclasses.dataclass
class Args:
    data: Path = Path("rides/a.h5")
    noise: Noise = Noise()
    names: tuple[str, ...] = ("a", "b")
    limit: float = math.inf
    grade: Grade = Grade.GOOD
    missing: int | None = None


class Result(NamedTuple):
    estimator: str
    trajectory: str
    quantity: str
    metric: str
    value: float
    unit: str


ROW = Result("vqf", "hand-0", "orientation", "rmse", 1.0 / 3.0, "deg")


@pytest.fixture
def run(tmp_path: Path) -> experiment.Run:
    return experiment.start_run("benchmark", Args(), seed=3, root=tmp_path / "runs")


def test_run_folder(run: experiment.Run, tmp_path: Path) -> None:
    assert run.folder.parent == tmp_path / "runs" / "benchmark"
    assert run.folder.name.endswith("-3")
    assert run.figures.is_dir()
    assert {path.name for path in run.folder.iterdir()} == {"args.json", "versions.json", "figures"}


def test_runs_within_a_second_are_apart(tmp_path: Path) -> None:
    folders = {experiment.start_run("train", {}, seed=0, root=tmp_path).folder for _ in range(5)}
    assert len(folders) == 5


def test_arguments_are_written_as_json(run: experiment.Run) -> None:
    assert json.loads((run.folder / "args.json").read_text()) == {
        "command": "benchmark",
        "seed": 3,
        "args": {
            "data": str(Path("rides/a.h5")),
            "noise": {"gyro": 0.01},
            "names": ["a", "b"],
            "limit": "inf",
            "grade": "GOOD",
            "missing": None,
        },
    }


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (np.float64(0.5), 0.5),
        (np.int32(4), 4),
        (np.array([[1.0, np.nan]]), [[1.0, "nan"]]),
        ({2: {"b", "a"}}, {"2": ["a", "b"]}),
        (Noise, f"{__name__}.Noise"),
        (True, True),
        (1 + 2j, "(1+2j)"),
    ],
)
def test_jsonable(value: Any, expected: Any) -> None:
    assert experiment.jsonable(value) == expected


def test_versions(run: experiment.Run) -> None:
    found = json.loads((run.folder / "versions.json").read_text())
    assert found["poise"]["version"] == version("poise")
    assert found["packages"]["numpy"] == np.__version__
    assert found["packages"]["stable-baselines3"] == version("stable-baselines3")
    assert {"python", "platform", "processors", "started"} <= set(found)


def test_versions_import_nothing_heavy() -> None:
    code = (
        "import sys; from poise.scripts.experiment import versions; versions();"
        "sys.exit(', '.join({'torch', 'pybullet', 'stable_baselines3', 'numba'} & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_package_that_is_missing_has_no_version() -> None:
    assert experiment.versions(["no-such-package-here"])["packages"] == {"no-such-package-here": None}


def test_commit_of_a_checkout_only(tmp_path: Path) -> None:
    def git(*words: str) -> None:
        identity = ["-c", "user.name=t", "-c", "user.email=t@example.org"]
        subprocess.run(["git", "-C", str(tmp_path), *identity, *words], check=True, capture_output=True)

    git("init")
    (tmp_path / "file").write_text("1")
    (tmp_path / "inner").mkdir()
    git("add", "file")
    git("commit", "-m", "first")
    state = experiment.git_state(tmp_path)
    assert len(state["commit"]) == 40
    assert state["changed"] is False
    (tmp_path / "file").write_text("22")
    assert experiment.git_state(tmp_path)["changed"] is True
    assert experiment.git_state(tmp_path / "inner") == {}


@pytest.mark.parametrize("rows", [[ROW], [ROW._asdict()], pd.DataFrame([ROW])], ids=["tuple", "mapping", "frame"])
def test_results_come_back_exactly(run: experiment.Run, rows: Any) -> None:
    path = run.write_results(rows)
    with path.open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert list(row) == ["estimator", "trajectory", "quantity", "metric", "value", "unit"]
    assert float(row["value"]) == ROW.value
    assert row["estimator"] == "vqf"


def test_a_row_of_the_wrong_shape_leaves_the_old_results(run: experiment.Run) -> None:
    before = run.write_results([ROW]).read_text()
    with pytest.raises(ValueError, match="a result has the fields"):
        run.write_results([ROW, {"estimator": "vqf", "value": 1.0}])
    assert run.results.read_text() == before
    assert not [path for path in run.folder.iterdir() if path.name.startswith(".")]


def test_a_write_that_fails_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(UnicodeEncodeError):
        experiment.write_text(tmp_path / "file", "\ud800")
    assert list(tmp_path.iterdir()) == []


def test_report(run: experiment.Run) -> None:
    path = run.write_report("Benchmark", {"Errors": rows.markdown_table([ROW], rows.RESULT)})
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# Benchmark\n\n## Errors\n\n| estimator |")
    assert "| vqf | hand-0 | orientation | rmse | 0.333 | deg |" in text


def test_printed_table_holds_every_row_and_no_markup() -> None:
    console = Console(record=True, width=80, file=open("/dev/null", "w"))  # noqa: SIM115
    printed = [{"estimator": "[red]vqf", "error": 1.5}, {"estimator": "mekf", "note": "slow"}]
    output.print_table(printed, title="Errors", console=console)
    text = console.export_text()
    assert "Errors" in text
    assert "[red]vqf" in text
    assert "slow" in text
    assert text.count("–") == 2


def test_the_command_that_repeats_a_run_has_a_positional_argument_only_where_there_is_one():
    from poise.scripts.realism import Args as Realism
    from poise.scripts.reproduce import Args as Reproduce

    words = experiment.command_line("realism", Realism(recordings=("hand=a",), parts=("points",)), ("parts", "rides"))
    assert words == "poise realism --parts points --rides 20"
    words = experiment.command_line("reproduce", Reproduce("two-gyro", quick=True), ("quick",))
    assert words == "poise reproduce two-gyro --quick"


def test_recordings_of_several_folders_are_told_apart(tmp_path: Path) -> None:
    for folder, seed in (("first", 0), ("second", 1)):
        (tmp_path / folder).mkdir()
        recording = HandTrajectories(duration=1.0).draw_many(seed, 1)[0]
        recording.replace(metadata={**recording.metadata, "name": "trial"}).save(tmp_path / folder / "trial.h5")
    sets = experiment.recorded_sets((tmp_path / "first", tmp_path / "second"))
    assert {group: [each.name for each in some] for group, some in sets.items()} == {
        "first": ["first/trial"],
        "second": ["second/trial"],
    }
    assert [each.name for each in experiment.recorded_sets((tmp_path / "first",))["first"]] == ["trial"]
    for names in (("first", "first"), ("simulated",)):
        with pytest.raises(ValueError, match="paths of different names, none 'simulated'"):
            experiment.recorded_sets(tuple(tmp_path / name for name in names))


def test_a_new_run_says_how_to_resume_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    args = dataclasses.make_dataclass("Args", ["seed", "runs", "resume"])(0, tmp_path, None)
    run = experiment.open_run("train", args)
    assert f"continues with --resume {run.folder}\n" in capsys.readouterr().err
    args.resume = run.folder
    assert experiment.open_run("train", args) == run
    assert capsys.readouterr().err == ""
