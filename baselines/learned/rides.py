"""Training data of networks for riders: sequences of rides (:mod:`poise.envs.recipes.rides`).

Most of what such a network corrects is constant in a ride and differs from ride to ride: alignment, zeros, lengths of
limbs. So every ride is used several times, each with another draw of errors and half of them with left and right
exchanged; without that, networks memorise the few draws.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.recipes.rides import SETTLED, RideSource, drawn, held_out
from ...filters.support.parallel import in_parallel
from .data import SequenceData, sequence_of
from .head import Head
from .inputs.front_end import FrontEnd

UNSEEN: Mapping[str, Mapping[str, Any]] = {
    "unseen riders": {},
    "other scenarios": {"scenarios": ("bumps", "pitch", "slow")},
    "aggressive riders": {"styles": ("aggressive",)},
}
"""Groups of test rides, none of whose riders is trained on: how their recipe differs from that of the training."""


def unseen_rides(source: RideSource, seed: int, group: str, first: int = 0) -> Iterator[tuple[int, int, Trajectory]]:
    """Test rides of a group that are long enough: number of the ride, number of the draw, and the drawn ride.

    Args:
        source: as in training; how many rides and draws.
        seed: root seed of test data.
        group: of :data:`UNSEEN`.
        first: number of the first ride.
    """
    own, root = held_out(source, **UNSEEN[group]), seed + list(UNSEEN).index(group)
    for index in range(first, own.rides):
        draws = drawn(own, root, index)
        if float(draws[0].time[-1]) >= 2.0 * SETTLED:
            yield from ((index, number, each) for number, each in enumerate(draws))


def ride_data(
    source: RideSource, seed: int, front_end: FrontEnd, head: Head, *, processes: int = 1, label: str = ""
) -> SequenceData:
    """Sequences of all draws on all rides; a ride of less than twice :data:`SETTLED` seconds is left out.

    Args:
        source: which rides.
        seed: root seed.
        front_end: what the network sees.
        head: what it should say.
        processes: how many ride at a time; the numbers do not depend on it.
        label: words before a progress bar; empty for none.

    Raises:
        ValueError: no ride is long enough.
    """
    jobs = [(source, seed, index, front_end, head) for index in range(source.rides)]
    done: dict[int, list[tuple[np.ndarray, ...]]] = dict(
        in_parallel(ride_sequences, jobs, processes, label=label, unit="ride")
    )
    parts = [part for index in range(source.rides) for part in done[index]]
    if not parts:
        raise ValueError(f"none of the {source.rides} rides lasts {2.0 * SETTLED:g} s: the riders fell")
    names = [f"ride-{seed}-{index}" for index in range(source.rides) for _ in done[index]]
    return SequenceData.joined(parts, names)


def ride_sequences(
    source: RideSource, seed: int, index: int, front_end: FrontEnd, head: Head
) -> tuple[int, list[tuple[np.ndarray, ...]]]:
    """The index, and the sequences of one ride's draws, for parallel processes."""
    draws = drawn(source, seed, index)
    if float(draws[0].time[-1]) < 2.0 * SETTLED:
        return index, []
    return index, [sequence_of(each, front_end, head) for each in draws]
