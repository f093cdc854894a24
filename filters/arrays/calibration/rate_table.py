r"""Scale and offset of accelerometers and gyroscopes from a one-axis rate table.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval; chapter 4. The table turns at constant rates ω about the vertical. An accelerometer with the raw reading v,
sensitive axis e and position r from the axis of the table satisfies

    μ v + η = eᵀ Ω² r − eᵀ Qᵀ g,   Ω² = diag(−ω², −ω², 0)          ⇒          μ v + η + ω² ρ = g e_up

e_up is the vertical component of e: 0 with a horizontal axis, 1 with an upright one. Of r only ρ, the coordinate along
the horizontal component of e, is observable. The unknowns are therefore μ, η and one ρ for each mounting of the device:
four with the thesis' two directions and one upright pose.

Errata: (4.1), (4.2) have the sign of gravity for an axis that points down; (4.5) has all of r as unknowns, which makes
the normal matrix singular (rank 3 of 5); in (4.6) the sign of the second position is that of the opposite coordinate.
Without an upright pose only ratios are determined. The columns are scaled before the solution.

:func:`calibrate_direction` is an addition to the thesis. With s = e/μ and the upward directions f_k of the poses, the
same relation is v = s·(g f_k) + b − ω² c_k, linear in s, b and one c_k per mounting. Upward directions that span three
dimensions and include one opposite pair therefore also determine the sensitive axis. A misalignment of half a degree
causes an error of up to 0.09 m/s².
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.quantity import STANDARD_GRAVITY

SINGULAR = 1e-5
"""Smallest accepted singular value of columns of unit length, relative to the largest."""
UPRIGHT = 0.999
"""An axis with at least this vertical component counts as upright: it does not determine a position."""


@dataclass(frozen=True)
class AxisCalibration:
    """One sensitive axis: calibrated value = scale · raw + offset."""

    scale: float
    """μ, m/s² (gyroscope: rad/s) per unit of the raw reading"""
    offset: float
    """η, m/s² (rad/s)"""
    positions: Mapping[str, float]
    """mounting → ρ, m along the sensor's axis from the axis of the table, signed; empty for gyroscopes"""
    residual: float
    """root mean square residual, m/s² (rad/s)"""
    largest: float
    """largest residual, m/s² (rad/s)"""
    samples: int
    """number of samples used"""
    discarded: int
    """number of saturated samples"""
    axis: tuple[float, ...] | None = None
    """``(3,)`` sensitive axis in device axes, if it was estimated"""


def calibrate_accelerometer(
    raw: np.ndarray,
    rate: np.ndarray,
    mounting: np.ndarray,
    upward: Mapping[str, float],
    *,
    gravity: float = STANDARD_GRAVITY,
    saturation: float | None = None,
) -> AxisCalibration:
    """Calibrate one accelerometer.

    Args:
        raw: ``(T,)`` readings at constant rates, any unit; NaN is ignored.
        rate: ``(T,)`` rate of the table, rad/s.
        mounting: ``(T,)`` name of the mounting of the device on the table.
        upward: mounting → vertical component of the sensitive axis, −1 to 1.
        gravity: m/s², positive.
        saturation: magnitude from which raw readings are discarded; None: only those that stay at the end of the range
            (constant, and equal at different rates).

    Raises:
        ValueError: different shapes, a mounting that is missing in ``upward``, an invalid gravity or saturation, too
            few samples, or poses that do not determine scale, offset and positions; the message lists what is missing.
    """
    _check_gravity(gravity)
    raw, rate, mounting, discarded = _usable(raw, rate, mounting, upward, saturation)
    up = np.array([upward[name] for name in mounting.tolist()])
    horizontal = [name for name in sorted(set(mounting.tolist())) if abs(upward[name]) < UPRIGHT]
    if not (np.abs(up) > 0.05).any():
        raise ValueError(
            "no pose in which the axis points up (or down): without one only ratios of scale, offset and position are "
            "determined"
        )
    _check_rates(rate, mounting, horizontal)
    columns = [raw, np.ones_like(raw), *(rate**2 * (mounting == name) for name in horizontal)]
    labels = ["scale", "offset", *(f"position {name}" for name in horizontal)]
    solution = _least_squares(np.stack(columns, axis=-1), gravity * up, labels)
    left = np.stack(columns, axis=-1) @ solution - gravity * up
    positions = dict(zip(horizontal, solution[2:].tolist(), strict=True))
    return _calibration(solution[0], solution[1], positions, left, discarded)


