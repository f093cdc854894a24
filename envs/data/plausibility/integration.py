"""Attitudes of windows of a recording by integration of their rates, all windows at once."""

from __future__ import annotations

import math

import numpy as np

from ....filters.core import rotation


def attitudes(turns: np.ndarray) -> np.ndarray:
    """Attitudes ``(..., N, 4)`` in the middle of each step, of rotation vectors ``(..., N, 3)``, rad, of the steps.

    A window begins with the axes of its body. The products are formed in blocks, all blocks beside one another, and
    then each block is turned by those before it.
    """
    half = rotation.exp(0.5 * turns)
    count = half.shape[-2]
    size = max(1, math.isqrt(count))
    whole = -(-count // size)
    padded = np.zeros((*half.shape[:-2], whole * size, 4))
    padded[..., 0] = 1.0
    padded[..., 0, :] = half[..., 0, :]
    padded[..., 1:count, :] = rotation.multiply(half[..., :-1, :], half[..., 1:, :])
    blocks = padded.reshape(*half.shape[:-2], whole, size, 4)
    for index in range(1, size):
        blocks[..., index, :] = rotation.multiply(blocks[..., index - 1, :], blocks[..., index, :])
    ends = blocks[..., -1, :].copy()
    for index in range(1, ends.shape[-2]):
        ends[..., index, :] = rotation.multiply(ends[..., index - 1, :], ends[..., index, :])
    blocks[..., 1:, :, :] = rotation.multiply(ends[..., :-1, None, :], blocks[..., 1:, :, :])
    return padded[..., :count, :]
