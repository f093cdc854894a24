"""Orientation of a controller that points at targets: the comparison of chapter 5 of the thesis, on simulated devices.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval. Motions are those of ``gesture="pointing"`` (targets within ±45°, moves of 1.5 s along fifth-order polynomials,
acceleration of 5 m/s² rms an axis between 0.3 and 2 Hz), readings those of the environment's devices with the thesis'
noises (σ_a = 0.1 g, σ_ω = 0.1 rad/s, σ_m 1 % of the field). Functions return rows that JSON can hold, for
:class:`~poise.baselines.studies.kit.Study`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.hand.controller_gestures import Pointing
from ....envs.hand.devices import DEVICES
from ....envs.hand.sensing import simulate_hand
from ....envs.sensors.ideal import STANDARD_GRAVITY
from ....filters.arrays.equivalent_imu import array_to_imu
from ....filters.arrays.rate import ANGULAR_RATE, ArrayRate
from ....filters.arrays.spatial.orientation import ArrayOrientation
from ....filters.arrays.spatial.pointing import pointing_angles, tilt_error_bound
from ....filters.core import metrics, rotation
from ....filters.core.estimator import run
from ....filters.core.kalman import KalmanFilter
from ....filters.core.observer import Observer
from ....filters.imu.marins import Marins

RATE = 100.0
"""Hz"""
DURATION = 100.0
"""s of a run, as in the thesis"""
FIELD = 50.0
"""µT, of which 1 % is the noise"""
PRINTED_LIMIT = math.radians(3.0)
"""Figures 5.6 to 5.10: errors of pitch and azimuth"""
STEEP = math.radians(70.0)
"""rad: a magnetic field as in middle Europe; the thesis gives no direction"""


@dataclass(frozen=True)
class Way:
    """One way of estimating: a name for tables and what makes it."""

    name: str
    kind: str = "array"
    """``array``: :class:`.ArrayOrientation`; ``marins``: :class:`.Marins`"""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    array_rate: bool = False
    """whether the rate of the array (the weighted method of chapter 2) takes the place of a gyroscope"""

    def estimator(self, trajectory: Trajectory, array: Any, dip: float, start: np.ndarray) -> KalmanFilter:
        """The estimator, told the start and the field, as the thesis' are."""
        common: dict[str, Any] = {
            "dt": trajectory.dt,
            "start": "given",
            "field": "given",
            "dip": dip,
            "start_orientation": tuple(start.tolist()),
        }
        if self.kind == "marins":
            return KalmanFilter(Marins(**common, **self.parameters), keep_covariance=False)
        model = ArrayOrientation(array=array, gravity=STANDARD_GRAVITY, **common, **self.parameters)
        return KalmanFilter(model, keep_covariance=False)


AS_PRINTED = {"exact_rotation": False, "orthonormalise": False}
PROPOSED = "proposed, sound"

CONTROLLER_WAYS = (
    Way(PROPOSED),
    Way("proposed, first order", parameters=AS_PRINTED),
    Way("proposed, F as printed", parameters=AS_PRINTED | {"coupling_sign": -1.0}),
    Way("proposed, gravity as printed", parameters={"gravity_sign": -1.0}),
    Way("tilt sensor", parameters={"method": "tilt"}),
    Way("integration", parameters={"method": "integration"}),
    Way("Marins, σ_q = 0.01", "marins", {"quaternion_deviation": 0.01}),
    Way("Marins, σ_q = 0.5", "marins", {"quaternion_deviation": 0.5}),
)
OCTA_WAYS = (
    Way("proposed, sound, with gyroscope"),
    Way("proposed, first order, with gyroscope", parameters=AS_PRINTED),
    Way("proposed, sound, no gyroscope", parameters={"gyroscope": False}),
    Way("proposed, first order, no gyroscope", parameters=AS_PRINTED | {"gyroscope": False}),
    Way(
        "proposed, F as printed, no gyroscope",
        parameters=AS_PRINTED | {"gyroscope": False, "coupling_sign": -1.0},
    ),
    Way("tilt sensor", parameters={"method": "tilt"}),
    Way("integration of the array's rate", parameters={"method": "integration"}, array_rate=True),
    Way("Marins, σ_q = 0.01, array's rate", "marins", {"quaternion_deviation": 0.01}, array_rate=True),
    Way("Marins, σ_q = 0.3, array's rate", "marins", {"quaternion_deviation": 0.3}, array_rate=True),
)
WAYS = {"controller": CONTROLLER_WAYS, "octa": OCTA_WAYS}
"""Device → what is compared; OCTA is simulated with a gyroscope beside it, which only the first ways read"""


