"""Whether the channels of a sensor are on one clock, and the gyroscope's scale: from how they turn together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .agreement import Agreement, agreement
from .readings import Finding, Severity

EXPLAINED, IN_STRONG_MOTION = 0.9, 0.6
"""Share of a direction's motion that rates must explain before their lag or scale is believed; and before a lag is that
explains much, where strong accelerations are the rest."""
LEAST_LAG = 0.015
"""s: filters of sensors delay by as much."""
LARGE_LAG, LATE_FIELD = 0.025, 0.05
"""s up to which a lag is told, and no more; the same of a late magnetometer: those of phones are 10 to 33 ms late."""
CERTAIN = 3.0
"""Standard errors beyond these bounds from which on there is a lag, or a wrong scale."""
QUIET, LITTLE, MUCH = 0.09, {"acc": 0.05, "mag": 0.2}, 0.5
"""Acceleration, as a share of gravity, up to which a lag is believed that explains little of what is left without it;
if there is more, a lag must explain much, as an acceleration in step with the rotation may look like one."""
SCALES = (0.45, 2.2)
"""Scales that a fit can tell; others are those of units."""
LEAST_SCALE = 0.08
"""Error of the scale of gyroscopes without calibration, and of the fit."""
UNDISTURBED = 0.99
"""Share of the motion of a magnetic field, as :data:`EXPLAINED`, from which on it tells a scale."""
ONE_LAG = 0.02
"""s by which two lags of one gyroscope may differ."""


def agreements(gyr: np.ndarray, vectors: dict[str, np.ndarray | None], interval: float) -> dict[str, Agreement]:
    """Fits of the rates ``(T, 3)`` to other channels ``(T, 3)``, by name, where there is one to be believed."""
    fits = {name: agreement(gyr, vector, interval) for name, vector in vectors.items() if vector is not None}
    known = {name: one for name, one in fits.items() if one is not None and SCALES[0] < one.scale < SCALES[1]}
    return {name: one for name, one in known.items() if one.explained > IN_STRONG_MOTION}


def is_sure(one: Agreement | None) -> bool:
    """Whether there is a fit that explains so much that its scale is believed, too."""
    return one is not None and one.explained > EXPLAINED


def is_late(kind: str, one: Agreement) -> bool:
    """Whether there is a lag for certain."""
    enough = LITTLE[kind] if one.left < QUIET and is_sure(one) else MUCH
    return abs(one.lag) - CERTAIN * one.lag_error > LEAST_LAG and one.explained_by_lag > enough


def check_lag(site: str, found: dict[str, Agreement]) -> Iterator[Finding]:
    """Lags between the channels of a sensor.

    Args:
        site: of the sensor.
        found: ``acc`` and ``mag`` → how the rates agree with it.
    """
    late = {kind: is_late(kind, one) for kind, one in found.items()}
    lags = [found[kind].lag for kind in found if late[kind]]
    if lags and len(lags) == len(found) and np.ptp(lags) < max(ONE_LAG, 0.2 * abs(lags[0])) and "acc" in found:
        others = " and the ".join({"acc": "accelerometer", "mag": "magnetometer"}[kind] for kind in found)
        yield finding(f"{site}/gyr", lags[0], f"the {others}")
    else:
        late_kinds = [kind for kind in found if late[kind]]
        yield from (finding(f"{site}/{kind}", -found[kind].lag, "the gyroscope") for kind in late_kinds)


def finding(channel: str, lag: float, other: str) -> Finding:
    """A lag in s of a channel, a warning beyond a large one."""
    severity: Severity = (
        "warning" if abs(lag) > (LATE_FIELD if channel.endswith("mag") and lag > 0.0 else LARGE_LAG) else "note"
    )
    cause = "streams with clocks of their own, rows that were shifted, or a filter of one of them"
    what = f"{1e3 * abs(lag):.0f} ms {'late' if lag > 0.0 else 'early'} against {other}"
    remedy = f"Move its stamps by {-lag:+.3f} s, or export the stamps of the sensors themselves."
    return Finding(severity, channel, what, cause, remedy)


def check_gyroscope_scale(site: str, found: dict[str, Agreement]) -> Iterator[Finding]:
    """Scale of the gyroscope against gravity, or against a field that fits it so well that it is undisturbed."""
    name, one = next(((kind, found[kind]) for kind in ("acc", "mag") if is_sure(found.get(kind))), ("", None))
    if one is None or (name == "mag" and one.explained < UNDISTURBED):
        return
    if abs(np.log(one.scale)) - CERTAIN * one.scale_error / one.scale < np.log1p(LEAST_SCALE):
        return
    what = f"turns {1.0 / one.scale:.2f} times as far as {'gravity' if name == 'acc' else 'the field'} does in its axes"
    cause = f"a wrong scale of the gyroscope, or a clock of {one.scale:.2f} times the rate"
    remedy = f"Multiply the rates by {one.scale:.3f}, or check the sampling rate."
    yield Finding("warning", f"{site}/gyr", what, cause, remedy)
