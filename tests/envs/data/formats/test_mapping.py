"""The general reader: any table by a mapping, as arguments or as a TOML file beside the data."""

from __future__ import annotations

import importlib.util
import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from scipy.spatial.transform import Rotation

import poise
from poise.envs.data.formats.draft import draft_map
from poise.filters.core import rotation

T = 200
RATE = 100.0
G = 9.80665


@pytest.fixture(scope="module")
def arrays() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(7)
    # A body that turns slowly, so that the specific force tells its vertical.
    turn = np.cumsum(rng.standard_normal((T, 3)) * 0.02, axis=0)
    q = rotation.exp(turn)
    return {
        "t": np.arange(T) / RATE,
        "gyr": rng.standard_normal((T, 3)),
        "acc": G * rotation.up_in_body(q),
        "mag": rng.standard_normal((T, 3)),
        "q": q,
    }


NAMES = {"gyr": ["p", "q", "r"], "acc": ["fx", "fy", "fz"], "mag": ["hx", "hy", "hz"], "q": ["e0", "e1", "e2", "e3"]}


def write(path: Path, arrays: dict[str, np.ndarray], kind: str = "csv", order: int = 1, **factors: float) -> Path:
    columns = {"time": arrays["t"] * factors.get("time", 1.0)}
    for key, names in list(NAMES.items())[::order]:
        values = arrays[key] * factors.get(key, 1.0)
        columns |= {name: values[:, i] for i, name in enumerate(names)}
    if kind == "csv":
        rows = np.column_stack(list(columns.values()))
        np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")
    elif kind == "npz":
        np.savez(path, **columns)
    elif kind == "structured npy":
        table = np.zeros(T, dtype=[(name, float) for name in columns])
        for name, values in columns.items():
            table[name] = values
        np.save(path, table)
    elif kind == "mat":
        scipy.io.savemat(path, columns)
    elif kind == "parquet":
        import pandas

        pandas.DataFrame(columns).to_parquet(path)
    return path


MAP: dict[str, Any] = {"columns": {key: names for key, names in NAMES.items() if key != "q"}, "time": "time"}
PARQUET = importlib.util.find_spec("pyarrow") or importlib.util.find_spec("fastparquet")


@pytest.mark.parametrize(
    ("kind", "suffix"),
    [("csv", "csv"), ("npz", "npz"), ("structured npy", "npy"), ("mat", "mat"), ("parquet", "parquet")],
)
@pytest.mark.parametrize("order", [1, -1])
def test_columns_are_found_in_every_container_and_order(tmp_path, arrays, kind, suffix, order):
    if kind == "parquet" and not PARQUET:
        pytest.skip("neither pyarrow nor fastparquet is installed")
    path = write(tmp_path / f"mine.{suffix}", arrays, kind, order)
    recording = poise.load_recording(path, **MAP)
    assert list(recording.measurements) == ["imu/gyr", "imu/acc", "imu/mag"]
    for name in ("gyr", "acc", "mag"):
        np.testing.assert_allclose(recording.measurements[f"imu/{name}"], arrays[name], atol=1e-9)
    np.testing.assert_allclose(recording.time, arrays["t"], atol=1e-12)
    assert recording.name == "mine"


def test_parquet_without_its_library_says_what_to_install(tmp_path):
    if PARQUET:
        pytest.skip("it is installed")
    (tmp_path / "a.parquet").write_bytes(b"PAR1" + bytes(30) + b"PAR1")
    with pytest.raises(ImportError, match="pip install pyarrow"):
        poise.load_recording(tmp_path / "a.parquet", columns={"gyr": ["x", "y", "z"]}, rate=100)


def test_arrays_go_by_their_names_and_matrices_by_their_columns(tmp_path, arrays):
    np.savez(tmp_path / "a.npz", time=arrays["t"], w=arrays["gyr"], f=arrays["acc"].T)
    whole = poise.load_recording(tmp_path / "a.npz", columns={"gyr": "w", "acc": "f"}, time="time")
    np.testing.assert_allclose(whole.measurements["imu/acc"], arrays["acc"])
    np.save(tmp_path / "b.npy", np.column_stack([arrays["t"], arrays["acc"], arrays["gyr"]]))
    for zero in (0, "0"):
        one = poise.load_recording(tmp_path / "b.npy", columns={"gyr": [4, 5, 6], "acc": [1, 2, 3]}, time=zero)
        np.testing.assert_allclose(one.measurements["imu/gyr"], arrays["gyr"])
    scipy.io.savemat(tmp_path / "c.mat", {"rec": {"imu": {"g": arrays["gyr"], "a": arrays["acc"]}}})
    two = poise.load_recording(tmp_path / "c.mat", columns={"gyr": "rec/imu/g", "acc": "rec/imu/a"}, rate=RATE)
    np.testing.assert_allclose(two.measurements["imu/acc"], arrays["acc"])
    assert two.dt == pytest.approx(1 / RATE)


