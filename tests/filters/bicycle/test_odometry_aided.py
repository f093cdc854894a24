"""Odometry-aided roll: the rolling wheel, Jacobians, consistency, rides, drop-outs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
import sympy
from scipy.spatial.transform import Rotation
from sympy.physics.mechanics import Point, ReferenceFrame, dynamicsymbols

from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.sensors.single_imu import imu_of
from poise.envs.data.trajectory import Trajectory
from poise.envs.record import record
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.bicycle.odometry_aided import OdometryAided
from poise.filters.core import rotation
from poise.filters.core.consistency import consistency, nees
from poise.filters.core.estimator import run
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.quantity import Channel
from poise.filters.registry import make

GRAVITY = np.array([0.0, 0.0, 9.81])
DT = 0.01
MOUNT = Rotation.from_euler("y", -10.0, degrees=True)
IMU = np.array([0.37, 0.0, 0.71])
CHANNELS = ["bicycle_imu/gyr", "bicycle_imu/acc", "wheel/speed"]


def ideal_ride(seed: int, length: int) -> tuple[dict[str, np.ndarray], Rotation, np.ndarray]:
    """A bicycle that rolls, pitches and yaws at will while its contact moves along its x axis.

    Returns:
        Ideal interval samples, orientation of the bicycle and velocity of the IMU (world) at their ends.
    """
    rng = np.random.default_rng(seed)
    t = DT * np.arange(length + 1)

    def waves(size: float, fastest: float) -> np.ndarray:
        phase, angular = rng.uniform(0.0, 6.28, 3), 2.0 * np.pi * rng.uniform(0.05, fastest, 3)
        return size * np.sin(angular * t[:, None] + phase).sum(axis=1)

    roll, pitch, speed = waves(0.12, 0.5), waves(0.02, 0.3), 3.0 + waves(0.4, 0.2)
    yaw = np.cumsum(waves(0.3, 0.3)) * DT
    turned = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1))
    turn = (turned[:-1].inv() * turned[1:]).as_rotvec()
    # the rate at a tick, from the turns on both sides of it
    rate = np.vstack([turn[:1], 0.5 * (turn[:-1] + turn[1:]), turn[-1:]]) / DT
    velocity = turned.apply(np.stack([speed, 0.0 * t, 0.0 * t], axis=1) + np.cross(rate, IMU))
    middle = turned[:-1] * Rotation.from_rotvec(0.5 * turn)
    force = middle.inv().apply(np.diff(velocity, axis=0) / DT + GRAVITY)
    data = {
        "bicycle_imu/gyr": MOUNT.inv().apply(turn / DT),
        "bicycle_imu/acc": MOUNT.inv().apply(force),
        "wheel/speed": speed[1:, None],
    }
    return data, turned[1:], velocity[1:]


def state(model: OdometryAided, seed: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Some state and sample in the middle of a ride."""
    data, turned, velocity = ideal_ride(seed, 30)
    bias = np.random.default_rng(seed).normal(0.0, 0.01, 3)
    x = np.concatenate([turned[20].as_quat(scalar_first=True), bias, velocity[20], [0.0]])
    return x, {name: array[20] for name, array in data.items()}


