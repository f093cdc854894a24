"""The force/inertial filter: Jacobians, another recursion, consistency, drop-outs, errata, what it is told."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest
import torch
from filterpy.kalman import ExtendedKalmanFilter
from scipy.spatial.transform import Rotation

from poise.baselines.studies.force_inertial.motion import DEG, NO_ERRORS, Errors, draw_motion, simulate
from poise.filters.bicycle.force_inertial.filter import ForceInertial
from poise.filters.bicycle.force_inertial.integration import ForceInertialIntegration
from poise.filters.bicycle.force_inertial.kinematics import DOWN, UP_THE_TRUNK, true_angles
from poise.filters.bicycle.force_inertial.readings import static_angles, steering
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.core import rotation
from poise.filters.core.estimator import run
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.metrics import rms
from poise.filters.core.recursion import Observer

RIDER = ForceInertial.for_rider(RiderGeometry())
VARIANTS = [
    RIDER,
    replace(RIDER, acceleration="accelerometer"),
    replace(RIDER, torque_model="static", torque_reading="without-z", handlebar_load="sum"),
    ForceInertial.published(
        form="published", acceleration="accelerometer", torque_reading="published", roll_model="published"
    ),
]
ANGLES = "force-inertial/trunk_angles"


def ride(seed=0, course="indoor", duration=20.0, errors=None):
    motion, noise = np.random.default_rng(seed).spawn(2)
    errors = Errors() if errors is None else errors
    return simulate(draw_motion(motion, course, errors), errors, ForceInertial.published(), duration, noise)


def random_sample(rng):
    sample = {channel.name: rng.normal(0.0, 0.5, channel.size) for channel in RIDER.channels}
    sample["wheel/speed"] = rng.uniform(1.0, 5.0, 1)
    sample["seat/load_cells"] = rng.uniform(80.0, 200.0, 3)
    sample["seat/wrench"] = rng.normal([0.0, 0.0, -400.0, 0.0, 0.0, 0.0], 20.0)
    sample["handlebar/force"] = rng.normal([0.0, 0.0, -60.0, 0.0, 0.0, -60.0], 10.0)
    return sample


def random_state(rng):
    state = rng.normal(0.0, 0.5, 27)
    state[:4] = rng.normal([0.0, 1.0, 0.0, 0.0], 0.2)
    state[4:7] *= 0.01
    state[13] = rng.uniform(1.0, 5.0)
    return state


def errors_deg(pose, truth, skip):
    """RMS of φ_h, θ, φ, φ_b."""
    angles = rotation.wrap(pose[ANGLES] - truth[ANGLES])
    both = np.concatenate([angles, pose["bicycle/roll"] - truth["bicycle/roll"]], axis=-1)
    return np.degrees(rms(both[skip:]))


@pytest.mark.parametrize("model", VARIANTS, ids=["default", "accelerometers", "static", "published"])
def test_jacobians_are_central_differences(model):
    rng, step = np.random.default_rng(0), 1e-6
    for _ in range(5):
        x, z, previous = random_state(rng), random_sample(rng), random_sample(rng)
        _, F, Q = model.predict(x, z, previous)
        _, H, R = model.residual(x, z)
        assert np.linalg.eigvalsh(Q).min() > -1e-15
        assert np.linalg.eigvalsh(R).min() > 0.0
        columns = [k for k in range(7) if not (model.form == "published" and k == 6)]
        for k in columns:
            unit = np.eye(7)[k]
            ahead, back = model.retract(x, step * unit), model.retract(x, -step * unit)
            moved = model.predict(ahead, z, previous)[0][:7] - model.predict(back, z, previous)[0][:7]
            np.testing.assert_allclose(F[:, k], moved / (2.0 * step), atol=1e-6)
            seen = model.residual(back, z)[0] - model.residual(ahead, z)[0]
            np.testing.assert_allclose(H[:, k], seen / (2.0 * step), atol=1e-6 * max(1.0, np.abs(H[:, k]).max()))


def test_partial_jacobian_is_the_corrected_21():
    """Rates and accelerations frozen, point mass: the terms with φ̈_b and the corrected H_14."""
    model = ForceInertial.published(jacobian="partial", roll_model="published")
    rng = np.random.default_rng(3)
    for _ in range(5):
        x, z = random_state(rng), random_sample(rng)
        H = model.residual(x, z)[1]
        plain = model.residual(_without_roll_acceleration(model, x), z)[1]
        f, t, p, b = x[:4]
        rate, found, _ = model._motion(x, _arrays(x), list(x[4:7]), whole=False)
        sd, cd = math.sin(b - f), math.cos(b - f)
        st, ct = math.sin(t), math.cos(t)
        factor = model.trunk_mass * model.pivot_height * model.trunk_height
        grown = {(0, 0): sd * st, (0, 1): cd * ct, (1, 0): cd * ct, (1, 1): sd * st, (1, 3): -cd * ct}
        for (row, column), value in grown.items():
            added = H[row, column] - plain[row, column]
            assert added == pytest.approx(factor * found.phi_b * value, abs=1e-8)
        turning = sd * found.phi_b + cd * rate.phi_b**2 + math.cos(b) * math.cos(f) * rate.psi**2
        assert H[0, 3] == pytest.approx(-factor * st * turning, abs=1e-8)
        s_h, c_h, s_p, c_p = math.sin(f), math.cos(f), math.sin(p), math.cos(p)
        level = [c_h * c_p - s_h * ct * s_p, -st * c_h * s_p, -s_h * s_p + c_h * ct * c_p, 0.0, 0.0, 0.0, 0.0]
        np.testing.assert_allclose(H[3], level, atol=1e-14)
        np.testing.assert_allclose(H[2], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], atol=1e-14)


def _arrays(x):
    from poise.filters.bicycle.force_inertial.kinematics import Angles

    return Angles(*(x[k] for k in range(4)))


def _without_roll_acceleration(model, x):
    """The same state with a turn of the bicycle's gyroscope that has no part along x of B, and the same ψ̈."""
    x = x.copy()
    s, c = math.sin(model.imu_tilt), math.cos(model.imu_tilt)
    turn = x[17:20] * [1.0, -1.0, -1.0]
    along = c * turn[0] + s * turn[2]
    x[17:20] = (turn - along * np.array([c, 0.0, s])) * [1.0, -1.0, -1.0]
    return x


