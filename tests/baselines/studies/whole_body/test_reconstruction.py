"""Points of rider and bicycle in space: limbs have their lengths and end where hands and feet are."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.studies.whole_body.motion import ExactRide
from poise.baselines.studies.whole_body.reconstruction import skeleton
from poise.baselines.studies.whole_body.speed import by_speed, speed_claims, squares_by_speed
from poise.baselines.studies.whole_body.states import true_angles_state, true_states
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.bicycle.whole_body.filter import WholeBody
from poise.filters.bicycle.whole_body.linkage import true_angles

GEOMETRY = RiderGeometry()


@pytest.fixture(scope="module")
def ride():
    return ExactRide(GEOMETRY, "outdoor", seed=2).record(3.0)


@pytest.mark.parametrize("index", [0, 120, 299])
def test_limbs_have_their_lengths(ride, index):
    pose = {name: values[index] for name, values in true_angles(ride.truth).items()}
    lines = skeleton(GEOMETRY, pose, ride.truth["bicycle/steer"][index], ride.truth["bicycle/crank"][index])
    for side in ("right", "left"):
        arm, leg = (np.linalg.norm(np.diff(lines[f"{limb} {side}"], axis=0), axis=1) for limb in ("arm", "leg"))
        np.testing.assert_allclose(arm, [GEOMETRY.upper_arm, GEOMETRY.forearm], atol=1e-9)
        assert leg[0] == pytest.approx(GEOMETRY.thigh)
    # both wheels touch the ground, which the roll about the contact line leaves where it is
    for wheel in ("rear wheel", "front wheel"):
        assert abs(lines[wheel][:, 2].min()) < 0.01
    assert lines["trunk"][-1, 2] > 1.5


def test_a_roll_to_the_right_moves_the_head_to_the_right(ride):
    pose = {name: values[0].copy() for name, values in true_angles(ride.truth).items()}
    steer, crank = np.zeros(1), np.zeros(1)
    upright = skeleton(GEOMETRY, {**pose, "bicycle/roll": np.zeros(1)}, steer, crank)
    leaned = skeleton(GEOMETRY, {**pose, "bicycle/roll": np.array([0.2])}, steer, crank)
    assert leaned["trunk"][-1, 1] < upright["trunk"][-1, 1] - 0.2


def test_true_states_remember_as_the_filter_does(ride):
    model = WholeBody.for_rider(GEOMETRY)
    read = {channel.name: ride.measurements[channel.name] for channel in model.channels}
    x = true_states(model, read, ride.truth)
    np.testing.assert_array_equal(x[:, :20], true_angles_state(ride.truth))
    now, before = ({name: values[k] for name, values in read.items()} for k in (50, 49))
    np.testing.assert_allclose(model.predict(x[49], now, before)[0][20:], x[50, 20:], atol=1e-12)


def test_errors_are_sorted_by_speed():
    ride = ExactRide(GEOMETRY, "outdoor", seed=0, constant_speed=3.0).record(16.0)
    np.testing.assert_allclose(ride.truth["bicycle/speed"], 3.0)
    found = squares_by_speed(ride, {"φ": np.full(len(ride), 2.0)})
    assert list(found) == ["2–3.5 m/s"]
    assert by_speed([{"speeds": found}, {"speeds": found}]) == {"2–3.5 m/s": {"φ": 2.0}}
    rows = {name: dict.fromkeys(true_names(), size) for name, size in (("slow", 1.0), ("fast", 3.0))}
    assert [claim.holds for claim in speed_claims(rows)] == [False, False, False]


def true_names():
    from poise.baselines.studies.whole_body.angles import STATES

    return list(STATES)
