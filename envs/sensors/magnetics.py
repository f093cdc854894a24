"""Magnetic fields as devices meet them: magnetised parts, iron in buildings, magnets, the frame of a bicycle.

:class:`Magnetics` has the parameters, :data:`MAGNETICS` named ones, and :class:`MagneticField` draws those of an
episode. The field at a sensor is that of the Earth, plus a smooth random field over position, plus those of dipoles
(fixed in the world, passing by, or along the tubes of a bicycle), changed by the iron of the device: S B + h in sensor
axes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from types import MappingProxyType
from typing import Self

import numpy as np

from ...filters.core import rotation
from ...filters.support.names import look_up
from ...filters.support.seeds import named_generator
from .ideal import BodyState

DIPOLE = 0.1
"""µT·m³ per A·m²: μ₀/4π"""
VACUUM = 0.4 * math.pi
"""µT·m per A: μ₀"""
MODES = 48
"""waves of the field over position"""
CLOSEST = 0.03
"""m: distance at which the field of a dipole stops growing, about the size of a magnet or tube"""
PASSING_TIME = 20.0
"""lengths of its closest distance over which a passing dipole is followed, before and after"""
BICYCLE = "bicycle"
"""body that bears the tubes"""
TUBES = (
    ((0.0, 0.0, 0.33), (0.43, 0.0, 0.28)),
    ((0.0, 0.0, 0.33), (0.24, 0.0, 0.75)),
    ((0.43, 0.0, 0.28), (0.24, 0.0, 0.75)),
    ((0.43, 0.0, 0.28), (0.83, 0.0, 0.65)),
    ((0.24, 0.0, 0.75), (0.80, 0.0, 0.80)),
)
"""ends of the tubes of a frame, m, bicycle axes: chain stay, seat stay, seat tube, down tube, top tube; assumed"""
SPACING = 0.04
"""m between the dipoles that stand for a tube"""
SECTION = 1e-4
"""m² of steel in the section of a tube: 32 mm wide, 1 mm thick"""
SUSCEPTIBILITY = 80.0
"""magnetisation along a tube per field in the air: limited by its ends, not by the steel; assumed"""
REMANENCE = 40.0
"""A/m: field in the air (50 µT) that would induce a magnetisation as large as the lasting one of a tube; assumed"""


@dataclass(frozen=True)
class Magnetics:
    """Magnetic disturbances; the defaults are none. Standard deviations are per axis and drawn once an episode.

    Raises:
        ValueError: a negative or not finite number, or a length or distance that is not positive.
    """

    hard_iron: float = 0.0
    """µT: standard deviation of the field of magnetised parts of the device, constant in its axes"""
    soft_iron: float = 0.0
    """1: standard deviation of the entries of the symmetric matrix by which its parts change the field"""
    variation: float = 0.0
    """µT: standard deviation over position of the field of everything around, per axis"""
    variation_length: float = 1.0
    """m: distance at which its correlation has fallen to exp(−1/2)"""
    magnets: int = 0
    """dipoles at rest within ``magnet_reach`` around the place of the first sample, in its outer 60 %"""
    magnet_moment: float = 1.0
    """A·m²: of each, in a random direction"""
    magnet_reach: float = 0.6
    """m"""
    passing_rate: float = 0.0
    """1/s: how often a dipole passes; at the same distance from all sensors"""
    passing_field: float = 10.0
    """µT: of a passing dipole at its closest, on its axis"""
    passing_distance: float = 0.5
    """m: closest distance"""
    passing_speed: float = 1.0
    """m/s"""
    attached_field: float = 0.0
    """µT: magnitude of the field of a magnet on the device, in a random direction of its axes"""
    frame: float = 0.0
    """1: magnetisation of the bicycle's tubes, 1 for steel"""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            positive = field.name in ("variation_length", "magnet_reach", "passing_distance", "passing_speed")
            if not (value > 0.0 if positive else value >= 0.0) or not value < math.inf:
                wanted = "positive" if positive else "not negative"
                raise ValueError(f"{field.name} must be {wanted} and finite, got {value}")

    @property
    def calm(self) -> bool:
        """Whether the field is that of the Earth everywhere."""
        sources = (self.magnets * self.magnet_moment, self.passing_rate * self.passing_field)
        return not any((self.hard_iron, self.soft_iron, self.variation, self.attached_field, self.frame, *sources))

    def scaled(self, noise_scale: float) -> Self:
        """The same surroundings with disturbances ``noise_scale`` times as large.

        Raises:
            ValueError: ``noise_scale`` is negative or not finite.
        """
        if not 0.0 <= noise_scale < math.inf:
            raise ValueError(f"noise_scale must lie in [0, inf), got {noise_scale}")
        names = ("hard_iron", "soft_iron", "variation", "magnet_moment", "passing_field", "attached_field", "frame")
        return replace(self, **{name: noise_scale * getattr(self, name) for name in names})

    def describe(self) -> dict[str, float]:
        """All fields, for JSON."""
        return asdict(self)


