"""A ridden bicycle vibrates on named surfaces as cargo bicycles were measured to."""

from __future__ import annotations

import pytest

from poise.baselines.studies.rides.vibration import BANDWIDTH, MEASURED, vibration


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("tarmac", *MEASURED["tarmac"]),
        ("pavers", *MEASURED["pavers"]),
        pytest.param("rough-tarmac", 1.8, 4.5, marks=pytest.mark.slow),
        pytest.param("gravel", 1.8, 7.0, marks=pytest.mark.slow),
        pytest.param("cobbles", 7.0, 15.0, marks=pytest.mark.slow),
    ],
)
def test_the_level_of_each_surface(name, low, high):
    deviation, bandwidth = vibration(name)
    assert low < deviation < high
    assert BANDWIDTH[0] < bandwidth < (BANDWIDTH[1] if name != "cobbles" else 80.0)


def test_a_hall_floor_adds_little_to_what_pedalling_shakes():
    smooth, hall = (vibration(name, 3.0, fidelity="lumped")[0] for name in ("smooth", "hall"))
    assert smooth < 0.3
    assert 1.2 * smooth < hall < 0.6
