"""Recorded equations as compiled functions of arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from poise.filters.compile.emit import print_function
from poise.filters.compile.native import addresses


def emitted(arguments: Mapping[str, tuple[int, ...]], outputs: Mapping[str, np.ndarray]) -> Callable[..., Any]:
    """The function that computes recorded outputs; it takes its arguments by position."""
    (address,) = addresses({"computed": print_function("computed", arguments, outputs)}, "Computed").values()
    function = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(arguments))(address)
    return lambda *arrays: function(*(array.ctypes.data for array in arrays))