def difference(model: OdometryAided, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Error that takes x to y, through SciPy."""
    before, after = (Rotation.from_quat(each[:4], scalar_first=True) for each in (x, y))
    return np.concatenate([(after * before.inv()).as_rotvec(), y[4:10] - x[4:10]])


def test_the_contact_of_a_rolling_wheel_moves_along_the_bicycle() -> None:
    """Equation (1) from the mechanics of a thin wheel in SymPy, at any roll, and the filter's residual at it."""
    psi, phi, spin = dynamicsymbols("psi phi spin")
    r = sympy.symbols("r")
    world = ReferenceFrame("N")
    heading = world.orientnew("A", "Axis", (psi, world.z))
    frame = heading.orientnew("B", "Axis", (phi, heading.x))
    wheel = frame.orientnew("W", "Axis", (spin, frame.y))
    touching = Point("touching")
    touching.set_vel(world, 0)
    hub = touching.locatenew("hub", r * frame.z)
    hub.v2pt_theory(touching, world, wheel)
    below = hub.locatenew("below", -r * frame.z)
    below.v2pt_theory(hub, world, frame)
    time = dynamicsymbols._t
    expected = r * spin.diff(time) * frame.x
    assert sympy.simplify((below.vel(world) - expected).to_matrix(frame)) == sympy.zeros(3, 1)

    imu = below.locatenew("imu", IMU[0] * frame.x + IMU[2] * frame.z)
    imu.v2pt_theory(below, world, frame)
    values = {spin.diff(time): 9.0, psi.diff(time): 0.7, phi.diff(time): -0.4, psi: 0.3, phi: 0.25, r: 0.33}
    velocity = np.array(imu.vel(world).to_matrix(world).subs(values), dtype=float)[:, 0]
    rate = np.array(frame.ang_vel_in(world).to_matrix(frame).subs(values), dtype=float)[:, 0]
    turned = Rotation.from_euler("ZX", [0.3, 0.25])
    model = OdometryAided()
    x = np.concatenate([turned.as_quat(scalar_first=True), np.zeros(3), velocity, [0.0]])
    z = {"bicycle_imu/gyr": MOUNT.inv().apply(rate), "wheel/speed": np.array([0.33 * 9.0])}
    np.testing.assert_allclose(model.residual(x, z)[0], 0.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_jacobians_are_central_differences(seed: int) -> None:
    model = OdometryAided()
    x, z = state(model, seed)
    _, F, _ = model.predict(x, z, z)
    _, H, _ = model.residual(x, z)
    step = 1e-6
    for column in range(9):
        dx = np.zeros(9)
        dx[column] = step
        ahead, behind = (model.predict(model.retract(x, sign * dx), z, z)[0] for sign in (1.0, -1.0))
        # the turn by the bias of half an interval, and its curvature, are second order in the interval
        np.testing.assert_allclose(difference(model, behind, ahead) / (2.0 * step), F[:, column], atol=2e-3)
        ahead, behind = (model.residual(model.retract(x, sign * dx), z)[0] for sign in (1.0, -1.0))
        np.testing.assert_allclose((behind - ahead) / (2.0 * step), H[:, column], atol=1e-8)


def test_ideal_rides_are_followed() -> None:
    rides = [ideal_ride(seed, 1000) for seed in range(8)]
    data = {name: np.stack([ride[0][name] for ride in rides], axis=1) for name in CHANNELS}
    pose = KalmanFilter(OdometryAided()).run(data).pose
    angles = np.stack([turned.as_euler("ZYX") for _, turned, _ in rides], axis=1)
    for name, true in (("bicycle/roll", angles[..., 2]), ("bicycle/pitch", angles[..., 1])):
        error = np.degrees(pose[name][..., 0] - true)
        assert np.abs(error[500:]).max() < 0.15
    assert np.degrees(np.abs(angles[..., 2]).max()) > 10.0


@dataclass(frozen=True)
class Slipping(OdometryAided):
    """Sees [v_w, n_y, n_z] instead of [v_w, 0, 0]: slip as the model supposes it, one more channel."""

    channels: ClassVar[tuple[Channel, ...]] = (*OdometryAided.channels, Channel("slip", 2, "m/s"))

    def residual(self, x, z):
        r, H, R = super().residual(x, z)
        return r + np.concatenate([0.0 * z["slip"][..., :1], z["slip"]], axis=-1), H, R


def test_the_covariance_tells_the_truth() -> None:
    """NEES of 64 runs and NIS over time with the noises that the model supposes."""
    runs, length = 64, 400
    model = Slipping(gyroscope_noise=1e-3, bias_noise=1e-4, acceleration_noise=0.05, lateral_slip=0.01, jump=1e6)
    rng = np.random.default_rng(5)
    rides = [ideal_ride(seed, length) for seed in range(runs)]
    data = {name: np.stack([ride[0][name] for ride in rides], axis=1) for name in CHANNELS}
    bias = rng.normal(0.0, model.bias_prior, (1, runs, 3))
    bias = bias + np.cumsum(rng.normal(0.0, model.bias_noise * np.sqrt(DT), (length, runs, 3)), axis=0)
    data["bicycle_imu/gyr"] += MOUNT.inv().apply(bias.reshape(-1, 3)).reshape(bias.shape)
    data["bicycle_imu/gyr"] += rng.normal(0.0, model.gyroscope_noise / np.sqrt(DT), bias.shape)
    data["bicycle_imu/acc"] += rng.normal(0.0, model.acceleration_noise / np.sqrt(DT), bias.shape)
    data["wheel/speed"] += rng.normal(0.0, model.wheel_step / DT / np.sqrt(12.0), (length, runs, 1))
    slips = np.array([model.lateral_slip, model.vertical_slip]) / np.sqrt(DT)
    data["slip"] = rng.normal(0.0, 1.0, (length, runs, 2)) * slips
    filter = KalmanFilter(model, compiled=False)
    estimate, last = filter.run_from(filter.init({name: array[0] for name, array in data.items()}), data)
    squared = []
    for x, P, (_, turned, velocity), b in zip(last.x, last.covariance, rides, bias[-1], strict=True):
        # the filter's heading starts at zero, and is not estimated: inclination, bias, velocity in bicycle axes are
        back = Rotation.from_euler("Z", Rotation.from_quat(x[:4], scalar_first=True).as_euler("ZYX")[0])
        back = back * Rotation.from_euler("Z", -turned[-1].as_euler("ZYX")[0])
        truth = [(back * turned[-1]).as_quat(scalar_first=True), b, back.apply(velocity[-1]), [0.0]]
        R = Rotation.from_quat(x[:4], scalar_first=True).as_matrix()
        J = np.eye(9)
        J[6:, :3], J[6:, 6:] = R.T @ rotation.skew(x[7:10]), R.T
        kept = [0, 1, *range(3, 9)]
        error, covariance = J @ difference(model, x, np.concatenate(truth)), J @ P @ J.T
        squared.append(nees(error[kept], covariance[np.ix_(kept, kept)]))
    found = consistency(np.array(squared), 8)
    assert found.consistent, found
    nis = consistency(estimate.nis[100:], 3)
    assert 0.95 < nis.ratio < 1.05, nis


@pytest.fixture(scope="module", params=["indoor_circle", "slalom"])
def ride(request: pytest.FixtureRequest) -> Trajectory:
    return recorded(request.param, 20.0, subject=2)


def recorded(scenario: str, duration: float, subject: int, seed: int = 4) -> Trajectory:
    env = RiderBicycleEnv(scenario, subject, suite=CHANNELS, rate=100.0, duration=duration)
    try:
        return record(env, seed=seed)
    finally:
        env.close()


def errors_deg(trajectory: Trajectory, skip: int = 500) -> dict[str, tuple[float, float]]:
    """Filter → RMS error of roll and pitch after the first ``skip`` ticks, deg."""
    geometry = RiderGeometry.read(trajectory.metadata["geometry"])
    imu = imu_of(trajectory)
    true = [trajectory.truth[f"bicycle/{name}"][:, 0] for name in ("roll", "pitch")]
    pose = run(KalmanFilter(OdometryAided.for_rider(geometry, dt=trajectory.dt)), trajectory.measurements).pose
    angles = {"odometry-aided": [pose[f"bicycle/{name}"][:, 0] for name in ("roll", "pitch")]}
    mount = MOUNT.as_quat(scalar_first=True)
    for name in ("bounded-motion", "tilt"):
        up = run(make(name, dt=trajectory.dt), imu.measurements).pose["up"]
        angles[name] = list(rotation.roll_pitch(rotation.rotate(mount, up)))
    return {
        name: tuple(
            float(np.degrees(np.sqrt(np.mean((each - truth)[skip:] ** 2))))
            for each, truth in zip(both, true, strict=True)
        )
        for name, both in angles.items()
    }


def test_simulated_rides_with_the_papers_sensors(ride: Trajectory) -> None:
    errors = errors_deg(ride)
    roll, pitch = errors["odometry-aided"]
    assert roll < 0.8
    assert pitch < 0.5
    assert roll < 0.5 * errors["bounded-motion"][0]
    assert roll < 0.3 * errors["tilt"][0]


def test_drop_outs_are_survived(ride: Trajectory) -> None:
    filter = KalmanFilter(OdometryAided(dt=ride.dt))
    true = ride.truth["bicycle/roll"][:, 0]
    for channel in CHANNELS[1:]:
        data = ride.measurements | {channel: ride.measurements[channel].copy()}
        data[channel][1000:1300] = np.nan
        error = np.degrees(run(filter, data).pose["bicycle/roll"][:, 0] - true)
        assert np.abs(error[1000:1300]).max() < 2.0, channel
        assert np.abs(error[1600:]).max() < 1.5, channel


@pytest.mark.parametrize("seconds", [2, 6])
def test_a_gap_of_all_samples_leaves_no_error_that_lasts(seconds: int) -> None:
    """The course of a bicycle does not tell its attitude, and a prior is nearer than a rate that was held so long."""
    for seed in range(3):
        data, turned, _ = ideal_ride(seed, 1800)
        for samples in data.values():
            samples[600 : 600 + 100 * seconds] = np.nan
        roll = run(KalmanFilter(OdometryAided()), data).pose["bicycle/roll"][:, 0]
        error = np.degrees(np.abs(roll - turned.as_euler("ZYX")[:, 2]))
        assert error[600 + 100 * seconds + 300 :].max() < 3.0, seed


def test_a_ride_that_begins_on_a_bump_begins_upright() -> None:
    """The wheel equation holds for a bicycle on its head too, so that a wrong start would last."""
    data, turned, _ = ideal_ride(0, 1000)
    data["bicycle_imu/acc"][0] = MOUNT.inv().apply([2.0, 1.0, -7.0])
    roll = run(KalmanFilter(OdometryAided()), data).pose["bicycle/roll"][:, 0]
    error = np.degrees(roll - turned.as_euler("ZYX")[:, 2])
    assert np.abs(error).max() < 30.0
    assert np.abs(error[500:]).max() < 0.3


@pytest.mark.parametrize("bias", [(0.17, -0.22, -0.17), (-0.2, 0.2, 0.2)])
def test_a_gyroscope_with_a_large_offset_is_found_out(bias: tuple[float, ...]) -> None:
    """Several times the offset of a data sheet, as a cheap gyroscope without calibration has it."""
    for seed in range(3):
        data, turned, _ = ideal_ride(seed, 1200)
        data["bicycle_imu/gyr"] = data["bicycle_imu/gyr"] + bias
        pose = run(KalmanFilter(OdometryAided()), data).pose
        error = np.degrees(pose["bicycle/roll"][:, 0] - turned.as_euler("ZYX")[:, 2])
        assert np.abs(error[500:]).max() < 5.0, seed
        assert np.abs(error[1000:]).max() < 3.0, seed


def test_a_wheel_in_the_air_is_not_believed(ride: Trajectory) -> None:
    data = ride.measurements | {"wheel/speed": ride.measurements["wheel/speed"].copy()}
    data["wheel/speed"][1000:1030] += 4.0
    worst = []
    for jump in (0.2, 1e6):
        pose = run(KalmanFilter(OdometryAided(dt=ride.dt, jump=jump)), data).pose
        worst.append(np.degrees(np.abs(pose["bicycle/pitch"][1000:, 0] - ride.truth["bicycle/pitch"][1000:, 0]).max()))
    assert worst[0] < 0.5 * worst[1]


def test_the_filter_is_told_the_bicycle() -> None:
    geometry = RiderGeometry(bicycle_imu=(0.3, 0.0, 0.6), bicycle_imu_tilt=0.2, wheel_radius=0.3)
    model = OdometryAided.for_rider(geometry, dt=0.02)
    assert (model.imu_forward, model.imu_height, model.imu_tilt, model.dt) == (0.3, 0.6, 0.2, 0.02)
    assert model.wheel_step == pytest.approx(2.0 * np.pi * 0.3 / 1024)
    assert OdometryAided.for_rider(geometry, imu_tilt=0.1).imu_tilt == 0.1
    usual = OdometryAided.for_rider(RiderGeometry())
    assert usual == OdometryAided(wheel_step=usual.wheel_step)
    with pytest.raises(ValueError, match="jump must be positive"):
        OdometryAided(jump=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["indoor_circle", "outdoor", "slalom", "pitch", "bumps"])
def test_accuracy_over_riders(scenario: str) -> None:
    """Prints the table of the documentation: mean over five riders, 60 s each (``-s`` shows it)."""
    found = [errors_deg(recorded(scenario, 60.0, subject, seed=10 + subject)) for subject in range(5)]
    mean = {name: np.mean([each[name] for each in found], axis=0) for name in found[0]}
    cells = [f"{roll:.2f} / {pitch:.2f}" for roll, pitch in mean.values()]
    print(f"| {scenario} | {' | '.join(cells)} |")
    assert mean["odometry-aided"][0] < 0.8
    assert mean["odometry-aided"][1] < 0.8
