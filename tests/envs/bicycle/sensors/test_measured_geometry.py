"""The geometry that filters are told, against the rider that rides."""

from __future__ import annotations

import json
from dataclasses import fields

import numpy as np
import pytest

from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE
from poise.envs.bicycle.rider.anthropometry import RiderBody
from poise.envs.bicycle.rider.limbs import reach_to
from poise.envs.bicycle.rider.posture import KNEE_OUT, sit
from poise.envs.bicycle.sensors.measured_geometry import measured, rider_geometry
from poise.filters.bicycle.geometry import GEOMETRY_STD, RiderGeometry, TapeMeasure
from poise.filters.core import rotation

POSTURE = sit(MOUNTAIN_BIKE, RiderBody())


def test_defaults_are_the_usual_rider() -> None:
    found, default = rider_geometry(POSTURE), RiderGeometry()
    for field in fields(RiderGeometry):
        value = getattr(found, field.name)
        np.testing.assert_allclose(value, getattr(default, field.name), atol=1e-4, err_msg=field.name)


def test_the_foot_is_where_the_lengths_say() -> None:
    geometry = rider_geometry(POSTURE)
    for crank in np.linspace(0.0, 6.0, 7):
        held = reach_to(POSTURE.leg, POSTURE.leg_target("left", crank), KNEE_OUT)
        knee = np.array(geometry.hip) + rotation.rotate(held.upper, np.array([0.0, 0.0, -geometry.thigh]))
        pedal = POSTURE.pedal("left", crank)
        assert np.linalg.norm(pedal - knee) == pytest.approx(geometry.knee_to_pedal, abs=1e-9)


def test_json_and_back() -> None:
    geometry = rider_geometry(POSTURE)
    assert RiderGeometry.read(json.loads(json.dumps(geometry.describe()))) == geometry


def test_measuring_errs_as_it_says() -> None:
    geometry = rider_geometry(POSTURE)
    drawn = [measured(geometry, np.random.default_rng(seed)) for seed in range(300)]
    assert np.std([each.thigh / geometry.thigh for each in drawn]) == pytest.approx(0.02, rel=0.15)
    assert np.std([each.hip[0] for each in drawn]) == pytest.approx(0.01, rel=0.15)
    assert measured(geometry, np.random.default_rng(0), TapeMeasure(0.0, 0.0, 0.0)) == geometry


def test_metadata_say_how_exactly_it_was_measured() -> None:
    assert TapeMeasure.of({}) == TapeMeasure()
    assert TapeMeasure.of({GEOMETRY_STD: {"lengths": 0.005}}) == TapeMeasure(lengths=0.005)
    with pytest.raises(ValueError, match=r"geometry_std must map some of .*'places'.*got \{'hips': 0"):
        TapeMeasure.of({GEOMETRY_STD: {"hips": 0.0}})
    with pytest.raises(ValueError, match="geometry_std must map some of"):
        TapeMeasure.of({GEOMETRY_STD: 0.0})
    for wrong in (-1.0, np.inf, np.nan, "1 cm", None):
        with pytest.raises(ValueError, match="places must"):
            TapeMeasure.of({GEOMETRY_STD: {"places": wrong}})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"thigh": 0.0}, "thigh"),
        ({"hip": (1.0, np.nan, 0.0)}, "hip"),
        ({"trunk_flexion": (1.0, 2.0, 3.0)}, "trunk_flexion must be a number"),
        ({"steer_axis": (0.0, 0.0, 2.0)}, "steer_axis must have length 1"),
    ],
)
def test_impossible_geometry_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        RiderGeometry(**change)  # type: ignore[arg-type]


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ValueError, match="femur"):
        RiderGeometry.read({"femur": 0.4})
