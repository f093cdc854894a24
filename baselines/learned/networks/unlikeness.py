"""How unlike its training data a network's inputs are, as a further output: where they are unlike, errors are larger.

    u = mean over features of min(((s − m) / d)², 25)

with features s, and their mean m and standard deviation d in the training data, in which u has the mean of about one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ....filters.core.backend import Array, constant, namespace
from ....filters.core.sampling import latest

LARGEST = 25.0
"""what a feature counts at most: five standard deviations, squared"""
NAMES = ("unlikeness.mean", "unlikeness.factor")
"""of its arrays in a file of weights"""


@dataclass(frozen=True, eq=False)
class WithUnlikeness:
    """A network whose outputs are followed by the unlikeness u of the features; otherwise as it is.

    Attributes:
        network: with F features, and any outputs and memory (:class:`..estimator.Network`).
        mean: ``(F,)`` m.
        factor: ``(F,)`` 1 / d; 0 for a feature that is not counted.

    Raises:
        ValueError: a shape does not fit the features of the network.
    """

    network: Any
    mean: np.ndarray
    factor: np.ndarray

    def __post_init__(self) -> None:
        for name in ("mean", "factor"):
            # what a file keeps is what is computed with
            array = np.array(getattr(self, name), dtype=np.float32).astype(float)
            if array.shape != (self.network.features,):
                raise ValueError(f"{name} must have shape {(self.network.features,)}, got {array.shape}")
            object.__setattr__(self, name, array)

    @classmethod
    def of(cls, network: Any, mean: np.ndarray, deviation: np.ndarray) -> Self:
        """Of mean and standard deviation ``(F,)`` in the training data; an infinite one is not counted."""
        return cls(network, mean, 1.0 / np.asarray(deviation))

    @property
    def kind(self) -> str:
        """Name under which cards know the network."""
        return str(self.network.kind)

    @property
    def features(self) -> int:
        """Features F."""
        return int(self.network.features)

    @property
    def outputs(self) -> int:
        """Those of the network and one."""
        return int(self.network.outputs) + 1

    @property
    def memory_size(self) -> int:
        """Of the network."""
        return int(self.network.memory_size)

    @property
    def counted(self) -> float:
        """How many features are counted; 1 if none is, since u is 0 then."""
        return float(max(1, int(np.count_nonzero(self.factor))))

    def unlikeness(self, features: Array) -> Array:
        """U ``(...)`` of features ``(..., F)``."""
        xp = namespace(features)
        scaled = (features - constant(self.mean, features)) * constant(self.factor, features)
        squared = xp.minimum(scaled * scaled, xp.full_like(scaled, LARGEST))
        return xp.sum(squared, axis=-1) / self.counted

    def step(self, features: Array, memory: Array) -> tuple[Array, Array]:
        """See :class:`..estimator.Network`."""
        xp = namespace(features)
        memory, output = self.network.step(features, memory)
        return memory, xp.concat([output, self.unlikeness(features)[..., None]], axis=-1)

    def advance(self, features: np.ndarray, due: np.ndarray, memory: np.ndarray, output: np.ndarray) -> np.ndarray:
        """See :class:`..estimator.Network`."""
        own = np.ascontiguousarray(output[:, :-1])
        raw_output = self.network.advance(features, due, memory, own)
        found = self.unlikeness(features)
        # the last update that was due, -1 where there was none
        last = latest(due == 1.0)
        kept = np.take_along_axis(found, np.maximum(last, 0), axis=0)
        unlike = np.where(last < 0, output[None, :, -1], kept)
        outputs = np.concatenate([raw_output, unlike[..., None]], axis=-1)
        output[:, :-1] = own
        if len(due):
            output[:, -1] = unlike[-1]
        return outputs

    def arrays(self) -> dict[str, np.ndarray]:
        """The weights, and what this adds to them."""
        added = zip(NAMES, (self.mean, self.factor), strict=True)
        return {**self.network.arrays(), **{name: array.astype(np.float32) for name, array in added}}


def read_network(kind: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """The network of a weights file.

    Args:
        kind: class of the network, or a network that takes its weights from here.
        arrays: of the file.

    Raises:
        ValueError: an array is missing or unknown, or has the wrong shape.
    """
    own = {name: array for name, array in arrays.items() if name not in NAMES}
    made: Any = kind
    if isinstance(kind, type):
        network = made.from_arrays(own)
    else:
        network = kind
        network.load(own)
    return network if len(own) == len(arrays) else WithUnlikeness(network, *(arrays[name] for name in NAMES))
