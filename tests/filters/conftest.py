"""Data for the contracts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from poise.baselines.speed.fixtures import plausible_measurements


@pytest.fixture(scope="session")
def motion() -> Callable[..., dict[str, np.ndarray]]:
    """Plausible samples for an estimator: ``motion(estimator, seed, length=80, dt=0.01)``."""
    return plausible_measurements
