"""The exact motions: samples against the orientations they belong to, biases, and the law that Σ2 rests on."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.studies.two_gyro.motion import DEG, IDEAL, MOTIONS, Errors, Pulses, bias_of, simulate
from poise.filters.bicycle.two_gyro.truth import true_angles, true_states
from poise.filters.core import rotation


@pytest.mark.parametrize("name", list(MOTIONS))
def test_samples_integrate_to_the_orientations(name):
    ride = simulate(MOTIONS[name], 4.0, 0.02)
    for gyroscope, body in (("bicycle_imu/gyr", "bicycle"), ("trunk_imu/gyr", "trunk")):
        q = Rotation.from_quat(rotation.to_xyzw(ride.truth[f"{body}/orientation"]))
        steps = Rotation.from_rotvec(0.02 * ride.measurements[gyroscope][1:])
        np.testing.assert_allclose((q[:-1] * steps * q[1:].inv()).magnitude(), 0.0, atol=1e-12)
    angles = true_angles(ride.truth)
    np.testing.assert_allclose(angles["bicycle/roll"][:, 0], MOTIONS[name].roll(ride.time), atol=1e-12)
    theta = np.stack([angle(ride.time) for angle in MOTIONS[name].theta], axis=-1)
    np.testing.assert_allclose(angles["two-gyro/relative_angles"], theta, atol=1e-12)
    np.testing.assert_allclose(angles["two-gyro/pitch"][:, 0], MOTIONS[name].pitch(ride.time), atol=1e-12)


def test_instantaneous_samples_obey_the_law_of_the_roll():
    """(5): without pitch tan φ is the ratio of the y and z rates, in the sensor's axes with both signs turned."""
    ride = simulate(MOTIONS["circle"], 4.0, 0.02, sampling="instant")
    rate = ride.measurements["bicycle_imu/gyr"]
    np.testing.assert_allclose(np.tan(ride.truth["bicycle/roll"][:, 0]), rate[:, 1] / rate[:, 2], atol=1e-6)


def test_errors_have_their_size():
    errors = Errors(camera_interval=5)
    ride = simulate(MOTIONS["circle"], 100.0, 0.01, errors, np.random.default_rng(0))
    ideal = simulate(MOTIONS["circle"], 100.0, 0.01, IDEAL)
    for place in ("bicycle_imu", "trunk_imu"):
        white = ride.measurements[f"{place}/gyr"] - ideal.measurements[f"{place}/gyr"]
        white = white - ride.truth[f"{place}/gyroscope_bias"]
        np.testing.assert_allclose(white.std(axis=0), 0.1 * DEG, rtol=0.05)
    frames = np.isfinite(ride.measurements["relative/orientation"]).all(axis=-1)
    np.testing.assert_array_equal(np.flatnonzero(frames) % 5, 0)
    seen = (
        true_angles(
            ride.truth
            | {
                "trunk/orientation": rotation.multiply(
                    ride.truth["bicycle/orientation"], ride.measurements["relative/orientation"]
                )
            }
        )["two-gyro/relative_angles"]
        - true_angles(ride.truth)["two-gyro/relative_angles"]
    )
    np.testing.assert_allclose(np.nanstd(seen, axis=0), 1.0 * DEG, rtol=0.1)
    assert not any(np.any(ideal.truth[f"{place}/gyroscope_bias"]) for place in ("bicycle_imu", "trunk_imu"))


def test_biases_are_a_markov_process():
    errors = Errors(bias=0.3 * DEG, bias_drift=0.1 * DEG, bias_time=5.0)
    draws = np.stack([bias_of(4001, 0.01, errors, np.random.default_rng(seed)) for seed in range(300)])
    np.testing.assert_allclose(draws[:, 0].std(), 0.3 * DEG, rtol=0.07)
    np.testing.assert_allclose(draws[:, -1].std(), 0.1 * DEG, rtol=0.07)
    product = np.mean(draws[:, -1] * draws[:, -501])
    assert product / np.mean(draws[:, -1] ** 2) == pytest.approx(np.exp(-1.0), abs=0.1)


def test_true_states_are_what_a_filter_holds():
    from poise.baselines.studies.two_gyro.motion import filter_of

    ride = simulate(MOTIONS["circle"], 1.0, 0.001, Errors(), np.random.default_rng(1))
    for name in ("sigma1", "sigma2"):
        model = filter_of(Errors(), 0.001, name)
        states = true_states(ride.truth, model)
        clean = {key: array.copy() for key, array in simulate(MOTIONS["circle"], 1.0, 0.001).measurements.items()}
        for place in ("bicycle_imu", "trunk_imu"):
            clean[f"{place}/gyr"] += ride.truth[f"{place}/gyroscope_bias"]
        now = {key: array[1:] for key, array in clean.items()}
        moved, _, _ = model.predict(states[:-1], now, now)
        np.testing.assert_allclose(moved[:, :4], states[1:, :4], atol=2e-6)


def test_pulses():
    yaw = Pulses(12.0 * DEG, 2.0, 8.0)
    np.testing.assert_allclose(
        yaw(np.array([0.0, 1.0, 2.0, 7.9, 9.0, 16.0])) / DEG, [0.0, 12.0, 24.0, 24.0, 36.0, 48.0]
    )