def test_equal_to_filterpy():
    data, _ = ride(duration=4.0)
    model = ForceInertial.published()
    ours = KalmanFilter(model, compiled=False).run(data)
    samples = [{name: array[k] for name, array in data.items()} for k in range(len(data["wheel/speed"]))]
    x, P = model.prior(samples[0])
    theirs = ExtendedKalmanFilter(dim_x=7, dim_z=4)
    theirs.P = P
    for k in range(1, len(samples)):
        x, F, Q = model.predict(x, samples[k], samples[k - 1])
        theirs.x = np.zeros(7)
        theirs.F, theirs.Q = F, Q
        theirs.predict()
        r, H, R = model.residual(x, samples[k])
        theirs.R = R
        theirs.update(r, lambda _, H=H: H, lambda _: np.zeros(4))
        x = model.finish(model.retract(x, theirs.x), samples[k])
        np.testing.assert_allclose(x[:3], ours.pose[ANGLES][k], atol=1e-9)
        np.testing.assert_allclose(theirs.P, ours.covariance[k], atol=1e-9)


def test_forms_agree():
    data, _ = ride(duration=3.0)
    compiled, arrays = (KalmanFilter(RIDER, compiled=each).run(data) for each in (True, False))
    tensors = run(KalmanFilter(RIDER), {name: torch.from_numpy(array) for name, array in data.items()})
    for name, values in arrays.pose.items():
        np.testing.assert_allclose(compiled.pose[name], values, atol=1e-9)
        np.testing.assert_allclose(tensors.pose[name].numpy(), values, atol=1e-9)
    batch = {name: np.stack([array, array[::-1]], axis=1) for name, array in data.items()}
    together = KalmanFilter(RIDER).run(batch)
    np.testing.assert_allclose(together.pose[ANGLES][:, 0], compiled.pose[ANGLES], atol=1e-12)


@pytest.mark.parametrize("course", ["indoor", "outdoor"])
def test_perfect_data_are_followed(course):
    """A point mass with level shoulders: what is left is the Euler step and the lag of the differences."""
    data, truth = ride(1, course, 20.0, NO_ERRORS)
    pose = KalmanFilter(ForceInertial.published(gyroscope_sample="previous")).run(data).pose
    assert np.all(errors_deg(pose, truth, 250) < [0.5, 0.5, 0.8, 0.2])


