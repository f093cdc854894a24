"""The estimator around a network: the contracts of estimators, files, limits, shipped weights."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from poise.baselines.learned.data import SequenceData
from poise.baselines.learned.estimator import LearnedEstimator, shipped
from poise.baselines.learned.head import AngleHead, TiltHead
from poise.baselines.learned.inputs.gravity_aligned_frame import FEATURES
from poise.baselines.learned.inputs.level_frame import LevelFrame
from poise.baselines.learned.networks.gru import GruNetwork
from poise.baselines.learned.networks.modules import GruModule
from poise.baselines.registry import make_estimator
from poise.baselines.weights_io import save_weights
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.gestures import make_gesture
from poise.envs.hand.hand_held import HandHeld
from poise.envs.recipes.hand import HandRecipe
from poise.envs.recipes.registry import recipe
from poise.envs.sensors.suite import imu_suite
from poise.filters.core import rotation
from poise.filters.core.estimator import Estimator, run, run_by_steps
from poise.filters.core.metrics import direction_error, score
from poise.filters.core.quantity import UP, Quantity
from poise.filters.core.recursion import Observer
from poise.filters.imu.classical import GyroscopeIntegration, Tilt
from poise.filters.registry import make


@pytest.fixture(scope="module")
def network() -> GruNetwork:
    module = GruModule(FEATURES.size, 2, 12, seed=1, scale=0.1)
    with torch.no_grad():
        generator = torch.Generator().manual_seed(2)
        module.output.weight.copy_(torch.randn(2, 12, generator=generator))
        module.output.bias.copy_(torch.randn(2, generator=generator))
    return module.export()


def learned(network: GruNetwork, dt: float = 0.01, **parts: Any) -> LearnedEstimator:
    return LearnedEstimator(network, **{"front_end": LevelFrame().with_dt(dt), "head": TiltHead(), **parts})


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


@pytest.mark.parametrize("limit", [None, 3.0])
@pytest.mark.parametrize("inner", [None, "bounded-motion"])
def test_a_file_gives_the_same_estimator(
    network: GruNetwork, episode: Trajectory, tmp_path: Path, inner: str | None, limit: float | None
) -> None:
    front_end = LevelFrame(None if inner is None else make(inner))
    if inner is not None:
        network = replace(network, input_weight=np.pad(network.input_weight, ((0, 0), (0, 1))))
    estimator = LearnedEstimator(network, front_end, TiltHead(None if inner is None else limit)).with_dt(episode.dt)
    path = estimator.save(tmp_path / "mine", {"name": "mine"})
    again = LearnedEstimator.load(path, dt=episode.dt)
    np.testing.assert_array_equal(
        run(again, episode.measurements).pose["up"], run(estimator, episode.measurements).pose["up"]
    )


def test_what_is_no_such_network_is_not_loaded(network: GruNetwork, tmp_path: Path) -> None:
    other = save_weights(tmp_path / "policy", {"0.weight": np.zeros(3)}, {})
    with pytest.raises(ValueError, match="does not describe a network"):
        LearnedEstimator.load(other)
    parts = {"front_end": {"kind": "level-frame", "frame": {"gain": 1.0}}, "head": {"kind": "tilt"}}
    old = save_weights(tmp_path / "old", network.arrays(), {"network": "gru", **parts})
    with pytest.raises(ValueError, match="does not describe a network"):
        LearnedEstimator.load(old)
    with pytest.raises(ValueError, match="kind of network"):
        LearnedEstimator.load(save_weights(tmp_path / "new", network.arrays(), {"network": "lstm", **parts}))
    with pytest.raises(ValueError, match="must take 22 features and give 3 outputs"):
        LearnedEstimator(network, LevelFrame(), AngleHead((Quantity("a", "angle", 3, "rad"),), (1.0, 1.0, 1.0)))


def test_a_filter_that_is_certain_is_not_overruled(network: GruNetwork, episode: Trajectory) -> None:
    """Whatever the network says, the correction stays below its limit in deviations of the filter."""
    wide = replace(
        network, input_weight=np.pad(network.input_weight, ((0, 0), (0, 1))), output_bias=np.array([9.0, 4.0])
    )
    front_end = LevelFrame(make("bounded-motion")).with_dt(episode.dt)
    seen = front_end.run(episode.measurements)
    for limit in (0.5, 3.0):
        bounded = LearnedEstimator(wide, front_end, TiltHead(limit, floor=0.001))
        up = run(bounded, episode.measurements).pose["up"]
        known = np.isfinite(up).all(axis=-1)
        corrected = direction_error(up, rotation.up_in_body(seen.base["relative_orientation"]))[known]
        allowed = np.arctan(limit * seen.spread[known, 0] + 0.001)
        assert (corrected <= allowed + 1e-9).all()
        assert (corrected[100:] > 0.9 * allowed[100:]).all()


def test_a_network_that_says_nothing_leaves_the_filter_alone(network: GruNetwork, episode: Trajectory) -> None:
    silent = replace(network, output_weight=0.0 * network.output_weight, output_bias=np.zeros(2))
    silent = replace(silent, input_weight=np.pad(network.input_weight, ((0, 0), (0, 1))))
    kalman = make("bounded-motion").with_dt(episode.dt)
    estimator = LearnedEstimator(silent, LevelFrame(kalman), TiltHead(3.0))
    expected = run(kalman, episode.measurements).pose["up"]
    np.testing.assert_allclose(run(estimator, episode.measurements).pose["up"], expected, atol=1e-12)


def test_stepping_is_running(network: GruNetwork, episode: Trajectory) -> None:
    estimator = learned(network, episode.dt)
    assert isinstance(estimator, Estimator)
    whole = run(estimator, episode.measurements).pose["up"]
    np.testing.assert_array_equal(run_by_steps(estimator, episode.measurements).pose["up"], whole)
    arrays = run_by_steps(replace(estimator, compiled=False), episode.measurements).pose["up"]
    np.testing.assert_allclose(arrays, whole, atol=1e-12)
    assert np.isnan(whole[:4]).all()
    assert np.isfinite(whole[4:]).all()
    np.testing.assert_allclose(np.linalg.norm(whole[4:], axis=-1), 1.0, rtol=1e-12)


def test_a_batch_is_its_members(network: GruNetwork, episode: Trajectory) -> None:
    estimator = learned(network, episode.dt)
    other = {name: np.roll(values, 3, axis=-1)[::-1] for name, values in episode.measurements.items()}
    batch = {name: np.stack([values, other[name]], axis=1) for name, values in episode.measurements.items()}
    together = run(estimator, batch).pose["up"]
    for index, alone in enumerate((episode.measurements, other)):
        np.testing.assert_allclose(together[:, index], run(estimator, alone).pose["up"], atol=1e-12)
    square = {name: values.reshape(len(values), 2, 1, 3) for name, values in batch.items()}
    np.testing.assert_allclose(run(estimator, square).pose["up"][:, :, 0], together, atol=1e-12)


def test_torch_gives_the_same(network: GruNetwork, episode: Trajectory) -> None:
    estimator = learned(network, episode.dt)
    part = {name: values[:150] for name, values in episode.measurements.items()}
    expected = run(estimator, part).pose["up"]
    found = run(estimator, {name: torch.from_numpy(values.copy()) for name, values in part.items()}).pose["up"]
    np.testing.assert_allclose(found.numpy(), expected, atol=1e-11)


def test_gradients_reach_the_samples(network: GruNetwork, episode: Trajectory) -> None:
    estimator = learned(network, episode.dt)
    part = {name: torch.from_numpy(values[20:40].copy()) for name, values in episode.measurements.items()}
    part["imu/acc"].requires_grad_()
    run(estimator, part).pose["up"][-1].sum().backward()
    gradient = part["imu/acc"].grad
    assert gradient is not None
    assert torch.isfinite(gradient).all()
    assert gradient.abs().sum() > 0.0


def test_a_saved_state_goes_on(network: GruNetwork, episode: Trajectory) -> None:
    estimator = learned(network, episode.dt)
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
    for array, kept in zip((*state.front.frame, *state[1:]), (*saved.front.frame, *saved[1:]), strict=True):
        np.testing.assert_array_equal(array, kept)


def test_the_tilt_means_what_training_takes_it_for(network: GruNetwork, episode: Trajectory) -> None:
    """An estimator whose network says the truth makes no error at the samples where an interval ends."""
    front_end, head = LevelFrame(), TiltHead()
    data = SequenceData.from_trajectories([episode], front_end, head)
    vertical = data.target[0, -1].astype(float)
    bias = vertical[:2] / vertical[2]
    knowing = replace(network, output_weight=0.0 * network.output_weight, output_bias=bias)
    seen = front_end.with_dt(episode.dt).run(episode.measurements)
    last = np.flatnonzero(seen.due == 1.0)[-1]
    up = run(learned(knowing, episode.dt), episode.measurements).pose["up"][last]
    np.testing.assert_allclose(up, episode.truth_of("up")[last], atol=1e-6)


def test_too_slow_a_sensor_is_refused(network: GruNetwork) -> None:
    learned(network).with_dt(0.04)
    with pytest.raises(ValueError, match="dt must be at most"):
        learned(network).with_dt(0.05)


def test_running_needs_no_torch() -> None:
    code = (
        "import sys, numpy as np; from poise.baselines.learned.estimator import shipped; from poise import run;"
        "run(shipped(), {'imu/gyr': np.zeros((9, 3)), 'imu/acc': np.ones((9, 3))}, dt=0.01);"
        "assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_shipped_weights_beat_what_either_sensor_gives_alone() -> None:
    trajectory = fast(100.0)
    found = inclination(shipped(), trajectory)
    assert found < 1.0
    assert found < 0.2 * inclination(Observer(Tilt()), trajectory)
    assert found < 0.7 * inclination(Observer(GyroscopeIntegration()), trajectory)


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


def test_the_shipped_mixture_beats_the_filter_on_carried_devices() -> None:
    """On motions and devices that its training did not draw."""
    motions = [replace(recipe("carried"), duration=60.0).episode(90, index) for index in range(4)]
    errors = {
        name: np.mean([inclination(make_estimator(name), each, skip=5.0) for each in motions])
        for name in ("bounded-motion+network", "bounded-motion")
    }
    assert errors["bounded-motion+network"] < 0.95 * errors["bounded-motion"], errors
