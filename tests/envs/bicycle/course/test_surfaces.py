"""Road surfaces: their spectra along any line, their tiles and their names."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import periodogram

from poise.envs.bicycle.course.scenarios import scenario
from poise.envs.bicycle.course.surfaces import CONTACT, SURFACES, Surface, list_surfaces, surface
from poise.envs.bicycle.course.terrain import CELLS, SPACING, FlatGround, RoughTile
from poise.envs.bicycle.environment import RiderBicycleEnv


def heights(ground, x, y):
    return np.array([ground.height_and_slope(a, b)[0] for a, b in zip(x, y, strict=True)])


def line_density(made, seed, axis):
    """One-sided density of the height along lines through a map, cycles/m and m³."""
    ground = made.draw(np.random.default_rng(seed))
    along = SPACING * np.arange(CELLS)
    found = []
    for other in np.linspace(0.0, 10.0, 12):
        line = np.full(CELLS, other)
        n, density = periodogram(heights(ground, *((along, line) if axis == 0 else (line, along))), 1.0 / SPACING)
        found.append(density)
    return n, np.mean(found, axis=0)


@pytest.mark.parametrize("waviness", [2.0, 2.5])
def test_the_spectrum_along_any_line_is_that_of_iso_8608(waviness):
    made = Surface("test", "", 64e-6, waviness)
    densities = [line_density(made, seed, axis) for seed in range(4) for axis in (0, 1)]
    n, density = densities[0][0], np.mean([each[1] for each in densities], axis=0)
    across = np.linspace(-25.0, 25.0, 5001)
    for low, high in ((0.3, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 12.0)):
        band = (n >= low) & (n < high)
        if high <= 2.0:  # waves that are long against the contact patch
            assert density[band].sum() == pytest.approx(made.density(n[band]).sum(), rel=0.15)
        # all waves of the plane that run across this line, smoothed over the patch
        plane = 2.0 * np.trapezoid(made.plane_density(np.hypot(n[band, None], across)), across, axis=1)
        assert density[band].sum() == pytest.approx(plane.sum(), rel=0.15)


def test_the_relief_of_stones_has_their_size():
    n, density = line_density(Surface("stones", "", 0.0, stone=0.1, relief=0.003), 0, 0)
    ground = Surface("stones", "", 0.0, stone=0.1, relief=0.003).draw(np.random.default_rng(0))
    x, y = np.random.default_rng(1).uniform(-100.0, 100.0, (2, 4000))
    # smoothed over the contact patch: at 10 cycles/m by exp(−(2π · 10 · 0.013)² / 2)
    assert np.std(heights(ground, x, y)) == pytest.approx(0.003 * np.exp(-0.5 * (20.0 * np.pi * CONTACT) ** 2), rel=0.1)
    assert 5.0 < np.average(n, weights=density) < 10.0


def test_a_tile_repeats_and_the_same_seed_gives_the_same_road():
    first, second, other = (surface("gravel").draw(np.random.default_rng(seed)) for seed in (5, 5, 6))
    x, y = np.random.default_rng(0).uniform(-50.0, 50.0, (2, 50))
    side = CELLS * SPACING
    np.testing.assert_allclose(heights(first, x + side, y - 3.0 * side), heights(first, x, y), atol=1e-12)
    np.testing.assert_array_equal(heights(first, x, y), heights(second, x, y))
    assert np.abs(heights(first, x, y) - heights(other, x, y)).max() > 1e-3


def test_a_smooth_surface_is_exactly_flat():
    course = scenario("slalom").draw(np.random.default_rng(0), 10.0, "smooth")
    assert len(course.ground.table[1]) == 0
    assert course.ground.height_and_slope(3.0, 4.0) == (0.0, 0.0, 0.0)
    assert isinstance(surface("smooth").draw(np.random.default_rng(0)), FlatGround)


def test_a_random_surface_is_drawn_for_each_ride():
    names = {scenario("slow").draw(np.random.default_rng(seed), 5.0, "random").surface.name for seed in range(40)}
    assert names == set(list_surfaces()) - {"smooth"}


def test_a_composed_scenario_has_the_rougher_surface():
    assert scenario("indoor_circle+outdoor").surface == scenario("outdoor+slow").surface == "rough-tarmac"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: surface("ice"), "surface must be one of .*tarmac.*got 'ice'"),
        (lambda: RiderBicycleEnv(surface="ice"), "surface must be one of"),
        (lambda: Surface("a", "", -1.0), "roughness must not be negative"),
        (lambda: Surface("a", "", 1.0, 0.5), r"waviness must lie in \[1, 4\], got 0.5"),
        (lambda: Surface("a", "", 1.0, stone=0.01, relief=0.001), "stone must be at least 0.04 m"),
        (lambda: RoughTile(np.zeros((4, 4))), r"512 × 512 finite heights, got \(4, 4\)"),
    ],
)
def test_impossible_surfaces_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_surfaces_are_sorted_by_their_roughness():
    rough = [each.roughness * (1.0 + each.relief * 1e3) for each in SURFACES.values()]
    assert rough == sorted(rough)
