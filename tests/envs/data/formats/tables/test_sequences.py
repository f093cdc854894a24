"""Several samples in a row and several numbers in a cell are read as what they are; sensors stay sensors."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import poise

from ..motion import readings, same

UNITS = {"gyr": "rad/s", "acc": "m/s^2"}
TIME, GYR, ACC, *_ = readings()
COUNT = 4
ROWS = len(TIME) // COUNT


def written(path: Path, columns: dict[str, np.ndarray], mark: str = ",") -> Path:
    rows = zip(*([str(value) for value in values] for values in columns.values()), strict=True)
    path.write_text("\n".join([mark.join(columns), *(mark.join(row) for row in rows)]) + "\n")
    return path


def blocks(values: np.ndarray) -> np.ndarray:
    """Values ``(rows, COUNT, 3)`` of samples ``(T, 3)``."""
    return values[: ROWS * COUNT].reshape(ROWS, COUNT, 3)


def right(path: Path) -> poise.Trajectory:
    found = poise.load_recording(path, units=UNITS)
    length = len(found)
    same(found.measurements["imu/gyr"], GYR[:length], 1e-5)
    same(found.measurements["imu/acc"], ACC[:length], 1e-5)
    assert found.dt == pytest.approx(0.01)
    return found


@pytest.mark.parametrize(
    "name", ["{kind}_{axis}_{n}", "{kind}_{axis}[{n}]", "{kind}{axis}{n}", "{kind}_{n}_{axis}", "s{n}_{kind}_{axis}"]
)
@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("lost", [False, True])
def test_samples_in_a_row(tmp_path: Path, name: str, first: int, lost: bool) -> None:
    columns = {"t": TIME[: ROWS * COUNT : COUNT]}
    for n in range(COUNT):
        for kind, values in (("gyr", GYR), ("acc", ACC)):
            columns |= {
                name.format(kind=kind, axis=axis, n=n + first): blocks(values)[:, n, i] for i, axis in enumerate("xyz")
            }
    if lost:
        kept = np.delete(np.arange(ROWS), [50, 51, 90])
        found = poise.load_recording(
            written(tmp_path / "a.csv", {key: each[kept] for key, each in columns.items()}), units=UNITS
        )
        rows = (COUNT * kept[:, None] + np.arange(COUNT)).ravel()
        same(found.measurements["imu/gyr"], GYR[rows])
        same(found.time - found.time[0], TIME[rows] - TIME[0], 1e-3)
        assert found.on_grid().dt == pytest.approx(0.01, rel=1e-3)
    else:
        assert len(right(written(tmp_path / "a.csv", columns))) == ROWS * COUNT


@pytest.mark.parametrize("name", ["{kind}_{axis}_{n}", "imu{n}_{kind}_{axis}"])
@pytest.mark.parametrize("second", [1.0, 0.6])
def test_sensors_with_numbers_stay_sensors(tmp_path: Path, name: str, second: float) -> None:
    """Of one body or of two that move in another way."""
    noise = np.random.default_rng(1).normal(0.0, 0.01, GYR.shape)
    columns = {"t": TIME}
    for n, (gyr, acc) in enumerate(((GYR, ACC), (second * GYR[:: 1 if second == 1.0 else -1] + noise, ACC + noise))):
        for kind, values in (("gyr", gyr), ("acc", acc)):
            columns |= {name.format(kind=kind, axis=axis, n=n): values[:, i] for i, axis in enumerate("xyz")}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one, other = poise.load_recordings(written(tmp_path / "a.csv", columns), units=UNITS)
    same(one.measurements["imu/gyr"], GYR)
    assert len(other) == len(TIME)


def test_rest_does_not_tell_which(tmp_path: Path) -> None:
    rng, columns = np.random.default_rng(2), {"t": TIME}
    for n in range(3):
        columns |= {f"gyr_{axis}_{n}": rng.normal(0.0, 0.01, len(TIME)) for axis in "xyz"}
        columns |= {f"acc_{axis}_{n}": rng.normal(9.81 * (axis == "z"), 0.05, len(TIME)) for axis in "xyz"}
    with pytest.warns(UserWarning, match="whether gyr_x_0 and so on are 3 sensors or samples"):
        assert len(poise.load_recordings(written(tmp_path / "a.csv", columns), units=UNITS)) == 3


@pytest.mark.parametrize(
    ("mark", "form", "between"),
    [(",", '"[{}]"', ", "), (",", "[{}]", " "), (",", "{}", " "), (";", "({})", ", "), ("\t", "{}", ",")],
)
@pytest.mark.parametrize("several", [False, True])
def test_cells_with_several_numbers(tmp_path: Path, mark: str, form: str, between: str, several: bool) -> None:
    columns: dict[str, np.ndarray] = {"time": TIME[::COUNT][:ROWS] if several else TIME}
    for kind, values in (("gyr", GYR), ("acc", ACC)):
        parts = (
            {f"{kind}_{axis}": blocks(values)[:, :, i] for i, axis in enumerate("xyz")} if several else {kind: values}
        )
        columns |= {
            name: np.array([form.format(between.join(map(repr, row))) for row in each.tolist()])
            for name, each in parts.items()
        }
    if form == "{}" and mark == ",":
        with pytest.raises(ValueError, match="do not identify"):
            poise.load_recording(written(tmp_path / "a.csv", columns, mark), units=UNITS)
    else:
        right(written(tmp_path / "a.csv", columns, mark))
