"""Posterior bounds along rides: with the camera's lasting alignment error, and with white noise of the camera alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.analysis.bounds import posterior_bound, with_gaps
from ....filters.analysis.lasting_errors import Lasting, lasting_bound
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.two_gyro.filter import TwoGyro
from ....filters.bicycle.two_gyro.truth import true_angles, true_states
from ....filters.core import rotation
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import DEG, Estimate
from ..ride_study import SETTLED, RideStudy
from ..sensors import without_errors
from ..signals import gauss_markov

FRAME = 1.0 * DEG
"""rad: white noise of the simulated camera's frames"""
CONSTANT, DRIFTING, DRIFT_TIME = 1.0 * DEG, 1.0 * DEG, 60.0
"""rad, rad and s: alignment error of the simulated marker, about each axis (page of the sensors)"""
WIDE = 60.0 * DEG
"""rad: what is known of θ before the first frame"""
GYROSCOPES, CAMERA = ("bicycle_imu/gyr", "trunk_imu/gyr"), ("relative/orientation",)
DRAWS = 10
"""noises drawn anew for each ride, to tell a beaten bound from chance"""
SITES = {"bicycle_imu/gyr": "platform", "trunk_imu/gyr": "body"}
"""Gyroscope → what the filter calls what carries it."""


def bounds_of_ride(study: RideStudy, ride: Trajectory, _: Mapping[str, Estimate]) -> dict[str, Any]:
    """Numbers of one ride for :attr:`.RideStudy.extra`.

    Returns:
        ``ride``: how much it rolls, pitches and turns; ``bound``: angle → RMS of the bound, deg, with the alignment
        error of the camera's marker among what has to be estimated; ``white``: angle → mean squares (deg²) of the bound
        with white noise of the camera alone, of the error with the samples of the ride (alignment error taken away),
        and of errors with :data:`DRAWS` other draws of all noises.
    """
    truth, settled = true_angles(ride.truth), ride.time >= min(SETTLED, 0.5 * float(ride.time[-1]))
    model = TwoGyro.for_rider(RiderGeometry.of(ride.metadata), dt=ride.dt, orientation_noise=FRAME)
    exact = with_gaps(without_errors(ride, exact=(*GYROSCOPES, *CAMERA)), ride.measurements)
    exact = {channel.name: exact[channel.name] for channel in model.channels}
    orientations = {name: ride.truth[name] for name in ("bicycle/orientation", "trunk/orientation")}
    states = true_states(orientations, model)
    covariances = {
        "white": posterior_bound(model, states, exact)[:, :4, :4],
        "lasting": with_alignment(model, orientations, exact)[:, :4, :4],
    }
    mean = {
        name: np.mean(np.diagonal(P, axis1=1, axis2=2)[settled], axis=0) / DEG**2 for name, P in covariances.items()
    }
    kalman = KalmanFilter(model, keep_covariance=False)
    recorded = without_errors(ride, unbiased=CAMERA)
    errors = study.errors(kalman.run({name: recorded[name] for name in exact}).pose, truth)
    drawn = study.errors(kalman.run(redrawn(model, exact, ride)).pose, {k: v[:, None] for k, v in truth.items()})
    squares = {
        name: {
            "bound": float(mean["white"][index]),
            "error": float(np.mean(errors[name][settled] ** 2)),
            "redrawn": float(np.mean(drawn[name][settled] ** 2)),
        }
        for name, index in study.states.items()
    }
    return {
        "ride": {
            "φ rms": float(np.sqrt(np.mean(truth["bicycle/roll"] ** 2))) / DEG,
            "χ largest": float(np.abs(truth["two-gyro/pitch"]).max()) / DEG,
            "|dψ/dt| mean": float(np.abs(ride.truth["bicycle/angular_rate"][:, 2]).mean()) / DEG,
        },
        "bound": {name: float(np.sqrt(mean["lasting"][index])) for name, index in study.states.items()},
        "white": squares,
    }


def with_alignment(model: TwoGyro, truth: Mapping[str, np.ndarray], exact: dict[str, np.ndarray]) -> np.ndarray:
    """Bound ``(T, e, e)`` where the marker's alignment is unknown: a constant and a drifting rotation.

    θ is not known before the first frame, whose error it then shares.
    """
    camera = CAMERA[0]
    errors = (
        Lasting((CONSTANT,) * 3, channel=camera, moved=turned),
        Lasting((DRIFTING,) * 3, DRIFT_TIME, channel=camera, moved=turned),
    )
    deviations = [model.roll_prior, *[WIDE] * 3, *[model.body_bias_prior] * 3]
    deviations += [model.platform_bias_prior] * model.platform_rates
    return lasting_bound(
        model, lambda _: true_states(truth, model), exact, errors, prior=np.diag(np.square(deviations))
    )


def turned(orientations: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Orientations of a marker that is turned by a small rotation about the body's axes."""
    return rotation.multiply(orientations, rotation.exp(error))


def redrawn(model: TwoGyro, exact: dict[str, np.ndarray], ride: Trajectory) -> dict[str, np.ndarray]:
    """Exact samples ``(T, draws, size)`` with noise as the model assumes it, of a seed that is the ride's name."""
    rng = np.random.default_rng(np.frombuffer(ride.name.encode(), np.uint8).astype(np.uint32))
    samples = {}
    for name, values in exact.items():
        shape = (len(values), DRAWS, 3)
        normal = rng.standard_normal(shape)
        if name in SITES:
            density, drift, time, prior = (
                getattr(model, f"{SITES[name]}_{what}")
                for what in ("gyroscope_noise", "bias_drift", "bias_time", "bias_prior")
            )
            bias = gauss_markov(rng.standard_normal(shape), drift, time, model.dt, prior)
            samples[name] = values[:, None] + bias + np.array(density) / np.sqrt(model.dt) * normal
        else:
            samples[name] = rotation.multiply(values[:, None], rotation.exp(FRAME * normal))
    return samples
