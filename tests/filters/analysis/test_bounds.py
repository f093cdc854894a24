"""Posterior Cramér–Rao bounds and observability: recursions against each other, printed and independent figures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.studies.two_gyro.motion import DEG, MOTIONS, Errors, filter_of, simulate, turning
from poise.filters.analysis.bounds import linearise, posterior_bound, with_gaps
from poise.filters.analysis.observability import trajectory_observability
from poise.filters.bicycle.two_gyro.truth import true_states
from poise.filters.core import rotation
from poise.filters.core.kalman import KalmanFilter
from poise.filters.imu.external_acceleration import ExternalAcceleration
from poise.filters.imu.mekf import MEKF

DT = 0.02
STUDY = Errors(bias=0.1 * DEG)


def bound_of_roll(motion, name, duration, errors=STUDY):
    """Standard deviations (T,) of φ and (T, 3) of θ, degrees."""
    model = filter_of(errors, DT, name)
    ride = simulate(motion, duration, DT)
    bound = posterior_bound(model, true_states(ride.truth, model), ride.measurements)
    deviations = np.sqrt(np.diagonal(bound, axis1=1, axis2=2)) / DEG
    return deviations[:, 0], deviations[:, 1:4]


def at(values, *seconds):
    return [float(values[round(second / DT)]) for second in seconds]


def information_step(J, F, Q, H, R):
    """One step of the information recursion as published; Q must not be singular."""
    weighted = np.linalg.solve(Q, F)  # Q⁻¹ F
    D22 = np.linalg.inv(Q) + H.T @ np.linalg.solve(R, H)
    return D22 - weighted @ np.linalg.solve(J + F.T @ weighted, weighted.T)


def test_riccati_equals_the_information_recursion():
    """Tichavsky's recursion and the Riccati form give the same numbers."""
    model = filter_of(STUDY, DT)
    ride = simulate(MOTIONS["circle"], 6.0, DT)
    states = true_states(ride.truth, model)
    bound = posterior_bound(model, states, ride.measurements)
    F, Q, H, R, _ = linearise(model, states, ride.measurements)
    J = np.linalg.inv(bound[0])
    for k in range(len(F)):
        J = information_step(J, F[k], Q[k], H[k + 1], R[k + 1])
    scale = np.sqrt(np.diag(bound[-1]))
    np.testing.assert_allclose(np.linalg.inv(J) / np.outer(scale, scale), bound[-1] / np.outer(scale, scale), atol=1e-7)


def test_a_filter_at_the_truth_has_the_bound():
    """Without noise, from the true start, the filter's own covariance is the bound: any model, singular Q as well."""
    ride = simulate(MOTIONS["circle"], 4.0, 0.001)
    model = replace(
        filter_of(STUDY, 0.001), initial_roll=float(ride.truth["bicycle/roll"][0, 0]), integration="midpoint"
    )
    bound = posterior_bound(model, true_states(ride.truth, model), ride.measurements)
    filtered = KalmanFilter(model).run(ride.measurements).covariance
    np.testing.assert_allclose(np.sqrt(filtered[-1].diagonal()), np.sqrt(bound[-1].diagonal()), rtol=1e-3)

    length = 200
    turn = np.tile([0.0, 0.0, 0.3], (length, 1))
    q = rotation.exp(0.01 * np.arange(length)[:, None] * turn)
    samples = {"imu/gyr": turn, "imu/acc": np.tile([0.0, 0.0, 9.81], (length, 1))}
    mekf = MEKF(dt=0.01)
    states = np.zeros((length, mekf.state_size))
    states[:, :4] = q
    filtered = KalmanFilter(mekf).run(samples)
    bound = posterior_bound(mekf, states, samples)
    np.testing.assert_allclose(np.sqrt(bound[-1].diagonal()), np.sqrt(filtered.covariance[-1].diagonal()), rtol=1e-6)

    lee = ExternalAcceleration(dt=0.01, gravity=9.81)  # its Q has rank two
    states = np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], (length, 1))
    bound = posterior_bound(lee, states, samples)
    filtered = KalmanFilter(lee).run(samples)
    np.testing.assert_allclose(bound[-1], filtered.covariance[-1], atol=1e-12)


def test_missing_samples_tell_nothing():
    model = filter_of(STUDY, DT)
    ride = simulate(MOTIONS["circle"], 4.0, DT)
    states = true_states(ride.truth, model)
    sparse = {name: array.copy() for name, array in ride.measurements.items()}
    sparse["relative/orientation"][1:][np.arange(200) % 3 != 0] = np.nan
    full, fewer = (posterior_bound(model, states, part) for part in (ride.measurements, sparse))
    assert np.all(np.linalg.eigvalsh(fewer[1:] - full[1:]).min(axis=-1) > -1e-12)
    assert fewer[-1, 0, 0] > 1.5 * full[-1, 0, 0]
    late = sparse | {"relative/orientation": sparse["relative/orientation"].copy()}
    late["relative/orientation"][:9] = np.nan
    bound = posterior_bound(model, states, late)
    assert np.isnan(bound[:9]).all()
    filtered = KalmanFilter(model).run(late).covariance
    np.testing.assert_allclose(bound[9], filtered[9], atol=1e-15)
    gaps = with_gaps(ride.measurements, sparse)
    for name, array in sparse.items():
        np.testing.assert_array_equal(gaps[name], array)
    with pytest.raises(ValueError, match="must have shape"):
        with_gaps({}, sparse)
    with pytest.raises(ValueError, match="never suffice"):
        posterior_bound(model, states, late | {"trunk_imu/gyr": np.full((201, 3), np.nan)})
    with pytest.raises(ValueError, match="states must have shape"):
        posterior_bound(model, states[:, :8], ride.measurements)


