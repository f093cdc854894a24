"""A hand that moves a device: gestures, drivers, device noise models, the environment."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    """Load the environment on first use."""
    if name == "HandMotionEnv":
        from .environment import HandMotionEnv

        return HandMotionEnv
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
