"""Sizes, masses and inertias of riders, scaled from published tables by stature and mass.

Source: P. de Leva, Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters, J. Biomech. 29 (1996), table 4
(young adults; mean stature 1.741 m, men, and 1.735 m, women). Radii of gyration are about the segment's sagittal
(forward), transverse (sideways) and longitudinal axis, in parts of its length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..frame.parameters import Mass


class SegmentTable(NamedTuple):
    """One row of the table for one sex."""

    mass: float
    """part of the body's mass"""
    length: float
    """m, of the mean person"""
    centre: float
    """part of the length, from the upper (proximal) end"""
    radii: tuple[float, float, float]
    """parts of the length: sagittal, transverse, longitudinal"""


MEN = {
    "head": SegmentTable(0.0694, 0.2033, 0.5976, (0.362, 0.376, 0.312)),
    "upper_trunk": SegmentTable(0.1596, 0.1707, 0.2999, (0.716, 0.454, 0.659)),
    "middle_trunk": SegmentTable(0.1633, 0.2155, 0.4502, (0.482, 0.383, 0.468)),
    "lower_trunk": SegmentTable(0.1117, 0.1457, 0.6115, (0.615, 0.551, 0.587)),
    "upper_arm": SegmentTable(0.0271, 0.2817, 0.5772, (0.285, 0.269, 0.158)),
    "forearm": SegmentTable(0.0162, 0.2689, 0.4574, (0.276, 0.265, 0.121)),
    "hand": SegmentTable(0.0061, 0.0862, 0.7900, (0.628, 0.513, 0.401)),
    "thigh": SegmentTable(0.1416, 0.4222, 0.4095, (0.329, 0.329, 0.149)),
    "shank": SegmentTable(0.0433, 0.4340, 0.4459, (0.255, 0.249, 0.103)),
    "foot": SegmentTable(0.0137, 0.2581, 0.4415, (0.257, 0.245, 0.124)),
}
WOMEN = {
    "head": SegmentTable(0.0668, 0.2002, 0.5894, (0.330, 0.359, 0.318)),
    "upper_trunk": SegmentTable(0.1545, 0.1425, 0.2077, (0.746, 0.502, 0.718)),
    "middle_trunk": SegmentTable(0.1465, 0.2053, 0.4512, (0.433, 0.354, 0.415)),
    "lower_trunk": SegmentTable(0.1247, 0.1815, 0.4920, (0.433, 0.402, 0.444)),
    "upper_arm": SegmentTable(0.0255, 0.2751, 0.5754, (0.278, 0.260, 0.148)),
    "forearm": SegmentTable(0.0138, 0.2643, 0.4559, (0.261, 0.257, 0.094)),
    "hand": SegmentTable(0.0056, 0.0780, 0.7474, (0.531, 0.454, 0.335)),
    "thigh": SegmentTable(0.1478, 0.3685, 0.3612, (0.369, 0.364, 0.162)),
    "shank": SegmentTable(0.0481, 0.4323, 0.4416, (0.271, 0.267, 0.093)),
    "foot": SegmentTable(0.0129, 0.2283, 0.4014, (0.299, 0.279, 0.139)),
}
MEAN_STATURE = {False: 1.741, True: 1.735}
"""m; True for women"""
VERTEX_ABOVE_SUPRASTERNALE = {False: 0.3143, True: 0.3292}
"""m: table 4, vertex to cervicale plus cervicale above suprasternale"""
VERTEX_ABOVE_CERVICALE = {False: 0.2429, True: 0.2437}
"""m: table 4, vertex to cervicale"""
STATURES, MASSES = (1.50, 1.95), (45.0, 110.0)
"""m and kg: of random riders"""
SHALLOWEST, HEAVIEST = (1.2, 2.3), (30.0, 200.0)
"""m and kg: outside these bounds the tables do not apply"""


class Segment(NamedTuple):
    """A body segment of one person, z along it upwards (towards the head or the proximal joint)."""

    mass: float
    """kg"""
    length: float
    """m"""
    centre: float
    """m from the upper (proximal) end"""
    moments: tuple[float, float, float]
    """kg·m² about the centre of mass: forward, sideways and long axis"""


