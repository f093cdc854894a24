"""Is the whole-body filter's covariance right? Rides in which everything that it assumes about noise is true.

White noise of the filter's own densities on the gyroscopes, its own processes for yaw acceleration and relative
acceleration, its own noise on every output, constraints included, no biases, no swivel. What remains between the filter
and a perfect one is linearisation, noise of gyroscopes that enters the outputs too, and what parts of the state share.
"""

from __future__ import annotations

import math

import numpy as np

from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.whole_body.filter import WholeBody
from ....filters.bicycle.whole_body.linkage import ERROR_SIZE
from ....filters.core.consistency import Consistency
from .. import model_draws
from ..signals import gauss_markov
from .motion import IDEAL, ExactRide

PARTS = {
    "roll": slice(0, 2),
    "trunk and arms": [*range(2, 11), *range(14, 17)],
    "right leg": slice(11, 14),
    "all": slice(0, ERROR_SIZE),
}
"""Decoupled parts of the state, as far as they are reported; and the whole."""
TUNING = {
    "sampling": "instant",
    "shock_guard": False,
    "seat_share": 1.0,
    "swivel_noise": 0.3,
    "bicycle_gyroscope_noise": math.radians(0.05),
    "trunk_gyroscope_noise": math.radians(0.05),
    "limb_gyroscope_noise": math.radians(0.05),
    "roll_prior": 0.03,
    "trunk_prior": 0.03,
    "limb_prior": 0.03,
}


def consistencies(
    geometry: RiderGeometry, runs: int = 50, seed: int = 0, duration: float = 3.0
) -> dict[str, Consistency]:
    """NEES of every part at the end of indoor rides, and NIS over all samples, with bounds."""
    model = WholeBody.for_rider(geometry, **TUNING)
    rng = np.random.default_rng(seed)
    rides = [
        ExactRide(geometry, swivel=0.0, seed=seed * 1000 + run).record(duration, errors=IDEAL) for run in range(runs)
    ]
    names = ["bicycle/roll", None, "trunk/angles", None]
    names += [f"{joint}_{side}/angles" for side in ("right", "left") for joint in ("shoulder", "hip")]
    processes = {
        1: (model.yaw_acceleration_std, model.yaw_acceleration_time),
        3: (model.relative_acceleration_std, model.relative_acceleration_time),
    }
    truth = np.concatenate(
        [
            np.stack([ride.truth[name] for ride in rides], axis=1)
            if name
            else gauss_markov(rng.standard_normal((len(rides[0]), runs, size)), *processes[size], model.dt)
            for name, size in zip(names, (1, 1, 3, 3, 3, 3, 3, 3), strict=True)
        ],
        axis=-1,
    )
    measurements = {
        name: np.stack([ride.measurements[name] for ride in rides], axis=1) for name in rides[0].measurements
    }
    for name, values in measurements.items():
        if name.endswith("/gyr"):
            site = name.split("_")[0]
            density = getattr(model, f"{site if site in ('bicycle', 'trunk') else 'limb'}_gyroscope_noise")
            values += density / math.sqrt(model.dt) * rng.standard_normal(values.shape)

    def move(k: int, x: np.ndarray, _: np.ndarray) -> np.ndarray:
        return np.concatenate([truth[k], x[:, ERROR_SIZE:]], axis=-1)

    return model_draws.consistencies(model, measurements, truth[0], move, PARTS, rng)
