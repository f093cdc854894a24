"""Packages that only some parts of poise need: they come with an extra of the installation."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

EXTRAS: dict[str, frozenset[str]] = {
    "sim": frozenset({"pybullet", "pybullet_data"}),
    "learn": frozenset({"torch", "tensorboard", "onnx", "onnxruntime"}),
    "rl": frozenset({"stable_baselines3", "sb3_contrib", "optuna", "torch", "tensorboard", "onnx", "onnxruntime"}),
    "compare": frozenset({"ahrs", "imufusion", "vqf"}),
    "parquet": frozenset({"pyarrow"}),
    "view": frozenset({"viser", "plotly", "trimesh"}),
    "exchange": frozenset({"minari"}),
    "cluster": frozenset({"dask", "ray"}),
}
"""Extra → the modules that it brings."""


class MissingExtraError(ImportError):
    """A package is missing that an extra of the installation brings; the message says how to install it."""


@contextmanager
def extra(name: str | None = None) -> Iterator[None]:
    """Surround the imports of what an extra of the installation brings.

    Args:
        name: a key of :data:`EXTRAS`; None: the first that brings the missing module.

    Raises:
        MissingExtraError: a module of the extra is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as reason:
        module = (reason.name or "").split(".")[0]
        found = next((each for each in ([name] if name else EXTRAS) if module in EXTRAS[each]), None)
        if found is None:
            raise
        raise MissingExtraError(f"{module} is not installed: pip install 'poise[{found}]'", name=module) from None


@contextmanager
def silent() -> Iterator[None]:
    """Surround an import whose machine code writes to standard error, as that of PyBullet writes when it was built."""
    kept, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nothing, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nothing)
