"""Estimates in files of every format, read back by other programs' readers."""

import h5py
import numpy as np
import pandas
import pytest
from scipy.spatial.transform import Rotation, Slerp

import poise
from poise.baselines.export import WRITERS, write_estimates
from poise.envs.hand.sensing import simulate_hand


@pytest.fixture(scope="module")
def estimates():
    return {
        gesture: poise.run("mekf-9", simulate_hand(gesture, seed=6, duration=5.0, rate=rate))
        for gesture, rate in (("slow", 100.0), ("fast", 80.0))
    }


def test_csv_and_parquet_hold_the_table(estimates, tmp_path):
    pytest.importorskip("pyarrow")
    one = {"slow": estimates["slow"]}
    expected = estimates["slow"].to_frame()
    readers = {".csv": pandas.read_csv, ".parquet": pandas.read_parquet}
    for ending, read in readers.items():
        pandas.testing.assert_frame_equal(read(write_estimates(one, tmp_path / f"a{ending}")), expected)
        both = read(write_estimates(estimates, tmp_path / f"b{ending}"))
        assert both.columns[0] == "sensor"
        for sensor, estimate in estimates.items():
            part = both[both.sensor == sensor].drop(columns="sensor").reset_index(drop=True)
            pandas.testing.assert_frame_equal(part, estimate.to_frame())


def test_hdf5_and_numpy_hold_every_column(estimates, tmp_path):
    arrays = np.load(write_estimates(estimates, tmp_path / "a.npz"))
    alone = np.load(write_estimates({"slow": estimates["slow"]}, tmp_path / "b.npz"))
    with h5py.File(write_estimates(estimates, tmp_path / "a.h5")) as file:
        for sensor, estimate in estimates.items():
            frame = estimate.to_frame()
            for column in frame:
                np.testing.assert_array_equal(file[sensor][column][()], frame[column])
                np.testing.assert_array_equal(arrays[f"{sensor}/{column}"], frame[column])
        assert file["slow/roll"].attrs["unit"] == "deg"
        assert file["slow/gyroscope_bias_x"].attrs["unit"] == "rad/s"
    assert set(alone.files) == set(estimates["slow"].to_frame().columns)


def test_sto_is_a_quaternion_table_on_one_clock(estimates, tmp_path):
    """Read as OpenSim reads it: a head of key=value lines, then tab-separated columns of w,x,y,z."""
    lines = write_estimates(estimates, tmp_path / "a.sto").read_text().splitlines()
    head, body = lines[: lines.index("endheader")], lines[lines.index("endheader") + 1 :]
    keys = dict(line.split("=") for line in head)
    assert keys["DataType"] == "Quaternion"
    assert float(keys["DataRate"]) == pytest.approx(100.0)
    assert body[0].split("\t") == ["time", "slow", "fast"]
    rows = [row.split("\t") for row in body[1:]]
    time = np.array([float(row[0]) for row in rows])
    np.testing.assert_allclose(np.diff(time), 0.01, atol=1e-6)
    for column, sensor in enumerate(("slow", "fast"), start=1):
        q = np.array([[float(value) for value in row[column].split(",")] for row in rows])
        np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-6)
        estimate = estimates[sensor]
        curve = Slerp(estimate.time, Rotation.from_quat(estimate.pose["orientation"][:, [1, 2, 3, 0]]))
        difference = Rotation.from_quat(q[:, [1, 2, 3, 0]]) * curve(time).inv()
        assert difference.magnitude().max() < 1e-6


def test_what_cannot_be_written_is_explained(estimates, tmp_path):
    with pytest.raises(ValueError, match=r"must end in one of \.csv"):
        write_estimates(estimates, tmp_path / "a.xlsx")
    with pytest.raises(ValueError, match="no estimate"):
        write_estimates({}, tmp_path / "a.csv")
    tilt = {"slow": poise.run("tilt", simulate_hand("slow", seed=6, duration=1.0))}
    with pytest.raises(ValueError, match="only an inclination"):
        write_estimates(tilt, tmp_path / "a.sto")
    later = estimates["fast"]._replace(time=estimates["fast"].time + 100.0)
    with pytest.raises(ValueError, match="do not overlap"):
        write_estimates({"slow": estimates["slow"], "fast": later}, tmp_path / "a.sto")
    timeless = {"slow": estimates["slow"]._replace(time=None)}
    with pytest.raises(ValueError, match="no time"):
        write_estimates(timeless, tmp_path / "a.sto")
    assert list(tmp_path.iterdir()) == []
    for ending in WRITERS:
        if ending not in (".sto", ".parquet"):
            write_estimates(tilt, tmp_path / f"tilt{ending}")


def test_sensors_without_a_common_heading_are_named(estimates, tmp_path, recwarn):
    """Inverse kinematics would take the difference of two arbitrary headings for an angle of a joint."""
    alone = poise.run("bounded-motion", simulate_hand("slow", seed=6, duration=5.0))
    write_estimates({"thigh": alone}, tmp_path / "a.sto")
    write_estimates(estimates, tmp_path / "a.sto")
    assert not recwarn
    with pytest.warns(UserWarning, match="heading of thigh, shank counts from its own start"):
        write_estimates({"thigh": alone, "shank": alone}, tmp_path / "a.sto")
