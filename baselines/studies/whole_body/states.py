"""True states of the whole-body filter, for bounds, and what the encoders alone say of a rider."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

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

    Args:
        model: the filter.
        measurements: channel → samples of the filter's channels; the last valid sample stands for a missing one.
        truth: true angles under the environment's names.
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
