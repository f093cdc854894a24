"""For training: the network of :mod:`poise.baselines.learned.gru` as a torch module, and the loss."""

from __future__ import annotations

import numpy as np

from ...filters.core.backend import Array, namespace, to_numpy
from ...filters.core.metrics import direction_error, rms, scored
from ...filters.support.optional import extra
from .gravity_aligned_frame import FEATURES

with extra("learn"):
    import torch
    from torch import Tensor, nn

SCALE = 0.1
"""rad: the output in this unit has the order of one"""


class GruModule(nn.Module):
    """Features ``(B, N, F)`` and memory ``(B, H)`` → tilt ``(B, N, 2)`` and memory; at first the tilt is zero.

    Args:
        units: H.
        seed: of the initial weights.
    """

    def __init__(self, units: int, seed: int) -> None:
        super().__init__()
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.input = nn.Linear(FEATURES.size, units)
            self.gru = nn.GRU(units, units, batch_first=True)
            self.output = nn.Linear(units, 2)
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)

    def forward(self, features: Tensor, memory: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Run over a window; ``memory`` None: zeros."""
        start = None if memory is None else memory[None]
        hidden, last = self.gru(torch.tanh(self.input(features)), start)
        return SCALE * self.output(hidden), last[0]

    def arrays(self) -> dict[str, np.ndarray]:
        """The weights for :meth:`poise.baselines.learned.gru.GruNetwork.from_arrays`, float32."""
        arrays = {name: to_numpy(tensor).astype(np.float32) for name, tensor in self.state_dict().items()}
        return {
            name: array * np.float32(SCALE if name.startswith("output.") else 1.0) for name, array in arrays.items()
        }


def up_of(tilt: Array) -> Array:
    """The up vector ``(..., 3)``, of any length, of a tilt ``(..., 2)`` in the gravity-aligned frame."""
    xp = namespace(tilt)
    return xp.concat([tilt, xp.ones_like(tilt[..., :1])], axis=-1)


def inclination_loss(tilt: Array, up: Array, mask: Array) -> Array:
    """Mean over sequences of the root mean square inclination error in time, rad.

    Tables of trials show this error. Its gradient weights sequences with small and large errors equally, in contrast to
    the mean square over all samples.

    Args:
        tilt: ``(B, N, 2)`` estimate.
        up: ``(B, N, 3)`` truth in the gravity-aligned frame.
        mask: ``(B, N)`` bool, evaluation mask.

    Returns:
        A number; zero, with gradient zero, where nothing is scored.
    """
    xp = namespace(tilt)
    error = direction_error(up_of(tilt), up)
    counted = xp.any(scored(error, mask), axis=1)
    each = rms(error, mask, axis=1)
    each = xp.where(counted, each, xp.zeros_like(each))
    count = xp.sum(xp.astype(counted, each.dtype))
    return xp.sum(each) / xp.where(count > 0.0, count, xp.ones_like(count))
