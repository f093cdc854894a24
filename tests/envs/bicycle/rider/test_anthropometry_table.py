"""De Leva's table against itself: segments that it gives between two pairs of end points must be the same bodies.

The alternative end points (second half of the table: cervicale instead of suprasternale, gonion, fingertip or ankle
joint centre instead of the first choice) are another set of printed numbers, so a mistyped one shows here.
"""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.bicycle.rider.anthropometry import MEN, VERTEX_ABOVE_SUPRASTERNALE, WOMEN, SegmentTable

# length (m), centre of mass from the upper end (part of the length), radii of gyration (parts of the length)
OTHERS = {
    False: {
        "head": (0.2429, 0.5002, (0.303, 0.315, 0.261)),
        "upper_trunk": (0.2421, 0.5066, (0.505, 0.320, 0.465)),
        "hand": (0.1879, 0.3624, (0.288, 0.235, 0.184)),
        "shank": (0.4403, 0.4395, (0.251, 0.246, 0.102)),
    },
    True: {
        "head": (0.2437, 0.4841, (0.271, 0.295, 0.261)),
        "upper_trunk": (0.2280, 0.5050, (0.466, 0.314, 0.449)),
        "hand": (0.1701, 0.3427, (0.244, 0.208, 0.154)),
        "shank": (0.4386, 0.4352, (0.267, 0.263, 0.092)),
    },
}
SHARED_LOWER_END = ("upper_trunk",)
"""the other definition has another upper end but the same lower one (xiphion)"""
ROUNDING = 7e-4  # m: half a digit of the radii times the length


def table(female: bool) -> dict[str, SegmentTable]:
    return WOMEN if female else MEN


@pytest.mark.parametrize("female", [False, True])
@pytest.mark.parametrize("name", ["head", "upper_trunk", "hand", "shank"])
def test_both_definitions_are_the_same_body(female: bool, name: str) -> None:
    row = table(female)[name]
    length, centre, radii = OTHERS[female][name]
    first, other = row.length * row.centre, length * centre
    if name in SHARED_LOWER_END:
        first, other = row.length - first, length - other
    assert first == pytest.approx(other, abs=ROUNDING)
    np.testing.assert_allclose(np.array(row.radii) * row.length, np.array(radii) * length, atol=ROUNDING)


@pytest.mark.parametrize("female", [False, True])
def test_vertex_above_suprasternale_is_the_sum_of_its_parts(female: bool) -> None:
    others, row = OTHERS[female], table(female)["upper_trunk"]
    vertex_to_cervicale, cervicale_to_suprasternale = others["head"][0], others["upper_trunk"][0] - row.length
    found = VERTEX_ABOVE_SUPRASTERNALE[female]
    assert found == pytest.approx(vertex_to_cervicale + cervicale_to_suprasternale, abs=1e-4)


@pytest.mark.parametrize("female", [False, True])
def test_the_parts_are_a_whole_body(female: bool) -> None:
    rows = table(female)
    single = ("head", "upper_trunk", "middle_trunk", "lower_trunk")
    total = sum(row.mass * (1 if name in single else 2) for name, row in rows.items())
    assert total == pytest.approx(1.0, abs=2e-4)
