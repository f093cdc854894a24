"""Tasks run in any number of processes and after any interruption with one result; the report shows them."""

from __future__ import annotations

import json
from pathlib import Path

import pandas
import pytest

from poise.baselines.comparison import tasks as tasks_module
from poise.baselines.comparison.data_sets import HAND_CHANNELS
from poise.baselines.comparison.html_report import html_report
from poise.baselines.comparison.recommendation import load_results
from poise.baselines.comparison.tasks import Task, compile_ahead, given, hand_tasks, recording_tasks, run_tasks

NAMES = ("bounded-motion", "tilt")


@pytest.fixture(scope="module")
def tasks() -> list[Task]:
    return hand_tasks(0, 1, duration=3.0)[:3]


def test_results_do_not_depend_on_processes_or_interruptions(tasks: list[Task], tmp_path: Path) -> None:
    whole = run_tasks(tasks, tmp_path / "whole", NAMES, HAND_CHANNELS)["simulation"].table
    spread = run_tasks(tasks, tmp_path / "spread", NAMES, HAND_CHANNELS, processes=2)["simulation"].table
    run_tasks(tasks[1:2], tmp_path / "stopped", NAMES, HAND_CHANNELS)
    (kept,) = (tmp_path / "stopped").iterdir()
    before = kept.stat().st_mtime_ns
    resumed = run_tasks(tasks, tmp_path / "stopped", NAMES, HAND_CHANNELS)["simulation"].table
    pandas.testing.assert_frame_equal(whole, spread, check_exact=True)
    pandas.testing.assert_frame_equal(whole, resumed, check_exact=True)
    assert kept.stat().st_mtime_ns == before, "what was done is not done again"


def test_what_is_compiled_is_not_run_ahead_again(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    shares: list[list[str]] = []
    monkeypatch.setattr(tasks_module, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(tasks_module, "compile_some", lambda labels, *_: shares.append(labels))
    for offline in (False, False, True):
        compile_ahead(NAMES, HAND_CHANNELS, offline, 1)
    assert shares == [list(NAMES), list(NAMES)], "once without smoothers and once with them"


def test_results_of_other_code_are_done_again(tasks: list[Task], tmp_path: Path) -> None:
    run_tasks(tasks[:1], tmp_path, NAMES, HAND_CHANNELS)
    (kept,) = tmp_path.iterdir()
    found = json.loads(kept.read_text())
    kept.write_text(json.dumps(found | {"code": "of yesterday", "rows": []}))
    assert len(run_tasks(tasks[:1], tmp_path, NAMES, HAND_CHANNELS)["simulation"].table)


def test_two_tasks_of_one_name(tasks: list[Task], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="two tasks share the file"):
        run_tasks([tasks[0], tasks[0]], tmp_path, NAMES, HAND_CHANNELS)


def test_a_task_in_which_nothing_runs_leaves_the_others(tasks: list[Task], tmp_path: Path) -> None:
    (trajectory,) = tasks[0].trajectories()
    magnetic = {"imu/mag": trajectory.measurements["imu/mag"]}
    deaf = trajectory.replace(measurements=magnetic, metadata={**trajectory.metadata, "name": "deaf"})
    both = [*recording_tasks([trajectory]), Task("recordings", "deaf", given, (deaf,))]
    together = [Task("both", "both", list, ([trajectory, deaf],))]
    with pytest.warns(UserWarning, match="was not run on deaf"):
        run_tasks(together, tmp_path / "warned", NAMES, HAND_CHANNELS)
    table = run_tasks(both, tmp_path, NAMES, HAND_CHANNELS)["recordings"].table
    assert set(table["trajectory"]) == {trajectory.name}
    with pytest.raises(ValueError, match="nothing could be run"):
        run_tasks(both[1:], tmp_path / "deaf", NAMES, HAND_CHANNELS)


def test_page_holds_everything_it_needs(tasks: list[Task], tmp_path: Path) -> None:
    pytest.importorskip("plotly")
    suites = run_tasks(tasks, tmp_path, NAMES, HAND_CHANNELS)
    page = html_report("a <title>", suites, {"tilt": "baseline"}, {"seed": 0}, {"Found": [{"estimator": "</script>"}]})
    assert "%%" not in page.split('<script id="data"')[0]
    assert "a &lt;title&gt;" in page
    data = page.split('<script id="data" type="application/json">')[1].split("</script>")[0]
    sections = {section["title"]: section for section in json.loads(data)["sections"]}
    assert sections["Found"]["tables"][0]["rows"] == [["</script>"]]
    section = sections["simulation: inclination, deg"]
    assert [row[0] for row in section["tables"][0]["rows"]] == ["bounded-motion", "tilt"]
    assert "src=" not in page.split("<main>")[0].split("</style>")[0], "nothing is fetched from a network"


def test_the_reference_result_is_recomputed_in_part(tmp_path: Path) -> None:
    """The errors that ``poise recommend`` reads are those of today's code, on the first simulated episode."""
    shipped = {one["name"]: one["errors"] for one in load_results()["recordings"]}
    task = hand_tasks(0, 3, sensors="xsens-mtw-awinda")[0]
    names = ("bounded-motion", "mekf-9", "external-acceleration", "mahony")
    found = run_tasks([task], tmp_path, names, HAND_CHANNELS)["simulation"].recordings[0]
    assert found["name"] == "slow-1"
    for name in names:
        assert found["errors"][name] == pytest.approx(shipped["slow-1"][name], abs=2e-4)
