"""Vibration of a ridden bicycle on named road surfaces, beside what was measured on cargo bicycles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from scipy.signal import welch

from ....envs.bicycle.course.scenarios import SpeedProfile, scenario
from ....envs.bicycle.course.surfaces import SURFACES, Surface
from ....envs.bicycle.environment import RiderBicycleEnv
from ....envs.bicycle.rider.rider import Fidelity
from ....envs.record import record_once
from .checks import Check

RATE, SPEED = 250.0, 12.0 / 3.6
"""Hz, and m/s"""
MEASURED = {"tarmac": (0.9, 1.8), "pavers": (4.5, 7.0)}
"""m/s² vertical root mean square at the seat pan of cargo bicycles at 12 km/h"""
BANDWIDTH = (19.0, 63.0)
"""Hz: of the same measurements"""


def vibration(surface: str | Surface, duration: float = 6.0, fidelity: Fidelity = "full") -> tuple[float, float]:
    """Vertical acceleration of the bicycle at the seat tube while subject 0 rides straight on at 12 km/h.

    Returns:
        Root mean square (m/s²) without gravity, and the frequency (Hz) below which 95 % of its power lies.

    Raises:
        RuntimeError: the rider fell.
    """
    steady = replace(scenario("slow"), name="steady", speed=lambda generator, duration: SpeedProfile(np.array([SPEED])))
    env = RiderBicycleEnv(steady, 0, "still", ["bicycle_imu/acc"], "ideal", RATE, duration, fidelity, surface=surface)
    ride = record_once(env, 3)
    if ride.time[-1] < duration - 1.5 / RATE:
        raise RuntimeError(f"the rider fell on {surface!r} after {ride.time[-1]:.1f} s")
    up = ride.measurements["bicycle_imu/acc"][1:, 2]
    frequency, power = welch(up - up.mean(), RATE, nperseg=512)
    return float(up.std()), float(frequency[np.searchsorted(np.cumsum(power) / power.sum(), 0.95)])


def levels() -> dict[str, tuple[float, float]]:
    """Surface → :func:`vibration` at 12 km/h."""
    return {name: vibration(name) for name in SURFACES}


def vibration_checks(found: Mapping[str, tuple[float, float]]) -> Iterator[Check]:
    """Every surface of :func:`levels` beside what was measured."""
    for name, (deviation, bandwidth) in found.items():
        text = f"{deviation:.2f} m/s², {bandwidth:.0f} Hz"
        what = f"vertical rms and 95 % frequency of the bicycle on {name}, 12 km/h"
        if name not in MEASURED:
            yield Check(what, "–", text)
            continue
        low, high = MEASURED[name]
        holds = low <= deviation <= high and BANDWIDTH[0] <= bandwidth <= BANDWIDTH[1]
        yield Check(what, f"{low:g} … {high:g} m/s², {BANDWIDTH[0]:.0f} … {BANDWIDTH[1]:.0f} Hz", text, holds)
