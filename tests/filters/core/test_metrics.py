"""Errors against textbook formulas and SciPy; gradients where training meets them."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from poise.filters.core import metrics, rotation
from poise.filters.core.quantity import EXTERNAL_ACCELERATION, ORIENTATION, RELATIVE_ORIENTATION, UP, Quantity

ROLL = Quantity("roll", "angle", 1, "rad")


@pytest.fixture
def pair(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    return rotation.random(rng, (200,)), rotation.random(rng, (200,))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def broad_errors(estimate: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Total, heading, inclination as printed in the BROAD paper, on SciPy's rotations."""
    difference = Rotation.from_quat(rotation.to_xyzw(estimate)) * Rotation.from_quat(rotation.to_xyzw(truth)).inv()
    _, _, z, w = np.abs(difference.as_quat().T)
    return 2 * np.arccos(w), 2 * np.arctan(z / w), 2 * np.arccos(np.sqrt(w**2 + z**2))


def test_rotation_errors_equal_the_formulas_of_broad(pair):
    expected = broad_errors(*pair)
    found = [f(*pair) for f in (metrics.total_error, metrics.heading_error, metrics.inclination_error)]
    np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_allclose(found[0], metrics.error(ORIENTATION, *pair))


def test_pure_heading_and_pure_inclination_are_told_apart():
    truth = rotation.from_euler_zyx(*(np.array(x) for x in (0.4, 0.3, -0.2)))
    turned = rotation.multiply(rotation.exp(np.array([0.0, 0.0, 0.1])), truth)
    tilted = rotation.multiply(rotation.exp(np.array([0.1, 0.0, 0.0])), truth)
    assert metrics.heading_error(turned, truth) == pytest.approx(0.1)
    assert metrics.inclination_error(turned, truth) == pytest.approx(0.0, abs=1e-12)
    assert metrics.heading_error(tilted, truth) == pytest.approx(0.0, abs=1e-12)
    assert metrics.inclination_error(tilted, truth) == pytest.approx(0.1)


def test_inclination_of_an_orientation_is_the_angle_of_its_up_vector(pair):
    p, q = pair
    of_up = metrics.error(UP, rotation.up_in_body(p), rotation.up_in_body(q))
    np.testing.assert_allclose(metrics.inclination_error(p, q), of_up, atol=1e-12)
    np.testing.assert_allclose(metrics.error(RELATIVE_ORIENTATION, p, q), of_up, atol=1e-12)


@pytest.mark.parametrize("size", [1e-12, 1e-9, 1e-4, 1.0, math.pi - 1e-9])
def test_small_and_large_angles_keep_their_digits(size):
    truth = rotation.exp(np.array([0.3, -0.5, 0.7]))
    turned = rotation.multiply(rotation.exp(np.array([size, 0.0, 0.0])), truth)
    assert metrics.total_error(turned, truth) == pytest.approx(size, rel=1e-3, abs=2e-16)
    assert metrics.total_error(-3.0 * turned, truth) == pytest.approx(size, rel=1e-3, abs=2e-16)
    a, b = np.array([1.0, 0.0, 0.0]), np.array([math.cos(size), math.sin(size), 0.0])
    assert metrics.direction_error(a, 5.0 * b) == pytest.approx(size, rel=1e-6)


def test_angles_wrap_and_vectors_are_distances():
    assert metrics.error(ROLL, np.array([3.1]), np.array([-3.1])) == pytest.approx(2 * math.pi - 6.2)
    assert metrics.error(EXTERNAL_ACCELERATION, np.array([1.0, 2.0, 2.0]), np.zeros(3)) == pytest.approx(3.0)


def test_what_is_not_known_has_no_error():
    truth = np.array([[1.0, 0, 0, 0], [np.nan] * 4, [1.0, 0, 0, 0]])
    estimate = np.array([[1.0, 0, 0, 0], [1.0, 0, 0, 0], [0.0, 0, 0, 0]])
    np.testing.assert_array_equal(metrics.error(ORIENTATION, estimate, truth), [0.0, np.nan, np.nan])
    assert np.isnan(metrics.error(UP, np.zeros(3), np.array([0.0, 0.0, 1.0]))), "no direction scores as perfect"