def test_bounds_of_roll():
    """Cases (a) and (b) of figure 4 beside an independent simulation with its own motion of the body."""
    sine, theta = bound_of_roll(MOTIONS["sine"], "sigma2", 60.0)
    np.testing.assert_allclose(at(sine, 2, 5, 10, 20, 60), [1.69, 0.41, 0.39, 0.20, 0.10], rtol=0.25)
    assert theta[-1].max() < 0.09
    for motion, name in (("sine", "sigma1"), ("straight", "sigma2"), ("straight", "sigma1")):
        roll, theta = bound_of_roll(MOTIONS[motion], name, 60.0)
        np.testing.assert_allclose(at(roll, 2, 5, 10, 20, 60), [5.00, 5.01, 5.04, 5.15, 5.77], rtol=0.06)
        assert theta[-1].max() < 0.09
    second, first = (bound_of_roll(MOTIONS["straight"], name, 20.0)[0][-1] for name in ("sigma2", "sigma1"))
    assert second < first < 1.01 * second  # (b): as good as equal, not equal


def test_scaling_with_the_yaw_rate():
    """Figure 4(c) does not hold: early and late the bound goes with 1 / yaw rate."""
    slow, fast = (bound_of_roll(turning(rate * DEG), "sigma2", 60.0)[0] for rate in (5.0, 20.0))
    np.testing.assert_allclose(at(slow, 2, 10), [2.07, 1.05], rtol=0.1)
    np.testing.assert_allclose(at(fast, 2, 10), [0.58, 0.32], rtol=0.2)
    assert slow[-1] / fast[-1] > 3.0
    still = bound_of_roll(MOTIONS["frozen"], "sigma2", 60.0)[0]
    assert still[-1] == pytest.approx(np.cos(8.0 * DEG) * 0.1 / (20.0 * DEG), rel=0.1)  # bias / yaw rate


def test_known_biases_let_the_curves_meet():
    """The exception: with biases known the bounds of 5 and 20 °/s differ by a quarter after a minute."""
    errors = replace(STUDY, bias=1e-6 * DEG, bias_drift=1e-6 * DEG)
    slow, fast = (bound_of_roll(turning(rate * DEG), "sigma2", 60.0, errors)[0] for rate in (5.0, 20.0))
    np.testing.assert_allclose([slow[-1], fast[-1]], [0.059, 0.047], rtol=0.05)
    early = np.sqrt(12.0 * DT / 2.0**3) / (20.0 * DEG)  # σ_y √(12 T / t³) / yaw rate at 2 s, σ_y = 1°
    assert at(fast, 2)[0] == pytest.approx(early, rel=0.03)


@pytest.mark.parametrize(
    ("motion", "name", "rank"),
    [
        ("circle", "sigma2", 9),
        ("sine", "sigma2", 9),
        ("frozen", "sigma2", 7),
        ("straight", "sigma2", 8),
        ("circle", "sigma1", 9),
    ],
)
def test_observability_along_a_trajectory(motion, name, rank):
    """Constant biases, 40 s; φ is the unobservable one wherever the rank is not full."""
    constant = replace(STUDY, bias_time=1e15)
    model = filter_of(constant, DT, name)
    ride = simulate(MOTIONS[motion], 40.0, DT)
    found = trajectory_observability(model, true_states(ride.truth, model), ride.measurements)
    assert found.rank() == rank
    deviations = found.deviations()
    if rank == model.error_size:
        assert np.isfinite(deviations).all()
        # what the measurements say at once is what the bound without process noise and prior says
        F, _, H, R, _ = linearise(model, true_states(ride.truth, model), ride.measurements)
        flow, gramian = np.eye(9), np.zeros((9, 9))
        for k in range(len(H)):
            gramian += (H[k] @ flow).T @ np.linalg.solve(R[k], H[k] @ flow)
            flow = F[k] @ flow if k < len(F) else flow
        np.testing.assert_allclose(np.sqrt(np.linalg.inv(gramian).diagonal()), deviations, rtol=1e-4)
    else:
        assert np.isinf(deviations[0])
        assert np.isfinite(deviations[1:4]).all()


def test_bad_scales_are_refused():
    model = filter_of(STUDY, DT)
    ride = simulate(MOTIONS["circle"], 1.0, DT)
    with pytest.raises(ValueError, match="scale must be 9 positive"):
        trajectory_observability(model, true_states(ride.truth, model), ride.measurements, np.zeros(9))
