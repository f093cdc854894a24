"""Statistics of a recording: clock, rest, noise and bias at rest, gravity, magnetic field, reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .plausibility.readings import clipped_share
from .plausibility.sites import seen, sites
from .trajectory import Trajectory

REST_WINDOW = 1.0
"""s: rest is found in windows of this length."""
REST_RATE, REST_FORCE = 0.02, 0.15
"""rad/s and m/s²: standard deviations below which a window is rest, unless a sensor is noisier at its quietest."""
SLOWEST_TURN = 0.25
"""rad/s: mean rate up to which a steady gyroscope shows a bias rather than a motion."""
LIKELY_BIAS, CERTAIN_REST = 0.035, 3.0
"""rad/s, and s of rest: a shorter rest with a larger rate than this, unlike the whole recording's, is a steady turn."""


@dataclass(frozen=True)
class Inspection:
    """Numbers of one recording, ready to be tables.

    Attributes:
        clock: property → text.
        channels: one row per channel.
        sensors: one row per sensor.
        rest: sensor → ``(T,)`` bool, samples at rest.
    """

    clock: dict[str, str]
    channels: list[dict[str, Any]]
    sensors: list[dict[str, Any]]
    rest: dict[str, np.ndarray]


def inspect_recording(trajectory: Trajectory) -> Inspection:
    """Describe a recording without checks (see :func:`poise.check_recording`)."""
    rest = {site: at_rest(trajectory, site) for site in sites(trajectory)}
    channels = [channel_row(name, values, trajectory.time) for name, values in trajectory.measurements.items()]
    sensors = [sensor_row(trajectory, site, rest[site]) for site in rest]
    return Inspection(clock_rows(trajectory), channels, sensors, rest)


def clock_rows(trajectory: Trajectory) -> dict[str, str]:
    """Format, duration, rate, jitter, gaps, reference."""
    time = trajectory.time
    rows = {
        "name": trajectory.name,
        "format": str(trajectory.metadata.get("format", "poise trajectory")),
        "samples": str(len(trajectory)),
        "duration": f"{time[-1] - time[0]:.2f} s",
    }
    try:
        clock = trajectory.clock
    except ValueError as reason:
        rows["rate"] = f"unknown: {reason}"
    else:
        grid = int(clock.index[-1]) + 1
        rows["rate"] = f"{1.0 / clock.interval:.4g} Hz"
        rows["jitter of the stamps"] = f"{1e3 * clock.jitter:.3g} ms RMS"
        rows["missing rows"] = f"{clock.missing} of {grid} ({100.0 * clock.missing / grid:.2g} %)"
        if clock.packets:
            rows["packets"] = f"{clock.packets} stamps are shared by several samples"
    unused = trajectory.metadata.get("columns_not_used")
    if isinstance(unused, list) and unused:
        more = f" and {len(unused) - 8} more" if len(unused) > 8 else ""
        rows["columns not used"] = ", ".join(map(str, unused[:8])) + more
    step = np.diff(time)
    if len(step):
        rows["longest interval"] = f"{step.max():.4g} s, at {time[int(np.argmax(step))] - time[0]:.1f} s"
    if trajectory.truth:
        known = [f"{name} ({100.0 * np.isfinite(v).all(axis=1).mean():.0f} %)" for name, v in trajectory.truth.items()]
        rows["truth"] = ", ".join(known[:6]) + (f" and {len(known) - 6} more" if len(known) > 6 else "")
        rows["scored"] = f"{100.0 * trajectory.mask.mean():.0f} % of the samples"
    offset = trajectory.metadata.get("reference_clock_offset")
    if isinstance(offset, int | float):
        rows["reference clock"] = f"{1e3 * abs(offset):.2f} ms {'ahead of' if offset > 0 else 'behind'} the gyroscope"
    return rows


def channel_row(name: str, values: np.ndarray, time: np.ndarray) -> dict[str, Any]:
    """Presence, own rate, range and clipping of one channel."""
    present = np.isfinite(values).all(axis=1)
    row: dict[str, Any] = {"channel": name, "axes": values.shape[1], "present %": 100.0 * float(present.mean())}
    if present.sum() > 1:
        stamps = time[present]
        row["Hz"] = (len(stamps) - 1) / float(stamps[-1] - stamps[0]) if stamps[-1] > stamps[0] else float("nan")
        row |= {"lowest": float(values[present].min()), "highest": float(values[present].max())}
        if not name.endswith("orientation"):
            row["clipped %"] = 100.0 * clipped_share(values[present])
    return row


