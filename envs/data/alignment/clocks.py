"""Clocks of several devices that move together: offset and drift from their angular rates, in any orientation.

The length of the angular rate is the same for all gyroscopes on one rigid body, whatever their axes. Its
cross-correlation finds the offset; windows along the recordings find how it grows. The offset of a window is refined
to a fraction of a sample by a parabola through the three largest values of the correlation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..trajectory import Trajectory

RATE = 200.0
"""Hz of the common grid on which rates are compared."""
WINDOW = 20.0
"""s: length of a window."""
LEAST_TURNING = 0.1
"""rad/s: standard deviation of the rate below which a window tells nothing."""
LEAST_CORRELATION = 0.6
"""Windows whose best correlation is lower are of devices that do not move together."""


@dataclass(frozen=True)
class ClockAlignment:
    """How one clock runs against another: ``time of the reference = offset + (1 + drift) · own time``.

    Attributes:
        offset: s.
        drift: s/s; 0 where one window alone could be compared.
        residual: s, RMS of the windows about the line.
        correlation: mean over the windows; 1 for devices that turn exactly alike.
        windows: how many.
    """

    offset: float
    drift: float
    residual: float
    correlation: float
    windows: int

    def apply(self, trajectory: Trajectory) -> Trajectory:
        """The same samples with times of the reference's clock."""
        details = {"offset": self.offset, "drift": self.drift}
        return trajectory.replace(
            time=self.offset + (1.0 + self.drift) * trajectory.time,
            metadata={**trajectory.metadata, "clock_alignment": details},
        )


