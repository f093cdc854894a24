"""The network and the estimator around it: one meaning in torch, NumPy and compiled; the contracts of estimators."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from poise.baselines.learned.dataset import LearnedDataset
from poise.baselines.learned.estimator import LearnedEstimator, shipped
from poise.baselines.learned.gravity_aligned_frame import FEATURES
from poise.baselines.learned.gru import NAMES, GruNetwork
from poise.baselines.learned.gru_module import GruModule
from poise.baselines.weights_io import save_weights
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.gestures import make_gesture
from poise.envs.hand.hand_held import HandHeld
from poise.envs.recipes.hand import HandRecipe
from poise.envs.sensors.suite import imu_suite
from poise.filters.core import rotation
from poise.filters.core.estimator import Estimator, run, run_by_steps
from poise.filters.core.metrics import score
from poise.filters.core.observer import Observer
from poise.filters.core.quantity import UP
from poise.filters.imu.classical import GyroscopeIntegration, Tilt


@pytest.fixture(scope="module")
def module() -> GruModule:
    module = GruModule(12, seed=1)
    with torch.no_grad():
        generator = torch.Generator().manual_seed(2)
        module.output.weight.copy_(torch.randn(2, 12, generator=generator))
        module.output.bias.copy_(torch.randn(2, generator=generator))
    return module


@pytest.fixture(scope="module")
def network(module: GruModule) -> GruNetwork:
    return GruNetwork.from_arrays(module.arrays())


@pytest.fixture(scope="module")
def episode() -> Trajectory:
    """Some seconds at a rate that is no multiple of the network's, with drop-outs, also at the start."""
    trajectory = HandRecipe(
        duration=6.0, rates=(137.0, 137.0), carried_share=0.0, held=HandHeld(first_rest=(0.3, 0.4))
    ).draw(5)
    measurements = {name: values.copy() for name, values in trajectory.measurements.items()}
    measurements["imu/acc"][:4] = np.nan
    measurements["imu/acc"][200:230] = np.nan
    measurements["imu/gyr"][0] = np.nan
    measurements["imu/gyr"][400:410] = np.nan
    return trajectory.replace(measurements=measurements)


def fast(rate: float, seed: int = 3, duration: float = 40.0) -> Trajectory:
    """A fast motion, the same at every rate, and a sensor with small errors."""
    gesture = make_gesture("fast", np.random.default_rng(seed), duration)
    states = gesture.sample(np.arange(int(duration * rate) + 1) / rate)
    suite = imu_suite("paper-hand", rate)
    suite.reset(np.random.default_rng(seed + 1))
    measurements = suite.simulate(states).measurements
    return Trajectory(np.asarray(states.time), measurements, {"orientation": states.orientation})


def inclination(estimator: Estimator, trajectory: Trajectory, skip: float = 0.0) -> float:
    estimate = run(estimator.with_dt(trajectory.dt), trajectory.measurements)
    mask = trajectory.time > skip
    return score(UP, estimate.pose["up"], trajectory.truth_of("up"), mask)["inclination"][0]


def test_torch_numpy_and_compiled_agree(module: GruModule, network: GruNetwork) -> None:
    features = np.random.default_rng(0).standard_normal((3, 50, FEATURES.size))
    with torch.no_grad():
        expected, last = module(torch.from_numpy(features).float())
    memory = np.zeros((3, 12))
    tilts = []
    for t in range(50):
        memory, tilt = network.step(features[:, t], memory)
        tilts.append(tilt)
    np.testing.assert_allclose(np.stack(tilts, axis=1), expected.numpy(), atol=2e-6)
    np.testing.assert_allclose(memory, last.numpy(), atol=2e-6)
    compiled_memory, compiled_tilt = np.zeros((3, 12)), np.zeros((3, 2))
    compiled = network.advance(
        np.ascontiguousarray(features.swapaxes(0, 1)), np.ones((50, 3)), compiled_memory, compiled_tilt
    )
    np.testing.assert_allclose(compiled.swapaxes(0, 1), np.stack(tilts, axis=1), atol=1e-13)
    np.testing.assert_allclose(compiled_memory, memory, atol=1e-13)


