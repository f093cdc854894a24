import numpy as np
import pytest
from scipy.signal import welch

from poise.envs.hand.parts.noise import Noise


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize("damping", [None, 0.05])
def test_level_and_band_are_those_asked_for(derivative, damping):
    noise = Noise.draw(np.random.default_rng(1), 200.0, (0.5, 4.0), 3.0, derivative=derivative, damping=damping)
    times = np.arange(0.0, 200.0, 0.01)
    values = noise.sample(times)[derivative]
    assert np.sqrt(np.mean(values**2)) == pytest.approx(3.0, rel=0.02)
    frequency, power = welch(values, 100.0, nperseg=1024, axis=0)
    power = power.sum(1)
    assert power[(frequency > 0.3) & (frequency < 6.0)].sum() > 0.85 * power.sum()
    if damping is None:
        inside = power[(frequency > 0.8) & (frequency < 2.5)]
        assert inside.max() < 3.0 * inside.min()
    else:
        assert power[(frequency > 0.4) & (frequency < 0.6)].sum() > 0.5 * power[frequency < 1.0].sum()


def test_axes_can_have_levels_of_their_own():
    noise = Noise.draw(np.random.default_rng(1), 300.0, (0.5, 4.0), [1.0, 0.1, 0.0], derivative=1)
    spread = noise.sample(np.arange(0.0, 300.0, 0.01))[1].std(axis=0)
    np.testing.assert_allclose(spread, [1.0, 0.1, 0.0], rtol=0.1)


def test_outside_its_interval_noise_stays_where_it_is():
    noise = Noise.draw(np.random.default_rng(0), 2.0, (0.5, 4.0), 1.0, start=1.0)
    value, first, second = noise.sample(np.array([0.0, 1.0, noise.end, 9.0]))
    np.testing.assert_array_equal(value[0], value[1])
    np.testing.assert_array_equal(value[2], value[3])
    assert not first[[0, 3]].any()
    assert not second[[0, 3]].any()
    assert first[1].any()
