"""Lasting faults of a ride's sensors: what changes, when, and nothing else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from poise.envs.data.trajectory import Trajectory
from poise.envs.recipes import rides
from poise.envs.recipes.rides import EARLIEST, FAULTS, RideSource, drawn

LENGTH = 4000
RIDE = Trajectory(
    time=0.01 * np.arange(LENGTH),
    measurements={"bicycle_imu/gyr": np.zeros((LENGTH, 3)), "seat/wrench": np.zeros((LENGTH, 6))},
    metadata={"name": "ride"},
)


def test_a_step_lasts_to_the_end_and_an_offset_for_its_time() -> None:
    for name, column, size, longest in (("bias step", 0, math.radians(1.0), 40.0), ("seat offset", 1, 40.0, 20.0)):
        fault = FAULTS[name]
        for seed in range(5):
            values = fault.applied(RIDE, np.random.default_rng(seed)).measurements[fault.channel]
            on = np.flatnonzero(values[:, column])
            assert (values[on, column] == size).all()
            assert (np.delete(values, column, axis=1) == 0.0).all()
            assert on[0] >= 100 * EARLIEST
            assert len(on) == on[-1] - on[0] + 1 >= 1500
            assert len(on) == (LENGTH - on[0] if longest == 40.0 else min(2000, LENGTH - on[0]))
    assert (RIDE.measurements["seat/wrench"] == 0.0).all()


def test_all_draws_of_a_ride_have_it_at_the_same_time(monkeypatch: pytest.MonkeyPatch) -> None:
    source = RideSource(1, 2, changes={"suite": ["bicycle_imu/gyr"]}, fault="bias step")
    monkeypatch.setattr(rides, "ride", lambda *_: RIDE)
    monkeypatch.setattr("poise.envs.recipes.rider.redrawn", lambda ride, *_, **__: ride)
    plain, faulty = drawn(replace(source, fault=None), 3, 0), drawn(source, 3, 0)
    changed = [
        one.measurements["bicycle_imu/gyr"] - other.measurements["bicycle_imu/gyr"]
        for one, other in zip(faulty, plain, strict=True)
    ]
    np.testing.assert_array_equal(*changed)
    assert changed[0].any()


def test_what_there_is_not_is_refused() -> None:
    with pytest.raises(ValueError, match="lacks the channel 'seat/wrench'"):
        FAULTS["seat offset"].applied(
            RIDE.replace(measurements={"bicycle_imu/gyr": np.zeros((LENGTH, 3))}), np.random.default_rng(0)
        )
    with pytest.raises(ValueError, match="fault"):
        RideSource(fault="flat tyre")
