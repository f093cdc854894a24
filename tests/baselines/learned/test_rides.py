"""Rides as training data: recorded once, drawn anew several times, resumable."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.learned.head import AngleHead
from poise.baselines.learned.inputs.filter_features import FilterFeatures
from poise.baselines.learned.presets import RIDES, seeds_of
from poise.baselines.learned.rides import UNSEEN, ride_data
from poise.envs import episodes
from poise.envs.recipes.rides import RideSource, drawn, held_out, ride
from poise.filters.registry import make

SHORT = RideSource(
    2, 2, 12.0, {"pilots": ["ideal"], "scenarios": ["straight"], "fidelity": ["lumped"], "suite": ["two-gyro"]}
)


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(episodes, "user_cache", lambda name: tmp_path_factory.mktemp("kept") / name)
        yield


def test_rides_are_drawn_anew_and_repeatable() -> None:
    first, second = drawn(SHORT, 5, 0)
    assert not np.array_equal(first.measurements["trunk_imu/gyr"], second.measurements["trunk_imu/gyr"])
    again = drawn(SHORT, 5, 0)[0]
    np.testing.assert_array_equal(again.measurements["trunk_imu/gyr"], first.measurements["trunk_imu/gyr"])
    assert not first.mask[:400].any()
    assert first.mask[600:].all()


def test_another_recipe_rides_otherwise() -> None:
    one = RideSource(1, 1, 0.5, SHORT.changes)
    plain, wild = ride(one, 5, 0), ride(held_out(one, styles=("aggressive",)), 5, 0)
    assert not np.array_equal(plain.truth["trunk/angles"], wild.truth["trunk/angles"])


def test_targets_are_the_errors_of_the_filter() -> None:
    kalman = make("two-gyro")
    front_end = FilterFeatures(kalman)
    outputs = tuple(quantity for quantity in kalman.outputs if quantity.kind == "angle")
    head = AngleHead(outputs, (0.02,) * 4)
    data = ride_data(SHORT, 5, front_end, head)
    assert data.features.shape[0] == 4
    assert data.features.shape[2] == front_end.size
    ridden = drawn(SHORT, 5, 0)[0]
    told = front_end.with_dt(ridden.dt).configured(ridden.metadata)
    seen = told.run({channel.name: ridden.measurements[channel.name] for channel in told.channels})
    due = seen.due == 1.0
    roll = ridden.truth["bicycle/roll"][due, 0] - seen.base["bicycle/roll"][due, 0]
    scored = data.mask[0, : due.sum()]
    assert scored.sum() > 100
    np.testing.assert_allclose(data.target[0, : due.sum(), 0][scored], roll[scored], atol=1e-6)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="rides must be at least 1"):
        RideSource(0)
    with pytest.raises(ValueError, match="draws must be at least 1"):
        RideSource(3, 0)


def test_no_knee_turns_behind_its_hip() -> None:
    """An unsteady rider of a heavy bicycle, whose legs would turn around between hip and pedal without ligaments."""
    source = replace(RIDES, rides=3, draws=1)
    ride = drawn(held_out(source, **UNSEEN["aggressive riders"]), seeds_of(0)[3] + 2, 2)[0]
    for side in ("left", "right"):
        abducted, rotated = np.degrees(ride.truth[f"hip_{side}/angles"][:, 1:]).T
        assert np.abs(abducted).max() < 50.0
        assert np.abs(rotated).max() < 70.0
