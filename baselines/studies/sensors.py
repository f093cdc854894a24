"""Samples of a recorded ride with some of its sensor errors taken away, to see which of them make an estimate wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...filters.bicycle.geometry import RiderGeometry
from ...filters.core import rotation

BIASES = {"gyr": "gyroscope_bias", "acc": "accelerometer_bias"}
"""Kind of an inertial channel → its true bias; another channel ``name`` has ``name_bias``."""
BODIES = {"bicycle_imu": "bicycle", "trunk_imu": "trunk", "disk": "disk"}
"""Gyroscope → what it is fixed to."""


def without_errors(ride: Trajectory, unbiased: Sequence[str] = (), exact: Sequence[str] = ()) -> dict[str, np.ndarray]:
    """The samples of a ride with some errors taken away; what was not sampled stays missing.

    Args:
        ride: with truth.
        unbiased: channels whose true bias (of ``relative/orientation``: alignment error) is taken away; white noise
            and what else the sensor has stays. A channel without a true bias stays as it is.
        exact: gyroscopes, ``relative/orientation``, ``seat/wrench`` or ``handlebar/force`` as ideal sensors read them.

    Returns:
        Channel → samples, all channels of the ride.

    Raises:
        ValueError: a channel that the ride lacks, or whose ideal samples do not follow from the truth.
    """
    samples = dict(ride.measurements)
    for name in (*unbiased, *exact):
        if name not in samples:
            raise ValueError(f"the ride has no channel {name!r}, only {', '.join(samples)}")
    for name in unbiased:
        site, kind = name.split("/")
        bias = ride.truth.get(f"{site}/{BIASES[kind]}" if kind in BIASES else f"{name}_bias")
        if bias is None:
            continue
        if name == "relative/orientation":
            samples[name] = rotation.multiply(samples[name], rotation.exp(-bias))
        else:
            samples[name] = samples[name] - bias
    for name in exact:
        ideal = IDEAL.get(name)
        values = _rate(ride, name) if ideal is None else ideal(ride)
        samples[name] = np.where(np.isfinite(samples[name]), values, np.nan)
    return samples


def _rate(ride: Trajectory, name: str) -> np.ndarray:
    """Rotation vector of each interval over its length; the bicycle's gyroscope is mounted nose up."""
    site, kind = name.split("/")
    if kind != "gyr" or site not in BODIES:
        raise ValueError(f"ideal samples of {name!r} are not known, only of gyroscopes and {', '.join(IDEAL)}")
    q = ride.truth[f"{BODIES[site]}/orientation"]
    rate = rotation.log(rotation.multiply(rotation.conjugate(q[:-1]), q[1:])) / ride.dt
    rate = np.concatenate([rate[:1], rate])
    if site != "bicycle_imu":
        return rate
    mounted = rotation.exp(np.array([0.0, -RiderGeometry.of(ride.metadata).bicycle_imu_tilt, 0.0]))
    return rotation.rotate_back(mounted, rate)


def _relative(ride: Trajectory) -> np.ndarray:
    body = "trunk" if "trunk/orientation" in ride.truth else "disk"
    return rotation.multiply(rotation.conjugate(ride.truth["bicycle/orientation"]), ride.truth[f"{body}/orientation"])


def _wrench(ride: Trajectory) -> np.ndarray:
    """The sensor sits down the post and is pitched with it; axes x forward, y left, z up."""
    geometry = RiderGeometry.of(ride.metadata)
    tilt, force = geometry.post_tilt, ride.truth["seat/force"]
    arm = geometry.post_length * np.array([-np.sin(tilt), 0.0, np.cos(tilt)])
    moment = ride.truth["seat/moment"] + rotation.cross(arm, force)
    mounted = rotation.exp(np.array([0.0, -tilt, 0.0]))
    return np.concatenate([rotation.rotate_back(mounted, values) for values in (force, moment)], axis=-1)


IDEAL: dict[str, Callable[[Trajectory], np.ndarray]] = {
    "relative/orientation": _relative,
    "seat/wrench": _wrench,
    "handlebar/force": lambda ride: np.concatenate([ride.truth[f"handlebar/force_{s}"] for s in ("left", "right")], -1),
}
"""Channel → its ideal samples."""
