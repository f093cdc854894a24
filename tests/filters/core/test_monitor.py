"""Starts that go wrong: whatever the first samples are, attitude and heading are found."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import metrics, rotation
from poise.filters.core.averages import SETTLED
from poise.filters.core.estimator import run_by_steps
from poise.filters.core.monitor import FORCE, INFLATION, TIME
from poise.filters.registry import make

FILTERS = ["external-acceleration", "mekf", "mekf-9", "bounded-motion", "bounded-motion-9"]
REFERENCES = ["mahony", "mahony-9", "marins", "array-orientation-imu"]
"""Methods whose error in ordinary motion is of the size of what a bad start may leave."""
CORRUPTIONS = ["zeros", "missing", "random", "scaled", "reversed", "huge", "force", "field"]


@cache
def motion(gesture: str) -> Trajectory:
    return simulate_hand(gesture, 5, rate=100.0, duration=25.0)


def upside_down(trajectory: Trajectory) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """The same recording by a device that is mounted the other way up, and its orientation."""
    turned = {name: array * [1.0, -1.0, -1.0] for name, array in trajectory.measurements.items()}
    return turned, rotation.multiply(trajectory.truth["orientation"], np.array([0.0, 1.0, 0.0, 0.0]))


def corrupted(data: dict[str, np.ndarray], kind: str, count: int, seed: int) -> dict[str, np.ndarray]:
    rng, result = np.random.default_rng(seed), {}
    for name, array in data.items():
        array = array.copy()
        direction = rng.normal(size=(count, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        size = {"imu/gyr": 5.0, "imu/acc": 9.8, "imu/mag": np.linalg.norm(array[0])}[name]
        if kind in ("zeros", "missing", "huge"):
            array[:count] = {"zeros": 0.0, "missing": np.nan, "huge": 1e15}[kind]
        elif kind == "scaled":
            array[:count] *= 57.3
        elif kind == "reversed" and name != "imu/gyr":
            array[:count] *= -1.0
        elif kind == "turned" and name != "imu/gyr":
            array[:count] *= [-1.0, 1.0, -1.0]
        elif kind == "random" or (kind, name) in (("force", "imu/acc"), ("field", "imu/mag")):
            array[:count] = size * direction
        result[name] = array
    return result


def errors(name: str, data: dict[str, np.ndarray], q: np.ndarray) -> tuple[float, float]:
    """Largest errors in degrees: of the inclination from 10 to 12 s, of orientation and heading from 20 to 22 s."""
    pose = make(name, dt=0.01).run(data).pose  # type: ignore[attr-defined]
    lean = np.degrees(metrics.direction_error(pose["up"], rotation.up_in_body(q)))
    turn = 0.0
    if "orientation" in pose:
        turned = rotation.angle(rotation.multiply(pose["orientation"], rotation.conjugate(q)))
        turn = float(np.max(np.degrees(turned[2000:2200])))
    return float(np.max(lean[1000:1200])), turn


@pytest.mark.parametrize("kind", CORRUPTIONS)
@pytest.mark.parametrize("name", FILTERS)
def test_bad_first_samples_decide_nothing(name: str, kind: str) -> None:
    for index, (gesture, count) in enumerate([("slow", 1), ("slow", 20), ("mixed", 3)]):
        trajectory = motion(gesture)
        data, q = upside_down(trajectory)
        if index == 1:
            data, q = dict(trajectory.measurements), trajectory.truth["orientation"]
        lean, turn = errors(name, corrupted(data, kind, count, index), q)
        usual, usual_turn = errors(name, data, q)
        assert lean < max(5.0, usual + 1.0), (gesture, count)
        assert turn < max(15.0, usual_turn + 3.0), (gesture, count)


@pytest.mark.parametrize("kind", ["random", "reversed", "force", "field"])
@pytest.mark.parametrize("name", REFERENCES)
def test_bad_first_samples_of_references_decide_nothing(name: str, kind: str) -> None:
    trajectory = motion("slow")
    data, q = dict(trajectory.measurements), trajectory.truth["orientation"]
    usual, usual_turn = errors(name, data, q)
    for count, most in ((1, 5.0), (3, 5.0), (20, 8.0)):
        lean, turn = errors(name, corrupted(data, kind, count, 3), q)
        assert lean < max(most, usual + 1.0), count
        assert turn < max(15.0, usual_turn + 3.0), count


@pytest.mark.parametrize("gesture", ["slow", "mixed"])
@pytest.mark.parametrize("name", ["marins", "array-orientation-imu", "mekf-9"])
def test_a_wrong_start_of_equations_that_keep_its_field_is_left_within_ten_seconds(name: str, gesture: str) -> None:
    """Their magnetometer does not see an error about the direction of the field, and a wrong dip stays."""
    trajectory, estimator = motion(gesture), make(name, dt=0.01)
    q = trajectory.truth["orientation"]

    def error(data: dict[str, np.ndarray]) -> float:
        found: Any = estimator.run(data)  # type: ignore[attr-defined]
        angle = rotation.angle(rotation.multiply(found.pose["orientation"], rotation.conjugate(q)))
        return float(np.degrees(np.sqrt(np.mean(angle[1000:1500] ** 2))))

    usual = error(dict(trajectory.measurements))
    for kind, count in [
        ("random", 5),
        ("reversed", 20),
        ("reversed", 100),
        ("force", 100),
        ("random", 100),
        ("turned", 150),
    ]:
        assert error(corrupted(dict(trajectory.measurements), kind, count, 3)) < usual + 5.0, (kind, count)


@pytest.mark.parametrize(
    ("name", "gesture", "seed", "count", "axis", "channels"),
    [
        ("mekf", "slow", 21, 120, (1.75, 0.0, 0.0), ("imu/gyr", "imu/acc")),
        ("mekf", "slow", 21, 200, (0.0, 2.6, 0.0), ("imu/acc",)),
        ("bounded-motion", "mixed", 22, 200, (0.0, 2.6, 0.0), ("imu/acc",)),
        ("bounded-motion-9", "slow", 21, 250, (0.7, 1.4, 0.7), ("imu/gyr", "imu/acc", "imu/mag")),
    ],
)
def test_a_device_that_lay_otherwise_for_seconds_is_followed_within_ten(
    name: str, gesture: str, seed: int, count: int, axis: tuple[float, ...], channels: tuple[str, ...]
) -> None:
    """Averages that mix both directions hide the contradiction until the filter has taken it for a bias."""
    trajectory = simulate_hand(gesture, seed, rate=100.0, duration=20.0)
    data = {channel: array.copy() for channel, array in trajectory.measurements.items()}
    for channel in channels:
        data[channel][:count] = rotation.rotate(rotation.exp(np.array(axis)), data[channel][:count])
    found: Any = make(name, dt=0.01).run(data)  # type: ignore[attr-defined]
    error = np.degrees(metrics.direction_error(found.pose["up"], trajectory.truth_of("up")))
    assert error[1000:].max() < 5.0
    # sooner than a contradiction that no change of the forces shows
    assert error[550:].max() < 10.0


def test_averages_do_not_depend_on_the_equations() -> None:
    data = {name: array[:300] for name, array in motion("slow").measurements.items()}
    found = [make(name, dt=0.01).run_from(None, data)[1].monitor[:4] for name in ("mekf-9", "marins")]  # type: ignore[attr-defined]
    np.testing.assert_allclose(*found, rtol=1e-9)


def test_a_swinging_arm_does_not_keep_an_average_from_being_trusted() -> None:
    """The force of each half of a swing contradicts the average of the other."""
    estimator: Any = make("mekf-9", dt=0.01)
    time = np.arange(1500) / 100.0
    angle = 0.9 * np.sin(2.0 * np.pi * 0.8 * time)
    q = rotation.exp(np.stack([angle, 0.0 * angle, 0.0 * angle], axis=-1))
    # A device on a rope feels no force across it.
    force = 9.81 * np.stack([0.0 * angle, 0.0 * angle, np.cos(angle)], axis=-1)
    field = rotation.rotate_back(q, np.tile([20.0, 0.0, -40.0], (1500, 1)))
    data = {"imu/gyr": np.gradient(angle, 0.01)[:, None] * [1.0, 0.0, 0.0], "imu/acc": force, "imu/mag": field}
    state, times = estimator.init({name: array[0] for name, array in data.items()}), []
    for row in range(1500):
        state, _ = estimator.step(state, {name: array[row] for name, array in data.items()})
        times.append(float(state.monitor[TIME]))
    assert np.mean(np.array(times[300:]) >= SETTLED) > 0.6


@pytest.mark.parametrize("name", ["marins", "array-orientation-imu"])
def test_a_magnetometer_that_is_calibrated_meanwhile_is_followed(name: str) -> None:
    """Phones do so some seconds after the start: another field, half as strong, from one sample to the next."""
    trajectory, estimator = motion("slow"), make(name, dt=0.01)
    q, data = trajectory.truth["orientation"], dict(trajectory.measurements)
    field = data["imu/mag"].copy()
    field[:600] += np.linalg.norm(field[0]) * np.array([1.2, -0.9, 0.6])

    def error(samples: dict[str, np.ndarray]) -> float:
        found: Any = estimator.run(samples)  # type: ignore[attr-defined]
        angle = rotation.angle(rotation.multiply(found.pose["orientation"], rotation.conjugate(q)))
        return float(np.degrees(np.sqrt(np.mean(angle[1100:1500] ** 2))))

    assert error(data | {"imu/mag": field}) < error(data) + 5.0


@pytest.mark.parametrize("name", ["mekf", "bounded-motion-9"])
def test_averages_leave_out_the_bias_that_was_estimated(name: str) -> None:
    """A phone's 5.6 degrees per second, about an axis across, turn an average of three seconds by 15 degrees."""
    estimator: Any = make(name, dt=0.01, bias_prior=0.1)
    data = {
        "imu/gyr": np.tile([0.098, 0.0, 0.0], (4000, 1)),
        "imu/acc": np.tile([0.0, 0.0, 9.81], (4000, 1)),
        "imu/mag": np.tile([0.0, 20.0, -40.0], (4000, 1)),
    }
    estimate, state = estimator.run_from(None, {channel.name: data[channel.name] for channel in estimator.channels})
    assert np.degrees(metrics.direction_error(estimate.pose["up"][-1], np.array([0.0, 0.0, 1.0]))) < 1.0
    force = state.monitor[FORCE]
    assert np.degrees(np.arccos(force[2] / np.linalg.norm(force))) < 2.0