LABORATORY = Magnetics(hard_iron=0.6, soft_iron=0.015, variation=1.0, variation_length=0.7)
MAGNETICS: Mapping[str, Magnetics] = MappingProxyType(
    {
        "undisturbed": Magnetics(),
        "laboratory": LABORATORY,
        "indoor": Magnetics(hard_iron=1.0, soft_iron=0.01, variation=5.0),
        "fixed-magnets": replace(LABORATORY, magnets=2, magnet_moment=1.6, magnet_reach=0.4),
        "passing-magnets": replace(LABORATORY, passing_rate=0.1, passing_field=30.0),
        "attached-magnet": replace(LABORATORY, attached_field=38.0),
        "street": Magnetics(
            hard_iron=1.0,
            soft_iron=0.01,
            variation=0.5,
            variation_length=5.0,
            passing_rate=0.05,
            passing_field=10.0,
            passing_distance=2.0,
            passing_speed=8.0,
        ),
        "steel-frame": Magnetics(hard_iron=1.0, soft_iron=0.01, variation=0.5, variation_length=5.0, frame=1.0),
    }
)
"""Name → disturbance. Measured in BROAD's trials: the variation of ``laboratory`` (undisturbed trials), the field of
``attached-magnet`` (magnet 1 cm away), number and moment of ``fixed-magnets`` (spread of the field in the trial with a
stationary magnet). The rest is assumed."""


def magnetics_of(magnetics: str | Magnetics | None) -> Magnetics:
    """The disturbance of a name, or itself; none for None.

    Raises:
        ValueError: there is none of that name; the message lists all.
    """
    if magnetics is None:
        return MAGNETICS["undisturbed"]
    return magnetics if isinstance(magnetics, Magnetics) else look_up("magnetic disturbance", magnetics, MAGNETICS)


@dataclass
class Passing:
    """Dipoles that pass, drawn in the order of their times."""

    generator: np.random.Generator
    until: float
    """s: all that begin before it are drawn"""
    events: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]]
    """time of the closest approach (s), place then (m), velocity (m/s) and moment (A·m²), world axes"""


