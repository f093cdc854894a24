"""The delay of an accelerometer relative to the gyroscope beside it, from the innovations of a whole recording.

The low-pass filters inside of inertial sensors delay their samples by milliseconds, not both by the same. While a hand
turns and accelerates, a force that is turned into the world by an attitude of another time has a mean that no motion
explains: at 10 rad/s and 10 m/s², one millisecond makes 0.1 m/s², or 0.6° of tilt.

The innovations of a filter are smallest at the right delay. With their squares J(l) summed over sections of the
recording, one step of Newton's method gives the delay. The scatter of the sections gives its deviation, whatever the
size and the correlation of the innovations (H. White, "Maximum likelihood estimation of misspecified models",
Econometrica 50(1), 1982):

    l = − Σ J' / Σ J'',   s² = Σ (J' + l J'')² / (Σ J'')²

The filter that gives the innovations runs on samples merged to its own correction interval (:func:`merged`), over the
liveliest :data:`LONGEST` seconds, so that the search costs a third of the smoothing or less.

A delay is believed as far as it is more certain than what was known before, zero ± ``PRIOR``. One beyond ``LARGEST`` is
not a delay: something else, such as a wrong scale, makes the innovations smaller there. Both bounds are those of the
filters inside of sensors. The register maps of the MPU-6050 (RM-MPU-6000A, register 26) and MPU-9250 (RM-MPU-9250A,
registers 26 and 29) list the delays of both sensors for each of seven bandwidths: at the same setting they differ by
0.8 ms rms and 1.0 ms at most, at settings next to each other between 20 and 100 Hz by 5 ms at most.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..core.rotation import cross

STEP = 1e-3
"""s: the innovations are compared at delays of minus this, zero and this."""
PRIOR = 1e-3
"""s"""
LARGEST = 5e-3
"""s"""
LONGEST = 240.0
"""s of a recording that are looked at; the delay is the device's, not the motion's"""
SECTION = 5.0
"""s: length of a section; longer than the innovations are correlated"""


def relative_delay(before: np.ndarray, now: np.ndarray, after: np.ndarray, dt: float) -> float:
    """The delay in seconds, from innovations squared ``(T, *batch)`` at delays of −``STEP``, 0 and ``STEP``.

    All sequences of a batch are of one device. It is zero if the recording is shorter than three sections or tells
    nothing.
    """
    length = round(SECTION / dt)
    count = len(now) // length
    if count < 3:
        return 0.0
    sections = (np.nan_to_num(part[: count * length]).reshape(count, length, -1) for part in (before, now, after))
    low, middle, high = (section.sum(axis=1).ravel() for section in sections)
    slope, curvature = (high - low) / 2.0, low - 2.0 * middle + high
    total = float(curvature.sum())
    if not total > 0.0:
        return 0.0
    steps = -float(slope.sum()) / total
    scatter = float(np.sum((slope + steps * curvature) ** 2)) / total**2
    delay = STEP * steps
    return delay / (1.0 + scatter * (STEP / PRIOR) ** 2) if abs(delay) < LARGEST else 0.0


def merged(measurements: Mapping[str, Any], interval: float, dt: float) -> tuple[dict[str, np.ndarray], float]:
    """Liveliest stretch of a recording with whole numbers of samples merged to one, and the interval of these in s.

    The specific force of a merged sample is the mean in the attitude of its middle, to first order in the rotation.

    Args:
        measurements: ``imu/gyr`` and ``imu/acc``, ``(T, *batch, 3)``, rad/s and m/s², NaN where there is no sample.
        interval: wanted, s.
        dt: given, s.
    """
    together = max(1, round(interval / dt))
    count = len(measurements["imu/gyr"]) // together
    rate, force = (
        np.asarray(measurements[name], dtype=float)[: count * together].reshape(
            count, together, *np.shape(measurements[name])[1:]
        )
        for name in ("imu/gyr", "imu/acc")
    )
    force = np.where(force.any(axis=-1, keepdims=True), force, np.nan)
    from_middle = dt * (np.arange(together) - 0.5 * (together - 1))
    rate, moment = rate.mean(axis=1), np.tensordot(from_middle, force, (0, 1)) / together
    force = force.mean(axis=1) + cross(rate, moment)
    length = round(LONGEST / (together * dt))
    if count > length:
        lively = np.nan_to_num(np.square(cross(rate, force))).reshape(count, -1).sum(axis=1)
        total = np.concatenate([[0.0], np.cumsum(lively)])
        start = int(np.argmax(total[length:] - total[:-length]))
        rate, force = rate[start : start + length], force[start : start + length]
    return {"imu/gyr": rate, "imu/acc": force}, together * dt
