"""Errors that data sheets do not state, assumed by the grade of a device: :data:`INDUSTRIAL`, :data:`CONSUMER`.

A data sheet that is silent about an error does not say that there is none. :func:`completed` therefore fills what is
left at zero with the value of the device's grade and names what it filled. The values are choices of this project, of
the order that Allan deviations and temperature tests of such parts show; those of consumer parts are never below those
of industrial parts, which are calibrated one by one over temperature.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ...filters.core.quantity import DEG, STANDARD_GRAVITY
from .noise import NoiseModel

DEG_PER_HOUR = DEG / 3600.0
MICRO_G = 1e-6 * STANDARD_GRAVITY
PEAK = 0.617
"""largest Allan deviation of a first-order Gauss-Markov process, relative to its standard deviation (IEEE Std 952)"""
WARM_UP = 5.0
"""K: assumed rise of a device's own temperature after it is switched on, of every grade"""


def model(stability: float = 0.0, **values: float) -> NoiseModel:
    """A noise model from the in-run bias stability of a data sheet (the floor of the Allan deviation) and others."""
    return NoiseModel(bias_instability=stability / PEAK, **values)


@dataclass(frozen=True)
class Grade:
    """What is assumed of devices of one grade where their data sheets are silent."""

    name: str
    gyroscope: NoiseModel
    accelerometer: NoiseModel
    magnetometer: NoiseModel


INDUSTRIAL = Grade(
    "industrial",
    model(
        10.0 * DEG_PER_HOUR,
        bias_random_walk=3e-5 * DEG,
        turn_on_bias=0.2 * DEG,
        scale_factor=1e-3,
        misalignment=1e-3,
        g_sensitivity=0.003 * DEG / STANDARD_GRAVITY,
        temperature_coefficient=0.002 * DEG,
        warm_up=WARM_UP,
    ),
    model(
        40.0 * MICRO_G,
        bias_random_walk=2e-6,
        turn_on_bias=0.02,
        scale_factor=1e-3,
        misalignment=1e-3,
        temperature_coefficient=20.0 * MICRO_G,
        warm_up=WARM_UP,
    ),
    model(
        0.05,
        white_noise=0.02,
        bias_random_walk=5e-4,
        turn_on_bias=0.5,
        scale_factor=5e-3,
        misalignment=5e-3,
        temperature_coefficient=0.01,
        warm_up=WARM_UP,
    ),
)
"""Modules that are calibrated one by one over temperature: inertial measurement units and motion trackers."""

CONSUMER = Grade(
    "consumer",
    model(
        15.0 * DEG_PER_HOUR,
        bias_random_walk=2e-4 * DEG,
        turn_on_bias=1.0 * DEG,
        scale_factor=0.01,
        misalignment=0.01,
        g_sensitivity=0.1 * DEG / STANDARD_GRAVITY,
        temperature_coefficient=0.03 * DEG,
        warm_up=WARM_UP,
    ),
    model(
        100.0 * MICRO_G,
        bias_random_walk=4e-5,
        turn_on_bias=0.04 * STANDARD_GRAVITY,
        scale_factor=0.01,
        misalignment=0.01,
        temperature_coefficient=500.0 * MICRO_G,
        warm_up=WARM_UP,
    ),
    model(
        0.1,
        white_noise=0.05,
        bias_random_walk=2e-3,
        turn_on_bias=5.0,
        scale_factor=0.03,
        misalignment=0.02,
        temperature_coefficient=0.1,
        warm_up=WARM_UP,
    ),
)
"""Single chips of phones, watches and game controllers, as they leave the factory."""

FILLED = (
    *("white_noise", "bias_random_walk", "bias_instability", "turn_on_bias"),
    *("scale_factor", "misalignment", "g_sensitivity", "temperature_coefficient", "warm_up"),
)
"""fields that :func:`completed` fills"""


def completed(stated: NoiseModel, assumed: NoiseModel) -> tuple[NoiseModel, tuple[str, ...]]:
    """A model that a data sheet states with its zeros replaced by those of a grade, and the names of these fields."""
    names = tuple(name for name in FILLED if not getattr(stated, name) and getattr(assumed, name))
    return replace(stated, **{name: getattr(assumed, name) for name in names}), names
