"""Spectra and their numbers against signals whose numbers are known."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.studies.realism.spectra import sinusoid_share, spectrum

RATE = 100.0
TIME = np.arange(12_000) / RATE


def test_rms_edges_shares_and_derivative_of_two_sines():
    values = np.stack([3.0 * np.sin(2 * np.pi * 2.0 * TIME), 1.0 * np.cos(2 * np.pi * 12.0 * TIME) + 5.0], axis=1)
    found = spectrum(values, RATE)
    assert found.rms() == pytest.approx(np.sqrt(0.5 * (9.0 + 1.0)), rel=1e-3)
    assert found.share(10.0) == pytest.approx(0.1, rel=1e-2)
    assert found.edge(0.85) == pytest.approx(2.0, abs=0.15)
    assert found.edge(0.95) == pytest.approx(12.0, abs=0.15)
    expected = 2 * np.pi * np.sqrt(0.5 * (9.0 * 2.0**2 + 1.0 * 12.0**2))
    assert found.derivative_rms() == pytest.approx(expected, rel=1e-2)
    assert found.band(0.0, 10.0).rms() == pytest.approx(np.sqrt(4.5), rel=1e-3)


def test_white_noise_is_flat():
    noise = np.random.default_rng(0).standard_normal((60_000, 3))
    found = spectrum(noise, RATE)
    assert found.rms() == pytest.approx(np.sqrt(3.0), rel=0.02)
    assert found.edge(0.5) == pytest.approx(25.0, abs=1.0)
    assert found.share(40.0) == pytest.approx(0.2, abs=0.01)


def test_short_gaps_are_filled_and_long_ones_cut():
    values = np.sin(2 * np.pi * 1.0 * TIME)[:, None]
    holed = values.copy()
    holed[1000:1008] = np.nan
    holed[5000:5400] = np.nan
    assert spectrum(holed, RATE).rms() == pytest.approx(spectrum(values, RATE).rms(), rel=0.01)
    holed[::5] = np.nan
    assert spectrum(holed, RATE).edge(0.9) == pytest.approx(1.0, abs=0.2)


def test_a_signal_shorter_than_a_segment_is_one_segment_and_none_is_an_error():
    assert spectrum(np.sin(TIME[:300])[:, None], RATE).resolution == pytest.approx(1.0 / 3.0)
    with pytest.raises(ValueError, match="needs a second without"):
        spectrum(np.full((500, 3), np.nan), RATE)
    with pytest.raises(ValueError, match=r"values must have shape \(T, size\)"):
        spectrum(np.zeros(500), RATE)
    with pytest.raises(ValueError, match="rate must be positive"):
        spectrum(np.zeros((500, 3)), 0.0)


def test_sinusoids_have_all_of_a_sum_of_sines_and_little_of_noise():
    generator = np.random.default_rng(1)
    sines = sum(np.sin(2 * np.pi * f * TIME + p) for f, p in [(0.37, 0.1), (1.21, 2.0), (2.83, 1.0), (4.1, 0.4)])
    assert sinusoid_share(sines[:, None], RATE) > 0.97
    noise = generator.standard_normal((len(TIME), 3))
    assert sinusoid_share(noise, RATE) < 0.1
    half = sines[:, None] + np.sqrt(2.0) * generator.standard_normal((len(TIME), 1))
    assert sinusoid_share(half, RATE) == pytest.approx(0.5, abs=0.06)
    assert np.isnan(sinusoid_share(sines[:500, None], RATE))
