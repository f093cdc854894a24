"""The whole-body filter: its equations against sympy and finite differences, filterpy, drop-outs, wrong starts."""

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import Point, ReferenceFrame, dynamicsymbols

from poise.baselines.studies.whole_body.motion import IDEAL, ExactRide
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.bicycle.whole_body.filter import CONSTRAINTS, WholeBody
from poise.filters.bicycle.whole_body.integration import WholeBodyIntegration
from poise.filters.bicycle.whole_body.linkage import ERROR_SIZE, OUTPUTS, seat_moments, true_angles
from poise.filters.core import metrics
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.recursion import Observer
from poise.filters.core.rotation import euler_axes, euler_matrix

from .whole_body_cases import RIDER

INSTANT = WholeBody.for_rider(RIDER, sampling="instant", seat_share=1.0)
VARIANTS = {
    "corrected": INSTANT,
    "published": replace(INSTANT, lateral="published", torque="published", knee_axis="y", published_knee=True),
    "hands carry": replace(INSTANT, seat_share=0.3, lateral="sign", constraints=("C1", "C6"), usual_twist=True),
}


def samples(ride, model, part=slice(None)):
    return {channel.name: ride.measurements[channel.name][part] for channel in model.channels}


def errors(estimate, ride, part=slice(None)):
    """Degrees by quantity: largest over time and components."""
    return {
        quantity.name: np.degrees(
            np.nanmax(metrics.error(quantity, estimate.pose[quantity.name][part], ride.truth[quantity.name][part]))
        )
        for quantity in OUTPUTS
    }


@pytest.fixture(scope="module")
def ride():
    return ExactRide(RIDER, "indoor", seed=3).record(20.0, sampling="interval")


@pytest.fixture(scope="module")
def ideal():
    return ExactRide(RIDER, "outdoor", swivel=0.0, seed=4).record(4.0, errors=IDEAL)


def some_state(model, ideal, tick=200):
    """A state in the middle of a ride, off its constraints, with lively memories."""
    z, before = ({name: values[k] for name, values in samples(ideal, model).items()} for k in (tick, tick - 1))
    rng = np.random.default_rng(5)
    x = model.prior(z)[0]
    x[:ERROR_SIZE] += 0.05 * rng.standard_normal(ERROR_SIZE)
    x[ERROR_SIZE + 5 : ERROR_SIZE + 8] = rng.standard_normal(3)
    return x, z, before


@pytest.mark.parametrize("name", list(VARIANTS))
def test_jacobians_through_retract(name, ideal):
    model = VARIANTS[name]
    x, z, before = some_state(model, ideal)
    _, F, _ = model.predict(x, z, before)
    r, H, R = model.residual(x, z)
    assert r.shape == (model.residual_size,)
    assert H.shape == (model.residual_size, 20)
    assert np.all(np.diag(R) > 0.0)
    step = 1e-6
    for i in range(ERROR_SIZE):
        plus, minus = (model.retract(x, sign * step * np.eye(ERROR_SIZE)[i]) for sign in (1.0, -1.0))
        slope = (model.predict(plus, z, before)[0] - model.predict(minus, z, before)[0])[:ERROR_SIZE] / (2.0 * step)
        np.testing.assert_allclose(F[:, i], slope, atol=1e-6)
        slope = (model.residual(plus, z)[0] - model.residual(minus, z)[0]) / (2.0 * step)
        np.testing.assert_allclose(-H[:, i], slope, atol=1e-6)


def test_lateral_acceleration_against_sympy():
    """(3*) is the specific force across a bicycle that rolls on its rear contact point, and print is not."""
    t = dynamicsymbols._t
    yaw, roll, speed = dynamicsymbols("yaw roll speed")
    px, py, g = sp.symbols("px py g")
    ground, heading, frame = ReferenceFrame("N"), ReferenceFrame("R"), ReferenceFrame("B")
    heading.orient_axis(ground, ground.y, yaw)
    frame.orient_axis(heading, heading.x, roll)
    contact, place = Point("C"), Point("I")
    contact.set_vel(ground, speed * heading.x)
    place.set_pos(contact, px * frame.x + py * frame.y)
    place.v2pt_theory(contact, ground, frame)
    across = (place.acc(ground) + g * ground.y).dot(frame.z)
    rng = np.random.default_rng(0)
    values = rng.uniform(-0.5, 0.5, 6)
    names = (yaw.diff(t, 2), yaw.diff(t), roll.diff(t, 2), roll.diff(t), roll, speed.diff(t))
    numbers = dict(zip(names, values, strict=True))
    v = 3.0
    expected = float(across.subs(numbers).subs({speed: v, yaw: 0.3, px: 0.37, py: 0.71, g: 9.8}))
    model = replace(INSTANT, gravity=9.8, bicycle_imu=(0.37, 0.0, 0.71))
    x = np.zeros(model.state_size)
    x[0], x[1], x[31] = values[4], values[0], v
    x[23], x[25] = values[1] * math.cos(values[4]), values[2]
    assert model._lateral(x)[0][0] == pytest.approx(expected, abs=1e-12)
    assert abs(replace(model, lateral="sign")._lateral(x)[0][0] - expected) > 0.1
    assert abs(replace(model, lateral="published")._lateral(x)[0][0] - expected) > 1.0


