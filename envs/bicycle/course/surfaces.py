"""Named road surfaces: random height maps with the displacement spectra of roads, as a bicycle tyre feels them.

The spectral density of the height along any straight line follows ISO 8608, G(n) = G(n₀) (n / n₀)^−w with
n₀ = 0.1 cycles/m; paved surfaces have a band around the size of their stones in addition. A tyre does not follow what
is shorter than its contact with the road, so the map is smoothed over the contact patch beforehand: the wheel model
touches the ground in one point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ....filters.support.parameters import check_positive
from .terrain import CELLS, SPACING, FlatGround, Ground, RoughTile

REFERENCE = 0.1
"""cycles/m: n₀ of ISO 8608"""
CONTACT = 0.013
"""m: standard deviation of the pressure over half a bicycle tyre's patch of 6 cm, parabolic along it (a / √5). 350 N at
3 bar press on 12 cm², of 2.5 cm width."""
STONE_SPREAD = 0.2
"""1: standard deviation of the stones' wave numbers, relative"""


@dataclass(frozen=True)
class Surface:
    """A road surface.

    Raises:
        ValueError: a number that is negative or not finite, a waviness outside [1, 4], or stones smaller than two cells
            of the map.
    """

    name: str
    summary: str
    roughness: float
    """m³: one-sided displacement density G(n₀) at 0.1 cycles/m. ISO 8608 has 16e-6 in the middle of class A, four times
    as much in each following class: B 64e-6, C 256e-6, D 1024e-6"""
    waviness: float = 2.0
    """1: w"""
    stone: float = 0.0
    """m: pitch of stones, 0 for none"""
    relief: float = 0.0
    """m: root mean square of the height of the stones alone"""
    longest: float = 5.0
    """m: longest wave; beyond it a road is a slope, not a surface"""

    def __post_init__(self) -> None:
        check_positive(self, or_zero=("roughness", "stone", "relief", "longest"))
        if not 1.0 <= self.waviness <= 4.0:
            raise ValueError(f"waviness must lie in [1, 4], got {self.waviness}")
        if self.relief and self.stone < 2.0 * SPACING:
            raise ValueError(f"stone must be at least {2.0 * SPACING} m where relief is not 0, got {self.stone} m")

    def density(self, n: np.ndarray) -> np.ndarray:
        """Spectral density along a line without stones and before the contact patch, m³, at n cycles/m."""
        return self.roughness * (np.asarray(n) / REFERENCE) ** -self.waviness

    def plane_density(self, n: np.ndarray) -> np.ndarray:
        """Two-sided density of the map over the plane of wave vectors, m⁴, at wave numbers of n > 0 cycles/m.

        An isotropic density A n^−(w+1) has the one-sided line density 2 √π Γ(w/2) / Γ((w+1)/2) A n^−w.
        """
        w = self.waviness
        line = 2.0 * math.sqrt(math.pi) * math.gamma(0.5 * w) / math.gamma(0.5 * (w + 1.0))
        found = self.roughness * REFERENCE**w / line * n ** -(w + 1.0) * (n >= 1.0 / max(self.longest, SPACING))
        if self.relief:
            middle = 1.0 / self.stone
            ring = np.exp(-0.5 * ((n / middle - 1.0) / STONE_SPREAD) ** 2)
            area = 2.0 * math.pi * middle * STONE_SPREAD * middle * math.sqrt(2.0 * math.pi)
            found = found + self.relief**2 * ring / area
        # amplitude exp(−(2π n σ)² / 2) of the mean over the contact patch
        return found * np.exp(-((2.0 * math.pi * n * CONTACT) ** 2))

    def draw(self, rng: np.random.Generator) -> Ground:
        """A ground of this surface."""
        if not (self.roughness or self.relief):
            return FlatGround()
        step = 1.0 / (CELLS * SPACING)
        across, along = np.fft.fftfreq(CELLS, SPACING)[:, None], np.fft.rfftfreq(CELLS, SPACING)[None, :]
        n = np.hypot(across, along)
        n[0, 0] = step
        deviation = step * np.sqrt(self.plane_density(n))
        deviation[0, 0] = 0.0
        # random waves, divided by the samples of a B-spline so that the spline passes through their sum
        spline = np.outer(*((2.0 + np.cos(2.0 * math.pi * each.ravel() * SPACING)) / 3.0 for each in (across, along)))
        real, imaginary = rng.standard_normal((2, *n.shape))
        waves = (real + 1j * imaginary) * (math.sqrt(0.5) * CELLS**2 * deviation / spline)
        return RoughTile(np.fft.irfft2(waves, s=(CELLS, CELLS)))


SURFACES = {
    surface.name: surface
    for surface in (
        Surface("smooth", "an exact plane, for checks of equations", 0.0),
        Surface("hall", "floor of a sports hall", 0.5e-6),
        Surface("tarmac", "smooth tarmac, ISO class A", 16e-6),
        Surface("rough-tarmac", "worn tarmac, ISO class B", 64e-6),
        Surface("gravel", "compacted gravel", 130e-6, waviness=1.8),
        Surface("pavers", "paver bricks of 10 × 20 cm", 200e-6, stone=0.10, relief=0.001),
        Surface("cobbles", "cobblestones of 12 cm", 500e-6, stone=0.12, relief=0.0025),
    )
}
"""The surfaces by name, from smooth to rough."""


def list_surfaces() -> list[str]:
    """Names that :func:`surface` takes."""
    return list(SURFACES)


def surface(name: str | Surface) -> Surface:
    """A surface by name, or as given.

    Raises:
        ValueError: there is none of that name.
    """
    if isinstance(name, Surface):
        return name
    if name not in SURFACES:
        raise ValueError(f"surface must be one of {list_surfaces()} or a Surface, got {name!r}")
    return SURFACES[name]
