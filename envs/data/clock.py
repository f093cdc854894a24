"""The clock of a recording: the uniform sampling grid behind the time stamps of a device.

Stamps are rounded, jitter, come in packets and have gaps; the sensor behind them samples at a constant rate. That rate
is a fit of time over the sample's number on the grid, not a median of intervals: stamps rounded to milliseconds at
286 Hz have intervals of 3 and 4 ms only. A phase-locked loop finds the grid point next to every stamp; where these do
not increase (a computer that stamped some samples late), isotonic regression finds the nearest ones that do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

EXACT = 1e-6
"""Intervals that differ by no more than this part are those of an exact grid."""
PHASE_GAIN = 0.05
RATE_GAIN = 0.25 * PHASE_GAIN**2
"""Gains of the loop per sample: a time constant of twenty samples, critically damped."""
RATE_RANGE = 0.1
"""The loop follows the interval by no more than this part."""
FAR = 20
"""Number of missing samples after which the loop takes the phase of the next stamp, as after a restart."""
LOCKED = 0.245
"""Root mean square deviation from the loop's phase, in intervals, up to which stamps have a sampling rate; that of
random stamps is 0.29."""
WELL_LOCKED = 0.15
"""The same, below which no better interval is looked for."""
LARGEST_SHIFT = 3.0
"""Intervals by which samples are typically moved at most, so that they fit a nominal rate."""
MILLISECOND = 1e-3
RESOLUTIONS = (1.0, 0.1, 0.01, MILLISECOND)
"""s to which loggers round their stamps."""
SHARED = 0.03
"""Least share of samples with the stamp of the one before: fewer are rows that were written twice."""
MANY, COARSEST = 100, 20.0
"""Samples of one stamp, and s between stamps, of which a rate cannot be told."""
LONGEST_GAP = 600.0
"""s; an interruption beyond it separates two recordings."""
USUAL_RATES: tuple[float, ...] = (25, 30, 50, 52, 60, 62.5, 64, 75, 80, 100, 104, 119, 120, 125, 128, 143, 150, 200)
USUAL_RATES += (208, 225, 238, 240, 250, 256, 285.7, 300, 333.3, 400, 416, 440, 476, 480, 500, 512, 562.5, 600)
"""Hz; rates at which sensors are sampled."""
SLOWEST, FASTEST = 0.25, 2e-5
"""Intervals in s between which inertial sensors are sampled."""


@dataclass(frozen=True)
class Clock:
    """Samples on a uniform grid."""

    interval: float
    """s between grid points"""
    start: float
    """s, time of grid point 0"""
    index: np.ndarray
    """``(T,)`` grid point of every sample, strictly increasing from 0"""
    jitter: float
    """s, root mean square of stamp minus grid point"""
    packets: int
    """stamps that several samples share"""

    @property
    def missing(self) -> int:
        """Grid points without a sample."""
        return int(self.index[-1]) + 1 - len(self.index)

    @property
    def exact(self) -> bool:
        """Whether the stamps are the grid."""
        return self.jitter == 0.0 and self.missing == 0


def fit_clock(time: np.ndarray, nominal_rate: float | None = None) -> Clock:
    """Find the grid behind time stamps.

    Args:
        time: ``(T,)`` s, not decreasing, at least two different stamps.
        nominal_rate: Hz, as the device's header names it; its grid is used where stamps fit to it.

    Raises:
        ValueError: no constant sampling rate explains the stamps, or a gap is so long that it separates recordings.
    """
    steps = np.diff(time)
    gap = int(np.argmax(steps))
    if steps[gap] > LONGEST_GAP and steps[gap] > 1000.0 * np.median(steps) > 0.0:
        raise ValueError(
            f"a gap of {steps[gap]:.0f} s before sample {gap + 1} separates two recordings; cut them apart, "
            f"[:{gap + 1}] and [{gap + 1}:]"
        )
    regular = exact_clock(time, steps, nominal_rate) or coarse_clock(time, steps, nominal_rate)
    if regular is not None:
        return regular
    stamps, counts = packets(time, steps)
    if len(stamps) < 2:
        raise ValueError(f"all {len(time)} samples share one stamp, {time[0]:g} s: name the sampling rate instead")
    if nominal_rate is None and counts.max() > MANY and (len(stamps) < 4 or np.median(np.diff(stamps)) > COARSEST):
        raise ValueError(
            f"{len(time)} samples share {len(stamps)} stamps, {np.median(np.diff(stamps)):.4g} s apart, too coarse to "
            "tell a rate; name the device's nominal rate (metadata['nominal_rate'], Hz)"
        )
    fits = []
    if nominal_rate is not None:
        nominal = 1.0 / nominal_rate
        position, interval, spread, shift = locked(stamps, counts, nominal)
        if spread > LOCKED:
            interval = nominal
            position, shift = numbered(np.rint((stamps - stamps[0]) / nominal), counts)
        if shift < LARGEST_SHIFT and abs(interval / nominal - 1.0) < RATE_RANGE:
            fits.append((0.0, position, interval))
    for candidates in likely_intervals(stamps, counts) if not fits else ():
        for candidate in candidates:
            position, interval, spread, shift = locked(stamps, counts, candidate)
            fits.append((spread + max(0.0, shift - 0.5), position, interval))
        if min(spread for spread, _, _ in fits) < WELL_LOCKED:
            break
    # What fits to an interval fits to its fractions too, and to shorter ones if most samples may be missing: of those
    # that fit alike the longest, and of multiples also one that fits a little less.
    least = min(spread for spread, _, _ in fits)
    best = max((fit for fit in fits if fit[0] <= least + 0.03), key=lambda fit: fit[2])
    multiples = [fit for fit in fits if fit[2] > 1.4 * best[2] and fit[0] <= best[0] + 0.1]
    spread, position, interval = max(multiples, key=lambda fit: fit[2], default=best)
    if spread > LOCKED:
        raise ValueError(
            f"no sampling rate explains the time stamps: intervals range from {np.quantile(steps, 0.05):.4g} s to "
            f"{np.quantile(steps, 0.95):.4g} s; name the device's nominal rate (metadata['nominal_rate'], Hz) or "
            "resample with trajectory.resampled(rate)"
        )
    if position[-1] > 20 * len(time) + 100_000:
        raise ValueError(
            f"{len(time)} samples at {1.0 / interval:.4g} Hz lie within {time[-1] - time[0]:.0f} s: more than 95 % are "
            "missing"
        )
    # The samples of a packet end at its stamp.
    index = np.repeat(position - counts, counts) + within(counts) + 1
    index -= index[0]
    residual = time - interval * index
    last = np.cumsum(counts) - 1
    start = float(np.mean(residual[last]))
    jitter = float(np.sqrt(np.mean((residual[last] - start) ** 2)))
    return Clock(interval, start, index, jitter, int((counts > 1).sum()))


def exact_clock(time: np.ndarray, steps: np.ndarray, nominal_rate: float | None) -> Clock | None:
    """The clock of stamps on an exact grid, or of stamps that jitter less than half an interval; else None."""
    index, median = np.arange(len(time)), float(np.median(steps))
    if median <= 0.0:
        return None
    if nominal_rate is not None and abs(median * nominal_rate - 1.0) > RATE_RANGE:
        return None
    resolution = 4.0 * np.spacing(np.abs(time[[0, -1]]).max())
    deviation = np.abs(steps - median).max()
    if deviation <= EXACT * median:
        return Clock(median, float(time[0]), index, 0.0, 0)
    interval, start, residual = line(index, time)
    largest_residual, largest_step = 0.45 * interval, 1.5 * median + resolution
    if interval < 1.6 * MILLISECOND and np.abs(time / MILLISECOND - np.rint(time / MILLISECOND)).max() < 1e-3:
        # Stamps in whole milliseconds of a faster sensor, several with the same stamp.
        largest_residual, largest_step = max(largest_residual, 0.5 * MILLISECOND + 0.1 * interval), 2.001 * MILLISECOND
    # One lost sample moves part of the stamps by half an interval from every line.
    if np.abs(residual).max() > largest_residual or steps.max() > largest_step:
        return None
    jitter = max(float(np.sqrt(np.mean(residual**2))), np.finfo(float).tiny)
    return Clock(interval, start, index, jitter, 0)


def coarse_clock(time: np.ndarray, steps: np.ndarray, nominal_rate: float | None) -> Clock | None:
    """The clock of stamps that are rounded to more than an interval, so that several samples share one; else None.

    Between gaps such stamps lie within half their resolution from a line.
    """
    tolerance = 4.0 * np.spacing(np.abs(time[[0, -1]]).max())
    whole = (r for r in RESOLUTIONS if np.abs(time - r * np.rint(time / r)).max() <= 1e-6 * r + tolerance)
    resolution = next(whole, None)
    if resolution is None or np.mean(steps < 0.5 * resolution) < SHARED:
        return None
    gaps = np.flatnonzero(steps > 1.5 * resolution)
    parts = np.split(np.arange(len(time)), gaps + 1)
    last = np.append(steps > 0.0, False)
    weight, slope = 0.0, 0.0
    for part in parts:
        # The last samples of stamps; that of the last stamp may be missing.
        ends = part[:-1][last[part[:-1]]]
        if len(ends) > 1:
            k = ends - ends.mean()
            weight, slope = weight + float(k @ k), slope + float(k @ time[ends])
    interval = slope / weight if weight > 0.0 else 0.0
    if not 0.0 < interval < resolution or (
        nominal_rate is not None and abs(interval * nominal_rate - 1.0) > RATE_RANGE
    ):
        return None
    index, residuals = np.arange(len(time)), []
    for before, part in zip([None, *parts[:-1]], parts, strict=True):
        begin = float((time[part] - interval * (part - part[0])).mean())
        residuals.append(time[part] - interval * (part - part[0]) - begin)
        if before is None:
            start = begin
        else:
            index[part] = part - part[0] + max(index[before[-1]] + 1, round((begin - start) / interval))
    residual = np.concatenate(residuals)
    # The line of few steps leans by a part of one.
    ticks = max(1.0, (time[-1] - time[0]) / resolution)
    if np.abs(residual).max() > (0.5 + 2.0 / ticks) * resolution + 0.1 * interval + tolerance:
        return None
    shared = int((np.unique(time, return_counts=True)[1] > 1).sum())
    return Clock(interval, start, index, float(np.sqrt(np.mean(residual**2))), shared)


def packets(time: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stamps ``(P,)`` of packets, that of their last samples, and their numbers of samples ``(P,)``."""
    last = np.flatnonzero(np.append(steps > packet_limit(steps), True))
    return time[last], np.diff(np.concatenate([[-1], last]))


