"""A trained network with the interface of an estimator: front end, network, head."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from ...filters.core.backend import Array, is_torch, namespace
from ...filters.core.estimator import check_measurements, run_by_steps
from ...filters.core.quantity import Channel, Estimate, Measurement, Quantity
from ...filters.core.sampling import zeros
from ...filters.support.names import look_up
from ..weights_io import load_weights, save_weights
from .head import AngleHead, Head, TiltHead
from .heading_head import HeadingHead
from .inputs.filter_bank import FilterBank
from .inputs.filter_features import FilterFeatures
from .inputs.front_end import FrontEnd, RawChannels
from .inputs.heading_bank import HeadingBank
from .inputs.level_frame import LevelFrame
from .mixture_head import MixtureHead
from .networks.gru import GruNetwork
from .networks.tcn import TcnNetwork
from .networks.unlikeness import read_network

FRONT_ENDS: dict[str, Any] = {
    kind.kind: kind for kind in (LevelFrame, FilterBank, HeadingBank, FilterFeatures, RawChannels)
}
HEADS: dict[str, Any] = {kind.kind: kind for kind in (TiltHead, MixtureHead, HeadingHead, AngleHead)}
NETWORKS: dict[str, Any] = {kind.kind: kind for kind in (GruNetwork, TcnNetwork)}
"""Kind in a card → class, with ``read`` or ``from_arrays``."""


class Network(Protocol):
    """Interface of networks: what :class:`.gru.GruNetwork` and :class:`.modules.TorchNetwork` have."""

    @property
    def kind(self) -> str:
        """Name under which cards know it."""
        ...

    @property
    def features(self) -> int:
        """Features F."""
        ...

    @property
    def outputs(self) -> int:
        """Outputs O."""
        ...

    @property
    def memory_size(self) -> int:
        """Numbers M that are remembered of each sequence."""
        ...

    def step(self, features: Array, memory: Array) -> tuple[Array, Array]:
        """One update: features ``(..., F)`` and memory ``(..., M)`` → new memory and output ``(..., O)``."""
        ...

    def advance(self, features: np.ndarray, due: np.ndarray, memory: np.ndarray, output: np.ndarray) -> np.ndarray:
        """All samples of all sequences; see :meth:`.gru.GruNetwork.advance`."""
        ...

    def arrays(self) -> dict[str, np.ndarray]:
        """The weights."""
        ...


class LearnedState(NamedTuple):
    """Complete state of the estimator.

    Attributes:
        front: of the front end.
        memory: ``(*batch, M)`` of the network.
        output: ``(*batch, O)`` last output of the network.
    """

    front: Any
    memory: Array
    output: Array


@dataclass(frozen=True, eq=False)
class NetworkParts:
    """What estimators with a network share: a front end before it and a head behind it, kept in one file.

    Attributes:
        network: the weights.
        front_end: what the network sees, and the sampling interval.
        head: what its output means.

    Raises:
        ValueError: front end, network and head do not fit together.
    """

    network: Network
    front_end: Any
    head: Any

    def __post_init__(self) -> None:
        if self.network.features != self.front_end.size or self.network.outputs != self.head.size:
            raise ValueError(
                f"the network must take {self.front_end.size} features and give {self.head.size} outputs, "
                f"got {self.network.features} and {self.network.outputs}"
            )

    def save(self, path: str | Path, card: Mapping[str, Any] | None = None) -> Path:
        """Write weights and card, which ``load`` of the same class reads.

        Args:
            path: of the weights; see :func:`poise.baselines.weights_io.save_weights`.
            card: further entries of the card.
        """
        parts = {"network": self.network.kind, "front_end": self.front_end.describe(), "head": self.head.describe()}
        return save_weights(path, self.network.arrays(), {**(card or {}), **parts})

    @property
    def dt(self) -> float:
        """Sampling interval, s."""
        return float(self.front_end.dt)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Required channels."""
        return tuple(self.front_end.channels)

    def with_dt(self, dt: float) -> Self:
        """The same estimator for another sampling interval."""
        return replace(self, front_end=self.front_end.with_dt(dt))

    def configured(self, metadata: Mapping[str, Any]) -> Self:
        """The same for the person, vehicle or device that a recording's metadata describe."""
        return replace(self, front_end=self.front_end.configured(metadata))

    def _advance(
        self, features: np.ndarray, due: np.ndarray, memory: np.ndarray, output: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Memory and output after ``(T, *batch, …)`` samples, and the output of every sample; inputs stay."""
        length, batch = features.shape[0], features.shape[1:-1]
        memory, output = np.array(memory, dtype=float), np.array(output, dtype=float)
        count = int(np.prod(batch, dtype=int))
        outputs = self.network.advance(
            np.ascontiguousarray(features).reshape(length, count, -1),
            np.ascontiguousarray(due, dtype=float).reshape(length, count),
            memory.reshape(count, -1),
            output.reshape(count, -1),
        )
        return memory, output, outputs.reshape(length, *batch, -1)


@dataclass(frozen=True, eq=False)
class LearnedEstimator(NetworkParts):
    """A network behind a front end, whose output a head makes a pose.

    The front end runs at the rate of the sensors. At fixed intervals, independent of that rate, the network receives
    the features of the interval. Between them its output stays, while what it corrects moves on.

    Attributes:
        network: the weights.
        front_end: what the network sees, and the sampling interval.
        head: what its output means.
        compiled: use compiled loops for NumPy data; arrays give the same to rounding.

    Raises:
        ValueError: front end, network and head do not fit together.
    """

    front_end: FrontEnd
    head: Head
    compiled: bool = True

    @classmethod
    def load(cls, path_or_name: str | Path = "gru", dt: float = 0.01, network: Network | None = None) -> Self:
        """The estimator of a weights file or of shipped weights.

        Args:
            path_or_name: file, or name of shipped weights.
            dt: sampling interval, s.
            network: one of your own (:class:`.modules.TorchNetwork`), which takes the weights of the file; None: the
                one that the card describes.

        Raises:
            FileNotFoundError: there are no such weights.
            ValueError: they are damaged, are those of something else, or of a network of your own that is not given.
        """
        arrays, card = load_weights(path_or_name)
        try:
            front, head, kind = card["front_end"], card["head"], card["network"]
            if network is None and kind == "torch":
                raise ValueError(
                    f"{path_or_name} holds a torch module of your own: "
                    "give it as network=TorchNetwork(module, features, outputs)"
                )
            made = read_network(look_up("kind of network", kind, NETWORKS) if network is None else network, arrays)
            front_end = look_up("kind of front end", front["kind"], FRONT_ENDS).read(front, dt)
            return cls(made, front_end, look_up("kind of head", head["kind"], HEADS).read(head))
        except (KeyError, TypeError) as reason:
            raise ValueError(
                f"{path_or_name}: the card does not describe a network of this package ({reason})"
            ) from None

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """Estimated quantities."""
        return self.head.outputs

    @property
    def error_parts(self) -> dict[str, tuple[int, int]]:
        """Quantity → its part of the covariance; empty where the head gives none."""
        return getattr(self.head, "error_parts", {})

    def truth(self, truth: Mapping[str, Any]) -> dict[str, Any]:
        """True values of outputs that only the corrected filter defines; see :meth:`.Equations.truth`."""
        kalman = getattr(self.front_end, "kalman", None)
        return {} if kalman is None else dict(kalman.model.truth(truth))

    def init(self, measurement: Measurement) -> LearnedState:
        """Initial state with the batch shape and array type of ``measurement``, which is not processed."""
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        like = arrays[self.channels[0].name]
        return LearnedState(
            self.front_end.init(arrays), zeros(like, self.network.memory_size), zeros(like, self.network.outputs)
        )

    def step(self, state: LearnedState, measurement: Measurement) -> tuple[LearnedState, Estimate]:
        """Process one sample of every channel, ``(*batch, size)``; NaN where there is none."""
        front, seen = self.front_end.step(state.front, measurement)
        memory, output = state.memory, state.output
        if bool((seen.due == 1.0).any()):
            if self.compiled and not is_torch(seen.features):
                memory, output, _ = self._advance(seen.features[None], seen.due[None], memory, output)
            else:
                xp, now = namespace(seen.features), (seen.due == 1.0)[..., None]
                moved, updated = self.network.step(xp.where(now, seen.features, xp.zeros_like(seen.features)), memory)
                memory, output = xp.where(now, moved, memory), xp.where(now, updated, output)
        return LearnedState(front, memory, output), self.head.estimate(seen, output)

    def run(self, measurements: Mapping[str, Any]) -> Estimate:
        """Estimates of a whole sequence, ``(T, *batch, size)`` in and out; equal to stepping."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        if not self.compiled or any(is_torch(array) for array in arrays.values()):
            return run_by_steps(self, arrays)
        state = self.init({name: array[0] for name, array in arrays.items()})
        seen = self.front_end.run(arrays)
        _, _, outputs = self._advance(seen.features, seen.due, state.memory, state.output)
        return self.head.estimate(seen, outputs)


def shipped(weights: str = "gru", dt: float = 0.01) -> LearnedEstimator:
    """The estimator with weights of the package, for samples ``dt`` seconds apart."""
    return LearnedEstimator.load(weights, dt)
