"""The covariance of corrections: found again where it is known, and the same in every form of a network."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from poise.baselines.learned.calibration import calibrate, calibrated
from poise.baselines.learned.config import FitConfig
from poise.baselines.learned.data import SequenceData
from poise.baselines.learned.estimator import LearnedEstimator
from poise.baselines.learned.fit import FitResult, fit
from poise.baselines.learned.head import AngleHead
from poise.baselines.learned.inputs.front_end import RawChannels
from poise.baselines.learned.networks.modules import GruModule
from poise.baselines.learned.networks.unlikeness import LARGEST, WithUnlikeness
from poise.filters.core.estimator import run, run_by_steps
from poise.filters.core.quantity import Channel, Quantity

CHANNELS = (Channel("a/gyr", 3, "rad/s"), Channel("a/acc", 3, "m/s²"))
END = RawChannels(CHANNELS)
HEAD = AngleHead((Quantity("a", "angle", 2, "rad"),), (0.02, 0.05))


def sequences() -> SequenceData:
    """Two draws on each of six rides."""
    rng = np.random.default_rng(3)
    features = rng.standard_normal((12, 30, END.size)).astype(np.float32)
    target = (0.05 * features[..., :2] + 0.02 * rng.standard_normal((12, 1, 2))).astype(np.float32)
    parts = (features, target, np.ones((12, 30, 0), np.float32), np.ones((12, 30), bool))
    return SequenceData(*parts, tuple(f"ride-{index // 2}" for index in range(12)))


DATA = sequences()


def known(rides: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Errors of two draws on each ride whose variances are 0.01² (1 + 3 u²) and 0.02²; u differs from ride to ride."""
    u = np.repeat(rng.uniform(0.2, 6.0, rides), 2)[:, None] * np.ones((1, 50))
    deviations = np.stack([0.01 * np.sqrt(1.0 + 3.0 * u**2), np.full_like(u, 0.02)], axis=-1)
    names = [f"ride-{index}" for index in range(rides) for _ in range(2)]
    return deviations * rng.standard_normal((*u.shape, 2)), u, np.ones(u.shape, bool), names


def test_the_covariance_is_found_again() -> None:
    found = calibrate(*known(300, np.random.default_rng(0)))
    assert found.rides == 300
    u = np.array([0.5, 2.0, 5.0])
    for k, expected in enumerate((0.01 * np.sqrt(1.0 + 3.0 * u**2), np.full(3, 0.02))):
        np.testing.assert_allclose(found.deviations[k] * np.sqrt(1.0 + found.growth[k] * u**2), expected, rtol=0.05)
    assert found.nees == pytest.approx(0.95, abs=0.04)
    assert found.coverage == pytest.approx(0.91, abs=0.01)
    # one deviation for all u is right on average only, and wider
    assert found.constant[0] == pytest.approx(0.01 * np.sqrt(1.0 + 3.0 * 12.4), rel=0.2)


@pytest.mark.parametrize("tail", [np.inf, 4.0])
def test_ninety_per_cent_of_other_rides_lie_inside(tail: float) -> None:
    """Errors that are constant in a ride, also of a distribution with long tails; only some rides are known."""
    rng, inside = np.random.default_rng(1), []

    def errors(count: int) -> np.ndarray:
        scale = 1.0 if tail == np.inf else np.sqrt(tail / rng.chisquare(tail, (count, 1, 1)))
        return np.asarray(0.01 * scale * rng.standard_normal((count, 1, 4)))

    for _ in range(60):
        known_errors = errors(24) * np.ones((1, 5, 1))
        found = calibrate(known_errors, np.ones((24, 5)), np.ones((24, 5), bool), [str(i) for i in range(24)])
        deviation = np.array(found.deviations) * np.sqrt(1.0 + np.array(found.growth))
        inside.append(np.mean(np.abs(errors(500)) < 1.645 * deviation))
    assert np.mean(np.array(inside) >= 0.89) > 0.9
    assert np.mean(inside) < 0.97
    with pytest.raises(ValueError, match="got none"):
        calibrate(np.ones((4, 20, 1)), np.ones((4, 20)), np.zeros((4, 20), bool), list("abcd"))


def test_unlikeness_is_one_in_training_and_bounded() -> None:
    rng = np.random.default_rng(2)
    network = GruModule(4, 2, 5, seed=1).export()
    mean, deviation = np.array([1.0, 0.0, -2.0, 5.0]), np.array([0.1, 2.0, 1.0, np.inf])
    made = WithUnlikeness.of(network, mean, deviation)
    features = mean + np.where(np.isfinite(deviation), deviation, 9.0) * rng.standard_normal((4000, 4))
    assert made.unlikeness(features).mean() == pytest.approx(1.0, abs=0.05)
    assert made.unlikeness(features + 1e6).max() == LARGEST
    with pytest.raises(ValueError, match="mean must have shape"):
        WithUnlikeness(network, mean[:2], deviation)