def test_outputs_are_those_of_an_exact_motion(ideal):
    """Accelerations, seat torque and constraints of a motion whose accelerations are differences of positions."""
    motion = ExactRide(RIDER, "outdoor", swivel=0.0, seed=4)
    time = ideal.time
    x = np.zeros((time.size, INSTANT.state_size))
    names = ("trunk/angles", "shoulder_right/angles", "hip_right/angles", "shoulder_left/angles", "hip_left/angles")
    for name, start in zip(names, (2, 8, 11, 14, 17), strict=True):
        x[:, start : start + 3] = ideal.truth[name]
    x[:, :1], x[:, 31:32] = ideal.truth["bicycle/roll"], ideal.truth["bicycle/speed"]
    x[:, 20:21], x[:, 21:22] = ideal.truth["bicycle/steer"], ideal.truth["bicycle/crank"]
    h = 1e-4
    rate, later, before = (motion.rates(time + step)["bicycle_imu"] for step in (0.0, h, -h))
    yaw = motion.functions["yaw"]
    forces = motion.forces(time)
    x[:, 1], x[:, 22:25] = (yaw(time + h) - yaw(time - h)) / (2.0 * h), rate
    x[:, 25:28] = (later - before) / (2.0 * h)
    z = samples(ideal, INSTANT)
    x[:, 28:31] = INSTANT._seat_force(z, x[:, 22:25], x[:, 25:28])
    np.testing.assert_allclose(x[:, 28:31], forces["pivot"], atol=1e-5)
    trunk = euler_matrix("zxy", ideal.truth["trunk/angles"])
    x[:, 5:8] = (trunk @ forces["trunk_imu"][..., None])[..., 0] - forces["pivot"]
    r, _, _ = INSTANT.residual(x, z)
    np.testing.assert_allclose(r, 0.0, atol=2e-5)


def test_the_seat_moment_of_point_masses():
    """(9*) against Newton's law for two points, one on the trunk and one on the frame, with the support's moment."""
    turning, sitting = seat_moments(RIDER)
    assert turning[2] > 0.9 * RIDER.trunk_mass * RIDER.trunk_centre[2]
    assert seat_moments(RiderGeometry())[1][2] > 0.0 == sitting[2]
    model = replace(INSTANT, turning_moment=(0.0, 0.0, 5.0), sitting_moment=(1.0, 0.0, 2.0))
    x = np.zeros(model.state_size)
    x[2:5], x[28:31] = (-0.5, 0.1, 0.2), (0.3, 9.7, -0.6)
    c, s = np.cos(x[2:5]), np.sin(x[2:5])
    trunk = 5.0 * np.array([-s[0] * c[1], c[0] * c[1], s[1]])
    R, J = euler_matrix("zxy", x[2:5]), euler_axes("zxy", x[2:5])
    expected = np.cross(trunk + np.array([1.0, 2.0, 0.0]), x[28:31])[0]
    assert model._torque(x, R, J)[0][0] == pytest.approx(expected, abs=1e-12)
    # a bicycle that leans at rest, rider upright on it: the static special case of (9*)
    roll, weight = 0.1, 5.0 * 9.80665
    x[28:31] = 9.80665 * np.array([0.0, math.cos(roll), -math.sin(roll)])
    model = replace(model, sitting_moment=(0.0, 0.0, 0.0))
    static = -weight * (s[1] * math.cos(roll) + c[0] * c[1] * math.sin(roll))
    assert model._torque(x, R, J)[0][0] == pytest.approx(static, abs=1e-12)


def test_without_errors_of_sensors_the_truth_is_found(ideal):
    estimate = KalmanFilter(replace(INSTANT, trunk_flexion=0.5, swivel_noise=0.3), compiled=False).run(
        samples(ideal, INSTANT)
    )
    assert max(errors(estimate, ideal, slice(300, None)).values()) < 0.7
    assert {name: value.shape for name, value in true_angles(ideal.truth).items()} == {
        name: value.shape for name, value in estimate.pose.items()
    }
    with pytest.raises(ValueError, match="bicycle/roll"):
        true_angles({})


def test_equal_to_filterpy(ideal):
    from filterpy.kalman import KalmanFilter as Filterpy

    measurements = samples(ideal, INSTANT, slice(0, 40))
    ours = KalmanFilter(INSTANT, compiled=False).run(measurements)
    ticks = [{name: values[k] for name, values in measurements.items()} for k in range(40)]
    x, P = INSTANT.prior(ticks[0])
    other = Filterpy(dim_x=20, dim_z=17)
    other.P = P
    for tick in range(1, 40):
        x, F, Q = INSTANT.predict(x, ticks[tick], ticks[tick - 1])
        other.x = np.zeros((20, 1))
        other.predict(F=F, Q=Q)
        r, H, R = INSTANT.residual(x, ticks[tick])
        other.update(r[:, None], H=H, R=R)
        x = INSTANT.finish(INSTANT.retract(x, other.x[:, 0]), ticks[tick])
        np.testing.assert_allclose(ours.covariance[tick], other.P, atol=1e-9)
    for name, value in INSTANT.pose(x).items():
        np.testing.assert_allclose(ours.pose[name][-1], value, atol=1e-9)


