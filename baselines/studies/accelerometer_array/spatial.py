"""Chapter 5 of the thesis: orientation of a controller, and of an OCTA, that point at targets.

Motions are those of ``gesture="pointing"`` (targets within ±45°, moves of 1.5 s along fifth-order polynomials,
acceleration of 5 m/s² rms an axis between 0.3 and 2 Hz), readings those of the environment's devices with the thesis'
noises (σ_a = 0.1 g, σ_ω = 0.1 rad/s, σ_m 1 % of the field).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.hand.controller_gestures import Pointing
from ....envs.hand.devices import DEVICES
from ....envs.hand.sensing import simulate_hand
from ....filters.arrays.equivalent_imu import array_to_imu
from ....filters.arrays.rate import ANGULAR_RATE, ArrayRate
from ....filters.arrays.spatial.orientation import ArrayOrientation
from ....filters.arrays.spatial.pointing import pointing_angles, tilt_error_bound
from ....filters.core import metrics, rotation
from ....filters.core.estimator import run
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import STANDARD_GRAVITY
from ....filters.core.recursion import Observer
from ....filters.imu.marins import Marins
from ..claims import Claim
from ..kit import Study
from ..report import OVER_MOTIONS, Report
from ..ride_study import ZERO
from .figures import move_figure, pointing_figures, readings_figure
from .tables import Row, grouped, mean_of, results_of, values_of

RATE = 100.0
"""Hz"""
DURATION = 100.0
"""s of a run, as in the thesis"""
FIELD = 50.0
"""µT, of which 1 % is the noise"""
LIMIT = 3.0
"""deg: Figures 5.6 to 5.10 show errors of pitch and azimuth within it"""
STEEP = math.radians(70.0)
"""rad: a magnetic field as in middle Europe; the thesis gives no direction"""
AS_PUBLISHED = {"exact_rotation": False, "orthonormalise": False}
NO_GYROSCOPE = {"gyroscope": False}
WRONG_SIGN = {"coupling_sign": -1.0}

PROPOSED, FIRST_ORDER = "proposed, exact rotation", "proposed, first order"
READING = "a single exact reading"
WITH_GYROSCOPE, WITHOUT_GYROSCOPE = "proposed, exact rotation, with gyroscope", "proposed, exact rotation, no gyroscope"
METHODS: dict[str, dict[str, dict[str, Any]]] = {
    "controller": {
        PROPOSED: {},
        FIRST_ORDER: AS_PUBLISHED,
        "proposed, F as published": AS_PUBLISHED | WRONG_SIGN,
        "proposed, gravity as published": {"gravity_sign": -1.0},
        "tilt sensor": {"method": "tilt"},
        "integration": {"method": "integration"},
        "Marins, σ_q = 0.01": {"quaternion_std": 0.01},
        "Marins, σ_q = 0.5": {"quaternion_std": 0.5},
    },
    "octa": {
        WITH_GYROSCOPE: {},
        "proposed, first order, with gyroscope": AS_PUBLISHED,
        WITHOUT_GYROSCOPE: NO_GYROSCOPE,
        "proposed, first order, no gyroscope": AS_PUBLISHED | NO_GYROSCOPE,
        "proposed, F as published, no gyroscope": AS_PUBLISHED | NO_GYROSCOPE | WRONG_SIGN,
        "tilt sensor": {"method": "tilt"},
        "integration of the array's rate": {"method": "integration"},
        "Marins, σ_q = 0.01, array's rate": {"quaternion_std": 0.01},
        "Marins, σ_q = 0.3, array's rate": {"quaternion_std": 0.3},
    },
}
"""Device → name in tables → parameters of :class:`.Marins` (names that begin so) or :class:`.ArrayOrientation`. OCTA is
simulated with a gyroscope beside it, which only the first methods read; *array's rate* takes the place of a gyroscope
for others (the weighted method of chapter 2)."""
QUICK_OCTA = (WITH_GYROSCOPE, WITHOUT_GYROSCOPE, "integration of the array's rate", "Marins, σ_q = 0.01, array's rate")
STEEP_METHODS = (PROPOSED, "Marins, σ_q = 0.5", "Marins, σ_q = 0.01")
PUBLISHED = {
    ("controller", PROPOSED): "within ±3",
    ("octa", WITH_GYROSCOPE): None,
    ("octa", WITHOUT_GYROSCOPE): "within ±3",
}
"""Device and method → what figures 5.6 to 5.10 show of the largest errors, deg"""


def pointed(device: str, seed: int, duration: float = DURATION, dip: float = 0.0) -> Trajectory:
    """A device that points at targets, in a magnetic field ``dip`` rad below north."""
    name = "octa-gyroscope" if device == "octa" else device
    field = (0.0, FIELD * math.cos(dip), -FIELD * math.sin(dip))
    held = replace(DEVICES[name], magnetic_field=field)
    return simulate_hand(Pointing(), seed, None, RATE, duration, device=held)


def estimated(*args: Any, **kwargs: Any) -> np.ndarray:
    """Orientation ``(T, 4)`` by a method of :func:`prepared`."""
    model, measurements = prepared(*args, **kwargs)
    return run(KalmanFilter(model, keep_covariance=False), measurements).pose["orientation"]


def prepared(
    method: str,
    device: str,
    trajectory: Trajectory,
    dip: float = 0.0,
    start: np.ndarray | None = None,
    **parameters: Any,
) -> tuple[Any, dict[str, np.ndarray]]:
    """Model and samples of a method that knows the start (None: the true one) and the field, as the thesis' do."""
    array, measurements = DEVICES[device].array, dict(trajectory.measurements)
    if "array's rate" in method:
        observer = Observer(ArrayRate(dt=trajectory.dt, array=array, bias_noise=0.0))
        measurements["imu/gyr"] = run(observer, measurements).pose[ANGULAR_RATE.name]
    first = trajectory.truth["orientation"][0] if start is None else start
    common: dict[str, Any] = {"dt": trajectory.dt, "start": "given", "field": "given", "dip": dip}
    common |= {"start_orientation": tuple(first.tolist())} | METHODS[device][method] | parameters
    if method.startswith("Marins"):
        measurements["imu/acc"] = array_to_imu(array, measurements["array/acc"])
        model: Any = Marins(**common)
    else:
        model = ArrayOrientation(array=array, gravity=STANDARD_GRAVITY, **common)
    return model, measurements