def test_weights_of_another_network_are_refused(module: GruModule) -> None:
    arrays = module.arrays()
    assert set(arrays) == set(NAMES)
    with pytest.raises(ValueError, match="hold the arrays"):
        GruNetwork.from_arrays({name: array for name, array in arrays.items() if name != "output.bias"})
    with pytest.raises(ValueError, match="input_weight must have shape"):
        GruNetwork.from_arrays(arrays | {"input.weight": arrays["input.weight"][:, 1:]})


def test_what_is_no_such_network_is_not_loaded(module: GruModule, tmp_path: Path) -> None:
    other = save_weights(tmp_path / "policy", {"0.weight": np.zeros(3)}, {})
    with pytest.raises(ValueError, match="hold the arrays"):
        LearnedEstimator.load(other)
    old = save_weights(tmp_path / "old", module.arrays(), {"front_end": {"gain": 1.0}})
    with pytest.raises(ValueError, match="another front end"):
        LearnedEstimator.load(old)
    slower = save_weights(tmp_path / "slower", module.arrays(), {"front_end": {"interval": 0.1}})
    assert LearnedEstimator.load(slower, dt=0.08).frame.interval == 0.1


def test_stepping_is_running(network: GruNetwork, episode: Trajectory) -> None:
    estimator = LearnedEstimator(network).with_dt(episode.dt)
    assert isinstance(estimator, Estimator)
    whole = run(estimator, episode.measurements).pose["up"]
    np.testing.assert_array_equal(run_by_steps(estimator, episode.measurements).pose["up"], whole)
    arrays = run_by_steps(replace(estimator, compiled=False), episode.measurements).pose["up"]
    np.testing.assert_allclose(arrays, whole, atol=1e-12)
    assert np.isnan(whole[:4]).all()
    assert np.isfinite(whole[4:]).all()
    np.testing.assert_allclose(np.linalg.norm(whole[4:], axis=-1), 1.0, rtol=1e-12)


def test_a_batch_is_its_members(network: GruNetwork, episode: Trajectory) -> None:
    estimator = LearnedEstimator(network).with_dt(episode.dt)
    other = {name: np.roll(values, 3, axis=-1)[::-1] for name, values in episode.measurements.items()}
    batch = {name: np.stack([values, other[name]], axis=1) for name, values in episode.measurements.items()}
    together = run(estimator, batch).pose["up"]
    for index, alone in enumerate((episode.measurements, other)):
        np.testing.assert_allclose(together[:, index], run(estimator, alone).pose["up"], atol=1e-12)
    square = {name: values.reshape(len(values), 2, 1, 3) for name, values in batch.items()}
    np.testing.assert_allclose(run(estimator, square).pose["up"][:, :, 0], together, atol=1e-12)


def test_torch_gives_the_same(network: GruNetwork, episode: Trajectory) -> None:
    estimator = LearnedEstimator(network).with_dt(episode.dt)
    part = {name: values[:150] for name, values in episode.measurements.items()}
    expected = run(estimator, part).pose["up"]
    found = run(estimator, {name: torch.from_numpy(values.copy()) for name, values in part.items()}).pose["up"]
    np.testing.assert_allclose(found.numpy(), expected, atol=1e-11)


def test_gradients_reach_the_samples(network: GruNetwork, episode: Trajectory) -> None:
    estimator = LearnedEstimator(network).with_dt(episode.dt)
    part = {name: torch.from_numpy(values[20:40].copy()) for name, values in episode.measurements.items()}
    part["imu/acc"].requires_grad_()
    run(estimator, part).pose["up"][-1].sum().backward()
    gradient = part["imu/acc"].grad
    assert gradient is not None
    assert torch.isfinite(gradient).all()
    assert gradient.abs().sum() > 0.0


