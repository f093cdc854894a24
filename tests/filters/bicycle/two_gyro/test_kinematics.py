"""Kinematics of the two-gyroscope paper against reference frames of SymPy, published forms and central differences."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
import sympy.physics.mechanics as mechanics
from scipy.spatial.transform import Rotation

from poise.envs.bicycle.fixture import DISK_CENTRE
from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE
from poise.envs.bicycle.rider.anthropometry import SUBJECTS
from poise.envs.bicycle.rider.posture import sit
from poise.envs.bicycle.sensors.measured_geometry import rider_geometry
from poise.envs.bicycle.sensors.sites import fixture_sites, sensor_sites
from poise.filters.bicycle import relative_sensor as sensor
from poise.filters.bicycle.two_gyro import kinematics as kinematics
from poise.filters.core import rotation

RNG = np.random.default_rng(0)
N = 20
THETA = RNG.uniform(-1.2, 1.2, (N, 3))
ROLL = RNG.uniform(-1.0, 1.0, N)
RATE = RNG.normal(size=(N, 3))
BODY_RATE = RNG.normal(size=(N, 3))


def derivative(function, x, step=1e-6):
    columns = [(function(x + step * unit) - function(x - step * unit)) / (2.0 * step) for unit in np.eye(x.shape[-1])]
    return np.stack(columns, axis=-1)


@pytest.fixture(scope="module")
def frames():
    """Rates of platform and body in their own axes, from frames that turn: angles and their rates as arguments."""
    t = sympy.symbols("t")
    names = "psi chi phi t1 t2 t3"
    angles = [mechanics.dynamicsymbols(name) for name in names.split()]
    inertial = mechanics.ReferenceFrame("I")
    platform = inertial.orientnew("P", "Body", angles[:3], "ZYX")
    body = platform.orientnew("H", "Body", angles[3:], "XYZ")
    values, rates = sympy.symbols(names), sympy.symbols(" ".join(f"d{name}" for name in names.split()))
    plain = {angle.diff(t): rate for angle, rate in zip(angles, rates, strict=True)} | dict(
        zip(angles, values, strict=True)
    )
    vectors = [
        platform.ang_vel_in(inertial).to_matrix(platform),
        body.ang_vel_in(inertial).to_matrix(body),
        body.dcm(platform).T,
    ]
    return [sympy.lambdify([*values, *rates], vector.subs(plain), "numpy") for vector in vectors]


def test_any_motion(frames):
    """(3), (11), (13): Σ1 gives the rates of the relative angles of frames that turn anyhow."""
    for _ in range(N):
        values, rates = RNG.uniform(-1.2, 1.2, 6), RNG.normal(size=6)
        platform, body, relative = (np.array(function(*values, *rates), float) for function in frames)
        theta = values[3:]
        found = (
            kinematics.body_rate_matrix(theta) @ body[:, 0] + kinematics.platform_rate_matrix(theta) @ platform[:, 0]
        )
        np.testing.assert_allclose(found, rates[3:], atol=1e-12)
        np.testing.assert_allclose(
            kinematics.platform_rate_matrix(theta), -kinematics.body_rate_matrix(theta) @ relative.T, atol=1e-12
        )


def test_a_pitch_rate_violates_the_second_model_by_the_law(frames):
    """(15) is exact for constant pitch; else it is off by −M_:2 (dχ/dt) / cos φ. (8) needs χ = 0."""
    for _ in range(N):
        values, rates = RNG.uniform(-1.0, 1.0, 6), RNG.normal(size=6)
        for pitch_rate in (0.0, rates[1]):
            rates[1] = pitch_rate
            platform, body, _ = (np.array(function(*values, *rates), float) for function in frames)
            phi, chi, theta = values[2], values[1], values[3:]
            D = kinematics.platform_rate_matrix(theta) @ kinematics.substitution(np.array(phi), "bicycle")
            found = kinematics.body_rate_matrix(theta) @ body[:, 0] + D @ platform[[0, 2], 0]
            off = -kinematics.platform_rate_matrix(theta)[:, 1] * pitch_rate / np.cos(phi)
            np.testing.assert_allclose(found - rates[3:], off, atol=1e-11)
            assert platform[0, 0] == pytest.approx(rates[2] - np.sin(chi) * rates[0], abs=1e-12)


def test_a_segway_pitches_and_does_not_roll(frames):
    """(6) and its kinematics: with φ = 0, δω_x = −tan χ δω_z and dχ/dt = δω_y."""
    for _ in range(N):
        values, rates = RNG.uniform(-1.0, 1.0, 6), RNG.normal(size=6)
        values[2] = rates[2] = 0.0
        platform, body, _ = (np.array(function(*values, *rates), float) for function in frames)
        theta = values[3:]
        D = kinematics.platform_rate_matrix(theta) @ kinematics.substitution(np.array(values[1]), "segway")
        found = kinematics.body_rate_matrix(theta) @ body[:, 0] + D @ platform[[1, 2], 0]
        np.testing.assert_allclose(found, rates[3:], atol=1e-11)
        assert platform[1, 0] == pytest.approx(rates[1], abs=1e-12)


def test_printed_form_of_the_second_model():
    """D of (15) with the sums θ₁ + φ as published, and E of (21)."""
    c, s = np.cos, np.sin
    t1, t2 = THETA[:, 0], THETA[:, 1]
    M, S = kinematics.platform_rate_matrix(THETA), kinematics.substitution(ROLL, "bicycle")
    D2 = np.stack([s(t2) * c(t1 + ROLL) / c(t2), -s(t1 + ROLL), -c(t1 + ROLL) / c(t2)], axis=-1) / c(ROLL)[:, None]
    np.testing.assert_allclose((M @ S)[..., 1], D2, atol=1e-12)
    np.testing.assert_allclose((M @ S)[..., 0], [[-1.0, 0.0, 0.0]] * N, atol=1e-15)
    slope = kinematics.substitution_derivative(ROLL, np.ones(N), "bicycle")
    E = -np.stack([s(t1) * s(t2), c(t1) * c(t2), -s(t1)], axis=-1) / (c(t2) * c(ROLL) ** 2)[:, None]
    np.testing.assert_allclose((M @ slope[..., None])[..., 0], E, atol=1e-12)


@pytest.mark.parametrize("platform", ["bicycle", "segway"])
def test_derivatives(platform):
    for theta, roll, rate, body in zip(THETA, ROLL, RATE, BODY_RATE, strict=True):
        by_body = derivative(lambda x, body=body: kinematics.body_rate_matrix(x) @ body, theta)
        np.testing.assert_allclose(kinematics.body_rate_derivative(theta, body), by_body, atol=1e-6)
        by_platform = derivative(lambda x, rate=rate: kinematics.platform_rate_matrix(x) @ rate, theta)
        np.testing.assert_allclose(kinematics.platform_rate_derivative(theta, rate), by_platform, atol=1e-6)
        used = rate[1:]
        by_roll = derivative(lambda x, used=used: kinematics.substitution(x[0], platform) @ used, np.array([roll]))
        slope = kinematics.substitution_derivative(np.array(roll), np.array(used[1]), platform)
        np.testing.assert_allclose(slope, by_roll[:, 0], atol=1e-6)


def test_relative_angles_are_those_of_scipy():
    """Half a turn about x between the axes of sensors and paper, intrinsic X-Y-Z angles there."""
    q = rotation.random(np.random.default_rng(1), (200,))
    flip = np.diag(kinematics.SIGNS)
    matrices = flip @ Rotation.from_quat(rotation.to_xyzw(q)).as_matrix() @ flip
    np.testing.assert_allclose(sensor.relative_angles(q), Rotation.from_matrix(matrices).as_euler("XYZ"), atol=1e-9)
    again = sensor.relative_orientation(sensor.relative_angles(q))
    np.testing.assert_allclose(rotation.positive(again), rotation.positive(q), atol=1e-12)


def test_a_tilted_gyroscope():
    """Nose up: the sensor's x axis points up and forward; axes of the paper are y right and z down."""
    mounted = sensor_sites(sit(MOUNTAIN_BIKE, SUBJECTS[0])).bicycle_imu.rotation
    reading = rotation.rotate_back(np.array(mounted), RATE)
    np.testing.assert_allclose(kinematics.platform_rate(reading, np.radians(10.0)), RATE * kinematics.SIGNS, atol=1e-12)


