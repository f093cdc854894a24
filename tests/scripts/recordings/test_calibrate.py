"""``poise calibrate`` end to end: simulated runs, their files, the record, and a recording that it is applied to."""

import json

import numpy as np
import pytest

from poise.envs.data.calibration.records import CalibrationRecord, load_calibration, undo_calibration
from poise.envs.hand.calibration_runs import nominal_calibration
from poise.envs.hand.devices import HandDevice
from poise.envs.hand.sensing import simulate_hand
from poise.filters.arrays.array import TRIAXIAL
from poise.filters.arrays.files import load_array
from poise.filters.arrays.spatial.orientation import ArrayOrientation
from poise.scripts.main import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("calibration")
    common = ["--simulate", "--seed", "2", "--raw", str(place / "raw"), "--record", str(place / "record.json")]
    for sensor in ("accelerometer", "gyroscope", "magnetometer"):
        assert main(["calibrate", sensor, "--hold", "0.5", *common]) == 0
    return place


def test_one_record_gathers_all_sensors(folder):
    record, truth = load_calibration(folder / "record.json"), load_calibration(folder / "raw" / "true-calibration.json")
    assert list(record.channels) == ["imu/acc", "imu/gyr", "imu/mag"]
    for name, one in record.channels.items():
        right = np.array(truth.channels[name].matrix)
        np.testing.assert_allclose(np.array(one.matrix) @ np.linalg.inv(right), np.eye(len(right)), atol=2e-3)


