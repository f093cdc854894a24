"""Table I of the force/inertial paper beside what is simulated."""

from __future__ import annotations

import math

from ....envs.bicycle.sensors.devices import (
    DRIFT_TIME,
    LOAD_CELL,
    MODEL_605_ACCELEROMETER,
    MODEL_605_GYROSCOPE,
    SEAT_WRENCH,
    STRAIN_GAUGES,
)
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.core.quantity import DEG, STANDARD_GRAVITY
from ..report import Report

RATE = 50.0
"""Hz, section II-A"""


def table_i(report: Report) -> None:
    """Published parameters beside those of the simulated bicycle, and the noises, which the paper does not give."""
    own = RiderGeometry()
    lengths: tuple[tuple[str, float | None, float | None], ...] = (
        ("α, deg", 10.0, own.bicycle_imu_tilt / DEG),
        ("γ, deg", 20.0, own.post_tilt / DEG),
        ("g, m/s²", 9.8, STANDARD_GRAVITY),
        ("l_s, m", 0.26, own.saddle[0]),
        ("h_s, m", 0.38, own.saddle[2]),
        ("l_b, m", 0.45, None),
        ("h_b, m", 0.66, None),
        ("p_x, m", 0.37, own.bicycle_imu[0]),
        ("p_z, m", 0.71, own.bicycle_imu[2]),
        ("L_1, m", 0.13, own.post_length),
        ("L_x, m", 0.20, own.cells_long),
        ("L_y, m", 0.12, own.cells_wide),
        ("L_m, m", 0.043, own.cells_behind),
        ("τ, s", 1800.0, DRIFT_TIME),
    )
    root = math.sqrt(RATE)
    noises = (
        ("gyroscopes, °/s a sample", MODEL_605_GYROSCOPE.noise.white_noise * root / DEG),
        ("σ of the gyroscopes' bias, °/s", MODEL_605_GYROSCOPE.noise.bias_instability / DEG),
        ("accelerometers, m/s² a sample", MODEL_605_ACCELEROMETER.noise.white_noise * root),
        ("seat force, N a sample", SEAT_WRENCH.noise.white_noise * root),
        ("zero of the seat force, N", SEAT_WRENCH.noise.turn_on_bias),
        ("load cells, N a sample", LOAD_CELL.noise.white_noise * root),
        ("handlebar force, N a sample", STRAIN_GAUGES.noise.white_noise * root),
        ("zero of the handlebar force, N", STRAIN_GAUGES.noise.turn_on_bias),
    )
    rows = [{"parameter": name, "published": published, "simulated": ours} for name, published, ours in lengths]
    rows += [{"parameter": name, "published": None, "simulated": value} for name, value in noises]
    note = (
        "l_b and h_b, the place of the bicycle's centre of mass, enter no equation of the filter. The published saddle "
        "is lower than the unit on the frame (h_s below p_z); the simulated one is where a rider can sit. The paper "
        "gives none of the noises; those here are standard deviations of the simulated sensors."
    )
    report.table("Table I: parameters", [{**row, "simulated": _short(row["simulated"])} for row in rows], note)


def _short(value: float | str | None) -> float | None:
    return None if value is None else float(f"{float(value):.3g}")
