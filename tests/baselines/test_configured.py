"""Filters by name are configured with the rider, bicycle or device of a recording, and scored on their own truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import gymnasium
import numpy as np
import pandas
import pytest

import poise
from poise import make_estimator
from poise.baselines.evaluation import evaluate
from poise.baselines.gain_policy.adaptive import AdaptiveEstimator
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.data.trajectory import load_trajectory
from poise.envs.hand.devices import DEVICES
from poise.envs.hand.sensing import simulate_hand
from poise.envs.record import record_episodes
from poise.filters.arrays.array import OCTA
from poise.filters.bicycle.geometry import RiderEquations, RiderGeometry
from poise.filters.bicycle.two_gyro.filter import TwoGyro
from poise.filters.core.model import Recurrence, equations_of
from poise.filters.core.quantity import Channel, Quantity
from poise.filters.registry import FILTERS, Entry
from poise.scripts.main import main

RATE = Channel("bicycle_imu/gyr", 3, "rad/s")


@dataclass(frozen=True)
class Wheelbase(RiderEquations, Recurrence):
    """Outputs the wheelbase that it is configured with as an angle, and the roll as zero."""

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
    def rider_parameters(cls, geometry):
        return {"length": geometry.wheelbase, "tilt": geometry.bicycle_imu_tilt}

    def prior(self, z):
        return 0.0 * z["bicycle_imu/gyr"][..., :1] + self.scale * self.length

    def predict(self, x, z, previous):
        return x

    def pose(self, x):
        return {"bicycle/roll": 0.0 * x, "fake/wheelbase": x}

    def truth(self, truth):
        return {"fake/wheelbase": self.scale + 0.0 * truth["bicycle/roll"]} if "bicycle/roll" in truth else {}


@pytest.fixture
def _fake(monkeypatch):
    entry = Entry(Wheelbase, "fake", "nowhere", fixed={"scale": 1.0})
    monkeypatch.setitem(FILTERS, "fake", entry)
    monkeypatch.setitem(FILTERS, "fake-twice", replace(entry, fixed={"scale": 2.0}))


def made_for(name, trajectory, **parameters):
    return make_estimator(name, **{"dt": trajectory.dt, "metadata": trajectory.metadata, **parameters})


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
        assert RiderGeometry.of(ride.metadata) == env.geometry
        assert env.geometry != RiderGeometry()
        env.reset(seed=0, options={"subject": 1})
        assert env.geometry.upper_arm != RiderGeometry.of(ride.metadata).upper_arm
    finally:
        env.close()


def test_a_pushed_fixture_has_the_geometry_of_its_bicycle():
    push = poise.record(gymnasium.make("poise/BicycleFixture-v0", duration=1.0), seed=0)
    assert push.metadata["geometry"]["wheelbase"] == RiderGeometry().wheelbase
    assert RiderGeometry.of({"name": "hand"}) == RiderGeometry()
    with pytest.raises(ValueError, match="unknown geometry"):
        make_estimator("two-gyro", metadata={"geometry": {"nose": 1.0}})


@pytest.mark.usefixtures("_fake")
def test_a_filter_is_configured_with_the_rider(ride):
    geometry = RiderGeometry.of(ride.metadata)
    model = made_for("fake", ride).model
    assert (model.length, model.tilt, model.dt) == (geometry.wheelbase, geometry.bicycle_imu_tilt, ride.dt)
    twice = made_for("fake-twice", ride, tilt=0.5, compiled=False)
    assert (twice.model.length, twice.model.tilt, twice.model.scale) == (geometry.wheelbase, 0.5, 2.0)
    assert twice.compiled is False
    assert made_for("fake", ride, metadata={}).model.length == 9.0
    assert made_for("mekf", ride).dt == ride.dt
    with pytest.raises(ValueError, match="unknown parameters"):
        made_for("fake", ride, nose=1.0)


def test_equations_are_configured_but_for_what_was_chosen(ride):
    geometry = RiderGeometry.of(ride.metadata)
    model = TwoGyro(imu_tilt=0.3, roll_prior=0.1).configured(ride.metadata)
    assert model == TwoGyro.for_rider(geometry, imu_tilt=0.3, roll_prior=0.1)
    assert model != TwoGyro(imu_tilt=0.3, roll_prior=0.1)
    assert TwoGyro().configured({"name": "hand"}) == TwoGyro()


@pytest.mark.parametrize("device", ["octa", "octa-gyroscope", "controller"])
def test_a_filter_is_configured_with_the_array_of_a_device(device):
    trajectory = simulate_hand("slow", 1, duration=1.5, device=device)
    model = made_for("array-orientation", trajectory, compiled=False).model
    assert model.array == DEVICES[device].array
    assert model.gyroscope == DEVICES[device].gyroscope
    assert [channel.name for channel in model.channels if channel.name not in trajectory.measurements] == []
    # the name stands for one IMU, whatever else the device has
    assert (
        made_for("array-orientation-imu", trajectory).model
        == made_for("array-orientation-imu", trajectory, metadata={}).model
    )


def test_the_name_of_a_sensor_is_not_an_array():
    trajectory = simulate_hand("slow", 1, duration=1.5)
    named = trajectory.replace(metadata={**trajectory.metadata, "device": "a sensor by name"})
    for each in (trajectory, named):
        assert made_for("array-orientation", each).model == make_estimator("array-orientation", dt=each.dt).model


def test_a_recorded_octa_is_evaluated_by_name():
    trajectory = simulate_hand("slow", 1, duration=1.5, device="octa")
    configured = made_for("array-orientation", trajectory, compiled=False)
    assert configured.model.array == OCTA
    frame = evaluate({"configured": configured}, [trajectory])
    total = frame[(frame["quantity"] == "orientation") & (frame["metric"] == "total")]["value"]
    assert np.isfinite(total).all()
    assert len(total) == 1


@pytest.mark.usefixtures("_fake")
def test_a_table_holds_the_filters_own_quantities(ride):
    table = evaluate(["fake", "fake-twice"], ride).set_index(["estimator", "quantity", "metric"])["value"]
    wheelbase = RiderGeometry.of(ride.metadata).wheelbase
    assert table["fake", "fake/wheelbase", "angle"] == pytest.approx(np.degrees(wheelbase - 1.0))
    assert table["fake-twice", "fake/wheelbase", "angle"] == pytest.approx(np.degrees(2.0 * wheelbase - 2.0))
    roll = ride.truth["bicycle/roll"]
    assert table["fake", "bicycle/roll", "angle"] == pytest.approx(np.degrees(np.sqrt(np.mean(roll**2))))


@pytest.mark.usefixtures("_fake")
def test_equations_know_the_truth_of_their_own_quantities(ride):
    model = made_for("fake", ride).model
    assert set(model.truth(ride.truth)) == {"fake/wheelbase"}
    assert model.truth({}) == {}
    for name in ("two-gyro", "two-gyro-integration", "force-inertial", "force-inertial-integration"):
        equations = equations_of(made_for(name, ride))
        own = {quantity.name for quantity in equations.outputs if quantity.name.startswith(name.split("-i")[0])}
        assert own <= set(equations.truth(ride.truth)), name
        assert equations.truth({}) == {}
    assert made_for("mekf", ride).model.truth(ride.truth) == {}


def test_equations_are_found_inside_an_estimator():
    assert type(equations_of(make_estimator("two-gyro"))).__name__ == "TwoGyro"
    assert equations_of(TwoGyro()) == TwoGyro()
    adaptive = make_estimator("external-acceleration+policy")
    assert isinstance(adaptive, AdaptiveEstimator)
    assert equations_of(adaptive) is adaptive.filter.model
    vqf = object()
    assert equations_of(vqf) is vqf


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