def test_corrected_against_printed():
    """Errata that change what comes out, indoors: (13) at face value, (12) without N_z."""
    data, truth = ride(2, "indoor", 12.0)
    found = {}
    for name, options in {
        "corrected": {},
        "published (13)": {"roll_model": "published"},
        "without N_z": {"torque_reading": "without-z"},
        "sign of (12)": {"torque_reading": "published"},
    }.items():
        model = ForceInertial.published(**options)
        kalman = KalmanFilter(model, compiled=not options)  # each of the others would be compiled for one run
        found[name] = errors_deg(kalman.run(data).pose, truth, 400)
    assert np.all(found["corrected"] < [1.5, 1.5, 2.0, 0.3])
    assert 7.0 < found["published (13)"][3] < 11.0
    assert found["without N_z"][1] > 1.5 * found["corrected"][1]
    assert found["sign of (12)"][1] > 10.0


@pytest.mark.parametrize("channel", [channel.name for channel in RIDER.channels])
def test_drop_outs_are_survived(channel):
    data, truth = ride(3, "indoor", 30.0)
    rng = np.random.default_rng(0)
    broken = {name: array.copy() for name, array in data.items()}
    lost = np.flatnonzero(rng.random(500) < 0.5) + 500
    broken[channel][lost] = np.nan
    pose = KalmanFilter(ForceInertial.published()).run(broken).pose
    assert all(np.isfinite(values).all() for values in pose.values())
    assert np.all(errors_deg(pose, truth, 1200) < [2.0, 2.0, 2.5, 0.5])


def test_load_cells_cancel():
    data, _ = ride(4, duration=3.0)
    lost = data | {"seat/load_cells": data["seat/load_cells"].copy()}
    lost["seat/load_cells"][1:] = np.nan
    model = KalmanFilter(ForceInertial.published(), compiled=False)
    np.testing.assert_allclose(model.run(lost).pose[ANGLES], model.run(data).pose[ANGLES], atol=1e-9)


def test_far_starts_converge():
    """35° off in φ_h: one update with the tuning of the synthetic study."""
    data, truth = ride(5, "indoor", 20.0)
    kalman = KalmanFilter(ForceInertial.published())
    first = {name: array[0] for name, array in data.items()}
    for off in (35.0, -35.0):
        state, _ = kalman.step(kalman.init(first), first)
        x = state.x.copy()
        x[:4] = [*truth[ANGLES][0], truth["bicycle/roll"][0, 0]]
        x[0] += off * DEG
        rest = {name: array[1:] for name, array in data.items()}
        estimate, _ = kalman.run_from(state._replace(x=x), rest)
        end = {name: values[1:] for name, values in truth.items()}
        assert np.all(errors_deg(estimate.pose, end, 800) < [2.0, 2.0, 2.5, 0.5])


def test_static_angles_are_found():
    """At rest, with any load on hands and pedals that balances, the angles of the trunk come out exactly."""
    rng = np.random.default_rng(6)
    for lateral in (0.0, -1.6):
        phi_h, theta, phi_b = rng.uniform(-0.4, 0.4), rng.uniform(0.7, 1.4), rng.uniform(-0.2, 0.2)
        model = replace(RIDER, pedal_share=0.0)
        f = np.array([0.0, lateral, -model.gravity])
        lean, back = Rotation.from_euler("XY", [phi_h, theta]), Rotation.from_euler("X", phi_b).inv()
        trunk = lean.apply([model.trunk_height, 0.0, 0.0])
        carried = back.inv().apply([model.carried_forward, 0.0, -model.carried_up])
        moment = back.apply(np.cross(trunk, model.trunk_mass * f) + np.cross(carried, model.carried_mass * f))
        force = -back.apply((model.trunk_mass + model.carried_mass) * f)
        arm = np.array([model.seat_forward, 0.0, model.seat_below])
        tilt = Rotation.from_euler("Y", model.post_tilt)
        arm = arm + tilt.apply([0.0, 0.0, model.post_length])
        z = {
            "seat/wrench": np.concatenate(
                [tilt.inv().apply(force) @ DOWN, tilt.inv().apply(-moment - np.cross(arm, force)) @ DOWN]
            ),
            "seat/load_cells": np.full(3, np.nan),
            "handlebar/force": np.zeros(6),
        }
        found = static_angles(model, model._readings(z, np.array(0.0)), np.array(lateral))
        np.testing.assert_allclose([found[0], found[1], found[3]], [phi_h, theta, phi_b], atol=1e-9)


