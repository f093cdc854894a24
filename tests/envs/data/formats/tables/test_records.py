"""JSON in the shapes of programs and apps, structured arrays and lists in cells of Parquet are the same recording."""

from __future__ import annotations

import importlib.util
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import poise

from ..motion import readings, same

UNITS = {"gyr": "rad/s", "acc": "m/s^2"}
STAMPS, GYR, ACC, *_ = readings()
TIME = STAMPS.tolist()
G, A = GYR.tolist(), ACC.tolist()
NAMES = ["time", "gyr_x", "gyr_y", "gyr_z", "acc_x", "acc_y", "acc_z"]
MATRIX = np.column_stack([STAMPS, GYR, ACC])
RECORDS = [{"t": t, "gyr": g, "acc": a} for t, g, a in zip(TIME, G, A, strict=True)]


def right(path: Path, given: dict[str, Any] | None = None, count: int = 1) -> None:
    found = poise.load_recordings(path, **({"units": UNITS} if given is None else given))
    assert len(found) == count
    for one in found:
        known = np.isfinite(one.measurements["imu/acc"]).all(axis=1)
        assert known.sum() >= len(one) - 1
        same(one.measurements["imu/gyr"], GYR[: len(one)], 1e-5)
        same(one.measurements["imu/acc"][known], ACC[: len(one)][known], 1e-5)
        assert len(one) > 0.99 * len(TIME)
        assert one.dt == pytest.approx(0.01)


def axes(values: np.ndarray) -> dict[str, list[float]]:
    return {axis: values[:, i].tolist() for i, axis in enumerate("xyz")}


def samples(values: np.ndarray) -> list[dict[str, float]]:
    return [{"t": t, **dict(zip("xyz", row, strict=True))} for t, row in zip(TIME, values.tolist(), strict=True)]


