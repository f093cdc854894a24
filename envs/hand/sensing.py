"""Measurements and truth of a moving device, many time steps at once; :func:`simulate_hand` gives whole episodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...filters.arrays.array import AccelerometerArray
from ...filters.core import rotation
from ...filters.support.parameters import check_positive
from ...filters.support.seeds import root_seed
from ..base import Block
from ..data.trajectory import Trajectory, trusted
from ..sensors.ideal import BodyState, Mounting, Sampling, mounted, vector
from ..sensors.magnetics import Magnetics
from ..sensors.presets import SensorPreset, sensor_preset
from ..sensors.suite import SensorSuite, imu_suite
from ..sensors.timing import Timings
from .devices import HandDevice, actual_array, array_preset, check_planar, device_suite, hand_device
from .drivers import KinematicDriver, States
from .gestures import GestureConfig, gesture_config, gesture_name, make_gesture
from .planar_motion import planar_angle

DEFAULT_SENSORS = "xsens-mtw-awinda"
"""Preset of the device ``imu``."""


@dataclass(frozen=True)
class HandVariation:
    """Variation between episodes in addition to motion and sensor errors; standard deviations, 0 for no variation.

    Attributes:
        lever_arm: of the sensor site, m per axis.
        mounting: of the sensor's axes on the device, rad per axis.
        mass: of the logarithm of the device's mass and inertia, which the arm does not know
            (``drive="dynamic"``).
    """

    lever_arm: float = 0.02
    mounting: float = math.radians(5.0)
    mass: float = 0.2

    def __post_init__(self) -> None:
        check_positive(self, or_zero=("lever_arm", "mounting", "mass"))

    def draw(self, mounting: Mounting, generator: np.random.Generator) -> tuple[Mounting, float]:
        """A mounting around ``mounting``, and a factor for the mass."""
        shift, turn, mass = generator.standard_normal(3), generator.standard_normal(3), generator.standard_normal()
        if self.lever_arm or self.mounting:
            lever = np.array(mounting.lever_arm) + self.lever_arm * shift
            axes = rotation.multiply(np.array(mounting.rotation), rotation.exp(self.mounting * turn))
            mounting = Mounting(tuple(lever.tolist()), tuple(rotation.normalize(axes).tolist()))
        return mounting, math.exp(self.mass * float(mass))


def check_duration(duration: float | None) -> None:
    """Check the length of an episode."""
    if duration is not None and not 0.0 < duration < math.inf:
        raise ValueError(f"duration must be positive and finite (s), got {duration}")


def samples_of(duration: float, rate: float) -> int:
    """Samples of an episode, the one at time 0 included; two at least."""
    return max(1, math.floor(duration * rate + 1e-6)) + 1


def built_array(
    device: HandDevice | None, sensors: str | SensorPreset | SensorSuite | None, generator: np.random.Generator
) -> AccelerometerArray | None:
    """The array of a device with the errors of its geometry in this episode; None without a device."""
    if device is None:
        return None
    preset = array_preset(device.noise if sensors is None else sensors)  # type: ignore[arg-type]
    return actual_array(device.array, preset, generator.spawn(1)[0])


def hand_suite(
    sensors: str | SensorPreset | SensorSuite | None = None,
    rate: float | None = None,
    magnetometer: bool | float | None = None,
    sampling: Sampling | None = None,
    device: HandDevice | None = None,
    timing: Timings | None = None,
    magnetics: str | Magnetics | None = None,
) -> SensorSuite:
    """Sensors at the origin of their own frame; arguments as of :class:`.HandMotionEnv`.

    Raises:
        ValueError: ``rate``, ``magnetometer``, ``timing`` or ``magnetics`` contradicts a whole suite, or a suite a
            device.
    """
    if device is not None:
        return device_suite(device, sensors, rate, magnetometer, sampling or "instant", timing, magnetics)
    sensors, sampling = DEFAULT_SENSORS if sensors is None else sensors, sampling or "interval"
    if not isinstance(sensors, SensorSuite):
        preset = sensor_preset(sensors) if isinstance(sensors, str) else sensors
        wanted = preset.magnetometer is not None if magnetometer is None else magnetometer
        rate = 100.0 if rate is None else rate
        return imu_suite(preset, rate, magnetometer=wanted, sampling=sampling, timing=timing, magnetics=magnetics)
    if rate is not None and rate != sensors.rate:
        raise ValueError(f"rate must be None or that of the suite, {sensors.rate:g} Hz, got {rate}")
    for name, value in (("magnetometer", magnetometer), ("timing", timing), ("magnetics", magnetics)):
        if value is not None:
            raise ValueError(f"{name} must be None where a whole suite is given: the suite has its own, got {value!r}")
    return sensors


def sense(suite: SensorSuite, states: States, mounting: Mounting, array: AccelerometerArray | None = None) -> Block:
    """Measurements and truth of consecutive time steps by a suite at a site of the device that is mounted so.

    A device with accelerometers in an array has it as it is built.
    """
    now, earlier = (mounted(part, mounting) for part in states)
    first = suite.sensors[0]
    # where the first sensor sits at this site and runs at this rate, its motion serves for the truth too
    site = (first.body, Mounting(), first.sampling, suite.rate, None)
    measurements, biases, motions = suite.simulate(now, array, before=earlier, reference=site)
    truth = {
        "position": now.position,
        "velocity": now.velocity,
        "angular_rate": motions[site].angular_rate,
        "external_acceleration": motions[site].external_acceleration,
        **({} if array is None else array_truth(array, now, earlier)),
        **biases,
    }
    pose = {"orientation": now.orientation, "up": rotation.up_in_body(now.orientation)}
    time = np.asarray(now.time)
    return Block(time, measurements, pose, truth, np.ones(len(time), bool))


def array_truth(array: AccelerometerArray, now: BodyState, earlier: BodyState) -> dict[str, np.ndarray]:
    """True values of further quantities that filters for arrays estimate: name → ``(n, size)``.

    Accelerations that the motion does not know are differences over a physics step.
    """
    acceleration, angular = now.acceleration, now.angular_acceleration
    if acceleration is None or angular is None:
        step = np.asarray(now.time - earlier.time)[:, None]
        acceleration = (now.velocity - earlier.velocity) / step
        angular = (now.angular_velocity - earlier.angular_velocity) / step
    truth = {"acceleration": acceleration, "angular_acceleration": rotation.rotate_back(now.orientation, angular)}
    if array.dimension == 3:
        return truth
    body_rate = rotation.rotate_back(now.orientation, now.angular_velocity)
    plane = [0, 2]
    return truth | {
        "planar/angle": planar_angle(now.orientation)[:, None],
        "planar/angular_rate": body_rate[:, 2:],
        "planar/angular_acceleration": truth["angular_acceleration"][:, 2:],
        "planar/position": now.position[:, plane],
        "planar/velocity": now.velocity[:, plane],
        "planar/acceleration": acceleration[:, plane],
    }


def simulate_hand(
    gesture: str | GestureConfig = "mixed",
    seed: int | None = None,
    sensors: str | SensorPreset | SensorSuite | None = None,
    rate: float | None = None,
    duration: float | None = None,
    sampling: Sampling | None = None,
    *,
    device: str | HandDevice = "imu",
    magnetometer: bool | float | None = None,
    lever_arm: Sequence[float] = (0.0, 0.0, 0.0),
    mounting: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
    timing: Timings | None = None,
    magnetics: str | Magnetics | None = None,
) -> Trajectory:
    """Record an episode of ``HandMotionEnv(drive="kinematic")`` at once, without stepping an environment.

    Motion and sensor errors are those that the environment has after ``reset(seed=seed)``; None draws a seed, which the
    metadata name. The other arguments are those of :class:`.HandMotionEnv`, and so are the errors; a suite is reset
    here.

    Returns:
        Measurements and truth as :func:`poise.record` would give them.

    Raises:
        ValueError: as the environment.
    """
    check_duration(duration)
    seed = root_seed(seed)
    held = hand_device(device)
    config, suite = gesture_config(gesture), hand_suite(sensors, rate, magnetometer, sampling, held, timing, magnetics)
    where = Mounting(vector("lever_arm", lever_arm, 3), vector("mounting", mounting, 4))
    if held is not None:
        check_planar(held, config, where)
    duration = config.duration if duration is None else duration
    motion, errors = np.random.default_rng(seed).spawn(2)
    driver = KinematicDriver(suite.rate)
    driver.start(make_gesture(config, motion, duration))
    suite.reset(errors)
    array = built_array(held, sensors, errors)
    block = sense(suite, driver.advance(samples_of(duration, suite.rate)), where, array)
    metadata = {
        "name": f"hand-{gesture_name(gesture)}-{seed}",
        "gesture": gesture_name(gesture),
        "sensors": suite.describe(),
        "seed": seed,
        "rate": suite.rate,
        "source": "simulation",
    }
    if held is not None:
        metadata["device"] = held.describe()
    truth = {**block.pose, **block.truth}
    return trusted(Trajectory(block.time, dict(block.measurements), truth, metadata=metadata))
