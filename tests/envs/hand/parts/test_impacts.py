import numpy as np
import pytest

from poise.envs.hand.parts.impacts import Ringing, SetDowns, Taps, random_impacts


def test_an_impact_has_its_peak_and_ends():
    vectors = np.array([[3.0, 0.0, -40.0, 5.0, 0.0, 1.0]])
    impact = Ringing(np.array([1.0]), vectors, np.array([0.004]), np.array([60.0]), damping=0.3)
    times = np.linspace(0.9, 1.4, 500_001)
    position, angles = impact.sample(times)
    np.testing.assert_allclose(np.abs(position[2]).max(axis=0), np.abs(vectors[0, :3]), rtol=5e-3)
    np.testing.assert_allclose(np.abs(angles[2]).max(axis=0), np.abs(vectors[0, 3:]), rtol=5e-3)
    over = (times < 1.0) | (times > 1.0 + impact.length(0.004, 60.0))
    for order in range(3):
        assert np.abs(position[order][over]).max() == 0.0
    # it comes back: no displacement and no velocity are left
    assert np.abs(np.diff(position[0], axis=0)).max() < 1e-6


def test_a_force_off_centre_turns_the_body_at_a_right_angle():
    generator = np.random.default_rng(0)
    impacts = random_impacts(generator, np.arange(50.0), np.full(50, 10.0), (0.002, 0.01), (20.0, 80.0), 0.1)
    np.testing.assert_allclose(np.linalg.norm(impacts.vectors[:, :3], axis=1), 10.0)
    np.testing.assert_allclose(np.sum(impacts.vectors[:, :3] * impacts.vectors[:, 3:], axis=1), 0.0, atol=1e-9)
    # |α| ≤ |r| |a| / ρ² with |r| ≤ √3 ρ
    assert np.linalg.norm(impacts.vectors[:, 3:], axis=1).max() <= np.sqrt(3.0) * 10.0 / 0.1


def test_taps_come_at_their_rate_and_set_downs_when_the_hand_lets_go():
    taps = Taps(rate=(2.0, 2.0)).draw(np.random.default_rng(0), ((1.0, 201.0), (300.0, 400.0)))
    assert 540 < len(taps.times) < 660
    assert not ((taps.times > 201.0) & (taps.times < 300.0)).any()
    downs = SetDowns(peak=(5.0, 10.0)).draw(np.random.default_rng(0), ((1.0, 4.0), (6.0, 9.0)))
    np.testing.assert_array_equal(downs.times, [4.0, 9.0])
    peaks = np.linalg.norm(downs.vectors[:, :3], axis=1)
    assert 5.0 <= peaks.min() < peaks.max() <= 10.0


def test_bad_ranges_are_refused_by_name():
    with pytest.raises(ValueError, match=r"peak must be a range \(lowest, highest\).*got \(2.0, 1.0\)"):
        Taps(peak=(2.0, 1.0))
