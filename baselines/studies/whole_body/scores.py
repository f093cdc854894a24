"""Errors of whole-body estimates in the columns of the paper's table III, and the filters of its study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.whole_body.filter import SEAT_FORCE, WholeBody
from ....filters.bicycle.whole_body.integration import WholeBodyIntegration
from ....filters.bicycle.whole_body.linkage import ERROR_SIZE, HIP, ROLL, SHOULDER, SIDES, TRUNK, true_angles
from ....filters.core import rotation
from ....filters.core.consistency import nees
from ....filters.core.kalman import KalmanFilter
from ....filters.core.observer import Observer
from ....filters.core.quantity import Estimate

COLUMNS: dict[str, tuple[str, int]] = {"φ": ("bicycle/roll", 0)}
COLUMNS |= {f"θ{i + 1}": ("trunk/angles", i) for i in range(3)}
for _side in SIDES:
    COLUMNS |= {f"φ{_side[0]}{i + 1}": (f"shoulder_{_side}/angles", i) for i in range(3)}
    COLUMNS |= {f"α{_side[0]}": (f"elbow_{_side}/flexion", 0)}
    COLUMNS |= {f"ψ{_side[0]}{i + 1}": (f"hip_{_side}/angles", i) for i in range(3)}
    COLUMNS |= {f"β{_side[0]}": (f"knee_{_side}/flexion", 0)}
"""Name of an angle in the paper → quantity and component, in the order of table III."""

PRINTED = {
    "indoor": "0.61±.13 2.21±.46 2.98±.97 3.46±1.04 4.28±1.76 4.01±1.67 3.97±2.69 4.46±1.40 4.33±.83 4.71±1.35 "
    "4.80±1.32 5.01±1.22 3.23±1.66 4.33±2.54 4.81±1.50 4.86±1.31 4.28±1.38 3.88±1.68 5.23±3.22 4.93±2.43",
    "outdoor": "0.86±.20 3.13±.56 4.85±1.75 4.03±2.18 5.36±1.41 5.82±1.39 4.53±1.78 6.35±2.63 5.27±1.91 6.22±2.11 "
    "5.57±3.06 5.27±1.97 6.47±2.11 4.92±1.45 5.72±1.51 5.13±2.27 5.43±3.16 5.28±2.13 6.34±2.13 5.21±2.16",
}
"""Table III, deg: RMS error, mean ± standard deviation over five subjects."""

PARTS: dict[str, Any] = {
    "φ": [ROLL.start],
    "Θ, Φ": [*range(TRUNK.start, TRUNK.stop), *(i for side in SIDES for i in range(*SHOULDER[side].indices(20)))],
    "Ψ right": HIP["right"],
    "Ψ left": HIP["left"],
}
"""States whose consistency is looked at."""


def printed(course: str) -> dict[str, str]:
    """Column → what table III has."""
    return dict(zip(COLUMNS, PRINTED[course].split(), strict=True))


def samples(ride: Trajectory) -> dict[str, np.ndarray]:
    """What the filter reads of a ride."""
    return {channel.name: ride.measurements[channel.name] for channel in WholeBody.channels}


def without_biases(ride: Trajectory) -> dict[str, np.ndarray]:
    """The same with the true biases of gyroscopes and accelerometers taken away."""
    found = samples(ride)
    for name in found:
        place, kind = name.split("/")
        bias = f"{place}/{ {'gyr': 'gyroscope', 'acc': 'accelerometer'}.get(kind, kind) }_bias"
        if kind in ("gyr", "acc") and bias in ride.truth:
            found[name] = found[name] - ride.truth[bias]
    return found


def with_trunk_on_the_seat(ride: Trajectory, model: WholeBody) -> dict[str, np.ndarray]:
    """The same with load cells that feel just what (9*) says: no pedals, and hands that carry nothing."""
    found = samples(ride)
    angles = true_angles(ride.truth)["trunk/angles"]
    x = np.zeros((len(ride), model.state_size))
    x[:, TRUNK] = angles
    rate = model.bicycle_axes(found["bicycle_imu/gyr"])
    x[:, SEAT_FORCE] = model._seat_force(found, rate, 0.0 * rate)
    R, J = rotation.euler_matrix("zxy", angles), rotation.euler_axes("zxy", angles)
    half = model._torque(x, R, J)[0][:, 0] / model.cells_wide
    found["seat/load_cells"] = np.stack([0.0 * half + 100.0, 150.0 + half, 150.0 - half], axis=-1)
    return found


def filter_of(geometry: RiderGeometry, **parameters: Any) -> KalmanFilter:
    """The filter for a person."""
    return KalmanFilter(WholeBody.for_rider(geometry, **parameters))


def integration_of(geometry: RiderGeometry) -> Observer:
    """The gyroscopes integrated."""
    return Observer(WholeBodyIntegration.for_rider(geometry))


def errors(estimate: Estimate, truth: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Column → error ``(T,)``, deg, signed."""
    true = true_angles(truth)
    return {
        column: np.degrees(rotation.wrap(estimate.pose[name][:, i] - true[name][:, i]))
        for column, (name, i) in COLUMNS.items()
    }


def rms(found: Mapping[str, np.ndarray], time: np.ndarray, begin: float, end: float = np.inf) -> dict[str, float]:
    """Column → RMS error between two times, deg."""
    part = (time - time[0] >= begin) & (time - time[0] <= end)
    return {column: float(np.sqrt(np.mean(error[part] ** 2))) for column, error in found.items()}


def consistency_of(estimate: Estimate, truth: Mapping[str, np.ndarray], begin: int) -> dict[str, float]:
    """NEES over the degrees of freedom for each part, and NIS over the rows, averaged from tick ``begin`` on."""
    true = true_angles(truth)
    states = np.zeros((len(estimate.pose["bicycle/roll"]), ERROR_SIZE))
    places = {"bicycle/roll": ROLL, "trunk/angles": TRUNK}
    for side in SIDES:
        places |= {f"shoulder_{side}/angles": SHOULDER[side], f"hip_{side}/angles": HIP[side]}
    for name, part in places.items():
        states[:, part] = rotation.wrap(estimate.pose[name] - true[name])
    assert estimate.covariance is not None
    assert estimate.innovation is not None
    found = {}
    for name, part in PARTS.items():
        error, P = states[begin:, part], estimate.covariance[begin:, part][:, :, part]
        found[f"NEES {name}"] = float(np.mean(nees(error, P)) / error.shape[-1])
    found["NIS"] = float(np.mean(estimate.innovation[begin:] ** 2))
    return found


def averaged(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Mean of every column over rides, NaN left out."""
    return {column: float(np.nanmean([row[column] for row in rows])) for column in rows[0]}


def short(row: Mapping[str, float]) -> dict[str, str]:
    """A row of twenty angles in eleven columns, three angles of a joint in one cell."""
    cells = {"φ": f"{row['φ']:.2f}", "Θ": " ".join(f"{row[f'θ{i}']:.2f}" for i in (1, 2, 3))}
    for side in ("r", "l"):
        cells[f"Φ{side}"] = " ".join(f"{row[f'φ{side}{i}']:.2f}" for i in (1, 2, 3))
        cells[f"α{side}"] = f"{row[f'α{side}']:.2f}"
        cells[f"Ψ{side}"] = " ".join(f"{row[f'ψ{side}{i}']:.2f}" for i in (1, 2, 3))
        cells[f"β{side}"] = f"{row[f'β{side}']:.2f}"
    return cells
