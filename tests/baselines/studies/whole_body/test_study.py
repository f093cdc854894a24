"""How the whole-body study counts errors, and what it makes of recorded rides."""

import numpy as np
import pytest

from poise.baselines.studies import find_paper
from poise.baselines.studies.averages import windowed
from poise.baselines.studies.sensors import without_errors
from poise.baselines.studies.whole_body.angles import ANGLES, TABLE_III, short
from poise.baselines.studies.whole_body.motion import IDEAL, ExactRide, SensorErrors
from poise.baselines.studies.whole_body.rides import INERTIAL, RIDES, with_trunk_on_the_seat
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.bicycle.whole_body.linkage import true_angles

GEOMETRY = RiderGeometry()


@pytest.fixture(scope="module")
def ride():
    return ExactRide(GEOMETRY, "indoor", seed=1).record(2.0, errors=IDEAL)


def test_the_published_table_has_a_value_for_every_angle():
    for course in ("indoor", "outdoor"):
        values = TABLE_III[course]
        assert list(values) == list(ANGLES)
        assert len(values) == 20
        assert all(0.5 < float(value.split("±")[0]) < 7.0 for value in values.values())
    assert TABLE_III["indoor"]["βr"] == "5.01±1.22"
    assert TABLE_III["outdoor"]["ψl3"] == "6.34±2.13"
    assert find_paper("whole-body").__module__.endswith("studies.whole_body.study")


def test_errors_are_degrees_by_column(ride):
    pose = {name: value.copy() for name, value in true_angles(ride.truth).items()}
    pose["hip_left/angles"][:, 1] += np.radians(3.0) + 2.0 * np.pi
    size = windowed(RIDES.errors(pose, true_angles(ride.truth)), ride.time, 1.0)
    assert size["ψl2"] == pytest.approx(3.0)
    assert sum(size.values()) == pytest.approx(3.0)
    assert short(size)["Ψl"] == "0.00 3.00 0.00"


def test_biases_are_taken_away_where_they_are_known(ride):
    place = "thigh_right/gyr"
    biased = ride.replace(
        measurements={**ride.measurements, place: ride.measurements[place] + 0.1},
        truth={**ride.truth, "thigh_right/gyroscope_bias": np.full((len(ride), 3), 0.1)},
    )
    for name, values in without_errors(biased, unbiased=INERTIAL).items():
        np.testing.assert_allclose(values, ride.measurements[name], atol=1e-12)


def test_a_seat_that_carries_the_trunk_is_that_of_an_exact_ride(ride):
    """Load cells made from the true angles are those of the simulated ride, to what the rate's derivative adds."""
    noisy = ExactRide(GEOMETRY, "indoor", seed=1).record(2.0, errors=SensorErrors(torque=50.0))
    exact = ride.measurements["seat/load_cells"] @ [0.0, 1.0, -1.0]
    made = with_trunk_on_the_seat(ride)["seat/load_cells"] @ [0.0, 1.0, -1.0]
    spoiled = noisy.measurements["seat/load_cells"] @ [0.0, 1.0, -1.0]
    assert np.std(made - exact) < 0.05 * np.std(spoiled - exact)
