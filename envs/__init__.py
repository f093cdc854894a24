"""Environments: physics, sensors, motions, recordings. Importing it registers the environments and loads no engine."""

from __future__ import annotations

from .registration import ENTRY_POINTS, list_environments, register_environments

__all__ = ["ENTRY_POINTS", "list_environments", "register_environments"]

register_environments()
