"""Who rides: from the environment into the recording, from there to filters, and their own truth into the table."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import ModuleType
from typing import ClassVar

import numpy as np
import pandas
import pytest

import poise
from poise.baselines.evaluation import evaluate
from poise.baselines.rider_estimators import equations_of, geometry_of, make_for, told, true_quantities
from poise.envs.batch_record import record_episodes
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.data.storage import load_trajectory
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.bicycle.told import TRUE_ANGLES
from poise.filters.core.model import Recurrence
from poise.filters.core.quantity import Channel, Quantity
from poise.filters.registry import CATALOGUE, Entry
from poise.scripts.main import main

RATE = Channel("bicycle_imu/gyr", 3, "rad/s")


@dataclass(frozen=True)
class Wheelbase(Recurrence):
    """Says the wheelbase that it was told, as an angle, and the roll as zero."""

    length: float = 9.0
    tilt: float = 0.0
    scale: float = 1.0

    channels: ClassVar[tuple[Channel, ...]] = (RATE,)
    outputs: ClassVar[tuple[Quantity, ...]] = (
        Quantity("bicycle/roll", "angle", 1, "rad"),
        Quantity("fake/wheelbase", "angle", 1, "rad"),
    )
    state_size: ClassVar[int] = 1

    @classmethod
    def for_rider(cls, geometry, **parameters):
        return cls(**{"length": geometry.wheelbase, "tilt": geometry.bicycle_imu_tilt, **parameters})

    def prior(self, z):
        return 0.0 * z["bicycle_imu/gyr"][..., :1] + self.scale * self.length

    def predict(self, x, z, previous):
        return x

    def pose(self, x):
        return {"bicycle/roll": 0.0 * x, "fake/wheelbase": x}


def true_angles(truth: Mapping[str, np.ndarray], scale: float = 5.0) -> dict[str, np.ndarray]:
    return {"fake/wheelbase": scale + 0.0 * truth["bicycle/roll"]}


@pytest.fixture
def _fake(monkeypatch):
    module = ModuleType("poise.filters.fake")
    vars(module).update(Wheelbase=Wheelbase, true_angles=true_angles)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    outputs = ("bicycle/roll", "fake/wheelbase")
    entry = Entry("fake:Wheelbase", "filter", "fake", ("bicycle_imu/gyr",), outputs, "Observer", {"scale": 1.0})
    monkeypatch.setitem(CATALOGUE, "fake", entry)
    monkeypatch.setitem(CATALOGUE, "fake-twice", replace(entry, fixed={"scale": 2.0}))
    monkeypatch.setitem(TRUE_ANGLES, "fake", module.__name__)


@pytest.fixture(scope="module")
def rides(tmp_path_factory):
    options = {"scenario": "straight", "subject": 3, "fidelity": "lumped", "duration": 0.5, "suite": "two-gyro"}
    folder = tmp_path_factory.mktemp("rides")
    return record_episodes("poise/RiderBicycle-v0", folder, episodes=2, options=options)


@pytest.fixture
def ride(rides):
    return load_trajectory(rides[0])


def test_a_recorded_ride_knows_its_rider(ride):
    env = RiderBicycleEnv("straight", 3, fidelity="lumped", duration=0.5, suite="two-gyro")
    try:
        env.reset(seed=0)
        assert geometry_of(ride) == env.geometry
        assert env.geometry != RiderGeometry()
        env.reset(seed=0, options={"subject": 1})
        assert env.geometry.upper_arm != geometry_of(ride).upper_arm
    finally:
        env.close()


def test_a_pushed_fixture_knows_its_bicycle_and_a_hand_knows_none():
    push = poise.record("poise/BicycleFixture-v0", seed=0)
    geometry = geometry_of(push)
    assert geometry is not None
    assert geometry.wheelbase == RiderGeometry().wheelbase
    hand = push.replace(metadata={"name": "hand"})
    assert geometry_of(hand) is None
    with pytest.raises(ValueError, match="unknown geometry"):
        geometry_of(push.replace(metadata={"geometry": {"nose": 1.0}}))


@pytest.mark.usefixtures("_fake")
def test_a_filter_is_told_who_rides(ride):
    geometry = geometry_of(ride)
    model = make_for("fake", ride).model
    assert (model.length, model.tilt, model.dt) == (geometry.wheelbase, geometry.bicycle_imu_tilt, ride.dt)
    twice = make_for("fake-twice", ride, tilt=0.5, compiled=False)
    assert (twice.model.length, twice.model.tilt, twice.model.scale) == (geometry.wheelbase, 0.5, 2.0)
    assert twice.compiled is False
    longer = told(ride, replace(geometry, wheelbase=1.2))
    assert make_for("fake", longer).model.length == 1.2
    assert make_for("fake", ride.replace(metadata={})).model.length == 9.0
    assert make_for("mekf", ride).dt == ride.dt
    with pytest.raises(ValueError, match="unknown parameters"):
        make_for("fake", ride, nose=1.0)


@pytest.mark.usefixtures("_fake")
def test_a_table_holds_the_filters_own_quantities(ride):
    table = evaluate(["fake", "fake-twice"], ride).set_index(["estimator", "quantity", "metric"])["value"]
    wheelbase = geometry_of(ride).wheelbase
    assert table["fake", "fake/wheelbase", "angle"] == pytest.approx(np.degrees(wheelbase - 1.0))
    assert table["fake-twice", "fake/wheelbase", "angle"] == pytest.approx(np.degrees(2.0 * wheelbase - 2.0))
    roll = ride.truth["bicycle/roll"]
    assert table["fake", "bicycle/roll", "angle"] == pytest.approx(np.degrees(np.sqrt(np.mean(roll**2))))
    estimator = make_for("fake", ride)
    assert isinstance(equations_of(estimator), Wheelbase)
    assert type(equations_of(make_for("two-gyro", ride))).__name__ == "TwoGyro"
    assert type(equations_of(make_for("bounded-motion+policy", ride))).__name__ == "BoundedMotion"
    assert true_quantities(estimator, {}) == {}
    assert true_quantities(make_for("mekf", ride), ride.truth) == {}


@pytest.mark.usefixtures("_fake")
def test_rides_are_evaluated_from_the_command_line(rides, tmp_path, capsys):
    words = ["evaluate", *map(str, rides), "--estimators", "fake", "mekf", "--runs", str(tmp_path)]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "bicycle/roll: RMS angle, deg" in out
    assert "no channel imu/gyr" in out
    (folder,) = (tmp_path / "evaluate").iterdir()
    assert set(pandas.read_csv(folder / "results.csv")["quantity"]) == {"bicycle/roll", "fake/wheelbase"}
    assert {path.name for path in (folder / "figures").iterdir()} >= {
        "bicycle-roll-angle.png",
        "fake-wheelbase-angle.png",
    }