@pytest.mark.parametrize("glitch", [400.0, 1e3, 1.9e3])
@pytest.mark.parametrize("name", [*FILTERS, *REFERENCES])
def test_a_force_that_no_motion_explains_is_no_sample(name: str, glitch: float) -> None:
    trajectory, estimator = motion("slow"), make(name, dt=0.01)
    data = {channel: array.copy() for channel, array in trajectory.measurements.items()}
    data["imu/acc"][[700, 1001]] = np.nan
    absent: Any = estimator.run(data)  # type: ignore[attr-defined]
    data["imu/acc"][700], data["imu/acc"][1001] = [0.0, glitch, 5.0], -glitch
    given = data["imu/acc"].copy()
    found: Any = estimator.run(data)  # type: ignore[attr-defined]
    for quantity, values in absent.pose.items():
        np.testing.assert_array_equal(found.pose[quantity], values)
    np.testing.assert_array_equal(data["imu/acc"], given)


def test_a_force_that_lasts_is_a_motion() -> None:
    trajectory, estimator = motion("slow"), make("bounded-motion", dt=0.01)
    data = {channel: array.copy() for channel, array in trajectory.measurements.items()}
    data["imu/acc"][700:800] += [0.0, 0.0, 400.0]
    force: Any = estimator.run(data)  # type: ignore[attr-defined]
    assert np.linalg.norm(force.pose["external_acceleration"][720:800], axis=1).min() > 300.0


