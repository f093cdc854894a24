"""Front end of a network that chooses among several headings which one filter of nine axes finds.

A magnetometer shows north where the field is that of the Earth; near iron and magnets the gyroscope keeps the heading
better, for as long as its bias is known. Here the filter runs with its published constants and, beside them, with other
noises of the magnetometer: the headings of the others are **candidates**, from one that follows the field sooner to one
that keeps the heading of the gyroscope for ten times as long. What the network sees of them, of the field and of the
motion depends neither on the heading nor on the side to which candidates differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ....filters.core.backend import Array, namespace
from ....filters.core.quantity import Estimate
from ....filters.imu.magnetic_heading import heading_between
from .filter_bank import FilterBank
from .gravity_aligned_frame import SCALARS, VECTORS

GAINS = ("process", "heading")
"""of bounded-motion-rest-9"""
TUNINGS = ((1.0, 0.3), (1.0, 3.0), (1.0, 10.0))
"""Factors on the deviations σ_g of the gyroscope and σ_m of the magnetic heading, one row a candidate; the last one has
the longest memory, and the sides of the others are told from it."""
FIELD = 4
"""Features of the magnetic field (:class:`.filter_frame.FieldFrame`)."""
SMALL = 0.01
"""rad: a smaller difference hardly has a side"""


@dataclass(frozen=True)
class HeadingBank(FilterBank):
    """The level frame of a filter of nine axes, and the headings that the same filter finds with other gains.

    Features: of the vectors of :class:`.gravity_aligned_frame.GravityAlignedFrame` the vertical parts and the lengths
    of the horizontal ones; its scalars, the filter's deviation of tilt, those of the field
    (:class:`.filter_frame.FieldFrame`); of the candidates the size of their difference from the filter, and whether
    they lie on the same side as the last one. All are of the order of one.

    ``spread`` holds the deviation of tilt (1) and the candidates (K, rad): by how much their heading differs.
    """

    tunings: tuple[tuple[float, ...], ...] = TUNINGS
    gains: tuple[str, ...] = GAINS

    kind: ClassVar[str] = "heading-bank"

    @property
    def size(self) -> int:
        """Number of features."""
        return 2 * VECTORS + SCALARS + 1 + FIELD + 2 * len(self.tunings)

    def _candidates(self, orientation: Array, others: Estimate) -> Array:
        """Headings ``(..., K)`` of the others less that of the filter, rad."""
        return heading_between(others.pose["orientation"], orientation[..., None, :])[..., 0]

    def _features(self, motion: Array, candidates: Array, sigma: Array) -> Array:
        """Features of the level frame, and of candidates ``(..., K)``, in terms that depend on no heading."""
        xp = namespace(motion)
        vectors = xp.reshape(motion[..., : 3 * VECTORS], (*tuple(motion.shape[:-1]), VECTORS, 3))
        length = xp.sqrt(xp.sum(vectors[..., :2] ** 2, axis=-1) + 1e-6)
        size = xp.abs(candidates)
        side = candidates / (size + SMALL)
        scalars, field = motion[..., 3 * VECTORS : -FIELD], motion[..., -FIELD:]
        told = [
            *(xp.clip(vectors[..., 2], -3.0, 3.0), xp.log(length) / 3.0 + 0.3, scalars),
            *(xp.tanh(4.0 * field[..., :2]), field[..., 2:]),
            *(xp.log(size + 0.003) / 2.0 + 2.0, side * side[..., -1:]),
        ]
        return xp.concat(told, axis=-1)
