"""One array vocabulary for NumPy, PyTorch and the tracer.

Model code asks ``xp = namespace(x)`` and takes every function from ``xp`` under its array-API name
(``xp.atan2``, ``xp.concat``, ``xp.where`` …). NumPy >= 2 is such a namespace by itself, PyTorch becomes one through
``array-api-compat``, and arrays of traced expressions (object dtype, see :mod:`.trace`) bring their own.

Rules for code that must run on all three: event dimensions last (``(..., 3)``, any leading batch dimensions), no
in-place writes, comparisons by function (``xp.greater(a, b)``), and ``xp.where`` instead of ``if`` on values.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

Array = Any
"""A NumPy array, a torch tensor or an object array of traced expressions; shapes are given in docstrings."""


def is_torch(value: Any) -> bool:
    """Whether ``value`` is a torch tensor, without importing torch."""
    torch = sys.modules.get("torch")
    return torch is not None and isinstance(value, torch.Tensor)


def is_traced(value: Any) -> bool:
    """Whether ``value`` is a traced expression or an object array of them."""
    return getattr(value, "dtype", None) == np.dtype(object)


def namespace(*arrays: Any) -> Any:
    """Return the array namespace that serves all ``arrays``; Python and NumPy scalars follow the others.

    Args:
        arrays: any mixture of one array kind with scalars.

    Returns:
        The ``numpy`` module, ``array_api_compat.torch``, or the tracer's namespace.
    """
    # most calls are with plain arrays
    if all(type(array) is np.ndarray and array.dtype.kind != "O" for array in arrays):
        return np
    for array in arrays:
        if is_torch(array):
            import array_api_compat.torch as torch_namespace

            return torch_namespace
    if any(is_traced(array) for array in arrays):
        from ..compile.trace import TracedNamespace

        return TracedNamespace
    return np


def together(xp: Any, parts: list[Array]) -> Array:
    """Stack parts ``(...)`` of one shape and type along a new last axis; NumPy's own way takes three times as long.

    Args:
        xp: their :func:`namespace`.
        parts: arrays.
    """
    if xp is not np:
        return xp.stack(parts, axis=-1)
    found = np.empty((*parts[0].shape, len(parts)), parts[0].dtype)
    for index, part in enumerate(parts):
        found[..., index] = part
    return found


def expand(parameter: Any, trailing: int) -> Any:
    """Append ``trailing`` axes of length one, so that a parameter ``(*batch,)`` scales an array ``(*batch, …)``.

    Plain numbers and traced scalars are returned unchanged, since they broadcast.
    """
    if getattr(parameter, "ndim", 0) == 0:
        return parameter
    return parameter[(..., *(None,) * trailing)]


def to_numpy(array: Any) -> np.ndarray:
    """Return ``array`` as a NumPy array, detached from any graph."""
    return array.detach().cpu().numpy() if is_torch(array) else np.asarray(array)


def constant(values: Any, like: Array) -> Array:
    """Return ``values`` as an array of the kind, precision and device of ``like`` (no batch axes are added)."""
    if is_torch(like):
        import torch

        return torch.as_tensor(np.array(values, dtype=float), dtype=like.dtype, device=like.device)
    if is_traced(like):
        return np.asarray(values, dtype=object)
    return np.asarray(values, dtype=getattr(like, "dtype", float))


def rows(entries: Any) -> Array:
    """Stack a nested list of ``(...)`` entries to a matrix ``(..., rows, columns)``; numbers broadcast.

    At least one entry must be an array (or a traced expression): it lends the others its kind and batch shape.
    """
    flat = [entry for row in entries for entry in row]
    array = next((entry for entry in flat if hasattr(entry, "dtype")), None)
    if array is None:
        return np.asarray(entries, dtype=object)
    xp = namespace(array)
    zero = 0.0 * sum((entry for entry in flat if hasattr(entry, "dtype")), start=0.0 * array)
    return xp.stack([xp.stack([zero + entry for entry in row], axis=-1) for row in entries], axis=-2)
