"""True states of the whole-body filter, their bound along a ride, and what the encoders alone say of a rider."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ....envs.bicycle.sensors.devices import MODEL_605_GYROSCOPE, SLIM_GYROSCOPE
from ....filters.analysis.lasting_errors import Lasting, lasting_and_white, lasting_bound
from ....filters.bicycle.whole_body.filter import WholeBody
from ....filters.bicycle.whole_body.linkage import ERROR_SIZE, RiderLinkage, true_angles
from ....filters.core.backend import Array
from ....filters.core.model import Recurrence
from ....filters.core.quantity import Measurement
from ....filters.core.sampling import latest
from .angles import ANGLES, STATES


@dataclass(frozen=True)
class Encoders(RiderLinkage, Recurrence):
    """Upright bicycle, usual trunk, limbs by inverse kinematics from steering and crank angle: no inertial sensor.

    What it says of elbows and knees shows how much of their angles the encoders give by themselves.
    """

    def prior(self, z: Measurement) -> Array:
        """The posture of the first samples."""
        return self.start(z)

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> Array:
        """The posture of these samples; nothing is remembered."""
        return self.start(z)


def true_angles_state(truth: Mapping[str, np.ndarray]) -> np.ndarray:
    """Angles of the truth ``(T, 20)`` in the filter's order; accelerations are zero."""
    angles = true_angles(truth)
    x = np.zeros((len(angles["bicycle/roll"]), ERROR_SIZE))
    for angle, index in STATES.items():
        name, part = ANGLES[angle]
        x[:, index] = angles[name][:, part]
    return x


def true_states(
    model: WholeBody, measurements: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]
) -> np.ndarray:
    """The filter's state ``(T, n)`` at the truth, with what it remembers of its inputs.

    The last valid sample stands for a missing one; the truth has the environment's names.
    """
    held = {name: held_samples(values) for name, values in measurements.items()}
    angles = true_angles_state(truth)
    x = np.zeros((len(angles), model.state_size))
    x[:, :ERROR_SIZE] = angles
    x[0, ERROR_SIZE:] = model.prior({channel: values[0] for channel, values in held.items()})[0][ERROR_SIZE:]
    for k in range(1, len(x)):
        z = {channel: values[k] for channel, values in held.items()}
        x[k, ERROR_SIZE:] = model._remember(x[k - 1], z, model.rates(z)["bicycle_imu/gyr"])
    return x


def held_samples(values: np.ndarray) -> np.ndarray:
    """Samples ``(T, size)`` with the last valid row, at the start the first one, where one is missing."""
    valid = np.isfinite(values).all(axis=-1)
    return values[np.maximum(latest(valid), np.argmax(valid))]


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