@pytest.fixture(scope="module")
def result() -> FitResult:
    return fit(GruModule(END.size, 2, 6, seed=1), END, HEAD, DATA, DATA, FitConfig(epochs=2, batch=4, window=30))


def test_saved_weights_are_calibrated_as_in_their_training(result: FitResult, tmp_path: Path) -> None:
    saved = LearnedEstimator.load(result.estimator.save(tmp_path / "mine", {"name": "mine"}))
    head, found = calibrated(saved.network, HEAD, DATA)
    assert found == result.calibration
    assert head == result.estimator.head == saved.head
    assert isinstance(head, AngleHead)
    assert (head.power, AngleHead.read({"outputs": [], "scale": []}).power) == (2, 1)


@pytest.fixture(scope="module")
def trained(result: FitResult) -> LearnedEstimator:
    assert result.calibration is not None
    assert result.calibration.rides == 6
    made = result.estimator
    head = made.head
    assert isinstance(head, AngleHead)
    # growth that no covariance of this toy asks for, so that the forms are compared with it
    return LearnedEstimator(
        made.network, END, AngleHead(HEAD.outputs, HEAD.scale, None, head.deviations, (2.0, 0.5), 2)
    )


def test_every_form_states_the_same_covariance(trained: LearnedEstimator, tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    larger = np.where(np.arange(60) < 30, 0.5, 4.0)[:, None, None]
    measurements = {c.name: rng.standard_normal((60, 2, 3)) * larger for c in CHANNELS}
    found = run(trained, measurements)
    stepped = run_by_steps(trained, measurements)
    again = run(LearnedEstimator.load(trained.save(tmp_path / "mine", {"name": "mine"})), measurements)
    for other in (stepped, again):
        np.testing.assert_allclose(other.pose["a"], found.pose["a"], atol=1e-6)
        np.testing.assert_allclose(other.covariance, found.covariance, rtol=1e-5)
    variances = np.diagonal(np.asarray(found.covariance), axis1=-2, axis2=-1)
    assert (np.asarray(found.covariance)[..., 0, 1] == 0.0).all()
    head = trained.head
    assert isinstance(head, AngleHead)
    np.testing.assert_allclose(variances[0], np.square(head.deviations)[None].repeat(2, 0))  # nothing seen yet
    assert variances[40:].mean() > 2.0 * variances[10:30].mean()
    features = torch.tensor(rng.standard_normal((3, END.size)))
    _, output = trained.network.step(features, torch.zeros(3, 6, dtype=torch.float64))
    seen = END.run(measurements)._replace(spread=features[:, :0], base={})
    told = head.estimate(seen, output).covariance
    assert isinstance(told, torch.Tensor)
    _, expected = trained.network.step(features.numpy(), np.zeros((3, 6)))
    np.testing.assert_allclose(told.numpy(), head.estimate(seen, expected).covariance, rtol=1e-9)


def test_growth_needs_deviations() -> None:
    with pytest.raises(ValueError, match="growth must be of deviations"):
        AngleHead(HEAD.outputs, HEAD.scale, growth=(1.0, 1.0))
    with pytest.raises(ValueError, match="growth must be 2 numbers or none"):
        AngleHead(HEAD.outputs, HEAD.scale, deviations=(1.0, 1.0), growth=(1.0,))
    with pytest.raises(ValueError, match="power must be 1 or 2, got 3"):
        AngleHead(HEAD.outputs, HEAD.scale, power=3)


def test_angles_on_both_sides_of_half_a_turn_are_near_each_other() -> None:
    """A shoulder may turn about ±180°: neither errors nor loss are of the long way round."""
    head = AngleHead((Quantity("a", "angle", 1, "rad"), Quantity("b", "length", 1, "m")), (1.0, 1.0))
    output = torch.full((1, 5, 2), 3.0, requires_grad=True)
    target, none = torch.full((1, 5, 2), -3.0), torch.ones((1, 5, 0))
    expected = [2.0 * np.pi - 6.0, 6.0]
    np.testing.assert_allclose(head.errors(output, target, none).detach()[0, 0], expected, rtol=1e-5)
    loss = head.loss(output, target, none, torch.ones((1, 5), dtype=torch.bool))
    assert float(loss.detach()) == pytest.approx(np.mean(expected), rel=1e-5)
    loss.backward()
    assert output.grad is not None
    assert (output.grad[..., 0] < 0.0).all()
    assert (output.grad[..., 1] > 0.0).all()
