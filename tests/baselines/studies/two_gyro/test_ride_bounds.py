"""Bounds with a camera that is misaligned, and the Segway."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.studies.signals import Waves
from poise.baselines.studies.two_gyro import segway
from poise.baselines.studies.two_gyro.motion import MOTIONS, Errors, filter_of, simulate
from poise.baselines.studies.two_gyro.ride_bounds import CONSTANT, DRIFTING, with_alignment
from poise.filters.analysis.bounds import posterior_bound
from poise.filters.bicycle.two_gyro.truth import true_states
from poise.filters.core.quantity import DEG


def test_an_unknown_alignment_leaves_theta_as_uncertain_as_it_is():
    model = filter_of(Errors(camera=0.1 * DEG), 0.05)
    # a turn would tell how the body stands to its axis
    ride = simulate(replace(MOTIONS["frozen"], yaw=Waves()), 10.0, 0.05)
    states = true_states(ride.truth, model)
    lasting = np.sqrt(with_alignment(model, ride.truth, ride.measurements)[-1, 2, 2]) / DEG
    white = np.sqrt(posterior_bound(model, states, ride.measurements)[-1, 2, 2]) / DEG
    # nothing moves: the two errors of the marker stay in θ₂, constant and drifting one together
    assert lasting == pytest.approx(np.hypot(CONSTANT, DRIFTING) / DEG, rel=0.1)
    assert white < 0.1


def test_a_segway_that_turns_knows_its_pitch():
    ride, error, estimate = segway.run("turning", "sigma2", 1)
    late = ride.time >= 60.0
    assert np.sqrt(np.mean(error[late] ** 2)) < 0.3
    assert abs(error[0]) == pytest.approx(4.0, abs=0.5)
    assert np.ptp(ride.truth["bicycle/roll"]) == 0.0
    assert "two-gyro/pitch" in estimate.pose
