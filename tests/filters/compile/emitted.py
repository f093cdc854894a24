"""Recorded equations as compiled functions of arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numba
import numpy as np
from numba.extending import intrinsic

from poise.filters.compile.emit import native, print_function


def emitted(arguments: Mapping[str, tuple[int, ...]], outputs: Mapping[str, np.ndarray]) -> Callable[..., Any]:
    """The function that computes recorded outputs; it takes its arguments by position."""
    names = ", ".join(arguments)
    scope: dict[str, Any] = {"intrinsic": intrinsic, "native": native}
    exec(print_function("computed", arguments, outputs), scope)
    exec(f"def call({names}):\n    computed({names})", scope)
    return numba.njit(scope["call"])
