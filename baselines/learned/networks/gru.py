"""A recurrent network: inference without torch, on any arrays or compiled.

    u = tanh(A s + a),   h ← GRU(u, h),   t = C h + c

with features s, memory h and outputs t, which a head (:mod:`.head`) makes a pose. The GRU is that of K. Cho et al.,
"Learning Phrase Representations using RNN Encoder-Decoder for Statistical Machine Translation", EMNLP 2014, with the
reset after the product, as PyTorch has it,

    r = σ(W_r u + b_r + V_r h + d_r),   z = σ(W_z u + b_z + V_z h + d_z),
    n = tanh(W_n u + b_n + r ∘ (V_n h + d_n)),   h ← (1 − z) ∘ n + z ∘ h
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

NAMES = (
    "input.weight",
    "input.bias",
    "gru.weight_ih_l0",
    "gru.bias_ih_l0",
    "gru.weight_hh_l0",
    "gru.bias_hh_l0",
    "output.weight",
    "output.bias",
)
"""Arrays of a network; the names are those of the torch module that is trained."""


@dataclass(frozen=True, eq=False)
class GruNetwork(NetworkWeights):
    """The weights, with H units, F features and O outputs.

    Attributes:
        input_weight: ``(H, F)`` A.
        input_bias: ``(H,)`` a.
        gru_weight: ``(3 H, H)`` W, the blocks in the order r, z, n.
        gru_bias: ``(3 H,)`` b.
        memory_weight: ``(3 H, H)`` V.
        memory_bias: ``(3 H,)`` d.
        output_weight: ``(O, H)`` C.
        output_bias: ``(O,)`` c.

    Raises:
        ValueError: a shape does not fit the others.
    """

    input_weight: np.ndarray
    input_bias: np.ndarray
    gru_weight: np.ndarray
    gru_bias: np.ndarray
    memory_weight: np.ndarray
    memory_bias: np.ndarray
    output_weight: np.ndarray
    output_bias: np.ndarray

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Field → its shape."""
        size, features, outputs = self.size, np.shape(self.input_weight)[-1:], np.shape(self.output_weight)[:1]
        return {
            "input_weight": (size, *features),
            "input_bias": (size,),
            "gru_weight": (3 * size, size),
            "gru_bias": (3 * size,),
            "memory_weight": (3 * size, size),
            "memory_bias": (3 * size,),
            "output_weight": (*outputs, size),
            "output_bias": outputs,
        }

    names: ClassVar[tuple[str, ...]] = NAMES
    kind: ClassVar[str] = "gru"

    @property
    def size(self) -> int:
        """Units H."""
        return len(np.atleast_1d(self.input_bias))

    @property
    def features(self) -> int:
        """Features F."""
        return int(self.input_weight.shape[1])

    @property
    def memory_size(self) -> int:
        """Numbers that are remembered of each sequence: H."""
        return self.size

    @property
    def outputs(self) -> int:
        """Outputs O."""
        return len(self.output_bias)

    def step(self, features: Array, memory: Array) -> tuple[Array, Array]:
        """One update: features ``(..., F)`` and memory ``(..., H)`` → new memory and output ``(..., O)``."""
        xp, size = namespace(features, memory), self.size

        def affine(weight: np.ndarray, bias: np.ndarray, x: Array) -> Array:
            return (constant(weight, x) @ x[..., None])[..., 0] + constant(bias, x)

        u = xp.tanh(affine(self.input_weight, self.input_bias, features))
        new = affine(self.gru_weight, self.gru_bias, u)
        old = affine(self.memory_weight, self.memory_bias, memory)
        r = 1.0 / (1.0 + xp.exp(-(new[..., :size] + old[..., :size])))
        z = 1.0 / (1.0 + xp.exp(-(new[..., size : 2 * size] + old[..., size : 2 * size])))
        n = xp.tanh(new[..., 2 * size :] + r * old[..., 2 * size :])
        memory = (1.0 - z) * n + z * memory
        return memory, affine(self.output_weight, self.output_bias, memory)

    def advance(self, features: np.ndarray, due: np.ndarray, memory: np.ndarray, output: np.ndarray) -> np.ndarray:
        """All samples of all sequences, compiled.

        Args:
            features: ``(T, B, F)``.
            due: ``(T, B)``, 1 where the network is updated; elsewhere memory and output stay.
            memory: ``(B, H)``, changed in place.
            output: ``(B, O)``, changed in place.

        Returns:
            The output of every sample, ``(T, B, O)``.
        """
        outputs = np.empty((*due.shape, self.outputs))
        compiled_kernel()(features, due, memory, output, outputs, *self._columns())
        return outputs

    def _columns(self) -> tuple[np.ndarray, ...]:
        """The arrays with the matrices by column, so that the inner loops run along memory; made once."""
        columns = self.__dict__.get("_transposed")
        if columns is None:
            arrays = (
                self.input_weight.T,
                self.input_bias,
                self.gru_weight.T,
                self.gru_bias,
                self.memory_weight.T,
                self.memory_bias,
                self.output_weight,
                self.output_bias,
            )
            columns = self.__dict__["_transposed"] = tuple(np.ascontiguousarray(array) for array in arrays)
        return columns


@lru_cache(maxsize=1)
def compiled_kernel() -> Callable[..., None]:
    """:func:`advance_all`, compiled on first use."""
    return jit(advance_all)


def advance_all(features, due, memory, output, outputs, A, a, W, b, V, d, C, c):  # type: ignore[no-untyped-def]  # noqa: D103, ANN
    T, B, F = features.shape
    H = memory.shape[1]
    u, new, old = np.empty(H), np.empty(3 * H), np.empty(3 * H)
    for t in range(T):
        for k in range(B):
            if due[t, k] == 1.0:
                h = memory[k]
                u[:] = a
                for j in range(F):
                    s = features[t, k, j]
                    for i in range(H):
                        u[i] += A[j, i] * s
                new[:] = b
                old[:] = d
                for j in range(H):
                    s, m = np.tanh(u[j]), h[j]
                    for i in range(3 * H):
                        new[i] += W[j, i] * s
                        old[i] += V[j, i] * m
                for i in range(H):
                    r = 1.0 / (1.0 + np.exp(-(new[i] + old[i])))
                    z = 1.0 / (1.0 + np.exp(-(new[H + i] + old[H + i])))
                    n = np.tanh(new[2 * H + i] + r * old[2 * H + i])
                    h[i] = (1.0 - z) * n + z * h[i]
                for o in range(c.shape[0]):
                    total = c[o]
                    for j in range(H):
                        total += C[o, j] * h[j]
                    output[k, o] = total
            for o in range(c.shape[0]):
                outputs[t, k, o] = output[k, o]
