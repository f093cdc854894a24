"""Networks in files of ONNX, for programs without Python: any number of sequences, one update or many at a time.

A file holds one graph,

    features ``(batch, updates, F)``, memory ``(batch, M)``
    → output ``(batch, updates, O)``, memory_after ``(batch, M)``

all float32, the memory zero before the first update. One update at a time, with the memory handed on, gives what all
at once do. The card of the weights, with what the features are and what the output means, is in the metadata
(``card``, JSON). Front ends and heads are not in the graph: they are filters, and rotations at the rate of the sensors.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...filters.support.files import write_bytes
from ...filters.support.optional import extra
from ...filters.support.version import poise_version
from ..weights_io import load_weights
from .networks.gru import GruNetwork
from .networks.tcn import TAPS, TcnNetwork
from .networks.unlikeness import LARGEST, WithUnlikeness, read_network

with extra("learn"):
    import onnx
    from onnx import TensorProto, helper, numpy_helper

OPSET = 17
"""Version of the operators: that of ONNX 1.12 (2022)."""
IR_VERSION = 8
"""Version of the file format that belongs to it."""


class Graph:
    """Nodes and constants of a graph while it is written."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, value: Any, dtype: Any = np.float32) -> str:
        """A constant; its name."""
        name = f"constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(value, dtype=dtype), name))
        return name

    def node(self, operator: str, *inputs: str, to: str = "", **attributes: Any) -> str:
        """A node with one output; its name, ``to`` if given."""
        name = to or f"value_{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, list(inputs), [name], **attributes))
        return name

    def affine(self, weight: np.ndarray, bias: np.ndarray, value: str, to: str = "") -> str:
        """``weight @ value + bias`` along the last axis."""
        return self.node("Add", self.node("MatMul", value, self.constant(weight.T)), self.constant(bias), to=to)

    def part(self, value: str, start: int, stop: int, axis: int) -> str:
        """A slice along an axis."""
        bounds = [self.constant([number], np.int64) for number in (start, stop, axis)]
        return self.node("Slice", value, *bounds)

    def reshaped(self, value: str, *shape: int) -> str:
        """Another shape; 0 keeps an axis."""
        return self.node("Reshape", value, self.constant(shape, np.int64))


def write_gru(graph: Graph, network: GruNetwork, to: str = "output") -> None:
    """The recurrent network, its output named ``to``: ONNX has the blocks of its gates in the order z, r, n."""

    def ordered(array: np.ndarray) -> np.ndarray:
        r, z, n = np.split(array, 3)
        return np.concatenate([z, r, n])

    size = network.size
    u = graph.node("Tanh", graph.affine(network.input_weight, network.input_bias, "features"))
    weights = [graph.constant(ordered(array)[None]) for array in (network.gru_weight, network.memory_weight)]
    biases = graph.constant(np.concatenate([ordered(network.gru_bias), ordered(network.memory_bias)])[None])
    inputs = [graph.node("Transpose", u, perm=[1, 0, 2]), *weights, biases, "", graph.reshaped("memory", 1, -1, size)]
    graph.nodes.append(
        helper.make_node("GRU", inputs, ["hidden", "last"], hidden_size=size, linear_before_reset=1)
    )  # (updates, 1, batch, H) and (1, batch, H)
    hidden = graph.node("Squeeze", "hidden", graph.constant([1], np.int64))
    hidden = graph.node("Transpose", hidden, perm=[1, 0, 2])
    graph.affine(network.output_weight, network.output_bias, hidden, to=to)
    graph.node("Squeeze", "last", graph.constant([0], np.int64), to="memory_after")