@pytest.mark.parametrize("name", FILTERS)
def test_a_motion_in_the_first_second_is_no_bad_start(name: str) -> None:
    """Half a second of rest, then the hand is flung up and checked: for a moment the force points down."""
    time = np.arange(800) / 100.0
    thrust = np.where((time > 0.5) & (time < 0.6), 20.0, np.where((time > 0.6) & (time < 0.7), -20.0, 0.0))
    data = {
        "imu/gyr": np.zeros((800, 3)),
        "imu/acc": np.tile([0.0, 0.0, 9.81], (800, 1)),
        "imu/mag": np.tile([0.0, 20.0, -40.0], (800, 1)),
    }
    data["imu/acc"][:, 2] += thrust
    assert data["imu/acc"][65, 2] < -9.0
    estimator: Any = make(name, dt=0.01)
    up = estimator.run({channel.name: data[channel.name] for channel in estimator.channels}).pose["up"]
    assert np.degrees(np.arccos(up[:, 2].min())) < 45.0


@pytest.mark.parametrize("name", FILTERS)
def test_nothing_happens_on_ordinary_data(name: str) -> None:
    for gesture in ("slow", "mixed", "severe"):
        trajectory, estimator = motion(gesture), make(name, dt=0.01)
        for one, other in zip(
            estimator.run(trajectory.measurements).pose.values(),  # type: ignore[attr-defined]
            replace(estimator, restart=False).run(trajectory.measurements).pose.values(),  # type: ignore[type-var]
            strict=True,
        ):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", ["mekf-9", "bounded-motion", "mahony-9", "gyroscope-integration", "marins"])
