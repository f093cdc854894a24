"""Rides from a recipe: rebuilt bit for bit, drawn again with other errors, and mirrored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.ride.contact_forces import LoadCells
from poise.envs.bicycle.ride.truth import isb_yxy, isb_zxy
from poise.envs.bicycle.rider.limbs import three_turns
from poise.envs.bicycle.rider.posture import two_turns
from poise.envs.data.trajectory import Trajectory
from poise.envs.recipes import rides
from poise.envs.recipes.devices import VariedTiming
from poise.envs.recipes.mirror import mirrored
from poise.envs.recipes.recipe import unspawned
from poise.envs.recipes.redraw import TRUE_GEOMETRY, redrawn, turned_anew, with_errors
from poise.envs.recipes.registry import rebuilt, recipe
from poise.envs.recipes.rider import RiderRecipe, RideSensors
from poise.envs.record import record
from poise.envs.sensors.timing import Timing
from poise.filters.bicycle.geometry import TapeMeasure
from poise.filters.core import rotation

SHORT = RiderRecipe("short", duration=2.0, scenarios=("straight",), fidelity=("lumped",))


def ridden(**options: object) -> Trajectory:
    env = RiderBicycleEnv("outdoor", 1, suite="all", duration=3.0, **options)  # type: ignore[arg-type]
    try:
        return record(env, seed=4)
    finally:
        env.close()


@pytest.fixture(scope="module")
def ride() -> Trajectory:
    return ridden(sensors="ideal", soft_tissue=1.0)


def test_errors_drawn_again_are_those_of_the_environment(ride: Trajectory) -> None:
    env = RiderBicycleEnv("outdoor", 1, suite="all", duration=3.0)
    try:
        expected = record(env, seed=4)
        errors = np.random.default_rng(4).spawn(2)[1]
        env.reset(seed=4)
        found, biases = with_errors(env.suite, ride, errors)
    finally:
        env.close()
    for name, values in expected.measurements.items():
        np.testing.assert_allclose(found[name], values, rtol=0.0, atol=1e-9, err_msg=name)
    for name, values in biases.items():
        np.testing.assert_allclose(values, expected.truth[name], atol=1e-12, err_msg=name)


def test_a_bicycle_imu_that_is_turned_anew_measures_the_same_ride_in_other_axes(ride: Trajectory) -> None:
    other = turned_anew(ride, np.random.default_rng(1))
    axes = {}
    for each in (ride, other):
        (sensor,) = (one for one in each.metadata["sensors"]["sensors"] if one["channel"] == "bicycle_imu/gyr")
        axes[each is other] = np.array(sensor["rotation"])
    turn = np.degrees(2.0 * np.arccos(abs(axes[False] @ axes[True])))
    assert 0.2 < turn < 5.0
    for name, values in ride.measurements.items():
        found = other.measurements[name]
        if name.startswith("bicycle_imu/"):
            assert np.nanmax(np.abs(found - values)) > 1e-3
            values, found = rotation.rotate(axes[False], values), rotation.rotate(axes[True], found)
        np.testing.assert_allclose(found, values, rtol=0.0, atol=1e-12)
    assert np.isfinite(redrawn(other, 0).measurements["bicycle_imu/gyr"]).any()
    with pytest.raises(ValueError, match="sensors='ideal'"):
        turned_anew(redrawn(ride, 0), np.random.default_rng(1))


def test_draws_differ_in_errors_and_measured_geometry_only(ride: Trajectory) -> None:
    one, again, other = (redrawn(ride, seed, geometry=TapeMeasure()) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.measurements["trunk_imu/gyr"], again.measurements["trunk_imu/gyr"])
    error = {
        draw: each.measurements["seat/load_cells"] - ride.measurements["seat/load_cells"]
        for draw, each in (("one", one), ("other", other))
    }
    assert 0.5 < np.abs(error["one"] - error["other"]).max() < 50.0
    assert one.metadata["geometry"] != other.metadata["geometry"]
    assert one.metadata[TRUE_GEOMETRY] == ride.metadata["geometry"]
    assert TapeMeasure.of(one.metadata) == TapeMeasure()
    for name in ("bicycle/roll", "trunk/orientation"):
        np.testing.assert_array_equal(one.truth[name], ride.truth[name])
    # the camera is slower than the ideal one
    assert np.isfinite(one.measurements["relative/orientation"][:, 0]).mean() == pytest.approx(0.16, abs=0.01)
    assert np.abs(one.truth["trunk_imu/gyroscope_bias"]).max() > 0.0


def test_some_draws_are_measured_exactly(ride: Trajectory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rides, "ride", lambda *_: ride)
    source = rides.RideSource(1, 2, exact_draws=1)
    *taped, exact = rides.drawn(source, 3, 0)
    assert exact.metadata["geometry"] == exact.metadata[TRUE_GEOMETRY] == ride.metadata["geometry"]
    assert TapeMeasure.of(exact.metadata) == TapeMeasure(0.0, 0.0, 0.0)
    # the others are as without it
    for one, other in zip(taped, rides.drawn(rides.held_out(source), 3, 0), strict=True):
        assert one.metadata == other.metadata
        assert one.metadata["geometry"] != one.metadata[TRUE_GEOMETRY]
        np.testing.assert_array_equal(one.measurements["trunk_imu/gyr"], other.measurements["trunk_imu/gyr"])
    with pytest.raises(ValueError, match="exact_draws must be at least 0, got -1"):
        rides.RideSource(exact_draws=-1)


def test_only_ideal_rides_are_drawn_again(ride: Trajectory) -> None:
    drawn = redrawn(ride, 0)
    with pytest.raises(
        ValueError, match="must be recorded with sensors='ideal' to be drawn again, but bicycle_imu/gyr"
    ):
        redrawn(drawn, 1)
    with pytest.raises(ValueError, match="does not describe its sensors"):
        redrawn(ride.replace(metadata={}), 1)


@pytest.mark.parametrize("fidelity", ["full", "lumped"])
def test_a_mirrored_ride_is_consistent(fidelity: str) -> None:
    """Everything that follows from something else still does, and two mirrors give the ride back."""
    ride = ridden(sensors="ideal", fidelity=fidelity)
    seen = mirrored(ride)
    truth, measured = seen.truth, seen.measurements
    turn = rotation.multiply(rotation.conjugate(truth["bicycle/orientation"]), truth["trunk/orientation"])
    np.testing.assert_allclose(isb_zxy(turn), truth["trunk/angles"], atol=1e-9)
    np.testing.assert_allclose(
        rotation.angle(rotation.multiply(rotation.conjugate(turn), measured["relative/orientation"])), 0.0, atol=1e-7
    )
    for side in ("left", "right"):
        arm = rotation.multiply(rotation.conjugate(truth["trunk/orientation"]), truth[f"upper_arm_{side}/orientation"])
        np.testing.assert_allclose(isb_yxy(arm), truth[f"shoulder_{side}/angles"], atol=1e-9)
        leg = rotation.multiply(rotation.conjugate(truth["bicycle/orientation"]), truth[f"thigh_{side}/orientation"])
        np.testing.assert_allclose(isb_zxy(leg), truth[f"hip_{side}/angles"], atol=1e-9)
    seat = two_turns(np.concatenate([truth["pelvis/angles"], truth["pelvis/height"]], axis=1))
    pelvis = rotation.multiply(truth["bicycle/orientation"], seat)
    for index, limb in enumerate(("upper_arm_left", "upper_arm_right", "thigh_left", "thigh_right")):
        root = truth["trunk/orientation"] if "arm" in limb else pelvis
        turn = rotation.multiply(rotation.conjugate(root), truth[f"{limb}/orientation"])
        angles = truth["joints/angles"][:, 3 + 4 * index : 6 + 4 * index]
        difference = rotation.multiply(rotation.conjugate(turn), three_turns(*angles.T))
        np.testing.assert_allclose(rotation.angle(difference), 0.0, atol=1e-6, err_msg=limb)
    cells = LoadCells().share(-truth["seat/force"], -truth["seat/moment"])
    np.testing.assert_allclose(measured["seat/load_cells"][1:], cells[1:], atol=1e-6)
    np.testing.assert_allclose(
        measured["handlebar/force"][1:],
        np.concatenate([truth["handlebar/force_left"], truth["handlebar/force_right"]], axis=1)[1:],
        atol=1e-9,
    )
    yaw, pitch, roll = rotation.to_euler_zyx(truth["bicycle/orientation"])
    for name, values in (("yaw", yaw), ("pitch", pitch), ("roll", roll)):
        np.testing.assert_allclose(truth[f"bicycle/{name}"][:, 0], values, atol=1e-9)
    rate = measured["bicycle_imu/gyr"][1:] * seen.dt
    steps = rotation.log(
        rotation.multiply(rotation.conjugate(truth["bicycle/orientation"][:-1]), truth["bicycle/orientation"][1:])
    )
    np.testing.assert_allclose(rotation.norm(rate), rotation.norm(steps), atol=1e-7)
    assert not np.allclose(truth["bicycle/roll"], ride.truth["bicycle/roll"])
    back = mirrored(seen)
    for name, values in ride.measurements.items():
        np.testing.assert_allclose(back.measurements[name], values, atol=1e-12, err_msg=name)
    for name, values in back.truth.items():
        np.testing.assert_allclose(values, ride.truth[name], atol=1e-12, err_msg=name)


def test_a_magnetometer_has_no_mirror_image(ride: Trajectory) -> None:
    field = {"trunk_imu/mag": np.zeros((len(ride), 3))}
    with pytest.raises(ValueError, match="the mirror image of 'trunk_imu/mag' is not known"):
        mirrored(ride.replace(measurements=field))


def test_an_episode_is_rebuilt_bit_for_bit() -> None:
    episode = SHORT.episode(1, 0)
    again = rebuilt(episode)
    assert again.metadata == episode.metadata
    for name, values in episode.measurements.items():
        np.testing.assert_array_equal(again.measurements[name], values, err_msg=name)
    for name, values in episode.truth.items():
        np.testing.assert_array_equal(again.truth[name], values, err_msg=name)
    more = SHORT.sensed(SHORT.ride(unspawned(5)), 9)
    assert more.metadata["devices"] in SHORT.sensors.devices


def test_settings_are_drawn_from_what_the_recipe_names() -> None:
    made = replace(SHORT, scenarios=("straight", "slalom"), styles=("mild", "normal"), subjects=(0, "random"))
    drawn = [made.options(np.random.SeedSequence(index)) for index in range(40)]
    for name, values in (("scenario", made.scenarios), ("style", made.styles), ("subject", made.subjects)):
        assert {each[name] for each in drawn} == set(values)
    # what is added to one choice leaves the others as they are
    more = replace(made, surfaces=("tarmac", "cobbles"))
    for index, each in enumerate(drawn):
        other = more.options(np.random.SeedSequence(index))
        assert other.pop("surface") in more.surfaces
        assert other == {name: value for name, value in each.items() if name != "surface"}


@pytest.mark.parametrize(
    ("described", "message"),
    [
        ({"scenarios": ["ice"]}, "unknown scenario"),
        ({"sensors": {"timing": {"late_share": 2.0}}}, r"late_share must lie in \[0, 1\], got 2.0"),
        ({"scenarios": []}, "scenarios must hold one name at least"),
        ({"bicycles": ["tricycle"]}, "bicycles must be among .*got 'tricycle'"),
        ({"surfaces": ["ice"]}, "surfaces must be among .*got 'ice'"),
        ({"subjects": [7]}, "subjects must be among .*got 7"),
        ({"sensors": {"devices": ["phone"]}}, "devices must be among .*got 'phone'"),
        ({"sensors": {"tape": {"lengths": -1.0}}}, "recipe.sensors.tape: lengths"),
        ({"suite": ["everything"]}, "suite must be one of"),
    ],
)
def test_wrong_fields_are_named(described: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        recipe({"kind": "rider", **described})


def test_sensors_of_a_grade_have_errors_of_that_size(ride: Trajectory) -> None:
    small, large = (redrawn(ride, 3, noise_scale=scale) for scale in (1.0, 2.0))
    name = "trunk_imu/gyroscope_bias"
    np.testing.assert_allclose(large.truth[name], 2.0 * small.truth[name], rtol=1e-9)
    assert RideSensors().mirrored_share == 0.5


def test_late_readings_of_a_draw_are_those_of_the_environment(ride: Trajectory) -> None:
    timing = {
        "trunk_imu": Timing(delay=0.01),
        "seat": Timing(delay=0.025, jitter=0.002, clock_drift=1e-4),
        "relative": Timing(delay=0.06, burst_rate=2.0),
        "steer": Timing(delay=0.0037),
    }
    env = RiderBicycleEnv("outdoor", 1, suite="all", duration=3.0, timing=timing)
    try:
        expected = record(env, seed=4)
        found, _ = with_errors(env.suite, ride, np.random.default_rng(4).spawn(2)[1])
    finally:
        env.close()
    for name, values in expected.measurements.items():
        # ideal interval readings begin a sample later than the motion, of which the environment knows all
        np.testing.assert_allclose(found[name][12:], values[12:], rtol=0.0, atol=1e-6, err_msg=name)


def test_timing_is_drawn_with_its_shares() -> None:
    drawn = [VariedTiming().draw(np.random.default_rng(seed)) for seed in range(400)]
    assert np.mean([each.delay > 0.0 for each in drawn]) == pytest.approx(0.3, abs=0.06)
    assert np.mean([each.burst_rate > 0.0 for each in drawn]) == pytest.approx(0.15, abs=0.05)
