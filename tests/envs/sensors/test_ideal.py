"""Ideal readings against closed forms, SciPy rotations and a strapdown integration."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.envs.sensors.ideal import (
    BodyState,
    Mounting,
    instant_readings,
    interval_readings,
    magnetic_field,
    magnetometer_reading,
    mounted,
)
from poise.filters.core import rotation

G = 9.80665
ZERO = np.zeros(3)


def scipy_rotation(q):
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


def wxyz(turn):
    return np.roll(turn.as_quat(), 1, axis=-1)


def random_mounting(rng):
    return Mounting(tuple(rng.normal(size=3)), tuple(rotation.random(rng)))


@pytest.mark.parametrize("sampling", ["interval", "instant"])
def test_rest_reads_g_along_up_in_any_attitude(sampling):
    rng = np.random.default_rng(0)
    q = rotation.random(rng, (200,))
    still = np.zeros((200, 3))
    for _ in range(5):
        mounting = random_mounting(rng)
        body = BodyState(np.zeros(200), 50.0 * rng.normal(size=(200, 3)), q, still, still, still, still)
        sensor = mounted(body, mounting)
        if sampling == "interval":
            rate, force = interval_readings(sensor, sensor._replace(time=np.full(200, 0.01)))
        else:
            rate, force = instant_readings(sensor)
        attitude = scipy_rotation(q) * scipy_rotation(np.array(mounting.rotation))
        np.testing.assert_allclose(force, attitude.inv().apply([0.0, 0.0, G]), atol=2e-14 * G)
        np.testing.assert_allclose(np.linalg.norm(force, axis=-1), G, rtol=1e-14)
        np.testing.assert_allclose(rate, 0.0, atol=1e-13)


def circle(time, speed, radius):
    """A vehicle on a left-hand circle, x ahead, y to the centre."""
    omega = speed / radius
    angle = omega * np.asarray(time)
    zero = np.zeros_like(angle)
    towards = np.stack([-np.sin(angle), np.cos(angle), zero], axis=-1)
    ahead = np.stack([np.cos(angle), np.sin(angle), zero], axis=-1)
    q = np.stack([np.cos(angle / 2), zero, zero, np.sin(angle / 2)], axis=-1)
    spin = np.stack([zero, zero, zero + omega], axis=-1)
    return BodyState(angle / omega, -radius * towards, q, speed * ahead, spin, speed**2 / radius * towards, 0.0 * spin)


@pytest.mark.parametrize("lever", [0.0, 0.4])
@pytest.mark.parametrize("rate", [25.0, 100.0, 1000.0])
def test_a_steady_turn_reads_v_squared_over_r_at_any_rate(rate, lever):
    speed, radius = 5.0, 8.0
    omega = speed / radius
    # a sensor nearer to the centre by the lever arm runs on a smaller circle
    expected = omega**2 * (radius - lever)
    body = circle(np.arange(50) / rate, speed, radius)
    sensor = mounted(body, Mounting((0.0, lever, 0.7)))
    before, after = sensor.at(slice(None, -1)), sensor.at(slice(1, None))

    turn, force = instant_readings(sensor)
    np.testing.assert_allclose(force, np.broadcast_to([0.0, expected, G], force.shape), atol=1e-12)
    np.testing.assert_allclose(turn, np.broadcast_to([0.0, 0.0, omega], turn.shape), atol=1e-12)

    # a mean over an interval is shorter by chord over arc, and by nothing else
    chord = np.sinc(omega / rate / (2.0 * np.pi))
    turn, force = interval_readings(before, after)
    np.testing.assert_allclose(force, np.broadcast_to([0.0, expected * chord, G], force.shape), atol=2e-11)
    np.testing.assert_allclose(force[:, 1], expected, rtol=2e-4)
    np.testing.assert_allclose(turn, np.broadcast_to([0.0, 0.0, omega], turn.shape), atol=1e-11)

    _, force = instant_readings(after._replace(acceleration=None), before)
    np.testing.assert_allclose(force[:, 1], expected, rtol=2e-4)


def test_a_spinning_lever_arm_feels_centripetal_and_tangential_acceleration():
    omega, alpha, length = 7.0, 3.0, 0.25
    spin, push = np.array([0.0, 0.0, omega]), np.array([0.0, 0.0, alpha])
    body = BodyState(0.0, ZERO, np.array([1.0, 0.0, 0.0, 0.0]), ZERO, spin, ZERO, push)
    rate, force = instant_readings(mounted(body, Mounting((length, 0.0, 0.0))))
    np.testing.assert_allclose(force, [-(omega**2) * length, alpha * length, G], atol=1e-13)
    np.testing.assert_allclose(rate, spin, atol=1e-14)
    rolled = Mounting((length, 0.0, 0.0), (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0))
    _, force = instant_readings(mounted(body, rolled))
    np.testing.assert_allclose(force, [-(omega**2) * length, G, -alpha * length], atol=1e-13)


def test_attitude_and_field_agree_with_scipy():
    rng = np.random.default_rng(1)
    q, mounting = rotation.random(rng, (100,)), random_mounting(rng)
    zeros = np.zeros((100, 3))
    position, spin = rng.normal(size=(2, 100, 3))
    sensor = mounted(BodyState(np.zeros(100), position, q, zeros, spin), mounting)
    attitude = scipy_rotation(q) * scipy_rotation(np.array(mounting.rotation))
    assert np.max((scipy_rotation(sensor.orientation).inv() * attitude).magnitude()) < 1e-12
    lever = scipy_rotation(q).apply(mounting.lever_arm)
    np.testing.assert_allclose(sensor.position, position + lever, atol=1e-13)
    np.testing.assert_allclose(sensor.velocity, np.cross(spin, lever), atol=1e-13)
    field = magnetic_field(48.0, 66.0, 4.0)
    np.testing.assert_allclose(magnetometer_reading(sensor, field), attitude.inv().apply(field), atol=1e-12)


def test_the_magnetic_field_points_north_and_down():
    north = magnetic_field(50.0, 60.0)
    np.testing.assert_allclose(north, [0.0, 25.0, -50.0 * np.sqrt(0.75)], atol=1e-12)
    east = magnetic_field(50.0, 60.0, 10.0)
    assert np.linalg.norm(east) == pytest.approx(50.0)
    assert np.rad2deg(np.arctan2(east[0], east[1])) == pytest.approx(10.0)


def smooth_motion(time):
    """Swinging in all six degrees of freedom; the angular velocity is that of Z-Y-X angles, in world axes."""
    yaw, pitch, roll = 1.2 * np.sin(1.1 * time), 0.8 * np.sin(2.3 * time + 0.4), 0.9 * np.sin(1.7 * time + 1.0)
    rates = 1.32 * np.cos(1.1 * time), 1.84 * np.cos(2.3 * time + 0.4), 1.53 * np.cos(1.7 * time + 1.0)
    about_z = Rotation.from_euler("z", yaw[:, None])
    about_zy = about_z * Rotation.from_euler("y", pitch[:, None])
    axes = about_zy.apply([1.0, 0.0, 0.0]), about_z.apply([0.0, 1.0, 0.0]), np.array([[0.0, 0.0, 1.0]])
    spin = rates[2][:, None] * axes[0] + rates[1][:, None] * axes[1] + rates[0][:, None] * axes[2]
    attitude = about_zy * Rotation.from_euler("x", roll[:, None])
    frequency, phase = np.array([1.3, 2.1, 3.1]), np.array([0.0, 0.5, 1.1])
    swing = frequency * time[:, None] + phase
    return BodyState(time, 0.5 * np.sin(swing), wxyz(attitude), 0.5 * frequency * np.cos(swing), spin), attitude


def test_strapdown_integration_of_interval_readings_returns_the_motion():
    rate, mounting = 100.0, random_mounting(np.random.default_rng(2))
    body, attitude = smooth_motion(np.arange(0.0, 30.0, 1.0 / rate))
    sensor = mounted(body, mounting)
    turns, forces = interval_readings(sensor.at(slice(None, -1)), sensor.at(slice(1, None)))
    q = attitude[0] * scipy_rotation(np.array(mounting.rotation))
    v, p, dt = sensor.velocity[0].copy(), sensor.position[0].copy(), 1.0 / rate
    for turn, force in zip(turns, forces, strict=True):
        middle = q * Rotation.from_rotvec(0.5 * turn * dt)
        step = (middle.apply(force) - [0.0, 0.0, G]) * dt
        p, v, q = p + (v + 0.5 * step) * dt, v + step, q * Rotation.from_rotvec(turn * dt)
    assert np.linalg.norm(p - sensor.position[-1]) < 0.01
    error = (q.inv() * attitude[-1] * scipy_rotation(np.array(mounting.rotation))).magnitude()
    assert np.rad2deg(error) < 0.01


def test_the_sign_of_a_quaternion_does_not_matter():
    body, _ = smooth_motion(np.arange(0.0, 1.0, 0.01))
    before, after = body.at(slice(None, -1)), body.at(slice(1, None))
    flipped = after._replace(orientation=-after.orientation)
    for one, other in zip(interval_readings(before, after), interval_readings(before, flipped), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="lever_arm must hold 3 finite numbers"):
        Mounting((0.0, 1.0))
    with pytest.raises(ValueError, match="rotation must be a unit quaternion"):
        Mounting(rotation=(1.0, 1.0, 0.0, 0.0))
    with pytest.raises(ValueError, match=r"dip_deg must lie in \[-90, 90\], got 120"):
        magnetic_field(dip_deg=120.0)
    with pytest.raises(ValueError, match="strength must be positive"):
        magnetic_field(0.0)
    state = BodyState(1.0, ZERO, np.array([1.0, 0.0, 0.0, 0.0]), ZERO, ZERO)
    with pytest.raises(ValueError, match=r"after\.time must lie after before\.time"):
        interval_readings(state, state)
    with pytest.raises(ValueError, match="instant readings need the acceleration"):
        instant_readings(state)
