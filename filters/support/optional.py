"""Packages that only some parts of poise need: they come with an extra of the installation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

EXTRAS: dict[str, frozenset[str]] = {
    "sim": frozenset({"pybullet", "pybullet_data"}),
    "learn": frozenset({"torch", "tensorboard"}),
    "rl": frozenset({"stable_baselines3", "torch", "tensorboard"}),
    "compare": frozenset({"ahrs", "imufusion", "vqf"}),
}
"""Extra → the modules that it brings."""


@contextmanager
def extra(name: str) -> Iterator[None]:
    """Surround the imports of what an extra of the installation brings.

    Args:
        name: a key of :data:`EXTRAS`.

    Raises:
        ImportError: it is not installed; the message says how to install it.
    """
    try:
        yield
    except ModuleNotFoundError as reason:
        module = (reason.name or "").split(".")[0]
        if module not in EXTRAS[name]:
            raise
        raise ImportError(f"{module} is not installed: pip install 'poise[{name}]'", name=module) from None
