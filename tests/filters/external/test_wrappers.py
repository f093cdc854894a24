"""Wrapped packages: what they say is what the package says, in the frames and units of this one."""

from __future__ import annotations

import importlib
import sys

import numpy as np
import pytest

from poise.filters.core import metrics, rotation
from poise.filters.core.estimator import run
from poise.filters.external.vqf import VQF
from poise.filters.registry import FILTERS, make

EXTERNAL = [name for name, entry in FILTERS.items() if entry.kind == "external"]
GRAVITY = np.array([0.0, 0.0, 9.81])
FIELD = np.array([0.0, 20.0, -45.0])


def slow_turn(length: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """A calm sensor in an attitude that is level in no axis, and its orientation."""
    t = 0.01 * np.arange(length)
    rate = np.stack([0.5 * np.sin(0.5 * t), 0.4 * np.cos(0.4 * t), 0.3 * np.sin(0.3 * t)], axis=-1)
    q = [rotation.from_euler_zyx(np.array(2.0), np.array(0.4), np.array(-0.6))]
    for omega in rate[1:]:
        q.append(rotation.multiply(q[-1], rotation.exp(0.01 * omega)))
    truth = np.array(q)
    return {
        "imu/gyr": rate,
        "imu/acc": rotation.rotate_back(truth, GRAVITY[None]),
        "imu/mag": rotation.rotate_back(truth, FIELD[None]),
    }, truth


@pytest.fixture(scope="module")
def turn() -> tuple[dict[str, np.ndarray], np.ndarray]:
    return slow_turn(1500)


@pytest.mark.parametrize("name", EXTERNAL)
def test_frames_and_units(name: str, turn: tuple[dict[str, np.ndarray], np.ndarray]) -> None:
    """Without noise and acceleration every method is right in our frame, heading and all."""
    pytest.importorskip(FILTERS[name].made_by.package)  # type: ignore[attr-defined]
    data, truth = turn
    pose = run(make(name), data).pose
    late = slice(1000, None)
    assert np.degrees(metrics.direction_error(pose["up"], rotation.up_in_body(truth)))[late].max() < 1.0
    if "orientation" in pose:
        assert np.degrees(metrics.total_error(pose["orientation"], truth))[late].max() < 2.5
    else:
        assert np.degrees(metrics.inclination_error(pose["relative_orientation"], truth))[late].max() < 1.0


@pytest.mark.parametrize("axes", [6, 9])
def test_vqf_is_the_package(axes: int, turn: tuple[dict[str, np.ndarray], np.ndarray]) -> None:
    vqf = pytest.importorskip("vqf")
    data, _ = turn
    channels = ("imu/gyr", "imu/acc", "imu/mag")[: axes // 3]
    expected = vqf.VQF(0.01).updateBatch(*(np.ascontiguousarray(data[channel]) for channel in channels))
    pose = run(make("vqf" if axes == 6 else "vqf-9"), data).pose
    name = "relative_orientation" if axes == 6 else "orientation"
    np.testing.assert_array_equal(pose[name], expected["quat6D" if axes == 6 else "quat9D"])
    np.testing.assert_array_equal(pose["gyroscope_bias"], expected["bias"])


def test_imufusion_is_the_package(turn: tuple[dict[str, np.ndarray], np.ndarray]) -> None:
    imufusion = pytest.importorskip("imufusion")
    data, _ = turn
    engine = imufusion.Ahrs()
    q = []
    for gyroscope, force in zip(data["imu/gyr"], data["imu/acc"], strict=True):
        engine.update_no_magnetometer(np.degrees(gyroscope), force / 9.80665)
        q.append(engine.get_quaternion())
    up = run(make("imufusion"), data).pose["up"]
    np.testing.assert_allclose(up, rotation.up_in_body(np.array(q, dtype=float)), atol=1e-6)


@pytest.mark.parametrize("name", ["ahrs-madgwick", "ahrs-mahony", "ahrs-ekf"])
def test_ahrs_is_the_package(name: str, turn: tuple[dict[str, np.ndarray], np.ndarray]) -> None:
    filters = pytest.importorskip("ahrs.filters")
    data = {channel: array[:200] for channel, array in turn[0].items()}
    start = np.asarray(rotation.level(data["imu/acc"][0]))
    kind = {"ahrs-madgwick": filters.Madgwick, "ahrs-mahony": filters.Mahony, "ahrs-ekf": filters.EKF}[name]
    options = {"frame": "NED"} if name == "ahrs-ekf" else {}
    # Its extended filter without magnetometer is the same in both of its frames: upward force or downward gravity.
    expected = kind(gyr=data["imu/gyr"], acc=data["imu/acc"], frequency=100.0, q0=start, **options).Q
    q = run(make(name), data).pose["relative_orientation"]
    assert metrics.total_error(q, np.asarray(expected)).max() < 1e-9


def test_going_back_in_a_package_that_hides_its_memory() -> None:
    pytest.importorskip("imufusion")
    data, _ = slow_turn(60)
    estimator = make("imufusion")
    states = [estimator.init({channel: array[0] for channel, array in data.items()})]
    ups = []
    for t in range(60):
        state, estimate = estimator.step(states[-1], {channel: array[t] for channel, array in data.items()})
        states.append(state)
        ups.append(estimate.pose["up"])
    for t in (10, 59, 30):
        _, estimate = estimator.step(states[t], {channel: array[t] for channel, array in data.items()})
        np.testing.assert_array_equal(estimate.pose["up"], ups[t])


def test_a_missing_package_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str, *rest: object) -> object:
        raise ModuleNotFoundError(name, name=name)

    monkeypatch.delitem(sys.modules, "vqf", raising=False)
    monkeypatch.setattr(importlib, "import_module", absent)
    with pytest.raises(ImportError, match=r"vqf is not installed: pip install 'poise\[compare\]'"):
        VQF().load()
