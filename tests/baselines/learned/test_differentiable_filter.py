"""The compiled derivatives of filters against automatic differentiation of their array form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from poise.baselines.learned.differentiable_filter import DifferentiableFilter  # noqa: E402
from poise.baselines.learned.gains.gain_shares import with_gain_shares  # noqa: E402
from poise.envs.hand.sensing import simulate_hand  # noqa: E402
from poise.filters.registry import make  # noqa: E402

T, B = 40, 3


def samples(kalman, length=T):
    """Samples of three gestures with gaps of the gyroscope and of the accelerometer."""
    rides = [simulate_hand(name, seed=seed, duration=4.0) for seed, name in enumerate(("slow", "fast", "slow"))]
    found = {
        c.name: np.stack([ride.measurements[c.name][150 : 150 + length] for ride in rides], 1) for c in kalman.channels
    }
    found["imu/gyr"][10:14, 0] = np.nan
    found["imu/acc"][20:24, 1] = np.nan
    return found


def weights(shape, seed):
    values = np.random.default_rng(seed).standard_normal(shape)
    values[:1] = 0.0
    return torch.tensor(values)


@pytest.mark.parametrize(
    "kalman",
    [
        make("external-acceleration"),
        with_gain_shares("external-acceleration"),
        *(pytest.param(make(name), marks=pytest.mark.slow) for name in ("mekf", "bounded-motion-9")),
        pytest.param(with_gain_shares("mekf"), marks=pytest.mark.slow),
    ],
    ids=lambda kalman: type(kalman.model).__name__,
)
def test_derivatives_equal_those_of_the_array_form(kalman):
    kalman = replace(kalman, restart=False)
    data, through = samples(kalman), DifferentiableFilter(kalman)
    factors = 0.3 * np.random.default_rng(5).standard_normal((T, B, len(through.gains)))
    mine, theirs = (torch.tensor(factors, requires_grad=True) for _ in range(2))
    state, found = through.run(through.init({key: array[0] for key, array in data.items()}), data, mine)
    tensors = {key: torch.tensor(array) for key, array in data.items()}
    gains = {gain: theirs[..., index] for index, gain in enumerate(through.gains)}
    expected, end = replace(kalman, compiled=False).run_from(None, tensors, gains)
    w = weights((T, B, 4), 1)

    def total(pose, covariance, nis, last):
        spread = (covariance * w[..., :1, None] ** 2).sum() + (nis * w[..., 1]).sum()
        return (pose * w[..., :3]).sum() + spread + (last * last).sum()

    for key, values in expected.pose.items():
        np.testing.assert_allclose(found.pose[key].detach().numpy(), values.detach().numpy(), atol=1e-12)
    total(found.pose["up"], found.covariance, found.nis, state.x).backward()
    total(expected.pose["up"], expected.covariance, expected.nis, end.x).backward()
    assert theirs.grad.abs().max() > 1e-3
    np.testing.assert_allclose(mine.grad.numpy()[1:], theirs.grad.numpy()[1:], rtol=1e-9, atol=1e-12)


def test_stretches_pass_derivatives_on_to_the_state():
    through = DifferentiableFilter(make("external-acceleration"))
    data = samples(through.kalman)
    factors = torch.full((T, B, len(through.gains)), 0.2, dtype=torch.float64, requires_grad=True)
    first = through.init({key: array[0] for key, array in data.items()})
    _, whole = through.run(first, data, factors)
    whole.innovation_loss().sum().backward()
    at_once, factors.grad = factors.grad.clone(), None
    parts, state = [slice(0, 17), slice(17, T)], first
    losses = []
    for part in parts:
        state, found = through.run(state, {key: array[part] for key, array in data.items()}, factors[part])
        losses.append(found.innovation_loss().sum())
    sum(losses).backward()
    np.testing.assert_allclose(factors.grad.numpy(), at_once.numpy(), rtol=1e-10, atol=1e-13)


def test_the_likelihood_prefers_the_right_noise():
    """Gradient descent on the innovations' likelihood finds the accelerometer noise of a sensor at rest."""
    rng = np.random.default_rng(0)
    kalman, deviation = make("external-acceleration"), 0.05
    kalman = replace(kalman, model=replace(kalman.model, c_a=0.0))
    acc = np.array([0.0, 0.0, kalman.model.gravity]) + deviation * rng.standard_normal((400, 4, 3))
    gyr = kalman.model.gyroscope_noise * rng.standard_normal((400, 4, 3))
    data = {"imu/gyr": gyr, "imu/acc": acc}
    through = DifferentiableFilter(kalman, ["measurement"])
    factor = torch.zeros(1, dtype=torch.float64, requires_grad=True)

    def loss(log_factor):
        state = through.init({key: array[0] for key, array in data.items()})
        return through.run(state, data, log_factor.expand(400, 4, 1))[1].innovation_loss().mean()

    optimizer = torch.optim.LBFGS([factor], lr=0.5, max_iter=60, line_search_fn="strong_wolfe")

    def closure():
        optimizer.zero_grad()
        value = loss(factor)
        value.backward()
        return value

    optimizer.step(closure)
    power = kalman.gains["measurement"].power
    learned = kalman.model.accelerometer_noise * np.exp(power * factor.item())
    assert learned == pytest.approx(deviation, rel=0.05)
    with torch.no_grad():
        assert loss(factor) < min(loss(factor - 0.2), loss(factor + 0.2))


def test_wrong_arguments_are_named():
    with pytest.raises(ValueError, match=r"unknown gains \['speed'\]"):
        DifferentiableFilter(make("mekf"), ["speed"])
    through = DifferentiableFilter(make("external-acceleration"))
    data = samples(through.kalman)
    state = through.init({key: array[0] for key, array in data.items()})
    with pytest.raises(ValueError, match=r"log_factors must have shape \(40, 3, 3\)"):
        through.run(state, data, torch.zeros(T, B, 1))
    with pytest.raises(ValueError, match=r"lack the channels \['imu/acc'\]"):
        through.run(state, {"imu/gyr": data["imu/gyr"]}, torch.zeros(T, B, 3))