def pointed(
    device: str, seed: int, duration: float = DURATION, dip: float = 0.0, *, gesture: Pointing | None = None
) -> Trajectory:
    """A device that points at targets, in a magnetic field ``dip`` rad below north."""
    name = "octa-gyroscope" if device == "octa" else device
    field = (0.0, FIELD * math.cos(dip), -FIELD * math.sin(dip))
    held = replace(DEVICES[name], magnetic_field=field)
    return simulate_hand(gesture or Pointing(), seed, None, RATE, duration, device=held)


def estimated(way: Way, device: str, trajectory: Trajectory, dip: float, start: np.ndarray | None = None) -> np.ndarray:
    """Orientation ``(T, 4)`` by one way; ``start`` None is the true one."""
    array = DEVICES[device].array
    measurements = dict(trajectory.measurements)
    if way.kind == "marins":
        measurements["imu/acc"] = array_to_imu(array, measurements["array/acc"])
    if way.array_rate:
        observer = Observer(ArrayRate(dt=trajectory.dt, array=array, bias_noise=0.0))
        measurements["imu/gyr"] = run(observer, measurements).pose[ANGULAR_RATE.name]
    first = trajectory.truth["orientation"][0] if start is None else start
    return run(way.estimator(trajectory, array, dip, first), measurements).pose["orientation"]