@pytest.mark.parametrize("quantity", [ORIENTATION, RELATIVE_ORIENTATION, UP, ROLL, EXTERNAL_ACCELERATION])
def test_torch_gives_the_same_and_gradients_stay_finite(quantity, rng):
    truth = rng.standard_normal((6, quantity.size))
    estimate = truth.copy()
    estimate[1:] += 0.1 * rng.standard_normal((5, quantity.size))
    truth[2] = np.nan
    estimate[3] = -truth[3]
    leaf = torch.tensor(estimate, requires_grad=True)
    error = metrics.error(quantity, leaf, torch.tensor(truth))
    np.testing.assert_allclose(error.detach(), metrics.error(quantity, estimate, truth), atol=1e-12)
    loss = metrics.rms(error) + metrics.rms(error[:1])
    loss.backward()
    assert torch.isfinite(loss)
    assert torch.isfinite(leaf.grad).all()
    assert (leaf.grad[[1, 4, 5]].abs().sum(-1) > 0).all()
    assert (leaf.grad[2] == 0).all()


def test_gradient_points_along_the_error():
    truth = torch.zeros(1, 3, dtype=torch.float64)
    estimate = torch.tensor([[3.0, 0.0, 4.0]], dtype=torch.float64, requires_grad=True)
    metrics.error(EXTERNAL_ACCELERATION, estimate, truth).sum().backward()
    np.testing.assert_allclose(estimate.grad, [[0.6, 0.0, 0.8]])


def test_rms_scores_the_mask_only(rng):
    error = rng.uniform(size=(50, 3))
    error[5] = np.nan
    mask = rng.uniform(size=50) < 0.5
    chosen = error[mask & np.isfinite(error[:, 0])]
    np.testing.assert_allclose(metrics.rms(error, mask), np.sqrt((chosen**2).mean(0)))
    np.testing.assert_allclose(metrics.rms(torch.tensor(error), mask), np.sqrt((chosen**2).mean(0)))
    assert metrics.rms(error, mask, axis=None) == pytest.approx(np.sqrt((chosen**2).mean()))
    assert np.isnan(metrics.rms(error, np.zeros(50, bool))).all()
    assert np.isnan(metrics.valid_fraction(error, np.zeros(50, bool)))
    assert metrics.valid_fraction(error) == pytest.approx(0.98)
    with pytest.raises(ValueError, match="mask must be bool"):
        metrics.rms(error, mask.astype(float))
    with pytest.raises(ValueError, match="mask must be bool"):
        metrics.rms(error, mask[:-1])


def test_score_makes_rows_with_units(pair):
    p, q = pair
    p = p.copy()
    p[:20] = np.nan
    mask = np.arange(200) < 100
    table = metrics.score(ORIENTATION, p, q, mask)
    assert list(table) == ["total", "heading", "inclination", "valid"]
    expected = broad_errors(p[20:100], q[20:100])
    for name, error in zip(("total", "heading", "inclination"), expected, strict=True):
        assert table[name] == (pytest.approx(np.degrees(np.sqrt((error**2).mean()))), "deg")
    assert table["valid"] == (pytest.approx(0.8), "1")
    assert metrics.score(EXTERNAL_ACCELERATION, p[20:, :3], q[20:, :3])["distance"][1] == "m/s²"
    assert set(metrics.score(UP, p[:, :3], q[:, :3])) == {"inclination", "valid"}
    assert set(metrics.score(RELATIVE_ORIENTATION, p, q)) == {"inclination", "valid"}
    with pytest.raises(ValueError, match=r"estimate of 'orientation' must have shape \(\.\.\., 4\)"):
        metrics.score(ORIENTATION, p[:, :3], q)
