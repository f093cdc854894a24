"""Angle in a vertical plane: models against differences and a moved body, methods against each other and print."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.filters.arrays.array import OCTA, PLANAR, PlanarArray
from poise.filters.arrays.planar.mean import PlanarMean
from poise.filters.arrays.planar.orientation import UNKNOWN_ANGLE, PlanarOrientation
from poise.filters.arrays.planar.pose import PlanarPose
from poise.filters.arrays.planar.unscented import PlanarUnscented
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.recursion import Observer
from poise.filters.core.rotation import wrap

Data = dict[str, np.ndarray]
STATE = np.array([0.7, 2.0, -3.0, 0.1, 0.2, 0.3, 0.4, 1.5, -2.5])


@pytest.fixture(scope="module")
def turning() -> Trajectory:
    """The ∞ of section 3.2."""
    return simulate_hand("infinity", 3, duration=20.0, device="planar")


def angle(estimator: object, data: Data) -> np.ndarray:
    return estimator.run(data).pose["planar/angle"][:, 0]  # type: ignore[attr-defined]


def rms_error(estimator: object, trajectory: Trajectory) -> float:
    error = wrap(angle(estimator, trajectory.measurements) - trajectory.truth["planar/angle"][:, 0])
    return float(np.rad2deg(np.sqrt(np.mean(error[trajectory.time > 3.0] ** 2))))


def planar_force(angle: Any, acceleration: Any, gravity: float = 9.81) -> np.ndarray:
    """c̈ = Qᵀ(b̈ − g) ``(..., 2)``: the specific force of a point in body axes, m/s²."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = acceleration[..., 0], acceleration[..., 1] + gravity
    return np.stack([c * x + s * y, c * y - s * x], axis=-1)


def differences(function: object, x: np.ndarray, step: float = 1e-6) -> np.ndarray:
    ends = [(function(x + step * d), function(x - step * d)) for d in np.eye(x.size)]  # type: ignore[operator]
    return np.stack([(high - low) / (2.0 * step) for high, low in ends], axis=-1)