def test_integration_drifts_and_the_filter_does_not():
    data, truth = ride(7, "indoor", 40.0, replace(Errors(), bias=0.5 * DEG))
    alone = Observer(ForceInertialIntegration(**_shared(ForceInertial.published()))).run(data).pose
    fused = KalmanFilter(ForceInertial.published()).run(data).pose
    drift, kept = errors_deg(alone, truth, 1500), errors_deg(fused, truth, 1500)
    assert drift[:3].max() > 2.5 * kept[:3].max()
    assert np.isfinite(alone[ANGLES]).all()


def _shared(model):
    from dataclasses import fields

    return {field.name: getattr(model, field.name) for field in fields(ForceInertialIntegration)}


def test_a_bias_is_found():
    data, truth = ride(8, "outdoor", 60.0)
    kalman = KalmanFilter(ForceInertial.published())
    bias = kalman.run(data).pose["trunk_imu/gyroscope_bias"]
    left = np.degrees(rms(bias[2000:] - truth["trunk_imu/gyroscope_bias"][2000:]))
    assert np.all(left < 0.15)
    short = {name: array[:50] for name, array in data.items()}
    fixed = (
        KalmanFilter(ForceInertial.published(bias_model=False), compiled=False)
        .run(short)
        .pose["trunk_imu/gyroscope_bias"]
    )
    assert np.all(fixed == 0.0)


def test_steering_follows_the_path():
    yaw, speed = np.array([0.4, -0.4, 0.1]), np.array([1.0, 2.0, 0.0])
    found = steering(RIDER, speed, yaw)
    wanted = np.arctan(1.05 * yaw / np.array([1.0, 2.0, 0.3])) / math.cos(RIDER.caster)
    np.testing.assert_allclose(found, wanted, rtol=1e-12)


def test_true_angles_are_those_of_the_frames():
    rng = np.random.default_rng(9)
    wanted = np.stack([rng.uniform(-1, 1, 50), rng.uniform(0.2, 2.9, 50), rng.uniform(-3, 3, 50)], axis=-1)
    yaw, roll = rng.uniform(-3, 3, 50), rng.uniform(-0.5, 0.5, 50)
    ground = Rotation.from_euler("ZYX", np.stack([yaw, 0.0 * yaw, roll], axis=-1))
    level = Rotation.from_euler("Z", yaw[:, None])
    trunk = level * Rotation.from_matrix(DOWN @ Rotation.from_euler("XYX", wanted).as_matrix() @ UP_THE_TRUNK)
    truth = {
        "bicycle/orientation": ground.as_quat(scalar_first=True),
        "trunk/orientation": trunk.as_quat(scalar_first=True),
    }
    np.testing.assert_allclose(true_angles(truth)[ANGLES], wanted, atol=1e-12)
    with pytest.raises(ValueError, match="trunk/orientation"):
        true_angles({"bicycle/orientation": ground.as_quat(scalar_first=True)})


def test_what_cannot_be_is_refused():
    options = [field.name for field in fields(ForceInertial) if isinstance(field.default, str)]
    assert len(options) == 8
    for name in options:
        with pytest.raises(ValueError, match=name):
            ForceInertial(**{name: "wrong"})
    with pytest.raises(ValueError, match="torque_noise must be positive"):
        ForceInertial(torque_noise=0.0)
    with pytest.raises(ValueError, match="carried_mass must not be negative"):
        ForceInertial.for_rider(RiderGeometry(), carried_mass=-1.0)


def test_defaults_are_the_usual_rider_s():
    told = ForceInertial.for_rider(RiderGeometry())
    made = ForceInertial()
    for name in ("pivot_forward", "pivot_height", "trunk_mass", "trunk_height", "carried_mass", "pedal_down"):
        assert getattr(made, name) == pytest.approx(getattr(told, name), rel=1e-3), name
