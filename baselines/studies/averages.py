"""Errors in windows of time, and means over rides, as columns and rows of tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ...filters.support.rows import cell


def windowed(
    errors: Mapping[str, np.ndarray],
    time: np.ndarray,
    begin: float,
    end: float = np.inf,
    statistic: Callable[[np.ndarray], float] | None = None,
) -> dict[str, float]:
    """RMS (or another statistic) of each column between two times, both included; NaN where a ride is too short."""
    part = (time >= begin) & (time <= end)
    statistic = statistic or rms
    return {name: float(statistic(error[part])) if part.any() else float("nan") for name, error in errors.items()}


def rms(values: np.ndarray) -> float:
    """Root mean square of all values."""
    return float(np.sqrt(np.mean(values**2)))


def largest(values: np.ndarray) -> float:
    """Largest size."""
    return float(np.abs(values).max())


def circular_mean(angles: np.ndarray) -> np.ndarray:
    """Mean ``(K,)`` of angles ``(N, K)``, rad."""
    return np.arctan2(np.sin(angles).mean(axis=0), np.cos(angles).mean(axis=0))


def mean_of(rows: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Mean of every column over rides; NaN is left out, and stays where nothing else is."""
    columns: dict[str, list[float]] = {}
    for row in rows:
        for name, value in row.items():
            columns.setdefault(name, []).append(float(value))
    return {name: mean(values) for name, values in columns.items()}


def mean(values: Iterable[float]) -> float:
    """Mean of what is known."""
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def rounded(row: Mapping[str, float], digits: int = 2) -> dict[str, float]:
    """Cells of a table."""
    return {name: round(value, digits) for name, value in row.items()}


def mean_rms(results: Iterable[Mapping[str, Any]], method: str, window: str = "settled") -> dict[str, float]:
    """Angle → mean over rides of a method's RMS error, deg."""
    return mean_of(each["rms"][method][window] for each in results)


def leading(published: str) -> float:
    """Mean of a published ``mean ± standard deviation``."""
    return float(published.replace("±", " ").split()[0])


def interval_of_mean(values: Sequence[float]) -> str:
    """Mean and its 95 % interval by Student's t, as text; a single value has no interval."""
    from scipy.stats import t

    found = np.asarray([value for value in values if np.isfinite(value)])
    if len(found) < 2:
        return cell(float(found.mean()), 2) if len(found) else "–"
    mean, half = float(found.mean()), float(t.ppf(0.975, len(found) - 1) * found.std(ddof=1) / np.sqrt(len(found)))
    return f"{cell(mean, 2)} ({cell(max(0.0, mean - half), 2)} … {cell(mean + half, 2)})"
