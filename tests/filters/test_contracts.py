"""What every estimator of the catalogue promises, whatever its method."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from poise.filters import metrics, rotation
from poise.filters.catalogue import CATALOGUE, make
from poise.filters.estimator import Estimator, run, run_by_steps
from poise.filters.quantity import Estimate

Data = dict[str, np.ndarray]

OWN = [name for name, entry in CATALOGUE.items() if entry.recursion]
CHANNELS = {"imu/gyr": 3, "imu/acc": 3, "imu/mag": 3}
FIELD = np.array([0.0, 20.0, -45.0])
# Rounding is amplified by what a filter feeds back; the network of an external package computes in single precision.
ROUNDING = 1e-8


def motion(seed: int, length: int = 80, dt: float = 0.01) -> tuple[Data, np.ndarray]:
    """Samples of a turning sensor that is shaken, and its orientation."""
    rng = np.random.default_rng(seed)
    rate = rng.normal(0.0, 1.0, 3) + np.cumsum(rng.normal(0.0, 0.2, (length, 3)), axis=0)
    q = [rotation.exp(rng.normal(0.0, 0.5, 3))]
    for omega in rate[1:]:
        q.append(rotation.multiply(q[-1], rotation.exp(dt * omega)))
    orientation = np.array(q)
    force = rotation.rotate_back(orientation, np.array([0.0, 0.0, 9.81])[None])
    force = force + np.sin(np.arange(length)[:, None] * 0.3 + rng.uniform(0, 6, 3))
    return {
        "imu/gyr": rate + rng.normal(0.0, 0.01, rate.shape),
        "imu/acc": force + rng.normal(0.0, 0.05, force.shape),
        "imu/mag": rotation.rotate_back(orientation, FIELD[None]) + rng.normal(0.0, 0.3, force.shape),
    }, orientation


def with_gaps(data: Data, seed: int = 9) -> Data:
    """The same with missing samples of every channel, after the first."""
    rng, result = np.random.default_rng(seed), {}
    for name, array in data.items():
        array = array.copy()
        array[1:][rng.random(array[1:].shape[:-1]) < 0.2] = np.nan
        result[name] = array
    return result


def of_channels(estimator: Estimator[Any], data: Data) -> Data:
    return {channel.name: data[channel.name] for channel in estimator.channels}


def assert_same(first: Estimate, second: Estimate, tolerance: float = ROUNDING) -> None:
    assert first.pose.keys() == second.pose.keys()
    for name in first.pose:
        np.testing.assert_allclose(first.pose[name], second.pose[name], atol=tolerance, rtol=tolerance, err_msg=name)
    for one, other in zip(first[1:], second[1:], strict=True):
        assert (one is None) == (other is None)
        if one is not None:
            np.testing.assert_allclose(one, other, atol=tolerance, rtol=tolerance)


@pytest.fixture(params=list(CATALOGUE))
def name(request: pytest.FixtureRequest) -> str:
    entry = CATALOGUE[request.param]
    if entry.kind == "external":
        pytest.importorskip(entry.load().package)  # type: ignore[attr-defined]
    return str(request.param)


@pytest.fixture
def estimator(name: str) -> Estimator[Any]:
    return make(name, dt=0.01)


def test_catalogue_tells_the_truth(name: str, estimator: Estimator[Any]) -> None:
    entry = CATALOGUE[name]
    assert isinstance(estimator, Estimator)
    assert entry.channels == tuple(channel.name for channel in estimator.channels)
    assert entry.outputs == tuple(quantity.name for quantity in estimator.outputs)
    estimate = run(estimator, motion(0)[0])
    assert set(estimate.pose) == set(entry.outputs)
    for quantity in estimator.outputs:
        assert estimate.pose[quantity.name].shape == (80, quantity.size)
        if quantity.kind in ("rotation", "direction"):
            np.testing.assert_allclose(np.linalg.norm(estimate.pose[quantity.name], axis=-1), 1.0, atol=1e-6)


@pytest.mark.parametrize("gaps", [False, True], ids=["complete", "gaps"])
def test_run_is_stepping(estimator: Estimator[Any], gaps: bool) -> None:
    data = of_channels(estimator, motion(1)[0])
    data = with_gaps(data) if gaps else data
    assert_same(run(estimator, data), run_by_steps(estimator, data), 1e-12)


def test_a_batch_is_its_sequences(estimator: Estimator[Any]) -> None:
    singles = [with_gaps(motion(seed)[0], seed) for seed in (2, 3, 4, 5)]
    batch = {channel: np.stack([single[channel] for single in singles], axis=1) for channel in CHANNELS}
    batch = {channel: array.reshape(80, 2, 2, 3) for channel, array in batch.items()}
    together = run(estimator, batch)
    for index, single in enumerate(singles):
        alone = run(estimator, single)
        for quantity, value in alone.pose.items():
            np.testing.assert_allclose(together.pose[quantity][:, index // 2, index % 2], value, atol=1e-9)


def test_input_and_state_are_left_alone(estimator: Estimator[Any]) -> None:
    data = of_channels(estimator, motion(6)[0])
    copies = {channel: array.copy() for channel, array in data.items()}
    state = estimator.init({channel: array[0] for channel, array in data.items()})
    for t in range(10):
        state, _ = estimator.step(state, {channel: array[t] for channel, array in data.items()})
    sample = {channel: array[10] for channel, array in data.items()}
    _, first = estimator.step(state, sample)
    estimator.step(state, {channel: array + 0.1 for channel, array in sample.items()})
    _, again = estimator.step(state, sample)
    assert_same(first, again, 0.0)
    for channel, array in copies.items():
        np.testing.assert_array_equal(data[channel], array)


def test_saving_midway_changes_nothing(estimator: Estimator[Any]) -> None:
    data = with_gaps(of_channels(estimator, motion(7)[0]))
    whole = run_by_steps(estimator, data)
    state = estimator.init({channel: array[0] for channel, array in data.items()})
    for t in range(80):
        if t == 33:
            state = pickle.loads(pickle.dumps(state))
        state, estimate = estimator.step(state, {channel: array[t] for channel, array in data.items()})
    for quantity, value in estimate.pose.items():
        np.testing.assert_array_equal(value, whole.pose[quantity][-1])


def test_nothing_is_said_before_every_channel_spoke(estimator: Estimator[Any]) -> None:
    data = of_channels(estimator, motion(8)[0])
    data["imu/acc"] = data["imu/acc"].copy()
    data["imu/acc"][:12] = np.nan
    pose = run(estimator, data).pose
    for value in pose.values():
        assert np.isnan(value[:12]).all()
        assert np.isfinite(value[12:]).all()


def test_another_interval(name: str, estimator: Estimator[Any]) -> None:
    other = estimator.with_dt(0.02)
    assert (estimator.dt, other.dt) == (0.01, 0.02)
    data = motion(9, dt=0.02)[0]
    assert_same(run(other, data), run(make(name, dt=0.02), data), 0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: {channel: array for channel, array in data.items() if channel != "imu/acc"}, "lack the channels"),
        (lambda data: data | {"imu/acc": data["imu/acc"][:, :2]}, "must have shape"),
        (lambda data: {channel: array[:0] for channel, array in data.items()}, "empty"),
        (lambda data: data | {"imu/acc": np.full((80, 3), "x")}, "real numbers"),
    ],
    ids=["missing", "width", "empty", "text"],
)
def test_wrong_input_is_refused(estimator: Estimator[Any], change: Callable[[Data], Data], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        run(estimator, change(motion(0)[0]))


@pytest.mark.parametrize("own", OWN)
def test_arrays_torch_and_compiled_agree(own: str) -> None:
    singles = [with_gaps(motion(seed, 60)[0], seed) for seed in (10, 11)]
    data = {channel: np.stack([single[channel] for single in singles], axis=1) for channel in CHANNELS}
    compiled, arrays = run(make(own), data), run(make(own, compiled=False), data)
    assert_same(compiled, arrays)
    tensors = run(make(own), {channel: torch.from_numpy(array) for channel, array in data.items()})
    assert all(isinstance(value, torch.Tensor) for value in tensors.pose.values())
    assert_same(arrays, Estimate(*(None if part is None else part for part in tensors)))


@pytest.mark.parametrize("own", [name for name in OWN if name != "tilt"])
def test_gradients_flow(own: str) -> None:
    data = {channel: torch.from_numpy(array[:20]) for channel, array in with_gaps(motion(12)[0]).items()}
    data["imu/gyr"].nan_to_num_(0.0).requires_grad_()
    run(make(own), data).pose["up"][-1].sum().backward()
    gradient = data["imu/gyr"].grad
    assert gradient is not None
    assert bool(torch.isfinite(gradient).all())
    assert bool((gradient.abs() > 0).any())


def test_a_drop_out_leaves_the_gyroscope(name: str) -> None:
    """Without accelerometer and magnetometer every method turns as the gyroscope says, less the bias that it knows."""
    if name == "tilt":
        pytest.skip("has no gyroscope")
    estimator = make(name)
    data, _ = motion(13, 120)
    data = of_channels(estimator, data)
    for channel in data:
        if channel != "imu/gyr":
            data[channel] = data[channel].copy()
            data[channel][60:] = np.nan
    pose = run(estimator, data).pose
    bias = pose.get("gyroscope_bias", np.zeros((120, 3)))
    up = pose["up"][60]
    if name == "external-acceleration":
        estimator = replace(estimator, model=replace(estimator.model, gyroscope_sample="current"))  # type: ignore
    for t in range(61, 120):
        turn = 0.01 * (data["imu/gyr"][t] - bias[t - 1])
        up = rotation.rotate_back(rotation.exp(turn), up)
    error = float(metrics.direction_error(pose["up"][-1], up))
    # First-order integration in other packages, rest detection and the low-pass of VQF are theirs.
    assert error < (0.05 if CATALOGUE[name].kind == "external" else 1e-9)


def test_unknown_names_and_parameters_are_refused() -> None:
    with pytest.raises(ValueError, match="did you mean 'bounded-motion'"):
        make("bounded-moton")
    with pytest.raises(ValueError, match=r"unknown parameters \['nose'\] of 'mekf'.*gyroscope_noise"):
        make("mekf", nose=1.0)
    with pytest.raises(ValueError, match="axes"):
        make("vqf", axes=9)
    with pytest.raises(ValueError, match="dt must be positive"):
        make("mahony", dt=0.0)
