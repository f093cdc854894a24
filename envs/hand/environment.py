"""``poise/HandMotion-v0``: a hand moves a device, its inertial sensors measure, an agent estimates the orientation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np

from ...filters.arrays.array import AccelerometerArray
from ...filters.core.quantity import ORIENTATION, RELATIVE_ORIENTATION
from ..base import Block, PoseEnv, choose_quantity
from ..drawn import Scene
from ..sensors.ideal import Mounting, Sampling, vector
from ..sensors.magnetics import Magnetics
from ..sensors.presets import SensorPreset
from ..sensors.suite import SensorSuite
from ..sensors.timing import Timings
from .arm.arm import Arm
from .arm.driver import ArmDriver
from .devices import HandDevice, check_planar, hand_device
from .drivers import Device, KinematicDriver, MotionDriver
from .gestures import GestureConfig, gesture_config, make_gesture
from .sensing import HandVariation, built_array, check_duration, hand_suite, samples_of, sense

DriveKind = Literal["dynamic", "kinematic"]


class HandMotionEnv(PoseEnv):
    """A hand-held device moves at random; from its inertial sensors an agent estimates its orientation.

    ## Description

    A rigid controller of 0.25 kg follows a random gesture. With ``drive="kinematic"`` it follows the gesture exactly.
    With ``drive="dynamic"`` an :class:`.Arm` of finite stiffness, reflex delay and motor noise pulls it along the
    gesture (rigid-body dynamics at 2 kHz): it lags by millimetres and degrees, trembles, and bumps into a table. The
    sensors follow the actual motion of the device, and so does the truth. World: x east, y north, z up; quaternions w,
    x, y, z.

    ## Action Space

    ``Box(-1, 1, (4,), float32)``: the agent's own estimate of the orientation at the last observation, a quaternion
    w, x, y, z that rotates sensor axes to world axes. The environment normalises it; zeros count as no rotation. A
    quaternion and its negative are the same estimate.

    | num | action | unit |
    |---|---|---|
    | 0 | w, scalar part | 1 |
    | 1, 2, 3 | x, y, z, vector part | 1 |

    ## Observation Space

    ``Dict``; bounds are the full scales of the sensors. With the default sensors:

    | key | shape | unit | rate |
    |---|---|---|---|
    | ``imu/gyr`` | (3,) float32 | rad/s, angular rate, sensor axes | ``rate`` |
    | ``imu/acc`` | (3,) float32 | m/s², specific force (+g on an axis that points up at rest) | ``rate`` |
    | ``imu/mag`` | (3,) float32 | µT, magnetic field; only with ``magnetometer`` | ``rate`` |
    | ``new_sample`` | (channels,) int8 | 1 for a new sample, 0 where the last value is repeated | ``rate`` |

    A device with an array of m uniaxial accelerometers has ``array/acc`` (m,), m/s² along each axis, in place of
    ``imu/acc``, and ``imu/gyr`` and ``imu/mag`` if it has these sensors; a planar one ``planar/gyr`` (1,), rad/s, about
    its z axis, in place of ``imu/gyr``.

    The sample of a time step describes the interval that ends with it: with ``sampling="interval"`` the rotation vector
    and the velocity increment over the interval, divided by its length; with ``sampling="instant"`` the values at its
    end. In an interval gravity acts in the attitude half way through it, while ``pose/up`` belongs to its end: an ideal
    accelerometer reads ``external_acceleration`` + g · ``up`` rotated by half the rotation vector of the interval
    (``angular_rate`` times its length), exactly. Without this rotation the sum is wrong by up to 0.5 m/s² at 100 Hz
    where a hand shakes.

    ## Rewards

    Minus the error of the action in rad, at the pose of the observation it answers: the angle of the rotation between
    estimate and truth, in [0, π]; with ``score="relative_orientation"`` only its inclination, which six-axis sensors
    can observe, whatever the heading.

    ## Starting State

    At rest for a second at least, with a random heading and attitude (``rest``, ``mixed``, ``walk`` and ``shaking``:
    any attitude; ``pointing``: at a target; ``planar-walk`` and ``infinity``: the same attitude every time).

    ## Episode End

    Truncated when the gesture is over. Never terminated.

    ## Info

    The same structure at ``reset`` and ``step``; arrays are float64.

    | key | shape | meaning |
    |---|---|---|
    | ``time`` | float | s since the start |
    | ``pose/orientation`` | (4,) | sensor to world |
    | ``pose/up`` | (3,) | gravity direction: the upward unit vector in sensor axes |
    | ``truth/position``, ``truth/velocity`` | (3,) | of the sensor, world, m and m/s |
    | ``truth/angular_rate`` | (3,) | rad/s, sensor axes: what an ideal gyroscope reports |
    | ``truth/external_acceleration`` | (3,) | m/s², sensor axes: what an ideal accelerometer reports without gravity |
    | ``truth/acceleration`` | (3,) | m/s², world; only with an array, as the following |
    | ``truth/angular_acceleration`` | (3,) | rad/s², sensor axes |
    | ``truth/planar/angle`` | (1,) | φ in [−π, π], rad, from east to up; planar devices only, as the following |
    | ``truth/planar/angular_rate``, ``truth/planar/angular_acceleration`` | (1,) | of φ, rad/s and rad/s² |
    | ``truth/planar/position``, ``truth/planar/velocity``, ``truth/planar/acceleration`` | (2,) | east and up |
    | ``truth/gyroscope_bias``, ``truth/accelerometer_bias``, … | (3,) | bias of the last sample of each sensor |
    | ``scored`` | bool | always True |

    ## Arguments

    Args:
        gesture: a name of :data:`.GESTURES` (``rest``, ``slow``, ``fast``, ``severe``, ``turn``,
            ``mixed``, ``walk``, ``pointing``, ``shaking``, ``rate-table``; in the plane ``planar-walk``, ``infinity``)
            or a configuration; None for ``slow``, with a planar device for ``infinity``.
            ``reset(options={"gesture": …})`` replaces it for one episode.
        drive: ``kinematic`` or ``dynamic``.
        arm: what pulls the device with ``drive="dynamic"``; None for the :class:`.Arm` of the defaults.
        sensors: name of a preset (:func:`poise.envs.sensors.presets.list_sensor_presets`), a preset, or a whole
            :class:`.SensorSuite` on one body; its mountings count from the site that ``lever_arm`` and
            ``mounting`` describe, whose pose is to be estimated. None for ``xsens-mtw-awinda``, or
            for the errors of the device (:data:`poise.envs.hand.devices.ARRAY_PRESETS`).
        rate: Hz; None for 100, or for the rate of the suite.
        duration: length of an episode, s; None for that of the gesture.
        lever_arm: ``(3,)`` from the centre of the device to the sensor, m, device axes.
        mounting: ``(4,)`` quaternion that rotates sensor axes to device axes.
        device: ``imu`` (one IMU), ``controller``, ``octa``, ``octa-gyroscope`` or ``planar``, a JSON file that
            describes an array, or a :class:`.HandDevice`. A planar device moves in the vertical plane
            of east and up only.
        magnetometer: False, True or its rate in Hz; None for True if the preset (the device) has one.
        sampling: ``interval`` or ``instant``; None for ``interval``, with an array for ``instant``.
        timing: delay, jitter, clock drift and lost packets of all sensors, or of each site (``imu``, ``array``): a
            name of :data:`poise.envs.sensors.timing.TIMINGS` or a :class:`poise.envs.sensors.timing.Timing`; None for
            that of the preset, which is punctual in those that are shipped.
        magnetics: disturbances of the magnetic field: a name of :data:`poise.envs.sensors.magnetics.MAGNETICS` or a
            :class:`poise.envs.sensors.magnetics.Magnetics`; None for none.
        randomise: True or a :class:`HandVariation` varies mounting and mass from episode to episode.
        score: ``orientation`` or ``relative_orientation``.
        render_mode: ``human`` (a window), ``rgb_array`` or None.

    Raises:
        ValueError: an argument out of its range or an unknown name.

    ## Version History

    * v0: first release.
    """

    reset_options: ClassVar[tuple[str, ...]] = ("gesture",)

    def __init__(
        self,
        gesture: str | GestureConfig | None = None,
        drive: DriveKind = "kinematic",
        sensors: str | SensorPreset | SensorSuite | None = None,
        rate: float | None = None,
        duration: float | None = None,
        lever_arm: Sequence[float] = (0.0, 0.0, 0.0),
        mounting: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        *,
        device: str | HandDevice = "imu",
        arm: Arm | None = None,
        magnetometer: bool | float | None = None,
        sampling: Sampling | None = None,
        timing: Timings | None = None,
        magnetics: str | Magnetics | None = None,
        randomise: bool | HandVariation = False,
        score: str = "orientation",
        render_mode: str | None = None,
    ) -> None:
        held = hand_device(device)
        if gesture is None:
            gesture = "infinity" if held is not None and held.planar else "slow"
        config = gesture_config(gesture)
        check_duration(duration)
        if drive not in ("dynamic", "kinematic"):
            raise ValueError(f"drive must be 'dynamic' or 'kinematic', got {drive!r}")
        if arm is not None and drive != "dynamic":
            raise ValueError(f"arm has no effect with drive={drive!r}: it must be None, or drive 'dynamic'")
        suite = hand_suite(sensors, rate, magnetometer, sampling, held, timing, magnetics)
        quantity = choose_quantity(score, (ORIENTATION, RELATIVE_ORIENTATION))
        super().__init__(suite, [quantity], suite.rate, render_mode)
        self._suite = suite
        self.gesture, self.drive_kind, self.duration = gesture, drive, duration
        self.mounting = Mounting(vector("lever_arm", lever_arm, 3), vector("mounting", mounting, 4))
        variation = HandVariation() if randomise is True else randomise
        self.variation = variation or HandVariation(0.0, 0.0, 0.0)
        self.arm = arm
        self.hand_device, self.device, self._sensors = held, Device() if held is None else held.body, sensors
        if held is not None:
            check_planar(held, config, self.mounting)
            if held.planar and self.variation.mounting:
                raise ValueError("randomise must leave the mounting of a planar device as it is (mounting=0)")
        self._array: AccelerometerArray | None = None
        self._driver: MotionDriver | None = None
        self._episode_mounting = self.mounting

    def begin(self, motion: np.random.Generator, sensors: np.random.Generator, options: Mapping[str, Any]) -> int:
        """Draw gesture, mounting and sensor errors."""
        config = gesture_config(options.get("gesture", self.gesture))
        if self.hand_device is not None:
            check_planar(self.hand_device, config, self.mounting)
        duration = config.duration if self.duration is None else self.duration
        gesture = make_gesture(config, motion, duration)
        # children of their own, so that neither variation nor noise changes the gesture
        setting, noise = motion.spawn(2)
        self._episode_mounting, mass_factor = self.variation.draw(self.mounting, setting)
        self._ready_driver().start(gesture, mass_factor, noise)
        self._suite.reset(sensors)
        self._array = built_array(self.hand_device, self._sensors, sensors)
        return samples_of(duration, self.rate) - 1

    def _ready_driver(self) -> MotionDriver:
        """The motion driver, made on first use and again after :meth:`close`."""
        if self._driver is None:
            if self.drive_kind == "kinematic":
                self._driver = KinematicDriver(self.rate)
            else:
                planar = self.hand_device is not None and self.hand_device.planar
                self._driver = ArmDriver(self.rate, self.device, self.arm, planar=planar, gravity=self._suite.gravity)
        return self._driver

    def next_block(self, most: int) -> Block:
        """Advance the device and simulate the sensors."""
        driver = self._ready_driver()
        states = driver.advance(min(most, driver.block))
        return sense(self._suite, states, self._episode_mounting, self._array)

    def save_source(self) -> Any:
        """Motion driver, mounting, and the array as it is built."""
        return self._ready_driver().save(), self._episode_mounting, self._array

    def restore_source(self, saved: Any) -> None:
        """Undo :meth:`save_source`."""
        driver, self._episode_mounting, self._array = saved
        self._ready_driver().restore(driver)

    def make_scene(self, gui: bool) -> Scene:
        """The device above the ground, and the axes of the estimate."""
        from ..rendering import DeviceScene

        return DeviceScene(self.device.size, gui=gui)

    def close(self) -> None:
        """Close the window; may be called twice."""
        super().close()
        self._driver = self._block = None
