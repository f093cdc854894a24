"""The commands end to end, on little data: files, tables, figures, JSON, going on after an interruption."""

import json
import re
from types import SimpleNamespace

import pandas
import pytest

from poise.baselines.comparison.intervals import is_measure
from poise.envs.data.trajectory import load_trajectory
from poise.filters.support.rows import RESULT
from poise.filters.support.seeds import child_seed
from poise.scripts import benchmark
from poise.scripts.benchmark import keep
from poise.scripts.main import main
from poise.scripts.record import environment_id, option

SHORT = ["--options", "gesture=fast", "duration=2.0", "drive=kinematic"]


def record(folder, *words):
    return main(["record", "hand-motion", "--folder", str(folder), "--processes", "1", *words, *SHORT])


@pytest.fixture(scope="module")
def episodes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("episodes")
    assert record(folder, "--episodes", "2", "--seed", "7") == 0
    return folder


def test_record_writes_episodes_and_goes_on_where_it_stopped(episodes, capsys):
    paths = sorted(episodes.glob("*.h5"))
    assert [path.name for path in paths] == ["hand_motion_0000.h5", "hand_motion_0001.h5"]
    stamps = [path.stat().st_mtime_ns for path in paths]
    assert record(episodes, "--episodes", "3", "--seed", "7") == 0
    assert [path.stat().st_mtime_ns for path in paths] == stamps
    third = load_trajectory(episodes / "hand_motion_0002.h5")
    assert third.metadata["seed"] == child_seed(7, 2)
    assert third.metadata["environment"]["kwargs"]["gesture"] == "fast"
    assert "3 episodes" in capsys.readouterr().out


def test_record_in_processes_gives_the_same_episodes(episodes, tmp_path):
    assert record(tmp_path, "--episodes", "2", "--seed", "7", "--processes", "2") == 0
    for path in sorted(tmp_path.glob("*.h5")):
        one, other = load_trajectory(path), load_trajectory(episodes / path.name)
        for channel, values in one.measurements.items():
            assert values.tobytes() == other.measurements[channel].tobytes()


def test_record_does_not_mix_origins(episodes, capsys):
    assert record(episodes, "--episodes", "2", "--seed", "8") == 2
    assert "holds an episode of another seed" in capsys.readouterr().err
    # without the options of before: those that are not named have their defaults, and so have not what is there
    assert main(["record", "hand-motion", "--folder", str(episodes), "--episodes", "3", "--seed", "7"]) == 2
    assert "holds an episode of other options: {'" in capsys.readouterr().err


