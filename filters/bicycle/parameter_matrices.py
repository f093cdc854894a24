"""Small matrices of parameters: numbers, traced scalars or arrays ``(*batch,)``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..core.backend import Array, constant, expand, namespace


def times(matrix: Array, vector: Array) -> Array:
    """Product of ``(..., m, n)`` with ``(..., n)``."""
    return (matrix @ vector[..., None])[..., 0]


def zeros(like: Array, rows: int, columns: int) -> Array:
    """Zeros ``(*batch, rows, columns)`` for a batch of vectors ``(*batch, n)``."""
    return 0.0 * like[..., :1, None] + constant([[0.0] * columns] * rows, like)


def values(entries: Sequence[Any], zero: Array) -> Array:
    """Parameters as a vector ``(*batch, n)``; ``zero`` is ``(*batch, 1)``."""
    return namespace(zero).concat([expand(entry, 1) + zero for entry in entries], axis=-1)


def diagonal(entries: Sequence[Any], zero: Array) -> Array:
    """Parameters as a diagonal matrix ``(*batch, n, n)``; ``zero`` is ``(*batch, 1)``."""
    size = len(entries)
    unit = constant([[float(row == column) for column in range(size)] for row in range(size)], zero)
    return values(entries, zero)[..., None] * unit


def zero_where_known(*samples: Array) -> Array:
    """Zeros ``(*batch, 1)`` where all of the samples ``(*batch, n)`` are there, else NaN: a prior waits for them."""
    xp = namespace(*samples)
    joined = xp.concat(samples, axis=-1)
    found = xp.all(xp.isfinite(joined), axis=-1)[..., None]
    return xp.where(found, xp.zeros_like(joined[..., :1]), xp.nan)