def at_rest(trajectory: Trajectory, site: str) -> np.ndarray:
    """Samples ``(T,)`` at which a sensor rests, found in windows of a second."""
    gyr, acc = seen(trajectory, f"{site}/gyr"), seen(trajectory, f"{site}/acc")
    resting = np.zeros(len(trajectory), bool)
    if gyr is None and acc is None:
        return resting
    interval = float(np.median(np.diff(trajectory.time))) if len(trajectory) > 1 else 0.0
    length = max(10, round(REST_WINDOW / interval)) if interval > 0.0 else 10
    count = len(trajectory) // length
    if count == 0:
        return resting
    quiet = np.ones(count, bool)
    for values, limit, centre in ((gyr, REST_RATE, SLOWEST_TURN), (acc, REST_FORCE, np.inf)):
        if values is None:
            continue
        windows = values[: count * length].reshape(count, length, 3)
        known = np.isfinite(windows).all(axis=(1, 2))
        spread = np.where(known, windows.std(axis=1).max(axis=1), np.inf)
        mean = np.where(known, np.linalg.norm(windows.mean(axis=1), axis=1), np.inf)
        least = float(spread[np.isfinite(spread)].min(initial=np.inf))
        # A noisy sensor rests where it is quiet for its own standard, if that is not motion already.
        quiet &= (spread < max(limit, min(1.5 * least, 3.0 * limit))) & (mean < centre)
    resting[: count * length] = np.repeat(quiet, length)
    if gyr is not None and resting.any() and resting.sum() * interval < CERTAIN_REST - 0.5 * REST_WINDOW:
        rate, usual = np.nanmedian(gyr[resting], axis=0), np.nanmedian(gyr, axis=0)
        if min(np.linalg.norm(rate), np.linalg.norm(rate - usual)) > LIKELY_BIAS:
            resting[:] = False
    return resting


def sensor_row(trajectory: Trajectory, site: str, rest: np.ndarray) -> dict[str, Any]:
    """Rest, noise and bias at rest, gravity, magnetic field of one sensor."""
    gyr, acc, mag = (seen(trajectory, f"{site}/{kind}") for kind in ("gyr", "acc", "mag"))
    row: dict[str, Any] = {"sensor": site, "rest %": 100.0 * float(rest.mean())}
    if gyr is not None:
        row["turns °/s RMS"] = float(np.degrees(np.sqrt(np.nanmean(np.square(gyr).sum(axis=1)))))
        if rest.any():
            row["bias °/s"] = float(np.degrees(np.linalg.norm(np.nanmedian(gyr[rest], axis=0))))
            row["noise °/s"] = float(np.degrees(quiet_noise(gyr, rest)))
    if acc is not None:
        length = np.linalg.norm(acc, axis=1)
        row["|acc| m/s²"] = float(np.nanmedian(length))
        if rest.any():
            row["|acc| at rest"] = float(np.nanmedian(length[rest]))
            row["noise m/s²"] = quiet_noise(acc, rest)
    if mag is not None:
        length = np.linalg.norm(mag, axis=1)
        row["|mag|"] = float(np.nanmedian(length))
        row["|mag| varies %"] = 100.0 * float(np.nanstd(length) / np.nanmedian(length))
        if acc is not None:
            row["dip °"] = dip(acc, mag)
    return row


def quiet_noise(values: np.ndarray, rest: np.ndarray) -> float:
    """Standard deviation of a sample at rest, from differences of neighbours, so that slow changes do not count."""
    step = np.diff(values, axis=0)[rest[1:] & rest[:-1]]
    return float(np.sqrt(np.nanmedian(np.nanvar(step, axis=0)) / 2.0)) if len(step) else float("nan")


def dip(acc: np.ndarray, mag: np.ndarray) -> float:
    """Angle in deg by which the magnetic field points below the horizon; negative south of the equator."""
    with np.errstate(invalid="ignore", divide="ignore"):
        up = (acc * mag).sum(axis=1) / (np.linalg.norm(acc, axis=1) * np.linalg.norm(mag, axis=1))
    return float(-np.degrees(np.arcsin(np.clip(np.nanmedian(up), -1.0, 1.0))))