def packet_limit(steps: np.ndarray) -> float:
    """Step in s up to which two samples belong to one packet.

    Packets make steps of two kinds, tiny ones within and long ones between. A sensor with several gaps does too, but
    its short steps are all alike.
    """
    ordered = np.sort(np.maximum(steps, 1e-9))
    low, high = int(0.4 * len(steps)), len(steps) - max(2, int(np.ceil(0.003 * len(steps))))
    if high > low:
        ratios = ordered[low + 1 : high + 1] / ordered[low:high]
        split = low + int(np.argmax(ratios))
        within_packets = ordered[: split + 1]
        smallest, largest = np.quantile(within_packets, [0.1, 0.9])
        if ordered[split + 1] > 5.0 * ordered[split] and not (smallest > 1e-4 and largest < 1.5 * smallest):
            return float(np.sqrt(ordered[split] * ordered[split + 1]))
    return 0.1 * float(np.median(steps))


def likely_intervals(stamps: np.ndarray, counts: np.ndarray) -> Iterator[list[float]]:
    """Candidates in s: the mean of the steps near their median; what divides most steps; what devices usually have.

    The second are for recordings that lack most samples. The third are for coarse stamps: in whole milliseconds a
    sensor at 512 Hz looks like one at 500 Hz.
    """
    steps, counts = np.diff(stamps), counts[1:]
    each = steps / counts
    usual = float(np.median(each))
    near = (each < 1.5 * usual) & (each > 0.5 * usual)
    yield [float(steps[near].sum() / counts[near].sum()) if near.any() else usual]
    shortest = 0.6 * max(float(np.quantile(each, 0.05)), 0.05 * usual)
    intervals = np.geomspace(1.2 * usual, min(shortest, usual), 600)
    in_milliseconds = np.abs(stamps / MILLISECOND - np.rint(stamps / MILLISECOND)).max() < 1e-3
    # Everything in whole milliseconds is divided by the millisecond.
    intervals = intervals[intervals > 1.3 * MILLISECOND] if in_milliseconds else intervals
    resultant = np.array([np.abs(np.exp(2j * np.pi / interval * steps[:3000]).mean()) for interval in intervals])
    peaks = np.flatnonzero((resultant[1:-1] > resultant[:-2]) & (resultant[1:-1] >= resultant[2:])) + 1
    yield [float(intervals[peak]) for peak in peaks[np.argsort(-resultant[peaks])][:4]]
    yield [1.0 / rate for rate in USUAL_RATES if len(intervals) and intervals[-1] < 1.0 / rate < intervals[0]]


