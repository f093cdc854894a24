"""``poise array``: the printed report; and how evaluations show what arrays estimate."""

import json

import pandas
import pytest

from poise.filters.arrays.array import planar_controller
from poise.scripts.array import Args
from poise.scripts.experiment import start_run
from poise.scripts.main import main
from poise.scripts.output import Output
from poise.scripts.report import print_comparison, wide_tables


def test_report_of_a_preset(capsys):
    assert main(["array", "octa"]) == 0
    output = capsys.readouterr().out
    assert "18.33" in output
    assert "6.98" in output
    assert "No redundancy" in output
    assert main(["array", "controller"]) == 0
    assert "not determined needs other sensors" in capsys.readouterr().out


def test_report_of_a_file_as_json(tmp_path, capsys):
    path = tmp_path / "short.json"
    described = planar_controller(0.1).describe()
    path.write_text(json.dumps({name: described[name] for name in ("positions", "axes")}))
    assert main(["array", str(path), "--std", "0.3", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    report = document["summary"]
    assert (report["array"], report["rank"], report["of"]) == ("short", 4, 4)
    # σ_a / (√2 r)
    deviation = {row["quantity"]: row["deviation"] for row in document["rows"]}["alpha"]
    assert abs(deviation - 0.3 / (2**0.5 * 0.1)) < 1e-9


def test_wrong_words_are_explained(capsys):
    assert main(["array", "okta"]) == 2
    assert "octa, controller, planar, triaxial or a JSON file" in capsys.readouterr().err
    assert main(["array", "octa", "--std", "0"]) == 2
    assert "std must be positive" in capsys.readouterr().err


@pytest.mark.parametrize("details", [[1], {"x": 5}, {"imu/acc": {"array": 3}}, None])
def test_a_spoilt_calibration_record_is_explained(details, tmp_path, capsys):
    path = tmp_path / "record.json"
    path.write_text(json.dumps({"format": "poise-calibration", "version": 1, "channels": {}, "details": details}))
    assert main(["array", str(path)]) == 2
    assert "contains no array" in capsys.readouterr().err


def test_evaluate_shows_estimators_that_give_no_angle(tmp_path, capsys):
    rows = [
        {
            "estimator": "a",
            "trajectory": "t",
            "quantity": "angular_rate",
            "metric": "distance",
            "value": 0.8,
            "unit": "rad/s",
        },
        {"estimator": "a", "trajectory": "t", "quantity": "angular_rate", "metric": "valid", "value": 1.0, "unit": "1"},
        {"estimator": "b", "trajectory": "t", "quantity": "up", "metric": "inclination", "value": 2.0, "unit": "deg"},
        {"estimator": "b", "trajectory": "t", "quantity": "bias", "metric": "distance", "value": 3.0, "unit": "rad/s"},
    ]
    tables = wide_tables(pandas.DataFrame(rows))
    assert [len(part) for part in tables.values()] == [1, 1]
    ((first, second),) = [tuple(tables)]
    assert first.startswith("Inclination error")
    assert second == "angular_rate: RMS distance, rad/s"
    assert tables[second][0]["estimator"] == "a"
    run = start_run("evaluate", Args("octa"), 0, tmp_path)
    out = Output("evaluate", None)
    print_comparison(pandas.DataFrame(rows), run, out)
    assert "0.8" in capsys.readouterr().out
    assert "Figure: angular_rate-distance" in out.sections
