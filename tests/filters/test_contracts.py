"""What every registered filter promises, whatever its method and whatever it reads."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from poise.filters.core import metrics, rotation
from poise.filters.core.estimator import Estimator, run, run_by_steps
from poise.filters.core.quantity import Estimate
from poise.filters.registry import FILTERS, make

Data = dict[str, np.ndarray]
Motion = Callable[..., Data]

OWN = [name for name, entry in FILTERS.items() if entry.runner]
SINGLE_IMU = [
    name
    for name, entry in FILTERS.items()
    if {"imu/acc"} <= set(entry.channels) <= {"imu/gyr", "imu/acc", "imu/mag"} and "up" in entry.outputs
]
STRAPDOWN = [
    name
    for name in SINGLE_IMU
    # where the angular rate is a state, it follows the gyroscope with a lag
    if "imu/gyr" in FILTERS[name].channels and "angular_rate" not in FILTERS[name].outputs
]
"""Methods whose attitude turns as the gyroscope says."""
# Rounding is amplified by what a filter feeds back; the network of an external package computes in single precision.
ROUNDING = 1e-8


def with_gaps(data: Data, seed: int = 9) -> Data:
    """The same with missing samples of every channel, after the first."""
    rng, result = np.random.default_rng(seed), {}
    for name, array in data.items():
        array = array.copy()
        array[1:][rng.random(array[1:].shape[:-1]) < 0.2] = np.nan
        result[name] = array
    return result


def assert_same(first: Estimate, second: Estimate, tolerance: float = ROUNDING) -> None:
    assert first.pose.keys() == second.pose.keys()
    for name in first.pose:
        np.testing.assert_allclose(first.pose[name], second.pose[name], atol=tolerance, rtol=tolerance, err_msg=name)
    for one, other in zip(first[1:], second[1:], strict=True):
        assert (one is None) == (other is None)
        if one is not None:
            np.testing.assert_allclose(one, other, atol=tolerance, rtol=tolerance)


def made(name: str, **parameters: Any) -> Estimator[Any]:
    """An estimator, or a skipped test where the package that it wraps is missing."""
    entry = FILTERS[name]
    if entry.kind == "external":
        pytest.importorskip(entry.made_by.package)  # type: ignore[attr-defined]
    return make(name, **parameters)


@pytest.fixture(params=list(FILTERS))
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def estimator(name: str) -> Estimator[Any]:
    return made(name, dt=0.01)


def test_an_entry_says_what_the_estimator_reads_and_estimates(
    name: str, estimator: Estimator[Any], motion: Motion
) -> None:
    entry = FILTERS[name]
    assert isinstance(estimator, Estimator)
    assert entry.channels == tuple(channel.name for channel in estimator.channels)
    estimate = run(estimator, motion(estimator, 0))
    assert tuple(estimate.pose) == tuple(quantity.name for quantity in estimator.outputs)
    assert set(estimate.pose) == set(entry.outputs)
    for quantity in estimator.outputs:
        assert estimate.pose[quantity.name].shape == (80, quantity.size)
        if quantity.kind in ("rotation", "direction"):
            np.testing.assert_allclose(np.linalg.norm(estimate.pose[quantity.name], axis=-1), 1.0, atol=1e-6)


@pytest.mark.parametrize("gaps", [False, True], ids=["complete", "gaps"])
def test_run_is_stepping(estimator: Estimator[Any], gaps: bool, motion: Motion) -> None:
    data = motion(estimator, 1)
    data = with_gaps(data) if gaps else data
    assert_same(run(estimator, data), run_by_steps(estimator, data), 1e-12)


def test_a_batch_is_its_sequences(estimator: Estimator[Any], motion: Motion) -> None:
    singles = [with_gaps(motion(estimator, seed), seed) for seed in (2, 3, 4, 5)]
    batch = {channel: np.stack([single[channel] for single in singles], axis=1) for channel in singles[0]}
    batch = {channel: array.reshape(80, 2, 2, array.shape[-1]) for channel, array in batch.items()}
    together = run(estimator, batch)
    for index, single in enumerate(singles):
        alone = run(estimator, single)
        for quantity, value in alone.pose.items():
            np.testing.assert_allclose(together.pose[quantity][:, index // 2, index % 2], value, atol=1e-9)


def test_input_and_state_are_left_alone(estimator: Estimator[Any], motion: Motion) -> None:
    data = motion(estimator, 6)
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


def test_saving_midway_changes_nothing(estimator: Estimator[Any], motion: Motion) -> None:
    data = with_gaps(motion(estimator, 7))
    whole = run_by_steps(estimator, data)
    state = estimator.init({channel: array[0] for channel, array in data.items()})
    for t in range(80):
        if t == 33:
            state = pickle.loads(pickle.dumps(state))
        state, estimate = estimator.step(state, {channel: array[t] for channel, array in data.items()})
    for quantity, value in estimate.pose.items():
        np.testing.assert_array_equal(value, whole.pose[quantity][-1])


def test_nothing_is_said_before_anything_was_heard(estimator: Estimator[Any], motion: Motion) -> None:
    data = {channel: array.copy() for channel, array in motion(estimator, 8).items()}
    for array in data.values():
        array[:12] = np.nan
    for quantity, value in run(estimator, data).pose.items():
        assert np.isnan(value[:12]).all(), quantity
        assert np.isfinite(value[12:]).all(), quantity


@pytest.mark.parametrize("name", SINGLE_IMU)
def test_without_accelerometer_there_is_no_start(estimator: Estimator[Any], motion: Motion) -> None:
    data = motion(estimator, 8)
    data["imu/acc"][:12] = np.nan
    for value in run(estimator, data).pose.values():
        assert np.isnan(value[:12]).all()
        assert np.isfinite(value[12:]).all()


@pytest.mark.parametrize("late", [True, False], ids=["late", "every other"])
def test_a_channel_that_is_late_or_loses_samples_leaves_estimates_finite(
    estimator: Estimator[Any], motion: Motion, late: bool
) -> None:
    whole, rng = motion(estimator, 14), np.random.default_rng(14)
    for channel in whole:
        data = whole | {channel: whole[channel].copy()}
        if late:
            data[channel][:12] = np.nan
        else:
            data[channel][20:60][rng.random(40) < 0.5] = np.nan
        estimate = run(estimator, data)
        for quantity, value in estimate.pose.items():
            assert np.isfinite(value[12:]).all(), (channel, quantity)
        if estimate.covariance is not None:
            assert np.isfinite(estimate.covariance[12:]).all(), channel


def test_another_interval(name: str, estimator: Estimator[Any], motion: Motion) -> None:
    other = estimator.with_dt(0.02)
    assert (estimator.dt, other.dt) == (0.01, 0.02)
    data = motion(estimator, 9, dt=0.02)
    assert_same(run(other, data), run(make(name, dt=0.02), data), 0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data, channel: data | {channel: data[channel][:, :-1]}, "must have shape"),
        (lambda data, channel: data | {channel: data[channel][:-1]}, "leading shape"),
        (lambda data, channel: {other: array[:0] for other, array in data.items()}, "empty"),
        (lambda data, channel: data | {channel: np.full(data[channel].shape, "x")}, "real numbers"),
    ],
    ids=["width", "length", "empty", "text"],
)
def test_wrong_input_is_refused(
    estimator: Estimator[Any], change: Callable[[Data, str], Data], message: str, motion: Motion
) -> None:
    data = motion(estimator, 0)
    for channel in data:
        if message != "leading shape" or len(data) > 1:
            with pytest.raises(ValueError, match=message):
                run(estimator, change(data, channel))


def test_a_missing_channel_is_named(estimator: Estimator[Any], motion: Motion) -> None:
    data = motion(estimator, 0)
    for channel in data:
        rest = {other: array for other, array in data.items() if other != channel}
        with pytest.raises(ValueError, match=f"lack the channels .'{channel}'."):
            run(estimator, rest)
        with pytest.raises(ValueError, match=f"lack the channels .'{channel}'."):
            estimator.init({other: array[0] for other, array in rest.items()})


@pytest.mark.parametrize("own", OWN)
def test_arrays_torch_and_compiled_agree(own: str, motion: Motion) -> None:
    estimator = make(own)
    singles = [with_gaps(motion(estimator, seed, 30), seed) for seed in (10, 11)]
    data = {channel: np.stack([single[channel] for single in singles], axis=1) for channel in singles[0]}
    compiled, arrays = run(estimator, data), run(make(own, compiled=False), data)
    assert_same(compiled, arrays)
    tensors = run(estimator, {channel: torch.from_numpy(array) for channel, array in data.items()})
    assert all(isinstance(value, torch.Tensor) for value in tensors.pose.values())
    assert_same(arrays, Estimate(*(None if part is None else part for part in tensors)))


@pytest.mark.parametrize("own", OWN)
def test_gradients_flow(own: str, motion: Motion) -> None:
    estimator = make(own)
    whole = motion(estimator, 12, 10)
    channel = next((name for name in whole if name.endswith("/gyr")), next(iter(whole)))
    data = {name: torch.from_numpy(array) for name, array in (with_gaps(whole) | {channel: whole[channel]}).items()}
    data[channel].requires_grad_()
    run(estimator, data).pose[estimator.outputs[0].name][-1].sum().backward()
    gradient = data[channel].grad
    assert gradient is not None
    assert bool(torch.isfinite(gradient).all())
    assert bool((gradient.abs() > 0).any())


@pytest.mark.parametrize("name", STRAPDOWN)
def test_a_drop_out_leaves_the_gyroscope(name: str, motion: Motion) -> None:
    """Without accelerometer and magnetometer every method turns as the gyroscope says, less the bias that it knows."""
    estimator = made(name)
    data = motion(estimator, 13, 120)
    for channel in data:
        if channel != "imu/gyr":
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
    assert error < (0.05 if FILTERS[name].kind == "external" else 1e-9)


def test_unknown_names_and_parameters_are_refused() -> None:
    with pytest.raises(ValueError, match="did you mean 'bounded-motion'"):
        make("bounded-moton")
    with pytest.raises(ValueError, match=r"unknown parameters \['nose'\] of 'mekf'.*gyroscope_noise"):
        make("mekf", nose=1.0)
    with pytest.raises(ValueError, match="axes"):
        make("vqf", axes=9)
    with pytest.raises(ValueError, match="dt must be positive"):
        make("mahony", dt=0.0)