@dataclass(frozen=True)
class RiderBody:
    """A person.

    Raises:
        ValueError: an impossible stature or mass, or combination of both.
    """

    stature: float = 1.76
    """m"""
    mass: float = 68.0
    """kg"""
    female: bool = False
    name: str = "rider"

    def __post_init__(self) -> None:
        if not SHALLOWEST[0] <= self.stature <= SHALLOWEST[1]:
            raise ValueError(f"stature must lie in {list(SHALLOWEST)} m, got {self.stature}")
        if not HEAVIEST[0] <= self.mass <= HEAVIEST[1]:
            raise ValueError(f"mass must lie in {list(HEAVIEST)} kg, got {self.mass}")
        if not 12.0 <= self.mass / self.stature**2 <= 50.0:
            raise ValueError(
                f"mass / stature² must lie in [12, 50] kg/m², got {self.mass} kg and {self.stature} m: impossible rider"
            )

    @property
    def scale(self) -> float:
        """Stature relative to that of the tables."""
        return self.stature / MEAN_STATURE[self.female]

    def segment(self, name: str) -> Segment:
        """A segment by its name in the tables.

        Raises:
            KeyError: there is none of that name.
        """
        row = (WOMEN if self.female else MEN)[name]
        mass, length = row.mass * self.mass, row.length * self.scale
        forward, sideways, along = (mass * (radius * length) ** 2 for radius in row.radii)
        return Segment(mass, length, row.centre * length, (forward, sideways, along))

    @property
    def vertex_height(self) -> float:
        """Top of the head above the suprasternal notch, m."""
        return VERTEX_ABOVE_SUPRASTERNALE[self.female] * self.scale

    @property
    def crown_height(self) -> float:
        """Top of the head above the cervicale, m."""
        return VERTEX_ABOVE_CERVICALE[self.female] * self.scale

    @property
    def shoulder_half_width(self) -> float:
        """From the middle to a shoulder joint, m: 0.129 of stature (Drillis and Contini) less 0.037 of acromion."""
        return 0.129 * self.stature - 0.037 * self.scale

    @property
    def hip_half_width(self) -> float:
        """From the middle to a hip joint, m; choice of this project after 0.17 m between hip joints."""
        return 0.085 * self.scale


SUBJECTS = (
    RiderBody(1.82, 80.0, name="subject 0"),
    RiderBody(1.79, 72.0, name="subject 1"),
    RiderBody(1.75, 66.0, name="subject 2"),
    RiderBody(1.76, 68.0, name="subject 3"),
    RiderBody(1.68, 54.0, female=True, name="subject 4"),
)
"""Five riders with the means and standard deviations of the papers' subjects: 176 ± 5 cm, 68 ± 10 kg, one female."""


def random_body(rng: np.random.Generator) -> RiderBody:
    """A random adult of 1.50 to 1.95 m and 45 to 110 kg, female or male with equal chance.

    Stature 1.65 ± 0.07 m (women) and 1.78 ± 0.075 m (men), body mass index 24 ± 3.5 kg/m², both drawn again where they
    leave these bounds: round figures of European adults.
    """
    female = bool(rng.random() < 0.5)
    middle, spread = (1.65, 0.07) if female else (1.78, 0.075)
    while True:
        stature = round(middle + spread * float(rng.standard_normal()), 3)
        mass = round((24.0 + 3.5 * float(rng.standard_normal())) * stature**2, 1)
        if STATURES[0] <= stature <= STATURES[1] and MASSES[0] <= mass <= MASSES[1] and mass / stature**2 >= 17.5:
            return RiderBody(stature, mass, female, "random rider")


def rider_body(subject: int | str | RiderBody, rng: np.random.Generator | None = None) -> RiderBody:
    """A person by number (0…4), as ``"random"`` (drawn from ``rng``), or as given.

    Raises:
        ValueError: there is no such subject, or a random one without ``rng``.
    """
    if isinstance(subject, RiderBody):
        return subject
    if subject == "random":
        if rng is None:
            raise ValueError("a random subject needs a generator")
        return random_body(rng)
    if isinstance(subject, (int, np.integer)) and not isinstance(subject, bool) and 0 <= subject < len(SUBJECTS):
        return SUBJECTS[int(subject)]
    raise ValueError(f"subject must be 0…{len(SUBJECTS) - 1}, 'random' or a RiderBody, got {subject!r}")


def hanging(segment: Segment, top: np.ndarray) -> Mass:
    """A segment that hangs from the point ``top`` along −z."""
    return Mass(segment.mass, top - np.array([0.0, 0.0, segment.centre]), np.diag(segment.moments))