def test_drop_outs_of_any_channel_are_survived(ride):
    """Half of the samples of one channel gone for 10 s, another channel in every sequence of a batch."""
    model = WholeBody.for_rider(RIDER, seat_share=1.0)
    complete = samples(ride, model)
    names, rng = list(complete), np.random.default_rng(6)
    batch = {name: np.repeat(values[:, None], len(names), axis=1) for name, values in complete.items()}
    for index, name in enumerate(names):
        batch[name][300:1300][rng.random(1000) < 0.5, index] = np.nan
    kalman = KalmanFilter(model, keep_covariance=False)
    estimate, alone = kalman.run(batch), kalman.run(complete)
    for quantity in OUTPUTS:
        found = estimate.pose[quantity.name]
        assert np.all(np.isfinite(found))
        apart = np.degrees(metrics.error(quantity, found, alone.pose[quantity.name][:, None]))
        assert apart[1800:].max() < 1.5, (quantity.name, names[int(apart[1800:].max(axis=0).argmax())])


@pytest.mark.parametrize("offset", [10.0, 20.0])
def test_wrong_starts_are_recovered_from(ride, offset):
    model = WholeBody.for_rider(
        RIDER, seat_share=1.0, swivel_noise=0.3, trunk_prior=0.35, limb_prior=0.35, roll_prior=0.35
    )
    kalman = KalmanFilter(model, keep_covariance=False)
    measurements = samples(ride, model)
    first = {name: values[0] for name, values in measurements.items()}
    state, _ = kalman.step(kalman.init(first), first)
    signs = np.random.default_rng(7).choice([-1.0, 1.0], 20)
    signs[[1, 5, 6, 7]] = 0.0
    state.x[:ERROR_SIZE] += math.radians(offset) * signs
    estimate, _ = kalman.run_from(state, {name: values[1:] for name, values in measurements.items()})
    shifted = {name: value[400:] for name, value in estimate.pose.items()}
    alone = kalman.run(measurements).pose
    for quantity in OUTPUTS:
        apart = np.degrees(metrics.error(quantity, shifted[quantity.name], alone[quantity.name][401:]))
        assert apart[600:].max() < 3.0, quantity.name


def test_integration_starts_like_the_filter_and_is_exact_without_errors(ride):
    model = WholeBodyIntegration.for_rider(RIDER)
    observer = Observer(model, compiled=False)
    integrated = observer.run(samples(ride, model, slice(0, 1)))
    start = KalmanFilter(WholeBody.for_rider(RIDER), compiled=False).run(samples(ride, model, slice(0, 1)))
    for name, value in start.pose.items():
        np.testing.assert_array_equal(integrated.pose[name][0], value[0])
    ideal = ExactRide(RIDER, "held", swivel=0.0, seed=8).record(4.0, errors=IDEAL)
    still = observer.run(samples(ideal, model))
    assert max(errors(still, ideal).values()) < 1e-6
    with pytest.raises(ValueError, match="sampling must be"):
        WholeBodyIntegration(sampling="late")


def test_nothing_is_estimated_before_every_input_was_heard_of(ride):
    model = WholeBody.for_rider(RIDER)
    measurements = {name: values[:6].copy() for name, values in samples(ride, model).items()}
    measurements["thigh_left/gyr"][:2], measurements["crank/angle"][:4] = np.nan, np.nan
    measurements["wheel/speed"][:] = np.nan
    estimate = KalmanFilter(model, compiled=False).run(measurements)
    np.testing.assert_array_equal(np.isfinite(estimate.pose["trunk/angles"][:, 0]), [False] * 4 + [True] * 2)


def test_choices_are_checked():
    assert WholeBody(constraints=("C2", "C7")).residual_size == 9
    for name, value in {
        "constraints": ("C4",),
        "knee_axis": "z",
        "lateral": "x",
        "torque": "x",
        "sampling": "x",
    }.items():
        with pytest.raises(ValueError, match=name):
            WholeBody(**{name: value})
    for name in ("swivel_noise", "shock_time"):
        with pytest.raises(ValueError, match=f"{name} must be positive"):
            WholeBody(**{name: 0.0})
    assert set(CONSTRAINTS) == {"C1", "C2", "C3", "C5", "C6", "C7"}
    assert WholeBody.for_rider(RIDER, thigh=0.4).thigh == 0.4


def test_a_pivot_beside_the_middle_is_a_place_like_any_other() -> None:
    """Measured geometries have coordinates of any sign."""
    pivot = (0.26, -0.005, 1.06)
    assert WholeBody(trunk_pivot=pivot).trunk_pivot == pivot
