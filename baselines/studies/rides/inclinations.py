"""What filters of a single IMU make of a ride: errors of inclination on the bicycle and on the trunk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ....envs.bicycle.environment import RiderBicycleEnv
from ....envs.bicycle.sensors.single_imu import imu_of
from ....envs.record import record_once
from ....filters.core.metrics import DEGREES, direction_error, rms
from ...evaluation import evaluate

ESTIMATORS = ("vqf", "mekf", "bounded-motion", "external-acceleration", "mahony", "tilt")
RIDES = (
    ("indoor_circle", "bicycle_imu"),
    ("indoor_circle", "trunk_imu"),
    ("outdoor", "bicycle_imu"),
    ("outdoor", "trunk_imu"),
    ("straight", "bicycle_imu"),
    ("slalom", "bicycle_imu"),
)
"""Scenario and site of the IMU."""


def inclination_rows(
    estimators: Sequence[str] = ESTIMATORS,
    rides: Sequence[tuple[str, str]] = RIDES,
    duration: float = 40.0,
) -> Iterator[dict[str, Any]]:
    """Rows: scenario and site of the IMU, then the RMS error of inclination (deg) of each estimator, in ``duration`` s.

    The last column is that of the mean of the true vertical, which only hindsight knows. Rows of one scenario are of
    the same ride.
    """
    ridden: dict[str, Any] = {}
    for scenario, site in rides:
        if scenario not in ridden:
            suite = ["bicycle_imu/gyr", "bicycle_imu/acc", "trunk_imu/gyr", "trunk_imu/acc"]
            env = RiderBicycleEnv(scenario, 2, suite=suite, duration=duration, fidelity="lumped")
            ridden[scenario] = record_once(env, 7)
        recording = imu_of(ridden[scenario], site)
        table = evaluate(list(estimators), recording)
        errors = table[(table["metric"] == "inclination")].set_index("estimator")["value"]
        up = recording.truth_of("up")
        constant = float(rms(direction_error(up.mean(axis=0), up), recording.mask)) * DEGREES
        row = {name: f"{errors[name]:.1f}" for name in estimators}
        yield {"scenario": scenario, "IMU": site, **row, "best constant": f"{constant:.1f}"}
