"""poise: pose from inertial sensors.

Gymnasium environments that simulate moving people and devices and return the true pose, published Kalman filters,
learned estimators, and policies that adapt filter gains, compared on the same simulated and recorded data.

>>> import poise
>>> trajectory = poise.record("poise/HandMotion-v0", seed=0)
>>> estimate = poise.run("bounded-motion", trajectory)
>>> table = poise.evaluate(["bounded-motion", "tilt"], [trajectory])

Five layers that import downwards only: :mod:`poise.filters` (rotations, the Kalman core, published filters, metrics),
:mod:`poise.envs` (physics, sensors, environments, recordings), :mod:`poise.baselines` (learned estimators, gain
policies, the registry of all estimators, evaluation), :mod:`poise.baselines.studies` (the five published works) and
:mod:`poise.scripts` (the command ``poise``). Importing poise registers its environments with Gymnasium and loads
neither PyBullet nor torch.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from .envs import register_environments
from .filters.support.version import poise_version

if TYPE_CHECKING:
    from .baselines.evaluation import evaluate
    from .baselines.gain_policy.scores import normalized_score
    from .baselines.online import OnlineEstimator
    from .baselines.registry import EstimatorInfo, list_estimators, make_estimator
    from .baselines.run import run, smooth
    from .envs.data.calibration.records import apply_calibration, load_calibration
    from .envs.data.formats.load import load_recording, load_recordings
    from .envs.data.plausibility.readings import Finding
    from .envs.data.plausibility.recording import check_recording
    from .envs.data.trajectory import Trajectory
    from .envs.exchange.minari_data import from_minari, to_minari
    from .envs.record import record
    from .envs.sensors.kinds import SensorKind, register_sensor_kind
    from .filters.core.estimator import Estimator
    from .filters.core.quantity import Estimate

__all__ = [
    "Estimate",
    "Estimator",
    "EstimatorInfo",
    "Finding",
    "OnlineEstimator",
    "SensorKind",
    "Trajectory",
    "__version__",
    "apply_calibration",
    "check_recording",
    "evaluate",
    "from_minari",
    "list_estimators",
    "load_calibration",
    "load_recording",
    "load_recordings",
    "make_estimator",
    "normalized_score",
    "record",
    "register_sensor_kind",
    "run",
    "smooth",
    "to_minari",
]

_HOMES = {
    "Estimate": ".filters.core.quantity",
    "Estimator": ".filters.core.estimator",
    "EstimatorInfo": ".baselines.registry",
    "Finding": ".envs.data.plausibility.readings",
    "OnlineEstimator": ".baselines.online",
    "SensorKind": ".envs.sensors.kinds",
    "Trajectory": ".envs.data.trajectory",
    "apply_calibration": ".envs.data.calibration.records",
    "check_recording": ".envs.data.plausibility.recording",
    "evaluate": ".baselines.evaluation",
    "from_minari": ".envs.exchange.minari_data",
    "list_estimators": ".baselines.registry",
    "load_calibration": ".envs.data.calibration.records",
    "load_recording": ".envs.data.formats.load",
    "load_recordings": ".envs.data.formats.load",
    "make_estimator": ".baselines.registry",
    "normalized_score": ".baselines.gain_policy.scores",
    "record": ".envs.record",
    "register_sensor_kind": ".envs.sensors.kinds",
    "run": ".baselines.run",
    "smooth": ".baselines.run",
    "to_minari": ".envs.exchange.minari_data",
}

__version__ = poise_version()

register_environments()


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name], __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
