"""Networks mean the same in torch, NumPy and compiled, in one piece and in parts."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import nn

from poise.baselines.learned.networks.gru import NAMES, GruNetwork
from poise.baselines.learned.networks.modules import GruModule, Standardised, TcnModule, TorchNetwork
from poise.baselines.learned.networks.tcn import TcnNetwork

F, OUT, B, N = 7, 3, 2, 60


def filled(module: nn.Module) -> nn.Module:
    """A module whose last layer and scales are not those of the start."""
    generator = torch.Generator().manual_seed(2)
    with torch.no_grad():
        for parameter in module.output.parameters():  # type: ignore[operator, union-attr]
            parameter.copy_(torch.randn(parameter.shape, generator=generator))
    module.standardised.fit(np.arange(F) / F, 0.5 + np.arange(F) / 3.0)  # type: ignore[operator, union-attr]
    return module.eval()


MODULES = {"gru": lambda: GruModule(F, OUT, 12, seed=1, scale=0.1), "tcn": lambda: TcnModule(F, OUT, 8, 4, seed=1)}


@pytest.fixture(scope="module")
def features() -> np.ndarray:
    return np.random.default_rng(0).standard_normal((B, N, F))


@pytest.mark.parametrize("kind", MODULES)
def test_torch_numpy_and_compiled_agree(kind: str, features: np.ndarray) -> None:
    module = filled(MODULES[kind]())
    network = module.export()  # type: ignore[operator]
    with torch.no_grad():
        expected, _ = module(torch.from_numpy(features).float())
        first, memory = module(torch.from_numpy(features[:, :23]).float())
        second, _ = module(torch.from_numpy(features[:, 23:]).float(), memory)
    np.testing.assert_allclose(torch.cat([first, second], dim=1).numpy(), expected.numpy(), atol=5e-6)
    kept, told = np.zeros((B, network.memory_size)), []
    for t in range(N):
        kept, output = network.step(features[:, t], kept)
        told.append(output)
    stepped = np.stack(told, axis=1)
    np.testing.assert_allclose(stepped, expected.numpy(), atol=5e-6)
    compiled_memory, compiled_output = np.zeros_like(kept), np.zeros((B, OUT))
    rows = np.ascontiguousarray(features.swapaxes(0, 1))
    compiled = network.advance(rows, np.ones((N, B)), compiled_memory, compiled_output)
    np.testing.assert_allclose(compiled.swapaxes(0, 1), stepped, atol=1e-12)
    np.testing.assert_allclose(compiled_memory, kept, atol=1e-12)
    np.testing.assert_array_equal(compiled_output, compiled[-1])


@pytest.mark.parametrize("kind", MODULES)
def test_weights_survive_a_file(kind: str) -> None:
    network = filled(MODULES[kind]()).export()  # type: ignore[operator]
    again = type(network).from_arrays(network.arrays())
    for name, array in network.arrays().items():
        np.testing.assert_array_equal(again.arrays()[name], array)
    assert (again.features, again.outputs) == (F, OUT)


def test_weights_of_another_network_are_refused() -> None:
    arrays = GruModule(F, OUT, 12).export().arrays()
    assert set(arrays) == set(NAMES)
    with pytest.raises(ValueError, match="hold the arrays"):
        GruNetwork.from_arrays({name: array for name, array in arrays.items() if name != "output.bias"})
    with pytest.raises(ValueError, match="gru_weight must have shape"):
        GruNetwork.from_arrays(arrays | {"gru.weight_ih_l0": arrays["gru.weight_ih_l0"][:, 1:]})
    with pytest.raises(ValueError, match="hold the arrays"):
        TcnNetwork.from_arrays(arrays)


def test_a_network_sees_only_the_past() -> None:
    """What comes later changes nothing: both kinds are causal."""
    rng = np.random.default_rng(3)
    one = rng.standard_normal((1, 40, F))
    other = np.concatenate([one[:, :25], rng.standard_normal((1, 15, F))], axis=1)
    for make in MODULES.values():
        module = filled(make())
        with torch.no_grad():
            told = [module(torch.from_numpy(each).float())[0][0, :25] for each in (one, other)]
        assert torch.equal(*told)


@pytest.mark.parametrize("context", [1, 5])
def test_any_module_is_a_network(context: int, features: np.ndarray) -> None:
    """A module without memory sees its last updates, in one piece or in parts, and keeps its output between them."""

    class Sum(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.layer = nn.Linear(F, OUT)

        def forward(self, rows: torch.Tensor) -> torch.Tensor:
            return torch.cumsum(self.layer(rows), dim=1)

    torch.manual_seed(0)
    network = TorchNetwork(Sum(), F, OUT, context)
    rows, due = np.ascontiguousarray(features.swapaxes(0, 1)), np.zeros((N, B))
    due[2::3] = 1.0
    memory, output = np.zeros((B, network.memory_size)), np.zeros((B, OUT))
    whole = network.advance(rows, due, memory, output)
    assert (whole[:2] == 0.0).all()
    assert (whole[2] == whole[4]).all()
    assert (whole[2] != whole[5]).any()
    with torch.no_grad():
        layer = network.module.layer(torch.from_numpy(rows[2::3]).float()).numpy()  # type: ignore[operator]
    np.testing.assert_allclose(whole[-1], layer[-context:].sum(axis=0), atol=1e-5)
    memory, output = np.zeros((B, network.memory_size)), np.zeros((B, OUT))
    parts = [network.advance(rows[part], due[part], memory, output) for part in (slice(0, 31), slice(31, N))]
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-5)


def test_a_module_that_remembers_equals_its_export(features: np.ndarray) -> None:
    module = filled(MODULES["gru"]())
    exported = module.export()  # type: ignore[operator]
    network = TorchNetwork(module, F, OUT, standardised=Standardised(F))
    rows = np.ascontiguousarray(features.swapaxes(0, 1))
    told = [
        each.advance(rows, np.ones((N, B)), np.zeros((B, each.memory_size)), np.zeros((B, OUT)))
        for each in (network, exported)
    ]
    np.testing.assert_allclose(*told, atol=1e-5)
    other = TorchNetwork(GruModule(F, OUT, 12, seed=9), F, OUT)
    other.load(network.arrays())
    np.testing.assert_array_equal(other.module.output.weight.detach(), module.output.weight.detach())  # type: ignore[operator, union-attr]
    with pytest.raises(ValueError, match="those of another module"):
        TorchNetwork(GruModule(F, OUT, 13), F, OUT).load(network.arrays())
    with pytest.raises(ValueError, match="context must be at least 1"):
        TorchNetwork(module, F, OUT, 0)