class MagneticField:
    """The disturbed field during one episode.

    Args:
        magnetics: parameters.
        field: ``(3,)`` the Earth's, world axes, µT.
        generator: from whose seed everything is drawn; it is not used up.
    """

    def __init__(self, magnetics: Magnetics, field: Sequence[float], generator: np.random.Generator) -> None:
        self.magnetics, self.earth, self._generator = magnetics, np.array(field, dtype=float), generator
        draw = named_generator(generator, "field").standard_normal
        # divergence-free: each wave is across its own direction
        self._waves = draw((MODES, 3)) / magnetics.variation_length
        across = rotation.cross(rotation.normalize(self._waves), draw((MODES, 3)))
        self._amplitudes = magnetics.variation * math.sqrt(3.0 / MODES) * across
        self._phases = named_generator(generator, "phases").uniform(0.0, 2.0 * math.pi, MODES)
        dipoles = named_generator(generator, "magnets")
        places = rotation.normalize(dipoles.standard_normal((magnetics.magnets, 3)))
        self._places = magnetics.magnet_reach * places * np.cbrt(dipoles.uniform(0.4**3, 1.0, (magnetics.magnets, 1)))
        self._moments = magnetics.magnet_moment * rotation.normalize(dipoles.standard_normal((magnetics.magnets, 3)))
        self._first: np.ndarray | None = None
        starts, ends = np.array(TUBES).transpose(1, 0, 2)
        counts = np.ceil(np.linalg.norm(ends - starts, axis=1) / SPACING).astype(int)
        shares = [(np.arange(count) + 0.5) / count for count in counts]
        lasting = named_generator(generator, "frame").standard_normal(len(TUBES))
        self._rods = np.concatenate([a + s[:, None] * (b - a) for a, b, s in zip(starts, ends, shares, strict=True)])
        self._rod_axes = np.repeat(rotation.normalize(ends - starts), counts, axis=0)
        self._rod_volumes = np.repeat(SECTION * np.linalg.norm(ends - starts, axis=1) / counts, counts)
        self._lasting = np.repeat(SUSCEPTIBILITY * REMANENCE * lasting, counts)
        self._iron: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._passing = Passing(named_generator(generator, "passing"), 0.0, [])

    def at(self, states: BodyState, site: str, carrier: BodyState | None = None) -> np.ndarray:
        """Field at a sensor, as its device distorts it.

        Args:
            states: motion ``(n, …)`` of the sensor.
            site: of the sensor; what is drawn for a device is that of its site.
            carrier: motion ``(n, …)`` of the bicycle at the same times, needed with a ``frame``.

        Returns:
            ``(n, 3)`` µT, world axes.
        """
        field = self.around(states)
        if self.magnetics.frame:
            if carrier is None:
                raise ValueError(f"frame must be 0 without a body {BICYCLE!r}, got {self.magnetics.frame}")
            field = field + self._of_frame(field, states, carrier)
        soft, hard = self._device(site)
        local = rotation.rotate_back(states.orientation, field)
        # sums instead of matrix products: their rounding does not depend on the number of rows
        local = np.sum(soft * local[..., None, :], axis=-1) + hard
        return rotation.rotate(states.orientation, local)

    def around(self, states: BodyState) -> np.ndarray:
        """Field ``(n, 3)`` at the place of a sensor without device and bicycle, µT, world axes."""
        position = np.asarray(states.position)
        field = np.broadcast_to(self.earth, position.shape)
        if self.magnetics.variation:
            phase = np.sum(self._waves * position[..., None, :], axis=-1) + self._phases
            field = field + np.sum(np.cos(phase)[..., None] * self._amplitudes, axis=-2)
        if self._first is None and len(position):
            self._first = position[0].copy()
        for place, moment in zip(self._places, self._moments, strict=True):
            field = field + dipole_field(position - self._first - place, moment)
        if self.magnetics.passing_rate and self.magnetics.passing_field:
            field = field + self._of_passing(np.asarray(states.time))
        return field

    def _device(self, site: str) -> tuple[np.ndarray, np.ndarray]:
        """Soft-iron matrix ``(3, 3)`` and constant field ``(3,)`` (µT, sensor axes) of the device at a site."""
        if site not in self._iron:
            draw = named_generator(self._generator, "iron", site).standard_normal
            entries, hard, magnet = draw((3, 3)), draw(3), draw(3)
            soft = np.eye(3) + self.magnetics.soft_iron * (np.tril(entries) + np.tril(entries, -1).T)
            hard = self.magnetics.hard_iron * hard + self.magnetics.attached_field * rotation.normalize(magnet)
            self._iron[site] = soft, hard
        return self._iron[site]

    def _of_frame(self, field: np.ndarray, states: BodyState, carrier: BodyState) -> np.ndarray:
        """Field of the tubes of a bicycle: magnetised along themselves, by the Earth and for good."""
        offset = rotation.rotate_back(carrier.orientation, states.position - carrier.position)
        earth = rotation.rotate_back(carrier.orientation, np.broadcast_to(self.earth, field.shape))
        total = np.zeros(field.shape)
        for place, axis, volume, lasting in zip(
            self._rods, self._rod_axes, self._rod_volumes, self._lasting, strict=True
        ):
            induced = SUSCEPTIBILITY / VACUUM * np.sum(earth * axis, axis=-1, keepdims=True)
            total = total + dipole_field(offset - place, self.magnetics.frame * volume * (induced + lasting) * axis)
        return rotation.rotate(carrier.orientation, total)

    def _of_passing(self, time: np.ndarray) -> np.ndarray:
        """Field ``(n, 3)`` of what passes at times ``(n,)``, µT."""
        magnetics, drawn = self.magnetics, self._passing
        distance, speed = magnetics.passing_distance, magnetics.passing_speed
        window = PASSING_TIME * distance / speed
        while drawn.until < float(np.max(time)) + window:
            drawn.until += float(drawn.generator.exponential(1.0 / magnetics.passing_rate))
            away, along, moment = rotation.normalize(drawn.generator.standard_normal((3, 3)))
            across = rotation.normalize(rotation.cross(away, along))
            strength = magnetics.passing_field * distance**3 / (2.0 * DIPOLE)
            drawn.events.append((drawn.until, distance * away, speed * across, strength * moment))
        field = np.zeros((*time.shape, 3))
        for moment_of, place, velocity, moment in drawn.events:
            near = np.abs(time - moment_of) < window
            if near.any():
                towards = -(place + velocity * (time[near, None] - moment_of))
                field[near] += dipole_field(towards, moment)
        return field


def dipole_field(offset: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Field of a magnetic dipole: μ₀/4π (3 (m·r) r / r⁵ − m / r³), limited to its value 3 cm away.

    Args:
        offset: ``(..., 3)`` m from the dipole.
        moment: ``(..., 3)`` A·m².

    Returns:
        ``(..., 3)`` µT.
    """
    distance = np.maximum(np.sqrt(np.sum(offset**2, axis=-1, keepdims=True)), CLOSEST)
    return DIPOLE * (
        3.0 * np.sum(moment * offset, axis=-1, keepdims=True) * offset / distance**5 - moment / distance**3
    )