@pytest.mark.parametrize(
    ("kind", "unit", "scale"),
    [
        ("gyr", "deg/s", 180 / np.pi),
        ("gyr", "rad/s", 1.0),
        ("acc", "g", 1 / G),
        ("acc", "mg", 1e3 / G),
        ("acc", "m/s^2", 1.0),
        ("mag", "mT", 1e-3),
        ("mag", "gauss", 0.01),
    ],
)
def test_units_are_converted(tmp_path, arrays, kind, unit, scale):
    path = write(tmp_path / "a.csv", arrays, **{kind: scale})
    recording = poise.load_recording(path, **MAP, units={kind: unit})
    np.testing.assert_allclose(recording.measurements[f"imu/{kind}"], arrays[kind], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("unit", "scale"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
@pytest.mark.parametrize("said", [True, False])
def test_time_has_any_unit(tmp_path, arrays, unit, scale, said):
    path = write(tmp_path / "a.csv", arrays, time=scale)
    if said:
        recording = poise.load_recording(path, **MAP, units={"time": unit})
    elif unit == "s":
        recording = poise.load_recording(path, **MAP)
    else:
        with pytest.warns(UserWarning, match=f"taken for {unit}"):
            recording = poise.load_recording(path, **MAP)
    assert recording.dt == pytest.approx(1 / RATE)


def test_signs_turn_axes(tmp_path, arrays):
    path = write(tmp_path / "a.csv", arrays)
    signs = {"acc": -1, "gyr": [1, -1, 1]}
    recording = poise.load_recording(path, **MAP, signs=signs)
    np.testing.assert_allclose(recording.measurements["imu/acc"], -arrays["acc"], atol=1e-9)
    np.testing.assert_allclose(recording.measurements["imu/gyr"], arrays["gyr"] * [1, -1, 1], atol=1e-9)


def test_a_rate_replaces_or_supports_the_time(tmp_path, arrays):
    path = write(tmp_path / "a.csv", arrays)
    bare = poise.load_recording(path, columns=MAP["columns"], rate=50)
    assert bare.dt == pytest.approx(0.02)
    assert bare.metadata["nominal_rate"] == 50.0
    assert poise.load_recording(path, **MAP, rate=100).metadata["nominal_rate"] == 100.0
    with pytest.raises(ValueError, match=r"time=….*rate=…"):
        poise.load_recording(path, columns=MAP["columns"])


@pytest.mark.parametrize("conjugate", [False, True])
@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("frame", ["enu", "ned", "nwu", "y-up"])
def test_references_have_any_order_sense_and_frame(tmp_path, arrays, conjugate, order, frame):
    """SciPy says how a vector of the sensor looks in the other world; ours must agree after its own conversion."""
    to_enu = {
        "enu": np.eye(3),
        "ned": np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]),
        "nwu": np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]),
        "y-up": np.array([[1, 0, 0], [0, 0, -1], [0, 1.0, 0]]),
    }[frame]
    own = Rotation.from_matrix(to_enu).inv() * Rotation.from_quat(rotation.to_xyzw(arrays["q"]))
    written = (own.inv() if conjugate else own).as_quat(scalar_first=order == "wxyz")
    path = write(tmp_path / "a.csv", arrays | {"q": written})
    reference = {"columns": NAMES["q"], "order": order, "conjugate": conjugate, "frame": frame}
    recording = poise.load_recording(path, **MAP, reference=reference)
    error = rotation.angle(rotation.multiply(rotation.conjugate(recording.truth["orientation"]), arrays["q"]))
    assert error.max() < 1e-6
    onboard = poise.load_recording(path, **MAP, reference=reference | {"role": "onboard"})
    assert onboard.truth == {}
    assert onboard.onboard_orientation is not None
    error = rotation.angle(rotation.multiply(rotation.conjugate(onboard.onboard_orientation), arrays["q"]))
    assert error.max() < 1e-6


def test_references_may_be_matrices_or_angles(tmp_path, arrays):
    matrix = rotation.to_matrix(arrays["q"]).reshape(T, 9)
    yaw, pitch, roll = np.degrees(rotation.to_euler_zyx(arrays["q"]))
    np.savez(
        tmp_path / "a.npz", **{k: arrays[k] for k in ("t", "gyr", "acc")}, m=matrix, e=np.stack([roll, pitch, yaw], 1)
    )
    for name in ("m", "e"):
        recording = poise.load_recording(
            tmp_path / "a.npz", columns={"gyr": "gyr", "acc": "acc"}, time="t", reference={"columns": name}
        )
        error = rotation.angle(rotation.multiply(rotation.conjugate(recording.truth["orientation"]), arrays["q"]))
        assert error.max() < 1e-6