def align_clocks(
    trajectory: Trajectory, reference: Trajectory, *, site: str = "imu", reference_site: str = "imu", most: float = 60.0
) -> ClockAlignment:
    """Find the clock of one device relative to another that moves with it.

    Args:
        trajectory: of the device whose clock is sought.
        reference: of the other device.
        site: whose gyroscope (``site/gyr``) is compared.
        reference_site: the same of the reference.
        most: s, largest offset that is looked for.

    Raises:
        ValueError: no such gyroscope, recordings that do not overlap long enough, no motion, or devices that do not
            turn alike.
    """
    from scipy.stats import theilslopes

    grids = [rate_on_grid(one, name) for one, name in ((trajectory, site), (reference, reference_site))]
    (start, own), (other_start, other) = grids
    if min(len(own), len(other)) < 2.0 * RATE:
        raise ValueError(
            f"both recordings must last 2 s at least, got {len(own) / RATE:.1f} s and {len(other) / RATE:.1f} s"
        )
    lag, quality = best_lag(own, other, round(most * RATE))
    coarse = round(lag)
    if quality < LEAST_CORRELATION:
        raise ValueError(
            f"{trajectory.name!r} and {reference.name!r} do not turn alike within {most:g} s: the largest "
            f"correlation of their angular rates is {quality:.2f}, at least {LEAST_CORRELATION} is needed"
        )
    found = []
    width = min(round(WINDOW * RATE), len(own))
    for begin in range(0, len(own) - width + 1, width // 2):
        part = own[begin : begin + width]
        near = begin + coarse  # where the window lies in the reference
        margin = round(RATE)
        if part.std() < LEAST_TURNING or near - margin < 0 or near + width + margin > len(other):
            continue
        lag, value = best_lag(part, other[near - margin : near + width + margin], 2 * margin, inside=True)
        if value >= LEAST_CORRELATION:
            middle = start + (begin + 0.5 * width) / RATE
            found.append((middle, other_start - start + (coarse - margin + lag) / RATE, value))
    if not found:
        lag, value = best_lag(own, other, round(most * RATE))
        return ClockAlignment(float(other_start - start + lag / RATE), 0.0, float("nan"), value, 1)
    time, shift, value = np.array(found).T
    if len(found) < 3:
        return ClockAlignment(float(shift.mean()), 0.0, float(shift.std()), float(value.mean()), len(found))
    # the median of slopes between points, so that a wrong window does not count
    drift, offset, *_ = theilslopes(shift, time)
    residual = float(np.sqrt(np.mean((shift - offset - drift * time) ** 2)))
    return ClockAlignment(float(offset), float(drift), residual, float(value.mean()), len(found))


def rate_on_grid(trajectory: Trajectory, site: str) -> tuple[float, np.ndarray]:
    """Start in s and length of the angular rate, rad/s, on the common grid; gaps are bridged by a line."""
    name = f"{site}/gyr"
    if name not in trajectory.measurements:
        there = [channel for channel in trajectory.measurements if channel.endswith("/gyr")]
        raise ValueError(f"{trajectory.name!r} has no channel {name}; gyroscopes there: {', '.join(there) or 'none'}")
    length = np.linalg.norm(trajectory.measurements[name], axis=1)
    known = np.isfinite(length)
    if known.sum() < 2:
        raise ValueError(f"{trajectory.name!r} has no valid sample in {name}")
    time = trajectory.time[known]
    # A sample is the mean of the interval that it ends.
    middle = time - 0.5 * float(np.median(np.diff(time)))
    grid = middle[0] + np.arange(int((middle[-1] - middle[0]) * RATE) + 1) / RATE
    return float(middle[0]), np.interp(grid, middle, length[known])


def best_lag(own: np.ndarray, other: np.ndarray, most: int, *, inside: bool = False) -> tuple[float, float]:
    """Samples by which ``own`` lies behind the start of ``other``, with a fraction, and the correlation there.

    Args:
        own: ``(n,)``.
        other: ``(m,)``.
        most: largest lag.
        inside: whether ``own`` must lie inside ``other``; else at least half of the shorter one overlaps.
    """
    from scipy.signal import correlate

    def sums(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
        return np.asarray(correlate(values, weight, "full", "fft"))

    # correlate(other, own)[k] = Σ other[i + lag] own[i] with lag = k - (n - 1)
    n, m = len(own), len(other)
    ones, others = np.ones(n), np.ones(m)
    count = np.round(sums(others, ones))
    mean, other_mean = sums(others, own) / np.maximum(count, 1), sums(other, ones) / np.maximum(count, 1)
    covariance = sums(other, own) - count * mean * other_mean
    variance = (sums(others, own**2) - count * mean**2) * (sums(other**2, ones) - count * other_mean**2)
    correlation = covariance / np.sqrt(np.maximum(variance, 1e-12))
    lag = np.arange(len(correlation)) - (n - 1)
    allowed = (lag >= 0) & (lag <= m - n) if inside else (count >= 0.5 * min(n, m)) & (np.abs(lag) <= most)
    if not allowed.any():
        return 0.0, -1.0
    peak = int(np.argmax(np.where(allowed, correlation, -np.inf)))
    fraction = 0.0
    if 0 < peak < len(correlation) - 1:
        left, top, right = correlation[peak - 1 : peak + 2]
        bend = left - 2.0 * top + right
        fraction = float(np.clip(0.5 * (left - right) / bend, -0.5, 0.5)) if bend < 0.0 else 0.0
    return float(lag[peak] + fraction), float(correlation[peak])


def merged(trajectories: Mapping[str, Trajectory], rate: float | None = None) -> Trajectory:
    """Devices on one clock as one trajectory with a site each: ``trunk/gyr``, ``bicycle/gyr``.

    Args:
        trajectories: site → trajectory with the channels ``imu/…`` and times of one clock
        (:meth:`ClockAlignment.apply`).
        rate: Hz of the result; None for the slowest device's.

    Raises:
        ValueError: fewer than two devices, or no time that all share.
    """
    if len(trajectories) < 2:
        raise ValueError(f"merged needs two devices at least, got {list(trajectories)}")
    chosen = rate or min(1.0 / one.dt for one in trajectories.values())
    begin = max(one.time[0] for one in trajectories.values())
    end = min(one.time[-1] for one in trajectories.values())
    count = int(np.floor((end - begin) * chosen)) + 1
    if count < 2:
        raise ValueError(f"the devices share no time: the last starts at {begin:.3f} s, the first ends at {end:.3f} s")
    grid = begin + np.arange(count) / chosen
    measurements = {}
    for site, one in trajectories.items():
        moved = one.on_grid()
        # start each on the same instant, then on the common rate: integrals of rate and force are preserved
        late = int(np.searchsorted(moved.time, begin - 1e-9))
        part = moved[max(late - 1, 0) :].resampled(chosen)
        for name, values in part.measurements.items():
            nearest = np.clip(np.searchsorted(part.time, grid - 0.5 / chosen), 0, len(part) - 1)
            measurements[f"{site}/{name.rpartition('/')[2]}"] = values[nearest]
    names = " + ".join(one.name for one in trajectories.values())
    return Trajectory(grid, measurements, {}, metadata={"name": names, "sites": list(trajectories)})
