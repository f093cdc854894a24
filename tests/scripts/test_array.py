"""``poise array``: the printed report."""

import json

from poise.filters.accelerometer_array.array import planar_controller
from poise.scripts.main import main


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
    assert main(["array", str(path), "--deviation", "0.3", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["array"], report["rank"], report["of"]) == ("short", 4, 4)
    # σ_a / (√2 r)
    deviation = {row["quantity"]: row["deviation"] for row in report["quantities"]}["alpha"]
    assert abs(deviation - 0.3 / (2**0.5 * 0.1)) < 1e-9


def test_wrong_words_are_explained(capsys):
    assert main(["array", "okta"]) == 2
    assert "octa, controller, planar, triaxial or a JSON file" in capsys.readouterr().err
    assert main(["array", "octa", "--deviation", "0"]) == 2
    assert "deviation must be positive" in capsys.readouterr().err
