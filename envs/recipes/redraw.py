"""Another draw of the sensors of a recorded ride: errors, tape-measured geometry, and left and right exchanged.

Learners need several draws a ride, and riding is what costs time. A ride is recorded with ideal sensors once; each draw
then applies the errors of other devices, as the environment would have with the same random numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from ...filters.bicycle.geometry import GEOMETRY_STD, RiderGeometry, TapeMeasure
from ...filters.core import rotation
from ...filters.core.quantity import STANDARD_GRAVITY
from ..bicycle.sensors.measured_geometry import measured
from ..bicycle.sensors.placement import PLACED, PlacementErrors
from ..bicycle.sensors.sites import BICYCLE_IMU_TILT, pitched, sensor_sites
from ..bicycle.sensors.suites import rider_bicycle_suite
from ..data.trajectory import Trajectory
from ..sensors.ideal import Mounting
from ..sensors.late import readings_at
from ..sensors.noise import TIMES
from ..sensors.sensor import Sensor, due
from ..sensors.suite import SensorSuite
from ..sensors.timing import Timings, make_clocks
from .mirror import POLAR, TURN, mirrored, other_side
from .recipe import unspawned

TRUE_GEOMETRY = "true_geometry"
"""Key of the metadata: the geometry itself, where ``geometry`` is what was measured of it"""


def redrawn(
    ride: Trajectory,
    seed: int | np.random.SeedSequence,
    *,
    sensors: str = "paper",
    noise_scale: float = 1.0,
    mirror: bool = False,
    geometry: TapeMeasure | None = None,
    timing: Timings | None = None,
) -> Trajectory:
    """A ride with sensor errors drawn anew: biases, zeros, camera alignment, scale, noise, lost samples.

    Args:
        ride: recorded in ``poise/RiderBicycle-v0`` with ``sensors="ideal"``.
        seed: of the draw; the ride itself does not depend on it.
        sensors: ``paper``, or a device for all inertial sensors, see :func:`.rider_bicycle_suite`.
        noise_scale: factor on all errors.
        mirror: exchange left and right, see :func:`.mirrored`.
        geometry: measure the rider anew: ``metadata["geometry"]``, with which filters are configured, is then
            measured, ``metadata["geometry_std"]`` says how exactly, and ``metadata["true_geometry"]`` is the geometry
            itself. None leaves the true one.
        timing: of all sensors, or of each site, as of the environment. Late readings are interpolated between the ideal
            ones, so that a part of their highest frequencies is lost.

    Returns:
        Measurements with errors, and the true biases; everything else as in ``ride``.

    Raises:
        ValueError: the ride's sensors were not ideal, or a channel is none of the environment's.
    """
    described = ideal_sensors(ride)
    ride = mirrored(ride) if mirror else ride
    errors, tape = (np.random.default_rng(child) for child in unspawned(seed).spawn(2))
    suite = suite_of(ride, described, sensors, noise_scale, timing)
    measurements, biases = with_errors(suite, ride, errors)
    metadata: dict[str, Any] = ride.metadata | {"sensors": suite.describe(), "devices": sensors}
    metadata |= {"noise_scale": float(noise_scale), "mirrored": bool(mirror)}
    if geometry is not None and "geometry" in metadata:
        true = RiderGeometry.read(metadata["geometry"])
        taped = measured(true, tape, geometry).describe()
        metadata |= {"geometry": taped, TRUE_GEOMETRY: metadata["geometry"], GEOMETRY_STD: asdict(geometry)}
    return ride.replace(measurements=measurements, truth=ride.truth | biases, metadata=metadata)


def turned_anew(ride: Trajectory, generator: np.random.Generator) -> Trajectory:
    """A ride with ideal sensors whose bicycle IMU is turned by another draw of the error of its placement.

    What gains are best on the one and on the other does not depend on how the sensor was turned: no sensor shows that.

    Raises:
        ValueError: as of :func:`redrawn`.
    """
    described = ideal_sensors(ride)
    turn = PlacementErrors().fixed_turn * generator.standard_normal(3)
    axes = rotation.multiply(rotation.exp(turn), np.array(pitched(BICYCLE_IMU_TILT)))
    measurements, sensors = dict(ride.measurements), []
    for sensor in described["sensors"]:
        name = sensor["channel"]
        if name.startswith("bicycle_imu/"):
            readings = rotation.rotate(np.array(sensor["rotation"]), measurements[name])
            measurements[name], sensor = rotation.rotate_back(axes, readings), {**sensor, "rotation": axes.tolist()}
        sensors.append(sensor)
    metadata = {**ride.metadata, "sensors": {**described, "sensors": sensors}}
    return ride.replace(measurements=measurements, metadata=metadata)


def ideal_sensors(ride: Trajectory) -> Mapping[str, Any]:
    """What the metadata say about the sensors.

    Raises:
        ValueError: they are not those of a simulated ride with ideal sensors.
    """
    described = ride.metadata.get("sensors")
    if not isinstance(described, Mapping) or "sensors" not in described:
        raise ValueError(f"{ride.name} does not describe its sensors: only simulated rides can be drawn again")
    kept = ("full_scale", "bandwidth", *TIMES)
    for sensor in described["sensors"]:
        wrong = [name for name, value in sensor["noise"].items() if value and name not in kept]
        if wrong or sensor["noise"].get("bandwidth") is not None:
            raise ValueError(
                f"{ride.name} must be recorded with sensors='ideal' to be drawn again, but {sensor['channel']} has "
                f"{', '.join(wrong) or 'a bandwidth'}"
            )
    return described


def suite_of(
    ride: Trajectory, described: Mapping[str, Any], sensors: str, noise_scale: float, timing: Timings | None = None
) -> SensorSuite:
    """The suite with errors, at the rate of the ride, with its wheel and the places of its sensors."""
    from ..bicycle.frame.parameters import MOUNTAIN_BIKE
    from ..bicycle.rider.anthropometry import RiderBody
    from ..bicycle.rider.posture import sit

    sites = sensor_sites(sit(MOUNTAIN_BIKE, RiderBody()))
    sites = replace(sites, wheel_radius=RiderGeometry.of(ride.metadata).wheel_radius)
    placed = {}
    for sensor in described["sensors"]:
        site, lever, axes = sensor["channel"].partition("/")[0], sensor["lever_arm"], sensor["rotation"]
        if ride.metadata.get("mirrored"):
            site, lever, axes = other_side(site), POLAR * lever, TURN * axes
        if site in PLACED:
            placed[site] = Mounting(tuple(lever), tuple(axes))
    return rider_bicycle_suite(
        list(ride.measurements),
        sensors=sensors,
        rate=float(described["rate"]),
        noise_scale=noise_scale,
        sites=sites,
        placed=placed,
        sampling=described["sensors"][0]["sampling"],
        timing=timing,
    )


def with_errors(
    suite: SensorSuite, ride: Trajectory, generator: np.random.Generator
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Measurements and true biases of a suite on the ideal readings of a ride.

    With the generator of an environment's sensors these are the errors that the environment would have added.
    """
    children = generator.spawn(len(suite.sensors))
    steps = np.arange(len(ride))
    clocks = make_clocks((sensor.clock for sensor in suite.sensors), suite.rate, children[0])
    lags = {key: clock.advance(steps) for key, clock in clocks.items()}
    measurements, biases = {}, {}
    for sensor, child in zip(suite.sensors, children, strict=True):
        name, noise = sensor.channel.name, sensor.errors(child)
        ideal = ride.measurements[name]
        rows = due(sensor.rate, steps, suite.rate)
        # an interval sensor has no sample before its first interval is over
        known = np.isfinite(ideal).all(axis=1)
        if sensor.clock is None:
            rows = rows[known[rows]]
            readings = ideal[rows]
        else:
            lag, lost = lags[sensor.clock]
            times, past = steps / suite.rate - lag, steps[known] / suite.rate
            rows = rows[~lost[rows]]
            rows = rows[times[rows] >= past[0]]
            readings = readings_at(past, ideal[known], times[rows], sensor.form)
        start = noise.bias
        values, found = noise.sequence(readings, force_at(sensor, ride, rows))
        measurements[name] = np.full_like(ideal, np.nan)
        measurements[name][rows] = values
        latest = np.searchsorted(rows, steps, side="right")
        biases[sensor.truth_name] = np.concatenate([start[None], found])[latest]
    return measurements, biases


def force_at(sensor: Sensor, ride: Trajectory, rows: np.ndarray) -> np.ndarray | None:
    """Specific force at a gyroscope that is sensitive to it; that of gravity where there is no accelerometer.

    Raises:
        ValueError: the ride knows neither the accelerometer at its site nor the orientation of its body.
    """
    if not sensor.noise.g_sensitivity:
        return None
    name, carrier = f"{sensor.channel.name.rpartition('/')[0]}/acc", f"{sensor.body}/orientation"
    if name in ride.measurements:
        return ride.measurements[name][rows]
    if carrier not in ride.truth:
        raise ValueError(f"{sensor.channel.name} of {sensor.device!r} is sensitive to acceleration: it needs {name}")
    orientation = rotation.multiply(ride.truth[carrier][rows], np.array(sensor.mounting.rotation))
    return STANDARD_GRAVITY * rotation.up_in_body(orientation)