def test_force_and_readings_are_those_of_a_moved_body() -> None:
    """Signs of α and ω² by second differences of each sensor's place; (3.9), (3.10) print them swapped and positive."""
    h, t = 1e-3, np.array([0.4])

    def turned(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        phi = 0.8 * np.sin(3.0 * time) + time**2
        place = np.stack([0.3 * np.sin(4.0 * time), 0.2 * np.cos(5.0 * time)], axis=-1)
        return phi, place

    def sensors(time: np.ndarray) -> np.ndarray:
        phi, place = turned(time)
        c, s = np.cos(phi), np.sin(phi)
        Q = np.array([[c, -s], [s, c]])[..., 0]
        return place + PLANAR.r @ Q.T

    phi = turned(t)[0]
    c, s = np.cos(phi[0]), np.sin(phi[0])
    Q = np.array([[c, -s], [s, c]])
    acceleration = (sensors(t + h) - 2.0 * sensors(t) + sensors(t - h)) / h**2
    expected = np.sum(PLANAR.e * ((acceleration + np.array([0.0, 9.81])) @ Q), axis=-1)
    rate = (turned(t + h)[0] - turned(t - h)[0]) / (2.0 * h)
    spin = (turned(t + h)[0] - 2.0 * phi + turned(t - h)[0]) / h**2
    place = (turned(t + h)[1] - 2.0 * turned(t)[1] + turned(t - h)[1]) / h**2
    readings = PLANAR.readings(planar_force(phi, place), spin[:, None], rate[:, None])[0]
    np.testing.assert_allclose(readings, expected, atol=2e-4)
    force = PlanarOrientation().specific_force({"array/acc": readings})
    np.testing.assert_allclose(force, planar_force(phi, place)[0], atol=1e-12)


@pytest.mark.parametrize("phi", [0.0, 0.7, 2.0, -2.9, 3.1])
def test_tilt_is_four_quadrant(phi: float) -> None:
    """(3.20) prints the arctangent of a ratio, which is wrong by half a turn upside down."""
    readings = PLANAR.readings(planar_force(np.array(phi), np.zeros(2)), np.zeros(1), np.zeros(1))
    force = PLANAR.pseudo_inverse[:2] @ readings
    assert PlanarOrientation().tilt({"array/acc": readings})[0] == pytest.approx(phi)
    published = np.arctan(force[0] / force[1])
    assert abs(wrap(published - phi)) < 1e-9 if abs(phi) < np.pi / 2 else abs(wrap(published - phi)) > 3.14


def test_extended_filter_is_the_derivative_of_its_model() -> None:
    model = PlanarOrientation()
    x = np.array([0.9])
    r, H, R = model.residual(x, {"array/acc": np.ones(4)})
    np.testing.assert_allclose(H, differences(model.expected, x), atol=1e-8)
    np.testing.assert_allclose(r, [1.0, 1.0] - model.expected(x))
    np.testing.assert_allclose(R, (100.0 + 0.5 * 0.09) * np.eye(2))
    # the gain of R ∝ 1: P⁺ = P R/(P g² + R), whatever the angle
    kalman = KalmanFilter(replace(model, start="known", initial_noise=0.2), compiled=False)
    readings = PLANAR.readings(np.array([[3.0, 4.0], [1.0, 9.0]]), np.zeros((2, 1)), np.zeros((2, 1)))
    P = kalman.run({"planar/gyr": np.zeros((2, 1)), "array/acc": readings}).covariance[1, 0, 0]
    predicted = 0.04 + 1e-4 * 0.36
    expected = predicted * R[0, 0] / (predicted * 9.81**2 + R[0, 0])
    np.testing.assert_allclose(P, expected, rtol=1e-12)


@pytest.mark.parametrize("form", ["corrected", "published-noise", "published-jacobian"])
def test_complete_pose_is_the_derivative_of_its_model(form: str) -> None:
    """(3.45) prints A_P for A_P Qᵀ; (3.44) the covariance of ẑ for that of raw readings."""
    model = PlanarPose(form=form)  # type: ignore[arg-type]
    numeric = differences(model.expected, STATE)
    same = np.allclose(model.slope(STATE), numeric, atol=1e-7)
    assert same == (form != "published-jacobian")
    _, _, R = model.residual(STATE, {"array/acc": np.zeros(4)})
    assert np.allclose(R, 0.09 * np.eye(4)) == (form != "published-noise")
    z = {"array/acc": np.zeros(4)}
    _, F, _ = model.predict(STATE, z, z)
    np.testing.assert_allclose(F, differences(lambda x: model.predict(x, z, z)[0], STATE), atol=1e-8)
    force = planar_force(STATE[0], STATE[7:])
    expected = PLANAR.readings(force, STATE[2:3], STATE[1:2])
    np.testing.assert_allclose(model.expected(STATE), expected, atol=1e-12)


def test_complete_pose_integrates_held_jerk() -> None:
    """(3.40), (3.41), (3.43) by fine steps; with the decay of b̈ switched off."""
    model, z = PlanarPose(acceleration_decay=0.0), {"array/acc": np.zeros(4)}
    x, _, Q = model.predict(STATE, z, z)
    G = np.zeros((9, 3))
    for column, chain in enumerate(([0, 1, 2], [3, 5, 7], [4, 6, 8])):
        fine, steps = STATE[chain].copy(), 20_000
        pushed = fine.copy()
        for _ in range(steps):
            h = model.dt / steps
            fine = fine + h * np.array([fine[1], fine[2], 0.0])
            pushed = pushed + h * np.array([pushed[1], pushed[2], 1.0])
        np.testing.assert_allclose(x[chain], fine, atol=1e-6)
        G[chain, column] = pushed - fine
    np.testing.assert_allclose(Q, G @ np.diag([300.0**2] * 3) @ G.T, rtol=2e-4, atol=1e-12)


def test_decaying_acceleration_has_the_deviation_that_is_told() -> None:
    model, z = PlanarPose(), {"array/acc": np.zeros(4)}
    _, F, Q = model.predict(STATE, z, z)
    stationary = Q[7, 7] / (1.0 - F[7, 7] ** 2)
    told = model.jerk * model.dt / np.sqrt(1.0 - np.exp(-2.0 * model.acceleration_decay * model.dt))
    assert np.sqrt(stationary) == pytest.approx(told, rel=1e-9)
    assert 5.0 < told < 5.5


def test_weight_of_the_mean_is_the_best_on_a_grid() -> None:
    """(3.23) gives no weight: the derived one against the variance that many draws have for others."""
    rng = np.random.default_rng(0)
    model, draws, length = PlanarMean(start="known", initial_noise=0.0, inertial_acceleration=0.1), 40_000, 25
    gyroscope = model.gyroscope_noise * rng.normal(size=(length, draws, 1))
    # the tilt's own errors, small enough for its linear form
    tilt = np.sqrt(model.tilt_variance(np.zeros(1))[0]) * rng.normal(size=(length, draws, 1))
    force = 9.81 * np.concatenate([np.sin(tilt), np.cos(tilt)], axis=-1)
    readings = PLANAR.readings(force, np.zeros((length, draws, 1)), np.zeros((length, draws, 1)))
    data = {"planar/gyr": gyroscope, "array/acc": readings}

    def last_two(model: PlanarMean) -> tuple[Any, Any]:
        observer = Observer(model, compiled=False)
        state = before = observer.init({name: array[0] for name, array in data.items()})
        for k in range(length):
            before = state
            state, _ = observer.step(state, {name: array[k] for name, array in data.items()})
        return before, state

    before, state = last_two(model)
    predicted = before.x[:, 0] + 0.005 * (gyroscope[-2] + gyroscope[-1])[:, 0]
    grid = np.linspace(0.6, 1.0, 401)
    variances = [np.var(rho * predicted + (1.0 - rho) * tilt[-1, :, 0]) for rho in grid]
    assert state.x[0, 2] == pytest.approx(grid[int(np.argmin(variances))], abs=5e-3)
    assert state.x[0, 1] == pytest.approx(np.var(state.x[:, 0]), rel=0.02)
    # without the correlation of two steps with one gyroscope sample, the variance is told wrongly
    _, other = last_two(replace(model, correlated=False))
    assert other.x[0, 1] > 1.035 * np.var(other.x[:, 0])


def test_linear_filter_with_the_same_noise_is_the_mean(turning: Trajectory) -> None:
    for wrapped in (True, False):
        mean = Observer(PlanarMean(correlated=False, wrapped=wrapped), compiled=False)
        kalman = KalmanFilter(PlanarOrientation(method="linear", wrapped=wrapped), compiled=False)
        data = {name: array[:300] for name, array in turning.measurements.items()}
        np.testing.assert_allclose(angle(mean, data), angle(kalman, data), atol=1e-9)
    assert PlanarMean(inertial_acceleration=50.0).tilt_variance(np.zeros(1))[0] == UNKNOWN_ANGLE


def test_unscented_is_extended_here(turning: Trajectory) -> None:
    data = {name: array[:600].copy() for name, array in turning.measurements.items()}
    data["array/acc"][200:230] = np.nan
    data["planar/gyr"][220:240] = np.nan
    unscented, extended = PlanarUnscented().run(data), KalmanFilter(PlanarOrientation(), compiled=False).run(data)
    difference = unscented.pose["planar/angle"] - extended.pose["planar/angle"]
    assert np.rad2deg(np.abs(difference)).max() < 1e-5
    np.testing.assert_allclose(unscented.covariance, extended.covariance, rtol=1e-5)


def test_what_print_gets_wrong_shows_on_the_infinity(turning: Trajectory) -> None:
    thesis = {"acceleration_decay": 0.0, "jerk": 1000.0, "angular_jerk": 100.0}

    def of(model: PlanarMean | PlanarOrientation | PlanarPose) -> float:
        wrapper = Observer if isinstance(model, PlanarMean) else KalmanFilter
        return rms_error(wrapper(model, compiled=False), turning)  # type: ignore[arg-type]

    errors = {
        "mean": of(PlanarMean(inertial_acceleration=30.0)),
        "literal mean": of(PlanarMean(inertial_acceleration=30.0, wrapped=False)),
        "extended": of(PlanarOrientation()),
        "pose": of(PlanarPose()),
        "thesis": of(PlanarPose(**thesis)),
        "published R": of(PlanarPose(**thesis, form="published-noise")),
        "published H": of(PlanarPose(**thesis, form="published-jacobian")),
        "tilt": of(PlanarMean(method="tilt")),
    }
    assert errors["pose"] < 4.0
    assert errors["extended"] < 6.5
    assert errors["mean"] < 8.0
    assert errors["literal mean"] > 30.0
    assert errors["tilt"] > 30.0
    assert errors["thesis"] > 1.5 * errors["pose"]
    assert errors["published R"] > 1.5 * errors["thesis"]
    assert errors["published H"] > 3.0 * errors["thesis"]


def test_drop_outs_are_predicted_through(turning: Trajectory) -> None:
    """Without the array all that read a gyroscope integrate it; tilt keeps what it had, and whole turns are counted."""
    data = {name: array[:400].copy() for name, array in turning.measurements.items()}
    data["array/acc"][300:360, 1] = np.nan
    steps = 0.005 * (data["planar/gyr"][299:359] + data["planar/gyr"][300:360])[:, 0]
    for estimator in (
        Observer(PlanarMean(), compiled=False),
        Observer(PlanarMean(method="integration"), compiled=False),
        KalmanFilter(PlanarOrientation(), compiled=False),
        KalmanFilter(PlanarOrientation(method="linear"), compiled=False),
        PlanarUnscented(),
    ):
        found = angle(estimator, data)
        np.testing.assert_allclose(found[300:360], found[299] + np.cumsum(steps), atol=1e-9)
    held = angle(Observer(PlanarMean(method="tilt"), compiled=False), data)
    np.testing.assert_array_equal(held[300:360], held[299])
    pose = KalmanFilter(PlanarPose(), compiled=False).run(data)
    assert np.isfinite(pose.pose["planar/angle"]).all()
    one_left = pose.covariance[359, 0, 0], pose.covariance[299, 0, 0]
    # three accelerometers of four go on correcting
    assert one_left[0] < 20.0 * one_left[1]


def test_known_start() -> None:
    data = {"planar/gyr": np.zeros((3, 1)), "array/acc": np.full((3, 4), 5.0)}
    for made in (PlanarOrientation, PlanarUnscented, PlanarPose):
        model = made(start="known", initial_angle=1.2, initial_noise=0.3)
        estimator = model if made is PlanarUnscented else KalmanFilter(model, compiled=False)
        estimate = estimator.run({channel.name: data[channel.name] for channel in model.channels})
        assert estimate.pose["planar/angle"][0, 0] == pytest.approx(1.2)
        assert estimate.covariance[0, 0, 0] == pytest.approx(0.09)


def test_the_printed_prior_turns_the_angle_by_whole_turns() -> None:
    """P₀ = 10³ rad² trusts the first specific force alone, 30 m/s² of which are acceleration; 10⁻² does not."""
    rng = np.random.default_rng(0)
    force = planar_force(np.zeros((2, 2000)), rng.normal(0.0, 30.1, (2, 2000, 2)))
    still = np.zeros((2, 2000, 1))
    data = {"planar/gyr": still, "array/acc": PLANAR.readings(force, still, still)}
    shares = []
    for deviation in (np.sqrt(1e3), 0.1):
        model = PlanarOrientation(start="known", initial_noise=deviation, inertial_acceleration=30.1)
        found = KalmanFilter(model, compiled=False).run(data).pose["planar/angle"][-1, :, 0]
        shares.append(np.mean(np.abs(found) > np.pi))
    assert 0.25 < shares[0] < 0.38
    assert shares[1] == 0.0


THREE = PlanarArray(((0.0, 0.1), (0.0, 0.1), (0.0, -0.1)), ((1.0, 0.0), (0.0, 1.0), (1.0, 0.0)))


@pytest.mark.parametrize(
    ("made", "parameters", "message"),
    [
        (PlanarOrientation, {"method": "best"}, "method must be one of .*'linear'.*got 'best'"),
        (PlanarMean, {"method": "best"}, "method must be one of .*'weighted'.*got 'best'"),
        (PlanarPose, {"form": "best"}, "form must be one of .*'corrected'.*got 'best'"),
        (PlanarMean, {"start": "best"}, "start must be one of .*'known'.*got 'best'"),
        (PlanarOrientation, {"array": OCTA}, "'octa' must be planar.*dimension 3"),
        (PlanarMean, {"array": THREE}, "must be planar and determine the specific force.*rank 3"),
        (PlanarUnscented, {"spread": 0.0}, r"spread must lie in \(0, 1\], got 0.0"),
    ],
)
def test_wrong_parameters_are_refused(made: type, parameters: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        made(**parameters)