def write_tcn(graph: Graph, network: TcnNetwork, to: str = "output") -> None:
    """The convolution network, its output named ``to``.

    Each block has the inputs that it needs of earlier updates in front of its own.
    """
    channels = network.block_bias.shape[1]
    h = graph.affine(network.input_weight, network.input_bias, "features")
    kept, start = [], 0
    for block, (weight, bias) in enumerate(zip(network.block_weight, network.block_bias, strict=True)):
        length = (TAPS - 1) * 2**block
        past = graph.part("memory", start, start + length * channels, 1)
        own = graph.node("Concat", graph.reshaped(past, 0, length, channels), h, axis=1)
        # of the last `length` updates; negative bounds count from the end
        newest = graph.part(own, -length, np.iinfo(np.int64).max, 1)
        kept.append(graph.reshaped(newest, 0, length * channels))
        inputs = [graph.node("Transpose", own, perm=[0, 2, 1]), graph.constant(weight.transpose(1, 2, 0))]
        found = graph.node("Conv", *inputs, graph.constant(bias), dilations=[2**block], kernel_shape=[TAPS])
        h = graph.node("Add", h, graph.node("Tanh", graph.node("Transpose", found, perm=[0, 2, 1])))
        start += length * channels
    graph.node("Concat", *kept, axis=1, to="memory_after")
    graph.affine(network.output_weight, network.output_bias, h, to=to)


def write_unlikeness(graph: Graph, network: WithUnlikeness, write: Callable[..., None]) -> None:
    """A network, and how unlike the training data the features are after its outputs."""
    write(graph, network.network, to="own_output")
    scaled = graph.node(
        "Mul", graph.node("Sub", "features", graph.constant(network.mean)), graph.constant(network.factor)
    )
    squared = graph.node("Min", graph.node("Mul", scaled, scaled), graph.constant(LARGEST))
    total = graph.node("ReduceSum", squared, graph.constant([-1], np.int64), keepdims=1)
    count = graph.constant(network.counted)
    graph.node("Concat", "own_output", graph.node("Div", total, count), axis=2, to="output")


WRITERS: dict[str, tuple[Any, Callable[..., None]]] = {
    GruNetwork.kind: (GruNetwork, write_gru),
    TcnNetwork.kind: (TcnNetwork, write_tcn),
}
"""Kind of network → its class, and what writes its graph."""


def export_onnx(path_or_name: str | Path, path: str | Path) -> Path:
    """Write a trained network as a file of ONNX.

    Args:
        path_or_name: weights, a file or the name of shipped ones; see :func:`poise.baselines.weights_io.load_weights`.
        path: the file to write; ``.onnx`` is appended where it is missing.

    Returns:
        Its path.

    Raises:
        FileNotFoundError: there are no such weights.
        ValueError: they are damaged, or not those of a network of this package. A module of your own is exported by
            ``torch.onnx.export``.
    """
    arrays, card = load_weights(path_or_name)
    if "network" not in card:
        raise ValueError(f"{path_or_name} are not the weights of a learned estimator: its card names no network")
    if card["network"] not in WRITERS:
        raise ValueError(
            f"{path_or_name} holds a network of the kind {card['network']!r}; exported are {', '.join(WRITERS)}, "
            "and a module of your own by torch.onnx.export"
        )
    cls, write = WRITERS[card["network"]]
    path = Path(path)
    path = path if path.suffix == ".onnx" else path.with_name(path.name + ".onnx")
    return write_bytes(path, onnx_model(read_network(cls, arrays), write, card).SerializeToString())


def onnx_model(network: Any, write: Callable[..., None], card: Mapping[str, Any]) -> Any:
    """The model, checked."""
    graph = Graph()
    if isinstance(network, WithUnlikeness):
        write_unlikeness(graph, network, write)
    else:
        write(graph, network)

    def value(name: str, *shape: Any) -> Any:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, list(shape))

    made = helper.make_graph(
        graph.nodes,
        str(card.get("name", network.kind)),
        [value("features", "batch", "updates", network.features), value("memory", "batch", network.memory_size)],
        [value("output", "batch", "updates", network.outputs), value("memory_after", "batch", network.memory_size)],
        graph.constants,
    )
    model = helper.make_model(
        made,
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="poise",
        producer_version=poise_version(),
    )
    helper.set_model_props(model, {"card": json.dumps(dict(card), ensure_ascii=False)})
    onnx.checker.check_model(model, full_check=True)
    return model
