"""Posterior bound of the spatial orientation filter, with the acceleration of the hand as it lasts in its motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.analysis.bounds import posterior_bound
from ....filters.analysis.lasting_errors import lasting_and_white, lasting_bound
from ....filters.core import rotation
from ..averages import mean_of
from ..claims import Claim
from ..kit import Study
from ..report import Report
from .spatial import (
    PROPOSED,
    WITH_GYROSCOPE,
    WITHOUT_GYROSCOPE,
    estimated,
    pointed,
    pointing_errors,
    prepared,
)

METHODS = (("controller", PROPOSED), ("octa", WITH_GYROSCOPE), ("octa", WITHOUT_GYROSCOPE))
ANGLES = ("pitch", "azimuth", "total")
BOUND, KNOWN = "bound", "bound, known acceleration"
NONE = 1e-6
"""m/s²: deviation of the white acceleration that the filter assumes, in whose place the true one is modelled"""
SETTLED = 2.0
"""s after which errors count"""


def attitude_covariance(P: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Covariance ``(T, 3, 3)`` of the attitude's error about the body's axes, rad², from that of the rows of Q.

    An error e changes row i by q_i × e. The product of these crosses with their transpose is twice the identity.
    """
    Q = rotation.to_matrix(orientation)
    J = np.concatenate([rotation.skew(Q[:, i]) for i in range(3)], axis=-2)
    return 0.25 * J.mT @ P[:, :9, :9] @ J


def true_states(trajectory: Trajectory, size: int, field: np.ndarray) -> np.ndarray:
    """True states ``(T, size)``: rows of Q, angular acceleration, rate and unit field; what is displayed is zero."""
    truth = trajectory.truth
    rows = rotation.to_matrix(truth["orientation"]).reshape(-1, 9)
    known = [rows, truth["angular_acceleration"], truth["angular_rate"], np.tile(field, (len(rows), 1))]
    x = np.concatenate(known, axis=-1)
    return np.pad(x, ((0, 0), (0, size - x.shape[-1])))


def bounds_of(trajectory: Trajectory, model: Any, measurements: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Bounds ``(T, 15, 15)`` for the sensors' white noises.

    Returns:
        ``bound``: the acceleration of the hand is unknown, but for its size and duration. It is common to all
        accelerometers: along each body axis a constant and a second-order process. ``bound, known acceleration``.
    """
    samples = {channel.name: measurements[channel.name] for channel in model.channels}
    start = model.prior({name: values[0] for name, values in samples.items()})[0]
    x = true_states(trajectory, model.state_size, start[15:18])
    hand = rotation.rotate_back(trajectory.truth["orientation"], trajectory.truth["acceleration"])
    shaken, _ = lasting_and_white(hand[trajectory.time >= SETTLED], trajectory.dt, trajectory.dt)
    through = np.zeros((model.residual_size, 3))
    through[: model.geometry.size] = model.geometry.A_P
    errors = [replace(error, rows=through @ error.rows) for error in shaken]
    exact = replace(model, acceleration_std=NONE)
    return {BOUND: lasting_bound(exact, lambda _: x, samples, errors), KNOWN: posterior_bound(exact, x, samples)}


def angles_of(P: np.ndarray, orientation: np.ndarray) -> dict[str, np.ndarray]:
    """Variances ``(T,)`` of pitch, azimuth and the whole rotation, rad², from the covariance of the rows of Q."""
    Q, attitude = rotation.to_matrix(orientation), attitude_covariance(P, orientation)
    # (5.50): sin θ = Q₃₂, tan ψ = Q₁₂ / Q₂₂; both move with e as the rows do
    by_e = np.stack([rotation.skew(Q[:, i])[:, 1] for i in range(3)], axis=1)
    east, north, up = Q[:, 0, 1], Q[:, 1, 1], Q[:, 2, 1]
    pitch = by_e[:, 2] / np.sqrt(1.0 - up**2)[:, None]
    azimuth = (north[:, None] * by_e[:, 0] - east[:, None] * by_e[:, 1]) / (east**2 + north**2)[:, None]
    return {
        "pitch": np.einsum("ti,tij,tj->t", pitch, attitude, pitch),
        "azimuth": np.einsum("ti,tij,tj->t", azimuth, attitude, azimuth),
        "total": np.trace(attitude, axis1=-2, axis2=-1),
    }


def errors_and_bounds(device: str, method: str, seed: int, duration: float) -> dict[str, float]:
    """RMS of errors and bounds of one motion, deg: ``pitch``, ``pitch bound``, ``pitch bound, known …`` and so on."""
    trajectory = pointed(device, seed, duration)
    truth, late = trajectory.truth["orientation"], trajectory.time >= SETTLED
    model, measurements = prepared(method, device, trajectory)
    variances = {kind: angles_of(P, truth) for kind, P in bounds_of(trajectory, model, measurements).items()}
    errors = pointing_errors(estimated(method, device, trajectory), truth)
    found = {}
    for name, error in zip(ANGLES, errors, strict=True):
        found[name] = float(np.degrees(np.sqrt(np.mean(error[late] ** 2))))
        for kind, each in variances.items():
            found[f"{name} {kind}"] = float(np.degrees(np.sqrt(np.mean(each[name][late]))))
    return found


def orientation_bounds(study: Study, report: Report) -> None:
    """Table and claims."""
    seeds, duration = (2, 30.0) if study.quick else (3, 60.0)
    roots = [study.seed_of("pointing", index) for index in range(seeds)]
    jobs = [(device, method, seed, duration) for device, method in METHODS for seed in roots]
    found = study.map("orientation bounds", errors_and_bounds, jobs)
    rows, claims = [], []
    for index, (device, method) in enumerate(METHODS):
        mean = mean_of(found[index * seeds : (index + 1) * seeds])
        rows.append({"device": device, "method": method} | {name: round(value, 3) for name, value in mean.items()})
        for kind, statement in (
            (BOUND, f"{device}, {method}: no error lies below its bound"),
            (KNOWN, f"Were the hand's acceleration known, no error would lie below: {device}, {method}"),
        ):
            bounds = {name: mean[f"{name} {kind}"] for name in ANGLES}
            claims.append(Claim.shares(statement, bounds, mean, 1.05, "of the error"))
    report.table(
        "Bound of the orientation",
        rows,
        f"RMS in deg from {SETTLED:g} s on, mean of {seeds} motions of {duration:g} s. The bound knows the sensors' "
        "white noises, and size and frequency of the acceleration of the hand, which the filter takes for white; or "
        "all of that acceleration.",
    )
    report.claims("Bound of the orientation: what holds", claims)
