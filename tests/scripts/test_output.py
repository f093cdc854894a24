"""What commands say to people and, with ``--json``, to programs."""

from __future__ import annotations

import dataclasses
import importlib
import json
from types import SimpleNamespace

import pytest

import poise
from poise.scripts.main import COMMANDS
from poise.scripts.output import Output

ROWS = [{"name": "a", "rms": 1.5}, {"name": "b", "rms": float("nan")}]


def test_people_get_tables_and_sentences(capsys: pytest.CaptureFixture[str]) -> None:
    with Output("x", SimpleNamespace(seed=3)) as out:
        out.say("working")
        out.table(ROWS, "Errors")
        out.rows(ROWS)
    said = capsys.readouterr()
    assert said.out.startswith("working\nErrors")
    assert said.out.count("1.5") == 1
    assert said.err == ""


def test_numbers_stay_whole_beside_long_names(capsys: pytest.CaptureFixture[str]) -> None:
    saved = dict.fromkeys(("saved", "saved of the others"), "-572 % (-672 to -223)")
    rows = [
        {
            "gains by": "a policy whose name has no more than sixty characters, or so",
            "mean": 1.25,
            "median": 33.5,
            **saved,
        }
    ]
    with Output("x", SimpleNamespace(seed=3)) as out:
        out.table(rows, "Errors")
    said = capsys.readouterr().out
    assert "1.25" in said
    assert "33.5" in said
    assert "or so" in said


def test_programs_get_one_document(capsys: pytest.CaptureFixture[str]) -> None:
    with Output("x", SimpleNamespace(json=True, seed=3)) as out:
        out.say("working")
        out.table(ROWS, "Errors")
        out.show(ROWS, "for people")
        out.rows([{"n": 1}])
        out.add(condition=float("inf"))
    said = capsys.readouterr()
    assert json.loads(said.out) == {
        "command": "x",
        "version": poise.__version__,
        "seed": 3,
        "rows": [
            {"table": "Errors", "name": "a", "rms": 1.5},
            {"table": "Errors", "name": "b", "rms": None},
            {"n": 1},
        ],
        "condition": None,
    }
    assert said.out.count("\n") == 1
    assert said.err == "working\n"


def test_after_an_error_there_is_no_document(capsys: pytest.CaptureFixture[str]) -> None:
    def failing() -> None:
        with Output("x", SimpleNamespace(json=True)):
            raise ValueError

    with pytest.raises(ValueError):  # noqa: PT011
        failing()
    assert capsys.readouterr().out == ""


# view serves a page, and the lines of stream are JSON already
@pytest.mark.parametrize("name", [name for name in COMMANDS if name not in ("stream", "view")])
def test_every_command_knows_json(name: str) -> None:
    fields = {
        field.name: field
        for field in dataclasses.fields(importlib.import_module(COMMANDS[name].module, "poise.scripts").Args)
    }
    assert fields["json"].default is False