def calibrate_direction(
    raw: np.ndarray,
    rate: np.ndarray,
    mounting: np.ndarray,
    upward: Mapping[str, np.ndarray],
    *,
    gravity: float = STANDARD_GRAVITY,
    saturation: float | None = None,
) -> AxisCalibration:
    """Calibrate one accelerometer and estimate the direction of its sensitive axis.

    Args:
        raw: as for :func:`calibrate_accelerometer`, as are ``rate``, ``gravity`` and ``saturation``.
        rate: rad/s.
        mounting: ``(T,)`` name of the mounting of the device on the table.
        upward: mounting → ``(3,)`` upward direction, device axes.
        gravity: m/s².
        saturation: raw.

    Raises:
        ValueError: as :func:`calibrate_accelerometer`; at least four upward directions must not lie in one plane.
    """
    _check_gravity(gravity)
    raw, rate, mounting, discarded = _usable(raw, rate, mounting, upward, saturation)
    names = sorted(set(mounting.tolist()))
    _check_rates(rate, mounting, names)
    up = np.array([np.asarray(upward[name], dtype=float) for name in mounting.tolist()])
    columns = [*(gravity * up.T), np.ones_like(raw), *(-(rate**2) * (mounting == name) for name in names)]
    labels = ["axis x", "axis y", "axis z", "offset", *(f"position {name}" for name in names)]
    solution = _least_squares(np.stack(columns, axis=-1), raw, labels)
    scale = 1.0 / float(np.linalg.norm(solution[:3]))
    left = scale * (np.stack(columns, axis=-1) @ solution - raw)
    positions = dict(zip(names, (scale * solution[4:]).tolist(), strict=True))
    axis = tuple((scale * solution[:3]).tolist())
    return _calibration(scale, -scale * float(solution[3]), positions, left, discarded, axis)


def calibrate_gyroscope(raw: np.ndarray, rate: np.ndarray, *, saturation: float | None = None) -> AxisCalibration:
    """Calibrate one axis of a gyroscope that is vertical on the table: ω = μ v + η by linear least squares.

    Args:
        raw: ``(T,)`` readings at constant rates, any unit; NaN is left out.
        rate: ``(T,)`` rate of the table about the sensitive axis, rad/s.
        saturation: as for :func:`calibrate_accelerometer`; the thesis discards readings beyond ±275 °/s.

    Raises:
        ValueError: different shapes, or fewer than three different rates that are not saturated.
    """
    everywhere = np.full(np.shape(raw), "")
    raw, rate, everywhere = _columns(raw, rate, everywhere)
    kept = np.isfinite(raw)
    lost = saturated(raw, rate, everywhere, saturation) & kept
    kept &= ~lost
    raw, rate = raw[kept], rate[kept]
    rates = np.unique(np.round(rate, 6))
    if len(rates) < 3:
        raise ValueError(f"at least three different rates that are not saturated are needed, got {len(rates)}")
    columns = np.stack([raw, np.ones_like(raw)], axis=-1)
    solution = _least_squares(columns, rate, ["scale", "offset"])
    return _calibration(solution[0], solution[1], {}, columns @ solution - rate, int(lost.sum()))


def _calibration(
    scale: float,
    offset: float,
    positions: dict[str, float],
    left: np.ndarray,
    discarded: int,
    axis: tuple[float, ...] | None = None,
) -> AxisCalibration:
    """The calibration with its residuals ``left`` ``(T,)`` summed up."""
    rms, largest = float(np.sqrt(np.mean(left**2))), float(np.abs(left).max())
    return AxisCalibration(float(scale), float(offset), positions, rms, largest, len(left), discarded, axis)


