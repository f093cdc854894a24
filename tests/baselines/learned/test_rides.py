"""Rides as training data: recorded once, drawn anew several times, resumable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from poise.baselines.learned.filter_features import FilterFeatures
from poise.baselines.learned.head import AngleHead
from poise.baselines.learned.rides import RideSource, drawn, held_out, ride_data, ride_files
from poise.filters.registry import make

SHORT = RideSource(
    2, 2, 12.0, {"pilots": ["ideal"], "scenarios": ["straight"], "fidelity": ["lumped"], "suite": ["two-gyro"]}
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("rides")
    ride_files(SHORT, 5, home)
    return home


def test_rides_are_kept_and_drawn_anew(folder: Path) -> None:
    paths = ride_files(SHORT, 5, folder)
    stamps = [path.stat().st_mtime_ns for path in paths]
    first, second = drawn(SHORT, 5, 0, paths[0])
    assert [path.stat().st_mtime_ns for path in ride_files(SHORT, 5, folder)] == stamps
    assert not np.array_equal(first.measurements["trunk_imu/gyr"], second.measurements["trunk_imu/gyr"])
    again = drawn(SHORT, 5, 0, paths[0])[0]
    np.testing.assert_array_equal(again.measurements["trunk_imu/gyr"], first.measurements["trunk_imu/gyr"])
    assert not first.mask[:400].any()


def test_rides_of_another_recipe_are_ridden_anew(tmp_path: Path) -> None:
    one = RideSource(1, 1, 0.5, SHORT.changes)
    (path,) = ride_files(one, 5, tmp_path)
    before = path.read_bytes()
    (path,) = ride_files(held_out(one, styles=("aggressive",)), 5, tmp_path)
    assert path.read_bytes() != before


def test_targets_are_the_errors_of_the_filter(folder: Path) -> None:
    kalman = make("two-gyro")
    front_end = FilterFeatures(kalman)
    outputs = tuple(quantity for quantity in kalman.outputs if quantity.kind == "angle")
    head = AngleHead(outputs, (0.02,) * 4)
    data = ride_data(SHORT, 5, folder, front_end, head)
    assert data.features.shape[0] == 4
    assert data.features.shape[2] == front_end.size
    ride = drawn(SHORT, 5, 0, ride_files(SHORT, 5, folder)[0])[0]
    told = front_end.with_dt(ride.dt).configured(ride.metadata)
    seen = told.run({channel.name: ride.measurements[channel.name] for channel in told.channels})
    due = seen.due == 1.0
    roll = ride.truth["bicycle/roll"][due, 0] - seen.base["bicycle/roll"][due, 0]
    scored = data.mask[0, : due.sum()]
    assert scored.sum() > 100
    np.testing.assert_allclose(data.target[0, : due.sum(), 0][scored], roll[scored], atol=1e-6)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="rides must be at least 1"):
        RideSource(0)
    with pytest.raises(ValueError, match="draws must be at least 1"):
        RideSource(3, 0)
