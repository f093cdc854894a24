"""Allan deviation that the parameters of a noise model imply, after IEEE Std 952."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .assumptions import DEG_PER_HOUR, MICRO_G
from .noise import NoiseModel
from .presets import PRESETS

FLOOR_TIME = 1000.0
"""s: averaging time at which white noise has faded and drift shows"""


def allan_deviation(
    model: NoiseModel, times: Sequence[float] | np.ndarray, rate: float = 100.0, duration: float | None = None
) -> np.ndarray:
    """Expected Allan deviation of the samples of a sensor at rest, per axis.

    The sum of the variances of its independent parts, with averaging time τ::

        white noise N:           N²/τ
        rounding to r:           r²/(12 f τ), as white noise (right where the noise of a sample exceeds r/2)
        Gauss-Markov σ, T:       2 σ² T/τ (1 − T/(2 τ) (3 − 4 exp(−τ/T) + exp(−2 τ/T)))
        random walk K:           K² τ/3
        warming to A, T:         A²/2 (T/τ)² (1 − exp(−τ/T))⁴ · mean of exp(−2 t/T) over the record

    Args:
        model: parameters, unit ``u``; a low-pass below the frequencies 1/(2 τ) is not considered.
        times: averaging times τ, s.
        rate: samples per second f, Hz.
        duration: length of a record that begins when the device is switched on, s, at least twice the longest
            averaging time; None for a device that is warm, as the standard has it.

    Returns:
        ``u``, in the shape of ``times``.

    Raises:
        ValueError: an averaging time or the rate is not positive, or the record is too short.
    """
    tau = np.asarray(times, dtype=float)
    for name, value in (("times", tau), ("rate", np.asarray(rate))):
        if not np.all((value > 0.0) & np.isfinite(value)):
            raise ValueError(f"{name} must be positive and finite, got {value}")
    if duration is not None and not 2.0 * np.max(tau) <= duration < np.inf:
        raise ValueError(f"duration must be at least twice the averaging time of {np.max(tau):g} s, got {duration}")
    white = (model.white_noise**2 + model.resolution**2 / (12.0 * rate)) / tau
    ratio = model.bias_correlation_time / tau
    decay = 3.0 - 4.0 * np.exp(-1.0 / ratio) + np.exp(-2.0 / ratio)
    wander = 2.0 * model.bias_instability**2 * ratio * (1.0 - 0.5 * ratio * decay)
    variance = white + wander + model.bias_random_walk**2 * tau / 3.0
    if duration is not None:
        ratio, starts = model.warm_up_time / tau, np.maximum(duration - 2.0 * tau, 1e-9) / model.warm_up_time
        average = -np.expm1(-2.0 * starts) / (2.0 * starts)
        warming = (model.temperature_coefficient * model.warm_up) ** 2
        variance = variance + 0.5 * warming * ratio**2 * np.expm1(-1.0 / ratio) ** 4 * average
    return np.sqrt(variance)


def allan_floors(time: float = FLOOR_TIME) -> list[dict[str, Any]]:
    """Allan deviation of every preset that is a device at ``time`` (s), at 100 Hz, warm: one row a preset.

    Returns:
        ``name``, ``gyroscope`` (°/h), ``accelerometer`` (µg), and in ``assumed`` the fields that no data sheet states.
    """
    rows: list[dict[str, Any]] = []
    for preset in (each for each in PRESETS if each.is_device):
        floors = [float(allan_deviation(noise, [time])[0]) for noise in (preset.gyroscope, preset.accelerometer)]
        assumed = [f"{kind}: {', '.join(names)}" for kind, names in preset.assumed.items() if names]
        rows.append(
            {
                "name": preset.name,
                "gyroscope": floors[0] / DEG_PER_HOUR,
                "accelerometer": floors[1] / MICRO_G,
                "assumed": "; ".join(assumed) or None,
            }
        )
    return rows
