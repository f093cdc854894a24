"""Colours of figures."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from poise.baselines.plots import PALETTE, TRUTH_COLOR, time_figure

SEEN_BY = {
    "everybody": np.eye(3),
    "protanopes": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopes": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
    "tritanopes": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
}
"""G. M. Machado, M. M. Oliveira, L. A. F. Fernandes, 2009: linear RGB → linear RGB as such people see it."""
XYZ = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]


def lab(colour: str, seen: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of a colour #rrggbb."""
    share = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    ratio = XYZ @ np.clip(seen @ linear, 0.0, 1.0) / [0.95047, 1.0, 1.08883]
    x, y, z = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16.0 / 116.0)
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


@pytest.mark.parametrize("who", SEEN_BY)
def test_colours_are_told_apart(who: str) -> None:
    """ΔE*ab of 15 is seen at a glance; 2 is the least that is seen side by side."""
    assert TRUTH_COLOR == "black"
    seen = {colour: lab(colour, np.asarray(SEEN_BY[who])) for colour in (*PALETTE, "#000000")}
    for one, other in combinations(seen, 2):
        assert np.linalg.norm(seen[one] - seen[other]) > 15.0, (one, other)


def test_the_lowest_axes_of_a_figure_over_time_say_so() -> None:
    labels = [ax.get_xlabel() for ax in time_figure(4.0, 3.0, 2, 2)[1]]
    assert labels == ["", "", "time, s", "time, s"]
