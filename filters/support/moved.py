"""Modules that the documentation of an earlier version named: they can still be imported from there, with a warning."""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

CORE = "kalman metrics model quantity rotation estimator"
IMU = "bounded_motion external_acceleration mekf marins"
MOVED = {
    **{f"poise.filters.{name}": f"poise.filters.core.{name}" for name in CORE.split()},
    **{f"poise.filters.{name}": f"poise.filters.imu.{name}" for name in IMU.split()},
    "poise.filters.bounds": "poise.filters.analysis.bounds",
    "poise.envs.calibration": "poise.envs.data.calibration.records",
    "poise.envs.devices": "poise.envs.hand.devices",
    "poise.envs.gestures": "poise.envs.hand.gestures",
    "poise.envs.hand_sensing": "poise.envs.hand.sensing",
    "poise.envs.recordings": "poise.envs.data.formats.load",
    "poise.envs.trajectory": "poise.envs.data.trajectory",
}
"""Name in version 0.1.0 → name now; goes with version 0.3.0."""


class MovedModules:
    """Finder and loader of :data:`MOVED`: the module under its earlier name is the module under its new one."""

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: object = None) -> ModuleSpec | None:
        """Find a module that has moved."""
        if name not in MOVED:
            return None
        warnings.warn(f"{name} is now {MOVED[name]}", DeprecationWarning, stacklevel=2)
        return ModuleSpec(name, self)  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Give the module itself, which the import system must not describe anew."""
        module = importlib.import_module(MOVED[spec.name])
        self.spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Restore what the import system changed."""
        module.__spec__ = self.spec


def install() -> None:
    """Find moved modules, after all that exist."""
    sys.meta_path.append(MovedModules())
