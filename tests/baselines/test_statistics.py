"""Statistics over runs and tasks: the definitions of the paper, numbers of its package, intervals that cover."""

import numpy as np
import pytest

from poise.baselines.statistics import (
    bootstrap_interval,
    interquartile_mean,
    mean_interval,
    mean_score,
    performance_profile,
    probability_of_improvement,
)

FIRST = np.array(
    [
        [1.83, 2.64, 1.07, 3.98, 0.91, 0.98, 0.11],
        [0.52, 1.06, 2.26, 1.51, 0.95, 3.13, 0.88],
        [1.14, 0.67, 1.47, 1.96, 0.96, 2.9, 0.51],
        [4.08, 2.03, 4.35, 5.24, 2.17, 1.66, 0.5],
        [2.29, 0.56, 1.16, 5.07, 2.13, 4.66, 2.63],
    ]
)
SECOND = np.round(np.random.default_rng(1).gamma(2.0, 0.8, (4, 7)), 2)


def test_they_are_those_of_rliable():
    """Numbers of rliable 1.2.0 for the same arrays."""
    assert interquartile_mean(FIRST) == pytest.approx(1.6789473684210525)
    assert mean_score(FIRST) == pytest.approx(1.9991428571428573)
    assert probability_of_improvement(FIRST, SECOND) == pytest.approx(0.6392857142857142)
    with_ties = np.concatenate([FIRST[:1], SECOND[1:]])
    assert probability_of_improvement(FIRST, with_ties) == pytest.approx(0.6714285714285715)
    profile = performance_profile(FIRST, [0.5, 1.0, 2.0, 4.0])
    np.testing.assert_allclose(profile, [0.9428571428571428, 0.6857142857142857, 0.42857142857142855, 1.0 / 7.0])


def test_improvement_of_both_over_each_other_is_certain():
    both = probability_of_improvement(FIRST, SECOND) + probability_of_improvement(SECOND, FIRST)
    assert both == pytest.approx(1.0)
    assert probability_of_improvement(FIRST, FIRST + 10.0) == 0.0


def test_the_interval_of_a_mean_is_that_of_its_normal_distribution():
    scores = np.random.default_rng(3).normal(size=(400, 1))
    found = bootstrap_interval(mean_score, scores, draws=4000)
    half = 1.96 * scores.std() / 20.0
    assert found.value == pytest.approx(scores.mean())
    np.testing.assert_allclose([found.low, found.high], scores.mean() + half * np.array([-1.0, 1.0]), atol=0.1 * half)


def test_intervals_cover_what_they_say():
    rng = np.random.default_rng(4)
    covered = 0
    for number in range(200):
        scores = rng.normal(size=(8, 10))
        found = bootstrap_interval(mean_score, scores, seed=number, draws=200)
        covered += found.low <= 0.0 <= found.high
    # 8 runs give somewhat too short percentile intervals: sqrt(7 / 8)
    assert 0.86 <= covered / 200 <= 0.98


def test_strata_are_kept_and_tasks_may_be_drawn():
    scores = np.tile(np.arange(5.0), (3, 1))  # runs agree, tasks do not
    assert bootstrap_interval(mean_score, scores, draws=50) == (2.0, 2.0, 2.0)
    wide = bootstrap_interval(mean_score, scores, draws=500, tasks_too=True)
    assert wide.low < 1.4 < 2.6 < wide.high


@pytest.mark.parametrize("tasks", [1, 2, 7, 40, 300])
def test_the_interval_of_a_mean_is_that_of_one_run(tasks):
    values = np.random.default_rng(tasks).gamma(2.0, 0.8, tasks)
    assert mean_interval(values, 200) == bootstrap_interval(mean_score, values[None], draws=200, tasks_too=True)


def test_equal_seeds_give_equal_intervals():
    one, two, three = (bootstrap_interval(interquartile_mean, FIRST, seed=seed, draws=50) for seed in (1, 1, 2))
    assert one == two != three
    pair = bootstrap_interval(probability_of_improvement, FIRST, SECOND, draws=200)
    assert 0.0 < pair.low < pair.value < pair.high < 1.0


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: interquartile_mean(np.zeros(3)), r"shape \(runs, tasks\)"),
        (lambda: interquartile_mean(np.zeros((0, 3))), "hold something"),
        (lambda: mean_score(np.array([[np.nan, 1.0]])), "1 of 2 are not"),
        (lambda: probability_of_improvement(FIRST, FIRST[:, :3]), "7 tasks of scores, got 3"),
        (lambda: bootstrap_interval(mean_score, FIRST, draws=0), "draws must be at least 1"),
        (lambda: bootstrap_interval(mean_score, FIRST, level=1.0), "level lie in"),
    ],
)
def test_wrong_scores_are_explained(call, words):
    with pytest.raises(ValueError, match=words):
        call()
