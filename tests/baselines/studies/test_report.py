"""Reports of studies: entries, files, printed values beside ours."""

from __future__ import annotations

import pandas
import pytest

from poise.baselines.plots import new_figure
from poise.baselines.studies.report import STD, Report


def test_tables_are_entries_and_files(tmp_path):
    told = []
    report = Report(tmp_path, told.append)
    report.text("Some *words*.\n")
    report.table(
        "Table I: errors, deg", [{"filter": "a", "roll": 1.0 / 3.0}, {"filter": "b", "pitch": None}], "A note."
    )
    assert [(entry.title, entry.text) for entry in told] == [("", "Some *words*."), ("Table I: errors, deg", "A note.")]
    assert told == report.entries
    table = pandas.read_csv(tmp_path / "tables" / "table-i-errors-deg.csv")
    assert list(table.columns) == ["filter", "roll", "pitch"]
    assert table["roll"][0] == 1.0 / 3.0
    with pytest.raises(ValueError, match="needs rows"):
        report.table("empty", [])
    with pytest.raises(ValueError, match=r"has table-i-errors-deg\.csv already"):
        report.table("Table I: errors; deg", [{"a": 1}])


def test_figures_are_files(tmp_path):
    report = Report(tmp_path)
    path = report.figure("Fig. 3", new_figure(2.0, 1.0)[0], "Figure 3", "A note.")
    assert path == tmp_path / "figures" / "fig-3.png"
    assert path.read_bytes().startswith(b"\x89PNG")
    assert report.entries[0].figure == path


def test_printed_values_stand_beside_ours_with_what_the_interval_means(tmp_path):
    report = Report(tmp_path)
    rows = [
        {
            "filter": "x",
            "quantity": "roll",
            "published": "2.1 ± 0.4",
            "values": [1.0, 2.0, 6.0, float("nan")],
            "unit": "deg",
        },
        {"filter": "z", "quantity": "roll", "published": None, "values": [float("nan")], "unit": "deg"},
    ]
    report.compare("Table", rows, "Why.")
    report.compare("Table with deviations", rows[:1], interval=STD)
    (first, third), (deviation,) = (entry.rows for entry in report.entries)
    assert first == {
        "filter": "x",
        "quantity": "roll",
        "published": "2.1 ± 0.4",
        "ours": 3.0,
        "interval": "1 … 6",
        "unit": "deg",
    }
    assert third["ours"] != third["ours"]
    assert third["interval"] is None
    assert deviation["interval"] == "± 2.65"
    assert report.entries[0].text.startswith("Ours: mean, smallest")
    assert report.entries[0].text.endswith("Why.")
