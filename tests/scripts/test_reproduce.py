"""``poise reproduce`` with a small study made for the test."""

from __future__ import annotations

import json
import sys
from concurrent.futures import BrokenExecutor
from types import ModuleType

import pandas
import pytest
from joblib import Parallel

from poise.baselines import studies as package
from poise.baselines.plots import new_figure
from poise.baselines.studies.coverage import Item, cover
from poise.scripts.experiment import Run
from poise.scripts.main import main
from poise.scripts.reproduce import attempts

STUDIES = []


def square(number):
    return number * number


def reproduce(study, report):
    STUDIES.append(study)
    rides = study.episodes("poise/BicycleFixture-v0", 2, name="push", options={"duration": 1.0})
    values = study.map("squares", square, [(number,) for number in range(study.seeds)])
    report.text("What was done.")
    report.table("Squares", [{"number": number, "square": value} for number, value in enumerate(values)])
    report.compare("Lengths", [{"quantity": "ticks", "published": 100, "values": [len(r) for r in rides], "unit": "1"}])
    report.figure("empty", new_figure(2.0, 1.0)[0], "An empty figure")
    row = {"estimator": "none", "trajectory": "push", "quantity": "ticks", "metric": "mean", "value": 101.0}
    report.numbers([{**row, "unit": "1"}])
    cover(
        report,
        (Item("Table I", "squares of numbers", ("Squares",)), Item("Figure 1", "a picture", because="it is old")),
    )


@pytest.fixture(autouse=True)
def _paper(monkeypatch):
    module = ModuleType("poise.baselines.studies.small")
    vars(module).update(reproduce=reproduce)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(package.PAPERS, "small", ".small")
    monkeypatch.delenv("POISE_DATA", raising=False)
    STUDIES.clear()


def start(folder, *words):
    return main(["reproduce", "small", "--runs", str(folder), "--processes", "1", *words])


def test_a_study_leaves_report_tables_figures_and_results(tmp_path, capsys):
    assert start(tmp_path, "--quick", "--seeds", "2") == 0
    out = capsys.readouterr().out
    assert "What was done." in out
    assert "Squares" in out
    (folder,) = (tmp_path / "reproduce").iterdir()
    text = (folder / "report.md").read_text(encoding="utf-8")
    for piece in (
        "# poise reproduce small",
        "| number | square |",
        "Ours: mean",
        "![An empty figure](figures/empty.png)",
    ):
        assert piece in text
    assert (folder / "figures" / "empty.png").exists()
    assert pandas.read_csv(folder / "tables" / "squares.csv")["square"].tolist() == [0, 1]
    assert pandas.read_csv(folder / "results.csv")["value"].tolist() == [101.0]
    study = STUDIES[0]
    assert (study.quick, study.seeds, study.subjects, study.duration) == (True, 2, (0, 1), 20.0)


def test_an_interrupted_study_goes_on_and_refuses_other_arguments(tmp_path, capsys):
    assert start(tmp_path) == 0
    (folder,) = (tmp_path / "reproduce").iterdir()
    assert (STUDIES[0].seeds, STUDIES[0].subjects, STUDIES[0].duration) == (3, (0, 1, 2, 3, 4), 60.0)
    files = {path: path.stat().st_mtime_ns for kind in ("*.h5", "cache/*/*.json") for path in folder.rglob(kind)}
    assert len(files) == 5
    assert start(tmp_path, "--resume", str(folder)) == 0
    assert files == {path: path.stat().st_mtime_ns for path in files}
    assert start(tmp_path, "--resume", str(folder), "--seed", "3") == 2
    assert "was started with seed 0, not 3" in capsys.readouterr().err
    assert start(tmp_path, "--resume", str(tmp_path / "nothing")) == 2


@pytest.mark.parametrize("text", ["{", "{}", '{"args": 3}', "[]"])
def test_a_folder_that_is_no_run_is_not_gone_on_with(text, tmp_path, capsys):
    (tmp_path / "args.json").write_text(text)
    assert start(tmp_path, "--resume", str(tmp_path)) == 2
    assert "does not say how the run was started" in capsys.readouterr().err


def test_a_file_in_the_place_of_the_run_folder_is_explained(tmp_path, capsys):
    (tmp_path / "file").touch()
    assert start(tmp_path / "file") == 2
    assert "file" in capsys.readouterr().err


