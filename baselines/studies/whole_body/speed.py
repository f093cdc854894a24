"""Errors of the whole-body filter against the bicycle's speed, to which the paper says it is insensitive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ..averages import leading
from ..claims import Claim
from ..ride_study import SETTLED
from .angles import STATES, TABLE_III

BINS = ((0.5, 2.0), (2.0, 3.5), (3.5, 5.0), (5.0, 6.5))
"""m/s: speeds of the paper's outdoor rides"""
SHOWN = ("φ", "θ1", "θ2", "θ3")
LEAST = 3.0
"""s that a ride must spend in a range of speeds for its errors to count"""


def squares_by_speed(ride: Trajectory, errors: Mapping[str, np.ndarray]) -> dict[str, dict[str, list[float]]]:
    """Range of speeds → angle → sum of squared errors (deg²) and number of samples, of one ride."""
    speed, found = ride.truth["bicycle/speed"][:, 0], {}
    for low, high in BINS:
        part = (ride.time >= SETTLED) & (speed >= low) & (speed < high)
        if part.sum() * ride.dt >= LEAST:
            found[f"{low:g}–{high:g} m/s"] = {
                angle: [float(np.sum(error[part] ** 2)), int(part.sum())] for angle, error in errors.items()
            }
    return found


def by_speed(results: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Range of speeds → angle → RMS over all rides that reach it, deg."""
    rows: dict[str, dict[str, float]] = {}
    for low, high in BINS:
        name = f"{low:g}–{high:g} m/s"
        parts = [each["speeds"][name] for each in results if name in each["speeds"]]
        if parts:
            rows[name] = {
                angle: float(np.sqrt(sum(part[angle][0] for part in parts) / sum(part[angle][1] for part in parts)))
                for angle in parts[0]
            }
    return rows


def speed_claims(rows: Mapping[str, Mapping[str, float]]) -> list[Claim]:
    """Whether errors depend on speed: against the published error, and by less than a factor.

    The paper gives no measure. A factor of an error of a tenth of a degree says little of a method that errs by four.
    """
    ratios = {
        angle: max(row[angle] for row in rows.values()) / min(row[angle] for row in rows.values()) for angle in SHOWN
    }
    spans = {
        angle: (max(row[angle] for row in rows.values()) - min(row[angle] for row in rows.values()))
        / leading(TABLE_III["outdoor"][angle])
        for angle in STATES
    }
    whole = {name: float(np.sqrt(np.mean([row[angle] ** 2 for angle in STATES]))) for name, row in rows.items()}
    return [
        Claim.every(
            "Insensitive to speed: no error changes by more than half of its size in table III",
            spans,
            0.5,
            "of the published error",
        ),
        Claim.every("Insensitive to speed: roll and trunk change by less than a factor of two", ratios, 2.0, "times"),
        Claim.less(
            "Insensitive to speed: all angles together change by less than a factor of 1.5",
            max(whole.values()),
            min(whole.values()),
            factor=1.5,
            names=("worst speed", "best speed"),
        ),
    ]