def pointing_errors(estimate: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors ``(T,)`` of pitch and azimuth (wrapped, signed) and of the whole rotation, rad."""
    found, true = pointing_angles(estimate), pointing_angles(truth)
    pitch, azimuth = (rotation.wrap(a - b) for a, b in zip(found, true, strict=True))
    return pitch, azimuth, metrics.total_error(estimate, truth)


def attitude_errors(
    device: str, seed: int, duration: float = DURATION, dip: float = 0.0, methods: Iterable[str] = ()
) -> list[Row]:
    """Errors of some methods (none: all, and a device that always points north and level) on one motion, degrees.

    Returns:
        A row for each method: ``device``, ``method``, ``seed``, ``pitch`` and ``azimuth`` (rms), ``pitch_max`` and
        ``azimuth_max``, ``inside`` (share of samples within ±3° in both), ``total`` (rms of the whole rotation).
    """
    trajectory, rows, wanted = pointed(device, seed, duration, dip), [], set(methods) or {*METHODS[device], ZERO}
    for method in (*METHODS[device], ZERO):
        if method not in wanted:
            continue
        if method == ZERO:
            # north and level
            estimate = np.zeros_like(trajectory.truth["orientation"])
            estimate[:, 0] = 1.0
        else:
            estimate = estimated(method, device, trajectory, dip)
        pitch, azimuth, total = map(np.degrees, pointing_errors(estimate, trajectory.truth["orientation"]))
        inside = (np.abs(pitch) < LIMIT) & (np.abs(azimuth) < LIMIT)
        rows.append(
            {
                "device": device,
                "method": method,
                "seed": seed,
                "pitch": float(metrics.rms(pitch)),
                "pitch_max": float(np.abs(pitch).max()),
                "azimuth": float(metrics.rms(azimuth)),
                "azimuth_max": float(np.abs(azimuth).max()),
                "inside": float(inside.mean()),
                "total": float(metrics.rms(total)),
            }
        )
    return rows


def attitude_table(rows: list[Row]) -> list[Row]:
    """Means over the seeds (of the largest errors: the largest), a row for each device and method, degrees."""
    columns: dict[str, tuple[str, Any]] = {
        "pitch, rms": ("pitch", np.mean),
        "pitch, max": ("pitch_max", max),
        "azimuth, rms": ("azimuth", np.mean),
        "azimuth, max": ("azimuth_max", max),
        "within ±3°": ("inside", np.mean),
        "total, rms": ("total", np.mean),
    }
    return grouped(rows, {"device": "device", "method": "method"}, columns)


def wrong_start(seed: int, duration: float = 60.0) -> dict[str, list[float]]:
    """A controller whose filter starts rolled by 40° about the pointing axis, with a closed and an open prior.

    Returns:
        Prior → total error in degrees, rms over 5 to 20 s and over the last 20 s.
    """
    trajectory = pointed("controller", seed, duration)
    truth, time = trajectory.truth["orientation"], trajectory.time
    start = rotation.multiply(truth[0], rotation.exp(np.array([0.0, math.radians(40.0), 0.0])))
    found = {}
    for label, parameters in (
        ("closed prior", {}),
        ("open prior", {"orientation_prior": 1.0}),
        ("open prior, first order", AS_PUBLISHED | {"orientation_prior": 1.0}),
    ):
        estimate = estimated(PROPOSED, "controller", trajectory, start=start, **parameters)
        total = np.degrees(metrics.total_error(estimate, truth))
        parts = (time > 5.0) & (time < 20.0), time > duration - 20.0
        found[label] = [float(metrics.rms(total[part])) for part in parts]
    return found


def cone(seed: int, duration: float = DURATION) -> dict[str, float]:
    """Share of samples whose pitch errs by more than (5.63) allows a tilt sensor, by its arcsine and its arctangent.

    The filter has memory, so neither is a strict bound. The rest at the start, where both are zero, is left out.
    """
    trajectory = pointed("controller", seed, duration)
    truth, acceleration = trajectory.truth["orientation"], trajectory.truth["acceleration"]
    bounds = {
        "arcsine": tilt_error_bound(acceleration, STANDARD_GRAVITY),
        "arctangent": np.arctan(np.linalg.norm(acceleration, axis=-1) / STANDARD_GRAVITY),
    }
    # the hand gets under way within a second after the rest
    moving = trajectory.time > Pointing().rest + 1.0
    shares = {}
    for method in (PROPOSED, "tilt sensor"):
        pitch = np.abs(pointing_errors(estimated(method, "controller", trajectory), truth)[0])
        for name, bound in bounds.items():
            shares[f"{method}, beyond the {name}"] = float((pitch > bound)[moving].mean())
    # the pitch that an exact accelerometer reads if its specific force is taken for the vertical
    force = rotation.rotate_back(truth, acceleration + np.array([0.0, 0.0, STANDARD_GRAVITY]))
    pitch = np.abs(np.arctan2(force[:, 1], np.hypot(force[:, 0], force[:, 2])) - pointing_angles(truth)[0])
    # beyond by more than rounding
    shares[f"{READING}, beyond the arcsine"] = float((pitch > bounds["arcsine"] + 1e-9)[moving].mean())
    return shares


def pointing_curves(
    device: str, trajectory: Trajectory, reference: np.ndarray, methods: Iterable[str], every: int = 1
) -> dict[str, Any]:
    """Pitch and azimuth of a reference ``(T, 4)`` and errors of methods against it, every so many samples, deg.

    Returns:
        ``time``; ``pitch`` and ``azimuth`` of the reference; ``errors``: method → [pitch, azimuth].
    """

    def shown(angles: Iterable[np.ndarray]) -> list[list[float]]:
        return [np.degrees(angle)[::every].tolist() for angle in angles]

    pitch, azimuth = shown(pointing_angles(reference))
    errors = {
        method: shown(pointing_errors(estimated(method, device, trajectory), reference)[:2]) for method in methods
    }
    return {"time": trajectory.time[::every].tolist(), "pitch": pitch, "azimuth": azimuth, "errors": errors}


def simulated_curves(device: str, seed: int, duration: float) -> dict[str, Any]:
    """:func:`pointing_curves` of the simulation, as in Figures 5.6, 5.7, 5.9 and 5.10; the proposed method first."""
    trajectory = pointed(device, seed, duration)
    methods = [method for method in METHODS[device] if "published" not in method and "first order" not in method]
    return pointing_curves(device, trajectory, trajectory.truth["orientation"], methods, 5)


def claims(rows: list[Row]) -> list[Claim]:
    """What figures 5.6 to 5.11 show, and what one would read off the table."""
    total = {
        device: {name: mean_of(rows, "total", device=device, method=name) for name in METHODS[device]}
        for device in METHODS
    }
    held, octa = total["controller"], total["octa"]
    found, largest = [], {}
    for device, method in (
        ("controller", PROPOSED),
        ("controller", FIRST_ORDER),
        ("octa", WITH_GYROSCOPE),
        ("octa", WITHOUT_GYROSCOPE),
    ):
        worst = max(
            each for key in ("pitch_max", "azimuth_max") for each in values_of(rows, key, device=device, method=method)
        )
        found.append(Claim.less(f"{device}: {method} keeps pitch and azimuth within ±3°", worst, LIMIT))
        largest[device, method] = worst
    found += [
        Claim.less(
            "controller: the first-order transition more than doubles the largest error",
            largest["controller", PROPOSED],
            largest["controller", FIRST_ORDER],
            factor=0.5,
        ),
        Claim.less(
            "octa: without a gyroscope the largest error is more than five times as large",
            largest["octa", WITH_GYROSCOPE],
            largest["octa", WITHOUT_GYROSCOPE],
            factor=0.2,
        ),
    ]
    for method in ("tilt sensor", "Marins, σ_q = 0.01"):
        statement = f"controller: {method} is more than ten times as wrong as the proposed method"
        found.append(Claim.less(statement, held[PROPOSED], held[method], factor=0.1))
    weighted, gravity = held["Marins, σ_q = 0.5"], held["proposed, gravity as published"]
    lone = octa["proposed, first order, no gyroscope"], octa["proposed, F as published, no gyroscope"]
    return [
        *found,
        Claim.less(
            "controller: Marins with σ_q = 0.5 is within three times that", weighted, held[PROPOSED], factor=3.0
        ),
        Claim.less(
            "controller: with the gyroscope the published sign of F adds at most a fifth to the error",
            held["proposed, F as published"],
            held[FIRST_ORDER],
            factor=1.2,
        ),
        Claim.less("octa without gyroscope: the published sign of F more than doubles the error", *lone, factor=0.5),
        Claim.less(
            "controller: the published sign of gravity more than doubles the error", held[PROPOSED], gravity, factor=0.5
        ),
    ]


def spatial(study: Study, report: Report) -> list[Row]:
    """Tables and figures of the pointing simulation; returns the errors of every motion."""
    seeds, duration = (2, 30.0) if study.quick else (10, DURATION)
    roots = [study.seed_of("pointing", index) for index in range(seeds)]
    jobs: list[tuple[Any, ...]] = [("controller", seed, duration, 0.0, ()) for seed in roots]
    jobs += [("octa", seed, duration, 0.0, QUICK_OCTA if study.quick else ()) for seed in roots]
    rows = [row for found in study.map("pointing", attitude_errors, jobs) for row in found]
    report.numbers(results_of(rows, "total", "{device} pointing {seed}", "orientation", "total", "deg"))
    report.compare(
        "Figures 5.6 to 5.10 and Table 5.1, simulation: the proposed method",
        [
            {"device": device, "method": method, "quantity": f"{angle}, {label}", "published": says, "unit": "deg"}
            | {"values": values_of(rows, key, device=device, method=method)}
            for (device, method), published in PUBLISHED.items()
            for angle in ("pitch", "azimuth")
            for key, label, says in ((f"{angle}_max", "largest error", published), (angle, "rms error", None))
        ],
        f"{seeds} motions of {duration:g} s.",
        interval=OVER_MOTIONS,
    )
    report.table(
        "Figures 5.6 to 5.10: every method",
        attitude_table(rows),
        "Degrees: rms means over the motions, the largest error over all of them, the share of samples within ±3° in "
        "pitch and azimuth, and the rms error of the whole rotation, which the thesis does not show. *Exact "
        "rotation* has the exact transition and takes the nearest rotation, *first order* is the thesis' form.",
    )
    report.claims("Chapter 5: what holds here", claims(rows))
    _inclined(study, report, roots[: 2 if study.quick else 5], duration)
    for device in METHODS:
        curves = study.cached(f"pointing curves {device}", simulated_curves, device, roots[0], duration)
        pointing_figures(report, device, curves)
    first = pointed("controller", roots[0], min(duration, 30.0))
    report.figure("pointing-path", move_figure(first), "Figures 5.3 and 5.4: path and profile of a move")
    report.figure("pointing-readings", readings_figure(first), "Figure 5.5: readings with and without noise")
    return rows


def _inclined(study: Study, report: Report, roots: list[int], duration: float) -> None:
    """A steep field, a wrong start, and the cone (5.63)."""
    jobs = [("controller", seed, duration, STEEP, STEEP_METHODS) for seed in roots]
    steep = [row for found in study.map("pointing, steep field", attitude_errors, jobs) for row in found]
    report.table("Inclined field, 70° below the horizon", attitude_table(steep), "Not in the thesis.")
    found = study.map("wrong start", wrong_start, [(seed,) for seed in roots])
    starts = {label: np.mean([one[label] for one in found], axis=0).tolist() for label in found[0]}
    report.table(
        "Start rolled by 40°",
        [{"filter": label, "5 to 20 s": early, "last 20 of 60 s": late} for label, (early, late) in starts.items()],
        "Total error in degrees, rms, means over the motions. The open prior is `orientation_prior=1`.",
    )
    found = study.map("cone", cone, [(seed, duration) for seed in roots])
    shares = {name: float(np.mean([one[name] for one in found])) for name in found[0]}
    report.table(
        "Figure 5.22: share of samples beyond the cone (5.63)",
        [{"bound": name, "share": share} for name, share in shares.items()],
        "For one reading the bound is the arcsine; the thesis prints the arctangent.",
    )
    pitch = {method: mean_of(steep, "pitch", method=method) for method in STEEP_METHODS}
    (closed, late), (opened, _), (_, first_order) = starts.values()
    beyond, single = (100.0 * shares[f"{name}, beyond the arcsine"] for name in ("tilt sensor", READING))
    proposed = 100.0 * shares[f"{PROPOSED}, beyond the arctangent"]
    report.claims(
        "Chapter 5, beyond the figures: what holds here",
        [
            Claim.best("In the steep field the proposed method has the smallest error of pitch", PROPOSED, pitch),
            Claim.less("An open prior halves the error of a wrong start within 20 s", opened, closed, factor=0.5),
            Claim.less("A closed prior forgets it within 60 s (below 2°)", late, 2.0),
            Claim.less("In first order an open prior recovers too (below 2°)", first_order, 2.0),
            Claim.less("(5.63): errors of pitch of the proposed method lie in the cone", proposed, 1.0, "% beyond"),
            Claim.within("(5.63) as arcsine bounds the tilt method's error of pitch", beyond, 0.0, 0.0, "% beyond"),
            Claim.within("(5.63) as arcsine bounds a single exact reading's error", single, 0.0, 0.0, "% beyond"),
        ],
    )
