"""Gain policies as arrays: forward pass, files, refusals."""

import json
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

from poise.baselines.gain_policy.policy import GainPolicy
from poise.filters.adaptation.gains import GainRange, tunable_filter
from poise.filters.adaptation.tuned import TunedFilter


@pytest.fixture
def tuned():
    return TunedFilter.of(tunable_filter("external-acceleration"))


def random_policy(tuned, seed=0, units=16):
    rng = np.random.default_rng(seed)
    sizes = [tuned.observation_size, units, units, tuned.actions]
    layers = tuple(
        (rng.normal(0.0, 1.0 / np.sqrt(inputs), (outputs, inputs)), rng.normal(0.0, 0.3, outputs))
        for inputs, outputs in pairwise(sizes)
    )
    return GainPolicy(tuned.name, tuned.ranges, tuned.features, layers, {"seed": seed})


def test_it_is_tanh_layers_and_a_clip(tuned):
    policy = random_policy(tuned)
    x = np.random.default_rng(1).uniform(-1.0, 1.0, (5, 2, tuned.observation_size))
    (w0, b0), (w1, b1), (w2, b2) = policy.layers
    expected = np.clip(np.tanh(np.tanh(x @ w0.T + b0) @ w1.T + b1) @ w2.T + b2, -1.0, 1.0)
    np.testing.assert_allclose(policy(x), expected, rtol=1e-13)
    np.testing.assert_allclose(policy(x[3, 1]), expected[3, 1], rtol=1e-12)


def test_constant_and_neutral_policies_ignore_what_they_see(tuned):
    x = np.random.default_rng(1).uniform(-1.0, 1.0, (7, tuned.observation_size))
    np.testing.assert_array_equal(GainPolicy.neutral(tuned)(x), np.zeros((7, 3)))
    np.testing.assert_array_equal(GainPolicy.constant(tuned, [0.1, -2.0, 1.0])(x), np.tile([0.1, -1.0, 1.0], (7, 1)))


def test_files_bring_it_back(tuned, tmp_path):
    policy = random_policy(tuned)
    path = policy.save(tmp_path / "one")
    again = GainPolicy.load(path)
    assert (again.filter, again.ranges, again.features) == (policy.filter, policy.ranges, policy.features)
    x = np.random.default_rng(1).uniform(-1.0, 1.0, (4, tuned.observation_size))
    np.testing.assert_allclose(again(x), policy(x), atol=1e-5)
    assert json.loads((tmp_path / "one.json").read_text())["seed"] == 0
    np.testing.assert_array_equal(GainPolicy.load(again.save(tmp_path / "two"))(x), again(x))


def test_what_does_not_fit_is_refused(tuned, tmp_path):
    good = random_policy(tuned)
    for layers, words in (
        ((), "no layer"),
        (good.layers[:1], "last layer must give 3"),
        (good.layers[1:], "layer 0 must take"),
        ((good.layers[0], (good.layers[1][0], np.zeros(3))), "layer 1 must take"),
    ):
        with pytest.raises(ValueError, match=words):
            GainPolicy(good.filter, good.ranges, good.features, layers)
    with pytest.raises(ValueError, match="lower <= 0 <= upper"):
        GainRange("process", 1.0, 2.0)
    with pytest.raises(FileNotFoundError):
        GainPolicy.load(tmp_path / "none")
    path = good.save(tmp_path / "one")
    path.write_bytes(path.read_bytes()[:-4] + b"1234")
    with pytest.raises(ValueError, match="sha256"):
        GainPolicy.load(path)


def test_running_a_policy_needs_neither_torch_nor_stable_baselines():
    code = (
        "import sys, poise, numpy as np\n"
        "estimator = poise.make_estimator('external-acceleration+policy', dt=0.01)\n"
        "poise.run(estimator, {'imu/gyr': np.zeros((50, 3)), 'imu/acc': np.tile([0, 0, 9.8], (50, 1))}, dt=0.01)\n"
        "print([name for name in ('torch', 'stable_baselines3', 'pybullet', 'pickle5') if name in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "[]"
