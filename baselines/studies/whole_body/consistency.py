"""Is the whole-body filter's covariance right? Rides in which everything that it assumes about noise is true.

White noise of the filter's own densities on the gyroscopes, its own processes for yaw acceleration and relative
acceleration, its own noise on every output, constraints included, no biases, no swivel. What remains between the filter
and a perfect one is linearisation, noise of gyroscopes that enters the outputs too, and what parts of the state share.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.whole_body.filter import WholeBody
from ....filters.bicycle.whole_body.linkage import ERROR_SIZE
from ....filters.core.backend import Array, namespace
from ....filters.core.consistency import Consistency, consistency, nees
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import Channel, Measurement
from ..signals import gauss_markov
from .motion import IDEAL, ExactRide

PARTS = {"roll": slice(0, 2), "trunk and arms": [*range(2, 11), *range(14, 17)], "right leg": slice(11, 14)}
"""Parts of the state that do not meet, as far as they are reported; and the whole."""


@dataclass(frozen=True)
class GivenOutputs(WholeBody):
    """The filter with its first five outputs given and noise added to the constraints, for simulations."""

    channels: ClassVar[tuple[Channel, ...]] = (*WholeBody.channels, Channel("given/outputs", 17, "any"))

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """The given outputs (five outputs, noise of twelve constraints) less the expected ones."""
        xp = namespace(x)
        r, H, R = super().residual(x, z)
        cells = z["seat/load_cells"]
        torque = 0.5 * self.cells_wide * (cells[..., 1:2] - cells[..., 2:3])
        trunk = z["trunk_imu/acc"]
        right_handed = xp.stack([trunk[..., 0], trunk[..., 2], -trunk[..., 1]], axis=-1)
        own = xp.concat([-z["bicycle_imu/acc"][..., 1:2], right_handed, torque, 0.0 * r[..., 5:]], axis=-1)
        return r - own + z["given/outputs"], H, R


def simulate(
    geometry: RiderGeometry, runs: int, seed: int, duration: float = 3.0, course: str = "indoor"
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors ``(T, runs, 20)``, covariances ``(T, runs, 20, 20)`` and NIS ``(T, runs)`` of such rides.

    The filter starts from the truth with errors that its prior covariance describes.
    """
    model = GivenOutputs.for_rider(
        geometry,
        sampling="instant",
        shock_guard=False,
        seat_share=1.0,
        swivel_noise=0.3,
        bicycle_gyroscope_noise=math.radians(0.05),
        trunk_gyroscope_noise=math.radians(0.05),
        limb_gyroscope_noise=math.radians(0.05),
        roll_prior=0.03,
        trunk_prior=0.03,
        limb_prior=0.03,
    )
    rng = np.random.default_rng(seed)
    rides = [
        ExactRide(geometry, course, swivel=0.0, seed=seed * 1000 + run).record(duration, errors=IDEAL)  # type: ignore[arg-type]
        for run in range(runs)
    ]
    measurements = {
        name: np.stack([ride.measurements[name] for ride in rides], axis=1) for name in rides[0].measurements
    }
    processes = {
        1: (model.yaw_acceleration_std, model.yaw_acceleration_time),
        3: (model.relative_acceleration_std, model.relative_acceleration_time),
    }
    names = ["bicycle/roll", None, "trunk/angles", None]
    names += [f"{joint}_{side}/angles" for side in ("right", "left") for joint in ("shoulder", "hip")]
    length = len(rides[0])
    truth = np.concatenate(
        [
            np.stack([ride.truth[name] for ride in rides], axis=1)
            if name
            else gauss_markov(rng.standard_normal((length, runs, size)), *processes[size], model.dt)
            for name, size in zip(names, (1, 1, 3, 3, 3, 3, 3, 3), strict=True)
        ],
        axis=-1,
    )
    for name, values in measurements.items():
        if name.endswith("/gyr"):
            place = name.split("_")[0]
            density = getattr(model, f"{place if place in ('bicycle', 'trunk') else 'limb'}_gyroscope_noise")
            values += density / math.sqrt(model.dt) * rng.standard_normal(values.shape)
    given = measurements["given/outputs"] = np.zeros((length, runs, 17))
    first = {name: values[0] for name, values in measurements.items()}
    x, P = model.prior(first)
    memory = x
    for tick in range(1, length):
        z, before = ({name: values[k] for name, values in measurements.items()} for k in (tick, tick - 1))
        memory = model.predict(memory, z, before)[0]
        r, _, R = model.residual(np.concatenate([truth[tick], memory[:, ERROR_SIZE:]], axis=-1), z)
        noise = np.sqrt(np.linalg.diagonal(R)) * rng.standard_normal(r.shape)
        # what a perfect sensor would give, and noise; constraints are met by the motion itself
        given[tick] = np.where(np.arange(17) < 5, -r, 0.0) + noise
    kalman = KalmanFilter(model, compiled=False)
    state = kalman.init(first)
    deviation = np.sqrt(np.linalg.diagonal(P))
    x[:, :ERROR_SIZE] = truth[0] + deviation * rng.standard_normal(truth[0].shape)
    held = np.concatenate([first[channel.name] for channel in model.channels], axis=-1)
    state = state._replace(x=x, covariance=P, held=held, started=np.ones(runs, dtype=bool))
    states, covariances, squares = [], [], []
    for tick in range(1, length):
        state, estimate = kalman.step(state, {name: values[tick] for name, values in measurements.items()})
        states.append(state.x[:, :ERROR_SIZE])
        covariances.append(state.covariance)
        squares.append(estimate.nis)
    return np.array(states) - truth[1:], np.array(covariances), np.array(squares)


def consistencies(
    geometry: RiderGeometry, runs: int = 50, seed: int = 0, duration: float = 3.0
) -> dict[str, Consistency]:
    """NEES of every part at the end of the runs, and NIS over all ticks, with bounds."""
    errors, covariances, nis = simulate(geometry, runs, seed, duration)
    found = {}
    for name, part in {**PARTS, "all": slice(0, 20)}.items():
        e, P = errors[-1][:, part], covariances[-1][:, part][:, :, part]
        found[name] = consistency(nees(e, P), e.shape[-1])
    found["innovation"] = consistency(nis, 17)
    return found
