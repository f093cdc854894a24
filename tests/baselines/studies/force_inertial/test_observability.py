"""Ranks with the biases of one gyroscope and of both, and what offsets cost."""

from __future__ import annotations

import numpy as np

from poise.baselines.studies.force_inertial import observability
from poise.baselines.studies.force_inertial.simulation import CASES, offset_errors


def test_the_bias_of_the_bicycle_about_y_is_never_seen(monkeypatch):
    monkeypatch.setattr(observability, "SECONDS", 4.0)
    found = observability.observed("indoor", 0)
    assert found["rank"] == {"7": 7, "10": 9}
    assert np.isnan(found["deviation"]["c_y"])
    assert found["seen"]["c_y"] == 0.0
    assert found["deviation"]["c_x"] > 0.0


def test_offsets_that_are_measured_cost_little():
    none, measured, kept = (offset_errors(case, "indoor", 1, 14.0, 0) for case in CASES)
    assert kept[3] > 2.0 * none[3]
    assert measured[3] < 1.3 * none[3]
