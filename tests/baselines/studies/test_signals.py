"""Sums of sines, numerical derivatives and Gauss–Markov noise of the synthetic motions."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.studies.signals import Waves, derivative, gauss_markov, second_derivative


def test_waves_have_the_standard_deviation_that_was_asked_for():
    t = np.linspace(0.0, 2000.0, 200_001)
    for equal in (False, True):
        waves = Waves.draw(np.random.default_rng(3), 0.2, 0.1, 1.0, offset=1.5, equal=equal)
        assert waves(t).mean() == pytest.approx(1.5, abs=0.005)
        assert waves(t).std() == pytest.approx(0.2, rel=0.02)
        assert len(waves.terms) == 4


def test_derivatives_and_integral_are_those_of_calculus():
    waves = Waves(0.3, -0.2, ((1.0, 2.0, 0.4), (0.5, 5.0, 1.1)))
    t = np.linspace(0.0, 3.0, 50)
    first = -0.2 + 2.0 * np.cos(2.0 * t + 0.4) + 2.5 * np.cos(5.0 * t + 1.1)
    second = -4.0 * np.sin(2.0 * t + 0.4) - 12.5 * np.sin(5.0 * t + 1.1)
    np.testing.assert_allclose(derivative(waves, t), first, atol=1e-9)
    np.testing.assert_allclose(second_derivative(waves, t), second, atol=1e-7)
    np.testing.assert_allclose(derivative(waves.integral, t), waves(t), atol=1e-9)
    assert waves.integral(np.zeros(1))[0] == 0.0


def test_gauss_markov_noise_has_its_deviation_and_correlation_time():
    normal = np.random.default_rng(0).standard_normal((400, 20_000))
    values = gauss_markov(normal, 0.5, 2.0, 0.01)
    np.testing.assert_allclose(values[[0, -1]].std(axis=1), 0.5, rtol=0.03)
    assert np.mean(values[0] * values[200]) / 0.25 == pytest.approx(np.exp(-1.0), abs=0.03)
    started = gauss_markov(normal, 0.5, 2.0, 0.01, start=0.0)
    np.testing.assert_array_equal(started[0], 0.0)
    # from rest the variance is σ² (1 − exp(−2t/τ))
    assert started[200].std() == pytest.approx(0.5 * np.sqrt(1.0 - np.exp(-2.0)), rel=0.03)
