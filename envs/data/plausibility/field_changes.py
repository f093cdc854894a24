"""Whether the magnetic field changes on the way and stays another: a magnet at the sensor, or another place.

The length of the field and its angle with the vertical (the dip) are those of the place. Windows of a recording, turned
into a frame that stands still by the integrated rates, give both; the vertical is their mean force, as the velocity of
what a person moves stays bounded. What comes and goes, as near iron, is left to the filters.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

from ....filters.core import rotation
from .integration import attitudes
from .readings import Finding

WINDOW, STEP = 1.5, 0.02
"""s of a window, and of the integration within it."""
FEWEST, MOST = 6, 400
"""Windows before and after a change; windows of a long recording, which are apart."""
LENGTH, DIP = 0.12, 10.0
"""Logarithm and degrees by which length and dip vary in a room: their units in what follows."""
SCATTER, SHARE = 2.0, 0.8
"""Bound of what counts as the same field, in deviations from the median that this share of one side keeps."""
SAME, OTHER, NEXT = 0.9, 0.85, 0.75
"""Share of the windows of one side within that bound, of the other side beyond it, and of those beside the change."""
WHOLE = 0.9
"""Length of the mean field of a window, in that of the samples, below which the rates do not turn it back."""
LARGE = 1.8
"""Median change: 22 % of the length or 18° of dip."""


def field_of_windows(gyr: np.ndarray, acc: np.ndarray, mag: np.ndarray, dt: float) -> tuple[np.ndarray, float]:
    """Length, dip in degrees, and how much of the length the mean keeps, of the field in windows; their distance in s.

    The first is ``(3, W)``, NaN where unknown.

    Args:
        gyr: ``(T, 3)`` rad/s on a grid, NaN where missing.
        acc: ``(T, 3)``.
        mag: ``(T, 3)``, any unit.
        dt: s between samples.
    """
    together = max(1, round(STEP / dt))
    step = together * dt
    length = max(1, round(WINDOW / step))
    count = len(gyr) // (together * length)
    apart = max(1, count // MOST)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        rate, force, field = (
            np.nanmean(values[: count * length * together].reshape(count, length, together, 3)[::apart], axis=2)
            for values in (gyr, acc, mag)
        )
        attitude = attitudes(step * np.nan_to_num(rate))
        up, north = (np.nanmean(rotation.rotate(attitude, values), axis=1) for values in (force, field))
        size = np.nanmean(np.linalg.norm(field, axis=2), axis=1)
        sine = np.sum(up * north, axis=1) / (np.linalg.norm(up, axis=1) * np.linalg.norm(north, axis=1))
        share = np.linalg.norm(north, axis=1) / size
    return np.stack([size, -np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))), share]), apart * length * step


def change_of(field: np.ndarray) -> int | None:
    """First window of a field ``(3, W)`` of :func:`field_of_windows` that is another for good, or None."""
    with np.errstate(divide="ignore", invalid="ignore"):
        values = np.stack([np.log(field[0]) / LENGTH, field[1] / DIP, field[2]], axis=1)
    places = np.flatnonzero(np.isfinite(values).all(axis=1))
    values, best, found = values[places], 0, None
    for backwards in (False, True):
        ordered = values[::-1] if backwards else values
        same, share = ordered[:, :2], ordered[:, 2]
        for border in range(FEWEST, len(same) - FEWEST):
            if np.median(share[:border]) < WHOLE:
                continue
            away = np.abs(same - np.median(same[:border], axis=0))
            bound = np.maximum(1.0, SCATTER * np.quantile(away[:border], SHARE, axis=0))
            beyond = (away > bound).any(axis=1)
            # The window of the change is on neither side.
            inside, outside = ~beyond[:border], beyond[border + 1 :]
            kept = min(inside.mean() / SAME, outside.mean() / OTHER, outside[:FEWEST].mean() / NEXT)
            score = int(inside.sum() + outside.sum())
            if kept >= 1.0 and score > best and np.median(away[border + 1 :].max(axis=1)) >= LARGE:
                best, found = score, int(places[len(same) - 1 - border if backwards else border])
    return found


def check_field_change(
    channel: str, time: np.ndarray, gyr: np.ndarray, acc: np.ndarray, mag: np.ndarray
) -> Iterator[Finding]:
    """A field that is another from some time on.

    Args:
        channel: of the magnetometer.
        time: ``(T,)`` s, a grid.
        gyr: ``(T, 3)`` rad/s, NaN where missing; likewise the others.
        acc: m/s².
        mag: any unit.
    """
    field, window = field_of_windows(gyr, acc, mag, float(np.median(np.diff(time))))
    place = change_of(field)
    if place is None:
        return
    length, dip, _ = field
    before, after = (
        f"{np.nanmedian(length[part]):.3g} with a dip of {np.nanmedian(dip[part]):.0f}°"
        for part in (slice(place), slice(place + 1, None))
    )
    what = f"the field is another from {time[0] + place * window:.0f} s on: {before} before, {after} after"
    cause = "a magnet or iron that was fixed to the sensor or taken off, or another place"
    remedy = "The headings before and after differ: cut the recording there, or leave the magnetometer out."
    yield Finding("warning", channel, what, cause, remedy)
