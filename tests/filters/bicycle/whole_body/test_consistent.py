"""The whole-body filter with biases and errors of the geometry as states."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.studies.whole_body.motion import IDEAL, ExactRide
from poise.envs.data.trajectory import Trajectory
from poise.filters.bicycle.geometry import GEOMETRY_STD
from poise.filters.bicycle.whole_body.consistent import ADDED, BIASES, PUBLISHED, ConsistentWholeBody
from poise.filters.bicycle.whole_body.filter import WholeBody
from poise.filters.bicycle.whole_body.linkage import ERROR_SIZE, GYROSCOPES, HIP, OUTPUTS, SHOULDER, paper_axes
from poise.filters.core import metrics
from poise.filters.core.kalman import KalmanFilter
from poise.filters.registry import FILTERS, name_of

from .whole_body_cases import RIDER

FORMS = {
    "complete": ConsistentWholeBody.for_rider(RIDER, sampling="instant"),
    "some constraints": ConsistentWholeBody.for_rider(RIDER, constraints=("C2", "C5", "C7"), usual_twist=True),
}
DEG = math.pi / 180.0


@pytest.fixture(scope="module")
def ideal() -> Trajectory:
    return ExactRide(RIDER, "outdoor", swivel=0.0, seed=4).record(20.0, sampling="interval", errors=IDEAL)


def samples(ride: Trajectory, tick: int) -> dict[str, np.ndarray]:
    return {channel.name: ride.measurements[channel.name][tick] for channel in WholeBody.channels}


@pytest.mark.parametrize("name", list(FORMS))
def test_jacobians_through_retract(name: str, ideal: Trajectory) -> None:
    model, rng = FORMS[name], np.random.default_rng(5)
    z, before = samples(ideal, 200), samples(ideal, 199)
    x = model.prior(z)[0]
    assert x.shape == (model.state_size,)
    x[:ERROR_SIZE] += 0.05 * rng.standard_normal(ERROR_SIZE)
    x[PUBLISHED:] = 0.05 * rng.standard_normal(ADDED)
    _, F, Q = model.predict(x, z, before)
    r, H, R = model.residual(x, z)
    assert F.shape == Q.shape == (model.error_size, model.error_size)
    assert H.shape == (model.residual_size, model.error_size)
    assert r.shape == (model.residual_size,)
    assert np.all(np.diag(R) > 0.0)

    def errors(state: np.ndarray) -> np.ndarray:
        return np.concatenate([state[:ERROR_SIZE], state[PUBLISHED:]])

    step = 1e-6
    for i in range(model.error_size):
        plus, minus = (model.retract(x, sign * step * np.eye(model.error_size)[i]) for sign in (1.0, -1.0))
        slope = errors(model.predict(plus, z, before)[0] - model.predict(minus, z, before)[0]) / (2.0 * step)
        # of the second order in the interval: the midpoint's own slope by a bias
        np.testing.assert_allclose(F[:, i], slope, atol=2e-4 if i >= ERROR_SIZE else 1e-6)
        slope = (model.residual(plus, z)[0] - model.residual(minus, z)[0]) / (2.0 * step)
        np.testing.assert_allclose(-H[:, i], slope, atol=1e-6)


def test_without_what_lasts_and_without_a_posture_it_is_the_published_filter(ideal: Trajectory) -> None:
    published = WholeBody.for_rider(RIDER)
    own = {name: getattr(published, name) for name in vars(published) if not name.startswith("_")}
    nothing = {
        "leg_gyroscope_noise": published.limb_gyroscope_noise,
        "bias_prior": 0.0,
        "bias_drift": 0.0,
        "trunk_offset_prior": 0.0,
        "posture_noise": (1e9, 1e9, 1e9),
    }
    nothing |= {"arm_offsets": (0.0, 0.0, 0.0), "leg_offsets": (0.0, 0.0, 0.0)}
    measurements = {channel.name: ideal.measurements[channel.name][:60] for channel in published.channels}
    first = KalmanFilter(published, compiled=False).run(measurements)
    second = KalmanFilter(ConsistentWholeBody(**own, **nothing), compiled=False).run(measurements)  # type: ignore[arg-type]
    for quantity in OUTPUTS:
        np.testing.assert_allclose(second.pose[quantity.name], first.pose[quantity.name], atol=1e-9)
    np.testing.assert_allclose(second.covariance[:, :ERROR_SIZE, :ERROR_SIZE], first.covariance, atol=1e-9)


def test_biases_of_gyroscopes_are_found_and_no_longer_turn_arms_and_trunk(ideal: Trajectory) -> None:
    rng = np.random.default_rng(0)
    measurements = {channel.name: ideal.measurements[channel.name].copy() for channel in WholeBody.channels}
    biases = {name: 3.0 * DEG * rng.uniform(-1.0, 1.0, 3) for name in GYROSCOPES[1:]}
    for name, bias in biases.items():
        measurements[name] += bias
    worst = {}
    for form in (WholeBody, ConsistentWholeBody):
        model = form.for_rider(RIDER, seat_share=1.0, trunk_flexion=0.5)
        state = None
        estimate, state = KalmanFilter(model).run_from(state, measurements)
        worst[form] = max(
            float(np.degrees(metrics.rms(metrics.error(q, estimate.pose[q.name], ideal.truth[q.name])[1000:])))
            for q in OUTPUTS
        )
    assert worst[ConsistentWholeBody] < 0.5 * worst[WholeBody]
    found = np.asarray(state.x[PUBLISHED:][BIASES]).reshape(5, 3)
    told = np.array([paper_axes(bias) for bias in biases.values()])
    assert np.sqrt(np.mean((found - told) ** 2)) < 0.5 * np.sqrt(np.mean(told**2))


def test_a_limb_in_its_mirrored_posture_begins_anew(ideal: Trajectory) -> None:
    model = FORMS["complete"]
    z = samples(ideal, 200)
    x = model.prior(z)[0]
    np.testing.assert_array_equal(model.finish(x, z), x)
    folded = x.copy()
    folded[HIP["left"]] -= [80.0 * DEG, 0.0, 0.0]
    folded[SHOULDER["right"]] += [10.0 * DEG, 70.0 * DEG, 0.0]
    np.testing.assert_allclose(model.finish(folded, z), x, atol=1e-9)


def test_the_usual_posture_is_that_of_the_rider() -> None:
    rider = replace(RIDER, trunk_flexion=0.7)
    model = ConsistentWholeBody.for_rider(rider)
    assert model.usual_flexion == 0.7
    assert name_of(model) == "whole-body-consistent"
    assert FILTERS["whole-body"].outputs == FILTERS["whole-body-consistent"].outputs
    with pytest.raises(ValueError, match="posture_noise must be positive"):
        ConsistentWholeBody(posture_noise=(0.0, 1.0, 1.0))


def test_offsets_follow_from_how_exactly_the_rider_was_measured() -> None:
    usual, geometry = ConsistentWholeBody(), RIDER.describe()

    def offsets(**tape: float) -> list[np.ndarray]:
        model = usual.configured({"geometry": geometry, GEOMETRY_STD: tape})
        return [np.array(each) for each in (model.arm_offsets, model.leg_offsets)]

    unsaid = usual.configured({"geometry": geometry})
    assert (unsaid.arm_offsets, unsaid.leg_offsets) == (usual.arm_offsets, usual.leg_offsets)
    for told, own in zip(offsets(), (usual.arm_offsets, usual.leg_offsets), strict=True):
        np.testing.assert_array_equal(told, own)
    for exact, twice, own in zip(
        offsets(lengths=0.0, places=0.0), offsets(lengths=0.04, places=0.02), offsets(), strict=True
    ):
        # an elbow or a knee that is not quite out is the rider's, not the tape's
        np.testing.assert_allclose(exact, [0.002, 0.002, own[2]])
        np.testing.assert_array_equal(twice, own)
    np.testing.assert_allclose(offsets(lengths=0.01, places=0.005)[0], [0.03, 0.025, 0.2])
    arm, leg = offsets(lengths=0.0)
    assert arm[0] == pytest.approx(0.06 * math.sqrt(0.87))
    assert leg[0] == pytest.approx(0.033 * math.sqrt(0.61))
    # without a geometry it tells nothing
    assert usual.configured({GEOMETRY_STD: {"lengths": 0.0}}) == usual
    with pytest.raises(ValueError, match="geometry_std must map"):
        usual.configured({"geometry": geometry, GEOMETRY_STD: {"tape": 0.01}})