def test_a_saved_state_goes_on(network: GruNetwork, episode: Trajectory) -> None:
    estimator = LearnedEstimator(network).with_dt(episode.dt)
    samples = [{name: values[t] for name, values in episode.measurements.items()} for t in range(120)]
    state = estimator.init(samples[0])
    for sample in samples[:60]:
        state, _ = estimator.step(state, sample)
    saved = pickle.loads(pickle.dumps(state))
    ends = []
    for start in (state, saved):
        current = start
        for sample in samples[60:]:
            current, estimate = estimator.step(current, sample)
        ends.append(estimate.pose["up"])
    np.testing.assert_array_equal(ends[0], ends[1])
    for array, kept in zip((*state.frame, *state[1:]), (*saved.frame, *saved[1:]), strict=True):
        np.testing.assert_array_equal(array, kept)


def test_the_tilt_means_what_training_takes_it_for(network: GruNetwork, episode: Trajectory) -> None:
    """An estimator whose network says the truth makes no error at the ticks of the network."""
    dataset = LearnedDataset.from_trajectories([episode])
    vertical = dataset.up[0, -1].astype(float)
    bias = vertical[:2] / vertical[2]
    knowing = replace(network, output_weight=0.0 * network.output_weight, output_bias=bias)
    estimator = LearnedEstimator(knowing).with_dt(episode.dt)
    pose = run(Observer(estimator.frame), episode.measurements).pose
    last = np.flatnonzero(pose["due"][:, 0] == 1.0)[-1]
    up = run(estimator, episode.measurements).pose["up"][last]
    np.testing.assert_allclose(up, episode.truth_of("up")[last], atol=1e-6)


def test_too_slow_a_sensor_is_refused(network: GruNetwork) -> None:
    LearnedEstimator(network).with_dt(0.04)
    with pytest.raises(ValueError, match="dt must be at most"):
        LearnedEstimator(network).with_dt(0.05)


def test_running_needs_no_torch() -> None:
    code = (
        "import sys, numpy as np; from poise.baselines.learned.estimator import shipped; from poise import run;"
        "run(shipped(), {'imu/gyr': np.zeros((9, 3)), 'imu/acc': np.ones((9, 3))}, dt=0.01);"
        "assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_shipped_weights_beat_what_either_sensor_gives_alone() -> None:
    trajectory = fast(100.0)
    learned = inclination(shipped(), trajectory)
    assert learned < 1.0
    assert learned < 0.2 * inclination(Observer(Tilt()), trajectory)
    assert learned < 0.7 * inclination(Observer(GyroscopeIntegration()), trajectory)


def test_shipped_weights_mean_the_same_at_every_rate() -> None:
    errors = [inclination(shipped(), fast(rate)) for rate in (50.0, 100.0, 286.0)]
    assert max(errors) - min(errors) < 0.35, errors


def test_shipped_weights_do_not_drift_in_long_runs() -> None:
    trajectory = fast(60.0, seed=8, duration=600.0)
    assert inclination(shipped(), trajectory, skip=300.0) < 1.0


def test_at_rest_only_the_bias_of_the_accelerometer_is_left() -> None:
    rng = np.random.default_rng(4)
    up = rotation.normalize(rng.standard_normal(3))
    acc = 9.80665 * up + np.array([0.05, -0.03, 0.02]) + 0.01 * rng.standard_normal((6000, 3))
    gyr = np.deg2rad([0.8, -0.5, 0.3]) + 0.002 * rng.standard_normal((6000, 3))
    trajectory = Trajectory(np.arange(6000) / 100.0, {"imu/gyr": gyr, "imu/acc": acc}, {"up": np.tile(up, (6000, 1))})
    assert inclination(shipped(), trajectory, skip=30.0) < np.rad2deg(0.062 / 9.8) + 0.15
