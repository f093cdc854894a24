"""Networks as torch modules, for training: the package's own, and any other inside :class:`TorchNetwork`."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ....filters.core.backend import to_numpy
from ....filters.support.optional import extra
from .gru import GruNetwork
from .tcn import TAPS, TcnNetwork

with extra("learn"):
    import torch
    from torch import Tensor, nn


class Standardised(nn.Module):
    """Features in units of their deviation from their mean; exported weights contain both.

    Args:
        features: F.
    """

    def __init__(self, features: int) -> None:
        super().__init__()
        self.register_buffer("shift", torch.zeros(features))
        self.register_buffer("factor", torch.ones(features))
        self.register_buffer("known", torch.tensor(False))

    def fit(self, mean: np.ndarray, deviation: np.ndarray) -> None:
        """Take mean and standard deviation ``(F,)`` of the training data."""
        self.shift.copy_(torch.from_numpy(np.asarray(mean)))  # type: ignore[operator]
        self.factor.copy_(torch.from_numpy(1.0 / np.asarray(deviation)))  # type: ignore[operator]
        self.known.fill_(True)  # type: ignore[operator]

    def forward(self, features: Tensor) -> Tensor:
        """Standardised features."""
        return (features - self.shift) * self.factor  # type: ignore[operator]

    def folded(self, layer: nn.Linear) -> tuple[np.ndarray, np.ndarray]:
        """Weight and bias of a linear layer that takes the features as they are."""
        weight, bias = (to_numpy(part.detach()).astype(float) for part in (layer.weight, layer.bias))
        shift, factor = to_numpy(self.shift).astype(float), to_numpy(self.factor).astype(float)
        weight = weight * factor
        return weight, bias - weight @ shift


class GruModule(nn.Module):
    """Features ``(B, N, F)`` and memory ``(B, H)`` → output ``(B, N, O)`` and memory; at first the output is zero.

    Args:
        features: F.
        outputs: O.
        units: H.
        seed: of the initial weights.
        scale: unit of the output: with it, the numbers that the last layer learns are of the order of one.
        noise: standard deviation of noise on standardised features while training.
    """

    def __init__(
        self, features: int, outputs: int, units: int = 64, seed: int = 0, scale: float = 1.0, noise: float = 0.0
    ) -> None:
        super().__init__()
        self.scale, self.noise, self.memory_size = scale, noise, units
        self.standardised = Standardised(features)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.input = nn.Linear(features, units)
            self.gru = nn.GRU(units, units, batch_first=True)
            self.output = nn.Linear(units, outputs)
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)

    def forward(self, features: Tensor, memory: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Run over a window; ``memory`` None: zeros."""
        start = None if memory is None else memory[None].contiguous()
        hidden, last = self.gru(torch.tanh(self.input(noisy(self, self.standardised(features)))), start)
        return self.scale * self.output(hidden), last[0]

    @classmethod
    def of(cls, network: GruNetwork, scale: float = 1.0) -> GruModule:
        """A module with the weights of a network, to be trained further; scales of the features are in them."""
        made = cls(network.features, network.outputs, network.size, scale=scale)
        arrays = {name: torch.from_numpy(array) for name, array in network.arrays().items()}
        for name in ("output.weight", "output.bias"):
            arrays[name] = arrays[name] / scale
        made.load_state_dict(arrays, strict=False)
        made.standardised.fit(np.zeros(network.features), np.ones(network.features))
        return made

    def export(self) -> GruNetwork:
        """The weights without torch."""
        weight, bias = self.standardised.folded(self.input)
        gru = [to_numpy(getattr(self.gru, name).detach()) for name in ("weight_ih_l0", "bias_ih_l0")]
        gru += [to_numpy(getattr(self.gru, name).detach()) for name in ("weight_hh_l0", "bias_hh_l0")]
        last = [self.scale * to_numpy(part.detach()) for part in (self.output.weight, self.output.bias)]
        return GruNetwork(*(array.astype(np.float32) for array in (weight, bias, *gru, *last)))