def test_record_explains_bad_words(tmp_path, capsys):
    assert main(["record", "foot-motion", "--folder", str(tmp_path)]) == 2
    message = capsys.readouterr().err
    assert "unknown environment 'foot-motion', did you mean 'hand-motion'? (environments: bicycle-fixture, " in message
    assert main(["record", "--folder", str(tmp_path), "--options", "fast"]) == 2
    assert "name=value" in capsys.readouterr().err
    assert main(["record", "--folder", str(tmp_path), "--episodes", "0"]) == 2
    capsys.readouterr()
    for words, said in (
        ("raet=3", "unexpected keyword argument 'raet', did you mean 'rate'?"),
        ("rate=fast", "rate must be a finite number (at most 1e+15 in magnitude) or None, got 'fast'"),
    ):
        assert main(["record", "--folder", str(tmp_path), "--options", words]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("poise: error: ")
        assert said in line
    assert not list(tmp_path.iterdir())
    assert environment_id("poise/Replay-v0") == environment_id("replay")
    assert option("rate=200") == ("rate", 200)
    assert option("gesture=fast") == ("gesture", "fast")


def test_evaluate_prints_tables_and_leaves_a_run(episodes, tmp_path, capsys):
    words = ["evaluate", str(episodes), "--estimators", "mekf", "tilt", "--runs", str(tmp_path)]
    assert main(words) == 0
    output = capsys.readouterr().out
    assert "Inclination error" in output
    assert output.index("mekf") < output.index("tilt")
    (folder,) = (tmp_path / "evaluate").iterdir()
    table = pandas.read_csv(folder / "results.csv")
    assert tuple(table.columns) == RESULT
    assert (folder / "figures" / "inclination.png").stat().st_size > 5_000
    assert "recordings-over-time.png" in (folder / "report.md").read_text()
    assert main(["evaluate", str(tmp_path / "nothing"), "--runs", str(tmp_path)]) == 2
    assert "nothing" in capsys.readouterr().err


def test_benchmark_keeps_what_was_written_while_it_ran(tmp_path):
    kept = tmp_path / "kept.json"
    rides = [{"paper": "two-gyro", "method": "two-gyro+network"}]
    sources = {"recordings": 0, "mekf": 1, "riders": 2, "two-gyro+network": 3}
    kept.write_text(json.dumps({"recordings": [], "riders": rides, "source": sources}))
    folder = SimpleNamespace(versions={"poise": "0", "python": "3", "packages": {}})
    broad = {"dataset": "broad", "errors": {"mekf": {}}}
    keep(benchmark.Args(save=kept), folder, {"recordings": [broad], "riders": []})
    saved = json.loads(kept.read_text())
    assert (saved["recordings"], saved["riders"]) == ([broad], rides)
    # of what a run of all estimators replaces there is one source
    assert set(saved["source"]) == {"recordings", "riders", "two-gyro+network"}
    assert (saved["source"]["riders"], saved["source"]["two-gyro+network"]) == (2, 3)


def test_benchmark_compares_and_reports(episodes, tmp_path, capsys):
    estimators = ["--estimators", "external-acceleration", "mekf-9", "tilt"]
    words = ["benchmark", "--quick", "--suite", "hand", "--processes", "1", "--runs", str(tmp_path), *estimators]
    assert main([*words, "--recordings", str(episodes / "hand_motion_0000.h5"), "--json"]) == 0
    captured = capsys.readouterr()
    (folder,) = (tmp_path / "benchmark").iterdir()
    document = json.loads(captured.out)
    assert {name: document[name] for name in ("command", "seed", "run")} == {
        "command": "benchmark",
        "seed": 0,
        "run": str(folder),
    }
    parts = {row["table"] for row in document["rows"]}
    assert {"simulation", "recordings"} < parts
    assert sum(name.startswith("All data sets: ") for name in parts) == 3
    assert "simulation: inclination, mean with its 95 % interval over 4 trajectories, deg" in parts
    rows = [row for row in document["rows"] if row["table"] in ("simulation", "recordings")]
    assert all(tuple(row) == ("table", *RESULT) for row in rows)
    assert {row["trajectory"] for row in rows} == {"slow-1", "fast-1", "severe-1", "mixed-1", "hand_motion_0000"}
    report = (folder / "report.md").read_text()
    pictures = re.findall(r"!\[[^]]*\]\(([^)]*)\)", report)
    assert len(pictures) >= 6
    assert all((folder / picture).stat().st_size > 5_000 for picture in pictures)
    assert "| C |" in report
    assert "root seed 0" in report
    results = pandas.read_csv(folder / "results.csv")
    assert {"inclination", "inclination largest", "nees", "nis"} <= set(results["metric"])
    assert len(results[~is_measure(results)]) == len(rows)
    assert (folder / "report.html").stat().st_size > 1_000_000
    again = [*words, "--recordings", str(episodes / "hand_motion_0000.h5"), "--resume", str(folder)]
    before = (folder / "results.csv").read_bytes()
    kept = tmp_path / "kept.json"
    kept.write_text(
        json.dumps({"source": {"riders": {"seed": 1}}, "recordings": [], "riders": [{"paper": "two-gyro"}]})
    )
    assert main([*again, "--baseline", str(folder / "results.csv"), "--save", str(kept)]) == 0
    assert (folder / "results.csv").read_bytes() == before
    saved = json.loads(kept.read_text())
    assert {one["dataset"] for one in saved["recordings"]} == {"simulated hand"}
    assert saved["riders"] == [{"paper": "two-gyro"}], "what this run has nothing of stays"
    assert {part: one["seed"] for part, one in saved["source"].items()} == {"riders": 1, "recordings": 0}
    better = results.assign(value=results["value"] * 0.9)
    better.to_csv(tmp_path / "better.csv", index=False)
    assert main([*again, "--baseline", str(tmp_path / "better.csv")]) == 1
    assert "grew by more than 2 %" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--suite", "rider", "--estimators", "mekf"], "--estimators mekf has nothing for --suite rider"),
        (["--suite", "rider", "--recordings", "some.csv"], "--recordings has nothing for --suite rider"),
        (["--sweep"], "--sweep belongs to --suite rider, not all"),
        (["--suite", "rider", "--sweep", "--estimators", "gru-two-gyro"], "whole papers: name their filters, two-gyro"),
    ],
)
def test_a_benchmark_of_nothing_is_refused(words, said, tmp_path, capsys):
    assert main(["benchmark", *words, "--runs", str(tmp_path)]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
