"""The filter of two gyroscopes and a camera with noises that hold on rides."""

from __future__ import annotations

from dataclasses import dataclass

from ...core.quantity import DEG
from ..geometry import Point
from .filter import TwoGyro


@dataclass(frozen=True)
class ConsistentTwoGyro(TwoGyro):
    """:class:`.TwoGyro` with noises chosen on rides.

    They have the largest likelihood of the true angles on simulated rides of training riders with devices from
    laboratory to phone grade, worn with placement errors. They are no noise of a sample: they stand for what lasts, the
    alignment of gyroscopes and marker (orientation, gyroscopes) and a road that is not level (pitch and roll rate).
    """

    orientation_noise: float = 3.4 * DEG
    """rad"""
    body_gyroscope_noise: Point = (0.21 * DEG, 0.21 * DEG, 0.21 * DEG)
    """rad/s/√Hz"""
    platform_gyroscope_noise: Point = (2.7 * DEG, 2.7 * DEG, 2.7 * DEG)
    """rad/s/√Hz"""
    body_bias_drift: float = 0.63 * DEG
    """rad/s"""
    platform_bias_drift: float = 0.075 * DEG
    """rad/s"""
    body_bias_prior: float = 3.2 * DEG
    """rad/s: turn-on bias of gyroscopes of phone grade"""
    platform_bias_prior: float = 3.9 * DEG
    """rad/s"""
    zero_yaw_guard: float = 0.16 * DEG
    """rad/s"""
    pitch_rate_noise: float = 2.5 * DEG
    """rad/s/√Hz"""
    roll_rate_noise: float = 5.5 * DEG
    """rad/s/√Hz"""
