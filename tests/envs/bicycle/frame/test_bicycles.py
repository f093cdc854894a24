"""Bicycles by name: they fit riders of all sizes, are stable at some speed, and can be ridden."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.bicycle.course.path import Path
from poise.envs.bicycle.frame.bicycles import BICYCLES
from poise.envs.bicycle.frame.whipple import whipple_model
from poise.envs.bicycle.ride.ride import Ride
from poise.envs.bicycle.rider.anthropometry import RiderBody
from poise.envs.bicycle.rider.posture import sit
from poise.envs.bicycle.rider.style import STYLES, RiderMotion

RIDDEN = [name for name, bicycle in BICYCLES.items() if bicycle.drive is not None]


@pytest.mark.parametrize("name", RIDDEN)
@pytest.mark.parametrize(("stature", "mass", "female"), [(1.50, 45.0, True), (1.76, 68.0, False), (1.95, 110.0, False)])
def test_every_rider_fits_on_every_bicycle_and_makes_it_stable_at_some_speed(name, stature, mass, female):
    """Measured bicycles with a rider are stable by themselves from about 5 to 8 m/s (Moore et al. 2010)."""
    posture = sit(BICYCLES[name], RiderBody(stature, mass, female))
    assert 0.1 < posture.flexion < 1.0
    model = whipple_model(posture.bicycle.with_load(posture.load()))
    stable = [speed for speed in np.arange(3.0, 12.0, 0.25) if model.eigenvalues(speed)[0].real < 0.0]
    assert 4.5 <= min(stable) <= 6.6
    assert max(stable) - min(stable) > 1.0


@pytest.mark.parametrize("name", RIDDEN[1:])
def test_a_novice_rides_every_bicycle(name):
    posture = sit(BICYCLES[name], RiderBody())
    motion = RiderMotion(STYLES["mild"], np.random.default_rng(0))
    with Ride(posture, motion, Path(np.zeros(2)), lambda _: 3.0, fidelity="lumped", pilot="novice") as ride:
        for _ in range(2000):
            ride.step()
        assert not ride.fallen
        assert abs(ride.state.roll) < 0.1
        assert abs(ride.pilot.offset) < 0.5
        assert ride.state.speed == pytest.approx(3.0, abs=0.2)


def test_measured_masses_are_kept():
    """Whole bicycles weigh what was measured: 18.2, 9.8 and 10.4 kg."""
    for name, mass in (("city-bike", 18.2), ("racing-bike", 9.8), ("trail-bike", 10.4)):
        assert sum(part.mass for part in BICYCLES[name].parts) == pytest.approx(mass, abs=1e-9)