def pointing_errors(estimate: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors ``(T,)`` of pitch and azimuth (wrapped, signed) and of the whole rotation, rad."""
    found, true = pointing_angles(estimate), pointing_angles(truth)
    pitch, azimuth = (rotation.wrap(a - b) for a, b in zip(found, true, strict=True))
    return pitch, azimuth, metrics.total_error(estimate, truth)


def attitude_errors(
    device: str, seed: int, duration: float = DURATION, dip: float = 0.0, names: Iterable[str] = ()
) -> list[dict[str, Any]]:
    """Errors of every way on one motion, degrees.

    Args:
        device: ``controller`` or ``octa``.
        seed: of motion and noise.
        duration: s.
        dip: of the field, rad.
        names: of the ways; none for all.

    Returns:
        A row for each way: ``device``, ``way``, ``seed``, ``pitch`` and ``azimuth`` (rms), ``pitch_max`` and
        ``azimuth_max``, ``inside`` (share of samples within ±3° in both), ``total`` (rms of the whole rotation).
    """
    trajectory, rows, wanted = pointed(device, seed, duration, dip), [], set(names)
    for way in WAYS[device]:
        if wanted and way.name not in wanted:
            continue
        pitch, azimuth, total = pointing_errors(
            estimated(way, device, trajectory, dip), trajectory.truth["orientation"]
        )
        inside = (np.abs(pitch) < PRINTED_LIMIT) & (np.abs(azimuth) < PRINTED_LIMIT)
        rows.append(
            {
                "device": device,
                "way": way.name,
                "seed": seed,
                "pitch": degrees_rms(pitch),
                "pitch_max": float(np.degrees(np.abs(pitch).max())),
                "azimuth": degrees_rms(azimuth),
                "azimuth_max": float(np.degrees(np.abs(azimuth).max())),
                "inside": float(inside.mean()),
                "total": degrees_rms(total),
            }
        )
    return rows


def degrees_rms(error: np.ndarray) -> float:
    """Root mean square of an error in rad, degrees."""
    return float(np.degrees(metrics.rms(error)))


COLUMNS = {
    "pitch": "pitch, rms",
    "pitch_max": "pitch, max",
    "azimuth": "azimuth, rms",
    "azimuth_max": "azimuth, max",
    "inside": "within ±3°",
    "total": "total, rms",
}


def attitude_table(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Means over the seeds (of the largest errors: the largest), a row for each device and way, degrees."""
    rows = list(rows)
    table = []
    for device, ways in WAYS.items():
        for way in ways:
            found = [row for row in rows if row["device"] == device and row["way"] == way.name]
            if not found:
                continue
            line: dict[str, Any] = {"device": device, "method": way.name}
            for key, column in COLUMNS.items():
                values = [row[key] for row in found]
                line[column] = max(values) if key.endswith("_max") else float(np.mean(values))
            table.append(line)
    return table


def wrong_start(seed: int, angle: float = math.radians(40.0), duration: float = 60.0) -> dict[str, Any]:
    """A controller that is told a start rolled by ``angle`` about its pointing axis, with a closed and an open prior.

    Returns:
        Prior → total error in degrees, rms over 5 to 20 s and over the last 20 s.
    """
    trajectory = pointed("controller", seed, duration)
    truth = trajectory.truth["orientation"]
    start = rotation.multiply(truth[0], rotation.exp(np.array([0.0, angle, 0.0])))
    found: dict[str, Any] = {"seed": seed}
    for label, way in (
        ("closed prior", CONTROLLER_WAYS[0]),
        ("open prior", Way("open", parameters={"orientation_prior": 1.0})),
        ("open prior, first order", Way("open", parameters=AS_PRINTED | {"orientation_prior": 1.0})),
    ):
        total = metrics.total_error(estimated(way, "controller", trajectory, 0.0, start), truth)
        early, late = (trajectory.time > 5.0) & (trajectory.time < 20.0), trajectory.time > duration - 20.0
        found[label] = [degrees_rms(total[early]), degrees_rms(total[late])]
    return found


def cone(seed: int, duration: float = DURATION) -> dict[str, float]:
    """Share of samples whose pitch errs by more than (5.63) allows a tilt sensor, by its arcsine and its arctangent.

    The filter has memory, so neither is a strict bound. The rest at the start, where both are zero, is left out.
    """
    trajectory = pointed("controller", seed, duration)
    truth, acceleration = trajectory.truth["orientation"], trajectory.truth["acceleration"]
    arcsine = tilt_error_bound(acceleration, STANDARD_GRAVITY)
    arctangent = np.arctan(np.linalg.norm(acceleration, axis=-1) / STANDARD_GRAVITY)
    # the hand gets under way within a second after the rest
    moving = trajectory.time > Pointing().rest + 1.0
    shares = {}
    for way in (CONTROLLER_WAYS[0], CONTROLLER_WAYS[4]):
        pitch = np.abs(pointing_errors(estimated(way, "controller", trajectory, 0.0), truth)[0])
        shares[f"{way.name}, beyond the arcsine"] = float((pitch > arcsine)[moving].mean())
        shares[f"{way.name}, beyond the arctangent"] = float((pitch > arctangent)[moving].mean())
    return shares


def attitude_curves(device: str, seed: int, duration: float = DURATION, every: int = 5) -> dict[str, Any]:
    """Pitch, azimuth and their errors over time, degrees, as in Figures 5.6, 5.7, 5.9 and 5.10; and directions.

    Returns:
        ``time``; ``pitch`` and ``azimuth``, the true ones; ``errors``: way → [pitch, azimuth]; ``found``: the same two
        angles of the first way.
    """
    trajectory = pointed(device, seed, duration)
    truth = trajectory.truth["orientation"]
    shown = [way for way in WAYS[device] if "printed" not in way.name and "first order" not in way.name]
    pitch, azimuth = (np.degrees(angle)[::every].tolist() for angle in pointing_angles(truth))
    curves: dict[str, Any] = {"time": trajectory.time[::every].tolist(), "pitch": pitch, "azimuth": azimuth}
    curves["errors"] = {}
    for index, way in enumerate(shown):
        estimate = estimated(way, device, trajectory, 0.0)
        both = pointing_errors(estimate, truth)[:2]
        curves["errors"][way.name] = [np.degrees(error)[::every].tolist() for error in both]
        if index == 0:
            curves["found"] = [np.degrees(angle)[::every].tolist() for angle in pointing_angles(estimate)]
    return curves