def test_distances():
    """Distances of the environment's markers, and their Jacobian; places that the filter is told are the true ones."""
    posture = sit(MOUNTAIN_BIKE, SUBJECTS[2])
    places = sensor_sites(posture)
    told = sensor.MarkerPlaces.of_trunk(rider_geometry(posture))
    np.testing.assert_allclose(told.markers, places.markers, atol=1e-12)
    np.testing.assert_allclose(told.viewpoints, places.viewpoints, atol=1e-12)
    disk, true_disk = sensor.MarkerPlaces.of_disk(), fixture_sites(places, DISK_CENTRE)
    np.testing.assert_allclose(disk.markers, true_disk.markers, atol=1e-12)
    np.testing.assert_allclose(disk.viewpoints, true_disk.viewpoints, atol=1e-12)
    found, slope = sensor.marker_distances(THETA, told)
    turned = Rotation.from_quat(rotation.to_xyzw(sensor.relative_orientation(THETA)))
    for index in range(3):
        ends = np.array(told.pivot) + turned.apply(told.markers[index]) - np.array(told.viewpoints[index])
        np.testing.assert_allclose(found[:, index], np.linalg.norm(ends, axis=-1), atol=1e-12)
    for theta, expected in zip(THETA, slope, strict=True):
        np.testing.assert_allclose(
            derivative(lambda x: sensor.marker_distances(x, told)[0], theta), expected, atol=1e-8
        )