@pytest.mark.parametrize("kind", ["reversed", "random"])
def test_a_restart_is_the_same_in_every_form(name: str, kind: str) -> None:
    data, _ = upside_down(motion("slow"))
    data = {channel: array[:300] for channel, array in corrupted(data, kind, 5, 0).items()}
    data["imu/acc"][200] = 500.0
    estimator: Any = make(name, dt=0.01)
    whole, arrays = estimator.run(data), replace(estimator, compiled=False).run(data)
    without = replace(estimator, restart=False).run(data)
    assert np.abs(whole.pose["up"] - without.pose["up"]).max() > 0.1
    np.testing.assert_allclose(whole.pose["up"], arrays.pose["up"], atol=1e-9)
    np.testing.assert_allclose(run_by_steps(estimator, data).pose["up"], whole.pose["up"], atol=1e-12)
    batch = {channel: np.stack([array, array[::-1]], axis=1) for channel, array in data.items()}
    np.testing.assert_allclose(estimator.run(batch).pose["up"][:, 0], whole.pose["up"], atol=1e-12)


def test_the_covariance_of_a_restart_is_larger_than_that_of_a_start() -> None:
    data, _ = upside_down(motion("slow"))
    estimator: Any = make("mekf", dt=0.01)
    covariance = estimator.run(corrupted(data, "reversed", 150, 0)).covariance[:, 0, 0]
    again = int(np.argmax(np.diff(covariance))) + 1
    assert again * 0.01 < 6.0
    assert covariance[again] == pytest.approx(INFLATION * covariance[0])


@pytest.mark.parametrize("name", ["mahony", "mahony-9", "marins", "array-orientation-imu"])
def test_zeros_in_between_leave_no_trace_that_lasts(name: str) -> None:
    trajectory = motion("slow")
    data = {channel: array.copy() for channel, array in trajectory.measurements.items()}
    for array in data.values():
        array[700] = 0.0
    estimator: Any = make(name, dt=0.01)
    found, usual = estimator.run(data).pose["up"], estimator.run(trajectory.measurements).pose["up"]
    assert np.isfinite(found).all()
    assert np.degrees(metrics.direction_error(found[900:], usual[900:])).max() < 1.0
