import numpy as np
import pytest

from poise.envs.hand.parts.gait import Path, Steps


def test_the_phase_counts_steps_at_the_cadence():
    steps = Steps.draw(np.random.default_rng(0), 60.0, 1.8, 0.05)
    assert steps.strikes[0] < -1.0
    assert steps.strikes[-1] > 61.0
    value, first, _ = steps.phase(steps.strikes[2:-2])
    np.testing.assert_allclose(value, np.arange(2, len(steps.strikes) - 2), atol=1e-9)
    assert (first > 0.0).all()
    assert np.mean(steps.phase(np.arange(0.0, 60.0, 0.01))[1]) == pytest.approx(1.8, rel=0.03)


def test_a_path_is_walked_at_its_speed_and_pauses():
    path = Path.draw(np.random.default_rng(0), 60.0, 1.3, 0.3, ((1.0, 30.0), (40.0, 60.0)))
    times = np.arange(0.0, 60.0, 0.05)
    speed = np.linalg.norm(path.curve.sample(times)[1], axis=1)
    assert speed[(times < 1.0) | ((times > 30.0) & (times < 40.0))].max() < 1e-12
    walking = (times > 4.0) & (times < 27.0)
    assert np.mean(speed[walking]) == pytest.approx(1.3, rel=0.15)
    east, north = path.curve.sample(times[walking])[1].T
    heading = path.heading.sample(times[walking])[0][:, 0]
    # one walks where one looks
    assert np.mean(np.cos(np.arctan2(north, east) - heading)) > 0.99
