import numpy as np
import pytest
from scipy.signal import welch

from poise.envs.hand.gestures import Turn, make_gesture
from poise.envs.hand.parts.shaking import Drift, SoftTissue, Tremor, Vibration
from poise.envs.sensors.ideal import STANDARD_GRAVITY
from poise.filters.core import rotation

INTERVAL = ((0.0, 120.0),)


def test_tremor_lies_between_8_and_12_hz():
    tremor = Tremor(acceleration=(0.3, 0.3), rate=(0.1, 0.1)).draw(np.random.default_rng(0), INTERVAL)
    times = np.arange(1.0, 119.0, 0.005)
    position, angles = tremor.sample(times)
    for values, level in ((position[2], 0.3), (angles[1], 0.1)):
        assert np.sqrt(np.mean(np.sum(values**2, axis=1))) == pytest.approx(level, rel=0.05)
        frequency, power = welch(values, 200.0, nperseg=1024, axis=0)
        power = power.sum(1)
        assert power[(frequency > 7.0) & (frequency < 13.0)].sum() > 0.9 * power.sum()


def test_vibration_is_a_tone_that_goes_on_and_off():
    config = Vibration(frequency=(90.0, 90.0), acceleration=(4.0, 4.0), on=(2.0, 2.0), off=(2.0, 2.0))
    buzz = config.draw(np.random.default_rng(0), INTERVAL)
    times = np.arange(0.0, 120.0, 0.001)
    acceleration = buzz.sample(times).position[2]
    length = np.linalg.norm(acceleration, axis=1)
    assert length.max() == pytest.approx(4.0, rel=0.05)
    assert 0.3 < np.mean(length > 0.0) < 0.7
    frequency, power = welch(acceleration, 1000.0, nperseg=4096, axis=0)
    power = power.sum(1)
    assert power[(frequency > 85.0) & (frequency < 95.0)].sum() > 0.9 * power.sum()


def test_drift_is_fast_and_slow():
    drift = Drift(speed=(0.2, 0.2)).draw(np.random.default_rng(0), INTERVAL)
    times = np.arange(0.0, 120.0, 0.05)
    velocity = drift.sample(times).position[1]
    assert np.sqrt(np.mean(np.sum(velocity**2, axis=1))) == pytest.approx(0.2, rel=0.25)
    frequency, power = welch(velocity, 20.0, nperseg=1024, axis=0)
    power = power.sum(1)
    assert power[frequency < 0.2].sum() > 0.8 * power.sum()


def test_soft_tissue_solves_its_equation():
    gesture = make_gesture("fast", np.random.default_rng(0), 10.0)
    tissue = SoftTissue(frequency=(8.0, 8.0), damping=(0.2, 0.2), tilt=0.0).draw(np.random.default_rng(0), gesture)
    times, w = np.arange(0.1, 9.9, 0.01), 2.0 * np.pi * 8.0
    body = gesture.sample(times)
    value, first, second = tissue.sample(times).position
    force = rotation.rotate_back(body.orientation, body.acceleration + np.array([0.0, 0.0, STANDARD_GRAVITY]))
    residual = second + 0.4 * w * first + w * w * value + force
    assert np.abs(residual).max() < 0.02 * np.abs(force).max()


def test_soft_tissue_sags_at_rest():
    gesture = make_gesture(Turn(tilt=0.0, rest=5.0), np.random.default_rng(0), 6.0)
    tissue = SoftTissue(frequency=(5.0, 5.0)).draw(np.random.default_rng(0), gesture)
    sag = tissue.sample(np.arange(0.0, 4.0, 0.1)).position[0]
    np.testing.assert_allclose(sag[:, 2], -STANDARD_GRAVITY / (10.0 * np.pi) ** 2, rtol=1e-9)
