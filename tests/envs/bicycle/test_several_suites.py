"""One ride recorded with several suites is, bit for bit, what each suite records on its own."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.ride.human import HumanPilot
from poise.envs.bicycle.several_suites import record_suite_files, record_suites
from poise.envs.data.trajectory import load_trajectory
from poise.envs.record import record_episode

SUITES = ("two-gyro", "force-inertial", "whole-body")


@pytest.mark.parametrize(
    "options",
    [
        {"scenario": "outdoor", "subject": 1, "duration": 2.0},
        {"scenario": "outdoor", "subject": "random", "duration": 2.0, "fidelity": "lumped"},
    ],
)
def test_a_shared_ride_is_recorded_bit_for_bit(options, tmp_path):
    check(options, tmp_path)


def test_a_shared_ride_ends_in_a_fall_for_every_suite(tmp_path, monkeypatch):
    monkeypatch.setattr(HumanPilot, "update", lambda *arguments: (0.0, 0.0))
    check({"duration": 20.0, "subject": 0, "fidelity": "lumped"}, tmp_path)
    ends = {load_trajectory(tmp_path / f"{suite}.h5").metadata["ended"] for suite in SUITES}
    assert ends == {"terminated"}


def check(options, tmp_path):
    every = [{**options, "suite": suite} for suite in SUITES]
    paths = [tmp_path / f"{suite}.h5" for suite in SUITES]
    assert record_suite_files(every, 3, paths) == paths
    for each, path in zip(every, paths, strict=True):
        shared = load_trajectory(path)
        alone = load_trajectory(record_episode("poise/RiderBicycle-v0", each, 3, tmp_path / "alone" / path.name))
        assert shared.metadata == alone.metadata
        for part in ("measurements", "truth"):
            one, other = getattr(shared, part), getattr(alone, part)
            assert list(one) == list(other)
            assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in one)
        assert np.array_equal(shared.time, alone.time)


def test_a_ride_that_is_not_the_same_is_refused():
    kinds = [{"suite": "two-gyro", "duration": 1.0}, {"suite": "two-gyro", "duration": 2.0}]
    with pytest.raises(ValueError, match="the same scenario, rider and seed"):
        record_suites(kinds, 0)
    lumped, full = RiderBicycleEnv(fidelity="lumped", duration=1.0), RiderBicycleEnv(duration=1.0)
    try:
        with pytest.raises(ValueError, match="fidelity must be that of the ride that is shared, 'full', got 'lumped'"):
            lumped.ride_with(full)
    finally:
        lumped.close()
        full.close()


def test_a_shared_ride_cannot_be_saved():
    first, other = RiderBicycleEnv(duration=1.0), RiderBicycleEnv(duration=1.0, suite="two-gyro")
    try:
        other.ride_with(first)
        first.reset(seed=0)
        other.reset(seed=0)
        with pytest.raises(RuntimeError, match="cannot be saved"):
            other.snapshot()
    finally:
        first.close()
        other.close()
