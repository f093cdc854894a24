"""Types and ranges of parameters follow from annotations and names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pytest

from poise.filters.support.parameters import check_parameters


@dataclass(frozen=True)
class Filter:
    dt: float = 0.01
    gyroscope_noise: float = 0.1
    accelerometer_noise: float = 0.1
    declination: float = 0.0
    mode: Literal[1, 2] = 1
    start: Literal["tilt", "known"] = "tilt"
    exact: bool = True
    order: int = 2
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)
    start_orientation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    names: tuple[str, ...] = ("a",)
    array: np.ndarray | str = "octa"


@pytest.mark.parametrize(
    "given",
    [
        {"dt": 1, "gyroscope_noise": 0.0, "declination": -3.0},
        {"dt": np.float32(0.5), "accelerometer_noise": np.int64(2), "order": np.int32(3)},
        {"mode": 2, "start": "known", "exact": np.bool_(False)},
        {"lever": (1, 2.0, -3.0), "start_orientation": np.array([0.0, 1.0, 0.0, 0.0]), "names": ("b", "c")},
        {"array": "planar"},
        {"array": np.zeros(3), "unknown to it": object()},
    ],
)
def test_what_fits_passes(given):
    check_parameters(Filter, given)


@pytest.mark.parametrize(
    ("name", "value", "accepted"),
    [
        ("dt", 0.0, r"positive \(at least 1e-12\)"),
        ("dt", True, "a finite number"),
        ("dt", "0.01", "a finite number"),
        ("dt", np.array([0.1, 0.2]), "a finite number"),
        ("dt", 1e300, "a finite number"),
        ("gyroscope_noise", float("nan"), "a finite number"),
        ("gyroscope_noise", -1.0, "negative"),
        ("accelerometer_noise", 0.0, r"positive \(at least 1e-12\)"),
        ("mode", True, r"one of \(1, 2\)"),
        ("mode", 1.0, r"one of \(1, 2\)"),
        ("start", "level", r"one of \('tilt', 'known'\)"),
        ("start", [], r"one of \('tilt', 'known'\)"),
        ("exact", 1, "True or False"),
        ("order", 2.0, "an integer"),
        ("lever", 1.0, "a sequence like"),
        ("lever", (1.0, 2.0), "a sequence of 3"),
        ("lever", (1.0, 2.0, "x"), "a sequence, each a finite number"),
        ("start_orientation", (1.0, 0.0), "a sequence of 4"),
        ("names", "b", "a sequence"),
        ("array", 3.0, "of type ndarray or of type str"),
    ],
)
def test_what_does_not_fit_is_named_with_what_is_accepted(name, value, accepted):
    with pytest.raises(ValueError, match=f"^{name} must (not )?be {accepted}.*got "):
        check_parameters(Filter, {name: value})
