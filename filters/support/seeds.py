"""Integer seeds that descend from one root seed; generators have ``spawn`` for the same purpose."""

from __future__ import annotations

import operator
import zlib

import numpy as np


def root_seed(seed: int | None) -> int:
    """Return ``seed``, or one from the operating system's entropy if it is None.

    Raises:
        ValueError: it is not a whole number of at least 0.
    """
    if seed is None:
        return _number(np.random.SeedSequence())
    try:
        number = operator.index(seed)
    except TypeError:
        number = -1
    if number < 0:
        raise ValueError(f"seed must be None or a whole number of at least 0, got {seed!r}")
    return number


def child_seed(root: int, index: int) -> int:
    """Return child number ``index`` of ``root``, below 2³²."""
    return _number(np.random.SeedSequence(root, spawn_key=(index,)))


def child_seeds(root: int, count: int) -> tuple[int, ...]:
    """Return ``count`` independent children of ``root``; a larger ``count`` keeps the first ones."""
    return tuple(child_seed(root, index) for index in range(count))


def named_seed(root: int, *names: str | int) -> int:
    """Return a seed below 2³² that depends on ``root`` and on the names only."""
    return _number(np.random.SeedSequence([root, *(zlib.crc32(str(name).encode()) for name in names)]))


def named_generator(generator: np.random.Generator, *names: str | int) -> np.random.Generator:
    """Return a descendant of a generator by name: neither draws nor other descendants of the generator change."""
    sequence = generator.bit_generator.seed_seq
    key = tuple(zlib.crc32(str(name).encode()) for name in names)
    return np.random.default_rng(
        np.random.SeedSequence(sequence.entropy, spawn_key=(*sequence.spawn_key, *key))  # type: ignore[attr-defined]
    )


def _number(sequence: np.random.SeedSequence) -> int:
    return int(sequence.generate_state(1)[0])
