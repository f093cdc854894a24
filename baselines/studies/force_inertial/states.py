"""True states of the force/inertial filter, for the evaluation of torques and bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from ....filters.bicycle.force_inertial.filter import ForceInertial
from ....filters.bicycle.force_inertial.kinematics import UP_THE_TRUNK, Angles, rates
from ....filters.bicycle.force_inertial.readings import Readings, readings, steering
from ....filters.core.kalman import KalmanFilter


def true_states(
    model: ForceInertial, measurements: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]
) -> np.ndarray:
    """The filter's state ``(T, 27)`` at the truth: true angles and bias, and what the filter remembers of its inputs.

    The measurements have no missing samples; the truth has trunk angles, roll and bias of the trunk's gyroscope.
    """
    names = ("trunk_imu/gyr", "bicycle_imu/gyr", "wheel/speed")
    now = [measurements[name] for name in names]
    slow = []
    for values, constant in zip(now, (model.gyroscope_filter, model.gyroscope_filter, model.speed_filter), strict=True):
        share = model.dt / (model.dt + constant)
        raw = np.diff(values, axis=0, prepend=values[:1]) / model.dt
        slow.append(lfilter([share], [1.0, share - 1.0], raw, axis=0))
    bias = truth["trunk_imu/gyroscope_bias"] @ UP_THE_TRUNK.T
    angles = [truth["force-inertial/trunk_angles"], truth["bicycle/roll"], bias]
    forces = [measurements["trunk_imu/acc"], measurements["bicycle_imu/acc"]]
    return np.concatenate([*angles, *now, *slow, *forces], axis=-1)


def read_forces(model: ForceInertial, states: np.ndarray, measurements: Mapping[str, np.ndarray]) -> Readings:
    """What seat and hands read, with the handlebar turned as in the true motion."""
    angles = Angles(*states[:, :4].T)
    omega_h = states[:, 7:10] @ UP_THE_TRUNK.T - states[:, 4:7]
    omega_b = states[:, 10:13] * [1.0, -1.0, -1.0]
    rate = rates(angles, tuple(omega_h.T), tuple(omega_b.T), model.imu_tilt)
    return readings(model, measurements, steering(model, states[:, 13], rate.psi), model.handlebar_load)


def torques(
    model: ForceInertial, measurements: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Torques τ_φh and τ_θ ``(T, 2)`` that the sensors read, and that the model predicts at the true state, N·m.

    What the pedals carry is on the predicted side.
    """
    states = true_states(model, measurements, truth)
    residual = model.residual(states, measurements)[0][:, :2]
    N = read_forces(model, states, measurements).moment
    delta = states[:, 3] - states[:, 0]
    read = np.stack([N[0], np.cos(delta) * N[1] - np.sin(delta) * N[2]], axis=-1)
    return read, read - residual


def smoothed_torques(
    model: ForceInertial, measurements: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """``read``, ``dynamic`` and ``static`` → torques ``(T, 2)`` of :func:`torques`, averaged over 0.2 s, N·m."""
    read, dynamic = torques(model, measurements, truth)
    _, static = torques(replace(model, torque_model="static"), measurements, truth)
    kernel = np.ones(10) / 10.0
    return {
        name: np.stack([np.convolve(part[:, axis], kernel, "same") for axis in (0, 1)], axis=-1)
        for name, part in (("read", read), ("dynamic", dynamic), ("static", static))
    }


def from_the_truth(
    kalman: KalmanFilter, samples: dict[str, np.ndarray], truth: dict[str, np.ndarray], off: float = 0.0
) -> dict[str, np.ndarray]:
    """Estimates of a filter that starts at the true angles, φ_h off by so many rad, zero bias.

    Returns:
        The pose from the second sample on.
    """
    first = {name: array[0] for name, array in samples.items()}
    state, _ = kalman.step(kalman.init(first), first)
    x = state.x.copy()
    x[..., :3], x[..., 3:4], x[..., 4:7] = truth["force-inertial/trunk_angles"][0], truth["bicycle/roll"][0], 0.0
    x[..., 0] += off
    rest = {name: array[1:] for name, array in samples.items()}
    return kalman.run_from(state._replace(x=x), rest)[0].pose
