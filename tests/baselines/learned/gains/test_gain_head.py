"""The loss of networks that set gains: the filter that runs in it, and what training with it learns."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from poise.baselines.learned.config import FitConfig  # noqa: E402
from poise.baselines.learned.data import SequenceData  # noqa: E402
from poise.baselines.learned.fit import fit  # noqa: E402
from poise.baselines.learned.gains.gain_filter import GainFilter  # noqa: E402
from poise.baselines.learned.gains.gain_head import GainHead, tilt_variance  # noqa: E402
from poise.baselines.learned.gains.presets import all_presets  # noqa: E402
from poise.baselines.learned.inputs.gain_features import GainFeatures  # noqa: E402
from poise.baselines.learned.networks.modules import GruModule  # noqa: E402
from poise.baselines.learned.training import train_preset  # noqa: E402
from poise.envs.recipes.registry import hand_recipe  # noqa: E402
from poise.filters.core.metrics import direction_error, rms  # noqa: E402
from poise.filters.registry import make  # noqa: E402

RECIPE = replace(hand_recipe("hand-held"), duration=12.0)


def parts(gains=("process", "measurement"), limit=8.0):
    kalman = replace(make("external-acceleration"), restart=False)
    return GainFeatures(kalman), GainHead(kalman, gains, (limit,) * len(gains))


def test_the_loss_runs_the_filter_that_the_estimator_runs():
    """At any sampling rate, with constants of the sequence, outputs one interval late, and the same after a gap."""
    front_end, head = parts()
    motions = [RECIPE.episode(5, index) for index in range(2)]
    assert len({motion.dt for motion in motions}) == 2
    lost = (motions[0].time > 5.0) & (motions[0].time < 5.5)
    samples = {name: np.where(lost[:, None], np.nan, values) for name, values in motions[0].measurements.items()}
    motions[0] = motions[0].replace(measurements=samples)
    data = SequenceData.from_trajectories(motions, front_end, head)
    module = GruModule(front_end.size, head.size, 6, scale=3.0)
    torch.nn.init.normal_(module.output.weight)
    with torch.no_grad():
        told, _ = module(torch.from_numpy(data.features))
        errors = head.errors(told, torch.from_numpy(data.target), None).numpy()[..., 0]
    for row, motion in enumerate(motions):
        made = GainFilter(module.export(), front_end.with_dt(motion.dt), head)
        pose = made.run(motion.measurements).pose["up"]
        whole = made.front_end.features.interval_samples(motion.dt)
        count = len(motion) // whole
        each = direction_error(pose, motion.truth_of("up"))[: count * whole].reshape(count, whole)
        np.testing.assert_allclose(errors[row, :count], rms(each, None, axis=1), rtol=2e-2, atol=2e-5)


def test_derivatives_are_those_of_the_loss():
    front_end, head = parts()
    data = SequenceData.from_trajectories([RECIPE.episode(5, 0)], front_end, head)
    target, mask = torch.from_numpy(data.target), torch.from_numpy(data.mask)
    told = 0.1 * torch.randn((*data.features.shape[:2], 2), generator=torch.Generator().manual_seed(0))
    told = told.double().requires_grad_()
    head.loss(told, target, None, mask).backward()
    direction = torch.zeros_like(told)
    direction[0, 20:60, 0] = 1.0
    step = 1e-4
    with torch.no_grad():
        above, below = (head.loss(told + sign * step * direction, target, None, mask) for sign in (1.0, -1.0))
    slope = float((above - below) / (2.0 * step))
    assert abs(slope) > 1e-6
    assert float((told.grad * direction).sum()) == pytest.approx(slope, rel=1e-3)


@pytest.mark.parametrize("name", ["mekf", "external-acceleration"])
def test_the_variance_of_the_inclination_does_not_depend_on_the_heading(name):
    motion = RECIPE.episode(5, 1)
    kalman = make(name, dt=motion.dt)
    estimate = kalman.run(motion.measurements)
    variance = tilt_variance(kalman, estimate.covariance, estimate.pose["up"])
    assert (variance > 0.0).all()
    turned = tilt_variance(kalman, estimate.covariance, -estimate.pose["up"])
    np.testing.assert_allclose(turned, variance)


def test_training_finds_better_gains_and_ends_as_an_estimator():
    front_end, head = parts()
    train, held_out = (
        SequenceData.from_recipe(RECIPE, seed, count, front_end, head) for seed, count in ((1, 6), (2, 3))
    )
    module = GruModule(front_end.size, head.size, 8)
    constant = head.begin(module, train, 0)
    assert constant[1] > 1.0  # a hand accelerates by more than the paper's 0.01 m/s²
    config = FitConfig(epochs=3, batch=2, window=10**6, learning_rate=5e-3)
    before = GainFilter(module.export(), front_end, head)
    result = fit(module, front_end, head, train, held_out, config)
    after = GainFilter(result.estimator.network, front_end, head)
    motion = RECIPE.episode(2, 0)

    def error(estimator):
        pose = estimator.with_dt(motion.dt).run(motion.measurements).pose["up"]
        return math.degrees(float(rms(direction_error(pose, motion.truth_of("up")), motion.mask)))

    assert error(before) < error(make("external-acceleration"))
    assert result.best_epoch > 0
    assert result.history[-1]["training"] < result.history[0]["training"]
    assert error(after) < error(make("external-acceleration"))


def test_what_cannot_be_used_is_named():
    front_end, head = parts()
    short = replace(RECIPE, duration=0.06).episode(0, 0)
    with pytest.raises(ValueError, match="too short"):
        SequenceData.from_trajectories([short], front_end, head)
    with pytest.raises(ValueError, match="neither an inclination nor an angle"):
        GainHead(make("array-rate", method="weighted"), (), ())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["external-acceleration+noise", "mekf+gain"])
def test_the_quick_form_of_a_preset_learns_visibly(name, tmp_path):
    preset = all_presets()[name].quick()
    began = time.process_time()
    result = train_preset(preset, 0, tmp_path)
    assert time.process_time() - began < 180.0
    made, errors = result.estimator, {"trained": [], "plain": []}
    assert isinstance(made, GainFilter)
    for index in range(6):
        motion = preset.recipe("hand-held-prompt").episode(3, index)
        for label, each in (("trained", made), ("plain", preset.kalman())):
            pose = each.with_dt(motion.dt).run(motion.measurements).pose["up"]
            errors[label].append(float(rms(direction_error(pose, motion.truth_of("up")), motion.mask)))
    assert np.mean(np.log(errors["trained"])) < np.mean(np.log(errors["plain"]))
    again = GainFilter.load(made.save(tmp_path / "weights"))
    assert again.front_end.describe() == made.front_end.describe()


def test_angles_are_scored_with_their_own_variances():
    head = GainHead(make("two-gyro-level"), ("constraint",), (1.0,))
    assert [quantity.size for quantity in head.outputs] == [1, 3]
    rng = np.random.default_rng(0)
    angles, truth = (torch.from_numpy(rng.uniform(-3.0, 3.0, (5, 4))) for _ in range(2))
    variances = torch.arange(1.0, 11.0, dtype=torch.float64)
    pose = {head.outputs[0].name: angles[:, None, :1], head.outputs[1].name: angles[:, None, 1:]}
    found = SimpleNamespace(pose=pose, covariance=torch.diag(variances).expand(5, 1, 10, 10))
    error, variance = head._scored(found, truth)
    np.testing.assert_allclose(torch.cos(error), torch.cos(angles - truth), atol=1e-12)
    assert error.abs().max() <= math.pi
    np.testing.assert_array_equal(variance, np.tile([1.0, 2.0, 3.0, 4.0], (5, 1)))
