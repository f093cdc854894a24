"""An estimator in a loop of one's own equals the run over the recording, glitches included."""

import numpy as np
import pytest

import poise
from poise.envs.hand.sensing import simulate_hand


@pytest.fixture(scope="module")
def motion():
    return simulate_hand("fast", seed=2, duration=4.0, rate=50.0)


def sample(motion, i):
    return {name: values[i] for name, values in motion.measurements.items()}


def test_stepping_equals_running(motion):
    online = poise.OnlineEstimator(poise.make_estimator("bounded-motion", dt=motion.dt)).warm_up()
    found = [online.step(sample(motion, i)).pose["up"] for i in range(len(motion))]
    np.testing.assert_allclose(np.array(found), poise.run("bounded-motion", motion).pose["up"], atol=1e-9)
    latency = online.latency()
    assert latency["samples"] == len(motion)
    assert 0.0 < latency["median (µs)"] <= latency["95 % (µs)"] <= latency["largest (µs)"]


def test_a_glitch_and_a_saturated_sample_are_none(motion):
    wrong = {name: values.copy() for name, values in motion.measurements.items()}
    wrong["imu/acc"][60] += 80.0
    wrong["imu/gyr"][90] = [35.0, 0.0, 0.0]
    spoilt = motion.replace(measurements=wrong, metadata={"name": "spoilt", "full_scale": {"imu/gyr": 34.9}})
    plain = poise.make_estimator("bounded-motion", dt=motion.dt)
    online = poise.OnlineEstimator(plain, ranges={"imu/gyr": 34.9})
    found = [online.step(sample(spoilt, i)).pose["up"] for i in range(len(motion))][-1]
    with pytest.warns(UserWarning, match="count as missing samples"):
        expected = poise.run("bounded-motion", spoilt).pose["up"][-1]
    np.testing.assert_allclose(found, expected, atol=1e-9)
    state = plain.init(sample(spoilt, 0))
    for i in range(len(motion)):
        state, bare = plain.step(state, sample(spoilt, i))
    assert np.linalg.norm(bare.pose["up"] - expected) > 10.0 * np.linalg.norm(found - expected) + 1e-4


def test_it_begins_anew_and_names_what_is_wrong(motion):
    online = poise.OnlineEstimator(poise.make_estimator("mekf", dt=motion.dt))
    for i in range(50):
        online.step(sample(motion, i))
    anew = online.step(sample(motion, 50), restart=True)
    first = poise.OnlineEstimator(online.estimator).step(sample(motion, 50))
    np.testing.assert_array_equal(anew.pose["up"], first.pose["up"])
    with pytest.raises(ValueError, match="imu/acc"):
        online.step({"imu/gyr": np.zeros(3)})
    with pytest.raises(ValueError, match="whole recording"):
        poise.OnlineEstimator(poise.make_estimator("mekf (offline)"))
