"""Magnetometer calibrated by any motion: hard and soft iron, and its axes against those of the other sensors.

Hard and soft iron make an ellipsoid of a sphere, which :func:`.fit_ellipsoid` undoes up to a rotation. That is found
from gravity: with the right axes the angle between field and vertical (the dip) is the same in every attitude. The
vertical is that of a six-axis filter, so no reference is needed.
"""

from __future__ import annotations

import math

import numpy as np

from ....filters.arrays.calibration.magnetometer import fit_ellipsoid
from ....filters.core import rotation
from ....filters.core.estimator import run
from ....filters.core.kalman import KalmanFilter
from ....filters.imu.bounded_motion import BoundedMotion
from ..calibration.records import CalibrationRecord, ChannelCalibration
from ..trajectory import Trajectory

FEWEST = 30
"""Samples of all three sensors that the axes are found from."""
SETTLED = 3.0
"""s of the filter's start that are left out."""
LARGEST_ROTATION = 30.0
"""deg: a larger rotation between the sensors is rather a wrong assignment of axes."""


def calibrate_magnetometer(trajectory: Trajectory, site: str = "imu") -> CalibrationRecord:
    """Calibrate the magnetometer of a recording in which the device was turned about all axes.

    Args:
        trajectory: with ``site/gyr``, ``site/acc`` and ``site/mag`` (any unit).
        site: of the sensors.

    Returns:
        A record for ``site/mag``: unit vectors in the axes of gyroscope and accelerometer. Its details hold the
        residual of the ellipsoid, the rotation between the sensors in deg, the dip of the field in deg and its
        variation.

    Raises:
        ValueError: a missing channel, or attitudes that do not suffice.
    """
    names = {kind: f"{site}/{kind}" for kind in ("gyr", "acc", "mag")}
    lacking = [name for name in names.values() if name not in trajectory.measurements]
    if lacking:
        raise ValueError(
            f"{trajectory.name!r} lacks {', '.join(lacking)}; it holds {', '.join(trajectory.measurements)}"
        )
    on_grid = trajectory.on_grid()
    raw = on_grid.measurements[names["mag"]]
    ellipsoid = fit_ellipsoid(raw)
    unit = (raw - ellipsoid.centre) @ ellipsoid.root.T
    samples = {f"imu/{kind}": on_grid.measurements[name] for kind, name in names.items() if kind != "mag"}
    estimate = run(KalmanFilter(BoundedMotion(dt=on_grid.dt)), samples)
    up = rotation.up_in_body(estimate.pose["relative_orientation"])
    used = np.isfinite(unit).all(axis=1) & np.isfinite(up).all(axis=1)
    used[: round(SETTLED / on_grid.dt)] = False
    if used.sum() < FEWEST:
        raise ValueError(
            f"{trajectory.name!r} has {used.sum()} samples of {', '.join(names.values())} together after the first "
            f"{SETTLED:g} s, at least {FEWEST} are needed"
        )
    turn, spread = rotation_by_dip(unit[used], up[used])
    matrix = np.asarray(rotation.to_matrix(turn)) @ ellipsoid.root
    angle = math.degrees(float(rotation.angle(turn)))
    if angle > LARGEST_ROTATION:
        raise ValueError(
            f"the axes of {names['mag']} are {angle:.0f}° from those of {names['acc']}: check the order and signs of "
            "its columns"
        )
    one = ChannelCalibration(matrix.tolist(), (-matrix @ ellipsoid.centre).tolist(), "1")
    vertical = np.einsum("ti,ti->t", up[used], unit[used] @ np.asarray(rotation.to_matrix(turn)).T)
    details = {
        "centre": ellipsoid.centre.tolist(),
        "residual": ellipsoid.residual,
        "samples": int(used.sum()),
        "rotation_deg": angle,
        "dip_deg": -math.degrees(math.asin(float(np.clip(vertical.mean(), -1.0, 1.0)))),
        "dip_variation_deg": math.degrees(spread),
    }
    return CalibrationRecord({names["mag"]: one}, {names["mag"]: details})


def rotation_by_dip(field: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, float]:
    """Quaternion that turns the field into the axes of ``up`` so that their angle varies least; the variation in rad.

    Both are unit vectors ``(T, 3)``, in the axes of magnetometer and accelerometer.
    """
    from scipy.optimize import least_squares

    step = max(1, len(field) // 3000)
    field, up = field[::step], up[::step]

    def residual(parameters: np.ndarray) -> np.ndarray:
        turned = rotation.rotate(rotation.exp(parameters[:3]), field)
        return np.einsum("ti,ti->t", turned, up) - parameters[3]

    start = np.array([0.0, 0.0, 0.0, float(np.mean(np.sum(field * up, axis=1)))])
    found = least_squares(residual, start, loss="soft_l1", f_scale=0.05)
    level = max(1e-3, math.sqrt(max(0.0, 1.0 - found.x[3] ** 2)))
    return np.asarray(rotation.exp(found.x[:3])), float(np.sqrt(np.mean(residual(found.x) ** 2))) / level
