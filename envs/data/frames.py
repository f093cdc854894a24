"""Trajectories as tables: one row per sample, measurements and truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ...filters.core.frames import ORIENTATIONS, QUATERNION, attitude_columns, quantity_columns

if TYPE_CHECKING:
    import pandas


def trajectory_frame(
    time: np.ndarray,
    measurements: Mapping[str, np.ndarray],
    truth: Mapping[str, np.ndarray],
    mask: np.ndarray,
    known_units: Mapping[str, str],
) -> pandas.DataFrame:
    """The fields of a trajectory as a data frame.

    Columns: ``time`` (s); every channel by its name and axis (``imu/gyr_x``), in the units of the trajectory; of the
    truth ``true_roll``, ``true_pitch``, ``true_yaw`` (deg), the quaternion ``true_qw`` … ``true_qz``, and every other
    quantity as it is stored (``true_position_x``); ``mask``. ``frame.attrs["units"]`` holds the units that are known.
    """
    import pandas

    units = {"time": "s"}
    data: dict[str, np.ndarray] = {"time": time}
    for name, values in measurements.items():
        columns = quantity_columns(name, values, "rotation" if name.endswith("orientation") else "vector")
        data |= columns
        units |= dict.fromkeys(columns, known_units.get(name, ""))
    angles = attitude_columns(truth, before="true_")
    data |= angles
    units |= {name: "1" if name.removeprefix("true_") in QUATERNION else "deg" for name in angles}
    for name, values in truth.items():
        if name not in ORIENTATIONS:
            data |= quantity_columns(f"true_{name}", values, "rotation" if name.endswith("orientation") else "vector")
    data["mask"] = mask
    frame = pandas.DataFrame(data)
    frame.attrs["units"] = {column: units.get(column, "") for column in frame}
    return frame
