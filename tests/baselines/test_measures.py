"""Measures of one run beyond its RMS error."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import poise
from poise.baselines.measures import error_vector, measures, of_error, settling
from poise.baselines.registry import make_estimator
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import rotation
from poise.filters.core.quantity import ORIENTATION, RELATIVE_ORIENTATION, UP, Estimate, Layout, Quantity

TIME = np.arange(2000) * 0.01


def test_measures_of_a_known_error() -> None:
    """An error that decays from 10 to a floor of 1 with 1 s, rising by 0.6 a minute afterwards."""
    error = 1.0 + 9.0 * np.exp(-TIME / 1.0)
    found = of_error(error, TIME, TIME > 10.0)
    assert found["largest"] == pytest.approx(1.0, abs=1e-3)
    # the mean square over 1 s falls below 9 when e^-t is about 0.2
    assert found["settling"] == pytest.approx(0.9, abs=0.3)
    slope = of_error(1.0 + 0.01 * TIME, TIME, np.ones(len(TIME), bool))
    assert slope["drift"] == pytest.approx(0.6)
    assert slope["p95"] == pytest.approx(1.0 + 0.01 * np.quantile(TIME, 0.95))


def test_an_error_that_grows_never_settles() -> None:
    assert settling(np.where(TIME < 19.0, 0.1, 50.0), TIME) != settling(np.ones(len(TIME)), TIME) == 0.0


def test_nothing_scored_gives_nothing() -> None:
    assert all(np.isnan(value) for value in of_error(np.full(5, np.nan), TIME[:5], np.ones(5, bool)).values())


def test_error_vectors_are_those_of_scipy() -> None:
    truth, small = Rotation.random(50, rng=1), Rotation.from_rotvec(np.random.default_rng(2).normal(0, 0.05, (50, 3)))
    heading = Rotation.from_euler("z", np.linspace(-3, 3, 50)[:, None])
    w_first = [3, 0, 1, 2]
    q = truth.as_quat()[:, w_first]
    turned = (small * truth).as_quat()[:, w_first]
    error, axes = error_vector(ORIENTATION, turned, q)
    np.testing.assert_allclose(error, small.as_rotvec(), atol=1e-12)
    tilt = small.as_rotvec() * [1, 1, 0]
    tilted = (Rotation.from_rotvec(tilt) * heading * truth).as_quat()[:, w_first]
    error, axes = error_vector(RELATIVE_ORIENTATION, tilted, q)
    np.testing.assert_allclose(error, tilt[:, :2], atol=1e-12)
    assert axes.shape == (2, 3)


@pytest.mark.parametrize("quantity", [ORIENTATION, UP, Quantity("speed", "vector", 2, "m/s")], ids=lambda one: one.name)
def test_nees_of_an_honest_covariance_is_one(quantity: Quantity) -> None:
    """Errors are drawn from the covariance that the estimate claims."""
    generator, count, deviation = np.random.default_rng(3), 4000, 0.02
    trajectory = poise.record("poise/HandMotion-v0", seed=0, steps=count - 1)
    count = len(trajectory)
    noise = generator.normal(0.0, deviation, (count, 3))
    if quantity is ORIENTATION:
        truth = trajectory.truth_of("orientation")
        value = rotation.multiply(rotation.exp(noise), truth)
    elif quantity is UP:
        truth = trajectory.truth_of("up")
        value = rotation.normalize(truth + np.cross(noise, truth))
    else:
        truth = generator.normal(size=(count, 2))
        value = truth + noise[:, :2]
    trajectory = trajectory.replace(
        truth={quantity.name: truth}, mask=np.ones(count, bool), time=trajectory.time[:count]
    )
    size = 2 if quantity.kind == "vector" else 3

    class Honest:
        outputs = (quantity,)

    estimate = Estimate(
        {quantity.name: value},
        np.broadcast_to(deviation**2 * np.eye(size), (count, size, size)),
        layout=Layout((quantity,), {quantity.name: (0, size)}),
    )
    rows = measures(Honest(), estimate, trajectory)  # type: ignore[arg-type]
    (found,) = (result for _, metric, result, _ in rows if metric == "nees")
    assert found == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("name", ["mekf", "mekf-9", "bounded-motion-9"])
def test_filters_with_and_without_a_magnetometer_have_a_nees(name: str) -> None:
    trajectory = simulate_hand("slow", 4, rate=100.0, duration=12.0)
    estimator = make_estimator(name, dt=trajectory.dt)
    rows = measures(estimator, poise.run(estimator, trajectory), trajectory)
    scored = {quantity.split("/")[-1] for quantity, metric, *_ in rows if metric == "nees"}
    assert ("orientation" if name.endswith("9") else "relative_orientation") in scored