def test_files_give_what_the_simulation_gave(folder, tmp_path, capsys):
    words = ["calibrate", "accelerometer", str(folder / "raw" / "accelerometer.csv")]
    assert main([*words, "--record", str(tmp_path / "a.json"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)["record"]
    assert printed["channels"]["imu/acc"] == load_calibration(folder / "record.json").describe()["channels"]["imu/acc"]
    words = ["calibrate", "gyroscope", str(folder / "raw" / "gyroscope.csv"), "--record", str(tmp_path / "a.json")]
    assert main(words) == 0
    assert "discarded" in capsys.readouterr().out
    assert set(load_calibration(tmp_path / "a.json").channels) == {"imu/acc", "imu/gyr"}


def test_evaluate_applies_a_record(folder, tmp_path, capsys):
    motion = simulate_hand("fast", 0, "array-data-sheet", duration=5.0, device=HandDevice("imu", TRIAXIAL))
    measurements = {"imu/acc": motion.measurements["array/acc"], "imu/gyr": motion.measurements["imu/gyr"]}
    truth = load_calibration(folder / "raw" / "true-calibration.json")
    truth = CalibrationRecord({name: truth.channels[name] for name in measurements})
    undo_calibration(motion.replace(measurements=measurements), truth).save(tmp_path / "raw.h5")
    part = load_calibration(folder / "record.json")
    found = CalibrationRecord({name: part.channels[name] for name in measurements})
    by_name = nominal_calibration(TRIAXIAL)
    nominal = CalibrationRecord({name: by_name.channels[name] for name in measurements})
    errors = {}
    for name, record in (("found", found), ("nominal", nominal)):
        path = record.save(tmp_path / f"{name}.json")
        words = ["evaluate", str(tmp_path / "raw.h5"), "--estimators", "mekf", "--json"]
        capsys.readouterr()
        assert main([*words, "--runs", str(tmp_path / "runs"), "--calibration", str(path)]) == 0
        rows = json.loads(capsys.readouterr().out)["rows"]
        errors[name] = rows[0]["value"]
    assert errors["found"] < 0.3 * errors["nominal"]


def test_frame(tmp_path, capsys):
    path = tmp_path / "axes.csv"
    path.write_text("bx,by,bz,ox,oy,oz\n1,0,0,0,1,0\n0,1,0,-1,0,0\n0,0,1,0,0,1\n")
    assert main(["calibrate", "frame", str(path), "--record", str(tmp_path / "f.json"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)["record"]["details"]["frame"]
    np.testing.assert_allclose(printed["tracker_to_device"], [np.sqrt(0.5), 0, 0, -np.sqrt(0.5)], atol=1e-12)
    path.write_text("bx,by,bz,ox,oy,oz\n1,0,0,0,1,0\n0,1,0,1,0,0\n0,0,1,0,0,1\n")
    assert main(["calibrate", "frame", str(path), "--record", str(tmp_path / "f.json")]) == 2
    assert "reflection" in capsys.readouterr().err


def test_wrong_words_are_explained(folder, tmp_path, capsys):
    record, table = ["--record", str(tmp_path / "r.json")], str(folder / "raw" / "accelerometer.csv")
    for words, message in (
        ([], "name CSV files, or --simulate"),
        ([str(tmp_path / "none.csv")], "no file at"),
        ([table, "--array", "controller"], "'controller' has 6 accelerometers, but the runs have 3 columns"),
        ([table, "--array", "okta"], "octa, controller, planar, triaxial"),
    ):
        assert main(["calibrate", "accelerometer", *words, *record]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "r.json").exists()
    assert main(["calibrate", "gyroscope", "--simulate", "--record", str(tmp_path)]) == 2
    assert "record must be a file" in capsys.readouterr().err
    assert main(["calibrate", "gyroscope", "--simulate", "--seed", "-1", *record]) == 2
    assert "seed must be at least 0" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--gravity", "nan"], "gravity must be positive and finite"),
        (["--gravity", "-9.81"], "gravity must be positive and finite"),
        (["--saturation", "nan"], "saturation must be a magnitude"),
        (["--raw", "somewhere"], "it needs --simulate"),
    ],
)
def test_numbers_that_cannot_be_are_refused_and_leave_the_record(words, message, folder, tmp_path, capsys):
    record = tmp_path / "r.json"
    record.write_text((folder / "record.json").read_text())
    table = str(folder / "raw" / "accelerometer.csv")
    assert main(["calibrate", "accelerometer", table, "--record", str(record), *words]) == 2
    assert message in capsys.readouterr().err
    assert record.read_text() == (folder / "record.json").read_text()


@pytest.mark.parametrize("spoilt", [{"version": "x"}, {"details": [1]}, {"channels": []}])
def test_a_spoilt_record_is_explained_and_kept(spoilt, tmp_path, capsys):
    path, axes = tmp_path / "r.json", tmp_path / "axes.csv"
    axes.write_text("bx,by,bz,ox,oy,oz\n1,0,0,1,0,0\n0,1,0,0,1,0\n0,0,1,0,0,1\n")
    text = json.dumps({"format": "poise-calibration", "version": 1, "channels": {}, "details": {}} | spoilt)
    path.write_text(text)
    assert main(["calibrate", "frame", str(axes), "--record", str(path)]) == 2
    assert "r.json" in capsys.readouterr().err
    assert path.read_text() == text


def test_simulated_runs_do_not_spoil_machine_readable_output(tmp_path, capsys):
    words = ["--simulate", "--hold", "0.3", "--raw", str(tmp_path / "raw"), "--record", str(tmp_path / "r.json")]
    assert main(["calibrate", "gyroscope", *words, "--json"]) == 0
    output = capsys.readouterr()
    assert set(json.loads(output.out)["record"]["channels"]) == {"imu/gyr"}
    assert "simulated runs" in output.err


def test_directions_of_axes_are_shown(tmp_path, capsys):
    words = ["calibrate", "accelerometer", "--simulate", "--hold", "0.3", "--axis-error", "1", "--estimate-axes"]
    assert main([*words, "--record", str(tmp_path / "r.json")]) == 0
    assert "turned (deg)" in capsys.readouterr().out
    axes = load_calibration(tmp_path / "r.json").details["imu/acc"]["axes"]
    assert 0.1 < np.degrees(max(axis["turned"] for axis in axes)) < 5.0
    array = load_array(tmp_path / "r.json")
    np.testing.assert_allclose(array.e, [axis["axis"] for axis in axes], atol=1e-12)
    assert ArrayOrientation(array=array).readings.name == "imu/acc", "the channel that the record calibrates"
    assert main(["calibrate", "gyroscope", "--simulate", "--hold", "0.3", "--record", str(tmp_path / "g.json")]) == 0
    with pytest.raises(ValueError, match="calibration record without accelerometers"):
        load_array(tmp_path / "g.json")