def locked(stamps: np.ndarray, counts: np.ndarray, interval: float) -> tuple[np.ndarray, float, float, float]:
    """Number packets by the loop until the interval stands.

    Returns:
        Grid point ``(P,)`` of every packet's last sample; the interval in s; the root mean square deviation of stamps
        from the loop's phase, and the typical distance of a packet from the grid point next to its stamp, in intervals.
    """
    phase = float(stamps[0])
    for _ in range(4):
        nearest, deviations = follow(stamps, interval, phase)
        position, shift = numbered(nearest, counts)
        before, (interval, _, residual) = interval, line(position, stamps)
        trusted = np.abs(residual) <= 4.0 * np.median(np.abs(residual)) + 1e-12
        if trusted.sum() > 2:
            interval = line(position[trusted], stamps[trusted])[0]
        # The first stamp jitters like all others: the loop starts in the phase of the first fifty.
        early = slice(0, 50)
        phase = float(np.median(stamps[early] - interval * (position[early] - position[0])))
        if abs(interval / before - 1.0) < 1e-4 and abs(phase - stamps[0]) < 0.1 * interval:
            break
    return position, interval, float(np.sqrt(np.mean(deviations**2))), shift


def numbered(nearest: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, float]:
    """Grid points of packets next to the wanted ones that leave room for all samples, and their typical distance."""
    from scipy.optimize import isotonic_regression

    # Between two packets lie as many grid points as the second has samples, or more: the excess must not decrease.
    excess = isotonic_regression((nearest - np.cumsum(counts)).astype(float)).x
    position = np.rint(excess).astype(int) + np.cumsum(counts)
    return position - position[0] + counts[0] - 1, float(np.median(np.abs(position - nearest)))


