"""Block matrices of the whole-body filter: eight blocks of the error state, most of them decoupled."""

from __future__ import annotations

from ...core.backend import Array, constant, namespace
from .linkage import HIP, RELATIVE_ACCELERATION, ROLL, SHOULDER, TRUNK, YAW_ACCELERATION

BLOCKS = (
    ROLL,
    YAW_ACCELERATION,
    TRUNK,
    RELATIVE_ACCELERATION,
    SHOULDER["right"],
    HIP["right"],
    SHOULDER["left"],
    HIP["left"],
)
"""Blocks of the state, in order."""


def assemble(blocks: dict[tuple[int, int], Array], x: Array) -> Array:
    """A matrix ``(..., 20, 20)`` from blocks by index of row and column; the rest is zero."""
    xp = namespace(x)
    bands = []
    for i, row in enumerate(BLOCKS):
        height = 0.0 * x[..., row, None]
        band = [
            blocks[i, j] if (i, j) in blocks else height + constant([[0.0] * (column.stop - column.start)], x)
            for j, column in enumerate(BLOCKS)
        ]
        bands.append(xp.concat(band, axis=-1))
    return xp.concat(bands, axis=-2)


def row_of(by: dict[int, Array], x: Array) -> Array:
    """A row ``(..., 1, 20)`` of H from its blocks."""
    zero = 0.0 * x[..., :1, None]
    parts = [
        by[i] + zero if i in by else zero + constant([[0.0] * (block.stop - block.start)], x)
        for i, block in enumerate(BLOCKS)
    ]
    return namespace(x).concat(parts, axis=-1)
