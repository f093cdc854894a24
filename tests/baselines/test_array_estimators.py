"""Filters for arrays are told the array of a recording."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.array_estimators import array_parameters
from poise.baselines.evaluation import evaluate
from poise.baselines.rider_estimators import equations_of, make_for
from poise.envs.hand.devices import DEVICES
from poise.envs.hand.sensing import simulate_hand
from poise.filters.arrays.array import OCTA
from poise.filters.registry import CATALOGUE


@pytest.mark.parametrize("device", ["octa", "octa-gyroscope", "controller"])
def test_the_device_of_a_recording_is_told(device):
    trajectory = simulate_hand("slow", 1, duration=1.5, device=device)
    model = equations_of(make_for("array-orientation", trajectory, compiled=False))
    assert model.array == DEVICES[device].array
    assert model.gyroscope == DEVICES[device].gyroscope
    assert [channel.name for channel in model.channels if channel.name not in trajectory.measurements] == []
    assert array_parameters(CATALOGUE["marins"], trajectory) == {}


def test_an_imu_and_a_fixed_array_are_told_nothing():
    trajectory = simulate_hand("slow", 1, duration=1.5)
    assert array_parameters(CATALOGUE["array-orientation"], trajectory) == {}
    named = trajectory.replace(metadata={**trajectory.metadata, "device": "a sensor by name"})
    assert array_parameters(CATALOGUE["array-orientation"], named) == {}
    assert (
        array_parameters(CATALOGUE["array-orientation-imu"], simulate_hand("slow", 1, duration=1.5, device="octa"))
        == {}
    )


def test_a_recorded_octa_is_evaluated_by_name():
    trajectory = simulate_hand("slow", 1, duration=1.5, device="octa")
    told = make_for("array-orientation", trajectory, compiled=False)
    assert equations_of(told).array == OCTA
    frame = evaluate({"told": told}, [trajectory])
    total = frame[(frame["quantity"] == "orientation") & (frame["metric"] == "total")]["value"]
    assert np.isfinite(total).all()
    assert len(total) == 1
