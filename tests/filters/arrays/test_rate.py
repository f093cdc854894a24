"""Angular rate from an array: exact motions, derivatives, covariances by Monte Carlo, and what print gets wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from poise.filters.arrays.array import CONTROLLER, OCTA, PLANAR
from poise.filters.arrays.products import product_jacobian, products
from poise.filters.arrays.rate import ArrayRate, parsa_step, polynomial_roots, published_jacobian, roots_jacobian
from poise.filters.arrays.reference_rate import reference_rate
from poise.filters.core.recursion import Observer
from poise.filters.core.rotation import from_xyzw

DT = 0.01


def rates(length: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A smooth angular rate that is never small, and its derivative."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(length)[:, None]
    amplitude, frequency, phase = (
        rng.normal(0.0, 1.0, (3, 3)),
        rng.uniform(3.0, 12.0, (3, 3)),
        rng.uniform(0, 6, (3, 3)),
    )
    waves = frequency * t[:, None] + phase
    rate = np.array([3.0, -2.0, 1.0]) + (amplitude * np.sin(waves)).sum(axis=1)
    return rate, (amplitude * frequency * np.cos(waves)).sum(axis=1)


def readings(rate: np.ndarray, turning: np.ndarray, noise: float = 0.0, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    ideal = OCTA.readings(np.array([1.0, -2.0, 9.0]) + 0.0 * rate, turning, rate)
    return ideal + noise * rng.normal(size=ideal.shape)


def estimate(model: ArrayRate, array: np.ndarray, compiled: bool = False) -> dict[str, np.ndarray]:
    return Observer(model, compiled=compiled).run({"array/acc": array}).pose


@pytest.mark.parametrize("method", ["weighted", "polynomial-roots", "parsa", "time-integration"])
def test_exact_readings_give_the_rate(method: str) -> None:
    rate, turning = rates(300)
    model = ArrayRate(dt=DT, method=method, initial_rate=tuple(rate[0]))  # type: ignore[arg-type]
    error = estimate(model, readings(rate, turning))["angular_rate"] - rate
    # the trapezoidal rule is the only approximation, and roots know nothing of it
    assert np.abs(error).max() < (1e-9 if method == "polynomial-roots" else 0.02)


def test_roots_are_the_global_minimum_of_the_cost() -> None:
    """(2.17) by a minimiser that starts from many places."""
    rng = np.random.default_rng(2)
    for _ in range(10):
        xi = rng.normal(0.0, 3.0, 6)
        W = np.array([[xi[0], xi[5], xi[4]], [xi[5], xi[1], xi[3]], [xi[4], xi[3], xi[2]]]) - xi[:3].sum() * np.eye(3)

        def cost(rate: np.ndarray, W: np.ndarray = W) -> float:
            return float(np.sum((np.outer(rate, rate) - rate @ rate * np.eye(3) - W) ** 2))

        best = min(minimize(cost, start).fun for start in rng.normal(0.0, 2.0, (12, 3)))
        assert cost(polynomial_roots(xi)) == pytest.approx(best, rel=1e-7, abs=1e-7)


def test_no_positive_eigenvalue_means_rest() -> None:
    np.testing.assert_array_equal(polynomial_roots(np.array([-1.0, -1.0, -1.0, 0.0, 0.0, 0.0])), 0.0)


def test_jacobian_of_the_roots_and_its_printed_sign() -> None:
    """(2.39) is published with the other sign; (2.41) mixes two rates, which central differences refuse."""
    rate = np.array([2.0, -1.5, 0.7])
    xi, step = products(rate), 1e-6
    columns = []
    for direction in np.eye(6):
        ends = [polynomial_roots(xi + side * step * direction) for side in (1.0, -1.0)]
        ends = [end * np.sign(end @ rate) for end in ends]
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    numeric = np.stack(columns, axis=-1)
    np.testing.assert_allclose(roots_jacobian(rate), numeric, atol=1e-8)
    np.testing.assert_allclose(published_jacobian(xi, rate, rate), -numeric, atol=1e-8)
    other = rate + np.array([0.3, 0.0, 0.0])
    assert np.abs(published_jacobian(xi, other, rate) + numeric).max() > 0.02


def test_parsa_is_singular_at_rest_only() -> None:
    """(2.55) prints 20 ω_x² ω_y² ω_z², which would vanish in every plane of two axes."""
    x, y, z = sympy.symbols("x y z", real=True)
    K = sympy.Matrix([[2 * x, 0, 0], [0, 2 * y, 0], [0, 0, 2 * z], [0, z, y], [z, 0, x], [y, x, 0]])
    squares = [x**2, y**2, z**2]
    expected = sum(a**3 for a in squares) + 17 * x**2 * y**2 * z**2
    expected += 5 * sum(a**2 * b for i, a in enumerate(squares) for j, b in enumerate(squares) if i != j)
    assert sympy.expand((K.T * K).det() - 4 * expected) == 0
    rate = np.array([0.0, 2.0, -1.0])
    np.testing.assert_allclose(product_jacobian(rate), np.array(K.subs({x: 0.0, y: 2.0, z: -1.0}), dtype=float))
    assert np.linalg.norm(parsa_step(rate + 0.01, products(rate)) - rate) < 1e-4


def test_predicted_covariance_is_that_of_many_draws() -> None:
    """(2.27), (2.32), (2.34) lack S; with it the predicted covariance is the actual one, without it is not."""
    draws, length = 30_000, 8
    rate, turning = rates(length, 3)
    rate, turning = 1.5 * rate, 1.5 * turning
    noise = 0.01
    rng = np.random.default_rng(4)
    array = readings(rate, turning)[:, None] + noise * rng.normal(size=(length, draws, 12))
    errors = {}
    for variant in ("integrated", "corrected", "published"):
        model = ArrayRate(
            dt=DT,
            variant=variant,  # type: ignore[arg-type]
            accelerometer_noise=noise,
            bias_noise=0.0,
            initial_rate=tuple(rate[0]),
        )
        # without the error of the trapezoidal rule, which all draws share
        pose = estimate(model, array)
        deviation = pose["angular_rate"][-1] - pose["angular_rate"][-1].mean(axis=0)
        actual = deviation.T @ deviation / draws
        predicted = pose["angular_rate_covariance"][-1].mean(axis=0).reshape(3, 3)
        errors[variant] = np.linalg.norm(predicted - actual) / np.linalg.norm(actual)
    # 30 000 draws tell a covariance to about two per cent
    assert errors["integrated"] < 0.03
    assert errors["corrected"] < 0.03
    assert errors["published"] > 0.2


@pytest.mark.parametrize("variant", ["integrated", "corrected", "published"])
def test_noise_of_the_accelerometers_need_not_be_known(variant: str) -> None:
    rate, turning = rates(200, 5)
    array = readings(rate, turning, 0.2)
    told = [
        ArrayRate(dt=DT, variant=variant, initial_rate=tuple(rate[0]), bias_noise=0.0)  # type: ignore
    ]
    told.append(replace(told[0], accelerometer_noise=7.0))
    first, second = (estimate(model, array) for model in told)
    np.testing.assert_allclose(first["angular_rate"], second["angular_rate"], atol=1e-12)
    ratio = second["angular_rate_covariance"][1:] / first["angular_rate_covariance"][1:]
    np.testing.assert_allclose(ratio, 4900.0, rtol=1e-9)
    weights = first["array-rate/weights"]
    assert (weights[0] == 1.0).all()
    assert weights.min() >= 0.0
    assert weights.max() <= 1.0
    assert weights[1:].min() < 0.98


def test_at_rest_the_roots_are_left_out() -> None:
    """Without the guard J is 0 at ω = 0, roots seem perfect, and their noise floor is taken for motion."""
    rest = np.zeros((200, 3))
    still = estimate(ArrayRate(dt=DT), readings(rest, rest))
    np.testing.assert_allclose(still["angular_rate"], 0.0, atol=1e-12)
    np.testing.assert_array_equal(still["array-rate/weights"], 1.0)
    noisy = readings(rest, rest, 0.02)
    quiet = np.abs(estimate(ArrayRate(dt=DT, bias_noise=0.0), noisy)["angular_rate"]).max()
    alone = np.abs(estimate(ArrayRate(dt=DT, method="polynomial-roots"), noisy)["angular_rate"][1:]).mean()
    assert quiet < 0.1
    assert alone > 0.1


def test_missing_readings_are_integrated_through() -> None:
    rate, turning = rates(100, 6)
    array = readings(rate, turning, 0.05)
    array[40:50, 3] = np.nan
    pose = estimate(ArrayRate(dt=DT, initial_rate=tuple(rate[0]), bias_noise=0.0), array)
    assert np.isfinite(pose["angular_rate"]).all()
    np.testing.assert_array_equal(pose["array-rate/weights"][40:50], 1.0)
    assert (pose["array-rate/weights"][51:] < 1.0).any()
    # a reading that is missing is held, element by element: the rate goes on with the last angular acceleration
    held = array.copy()
    held[40:50, 3] = array[39, 3]
    turning_seen = held @ OCTA.pseudo_inverse[3:6].T
    steps = 0.5 * DT * (turning_seen[39:49] + turning_seen[40:50])
    expected = pose["angular_rate"][39] + np.cumsum(steps, axis=0)
    np.testing.assert_allclose(pose["angular_rate"][40:50], expected, atol=1e-12)
    spread = pose["angular_rate_covariance"][..., 0]
    assert (np.diff(spread[39:50]) > 0.0).all()


def test_biases_are_found_where_the_roots_can_see_them() -> None:
    rate, turning = rates(1500, 7)
    lull = 0.2 * np.pi * DT * np.arange(1500)[:, None]
    turning = turning * np.cos(lull) ** 2 - rate * 0.2 * np.pi * np.sin(2.0 * lull)
    rate = rate * np.cos(lull) ** 2
    bias = OCTA.A_T @ np.array([0.6, -0.4, 0.5])
    array = readings(rate, turning, 0.05) + bias
    without, found = (
        estimate(ArrayRate(dt=DT, initial_rate=tuple(rate[0]), bias_noise=noise), array)["angular_rate"]
        for noise in (0.0, 0.1)
    )
    errors = [np.sqrt(np.mean((one - rate)[500:] ** 2)) for one in (without, found)]
    assert errors[1] < 0.5 * errors[0]


def test_a_gyroscope_may_start_it() -> None:
    rate, turning = rates(20, 9)
    observer = Observer(ArrayRate(dt=DT, start="gyroscope"), compiled=False)
    assert [channel.name for channel in observer.channels] == ["array/acc", "imu/gyr"]
    gyroscope = np.full((20, 3), np.nan)
    gyroscope[0] = rate[0]
    pose = observer.run({"array/acc": readings(rate, turning), "imu/gyr": gyroscope}).pose
    np.testing.assert_array_equal(pose["angular_rate"][0], rate[0])
    np.testing.assert_allclose(pose["angular_rate"], rate, atol=0.02)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"method": "best"}, "method must be one of .*'weighted'.*got 'best'"),
        ({"variant": "new"}, "variant must be one of .*'integrated'.*got 'new'"),
        ({"start": "later"}, "start must be one of .*'gyroscope'.*got 'later'"),
        ({"accelerometer_noise": 0.0}, "accelerometer_noise must be positive"),
        ({"array": CONTROLLER}, "'controller' must be spatial and of rank 12.*rank 6"),
        ({"array": PLANAR}, "'planar' must be spatial and of rank 12.*dimension 2"),
    ],
)
def test_wrong_parameters_are_refused(parameters: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ArrayRate(**parameters)


def test_reference_rate_from_tracked_orientations() -> None:
    """(2.51) prints Q Q̇ᵀ, which is the rate in world axes with the other sign."""
    t = 1e-3 * np.arange(4000)
    angles = np.stack([0.8 * np.sin(5.0 * t), 0.5 * np.sin(3.0 * t + 1.0), 2.0 * t], axis=-1)
    turns = Rotation.from_euler("ZYX", angles)
    between = (turns[:-1].inv() * turns[1:]).as_rotvec() / 1e-3
    expected = 0.5 * (between[:-1] + between[1:])
    orientation = from_xyzw(turns.as_quat()) * np.where(np.arange(4000) % 3, 1.0, -1.0)[:, None]
    rate = reference_rate(orientation, 1e-3, cutoff=None)
    assert np.isnan(rate[[0, -1]]).all()
    np.testing.assert_allclose(rate[1:-1], expected, atol=2e-4)
    Q = turns.as_matrix()
    published = Q[1:-1] @ ((Q[2:] - Q[:-2]) / 2e-3).swapaxes(-1, -2)
    of_print = np.stack([published[:, 2, 1], published[:, 0, 2], published[:, 1, 0]], axis=-1)
    np.testing.assert_allclose(of_print, -turns[1:-1].apply(expected), atol=1e-3)
    # smoothing both ways shifts nothing, and takes away little of 0.8 Hz
    smooth = reference_rate(orientation, 1e-3, cutoff=20.0)[500:-500]
    assert np.abs(smooth - rate[500:-500]).max() < 0.1
    rough = orientation + 1e-3 * np.random.default_rng(0).normal(size=orientation.shape)
    rough = rough / np.linalg.norm(rough, axis=1, keepdims=True)
    noise = [np.nanstd(reference_rate(rough, 1e-3, cutoff) - rate) for cutoff in (None, 20.0)]
    assert noise[1] < 0.1 * noise[0]


@pytest.mark.parametrize(
    ("orientation", "dt", "cutoff", "message"),
    [
        (np.zeros((5, 3)), 0.01, 5.0, r"\(T, 4\)"),
        (np.full((5, 4), np.nan), 0.01, 5.0, "finite"),
        (np.ones((5, 4)), 0.0, 5.0, "dt must be positive"),
        (np.ones((5, 4)), 0.01, 50.0, "cutoff must lie between 0 and 50"),
    ],
)
def test_reference_rate_refuses(orientation: np.ndarray, dt: float, cutoff: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        reference_rate(orientation, dt, cutoff)
