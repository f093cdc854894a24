"""All that may set gains, on the same trajectories: what is equal by definition is equal, bounds are bounds."""

import numpy as np
import pytest

from poise.baselines.gain_policy.compared.contenders import (
    OTHERS,
    REFERENCE,
    contenders,
    improvement,
    rows_of,
    side_by_side,
)
from poise.baselines.gain_policy.compared.explained import gains_by_motion, gains_figure
from poise.baselines.gain_policy.compared.oracles import schedule_error, windowed_oracle
from poise.baselines.gain_policy.constant_gains import constant_errors
from poise.baselines.gain_policy.policy import GainPolicy
from poise.envs.hand.trajectories import HandTrajectories
from poise.filters.adaptation.gains import tunable_filter
from poise.filters.adaptation.tuned import TunedFilter

TUNED = TunedFilter.of(tunable_filter("external-acceleration"), ("process", "measurement"))


@pytest.fixture(scope="module")
def motions():
    return HandTrajectories(duration=3.0).draw_many(4, 3)


@pytest.fixture(scope="module")
def found(motions):
    policies = {"policy": GainPolicy.neutral(TUNED)}
    constant = np.array([0.3, 0.4])
    return contenders(TUNED, motions, constant, policies=policies, twins=motions, leave_out=True, points=2).errors


def test_contenders_are_measured_alike(found, motions):
    np.testing.assert_allclose(found["policy"], found["published"], rtol=1e-9)
    np.testing.assert_allclose(found[REFERENCE], constant_errors(TUNED, motions, np.array([0.3, 0.4])))
    assert {"random gains", "innovation-adaptive", "rule: acceleration", "multiple model", "learned noises"} <= set(
        found
    )
    assert all(errors.shape == (3,) and np.isfinite(errors).all() for errors in found.values())


def test_bounds_are_bounds(found):
    hindsight = found["hindsight constant (knows the truth)"]
    for name in ("published", REFERENCE, OTHERS):
        assert (hindsight <= found[name] + 1e-12).all()
    # on the same errors, the oracle of another draw is the oracle itself
    oracle = found["oracle of windows (knows the truth)"]
    np.testing.assert_array_equal(found["oracle of another draw (knows the truth)"], oracle)


def test_the_oracle_of_one_window_is_the_best_constant(motions):
    actions = np.array([[0.0, 0.0], [-0.5, 0.5], [0.5, -0.5]])
    schedule = windowed_oracle(TUNED, motions[0], actions, window=10.0)
    assert (schedule == schedule[0]).all()
    errors = [schedule_error(TUNED, motions[0], action) for action in actions]
    assert schedule_error(TUNED, motions[0], schedule) == pytest.approx(min(errors), rel=1e-9)


def test_what_is_saved_has_an_interval():
    reference = np.array([1.0, 2.0, 3.0, 4.0])
    interval = improvement(0.75 * reference, reference)
    assert interval == pytest.approx((0.25, 0.25, 0.25))
    worse = improvement(reference[::-1], reference)
    assert worse.low < 0.0 < worse.high
    rows = rows_of({REFERENCE: reference, "other": 0.5 * reference})
    assert rows[0]["saved"] == "0 % (0 to 0)"
    assert rows[1]["saved"] == "50 % (50 to 50)"
    rows = rows_of({REFERENCE: reference, OTHERS: 0.5 * reference})
    assert [row["saved of the others'"] for row in rows] == ["-100 % (-100 to -100)", "0 % (0 to 0)"]


def test_a_policy_is_explained_by_its_factors(motions):
    constant = GainPolicy.constant(TUNED, np.array([0.0, 1.0]))
    rows = gains_by_motion(TUNED.kalman, constant, motions)
    assert {row["gain"] for row in rows} == {"process", "measurement"}
    largest = np.exp(TUNED.ranges[1].upper)
    for row in rows:
        wanted = largest if row["gain"] == "measurement" else 1.0
        assert row["factor here"] == pytest.approx(wanted)
        assert row["of the lowest fifth"] <= row["of the highest fifth"]


def test_the_figure_shows_every_gain_over_every_number(motions):
    constant = GainPolicy.constant(TUNED, np.array([0.0, 1.0]))
    figure = gains_figure(TUNED.kalman, constant, {"one": motions, "two": motions[:2]})
    assert len(figure.axes) == 4
    line = figure.axes[2].lines[0]
    np.testing.assert_allclose(line.get_ydata(), np.exp(TUNED.ranges[1].upper))
    assert len(figure.axes[0].lines) == 2


def test_sets_stand_side_by_side():
    one = {REFERENCE: np.radians([1.0, 3.0]), "policy": np.radians([1.0, 1.0])}
    two = {REFERENCE: np.radians([4.0]), OTHERS: np.radians([2.0]), "policy": np.radians([1.0])}
    rows = {row["gains by"]: row for row in side_by_side({"a": one, "b": two})}
    assert rows["policy"]["a (2)"] == pytest.approx(1.0)
    assert rows["policy"]["saved, a"].startswith("50 %")
    assert rows["policy"]["saved, b"].startswith("50 %")
    assert "a (2)" not in rows[OTHERS]
