"""Spectra of simulated episodes and of recordings, one above the other."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...plots import AMBER, BLUE, GREEN, PINK, SKY, VERMILION, legend_above, new_figure
from .containment import DRAWN, HIGH, LOW, Summary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNITS = {"gyr": "angular rate, (rad/s)²/Hz", "acc": "acceleration, (m/s²)²/Hz", "force": "specific force, (m/s²)²/Hz"}
COLOURS = (VERMILION, GREEN, PINK, AMBER, SKY)


def spectra(simulated: Sequence[Summary], recorded: Mapping[str, Sequence[Summary]]) -> Figure:
    """Power spectral densities: range and median of the episodes, and every recording.

    Args:
        simulated: of one recipe and site.
        recorded: group → its recordings.
    """
    known = all("acc" in each.spectra for group in (simulated, *recorded.values()) for each in group)
    shown = ("gyr", "acc" if known else "force")
    figure, axes = new_figure(7.5, 6.5, rows=2)
    middle = np.sqrt(DRAWN[:-1] * DRAWN[1:])
    for ax, signal in zip(axes, shown, strict=True):
        densities = np.array([each.spectra[signal] for each in simulated], dtype=float)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            low, median, high = np.nanpercentile(densities, [LOW, 50.0, HIGH], axis=0)
        there = np.isfinite(median)
        name = f"simulated, {LOW:g} to {HIGH:g} % of {len(simulated)}"
        ax.fill_between(middle[there], low[there], high[there], color=BLUE, alpha=0.18, linewidth=0, label=name)
        ax.plot(middle[there], median[there], color=BLUE, linewidth=1.4, label="median")
        for index, (group, summaries) in enumerate(recorded.items()):
            for number, each in enumerate(summaries):
                density = np.array(each.spectra[signal], dtype=float)
                there = np.isfinite(density) & (middle < 0.5 * each.rate)
                colour = COLOURS[index % len(COLOURS)]
                label = group if number == 0 else None
                ax.plot(middle[there], density[there], color=colour, linewidth=0.8, alpha=0.8, label=label)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_ylabel(UNITS[signal])
        ax.yaxis.label.set_size(8.5)
    axes[-1].set_xlabel("frequency, Hz")
    legend_above(axes[0])
    figure.align_ylabels(axes)
    return figure
