"""Random movements of a rider: their spectra, events, and what they must not depend on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import welch

from poise.envs.bicycle.rider.body_motion import (
    CORNERS,
    TABLE_RATE,
    breathing,
    coloured_noise,
    events,
    glances,
    posture_changes,
    row_at,
)
from poise.envs.bicycle.rider.style import (
    AT_REST,
    LEAST_EASE,
    LOOKING,
    START,
    STYLES,
    RiderMotion,
    RiderStyle,
    random_style,
    rider_style,
)

TIME = np.arange(0.0, 600.0, 1.0 / TABLE_RATE)


def rng(seed=0):
    return np.random.default_rng(seed)


def test_the_rate_of_the_noise_is_flat_between_its_corner_and_the_lags():
    noise = coloured_noise(rng(), np.ones(8), 60000)
    assert np.std(noise[:, 3:7]) == pytest.approx(1.0, abs=0.06)
    frequency, density = welch(np.gradient(noise[:, :3], 1.0 / TABLE_RATE, axis=0), TABLE_RATE, nperseg=2048, axis=0)
    density = density.mean(axis=1)
    first, middle, high = (
        density[(frequency > low) & (frequency < up)].mean() for low, up in ((0.8, 1.2), (1.8, 2.2), (10.0, 12.0))
    )
    # white noise of rate density 8 π σ² fc: half of it at the corner, all of it far above
    assert first == pytest.approx(8.0 * np.pi * CORNERS[0] / (1.0 + CORNERS[0] ** 2), rel=0.2)
    assert 0.7 < middle / first < 1.2
    assert high < 0.1 * first


def test_fewer_rows_are_the_beginning_of_more():
    np.testing.assert_array_equal(coloured_noise(rng(), np.ones(8), 100), coloured_noise(rng(), np.ones(8), 500)[:100])
    short, long = (RiderMotion(STYLES["normal"], rng(3), duration) for duration in (40.0, 90.0))
    for time in np.linspace(0.0, 40.0, 50):
        for one, other in zip(short.at(time, 0.1, 0.02, 1.0), long.at(time, 0.1, 0.02, 1.0), strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_table_is_read_smoothly():
    table = np.sin(2.0 * np.pi * 2.0 * (np.arange(200) - 1.0) / TABLE_RATE)[:, None] * np.ones(8)
    times = np.linspace(0.0, 3.0, 1000)
    values = np.array([row_at(table, time)[0] for time in times])
    np.testing.assert_allclose(values, np.sin(2.0 * np.pi * 2.0 * times), atol=2e-3)


def test_events_come_at_random_with_their_mean_interval():
    times = list(events(rng(), 20.0, 20000.0))
    assert len(times) == pytest.approx(1000, rel=0.1)
    assert np.std(np.diff(times)) == pytest.approx(20.0, rel=0.1)
    assert list(events(rng(), np.inf, 1e9)) == []


def test_posture_is_held_between_its_changes():
    posture = posture_changes(rng(), TIME, 0.02, 10.0)
    assert (np.abs(np.diff(posture, axis=0)).max(axis=1) == 0.0).mean() > 0.7
    assert np.std(posture) == pytest.approx(0.02, rel=0.3)


def test_glances_turn_the_trunk_and_come_back():
    twist = glances(rng(), TIME, 0.15, 25.0)
    assert 0.1 < np.abs(twist).max() < 0.5
    assert twist.max() > 0.07 > -0.07 > twist.min()
    assert (twist == 0.0).mean() > 0.8


def test_breaths_have_their_rate():
    frequency, power = welch(breathing(rng(), TIME, 0.01), TABLE_RATE, nperseg=8192)
    assert 0.15 < np.average(frequency, weights=power) < 0.7


def test_a_still_rider_does_not_move_at_all():
    motion = RiderMotion(STYLES["still"], rng())
    for time in (0.0, 1.0, 50.0):
        trunk, swivel, torque = motion.at(time, 0.0, 0.0, 2.0)
        assert not trunk.any()
        assert not swivel.any()
        assert torque == 0.0


def test_a_part_is_locked_to_the_cranks():
    style = replace(STYLES["still"], pedalling=0.02)
    motion = RiderMotion(style, rng())
    turn = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    flexion, lean, twist = np.array([motion.at(START, 0.0, 0.0, angle)[0] for angle in turn]).T
    for values, size in ((flexion, 0.01), (lean, 0.02), (twist, 0.02)):
        assert values.max() == pytest.approx(size, rel=0.02)
    spectrum = np.abs(np.fft.rfft(flexion))
    assert np.argmax(spectrum) == 2


def test_a_rider_moves_least_at_walking_pace_and_most_with_a_foot_on_the_ground():
    """At rest nobody has a balance to keep; walking pace takes sway and bending away, but no turns of the shoulders."""
    motion = RiderMotion(replace(STYLES["still"], lean=0.001, twist=0.001), rng())
    riding, walking, rest = (
        motion.at(5.0, 0.0, 0.0, **now)[0][1:] for now in ({}, {"speed": 0.5}, {"speed": 0.0, "foot": 1.0})
    )
    np.testing.assert_allclose(walking / riding, [LEAST_EASE, 1.0], rtol=1e-6)
    np.testing.assert_allclose(rest / riding, AT_REST, rtol=1e-3)


def test_random_styles_lie_between_mild_and_aggressive():
    low, high = STYLES["mild"], STYLES["aggressive"]
    styles = [random_style(rng(seed)) for seed in range(50)]
    for name in ("lean", "twist", "pedalling", "glance_interval"):
        ends = sorted((getattr(low, name), getattr(high, name)))
        drawn = [getattr(style, name) for style in styles]
        assert ends[0] <= min(drawn) < max(drawn) <= ends[1]
        assert np.ptp(drawn) > 0.7 * (ends[1] - ends[0])
    assert rider_style("random", rng(1)) == styles[1]


def test_who_looks_around_does_so_often_and_far():
    looking = np.array([[np.log(getattr(random_style(rng(seed)), name)) for name in LOOKING] for seed in range(20)])
    np.testing.assert_allclose(np.abs(np.corrcoef(looking.T)), 1.0)
    others = [np.log(random_style(rng(seed)).lean) for seed in range(20)]
    assert abs(np.corrcoef(others, looking[:, 0])[0, 1]) < 0.5


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rider_style("random"), "a random style needs a generator"),
        (lambda: RiderMotion(STYLES["mild"], rng(), 10.0).at(10.1, 0.0, 0.0), "time must lie in the 10 s"),
        (lambda: replace(STYLES["mild"], twist=0.3), "twist must be at most 0.2 rad.*0.3"),
        (lambda: replace(STYLES["mild"], glance_interval=0.0), "glance_interval must be at least 1 s"),
        (lambda: RiderStyle("x", 0.1, 0.1, -0.1, 0.0, 0.0), "twist must not be negative"),
    ],
)
def test_impossible_movements_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
