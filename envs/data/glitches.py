"""Samples that a recording shows to be none, although each alone could be one: found from what comes before and after.

A glitch of the transmission stands alone: the sample after it is where the sample before was. What a motion or an
impact does to a sensor rings on. In the recordings of BROAD, RepoIMU, EuRoC, smartphones and a bicycle ride no sample
comes near the bounds below; tapping on the sensor of BROAD reaches a third of :data:`ISOLATION`.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from .trajectory import Trajectory

LEAST = {"gyr": 3.0, "acc": 30.0}
"""rad/s and m/s²: distance of a glitch from the mean of its neighbours."""
ISOLATION = 6.0
"""The same beside that of the samples two to four intervals away, of which one may be a glitch too."""
RETURN = 0.3
"""Difference of the neighbours, as a share of the distance."""
AWAY = (-4, -3, -2, 2, 3, 4)
FULL = 0.999
"""Share of the range from which a sample is saturated."""


def glitches(values: np.ndarray, least: float) -> np.ndarray:
    """Samples ``(T,)`` bool of ``(T, 3)`` that stand alone, far from neighbours that agree."""
    found = np.zeros(len(values), bool)
    if len(values) < 9:
        return found
    with np.errstate(invalid="ignore", over="ignore"):
        distance = np.zeros(len(values))
        distance[1:-1] = np.linalg.norm(values[1:-1] - 0.5 * (values[:-2] + values[2:]), axis=1)
        far = np.flatnonzero(distance > least)
        if not len(far):
            return found
        around = np.sort(np.nan_to_num(distance[np.clip(far[:, None] + AWAY, 0, len(values) - 1)]), axis=1)[:, -2]
        beyond = np.linalg.norm(values[far + 1] - values[far - 1], axis=1)
        found[far] = (distance[far] > ISOLATION * around) & (beyond < RETURN * distance[far])
    return found


def full_scales(metadata: Mapping[str, Any]) -> dict[str, float]:
    """Channel → range in its unit, of ``metadata["full_scale"]``."""
    given = metadata.get("full_scale", {})
    return {str(name): float(limit) for name, limit in given.items()} if isinstance(given, Mapping) else {}


def without_glitches(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """The measurements of a trajectory on its grid, NaN where there is no sample in truth.

    That is a glitch of a gyroscope or an accelerometer; a gyroscope's 0, 0, 0 beside an accelerometer's, which is how a
    logger writes that nothing came; and what reaches the range of a sensor, where ``metadata["full_scale"]`` names it
    (channel → range).

    Warns:
        UserWarning: how many samples there are.
    """
    measurements, told = dict(trajectory.measurements), []
    ranges = full_scales(trajectory.metadata)
    for name, values in trajectory.measurements.items():
        site, _, kind = name.rpartition("/")
        if kind not in LEAST or values.shape[1] != 3:
            continue
        parts: dict[str, np.ndarray] = {"glitches": glitches(values, LEAST[kind])}
        force = trajectory.measurements.get(f"{site}/acc")
        if kind == "gyr" and force is not None:
            parts["rows of zeros"] = np.logical_not(values.any(axis=1) | force.any(axis=1))
        if name in ranges:
            parts["saturated"] = np.any(np.abs(values) >= FULL * ranges[name], axis=1)
        wrong = np.logical_or.reduce(list(parts.values()))
        if wrong.any():
            measurements[name] = np.where(wrong[:, None], np.nan, values)
            told += [f"{name}: {int(part.sum())} {what}" for what, part in parts.items() if part.any()]
    if told:
        warnings.warn(f"{trajectory.name}: {', '.join(told)}; they count as missing samples", stacklevel=4)
    return measurements
