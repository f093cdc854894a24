"""Forces of the force/inertial filter against Newton and Euler, statics, and the published equations."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.studies.force_inertial.motion import (
    DEG,
    NO_ERRORS,
    derivative,
    draw_motion,
    exact_readings,
    second_derivative,
)
from poise.envs.bicycle.ride.contact_forces import LoadCells
from poise.filters.bicycle.force_inertial.accelerometer import accelerometer_accelerations
from poise.filters.bicycle.force_inertial.filter import ForceInertial
from poise.filters.bicycle.force_inertial.forces import (
    apparent_vertical,
    centre_of_pressure,
    in_bicycle,
    needed_load,
    pedal_moment,
    seat_load,
    trunk_moment,
)
from poise.filters.bicycle.force_inertial.kinematics import (
    Accelerations,
    Angles,
    Rates,
    Travel,
    gyroscope_accelerations,
    rates,
)
from poise.filters.bicycle.force_inertial.parameters import LEG_MASS, resting_leg, resting_legs
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.core import rotation

G, L_S, H_S, M_H, H_H = 9.8, 0.26, 0.38, 45.0, 0.33
POINT = ForceInertial.published()
STILL = (Rates(*[0.0] * 5), Accelerations(*[0.0] * 5), 0.0, Travel(0.0, 0.0))


def published(angles, rate, acceleration, travel):
    """(9) with (19), as the paper writes them."""
    f, t, _, b = angles
    df, dt, _, db, w = rate
    ddf, ddt, _, ddb, dw = acceleration
    sf, cf, st, ct, sb, cb = math.sin(f), math.cos(f), math.sin(t), math.cos(t), math.sin(b), math.cos(b)
    sd, cd = math.sin(b - f), math.cos(b - f)
    h, s, v, dv = H_H, H_S, travel.speed, travel.acceleration
    lean = (
        h * h * st * st * ddf + h * st * cf * (L_S + h * ct) * dw + s * h * cd * st * ddb
        + h * h * math.sin(2 * t) * dt * df - s * h * sd * st * db**2 - 2 * h * h * cf * st * st * dt * w
        - h * st * cf * (h * sf * st + s * sb) * w**2 + h * cf * st * v * w - G * h * sf * st
    )  # fmt: skip
    pitch = (
        h * h * ddt + h * (s * sb * st + L_S * ct * sf + h * sf) * dw - s * h * sd * ct * ddb - h * st * dv
        + 2 * s * h * cb * st * db * w + 2 * h * h * st * st * cf * df * w - s * h * cd * ct * db**2
        - h * (h * sf * sf * st * ct + s * sb * sf * ct - L_S * st) * w**2 + h * sf * ct * v * w
        - h * h * st * ct * df**2 + h * h * st * ct * w**2 + G * h * cf * ct
    )  # fmt: skip
    return M_H * lean, M_H * pitch


def test_a_point_mass_is_the_published_model():
    rng = np.random.default_rng(0)
    for _ in range(20):
        angles = Angles(rng.uniform(-0.5, 0.5), rng.uniform(0.5, 2.0), 0.3, rng.uniform(-0.4, 0.4))
        rate, acceleration = Rates(*rng.normal(size=5)), Accelerations(*rng.normal(size=5))
        travel = Travel(rng.uniform(0.0, 6.0), rng.normal())
        found = needed_load(angles, rate, acceleration, 0.4, travel, POINT)
        np.testing.assert_allclose(found[:2], published(angles, rate, acceleration, travel), rtol=1e-11)


@pytest.mark.parametrize("course", ["indoor", "outdoor"])
def test_needed_moments_are_those_of_newton_and_euler(course):
    """A trunk with inertia and a load on the bicycle, from positions and orientations alone."""
    motion = draw_motion(np.random.default_rng(3), course, NO_ERRORS)
    across, along, carried, forward, up = 1.1, 0.4, 20.0, 0.15, -0.25
    rider = ForceInertial.published(pivot_height=1.0)
    masses = {"trunk_across": across, "trunk_along": along, "carried_mass": carried}
    loaded = replace(rider, **masses, carried_forward=forward, carried_up=up)
    t = np.linspace(1.0, 9.0, 9)
    exact = exact_readings(motion, t, rider, (along, across, across))
    turned = [
        derivative(lambda time, which=which: getattr(exact_readings(motion, time, rider, (0.0,) * 3), which), t)
        for which in ("trunk_rate", "bicycle_rate")
    ]
    # the load: its own force, and moment about the pivot
    arm = np.array([forward, 0.0, -up])
    place = np.array([L_S, 0.0, -1.0]) + arm

    def contact(time):
        return rotation.rotate(motion.yawed(time), np.array([1.0, 0.0, 0.0])) * motion.speed(time)[:, None]

    acceleration = derivative(contact, t) + second_derivative(
        lambda time: rotation.rotate(motion.bicycle(time), np.array(place)), t
    )
    load = carried * rotation.rotate_back(motion.bicycle(t), acceleration - [0.0, 0.0, G])
    force, moment = load - exact.force, np.cross(arm, load) - exact.moment
    tilt = Rotation.from_euler("X", motion.phi_b(t)[:, None])
    force, moment = tilt.apply(force), tilt.apply(moment)
    angles = Angles(motion.phi_h(t), motion.theta(t), motion.phi(t), motion.phi_b(t))
    omega_h, omega_b = tuple(exact.trunk_rate.T), tuple(exact.bicycle_rate.T)
    rate = rates(angles, omega_h, omega_b, rider.imu_tilt)
    found = gyroscope_accelerations(angles, rate, omega_h, tuple(turned[0].T), tuple(turned[1].T), rider.imu_tilt)
    travel = Travel(motion.speed(t), derivative(motion.speed, t))
    needed = needed_load(angles, rate, found, omega_h[0], travel, loaded)
    np.testing.assert_allclose(needed.tau_phi_h, moment[:, 0], atol=2e-4)
    wanted = np.cos(angles.phi_h) * moment[:, 1] + np.sin(angles.phi_h) * moment[:, 2]
    np.testing.assert_allclose(needed.tau_theta, wanted, atol=2e-4)
    np.testing.assert_allclose(np.stack(needed.force, axis=-1), force, atol=2e-4)
    # what the seat carries points along the apparent vertical
    seat = -force
    ratio = np.arctan2(*Rotation.from_euler("X", motion.phi_b(t)[:, None]).inv().apply(seat)[:, 1:].T)
    np.testing.assert_allclose(ratio, angles.phi_b - apparent_vertical(needed.force), atol=1e-6)
    np.testing.assert_allclose(
        np.stack(in_bicycle(needed.force, angles.phi_b), axis=-1), tilt.inv().apply(force), atol=2e-4
    )


def test_at_rest_the_torque_is_gravity_s():
    for angles in (Angles(0.2, 1.0, 0.1, -0.1), Angles(-0.5, 1.8, 0.0, 0.3)):
        needed = needed_load(angles, *STILL, POINT)
        lean = -M_H * G * H_H * math.sin(angles.phi_h) * math.sin(angles.theta)
        pitch = M_H * G * H_H * math.cos(angles.phi_h) * math.cos(angles.theta)
        np.testing.assert_allclose(needed[:2], (lean, pitch), rtol=1e-13)
        # (13) reads the roll at rest
        R = [-part for part in in_bicycle(needed.force, angles.phi_b)]
        assert math.atan2(R[1], R[2]) == pytest.approx(angles.phi_b, abs=1e-14)


@pytest.mark.parametrize(
    ("turning", "lean", "roll", "reads"),
    [
        (False, 9.27, 9.27, 9.27),
        (True, 9.27, 9.27, 0.39),
        (True, 20.0, 5.20, -3.59),
        (True, 0.0, 13.0, 4.04),
        (True, 20.0, 0.0, -8.92),
    ],
    ids=["straight", "coordinated", "leaning in", "rider upright", "bicycle upright"],
)
def test_what_the_seat_s_force_tells_of_the_roll(turning, lean, roll, reads):
    """v = 2 m/s, r = 2.5 m, θ = 60°: R_y / R_z as an independent simulation found it."""
    angles = Angles(lean * DEG, 60.0 * DEG, 0.0, roll * DEG)
    rate = Rates(0.0, 0.0, 0.0, 0.0, 0.8 if turning else 0.0)
    load = needed_load(angles, rate, STILL[1], 0.0, Travel(2.0, 0.0), POINT)
    R = [-part for part in in_bicycle(load.force, angles.phi_b)]
    assert math.atan2(R[1], R[2]) / DEG == pytest.approx(reads, abs=0.01)


@pytest.mark.parametrize(
    ("height", "sensitivity"), [(None, -118.4), (0.33, 0.0), (0.42, -25.4), (0.60, -53.3)], ids=str
)
def test_gravity_cancels_with_accelerometers(height, sensitivity):
    """dτ/dφ_h at rest, θ = 60°, φ_h = −20°: with (8) only 1 − h_h/h of gravity is left."""
    true = Angles(-20.0 * DEG, 60.0 * DEG, 0.0, 0.0)
    if height is not None:
        orientation = Rotation.from_euler("XYX", [true.phi_h, true.theta, true.phi])
        a_h = tuple(orientation.inv().apply([0.0, 0.0, -G]))

    def torque(phi_h):
        angles, rate, acceleration, axial, travel = true._replace(phi_h=phi_h), *STILL
        if height is not None:
            rider = replace(POINT, trunk_imu_height=height)
            acceleration = accelerometer_accelerations(angles, rate, a_h, 0.0, 0.0, 0.0, travel, rider)
        return needed_load(angles, rate, acceleration, axial, travel, POINT).tau_phi_h

    slope = (torque(true.phi_h + 1e-6) - torque(true.phi_h - 1e-6)) / 2e-6
    assert slope == pytest.approx(sensitivity, abs=0.06)


def test_centre_of_pressure_is_that_of_the_environment_s_cells():
    cells = LoadCells()
    force, at = 400.0, (0.03, 0.012)
    # ours: y to the left; an upward force there has moments y F and −x F
    share = cells.share(np.array([0.0, 0.0, force]), np.array([at[1] * force, -at[0] * force, 0.0]))
    x_C, y_C = centre_of_pressure((share[0], share[2], share[1]), POINT)
    assert (x_C, y_C) == pytest.approx((at[0], -at[1]), abs=1e-12)


def test_the_seat_s_load_is_moved_by_cross_products():
    rng = np.random.default_rng(5)
    sensors = replace(POINT, seat_forward=0.02, seat_below=0.15)
    F, T = rng.normal(0.0, 200.0, 3), rng.normal(0.0, 20.0, 3)
    turn = Rotation.from_euler("Y", sensors.post_tilt)
    sensor = np.array([sensors.seat_forward, 0.0, sensors.seat_below]) + turn.apply([0.0, 0.0, sensors.post_length])
    wanted = -(turn.apply(T) + np.cross(sensor, turn.apply(F)))
    found = []
    for centre in ((0.0, 0.0), (0.04, -0.03)):
        R, M = seat_load((tuple(F), tuple(T)), sensors, centre)
        np.testing.assert_allclose(R, turn.apply(F), atol=1e-10)
        found.append(trunk_moment(R, M, centre, sensors))
        # the centre of pressure cancels
        np.testing.assert_allclose(found[-1], wanted, atol=1e-10)
    R, M = seat_load((tuple(F), tuple(T)), sensors, (0.04, 0.0))
    published = trunk_moment(R, M, (0.04, 0.0), sensors, published=True)
    # with the published sign it counts twice
    assert published[1] - wanted[1] == pytest.approx(-2.0 * R[2] * (0.04 + sensors.seat_forward), abs=1e-9)


def test_pedals_push_where_they_are():
    axle, legs = {"axle_forward": 0.17, "axle_up": -0.76}, {"pedal_down": 150.0, "pedal_back": 25.0}
    pedals = replace(POINT, **axle, **legs, drive_forward=0.38)
    # (x, z) of the axle from the pivot, z down; force of the feet on the pedals (−25, 150)
    wanted = -np.cross([0.17, 0.0, 0.76], [-25.0, 0.0, 150.0])[1]
    assert pedal_moment(150.0, pedals) == pytest.approx(wanted)
    assert pedal_moment(250.0, pedals) == pytest.approx(wanted + 38.0)


def test_resting_legs_are_in_balance():
    """Virtual work: what the pedal's force does over a small displacement lifts the leg's weight."""
    geometry, crank, step = RiderGeometry(), np.linspace(0.0, 2.0 * np.pi, 12), 1e-5
    geometry = replace(geometry, pedal_offset=geometry.hip[1])
    leg = resting_leg(geometry, crank)
    weight = LEG_MASS * geometry.rider_mass * 9.81
    longer, shorter = (replace(geometry, crank_length=geometry.crank_length + d) for d in (step, -step))
    pairs = (
        (resting_leg(geometry, crank + step), resting_leg(geometry, crank - step)),
        (resting_leg(longer, crank), resting_leg(shorter, crank)),
    )
    for ahead, back in pairs:
        work = np.sum(leg.push * (ahead.pedal - back.pedal), axis=-1)
        np.testing.assert_allclose(work / step, weight * (ahead.centre - back.centre)[:, 1] / step, atol=1e-5)
    both = resting_legs(geometry)
    assert 0.45 < both.down / (2.0 * weight) < 0.65
    assert geometry.crank_axle[2] < both.up < geometry.hip[2]
