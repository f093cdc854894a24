"""Samples in a row that a recording shows to be none: they jump away and back at once.

An angular rate changes within the time in which a torque builds up: before a change by radians per second from one
sample to the next come smaller ones, and after it. In the recordings of BROAD, RepoIMU, EuRoC, smartphones, devices and
simulated gestures, shaking and running among them, no stretch comes near the bounds below.
"""

from __future__ import annotations

import numpy as np

LEAST = {"gyr": 1.0, "acc": 40.0}
"""rad/s and m/s² by which a burst jumps away and back."""
SHORTEST = {"gyr": 2, "acc": 4}
"""Samples; shorter ones of an accelerometer are knocks."""
SUDDEN = {"gyr": 4.0, "acc": 6.0}
"""The same, in steps of the samples before and after."""
LONGEST = {"gyr": 0.2, "acc": 0.1}
"""s; of an accelerometer less, as grips and steps look alike when they last longer."""
LARGEST = 1e100
"""Step as which a larger one counts."""
BESIDE = 8
"""Samples before and after, whose second largest step counts: one may be a part of the burst."""
RETURN = 0.5
"""Largest difference of the sample after from that before, as a share of the jump."""


def bursts(values: np.ndarray, kind: str, dt: float) -> np.ndarray:
    """Samples ``(T,)`` bool of ``(T, 3)`` that belong to a burst.

    There is none in a recording that is too slow to tell one from a motion.

    Args:
        values: on a grid, NaN where missing.
        kind: ``gyr`` or ``acc``.
        dt: s between samples.
    """
    found = np.zeros(len(values), bool)
    sudden, longest = SUDDEN[kind], round(LONGEST[kind] / dt)
    if len(values) <= 2 * BESIDE or longest <= SHORTEST[kind]:
        return found
    with np.errstate(invalid="ignore", over="ignore"):
        steps = np.minimum(np.nan_to_num(np.linalg.norm(np.diff(values, axis=0), axis=1)), LARGEST)
    large = np.flatnonzero(steps > LEAST[kind])
    large = large[(large >= BESIDE) & (large < len(steps) - BESIDE)]
    window = np.arange(BESIDE)
    before = np.sort(steps[large[:, None] - BESIDE + window], axis=1)
    after = np.sort(steps[large[:, None] + 1 + window], axis=1)[:, -2]
    ends = np.flatnonzero(steps[large] > sudden * after)
    last = 0
    for begin in np.flatnonzero(steps[large] > sudden * before[:, -2]):
        first = large[begin]
        if first < last:
            continue
        for end in ends[(large[ends] >= first + SHORTEST[kind]) & (large[ends] <= first + longest)][::-1]:
            calm, jump = max(before[begin, -2], after[end]), min(steps[first], steps[large[end]])
            apart = np.linalg.norm(values[large[end] + 1] - values[first])
            if jump > sudden * calm and apart < RETURN * jump:
                last = large[end]
                found[first + 1 - int(steps[first - 1] > sudden * before[begin, -2]) : last + 1] = True
                break
    return found
