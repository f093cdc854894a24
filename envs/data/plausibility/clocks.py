"""Plausibility of the clock of a recording: unit of time, gaps, lost rows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..trajectory import Trajectory
from .rate_consistency import rate_consistency
from .readings import Finding, Severity
from .sites import seen, sites

PLAUSIBLE_RATES = (5.0, 10_000.0)
"""Hz."""
SLOW_RATE, UNUSUAL_RATE = 20.0, 2000.0
"""Hz, slower than what motion needs and faster than what nearly all recorders write."""


def check_clock(trajectory: Trajectory) -> Iterator[Finding]:
    """Unit of time, gaps."""
    if len(trajectory) < 2:
        what = "a single sample"
        yield Finding("warning", "time", what, "a recording that was cut off", "Estimators need a sequence of samples.")
        return
    step = np.diff(trajectory.time)
    try:
        interval = trajectory.dt
    except ValueError as reason:
        remedy = "Name the device's nominal rate, or cut the recording."
        what = str(reason).removeprefix(f"{trajectory.name}: ")
        yield Finding("warning", "time", what, "stamps of arrival, or of several recordings", remedy)
        return
    rate = 1.0 / interval
    if trajectory.contradicted_rate:
        cause = "a recording that was thinned out, or another sensor's rate"
        yield Finding("note", "time", trajectory.contradicted_rate, cause, "The stamps are believed.")
    if rate < PLAUSIBLE_RATES[0]:
        whole = bool(np.all(np.abs(step - np.round(step)) < 1e-6 * interval))
        units = {"sample numbers": 1.0} if whole and interval == 1.0 else {}
        units |= {"ms": 1e3, "µs": 1e6, "ns": 1e9}
        fitting = [unit for unit, scale in units.items() if unit == "sample numbers" or 15 <= scale * rate <= 4000]
        cause = f"time in {' or '.join(fitting)}" if fitting else "a recording that is too slow for inertial sensors"
        remedy = "Give time in seconds." if fitting else "Inertial estimates need 20 Hz or more."
        yield Finding("warning", "time", f"{interval:.4g} s between samples ({rate:.3g} Hz)", cause, remedy)
    elif rate > PLAUSIBLE_RATES[1]:
        what = f"{rate:.3g} Hz"
        yield Finding("warning", "time", what, "time in minutes, days or another unit", "Give time in seconds.")
    else:
        if rate < SLOW_RATE:
            cause = "a recording that was thinned out, or a sensor's slow mode"
            yield Finding("note", "time", f"{rate:.3g} Hz", cause, "Motion needs 20 Hz or more; 50 Hz if it is fast.")
        if rate > UNUSUAL_RATE:
            cause = f"time in minutes (in seconds that would be {rate / 60.0:.4g} Hz)"
            severity: Severity = "warning" if in_minutes(trajectory) else "note"
            remedy = "Give time in seconds, unless the sensor is so fast."
            yield Finding(severity, "time", f"{rate:.4g} Hz", cause, remedy)
        long = step[step > 1.0]
        if len(long):
            what = f"{len(long)} gaps of more than 1 s, the longest {long.max():.1f} s"
            remedy = "Estimators predict through gaps; cut the recording if the motion in them matters."
            yield Finding("note", "time", what, "lost rows, or a paused recorder", remedy)
        lost = 1.0 - len(trajectory) * interval / (trajectory.time[-1] - trajectory.time[0] + interval)
        if lost > 0.05 and not len(long):
            remedy = "They are treated as missing samples."
            yield Finding("note", "time", f"{100 * lost:.0f} % of the rows are missing", "lost packets", remedy)


def in_minutes(trajectory: Trajectory) -> bool:
    """Whether the rates turn gravity as it moves if the time is read as minutes."""
    for site in sites(trajectory):
        gyr, acc = seen(trajectory, f"{site}/gyr"), seen(trajectory, f"{site}/acc")
        if gyr is not None and acc is not None:
            found = rate_consistency(60.0 * trajectory.time, gyr, acc)
            return found is not None and found.confirmed
    return False
