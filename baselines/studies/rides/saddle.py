"""What load cells say of the contact on the saddle: whether a cell pulls, and where the centre of pressure is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ....envs.bicycle.ride.contact_forces import LoadCells

SITTING = 50.0
"""N on the saddle, from which there is a centre of pressure"""
PULL = 5.0
"""N of tension of a cell that counts as a pull"""
ALONG, ACROSS = 130.0, 140.0
"""mm from the saddle point: a centre of pressure beyond is not on a saddle"""
APART = 15.0
"""mm between the mean centres of pressure of full and lumped riders"""


def saddle_statistics(cells: np.ndarray) -> dict[str, float]:
    """Pulls and centre of pressure of one ride on the published saddle.

    Args:
        cells: ``(T, 3)`` compression front, rear left, rear right, N.

    Returns:
        ``pulls``: % of the samples in which a cell is below −5 N; ``least``: N. The rider has left the saddle where it
        carries less than 50 N: ``lifted``, % of the samples. In all others, ``seated_pulls``: % of all samples in which
        a cell is below −5 N, ``seated_least``: N, and, of the centre of pressure ahead and to the left of the post in
        mm, the 5th and 95th percentiles ``along_5``, ``along_95``, ``across_5``, ``across_95``, and ``along_mean``,
        ``along_sd``, ``across_mean``, ``across_sd``; NaN for a rider who is never seated.
    """
    geometry = LoadCells()
    cells = cells[np.isfinite(cells).all(axis=1)]
    total = cells.sum(axis=1)
    loaded = total > SITTING
    place = 1e3 * cells[loaded] @ np.array([geometry.x, geometry.y]).T / total[loaded, None]
    pulled = (cells < -PULL).any(axis=1)
    found = {"pulls": 100.0 * float(pulled.mean()), "least": float(cells.min())}
    found |= {"lifted": 100.0 * float((~loaded).mean()), "seated_pulls": 100.0 * float((pulled & loaded).mean())}
    found["seated_least"] = float(cells[loaded].min()) if loaded.any() else float("nan")
    for index, axis in enumerate(("along", "across")):
        values = place[:, index] if loaded.any() else np.array([np.nan])
        low, high = np.percentile(values, [5.0, 95.0])
        found |= {f"{axis}_5": float(low), f"{axis}_95": float(high)}
        found |= {f"{axis}_mean": float(values.mean()), f"{axis}_sd": float(values.std())}
    return found


def worst_of(rides: Sequence[Mapping[str, float]], statistic: str) -> float:
    """Worst of several rides: the least force and the outermost centre of pressure, and the largest of the rest."""
    pick = min if statistic.endswith(("least", "_5")) else max
    return float(pick(each[statistic] for each in rides))


def saddle_rows(found: Mapping[str, Sequence[Mapping[str, float]]]) -> Iterator[dict[str, Any]]:
    """Rows of a table, worst of the rides of each scenario; ``found``: scenario → :func:`saddle_statistics`."""
    for name, rides in found.items():
        worst = {
            key: worst_of(rides, key)
            for key in ("lifted", "seated_pulls", "seated_least", "along_5", "along_95", "across_5", "across_95")
        }
        yield {
            "scenario": name,
            "off the saddle, %": worst["lifted"],
            "seated, a cell below -5 N, %": worst["seated_pulls"],
            "least N": worst["seated_least"],
            "CoP along mm": f"{worst['along_5']:.0f} … {worst['along_95']:.0f}",
            "CoP across mm": f"{worst['across_5']:.0f} … {worst['across_95']:.0f}",
            "mean along mm": f"{float(np.mean([each['along_mean'] for each in rides])):.0f}",
        }
