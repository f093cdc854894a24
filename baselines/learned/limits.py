"""Limits within which a trained network is valid, in words for its card."""

from __future__ import annotations

import math
from typing import Any

from .calibration import Calibration
from .presets import Preset


def limits_of(preset: Preset, estimator: Any, calibration: Calibration | None) -> list[str]:
    """Sentences about what a network was trained on and what it shares with the filter that it corrects.

    Args:
        preset: of the training.
        estimator: that came out, with a front end.
        calibration: of its covariance, if it has one.
    """
    said = []
    interval = getattr(estimator.front_end, "interval", None)
    if interval is not None:
        said.append(f"Sampling at {1.0 / interval:g} Hz or faster.")
    if preset.rides is not None:
        changes = preset.rides.changes
        kinds = ", ".join(f"{name} {' '.join(map(str, values))}" for name, values in changes.items())
        said.append(f"Trained on simulated riders only ({kinds}); never compared with a recorded ride.")
        said.append("Other scenarios and styles of riding have the larger errors of the groups under test.")
    for name in preset.sources:
        made: Any = preset.recipe(name)
        bias = math.degrees(made.sensors.gyroscope_bias[1])
        said.append(f"Trained on the simulated motions {name}, with gyroscope biases of up to {bias:.1f} °/s.")
    if preset.filter is not None:
        said.append(f"It shares the failures of {preset.filter}, of which it sees states and innovations.")
    elif preset.rides is not None:
        said.append("It sees the share of samples that came, so sensors should have the rates of the training, 100 Hz.")
    if calibration is not None:
        said.append(
            f"The covariance comes from {calibration.rides} rides that were not trained on; it grows where inputs are "
            "unlike the training data, by less than the errors of riders of another style."
        )
    elif not hasattr(estimator, "filter"):
        said.append("It states no covariance.")
    return said
