"""Plausibility of the reference of a recording: its clock, and stretches in which it stands still."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..repeats import HELD
from ..trajectory import Trajectory
from .readings import Finding, Severity
from .sites import seen

LARGE_OFFSET = 0.01
"""s by which a reference may be late before it decides about errors."""
FROZEN = 0.2
"""rad that a gyroscope turns while a reference stands still."""


def check_reference(trajectory: Trajectory) -> Iterator[Finding]:
    """Offset of the clock of the reference, if known."""
    offset = trajectory.metadata.get("reference_clock_offset")
    if isinstance(offset, int | float) and abs(offset) > 1e-3:
        what = f"the reference is {1e3 * abs(offset):.1f} ms {'ahead of' if offset > 0.0 else 'behind'} the gyroscope"
        remedy = "Evaluate with the reference clock corrected as well."
        severity: Severity = "warning" if abs(offset) > LARGE_OFFSET else "note"
        yield Finding(severity, "orientation", what, "two clocks that were not synchronised", remedy)


def check_frozen(trajectory: Trajectory) -> Iterator[Finding]:
    """Stretches in which the reference repeats one orientation while the gyroscope turns."""
    q, gyr = trajectory.truth.get("orientation"), seen(trajectory, "imu/gyr")
    if q is None or gyr is None or len(q) < 3:
        return
    begins = np.flatnonzero(np.append(True, ~(q[1:] == q[:-1]).all(axis=1)))
    ends = np.append(begins[1:], len(q))
    seconds = np.linalg.norm(np.nan_to_num(gyr), axis=1) * np.gradient(trajectory.time)
    turned = np.add.reduceat(seconds, begins)
    frozen = (trajectory.time[ends - 1] - trajectory.time[begins] > HELD) & (turned > FROZEN)
    if frozen.any():
        share = 100.0 * float((ends - begins)[frozen].sum()) / len(q)
        what = (
            f"{share:.3g} % of it repeat one orientation, while the gyroscope turns by {turned[frozen].max():.2g} rad"
        )
        cause = "a tracking system that lost its markers and repeats the last value"
        yield Finding("warning", "orientation", what, cause, "Replace the repeated rows by NaN.")
