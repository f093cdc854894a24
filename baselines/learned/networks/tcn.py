"""A causal temporal convolution network: inference without torch, on any arrays or compiled.

After S. Bai, J. Z. Kolter, V. Koltun, "An Empirical Evaluation of Generic Convolutional and Recurrent Networks for
Sequence Modeling", arXiv:1803.01271, 2018. With the features s, C channels and L blocks,

    h_0 = A s + a,   h_l = h_{l-1} + tanh(Σ_j W_lj h_{l-1}(t − j 2^l) + b_l),   t = B h_L + c

where j runs over three taps, so that the last block sees 2^{L+1} − 1 updates back. The memory of a sequence are the
inputs of each block that later updates need; before the start they are zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from ....filters.compile.cache import jit
from ....filters.core.backend import Array, constant, namespace
from .weights import NetworkWeights

TAPS = 3
NAMES = ("input.weight", "input.bias", "blocks.weight", "blocks.bias", "output.weight", "output.bias")
"""Arrays of a network; the names are those of the torch module that is trained."""


@dataclass(frozen=True, eq=False)
class TcnNetwork(NetworkWeights):
    """The weights, with C channels, L blocks, F features and O outputs.

    Attributes:
        input_weight: ``(C, F)`` A.
        input_bias: ``(C,)`` a.
        block_weight: ``(L, TAPS, C, C)`` W, the last tap is the newest.
        block_bias: ``(L, C)`` b.
        output_weight: ``(O, C)`` B.
        output_bias: ``(O,)`` c.

    Raises:
        ValueError: a shape does not fit the others.
    """

    input_weight: np.ndarray
    input_bias: np.ndarray
    block_weight: np.ndarray
    block_bias: np.ndarray
    output_weight: np.ndarray
    output_bias: np.ndarray

    names: ClassVar[tuple[str, ...]] = NAMES
    kind: ClassVar[str] = "tcn"

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Field → its shape."""
        channels, blocks = np.shape(self.block_bias)[-1], len(np.atleast_1d(self.block_bias))
        features, outputs = np.shape(self.input_weight)[-1:], np.shape(self.output_weight)[:1]
        return {
            "input_weight": (channels, *features),
            "input_bias": (channels,),
            "block_weight": (blocks, TAPS, channels, channels),
            "block_bias": (blocks, channels),
            "output_weight": (*outputs, channels),
            "output_bias": outputs,
        }

    @property
    def features(self) -> int:
        """Features F."""
        return int(self.input_weight.shape[1])

    @property
    def outputs(self) -> int:
        """Outputs O."""
        return len(self.output_bias)

    @property
    def memory_size(self) -> int:
        """Numbers that are remembered of each sequence."""
        blocks, channels = self.block_bias.shape
        return (TAPS - 1) * (2**blocks - 1) * channels

    def step(self, features: Array, memory: Array) -> tuple[Array, Array]:
        """One update: features ``(..., F)`` and memory ``(..., M)`` → new memory and output ``(..., O)``."""
        xp, channels = namespace(features, memory), self.block_bias.shape[1]

        def affine(weight: np.ndarray, x: Array) -> Array:
            return (constant(weight, x) @ x[..., None])[..., 0]

        h = affine(self.input_weight, features) + constant(self.input_bias, features)
        kept, start = [], 0
        for block, (weight, bias) in enumerate(zip(self.block_weight, self.block_bias, strict=True)):
            gap = 2**block
            stop = start + (TAPS - 1) * gap * channels
            own = xp.concat([memory[..., start:stop], h], axis=-1)
            total = constant(bias, h) + 0.0 * h
            for tap in range(TAPS):
                total = total + affine(weight[tap], own[..., tap * gap * channels : (tap * gap + 1) * channels])
            kept.append(own[..., channels:])
            h = h + xp.tanh(total)
            start = stop
        return xp.concat(kept, axis=-1), affine(self.output_weight, h) + constant(self.output_bias, h)

    def advance(self, features: np.ndarray, due: np.ndarray, memory: np.ndarray, output: np.ndarray) -> np.ndarray:
        """All samples, compiled; see :meth:`~poise.baselines.learned.networks.gru.GruNetwork.advance`."""
        outputs = np.empty((*due.shape, self.outputs))
        fields = (self.input_weight, self.input_bias, self.block_weight, self.block_bias)
        compiled_kernel()(features, due, memory, output, outputs, *fields, self.output_weight, self.output_bias)
        return outputs


@lru_cache(maxsize=1)
def compiled_kernel() -> Callable[..., None]:
    """:func:`advance_all`, compiled on first use."""
    return jit(advance_all)


def advance_all(features, due, memory, output, outputs, A, a, W, w, C, c):  # type: ignore[no-untyped-def]  # noqa: D103, ANN
    T, B, F = features.shape
    blocks, taps, H, _ = W.shape
    h, total = np.empty(H), np.empty(H)
    for t in range(T):
        for k in range(B):
            if due[t, k] == 1.0:
                for i in range(H):
                    h[i] = a[i]
                    for j in range(F):
                        h[i] += A[i, j] * features[t, k, j]
                start, own = 0, memory[k]
                for block in range(blocks):
                    gap = 2**block
                    length = (taps - 1) * gap * H
                    for i in range(H):
                        total[i] = w[block, i]
                        for tap in range(taps - 1):
                            for j in range(H):
                                total[i] += W[block, tap, i, j] * own[start + tap * gap * H + j]
                        for j in range(H):
                            total[i] += W[block, taps - 1, i, j] * h[j]
                    for i in range(length - H):
                        own[start + i] = own[start + i + H]
                    for i in range(H):
                        own[start + length - H + i] = h[i]
                        h[i] += np.tanh(total[i])
                    start += length
                for o in range(c.shape[0]):
                    output[k, o] = c[o]
                    for j in range(H):
                        output[k, o] += C[o, j] * h[j]
            for o in range(c.shape[0]):
                outputs[t, k, o] = output[k, o]