def test_lost_trackers_are_unknown_truth(tmp_path, arrays):
    q = arrays["q"].copy()
    q[20:30] = 0.0
    path = write(tmp_path / "a.csv", arrays | {"q": q})
    recording = poise.load_recording(path, **MAP, reference={"columns": NAMES["q"]})
    np.testing.assert_array_equal(np.flatnonzero(~recording.mask), np.arange(20, 30))
    assert np.isnan(recording.truth["orientation"][20:30]).all()


def test_several_sensors_of_a_file(tmp_path, arrays):
    columns = {"time": arrays["t"]}
    for sensor, sign in (("chest", 1.0), ("Head", -1.0)):
        for kind in ("gyr", "acc"):
            columns |= {f"{sensor}_{kind}_{axis}": sign * arrays[kind][:, i] for i, axis in enumerate("xyz")}
    np.savetxt(
        tmp_path / "two.csv",
        np.column_stack(list(columns.values())),
        delimiter=";",
        header=";".join(columns),
        comments="",
    )
    mapping = {
        "columns": {
            f"{sensor}/{kind}": [f"{sensor}_{kind}_{axis}" for axis in "xyz"]
            for sensor in ("chest", "Head")
            for kind in ("gyr", "acc")
        },
        "time": "time",
    }
    both = poise.load_recordings(tmp_path / "two.csv", **mapping)
    assert [one.name for one in both] == ["two-chest", "two-Head"]
    np.testing.assert_allclose(both[1].measurements["imu/gyr"], -arrays["gyr"], atol=1e-9)
    head = poise.load_recording(tmp_path / "two.csv", sensor="head", **mapping)
    assert head.metadata["sensor"] == "Head"
    with pytest.warns(UserWarning, match=r"several sensors \(chest, Head\)"):
        assert poise.load_recording(tmp_path / "two.csv", **mapping).metadata["sensor"] == "chest"
    with pytest.raises(ValueError, match="unknown sensor 'hand'"):
        poise.load_recording(tmp_path / "two.csv", sensor="hand", **mapping)


def test_a_mapping_beside_the_data(tmp_path, arrays):
    write(tmp_path / "raw.csv", arrays, gyr=180 / np.pi, acc=1 / G, time=1e3)
    (tmp_path / "mine.toml").write_text(
        """
        file = "raw.csv"
        name = "walk"
        time = "time"
        rate = 100
        [columns]
        gyr = ["p", "q", "r"]
        acc = ["fx", "fy", "fz"]
        [units]
        gyr = "deg/s"
        acc = "g"
        time = "ms"
        [[reference]]
        columns = ["e0", "e1", "e2", "e3"]
        """,
        encoding="utf-8",
    )
    recording = poise.load_recording(tmp_path / "mine.toml")
    assert recording.name == "walk"
    np.testing.assert_allclose(recording.measurements["imu/gyr"], arrays["gyr"], atol=1e-9)
    np.testing.assert_allclose(recording.measurements["imu/acc"], arrays["acc"], atol=1e-9)
    assert recording.dt == pytest.approx(0.01)
    assert "orientation" in recording.truth
    from poise.envs.data.formats.load import find_recordings

    assert find_recordings(tmp_path) == [tmp_path / "mine.toml"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("file = 1\n[columns]\ngyr = [1]", "names the data by 'file'"),
        ('file = "none.csv"\n[columns]\ngyr = ["p"]', "there is no .*none.csv"),
        ('file = "raw.csv"\ntimes = "t"\n[columns]\ngyr = ["p"]', "unknown key 'times', did you mean 'time'"),
        ("file = \n[columns]", "it is not TOML"),
    ],
)
def test_wrong_mappings_are_named(tmp_path, arrays, text, message):
    write(tmp_path / "raw.csv", arrays)
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(ValueError, match=rf"mine\.toml: .*{message}"):
        poise.load_recording(tmp_path / "mine.toml")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"columns": {"gyr": ["p", "q", "s"]}}, r"unknown column 's'"),
        ({"columns": {"gyr": ["p", "q"]}}, r"columns\['gyr'\] must be 3 columns, got 2"),
        ({"columns": {"mag": ["hx", "hy", "hz"]}}, "columns must name 'gyr' or 'acc'"),
        ({"columns": {}}, "columns must map channels"),
        ({"columns": "gyr"}, "columns must map channels"),
        ({"units": {"gyr": "furlong"}}, r"units\['gyr'\]: unknown unit 'furlong'"),
        ({"units": {"gyro": "deg/s"}}, "units: unknown channel 'gyro', did you mean 'gyr'"),
        ({"units": {"time": "fortnight"}}, "unknown unit 'fortnight'"),
        ({"signs": {"acc": 2}}, r"signs\['acc'\] must be 1 or -1"),
        ({"signs": {"acc": [1, -1]}}, r"signs\['acc'\] must be 1 or -1"),
        ({"time": "clock"}, "unknown column 'clock'"),
        ({"rate": 0}, "rate must be a positive number of Hz, got 0"),
        ({"rate": "fast"}, "rate must be a positive number of Hz, got 'fast'"),
        ({"rate": True}, "rate must be a positive number of Hz, got True"),
        ({"reference": {"columns": ["e0", "e1"]}}, "reference columns must be four, nine or three, got 2"),
        ({"reference": ["e0", "e1", "e2", "e3"]}, "reference must be a mapping with 'columns'"),
        ({"reference": {"columns": NAMES["q"], "order": "xyzt"}}, "unknown order 'xyzt'"),
        ({"reference": {"columns": NAMES["q"], "frame": "up"}}, "unknown frame 'up'"),
        ({"reference": {"columns": NAMES["q"], "conj": True}}, "unknown key 'conj', did you mean 'conjugate'"),
    ],
)
def test_wrong_arguments_are_named(tmp_path, arrays, changes, message):
    path = write(tmp_path / "a.csv", arrays)
    with pytest.raises(ValueError, match=rf"a\.csv: .*{message}"):
        poise.load_recording(path, **MAP | changes)