class TcnModule(nn.Module):
    """A causal temporal convolution network with the interface of :class:`GruModule`.

    Args:
        features: F.
        outputs: O.
        channels: C.
        blocks: L; the network sees 2^{L+1} − 1 updates back.
        seed: of the initial weights.
        scale: unit of the output.
        noise: standard deviation of noise on standardised features while training.
    """

    def __init__(
        self,
        features: int,
        outputs: int,
        channels: int = 32,
        blocks: int = 7,
        seed: int = 0,
        scale: float = 1.0,
        noise: float = 0.0,
    ) -> None:
        super().__init__()
        self.scale, self.noise, self.channels, self.blocks = scale, noise, channels, blocks
        self.memory_size = (TAPS - 1) * (2**blocks - 1) * channels
        self.standardised = Standardised(features)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.input = nn.Linear(features, channels)
            self.convolutions = nn.ModuleList(
                nn.Conv1d(channels, channels, TAPS, dilation=2**block) for block in range(blocks)
            )
            self.output = nn.Linear(channels, outputs)
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)

    def forward(self, features: Tensor, memory: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Run over a window; ``memory`` None: zeros."""
        h = self.input(noisy(self, self.standardised(features))).swapaxes(1, 2)
        if memory is None:
            memory = h.new_zeros(len(h), self.memory_size)
        kept, start = [], 0
        for block, convolution in enumerate(self.convolutions):
            length = (TAPS - 1) * 2**block
            past = memory[:, start : start + length * self.channels].reshape(len(h), length, -1).swapaxes(1, 2)
            own = torch.cat([past, h], dim=2)
            kept.append(own[:, :, own.shape[2] - length :].swapaxes(1, 2).reshape(len(h), -1))
            h = h + torch.tanh(convolution(own))
            start += length * self.channels
        return self.scale * self.output(h.swapaxes(1, 2)), torch.cat(kept, dim=1)

    def export(self) -> TcnNetwork:
        """The weights without torch."""
        weight, bias = self.standardised.folded(self.input)
        blocks: list[Any] = list(self.convolutions)
        taps = np.stack([to_numpy(block.weight.detach()).transpose(2, 0, 1) for block in blocks])
        biases = np.stack([to_numpy(block.bias.detach()) for block in blocks])
        last = [self.scale * to_numpy(part.detach()) for part in (self.output.weight, self.output.bias)]
        return TcnNetwork(*(array.astype(np.float32) for array in (weight, bias, taps, biases, *last)))


class TorchNetwork:
    """Any torch module as a network of this package.

    The module takes features ``(B, N, F)`` and gives ``(B, N, O)`` or, if it remembers, takes ``(features, memory)``
    with memory ``(B, M)`` (None: the start) and gives ``(output, memory)``; then it has an attribute ``memory_size`` M.
    One that remembers nothing sees the last ``context`` updates at each.

    Args:
        module: the module.
        features: F.
        outputs: O.
        context: updates that a module without memory sees, itself included.
        standardised: with the scales of the features, applied before the module; None: as they are.

    Raises:
        ValueError: a context that is not positive.
    """

    kind: ClassVar[str] = "torch"

    def __init__(
        self, module: nn.Module, features: int, outputs: int, context: int = 1, standardised: Standardised | None = None
    ) -> None:
        if context < 1:
            raise ValueError(f"context must be at least 1, got {context}")
        self.module, self.features, self.outputs, self.context = module, features, outputs, context
        self.standardised = Standardised(features) if standardised is None else standardised
        self.remembers = hasattr(module, "memory_size")
        # the last numbers tell how much of the memory is filled
        remembered: Any = getattr(module, "memory_size", (context - 1) * features)
        self.memory_size = 1 + int(remembered)

    def arrays(self) -> dict[str, np.ndarray]:
        """The weights: the module's state, and the scales of the features."""
        states = {"module": self.module.state_dict(), "standardised": self.standardised.state_dict()}
        return {f"{part}.{name}": to_numpy(array) for part, state in states.items() for name, array in state.items()}

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        """Take the weights of a file.

        Raises:
            ValueError: they are those of another module.
        """
        try:
            for part, module in (("module", self.module), ("standardised", self.standardised)):
                own = {name.removeprefix(f"{part}."): array for name, array in arrays.items() if name.startswith(part)}
                module.load_state_dict({name: torch.from_numpy(np.array(array)) for name, array in own.items()})
        except RuntimeError as reason:
            raise ValueError(f"the weights are those of another module: {reason}") from None

    def step(self, features: Any, memory: Any) -> tuple[Any, Any]:
        """One update: features ``(..., F)`` and memory ``(..., M)`` → new memory and output ``(..., O)``."""
        batch = tuple(features.shape[:-1])
        flat, kept = (np.array(array, dtype=float).reshape(-1, array.shape[-1]) for array in (features, memory))
        output = np.zeros((len(flat), self.outputs))
        self.advance(flat[None], np.ones((1, len(flat))), kept, output)
        return kept.reshape(*batch, -1), output.reshape(*batch, -1)

    def advance(self, features: np.ndarray, due: np.ndarray, memory: np.ndarray, output: np.ndarray) -> np.ndarray:
        """All samples of all sequences; see :meth:`poise.baselines.learned.networks.gru.GruNetwork.advance`."""
        outputs = np.empty((*due.shape, self.outputs))
        self.module.eval()
        with torch.no_grad():
            for k in range(due.shape[1]):
                rows = np.flatnonzero(due[:, k] == 1.0)
                raw_output = self._whole(features[rows, k], memory[k]) if len(rows) else output[:0, :]
                place = np.searchsorted(rows, np.arange(len(due)), side="right") - 1
                before = output[k].copy()
                outputs[:, k] = np.where(place[:, None] < 0, before, raw_output[place] if len(rows) else before)
                output[k] = outputs[-1, k]
        return outputs

    def _whole(self, rows: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Outputs ``(N, O)`` of consecutive updates of one sequence; its memory ``(M,)`` is changed in place."""
        own = self.standardised(torch.from_numpy(rows).float())
        if self.remembers:
            start = torch.from_numpy(memory[:-1]).float()[None] if memory[-1] else None
            raw_output, last = self.module(own[None], start)
            memory[:-1], memory[-1] = to_numpy(last[0]), 1.0
            return np.asarray(to_numpy(raw_output[0]), dtype=float)
        filled = int(memory[-1])
        past = torch.from_numpy(memory[:-1].reshape(-1, self.features)[self.context - 1 - filled :]).float()
        both = torch.cat([past, own])
        raw_output = torch.stack([self._last(both[: filled + index + 1]) for index in range(len(own))])
        kept = both[max(0, len(both) - self.context + 1) :]
        memory[-1] = len(kept)
        if self.context > 1:
            memory[:-1].reshape(-1, self.features)[self.context - 1 - len(kept) :] = to_numpy(kept)
        return np.asarray(to_numpy(raw_output), dtype=float)

    def _last(self, rows: Tensor) -> Tensor:
        found: Tensor = self.module(rows[None, -self.context :])[0, -1]
        return found


def noisy(module: Any, features: Tensor) -> Tensor:
    """Features with the module's noise while it is trained."""
    if module.noise and module.training:
        return features + module.noise * torch.randn_like(features)
    return features
