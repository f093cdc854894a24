"""Training learns, repeats itself bit by bit, goes on after an interruption and survives bad numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from poise.baselines.learned import fit as fitting
from poise.baselines.learned.config import FitConfig
from poise.baselines.learned.data import SequenceData
from poise.baselines.learned.estimator import LearnedEstimator
from poise.baselines.learned.fit import FitResult, Trainer, fit
from poise.baselines.learned.head import AngleHead, TiltHead
from poise.baselines.learned.inputs.level_frame import LevelFrame
from poise.baselines.learned.networks.modules import GruModule, TcnModule
from poise.baselines.registry import make_estimator
from poise.baselines.weights_io import WEIGHTS, load_weights
from poise.filters.core.metrics import direction_error
from poise.filters.core.quantity import Quantity
from poise.scripts.main import main

SMALL = FitConfig(epochs=2, batch=8, window=20, learning_rate=1e-2)
END, HEAD = LevelFrame(), TiltHead()


def leaning(count: int, length: int = 40, seed: int = 0) -> SequenceData:
    """Frames that lean by a constant angle, of which a noisy velocity tells: the task with a known answer."""
    rng = np.random.default_rng(seed)
    tilt = rng.uniform(-0.1, 0.1, (count, 1, 2))
    features = 0.1 * rng.standard_normal((count, length, END.size))
    features[..., 3:5] += 5.0 * tilt
    vertical = np.concatenate([tilt, np.ones_like(tilt[..., :1])], axis=-1)
    vertical = np.repeat(vertical / np.linalg.norm(vertical, axis=-1, keepdims=True), length, axis=1)
    scored, spread = np.ones((count, length), bool), np.ones((count, length, 0), np.float32)
    names = tuple(f"leaning-{index}" for index in range(count))
    return SequenceData(features.astype(np.float32), vertical.astype(np.float32), spread, scored, names)


def gru(units: int = 8, seed: int = 0) -> GruModule:
    return GruModule(END.size, 2, units, seed, scale=0.1)


def trained(data: tuple[SequenceData, SequenceData], config: FitConfig, module: Any = None, **more: Any) -> FitResult:
    return fit(gru() if module is None else module, END, HEAD, *data, config, **more)


@pytest.fixture(scope="module")
def data() -> tuple[SequenceData, SequenceData]:
    return leaning(64), leaning(32, seed=1)


def test_the_loss_is_the_error_of_tables() -> None:
    rng = np.random.default_rng(0)
    tilt, vertical = torch.from_numpy(rng.normal(0, 0.1, (3, 50, 2))), torch.from_numpy(rng.normal(0, 1, (3, 50, 3)))
    known = torch.from_numpy(rng.random((3, 50)) < 0.7)
    known[2] = False
    estimate = np.concatenate([tilt.numpy(), np.ones((3, 50, 1))], axis=-1)
    error = direction_error(estimate, vertical.numpy())
    expected = np.mean([np.sqrt(np.mean(error[index][known[index]] ** 2)) for index in range(2)])
    assert float(HEAD.loss(tilt, vertical, None, known)) == pytest.approx(expected, rel=1e-12)


def test_the_loss_has_finite_gradients_everywhere() -> None:
    tilt = torch.zeros(2, 5, 2, requires_grad=True)
    vertical = torch.tensor([0.0, 0.0, 1.0]).repeat(2, 5, 1)
    for known in (torch.ones(2, 5, dtype=torch.bool), torch.zeros(2, 5, dtype=torch.bool)):
        loss = HEAD.loss(tilt, vertical, None, known)
        loss.backward()
        assert float(loss.detach()) == 0.0
        assert tilt.grad is not None
        assert torch.isfinite(tilt.grad).all()


@pytest.mark.parametrize("module", [gru, lambda: TcnModule(END.size, 2, 8, 3, scale=0.1)])
def test_a_constant_lean_is_learned(data: tuple[SequenceData, SequenceData], module: Any) -> None:
    result = trained(data, replace(SMALL, epochs=25), module())
    errors = [entry["validation_deg"] for entry in result.history]
    still = np.rad2deg(np.sqrt(np.mean(np.sum(data[1].target[..., :2] ** 2, axis=-1))))
    assert still > 3.0
    assert errors[result.best_epoch - 1] < 0.3 * still
    assert isinstance(result.estimator.network.arrays(), dict)


def test_the_readers_own_module_learns(data: tuple[SequenceData, SequenceData], tmp_path: Path) -> None:
    """Any module of torch, saved and loaded again."""

    def own() -> nn.Module:
        torch.manual_seed(0)
        return nn.Sequential(nn.Linear(END.size, 16), nn.Tanh(), nn.Linear(16, 2))

    result = trained(data, replace(SMALL, epochs=10), own())
    assert result.history[-1]["validation_deg"] < 0.6 * 4.7
    path = result.estimator.save(tmp_path / "own")
    with torch.random.fork_rng():
        torch.manual_seed(1)
        other = nn.Sequential(nn.Linear(END.size, 16), nn.Tanh(), nn.Linear(16, 2))
    network = fitting.TorchNetwork(other, END.size, 2)
    samples = {"imu/gyr": np.zeros((50, 3)), "imu/acc": np.tile([0.3, 0.0, 9.8], (50, 1))}
    again = LearnedEstimator.load(path, network=network)
    np.testing.assert_array_equal(again.run(samples).pose["up"], result.estimator.run(samples).pose["up"])
    with pytest.raises(ValueError, match="the weights are those of another module"):
        LearnedEstimator.load(path, network=fitting.TorchNetwork(nn.Linear(END.size, 2), END.size, 2))
    with pytest.raises(ValueError, match="give it as network=TorchNetwork"):
        LearnedEstimator.load(path)
    with pytest.raises(ValueError, match=r"a network of your own is loaded by LearnedEstimator\.load"):
        make_estimator(str(path))


def test_a_module_of_other_shapes_is_refused(data: tuple[SequenceData, SequenceData]) -> None:
    with pytest.raises(ValueError, match=r"module must give \[\(2, 3, 2\)\] for .*, got \[\(2, 3, 3\)\]"):
        trained(data, SMALL, nn.Linear(END.size, 3))


class Remembering(nn.Module):
    """A recurrent module that says what memory it has."""

    def __init__(self, memory_size: int, kind: type[nn.RNNBase] = nn.GRU) -> None:
        super().__init__()
        self.memory_size, self.inner, self.output = memory_size, kind(END.size, 4, batch_first=True), nn.Linear(4, 2)

    def forward(self, features: torch.Tensor, memory: torch.Tensor | None = None) -> tuple[torch.Tensor, Any]:
        hidden, last = self.inner(features, None if memory is None else memory[None].contiguous())
        return self.output(hidden), last[0]


class Unbounded(nn.Linear):
    """Gives what is no number."""

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        return super().forward(features) * math.nan


@pytest.mark.parametrize(
    ("module", "message"),
    [
        (lambda: nn.Linear(END.size + 1, 2), r"must take float32 features \(B, N, \d+\) on the CPU, but it fails"),
        (lambda: nn.Linear(END.size, 2).double(), "on the CPU, but it fails: .*Double"),
        (lambda: nn.Linear(END.size, 2, device="meta"), "on the CPU, but it fails: .*meta"),
        (
            lambda: nn.GRU(END.size, 2, batch_first=True),
            "one that remembers needs an attribute memory_size.* got tuple",
        ),
        (lambda: Remembering(3), r"module must give \[\(2, 3, 2\), \(2, 3\)\] .* got \[\(2, 3, 2\), \(2, 4\)\]"),
        (lambda: nn.Identity(), "no parameter that can be trained"),
        (lambda: nn.Linear(END.size, 2).requires_grad_(False), "no parameter that can be trained"),
        (lambda: Unbounded(END.size, 2), "not finite before it is trained"),
    ],
)
def test_a_module_that_cannot_be_trained_is_refused(
    data: tuple[SequenceData, SequenceData], module: Callable[[], nn.Module], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        trained(data, SMALL, module())


def test_weights_that_give_no_numbers_are_never_the_best(data: tuple[SequenceData, SequenceData]) -> None:
    class Breaking(nn.Linear):
        def forward(self, features: torch.Tensor) -> torch.Tensor:
            found = super().forward(features)
            return found if self.training or self.epochs == 0 else found * math.nan

    module = Breaking(END.size, 2)
    module.epochs = 0
    module.register_forward_hook(lambda made, *_: setattr(made, "epochs", made.epochs + made.training))
    result = trained(data, SMALL, module)
    assert result.best_epoch == 0
    assert all(math.isinf(entry["validation"]) for entry in result.history)


def test_data_of_another_front_end_are_refused(data: tuple[SequenceData, SequenceData]) -> None:
    fewer = replace(data[0], features=data[0].features[..., 1:])
    with pytest.raises(ValueError, match=r"data must have the \d+ features of the front end"):
        trained((fewer, data[1]), SMALL)


def test_data_that_score_nothing_are_refused(data: tuple[SequenceData, SequenceData]) -> None:
    unknown = replace(data[1], mask=np.zeros_like(data[1].mask))
    with pytest.raises(ValueError, match="validation scores nothing"):
        trained((data[0], unknown), SMALL)


def test_numbers_that_are_none_are_refused_by_name(data: tuple[SequenceData, SequenceData]) -> None:
    for part, name in ((0, "data"), (1, "validation")):
        for field in ("target", "features"):
            array = getattr(data[part], field).copy()
            array[5, 3] = np.nan
            spoiled = [data[0], data[1]]
            spoiled[part] = replace(data[part], **{field: array})
            with pytest.raises(ValueError, match=rf"{name} holds numbers that are not finite .* {field} of leaning-5"):
                trained((spoiled[0], spoiled[1]), SMALL)


def test_angles_are_corrected_in_their_scale() -> None:
    """The head of angles learns an offset that depends on a feature, and keeps to its limit."""
    rng = np.random.default_rng(0)
    head = AngleHead((Quantity("a", "angle", 2, "rad"),), (0.02, 0.05))
    features = rng.standard_normal((48, 30, END.size)).astype(np.float32)
    target = np.stack([0.02 * features[..., 0], 0.05 * features[..., 1] - 0.03], axis=-1)
    parts = (features, target.astype(np.float32), np.ones((48, 30, 0), np.float32), np.ones((48, 30), bool))
    data = SequenceData(*parts, tuple(f"ride-{index}" for index in range(48)))
    result = fit(nn.Linear(END.size, 2), END, head, data, data, replace(SMALL, epochs=30, learning_rate=0.05))
    assert result.history[-1]["validation_deg"] < 0.1
    told = np.array([[1.0, -2.0]])
    np.testing.assert_allclose(head.correction(told, told[..., :0]), [[0.02, -0.1]])
    limited = replace(head, limit=1.0)
    assert np.abs(limited.correction(100.0 * told, np.array([[0.01, 0.01]]))).max() <= 0.0101


def test_an_angle_that_is_known_well_weighs_as_much_as_another() -> None:
    """The loss of angles is the mean of their root mean square errors; samples outside the mask have no part in it."""
    head = AngleHead((Quantity("a", "angle", 2, "rad"),), (0.02, 0.05))
    outputs = torch.tensor([[[0.1, 2.0], [-0.1, -2.0], [9.0, 9.0]]], requires_grad=True)
    mask = torch.tensor([[True, True, False]])
    loss = head.loss(outputs, torch.zeros_like(outputs), torch.ones(1, 3, 0), mask)
    assert loss.item() == pytest.approx(0.5 * (0.1 * 0.02 + 2.0 * 0.05))
    loss.backward()
    assert outputs.grad is not None
    np.testing.assert_allclose(outputs.grad[0] / torch.tensor(head.scale), [[0.25, 0.25], [-0.25, -0.25], [0.0, 0.0]])


def test_equal_seeds_give_equal_weights(data: tuple[SequenceData, SequenceData]) -> None:
    first, second, other = (trained(data, replace(SMALL, seed=seed)) for seed in (0, 0, 1))
    assert first.history == second.history
    arrays = [each.estimator.network.arrays() for each in (first, second, other)]
    for name, array in arrays[0].items():
        np.testing.assert_array_equal(array, arrays[1][name])
    assert any(not np.array_equal(array, arrays[2][name]) for name, array in arrays[0].items())


def test_training_leaves_the_global_generator_and_threads_alone(data: tuple[SequenceData, SequenceData]) -> None:
    state, threads = torch.random.get_rng_state(), torch.get_num_threads()
    trained(data, replace(SMALL, epochs=1))
    assert torch.equal(torch.random.get_rng_state(), state)
    assert torch.get_num_threads() == threads


def test_an_interrupted_training_goes_on_bit_by_bit(
    data: tuple[SequenceData, SequenceData], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = replace(SMALL, epochs=3)
    whole = trained(data, config, folder=tmp_path / "whole")

    def interrupt(folder: Path) -> Any:
        def log(entry: dict[str, float] | None) -> None:
            if entry is not None:
                raise KeyboardInterrupt

        return log

    with monkeypatch.context() as patch:
        patch.setattr(fitting, "open_log", interrupt)
        with pytest.raises(KeyboardInterrupt):
            trained(data, config, folder=tmp_path / "parts")
    resumed = trained(data, config, folder=tmp_path / "parts", resume=True)
    assert resumed.history == whole.history
    for name, array in whole.estimator.network.arrays().items():
        np.testing.assert_array_equal(array, resumed.estimator.network.arrays()[name])


def test_only_the_same_training_is_resumed(data: tuple[SequenceData, SequenceData], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="nothing to resume"):
        trained(data, SMALL, folder=tmp_path, resume=True)
    trained(data, replace(SMALL, epochs=1), folder=tmp_path)
    with pytest.raises(ValueError, match=r"started with config\.epochs 1, not 2"):
        trained(data, SMALL, folder=tmp_path, resume=True)
    with pytest.raises(ValueError, match="started with data"):
        trained((leaning(32), data[1]), replace(SMALL, epochs=1), folder=tmp_path, resume=True)
    with pytest.raises(ValueError, match="started with module"):
        trained(data, replace(SMALL, epochs=1), gru(9), folder=tmp_path, resume=True)
    with pytest.raises(ValueError, match="resume needs the folder"):
        trained(data, SMALL, resume=True)


def test_bad_numbers_change_nothing_and_end_a_training_at_last(data: tuple[SequenceData, SequenceData]) -> None:
    module = gru()
    trainer = Trainer(module, HEAD, SMALL, data[0], 1)
    before = module.export().arrays()
    for _ in range(fitting.MOST_BAD_STEPS - 1):
        assert not trainer.descend(module.output.weight.sum() * float("nan"))
    for name, array in module.export().arrays().items():
        np.testing.assert_array_equal(array, before[name])
    assert trainer.descend((module.output.weight**2).sum() + module.output.bias.sum())
    for _ in range(fitting.MOST_BAD_STEPS - 1):
        trainer.descend(module.output.weight.sum() * float("inf"))
    with pytest.raises(RuntimeError, match="not finite in 10 updates"):
        trainer.descend(module.output.weight.sum() * float("inf"))


def test_a_sequence_with_nan_does_not_spoil_the_others() -> None:
    bad = leaning(17)
    bad.features[3] = np.nan
    scored = bad.mask.copy()
    scored[3] = False
    # scales come from what is scored
    result = trained((replace(bad, mask=scored), leaning(4, seed=1)), replace(SMALL, epochs=1, batch=4))
    assert 0.0 <= result.history[0]["skipped"] < 8.0
    assert all(np.isfinite(array).all() for array in result.estimator.network.arrays().values())


def test_senseless_configurations_are_refused() -> None:
    for name, value in (
        ("epochs", 0),
        ("batch", 0),
        ("learning_rate", 0.0),
        ("seed", -1),
        ("warmup", 1.0),
        ("clip", -1.0),
    ):
        with pytest.raises(ValueError, match=name):
            replace(SMALL, **{name: value})


def test_the_command_leaves_weights_that_load(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["train", "bounded-motion+network", "--quick", "--episodes", "4", "--epochs", "1", "--units", "8"]
    words += ["--test-episodes", "2", "--processes", "1", "--runs", str(tmp_path / "runs")]
    assert main([*words, "--export", str(tmp_path / "mine")]) == 0
    assert "Error on unseen simulated episodes" in capsys.readouterr().out
    (folder,) = (tmp_path / "runs" / "train").iterdir()
    files = ("args.json", "versions.json", "results.csv", "checkpoint.pt")
    for name in (*files, "bounded-motion_network.safetensors", "bounded-motion_network.json"):
        assert (folder / name).is_file(), name
    arrays, card = load_weights(tmp_path / "mine")
    assert card["command"].startswith("poise train bounded-motion+network --quick --seed 0 --replicate 0 --episodes 4")
    assert card["test"]["hand-held-varying"]["bounded-motion+network"]["mean_deg"] > 0.0
    assert LearnedEstimator.load(tmp_path / "mine").network.memory_size == 8
    assert main([*words, "--resume", str(folder)]) == 0
    again, _ = load_weights(folder / "bounded-motion_network.safetensors")
    np.testing.assert_array_equal(again["output.weight"], arrays["output.weight"])
    assert main(["train", "bounded-motion+networks"]) != 0
    assert "bounded-motion+network" in capsys.readouterr().err


def test_a_start_of_another_network_and_recipes_of_rides_are_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["train", "bounded-motion+network", "--quick", "--runs", str(tmp_path)]
    for more, message in (
        (["--start", str(WEIGHTS / "gru.safetensors")], "start must have 54 features and 10 outputs, got 22 and 2"),
        (["--recipe", "rider"], "recipe must be one of hand motions"),
    ):
        assert main([*words, *more]) != 0
        assert message in " ".join(capsys.readouterr().err.split())
    assert main(["train", "two-gyro+network", "--recipe", "hand-held", "--runs", str(tmp_path)]) != 0
    assert "is trained on rides" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
