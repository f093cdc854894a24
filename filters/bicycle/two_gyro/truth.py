"""True values of the quantities of the two-gyroscope filter, from the truth that an environment records."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ...core.rotation import conjugate, multiply, to_euler_zyx, up_in_body
from ..relative_sensor import relative_angles
from .kinematics import in_paper_axes, platform_rate


def true_angles(
    truth: Mapping[str, np.ndarray],
    body: Literal["trunk", "disk"] = "trunk",
    imu_tilt: float = math.radians(10.0),
    used_axes: tuple[int, ...] = (0, 2),
) -> dict[str, np.ndarray]:
    """Quantity of :class:`.TwoGyro` → ``(T, size)``.

    Args:
        truth: ``bicycle/orientation`` and ``<body>/orientation`` ``(T, 4)``, body to world; with
            ``bicycle_imu/gyroscope_bias`` ``(T, 3)`` the platform's biases are returned too.
        body: the body of the second gyroscope.
        imu_tilt: tilt of the platform's gyroscope, nose up, rad.
        used_axes: of the platform's biases, :attr:`.TwoGyro.used_axes`.

    Raises:
        ValueError: an orientation is missing.
    """
    names = ("bicycle/orientation", f"{body}/orientation")
    missing = [name for name in names if name not in truth]
    if missing:
        raise ValueError(f"truth must contain {' and '.join(names)}; {missing} are missing")
    platform, on_it = (np.asarray(truth[name], dtype=float) for name in names)
    _, pitch, roll = to_euler_zyx(platform)
    angles = {
        "bicycle/roll": roll[..., None],
        "two-gyro/pitch": -pitch[..., None],
        "two-gyro/relative_angles": relative_angles(multiply(conjugate(platform), on_it)),
        "two-gyro/body_up": up_in_body(on_it),
    }
    if "bicycle_imu/gyroscope_bias" in truth:
        bias = in_paper_axes(platform_rate(np.asarray(truth["bicycle_imu/gyroscope_bias"], dtype=float), imu_tilt))
        angles["two-gyro/platform_bias"] = bias[..., list(used_axes)]
    return angles


def true_states(truth: Mapping[str, np.ndarray], model: Any) -> np.ndarray:
    """True states ``(T, n)`` of a filter, for bounds; biases that are missing in the truth are zero.

    Args:
        truth: as for :func:`true_angles`, with ``trunk_imu/gyroscope_bias`` (or ``disk/gyroscope_bias``) for biases.
        model: the filter, a :class:`.TwoGyro`.
    """
    angles = true_angles(truth, model.body, model.imu_tilt)
    main = angles["bicycle/roll"] if model.platform == "bicycle" else angles["two-gyro/pitch"]
    nothing = np.zeros((len(main), 3))
    body = in_paper_axes(truth.get(model.body_gyroscope.replace("gyr", "gyroscope_bias"), nothing))
    platform = platform_rate(truth.get("bicycle_imu/gyroscope_bias", nothing), model.imu_tilt)
    return np.concatenate([main, angles["two-gyro/relative_angles"], body, platform[:, list(model.used_axes)]], axis=-1)