def saturated(raw: np.ndarray, rate: np.ndarray, mounting: np.ndarray, limit: float | None) -> np.ndarray:
    """Mask ``(T,)`` of the readings at the end of the range: beyond ``limit``, or stuck.

    Readings at one rate are stuck if all of them equal the largest (or smallest) one of the mounting, and another rate
    has the same value or the readings at other rates show noise.
    """
    if limit is not None:
        if not limit >= 0.0:
            raise ValueError(f"saturation must be a magnitude of raw readings, 0 or more, got {limit}")
        return np.abs(raw) >= limit
    result = np.zeros(len(raw), bool)
    for name in set(mounting.tolist()):
        here = np.isfinite(raw) & (mounting == name)
        steps = [here & (rate == one) for one in np.unique(rate[here])]
        noisy = np.mean([np.ptp(raw[step]) > 0.0 for step in steps]) > 0.5 if steps else False
        for end in (np.max, np.min):
            stuck = [step for step in steps if (raw[step] == end(raw[here])).all()]
            speeds = {abs(float(rate[step][0])) for step in stuck}
            several = len(speeds) > 1 or (noisy and all(step.sum() >= 5 for step in stuck))
            if stuck and several and len(stuck) < len(steps):
                limit_reached = end(raw[here])
                # a rate that reaches the end only at times has a biased mean as well
                result |= np.any([step for step in steps if (raw[step] == limit_reached).any()], axis=0)
    return result


def _usable(
    raw: np.ndarray, rate: np.ndarray, mounting: np.ndarray, upward: Mapping[str, Any], saturation: float | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """The valid samples that are not saturated, and the number of saturated ones."""
    raw, rate, mounting = _columns(raw, rate, mounting)
    unknown = [name for name in sorted(set(mounting.tolist())) if name not in upward]
    if unknown:
        raise ValueError(f"upward must contain every mounting; {unknown} are missing")
    kept = np.isfinite(raw)
    lost = saturated(raw, rate, mounting, saturation) & kept
    kept &= ~lost
    if not kept.any():
        raise ValueError("every sample is saturated or missing: repeat with lower rates or a smaller radius")
    return raw[kept], rate[kept], mounting[kept], int(lost.sum())


def _check_gravity(gravity: float) -> None:
    if not 0.0 < gravity < np.inf:
        raise ValueError(f"gravity must be positive and finite (m/s²), got {gravity}")


def _check_rates(rate: np.ndarray, mounting: np.ndarray, names: list[str]) -> None:
    for name in names:
        if len(np.unique(np.round(rate[mounting == name] ** 2, 6))) < 2:
            raise ValueError(f"mounting {name!r} needs at least two different rates to determine its position, got 1")


def _columns(raw: np.ndarray, rate: np.ndarray, mounting: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    raw, rate, mounting = np.asarray(raw, dtype=float), np.asarray(rate, dtype=float), np.asarray(mounting)
    if raw.ndim != 1 or rate.shape != raw.shape or mounting.shape != raw.shape:
        raise ValueError(
            f"raw, rate and mounting must be columns of one length, got {raw.shape}, {rate.shape}, {mounting.shape}"
        )
    if not np.isfinite(rate).all():
        raise ValueError("rate must be finite in every row")
    return raw, rate, mounting


def _least_squares(columns: np.ndarray, right: np.ndarray, labels: list[str]) -> np.ndarray:
    """Solve with columns of unit length; raise an error for unknowns that are not determined."""
    if len(columns) < len(labels):
        raise ValueError(f"{len(labels)} unknowns need at least as many samples, got {len(columns)}")
    lengths = np.linalg.norm(columns, axis=0)
    if not (lengths > 0.0).all():
        nothing = [label for label, length in zip(labels, lengths, strict=True) if not length > 0.0]
        raise ValueError(f"the data do not determine {nothing}")
    values = np.linalg.svd(columns / lengths, compute_uv=False)
    if values[-1] < SINGULAR * values[0]:
        raise ValueError(f"the data do not separate {', '.join(labels)} (singular normal matrix): add rates or poses")
    return np.linalg.lstsq(columns / lengths, right, rcond=None)[0] / lengths
