"""Posterior bound of the whole-body filter along a ride, for the errors that sensors and constraints have in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ....envs.bicycle.sensors.devices import MODEL_605_GYROSCOPE, SLIM_GYROSCOPE
from ....filters.analysis.lasting_errors import Lasting, lasting_and_white, lasting_bound
from ....filters.bicycle.whole_body.filter import WholeBody
from .states import true_states

GYROSCOPES = {
    "bicycle_imu/gyr": MODEL_605_GYROSCOPE,
    "trunk_imu/gyr": MODEL_605_GYROSCOPE,
    **{f"{limb}_{side}/gyr": SLIM_GYROSCOPE for limb in ("upper_arm", "thigh") for side in ("right", "left")},
}
"""Channel → device whose white noise and bias it has"""
CALM = 1e-4
"""rad/s², m/s²: stationary deviation of accelerations outside the states of the bound; what they add to the outputs is
among the errors of the outputs"""


def bound_of_ride(
    model: WholeBody, measurements: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Bound ``(T, 20, 20)`` of an estimator that knows size and correlation time of every error of this ride.

    Biases of all gyroscopes last as the devices' do. Each output is off at the true angles by a part that lasts (zeros,
    accelerations, pedal forces, elbows off their plane) and by white noise.
    """
    real = replace(
        model,
        bicycle_gyroscope_noise=MODEL_605_GYROSCOPE.noise.white_noise,
        trunk_gyroscope_noise=MODEL_605_GYROSCOPE.noise.white_noise,
        limb_gyroscope_noise=SLIM_GYROSCOPE.noise.white_noise,
        yaw_acceleration_std=CALM,
        relative_acceleration_std=CALM,
    )
    base = true_states(real, measurements, truth)

    def states(changed: Mapping[str, np.ndarray]) -> np.ndarray:
        # only the bicycle's gyroscope is remembered in the state
        same = changed["bicycle_imu/gyr"] is measurements["bicycle_imu/gyr"]
        return base if same else true_states(real, changed, truth)

    output = real.residual(base, measurements)[0]
    errors, whites = lasting_and_white(output, real.dt)
    errors += [
        Lasting((device.noise.bias_instability,) * 3, device.noise.bias_correlation_time, channel=channel)
        for channel, device in GYROSCOPES.items()
    ]
    return lasting_bound(real, states, measurements, errors, white=np.diag(whites**2))