def packets(size: int) -> list[dict[str, Any]]:
    return [
        {
            "Timestamp": 10 * begin,
            **{
                name: [dict(zip("xyz", row, strict=True)) for row in values[begin : begin + size].tolist()]
                for name, values in (("ArrayGyro", GYR), ("ArrayAcc", ACC))
            },
        }
        for begin in range(0, len(TIME) // size * size, size)
    ]


@pytest.mark.parametrize(
    "content",
    [
        {"time": TIME, "gyr": axes(GYR), "acc": axes(ACC)},
        {"time": TIME, "gyr": G, "acc": A},
        {"time": TIME, "gyr": GYR.T.tolist(), "acc": ACC.T.tolist()},
        {"device": "one", "fs": 100.0, "gyr": G, "acc": A},
        {"gyroscope": samples(GYR), "accelerometer": samples(ACC)},
        {"gyroscope": {"time": TIME, **axes(GYR)}, "accelerometer": {"time": TIME, **axes(ACC)}},
        {"sensors": [{"type": "gyroscope", "data": samples(GYR)}, {"type": "accelerometer", "data": samples(ACC)}]},
        {"columns": NAMES, "data": MATRIX.tolist()},
        {"header": NAMES, "rows": MATRIX.tolist()},
        [NAMES, *MATRIX.tolist()],
        {name: {str(k): value for k, value in enumerate(MATRIX[:, i].tolist())} for i, name in enumerate(NAMES)},
        {str(k): dict(zip(NAMES, row, strict=True)) for k, row in enumerate(MATRIX.tolist())},
        {"session": {"id": 3}, "data": {"imu": RECORDS}},
        {"tags": ["a", "b"], "events": [{"t": 1, "name": "x"}, {"t": 3, "name": "y"}], "samples": RECORDS},
        [one | ({"acc": None} if k == 300 else {}) for k, one in enumerate(RECORDS)],
        packets(8),
        [{"payload": {"data": {"imu": one}}} for one in packets(5)],
    ],
)
def test_shapes_of_json(tmp_path: Path, content: Any) -> None:
    (tmp_path / "a.json").write_text(json.dumps(content))
    right(tmp_path / "a.json")


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + json.dumps(RECORDS, indent=2).replace("\n", "\r\n"),
        json.dumps({"device": "x", "rate": 100}) + "\n" + "\n".join(map(json.dumps, RECORDS)),
        json.dumps([{**one, "t": f"2024-01-01T13:00:{one['t']:06.3f}Z"} for one in RECORDS]),
    ],
)
def test_texts_of_json(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.json").write_bytes(text.encode())
    right(tmp_path / "a.json")


def test_units_may_stand_in_json_or_in_its_names(tmp_path: Path) -> None:
    degrees = np.degrees(GYR).tolist()
    rows = [{"time": 1e3 * t, "gyr": g, "acc": a} for t, g, a in zip(TIME, degrees, A, strict=True)]
    units = {"time": "ms", "gyr": "deg/s", "acc": "m/s^2"}
    (tmp_path / "a.json").write_text(json.dumps({"units": units, "samples": rows}))
    right(tmp_path / "a.json", {})
    names = ["time_s", *(f"gyr_{axis}_dps" for axis in "xyz"), *(f"acc_{axis}_mps2" for axis in "xyz")]
    table = np.column_stack([STAMPS, degrees, ACC]).tolist()
    (tmp_path / "b.json").write_text(json.dumps([dict(zip(names, row, strict=True)) for row in table]))
    right(tmp_path / "b.json", {})


def test_devices_of_json_are_sensors(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps({"left": RECORDS, "right": RECORDS}))
    right(tmp_path / "a.json", count=2)


NOTHING = ["{}", "[1, 2, 3]", '{"a": 1}', '{"a": [1, 2]}', "[[1, 2], [3, 4]]", "[[[[[[[[1]]]]]]]]", "[" * 5000]
NOTHING += ['[{"a": []}, {"a": []}]', json.dumps(RECORDS)[:-9]]


@pytest.mark.parametrize("content", NOTHING)
def test_json_without_samples_is_told(tmp_path: Path, content: str) -> None:
    (tmp_path / "a.json").write_text(content)
    with pytest.raises(ValueError, match=r"JSON without a list of samples|do not identify|no table of numbers"):
        poise.load_recording(tmp_path / "a.json")


def test_the_title_of_a_section_is_no_json(tmp_path: Path) -> None:
    rows = "\n".join(",".join(map(repr, row)) for row in MATRIX.tolist())
    (tmp_path / "a.csv").write_text(f"[Header]\nName=Test\n[Data]\n{','.join(NAMES)}\n{rows}\n")
    right(tmp_path / "a.csv")


VECTOR: list[Any] = [("x", float), ("y", float), ("z", float)]


@pytest.mark.parametrize("kind", [(float, (3,)), VECTOR])
@pytest.mark.parametrize("dates", [False, True])
def test_structured_arrays(tmp_path: Path, kind: Any, dates: bool) -> None:
    stamps = "M8[us]" if dates else "f8"
    vectors: list[Any] = [(name, kind) if kind == VECTOR else (name, *kind) for name in ("gyr", "acc")]
    table = np.zeros(len(TIME), dtype=[("time", stamps), *vectors])
    table["time"] = (
        np.datetime64("2024-01-01T12:00", "us") + np.rint(1e6 * STAMPS).astype("m8[us]") if dates else STAMPS
    )
    for name, values in (("gyr", GYR), ("acc", ACC)):
        if kind == VECTOR:
            for i, axis in enumerate("xyz"):
                table[name][axis] = values[:, i]
        else:
            table[name] = values
    np.save(tmp_path / "a.npy", table)
    right(tmp_path / "a.npy")
    if not dates:
        h5py = pytest.importorskip("h5py")
        with h5py.File(tmp_path / "a.h5", "w") as file:
            file["imu"] = table
        right(tmp_path / "a.h5")


def mat(path: Path, **arrays: Any) -> Path:
    scipy_io = pytest.importorskip("scipy.io")
    scipy_io.savemat(path.with_suffix(".mat"), arrays)
    return path.with_suffix(".mat")


def npz(path: Path, **arrays: Any) -> Path:
    np.savez(path.with_suffix(".npz"), **arrays)
    return path.with_suffix(".npz")


def hdf5(path: Path, **arrays: Any) -> Path:
    with pytest.importorskip("h5py").File(path.with_suffix(".h5"), "w") as file:
        for name, values in arrays.items():
            if np.ndim(values):
                file[name] = [one.encode() for one in values] if isinstance(values, list) else values
            else:
                file.attrs[name] = values
    return path.with_suffix(".h5")


@pytest.mark.parametrize("write", [mat, npz, hdf5])
def test_a_rate_and_names_of_columns_beside_the_arrays(tmp_path: Path, write: Callable[..., Path]) -> None:
    right(write(tmp_path / "rate", gyr=GYR, acc=ACC, fs=100.0))
    right(write(tmp_path / "names", values=MATRIX, labels=NAMES))


@pytest.mark.skipif(importlib.util.find_spec("pyarrow") is None, reason="needs pyarrow")
@pytest.mark.parametrize("shape", ["objects", "lists", "packets"])
def test_nested_columns_of_parquet(tmp_path: Path, shape: str) -> None:
    pandas = pytest.importorskip("pandas")
    if shape == "packets":
        begins = range(0, len(TIME) // 5 * 5, 5)
        columns: dict[str, Any] = {"t": [TIME[begin] for begin in begins]}
        for kind, values in (("gyr", GYR), ("acc", ACC)):
            for i, axis in enumerate("xyz"):
                columns[f"{kind}_{axis}"] = [values[begin : begin + 5, i].tolist() for begin in begins]
    else:
        columns = {"t": TIME, "gyr": G, "acc": A}
        if shape == "objects":
            columns |= {kind: [dict(zip("xyz", row, strict=True)) for row in columns[kind]] for kind in ("gyr", "acc")}
    pandas.DataFrame(columns).to_parquet(tmp_path / "a.parquet")
    right(tmp_path / "a.parquet")


SHORT = {"x": [1.0] * 50, "y": [2.0] * 50, "z": [3.0] * 50}


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ({"t": TIME, "gyr": G, "acc": A, "mag": [[1.0, 2.0, 3.0]] * 50}, "mag (50 values)"),
        ({"t": TIME, "gyr": axes(GYR), "acc": axes(ACC), "mag": SHORT}, "mag.x (50 values), mag.y (50 values)"),
        ({"imu": RECORDS, "barometer": [{"t": t, "pressure": 1013.0 + t} for t in TIME[:70]]}, "barometer (70 rows)"),
    ],
)
def test_lists_of_another_length_that_are_not_read_are_named(tmp_path: Path, content: Any, named: str) -> None:
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.warns(UserWarning, match=re.escape(f"a.json: of its lists {named}")):
        right(tmp_path / "a.json")
