"""Whether recordings lie inside what a recipe simulates: each statistic against the 5 to 95 % range of episodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.recipes.hand import HandRecipe
from ....envs.recipes.recipe import Recipe
from ....envs.recipes.registry import recipe
from ....envs.recipes.rider import RiderRecipe
from ..kit import Study
from .motion import SHARE_OF_RATE, UNITS, motion_spectra, statistics_of
from .spectra import Spectrum

LOW, HIGH = 5.0, 95.0
"""Percentiles of the simulated episodes between which a recorded value is inside"""
DRAWN = np.geomspace(0.1, 100.0, 61)
"""Hz, edges of the bands in which spectra are averaged for figures"""


class Summary(NamedTuple):
    """One sensor's motion in numbers.

    Attributes:
        name: of the trajectory.
        rate: Hz.
        statistics: bandwidth (Hz) → statistic → value.
        spectra: ``gyr``, ``force``, ``acc`` → mean density in the bands of :data:`DRAWN`, NaN in bands without a line.
        fell: whether it is a ride that ended in a fall.
    """

    name: str
    rate: float
    statistics: dict[float, dict[str, float]]
    spectra: dict[str, list[float]]
    fell: bool = False


def summary(trajectory: Trajectory, site: str, bandwidths: Sequence[float], orientation: str) -> Summary:
    """Statistics of one sensor at several bandwidths (Hz), and its spectra in bands.

    The smallest bandwidth that the sampling rate allows stands for those beyond. ``orientation`` names the sensor's
    truth.
    """
    spectra = motion_spectra(trajectory, site, orientation=orientation)
    own = SHARE_OF_RATE * spectra.rate
    found = {each: statistics_of(spectra, min(each, own)) for each in bandwidths}
    fell = trajectory.metadata.get("ended") == "terminated"
    known = {"gyr": spectra.gyr, "force": spectra.force, "acc": spectra.acc}
    bands = {name: banded(each).tolist() for name, each in known.items() if each is not None}
    return Summary(trajectory.name, spectra.rate, found, bands, fell)


def banded(spectrum: Spectrum) -> np.ndarray:
    """Mean density in each band of :data:`DRAWN`; NaN in a band without a line."""
    place = np.searchsorted(DRAWN, spectrum.frequency, side="right") - 1
    inside = (place >= 0) & (place < len(DRAWN) - 1)
    total = np.bincount(place[inside], spectrum.density[inside], len(DRAWN) - 1)
    count = np.bincount(place[inside], minlength=len(DRAWN) - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return total / count


def episode_summary(
    described: Mapping[str, Any], seed: int, index: int, sites: Sequence[str], bandwidths: Sequence[float]
) -> list[dict[str, Any]]:
    """Simulate one episode of a described recipe and summarise it site by site, for :meth:`.Study.map`."""
    episode = recipe(described).episode(seed, index)
    found = [summary(episode, site, bandwidths, "orientation" if site == "imu" else "") for site in sites]
    return [one._asdict() | {"statistics": [one.statistics[each] for each in bandwidths]} for one in found]


def simulated_summaries(
    study: Study,
    made: Recipe,
    episodes: int,
    sites: Sequence[str],
    bandwidths: Sequence[float],
    rate: float | None = None,
) -> dict[str, list[Summary]]:
    """Site → summaries of the first episodes of a recipe, computed once a run folder; riders carry these sensors alone.

    ``rate`` (Hz) of all episodes of a hand keeps the ``bandwidths`` (Hz) of recordings within theirs; None: the
    recipe's.
    """
    if rate is not None and isinstance(made, HandRecipe):
        made = replace(made, rates=(rate, rate))
    if isinstance(made, RiderRecipe):
        made = replace(made, suite=tuple(f"{site}/{kind}" for site in sites for kind in ("gyr", "acc")))
    seed = study.seed_of("realism", made.name)
    jobs = [(made.describe(), seed, index, tuple(sites), tuple(bandwidths)) for index in range(episodes)]
    found = study.map(f"episodes of {made.name} at {', '.join(sites)}", episode_summary, jobs)
    read = [
        [Summary(**(each | {"statistics": dict(zip(bandwidths, each["statistics"], strict=True))})) for each in episode]
        for episode in found
    ]
    return {site: [episode[index] for episode in read] for index, site in enumerate(sites)}


def ranges(summaries: Sequence[Summary], bandwidth: float) -> dict[str, tuple[float, float, float]]:
    """Statistic → 5 %, median and 95 % of the simulated episodes; NaN where none knows it."""
    found = {}
    for name in UNITS:
        values = np.array([each.statistics[bandwidth][name] for each in summaries], dtype=float)
        values = values[np.isfinite(values)]
        quantiles = np.percentile(values, [LOW, 50.0, HIGH]) if len(values) else np.full(3, np.nan)
        found[name] = (float(quantiles[0]), float(quantiles[1]), float(quantiles[2]))
    return found


def totals(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """How many values of :func:`containment_rows` are inside, and the statistics of which one is not."""
    inside, count = (sum(int(row["inside"].split("/")[part]) for row in rows) for part in (0, 1))
    outside = [row["statistic"] for row in rows if row["outside"] != "none"]
    return {"inside": f"{inside}/{count}", "outside in": ", ".join(outside) or "none"}


def containment_rows(recorded: Sequence[Summary], simulated: Sequence[Summary]) -> list[dict[str, Any]]:
    """One row a statistic: the simulated range, the recorded values, and which recordings lie outside.

    Every recording is compared at its own, only bandwidth; the range shown is that at the widest one.
    """
    by_width = {width: ranges(simulated, width) for each in recorded for width in each.statistics}
    widest = by_width[max(by_width)]
    rows = []
    for name, unit in UNITS.items():
        low, middle, high = widest[name]
        values, outside = [], []
        for each in recorded:
            ((width, statistics),) = each.statistics.items()
            value = statistics[name]
            if np.isfinite(value):
                values.append(value)
                least, _, most = by_width[width][name]
                if not least <= value <= most:
                    outside.append(f"{each.name} ({value:.3g} {'below' if value < least else 'above'})")
        if not values:
            continue
        rows.append(
            {
                "statistic": name,
                "unit": unit,
                "simulated 5 %": low,
                "median": middle,
                "95 %": high,
                "recorded from": min(values),
                "to": max(values),
                "inside": f"{len(values) - len(outside)}/{len(values)}",
                "outside": ", ".join(outside) or "none",
            }
        )
    return rows
