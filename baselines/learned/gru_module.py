"""The network of :mod:`poise.baselines.learned.gru` as a torch module, for training."""

from __future__ import annotations

import numpy as np

from ...filters.core.backend import to_numpy
from ...filters.support.optional import extra
from .level_frame import FEATURES

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