def follow(stamps: np.ndarray, interval: float, phase: float) -> tuple[np.ndarray, np.ndarray]:
    """One pass of the loop; the grid point next to every stamp, and its deviation in intervals."""
    slowest, fastest = interval * (1.0 + RATE_RANGE), interval * (1.0 - RATE_RANGE)
    position = 0
    positions, deviations = [], []
    for stamp in stamps.tolist():
        ahead = (stamp - phase) / interval
        step = round(ahead)
        deviation = ahead - step
        position += step
        if step > FAR:
            phase, deviation = stamp, 0.0
        else:
            phase += interval * (step + PHASE_GAIN * deviation)
            interval = min(slowest, max(fastest, interval * (1.0 + RATE_GAIN * deviation)))
        positions.append(position)
        deviations.append(deviation)
    return np.array(positions), np.array(deviations)


def line(index: np.ndarray, time: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Slope, value at 0 and residuals ``(N,)`` of the least-squares line of time over index."""
    k, t = index - index.mean(), time - time.mean()
    slope = float(k @ t / (k @ k))
    return slope, float(time.mean() - slope * index.mean()), t - slope * k


def too_coarse(time: np.ndarray, clock: Clock) -> bool:
    """Whether stamps in whole milliseconds leave open which samples of a fast sensor are missing."""
    coarse = np.abs(time / MILLISECOND - np.rint(time / MILLISECOND)).max() < 1e-3
    return bool(coarse and clock.interval < 2.5 * MILLISECOND and clock.missing > 0.02 * len(time))


def within(counts: np.ndarray) -> np.ndarray:
    """0, 1, … within every group: ``(sum of counts,)``."""
    return np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)


def check_interval(interval: float, time: np.ndarray) -> None:
    """Check that an interval is plausible for an inertial sensor.

    Raises:
        ValueError: names the unit in which the stamps would be plausible.
    """
    if FASTEST <= interval <= SLOWEST:
        return
    units = {"ms": 1e-3, "µs": 1e-6, "ns": 1e-9, "minutes": 60.0, "hours": 3600.0, "days": 86400.0}
    likely = [
        f"{name} (that would be {1.0 / (interval * unit):.4g} Hz)"
        for name, unit in units.items()
        if 1.0 / 5000.0 <= interval * unit <= 1.0 / SLOWEST / 20.0
    ]
    if np.all(time == np.rint(time)) and np.median(np.diff(time)) == 1.0:
        likely.insert(0, "sample numbers (divide them by the sampling rate)")
    raise ValueError(
        f"time must be in s, but its samples are {interval:.4g} s apart ({1.0 / interval:.4g} Hz), which no inertial "
        f"sensor is: {'it seems to be in ' + ' or '.join(likely) if likely else 'check its unit'}; from "
        f"{1.0 / SLOWEST:g} to {1.0 / FASTEST:g} Hz are accepted"
    )
