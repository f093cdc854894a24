"""Integration, tilt and Mahony's filters: exact cases, an independent implementation, rates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.filters.core import metrics, rotation
from poise.filters.core.recursion import Observer
from poise.filters.imu.classical import GyroscopeIntegration, Mahony, Mahony9, Tilt

GRAVITY = np.array([0.0, 0.0, 9.81])
FIELD = np.array([0.0, 20.0, -45.0])


@pytest.fixture(scope="module")
def turning() -> tuple[dict[str, np.ndarray], np.ndarray]:
    """A turning sensor without acceleration or noise; orientation by SciPy."""
    rng = np.random.default_rng(0)
    t = 0.01 * np.arange(3000)
    rate = np.stack([np.sin(0.9 * t), np.cos(1.3 * t), 0.6 * np.sin(0.7 * t)], axis=-1)
    attitude = Rotation.random(random_state=1)
    q = [rotation.from_xyzw(attitude.as_quat())]
    for omega in rate[1:]:
        attitude = attitude * Rotation.from_rotvec(0.01 * omega)
        q.append(rotation.from_xyzw(attitude.as_quat()))
    truth = np.array(q)
    return {
        "imu/gyr": rate,
        "imu/acc": rotation.rotate_back(truth, GRAVITY[None]),
        "imu/mag": rotation.rotate_back(truth, FIELD[None]) * rng.uniform(0.9, 1.1, (3000, 1)),
    }, truth


def test_integration_is_exact(turning: tuple[dict[str, np.ndarray], np.ndarray]) -> None:
    data, truth = turning
    force = data["imu/acc"].copy()
    force[1:] = 0.0  # only the first sample is read
    pose = Observer(GyroscopeIntegration()).run(data | {"imu/acc": force}).pose
    assert metrics.inclination_error(pose["relative_orientation"], truth).max() < 1e-9
    assert metrics.direction_error(pose["up"], rotation.up_in_body(truth)).max() < 1e-9
    heading = rotation.to_euler_zyx(pose["relative_orientation"][0])[0]
    assert float(heading) == pytest.approx(0.0, abs=1e-12)


def test_tilt_is_the_direction_of_the_force(turning: tuple[dict[str, np.ndarray], np.ndarray]) -> None:
    data, truth = turning
    force = data["imu/acc"].copy()
    force[100:200] = np.nan
    force[300] = 0.0  # free fall has no direction
    up = Observer(Tilt()).run({"imu/acc": force}).pose["up"]
    expected = rotation.up_in_body(truth)
    expected[100:200] = expected[99]
    expected[300] = expected[299]
    np.testing.assert_allclose(up, expected, atol=1e-12)


def test_mahony_finds_bias_and_vertical(turning: tuple[dict[str, np.ndarray], np.ndarray]) -> None:
    data, truth = turning
    bias = np.array([0.02, -0.01, 0.015])
    pose = Observer(Mahony()).run(data | {"imu/gyr": data["imu/gyr"] + bias}).pose
    np.testing.assert_allclose(pose["gyroscope_bias"][-1], bias, atol=1e-3)
    assert metrics.inclination_error(pose["relative_orientation"], truth)[-500:].max() < 1e-3


def test_mahony_decays_as_its_linear_form() -> None:
    """A small tilt error e at rest: ë + k_P ė + k_I e = 0."""
    pose = Observer(Mahony(dt=0.001)).run(
        {
            "imu/gyr": np.zeros((8000, 3)),
            "imu/acc": np.concatenate(
                [rotation.rotate_back(rotation.exp(np.array([0.01, 0, 0])), GRAVITY)[None]]
            ).repeat(8000, axis=0)
            * np.where(np.arange(8000)[:, None] > 0, 1.0, [0.0, 0.0, 1.0]),
        }
    )
    t = 0.001 * np.arange(8000)
    damping, frequency = 0.5, np.sqrt(0.3 - 0.25)
    decay = 0.01 * np.exp(-damping * t) * (np.cos(frequency * t) + damping / frequency * np.sin(frequency * t))
    # The bias starts to answer at once: ė(0) = −k_P e, so the sine has the other sign than for a start at rest.
    decay -= 0.01 * np.exp(-damping * t) * np.sin(frequency * t) / frequency
    roll, _ = rotation.roll_pitch(pose.pose["up"])
    np.testing.assert_allclose(0.01 - roll, decay, atol=3e-5)


@pytest.mark.parametrize("dt", [0.002, 0.02])
def test_mahony_means_the_same_at_every_rate(dt: float) -> None:
    length = round(4.0 / dt)
    force = np.tile([0.0, 0.0, 9.81], (length, 1))
    force[1:] = rotation.rotate_back(rotation.exp(np.array([0.3, 0.0, 0.0])), GRAVITY)
    data = {"imu/gyr": np.zeros((length, 3)), "imu/acc": force}
    up = Observer(Mahony(dt=dt)).run(data).pose["up"]
    reference = Observer(Mahony(dt=0.0005)).run({k: v.repeat(round(dt / 0.0005), axis=0) for k, v in data.items()})
    np.testing.assert_allclose(up[-1], reference.pose["up"][-1], atol=5e-3)


def test_mahony_9_finds_the_world(turning: tuple[dict[str, np.ndarray], np.ndarray]) -> None:
    data, truth = turning
    declination = np.deg2rad(4.0)
    pose = Observer(Mahony9()).run(data).pose
    assert metrics.total_error(pose["orientation"], truth).max() < 1e-6
    turned = Observer(Mahony9(declination=declination)).run(data).pose
    difference = rotation.log(rotation.multiply(turned["orientation"], rotation.conjugate(truth)))
    np.testing.assert_allclose(difference[-1], [0.0, 0.0, -declination], atol=1e-4)


@pytest.mark.parametrize("axes", [6, 9])
def test_mahony_equals_another_implementation(axes: int) -> None:
    """The package ahrs integrates to first order; the rest is the difference of the integration."""
    filters = pytest.importorskip("ahrs.filters")
    rng, dt = np.random.default_rng(3), 0.001
    t = dt * np.arange(4000)
    rate = np.stack([np.sin(2 * t), 0.5 * np.cos(t), 0.3 + 0 * t], axis=-1)
    data = {
        "imu/gyr": rate,
        "imu/acc": GRAVITY + np.sin(t)[:, None] + rng.normal(0.0, 0.1, (4000, 3)),
        "imu/mag": FIELD + 5.0 * np.cos(t)[:, None] + rng.normal(0.0, 0.1, (4000, 3)),
    }
    pose = Observer(Mahony(dt=dt) if axes == 6 else Mahony9(dt=dt)).run(data).pose
    q = pose["relative_orientation" if axes == 6 else "orientation"]
    other = filters.Mahony(
        gyr=rate,
        acc=data["imu/acc"],
        mag=data["imu/mag"] if axes == 9 else None,
        Dt=dt,
        k_P=1.0,
        k_I=0.3,
        q0=q[0],
    )
    assert np.degrees(metrics.total_error(q, other.Q)).max() < 0.1
    np.testing.assert_allclose(pose["gyroscope_bias"][-1], other.b, atol=2e-3)
