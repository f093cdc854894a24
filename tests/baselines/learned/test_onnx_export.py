"""Exported networks say in onnxruntime what they say here."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poise.baselines.learned.estimator import NETWORKS
from poise.baselines.learned.networks.modules import GruModule, TcnModule
from poise.baselines.learned.networks.unlikeness import WithUnlikeness, read_network
from poise.baselines.learned.onnx_export import export_onnx
from poise.baselines.weights_io import list_weights, load_weights, save_weights

onnxruntime = pytest.importorskip("onnxruntime")

SHIPPED = [name for name in list_weights() if "network" in load_weights(name)[1]]


def session(path: Path) -> Any:
    return onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])


def by_steps(network: Any, features: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Outputs ``(B, N, O)`` and last memory of our own inference."""
    memory = np.zeros((len(features), network.memory_size))
    told = []
    for row in features.swapaxes(0, 1):
        memory, output = network.step(row.astype(float), memory)
        told.append(output)
    return np.stack(told, axis=1), memory


def compare(weights: str | Path, folder: Path, tolerance: float = 1e-5) -> None:
    arrays, card = load_weights(weights)
    network = read_network(NETWORKS[card["network"]], arrays)
    path = export_onnx(weights, folder / "network.onnx")
    run = session(path)
    features = np.random.default_rng(0).normal(0.0, 1.0, (3, 150, network.features)).astype(np.float32)
    expected, last = by_steps(network, features)
    assert np.abs(expected).max() > 1e-4
    # a sum in single precision is as exact as its largest terms: an output near zero no more than the others
    absolute = tolerance * max(1.0, float(np.abs(expected).max()))
    memory = np.zeros((3, network.memory_size), np.float32)
    output, after = run.run(["output", "memory_after"], {"features": features, "memory": memory})
    np.testing.assert_allclose(output, expected, rtol=tolerance, atol=absolute)
    np.testing.assert_allclose(after, last, atol=10.0 * tolerance)
    # one update at a time, the memory handed on
    for index in range(features.shape[1]):
        one, memory = run.run(None, {"features": features[:, index : index + 1], "memory": memory})
        np.testing.assert_allclose(one[:, 0], expected[:, index], rtol=tolerance, atol=absolute)
    assert json.loads(run.get_modelmeta().custom_metadata_map["card"]) == card


@pytest.mark.parametrize("weights", SHIPPED)
def test_shipped_networks_are_equal(weights: str, tmp_path: Path) -> None:
    compare(weights, tmp_path)


@pytest.mark.parametrize("module", [GruModule(5, 3, 8, scale=0.1), TcnModule(5, 3, 6, 4, scale=0.1)])
def test_networks_of_any_size_are_equal(module: Any, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    network = module.export()
    arrays = {name: rng.normal(0.0, 0.3, array.shape).astype(np.float32) for name, array in network.arrays().items()}
    compare(save_weights(tmp_path / "own", arrays, {"network": network.kind}), tmp_path)
    unlike = WithUnlikeness.of(network, rng.normal(size=5), np.array([0.1, 1.0, 2.0, np.inf, 0.5]))
    assert unlike.unlikeness(np.zeros((3, 5))).shape == (3,)
    compare(save_weights(tmp_path / "wider", unlike.arrays(), {"network": network.kind}), tmp_path)


def test_what_is_no_network_of_this_package_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no weights 'grue'"):
        export_onnx("grue", tmp_path / "a.onnx")
    with pytest.raises(ValueError, match="names no network"):
        export_onnx("external_acceleration_policy", tmp_path / "a.onnx")
    foreign = save_weights(tmp_path / "foreign", {"a": np.ones(3)}, {"network": "torch"})
    with pytest.raises(ValueError, match=r"a module of your own by torch\.onnx\.export"):
        export_onnx(foreign, tmp_path / "a.onnx")
    wrong = save_weights(tmp_path / "wrong", {"a": np.ones(3)}, {"network": "gru"})
    with pytest.raises(ValueError, match="weights of a network hold the arrays"):
        export_onnx(wrong, tmp_path / "a.onnx")
    assert not list(tmp_path.glob("*.onnx"))
