"""Policies cloned from an oracle: the polynomials, the costs, the network, the policy."""

import dataclasses

import numpy as np
import pytest
import torch

from poise.baselines.gain_policy.constant_gains import constant_errors, policy_errors
from poise.baselines.gain_policy.oracle_warm_start import OracleNetwork, costs_to_go, cubic, fit_oracle
from poise.baselines.gain_policy.stack import TrajectoryStack
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.tuned import TunedFilter
from poise.filters.core.kalman import KalmanFilter


@pytest.fixture(scope="module")
def trajectories():
    return HandTrajectories(("slow", "fast"), duration=10.0, rates=(50.0, 100.0)).draw_many(0, 8)


def test_polynomials_give_back_a_cubic_function():
    rng = np.random.default_rng(0)
    points, others = rng.uniform(-1.0, 1.0, (2, 64, 3))
    coefficients = rng.normal(size=20)
    fitted = np.linalg.pinv(cubic(points)) @ (cubic(points) @ coefficients)
    np.testing.assert_allclose(cubic(others) @ fitted, cubic(others) @ coefficients, rtol=1e-9)
    np.testing.assert_allclose(cubic(torch.as_tensor(points)).numpy(), cubic(points))
    one = cubic(np.array([[2.0, 3.0]]))[0]
    np.testing.assert_array_equal(one, [1, 2, 3, 4, 6, 9, 8, 12, 18, 27])


def test_costs_are_discounted_means_of_what_follows(trajectories):
    tuned = TunedFilter.of(tunable_filter("bounded-motion"))
    same_rate = [trajectory for trajectory in trajectories if trajectory.dt == trajectories[0].dt]
    stack = TrajectoryStack.of(tuned, same_rate)
    actions = np.array([[0.0, 0.0, 0.0], [0.5, -0.5, 0.5]])
    costs = costs_to_go(stack, actions, 0.9, small=0.0)
    assert costs.shape == (stack.decisions, len(same_rate), 2)
    now = costs_to_go(stack, actions, 0.0, small=0.0)
    np.testing.assert_allclose(now[..., 0].mean(axis=0), 1.0)
    weights = 0.9 ** np.arange(stack.decisions - 5)
    np.testing.assert_allclose(costs[5], np.tensordot(weights / weights.sum(), now[5:], axes=1))


def test_the_network_finds_the_minimum_that_its_inputs_tell():
    rng = np.random.default_rng(0)
    inputs = rng.uniform(-1.0, 1.0, (4096, 5))
    best = 0.6 * np.tanh(inputs[:, :1])
    points = np.linspace(-1.0, 1.0, 30)[:, None]
    # the logarithm of the cost is a parabola around the best action
    polynomials = (points[:, 0] - best) ** 2 @ np.linalg.pinv(cubic(points)).T
    network = OracleNetwork(5, (16,), np.zeros(1), seed=0)
    network.train(inputs, polynomials.astype(np.float32), n_epochs=200)
    layers = [(layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in network.linear]
    hidden = np.tanh((inputs - network.mean) / network.std @ layers[0][0].T + layers[0][1])
    assert np.abs(hidden @ layers[1][0].T + layers[1][1] - best).mean() < 0.05


def test_it_corrects_a_wrong_tuning_and_is_reproducible(trajectories):
    model = tunable_filter("bounded-motion").model
    wrong = KalmanFilter(dataclasses.replace(model, velocity_bound=5.0 * model.velocity_bound), keep_covariance=False)
    tuned = TunedFilter.of(wrong, ("velocity",))
    options = {"net_arch": (16,), "candidates": 7, "n_epochs": 80, "seed": 0}
    one, two = (fit_oracle(tuned, trajectories, np.zeros(1), **options).policy(tuned) for _ in range(2))
    for (w1, b1), (w2, b2) in zip(one.layers, two.layers, strict=True):
        np.testing.assert_array_equal(w1, w2)
        np.testing.assert_array_equal(b1, b2)
    unseen = HandTrajectories(("slow", "fast"), duration=10.0, rates=(50.0,)).draw_many(1, 6)
    assert policy_errors(wrong, one, unseen).mean() < 0.7 * constant_errors(tuned, unseen, np.zeros(1)).mean()