def test_all_papers_make_one_page_and_what_is_done_is_not_done_again(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(package, "PAPERS", {"small": ".small"})
    words = [
        "reproduce",
        "all",
        "--quick",
        "--runs",
        str(tmp_path),
        "--processes",
        "1",
        "--page",
        str(tmp_path / "page.md"),
    ]
    assert main(words) == 0
    assert "small: 1 reproduced, 1 cannot be answered" in capsys.readouterr().out
    (folder,) = (tmp_path / "reproduce").iterdir()
    assert (folder / "small" / "report.md").exists()
    assert pandas.read_csv(folder / "small" / "results.csv")["value"].tolist() == [101.0]
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert text == (folder / "report.md").read_text(encoding="utf-8")
    assert "| Table I | squares of numbers | reproduced |" in text
    assert "poise reproduce all --quick --seed 0" in text
    assert main([*words, "--resume", str(folder)]) == 0
    assert len(STUDIES) == 1


def broken(study, report):
    if not (study.folder / "mended").exists():
        raise ValueError("a ride of 3 s is too short\nand so on")
    reproduce(study, report)


@pytest.mark.parametrize("processes", ["1", "2"])
def test_a_work_that_fails_stops_no_other_and_alone_is_done_again(tmp_path, capsys, monkeypatch, processes):
    module = ModuleType("poise.baselines.studies.bad")
    vars(module).update(reproduce=broken)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(package, "PAPERS", {"bad": ".bad", "small": ".small"})
    if processes == "2":
        # in threads, since other processes do not know these studies
        monkeypatch.setattr("joblib.Parallel", lambda **options: Parallel(**options, prefer="threads"))
    page = tmp_path / "page.md"
    words = ["reproduce", "all", "--quick", "--processes", processes, "--runs", str(tmp_path), "--page", str(page)]
    assert main(words) == 1
    shown = capsys.readouterr()
    assert "bad is not computed: ValueError: a ride of 3 s is too short" in shown.err
    assert "small: 1 reproduced, 1 cannot be answered" in shown.out
    text = page.read_text(encoding="utf-8")
    assert "## bad\n\nNot computed: `ValueError: a ride of 3 s is too short`" in text
    assert "**Not computed: bad.**" in text
    assert "| Table I | squares of numbers | reproduced |" in text
    (folder,) = (tmp_path / "reproduce").iterdir()
    assert "and so on" in (folder / "bad" / "error.txt").read_text(encoding="utf-8")
    assert len(STUDIES) == 1
    (folder / "bad" / "mended").touch()
    assert main([*words, "--resume", str(folder)]) == 0
    assert [study.folder.name for study in STUDIES] == ["small", "bad"]
    assert "Not computed" not in page.read_text(encoding="utf-8")
    assert not (folder / "bad" / "error.txt").exists()


def test_works_of_a_process_that_was_killed_are_named(tmp_path, monkeypatch):
    def killed(*_, **__):
        yield "one", None
        raise BrokenExecutor("the process was killed")

    monkeypatch.setattr("poise.scripts.reproduce.in_parallel", killed)
    run = Run(tmp_path, "reproduce", 0)
    found = list(attempts(["one", "two"], {"processes": 2}, run))
    assert found == [("one", None), ("two", "BrokenExecutor: the process was killed")]


def test_the_page_is_that_of_all_papers(tmp_path, capsys):
    assert start(tmp_path, "--page", str(tmp_path / "page.md")) == 2
    assert "--page is the page of all papers: use it with 'all', not with 'small'" in capsys.readouterr().err


def test_rows_are_machine_readable(tmp_path, capsys):
    assert start(tmp_path, "--json") == 0
    assert json.loads(capsys.readouterr().out)["rows"][1] == {"table": "Squares", "number": 1, "square": 1}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["two-gyr"], "did you mean 'two-gyro'"),
        (["small", "--subjects", "7"], "subjects must be numbers from 0 to 4, got [7]"),
        (["small", "--seeds", "0"], "seeds must be at least 1, got 0"),
        (["small", "--seed", "-1"], "seed must be at least 0, got -1"),
        (["small", "--recordings", "nowhere"], "no recording at nowhere"),
    ],
)
def test_wrong_arguments_are_named_and_leave_no_folder(tmp_path, capsys, words, message):
    assert main(["reproduce", *words, "--runs", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
