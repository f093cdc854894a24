"""The command that prints what there is by name."""

import json

import numpy as np
import pytest

import poise
from poise.baselines.weights_io import save_weights
from poise.scripts.list import LISTS, first_sentence, short, updated
from poise.scripts.main import main


def test_without_a_list_the_names_of_all_are_printed(capsys):
    assert main(["list"]) == 0
    out = capsys.readouterr().out
    assert len(out.splitlines()) < 60
    for name in (
        *LISTS,
        "external-acceleration+policy",
        "poise/HandMotion-v0",
        "xsens-mti-100",
        "walk",
        "slalom",
        "BROAD",
    ):
        assert name in out


def test_the_document_holds_the_rows_of_the_lists_that_are_named(capsys):
    assert main(["list", "estimators", "scenarios", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {row["table"] for row in rows} == {"estimators", "scenarios"}
    found = {row["name"]: row for row in rows if row["table"] == "estimators"}
    listed = poise.list_estimators()
    assert list(found) == list(listed)
    assert found["mekf"]["channels"] == "gyr, acc"
    assert found["mekf"]["kind"] == listed["mekf"].kind


def test_a_page_is_written_anew(tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text("# Rides\n\n<!-- list: scenarios -->\nold\n<!-- end of list -->\n\nlast\n", encoding="utf-8")
    assert main(["list", "--update", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# Rides\n\n<!-- list: scenarios -->\n| name |")
    assert "| `slalom` |" in text
    assert "old" not in text
    assert text.endswith("<!-- end of list -->\n\nlast\n")
    assert updated(text) == text
    assert main(["list", "scenarios", "--markdown"]) == 0
    assert capsys.readouterr().out.strip() in text


def test_trainings_of_one_preset_stand_in_one_row(tmp_path, capsys):
    for replicate, error in ((1, 1.25), (0, 1.5)):
        means = {"mine": {"mean_deg": error}, "mekf": {"mean_deg": 2.0}}
        card = {"name": "mine", "command": f"poise train mine --replicate {replicate}", "test": {"slow": means}}
        save_weights(tmp_path / f"run-{replicate}" / "mine", {"bias": np.zeros(1)}, card)
    assert main(["list", "learned", "--weights", str(tmp_path), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert (row["name"], row["episodes"], row["error"], row["best other"]) == (
        "mine",
        "slow",
        "1.50, 1.25",
        "mekf 2.00",
    )


def test_unknown_lists_are_refused(capsys):
    assert main(["list", "estimator"]) == 2
    assert "unknown list 'estimator', did you mean 'estimators'?" in capsys.readouterr().err
    with pytest.raises(ValueError, match=r"unknown lists \['people'\]"):
        updated("<!-- list: people -->\n<!-- end of list -->")


def test_texts_are_short():
    assert first_sentence("A :class:`.Thing` that\n    goes. And stops.\n\nMore.") == "A `Thing` that goes"
    assert first_sentence(None) == ""
    assert short(["imu/gyr", "thigh_right/gyr", "thigh_left/gyr"]) == "gyr, thigh_{left,right}/gyr"
