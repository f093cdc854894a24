"""Recordings of devices with an array of accelerometers in what is made for IMUs."""

import numpy as np

from poise.baselines.plots import error_curves
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core.quantity import Estimate


def test_curves_show_the_true_motion_where_there_is_no_imu():
    for device, labels in (
        ("octa", ["true acceleration, m/s²", "true angular rate, rad/s"]),
        ("controller", ["true acceleration, m/s²", "angular rate, rad/s"]),
        ("imu", ["specific force, m/s²", "angular rate, rad/s"]),
    ):
        trajectory = simulate_hand("fast", 0, duration=2.0, device=device)
        estimate = Estimate({"orientation": np.tile([1.0, 0.0, 0.0, 0.0], (len(trajectory), 1))})
        figure = error_curves(trajectory, {"still": estimate}, {"still": "filter"})
        motion = figure.axes[0]
        assert [line.get_label() for line in motion.lines] == labels
