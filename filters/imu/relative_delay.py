"""The delay of an accelerometer relative to the gyroscope beside it, from the innovations of a whole recording.

The low-pass filters inside of inertial sensors delay their samples by milliseconds, not both by the same. While a hand
turns and accelerates, a force that is turned into the world by an attitude of another time has a mean that no motion
explains: at 10 rad/s and 10 m/s², one millisecond makes 0.1 m/s², or 0.6° of tilt.

The innovations of a filter are smallest at the right delay. With their squares J(l) summed over sections of the
recording, one step of Newton's method gives the delay. The scatter of the sections gives its deviation, whatever the
size and the correlation of the innovations (H. White, "Maximum likelihood estimation of misspecified models",
Econometrica 50(1), 1982):

    l = − Σ J' / Σ J'',   s² = Σ (J' + l J'')² / (Σ J'')²

A delay is believed as far as it is more certain than what was known before, zero ± ``PRIOR``. One beyond ``LARGEST`` is
not a delay: something else, such as a wrong scale, makes the innovations smaller there.
"""

from __future__ import annotations

import numpy as np

STEP = 1e-3
"""s: the innovations are compared at delays of minus this, zero and this."""
PRIOR = 1e-3
"""s; chosen on simulated gestures without delay and on RepoIMU, as is the next"""
LARGEST = 5e-3
"""s"""
SECTION = 5.0
"""s: length of a section; longer than the innovations are correlated"""


def relative_delay(before: np.ndarray, now: np.ndarray, after: np.ndarray, dt: float) -> float:
    """The delay in seconds, from innovations squared at delays of −``STEP``, 0 and ``STEP``.

    Args:
        before: ``(T, *batch)``, NaN where there is none; all sequences of a batch are of one device.
        now: likewise.
        after: likewise.
        dt: sampling interval, s.

    Returns:
        Zero if the recording is shorter than three sections or tells nothing.
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