def test_unknown_files_are_answered_with_what_was_seen_and_how_to_map_it(tmp_path, arrays):
    path = write(tmp_path / "a.csv", arrays)
    with pytest.raises(
        ValueError,
        match=r"delimited by comma; 200 rows; columns time, p, q, r.*inspect a\.csv --write-map a\.toml.*\(path, col",
    ):
        poise.load_recording(path)
    path.write_text("hello\n")
    with pytest.raises(ValueError, match=r"a\.csv is of no known format.*no table of numbers"):
        poise.load_recording(path)


@pytest.mark.parametrize(
    ("gyr", "acc", "units"), [(1.0, 1.0, ("rad/s", "m/s^2")), (180 / np.pi, 1 / G, ("deg/s", "g"))]
)
def test_a_draft_of_a_mapping_can_be_read(tmp_path, arrays, gyr, acc, units):
    columns = {"Zeit": arrays["t"] * 1e3, "timestamp": arrays["t"] * 1e3}
    for kind, scale in (("gyr", gyr), ("acc", acc)):
        columns |= {f"{kind}{axis.upper()}": scale * arrays[kind][:, i] for i, axis in enumerate("xyz")}
    columns |= {f"q{axis}": arrays["q"][:, i] for i, axis in enumerate("wxyz")}
    np.savetxt(tmp_path / "x.csv", np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns))
    text = draft_map(tmp_path / "x.csv")
    (tmp_path / "x.toml").write_text(text, encoding="utf-8")
    assert f'acc = "{units[1]}"  # guessed' in text
    recording = poise.load_recording(tmp_path / "x.toml")
    np.testing.assert_allclose(recording.measurements["imu/acc"], arrays["acc"], atol=1e-9)
    assert recording.dt == pytest.approx(0.01)
    assert recording.onboard_orientation is not None
    assert "fill in" in draft_map(write(tmp_path / "a.csv", arrays))


def test_pickles_and_bombs_are_not_loaded(tmp_path, arrays):
    np.save(tmp_path / "a.npy", np.array([{"x": 1}], dtype=object), allow_pickle=True)
    np.savez(tmp_path / "b.npz", t=arrays["t"], gyr=np.array([print], dtype=object))
    for name in ("a.npy", "b.npz"):
        with pytest.raises(ValueError, match="pickled"):
            poise.load_recording(tmp_path / name, columns={"gyr": "gyr", "acc": "t"}, time="t")
    with zipfile.ZipFile(tmp_path / "d.xlsx", "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
    with pytest.raises(ValueError, match="a spreadsheet; save its table as CSV"):
        poise.load_recording(tmp_path / "d.xlsx")
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (2**40, 3)})
    with zipfile.ZipFile(tmp_path / "c.npz", "w") as archive:
        archive.writestr("t.npy", header.getvalue() + bytes(64))
    with pytest.raises(ValueError, match="more than it holds"):
        poise.load_recording(tmp_path / "c.npz", columns={"gyr": "t"}, rate=100)
