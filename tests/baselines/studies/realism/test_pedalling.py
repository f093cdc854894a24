"""Lines of a trunk that is shaken by pedalling."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.studies.realism.pedalling import pedalling


@pytest.mark.parametrize("told", [True, False])
def test_lines_are_found_at_multiples_of_the_cadence(told: bool) -> None:
    rate, time = 60.0, np.arange(0.0, 60.0, 1.0 / 60.0)
    cranks = 2.0 * np.pi * 70.0 / 60.0
    noise = 0.02 * np.random.default_rng(0).standard_normal((2, len(time), 3))
    gyr, force = noise[0], noise[1] + [0.0, 0.0, 9.8]
    gyr[:, 0] += 0.3 * np.sin(cranks * time)
    for multiple, size in ((1, 0.5), (2, 0.4), (4, 0.2)):
        force[:, 2] += np.sqrt(2.0) * size * np.sin(multiple * cranks * time)
    found = pedalling(gyr, force, rate, np.full(len(time), cranks) if told else None)
    assert found["cadence"] == pytest.approx(70.0, abs=1.5)
    assert [found[f"shake_{each}"] for each in (1, 2, 4)] == pytest.approx([0.5, 0.4, 0.2], rel=0.12)


def test_of_a_short_record_nothing_is_known() -> None:
    assert np.isnan(pedalling(np.zeros((60, 3)), np.zeros((60, 3)), 60.0)["shake_2"])
