"""One ride drawn: what its sensors read, and what is true."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ....envs.data.trajectory import Trajectory
from ...plots import TRUTH_COLOR, new_figure
from .statistics import trunk_lean

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIGNALS = (
    ("bicycle_imu/gyr", "bicycle gyr, rad/s", ("forward", "left", "up")),
    ("bicycle_imu/acc", "bicycle acc, m/s²", ("forward", "left", "up")),
    ("trunk_imu/acc", "trunk acc, m/s²", ("forward", "left", "up")),
    ("seat/load_cells", "load cells, N", ("front", "rear left", "rear right")),
)
"""Channel, label of its axis, names of its columns."""


def example_ride(scenario: str, subject: int, seed: int, duration: float, fidelity: str) -> Trajectory:
    """One ride with every sensor of the papers, errors included.

    Args:
        scenario: name.
        subject: number of the rider.
        seed: of the ride.
        duration: s.
        fidelity: ``full`` or ``lumped``.
    """
    from ....envs.bicycle.environment import RiderBicycleEnv
    from ....envs.record import record_once

    options = {"suite": "all", "duration": duration, "fidelity": fidelity}
    return record_once(RiderBicycleEnv(scenario, subject, **options), seed)  # type: ignore[arg-type]


def ride_signals(trajectory: Trajectory, title: str = "") -> Figure:
    """Speed, true angles, inertial sensors, load cells and the hands' forces over time.

    Args:
        trajectory: of ``poise/RiderBicycle-v0`` with the suite ``all``.
        title: above the figure.
    """
    figure, axes = new_figure(8.5, 10.0, rows=len(SIGNALS) + 3)
    time, truth = trajectory.time - trajectory.time[0], trajectory.truth
    speed, angles, *inertial, hands = axes
    speed.plot(time, trajectory.measurements["wheel/speed"], color="#b9bec6", linewidth=0.7, label="wheel/speed")
    speed.plot(time, truth["bicycle/speed"], color=TRUTH_COLOR, linewidth=1.0, label="true")
    speed.set_ylabel("speed, m/s")
    for name, values in (
        ("roll", truth["bicycle/roll"][:, 0]),
        ("pitch", truth["bicycle/pitch"][:, 0]),
        ("steer", truth["bicycle/steer"][:, 0]),
        ("trunk lean", trunk_lean(truth)),
    ):
        angles.plot(time, np.degrees(values), linewidth=0.9, label=name)
    angles.set_ylabel("true angles, deg")
    for ax, (channel, label, columns) in zip(inertial, SIGNALS, strict=True):
        for column, name in enumerate(columns):
            ax.plot(time, trajectory.measurements[channel][:, column], linewidth=0.7, label=name)
        ax.set_ylabel(label)
    grips = trajectory.measurements["handlebar/force"]
    for begin, name in ((0, "left"), (3, "right")):
        hands.plot(time, np.linalg.norm(grips[:, begin : begin + 3], axis=1), linewidth=0.7, label=name)
    hands.set_ylabel("hands, N")
    hands.set_xlabel("time, s")
    for ax in axes:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
        ax.yaxis.label.set_size(8.5)
    figure.align_ylabels(axes)
    if title:
        speed.set_title(title, loc="left", fontsize=10.5)
    return figure
