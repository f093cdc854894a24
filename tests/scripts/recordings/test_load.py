"""``poise inspect``, ``estimate``, ``evaluate`` on files as users have them."""

import json

import numpy as np
import pandas
import pytest

import poise
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.sensors.single_imu import SITES
from poise.envs.data.formats.load import load_recording
from poise.envs.hand.sensing import simulate_hand
from poise.scripts.main import main
from poise.scripts.report import numbered


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    for number, session in enumerate(("first", "second")):
        (folder / session).mkdir()
        motion = simulate_hand("slow", seed=number, duration=4.0)
        six = {name: values for name, values in motion.measurements.items() if name != "imu/mag"}
        motion.replace(measurements=six, truth={}, metadata={"name": "chest"}).save(folder / session / "chest.h5")
    (folder / "second" / "notes.txt").write_text("the sensor fell off at 12:30\n")
    return folder


def test_six_axes_without_truth_work_out_of_the_box(folder, tmp_path, capsys):
    assert main(["evaluate", str(folder), "--runs", str(tmp_path), "--estimators", "mekf", "tilt", "mekf-9"]) == 0
    captured = capsys.readouterr()
    assert "no truth" in captured.out
    assert "reference bounded-motion" in captured.out
    assert "mekf-9: no channel imu/mag (2 recordings)" in captured.out
    assert "notes.txt: no known format" in captured.out
    (run,) = (tmp_path / "evaluate").iterdir()
    table = pandas.read_csv(run / "results.csv")
    assert set(table.trajectory) == {"first/chest", "second/chest"}


def test_estimates_are_written_for_several_sensors_at_once(folder, tmp_path, capsys):
    output, plot = tmp_path / "angles.csv", tmp_path / "angles.png"
    assert main(["estimate", str(folder), "--output", str(output), "--plot", str(plot)]) == 0
    table = pandas.read_csv(output)
    assert set(table.sensor) == {"first/chest", "second/chest"}
    assert {"time", "roll", "pitch", "yaw", "qw", "std_roll", "gyroscope_bias_x"} <= set(table.columns)
    assert plot.stat().st_size > 10_000
    assert "first/chest" in capsys.readouterr().out
    assert main(["estimate", str(folder), "--output", str(tmp_path / "angles.docx")]) == 2
    assert "must end in" in capsys.readouterr().err
    assert main(["estimate", str(folder), "--estimator", "mekff"]) == 2
    assert "did you mean 'mekf'" in capsys.readouterr().err


def test_inspect_tells_what_is_there_and_what_is_odd(folder, tmp_path, capsys):
    plot = tmp_path / "signals.png"
    assert main(["inspect", str(folder / "first" / "chest.h5"), "--plot", str(plot)]) == 0
    text = capsys.readouterr().out
    assert "100 Hz" in text
    assert "plausible" in text
    assert plot.stat().st_size > 10_000
    motion = simulate_hand("slow", seed=0, duration=4.0)
    wrong = {**motion.measurements, "imu/gyr": np.degrees(motion.measurements["imu/gyr"])}
    path = motion.replace(measurements=wrong, metadata={"name": "wrong"}).save(tmp_path / "wrong.h5")
    assert main(["inspect", str(path), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    findings = [row for row in document["rows"] if row["table"] == "wrong: findings"]
    assert [row["cause"] for row in findings] == ["rates in deg/s"]
    sensor = next(row for row in document["rows"] if row["table"] == "wrong: sensors")
    assert sensor["dip °"] == pytest.approx(60.0, abs=25.0)


def test_users_are_warned_where_they_estimate(tmp_path, capsys):
    motion = simulate_hand("fast", seed=0, duration=4.0)
    wrong = {**motion.measurements, "imu/acc": motion.measurements["imu/acc"] / 9.80665}
    path = motion.replace(measurements=wrong, metadata={"name": "wrong"}).save(tmp_path / "wrong.h5")
    assert main(["estimate", str(path)]) == 0
    assert "readings in g. Multiply by 9.80665" in capsys.readouterr().err


@pytest.fixture(scope="module")
def ride(tmp_path_factory):
    env = RiderBicycleEnv("straight", subject=1, suite="two-gyro", fidelity="lumped", duration=2.0)
    path = poise.record(env, seed=1).save(tmp_path_factory.mktemp("rides") / "ride.h5")
    env.close()
    return path


def test_a_filter_of_rides_gets_the_whole_ride_and_one_of_an_imu_each_site(ride, tmp_path, capsys):
    whole, sites = tmp_path / "whole.csv", tmp_path / "sites.csv"
    assert main(["estimate", str(ride), "--estimator", "two-gyro", "--output", str(whole)]) == 0
    assert "bicycle/roll" in pandas.read_csv(whole).columns
    assert main(["estimate", str(ride), "--estimator", "gyroscope-integration", "--output", str(sites)]) == 2
    assert "lack" in capsys.readouterr().err
    full = load_recording(ride)
    worn = [site for site in SITES if f"{site}/gyr" in full.measurements]
    with_force = full.measurements | {f"{site}/acc": np.tile([0.0, 0.0, 9.81], (len(full), 1)) for site in worn}
    path = full.replace(measurements=with_force).save(tmp_path / "full.h5")
    assert main(["estimate", str(path), "--estimator", "mekf", "--output", str(sites)]) == 0
    names = set(pandas.read_csv(sites).sensor)
    assert {name.removeprefix(full.name).strip("-/") for name in names} == set(worn) == {"bicycle_imu", "trunk_imu"}
    assert main(["evaluate", str(path), "--estimators", "mekf", "--runs", str(tmp_path)]) == 2
    assert "sensors there: bicycle_imu, trunk_imu" in capsys.readouterr().err
    assert main(["evaluate", str(path), "--estimators", "mekf", "--site", "trunk_imu", "--runs", str(tmp_path)]) == 0


def test_a_matrix_of_many_estimators_fits_a_terminal():
    names = [f"a-rather-long-name-{number}" for number in range(12)]
    rows = [{"estimator": name, **{f"to {other}": 1.0 for other in [*names, "reference"]}} for name in names]
    shown = numbered(rows)
    assert list(shown[0]) == ["estimator", *(str(number) for number in range(1, 14))]
    assert shown[4]["estimator"] == "5 a-rather-long-name-4"
    assert shown[-1] == {"estimator": "13 reference"}
    assert numbered(rows[:1]) != rows[:1]
    few = [{"estimator": "a", "to b": 1.0}]
    assert numbered(few) == few


def test_a_drafted_mapping_lies_beside_its_data(tmp_path, capsys):
    (tmp_path / "elsewhere").mkdir()
    rows = "".join(f"{k / 50},0.1,0.2,0.3,0,0,9.81\n" for k in range(60))
    data = tmp_path / "mine.csv"
    data.write_text("clock,a,b,c,d,e,f\n" + rows)
    away, beside = tmp_path / "elsewhere" / "mine.toml", tmp_path / "mine.toml"
    assert main(["inspect", str(data), "--write-map", str(away)]) != 0
    assert "write_map must name a file beside the data" in capsys.readouterr().err
    assert not away.exists()
    assert main(["inspect", str(data), "--write-map", str(beside)]) == 0
    assert beside.read_text().startswith("# What the columns of mine.csv mean")
