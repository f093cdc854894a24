"""``poise/BicycleFixture-v0``: a bicycle pushed around a circle with a motor-driven tilted disk on it.

The two-gyroscope paper tests its filter on such a fixture before riders. There is no physics: the motion is prescribed
in closed form (arbitrary roll, no pitch, wheels without slip).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...filters.bicycle.geometry import RiderGeometry
from ...filters.core import rotation
from ...filters.core.quantity import Quantity
from ..base import Block, PoseEnv, choose_quantity
from ..drawn import Scene
from ..sensors.ideal import BodyState
from .frame.parameters import MOUNTAIN_BIKE
from .rider.anthropometry import SUBJECTS
from .rider.limbs import half_turns
from .rider.posture import sit
from .sensors.measured_geometry import rider_geometry
from .sensors.readings import RideQuantities
from .sensors.sites import fixture_sites, sensor_sites
from .sensors.suites import rider_bicycle_suite

DISK_CENTRE = (0.26, 0.0, 1.0)
"""m in the bicycle frame: above the saddle; assumed"""
QUANTITIES = (
    Quantity("bicycle/roll", "angle", 1, "rad"),
    Quantity("bicycle/orientation", "rotation", 4, "1"),
    Quantity("disk/orientation", "rotation", 4, "1"),
    Quantity("disk/relative_orientation", "rotation", 4, "1"),
)
BLOCK = 200
"""time steps computed at once"""


@dataclass(frozen=True)
class FixtureMotion:
    """A push around a circle; each coordinate is a steady value plus a sum of sines. Angles in rad, rates in rad/s."""

    radius: float
    """m, left positive"""
    speed: float
    """m/s"""
    heading: float
    tilt: float
    """of the disk against the bicycle"""
    spin: float
    """mean rate of the motor about the bicycle's z axis"""
    roll: np.ndarray
    """(3, k) amplitude, angular frequency and phase of each wave"""
    surge: np.ndarray
    """(3, k) likewise of the way along the circle, m"""
    motor: np.ndarray
    """(3, k) likewise of the motor's angle"""

    @classmethod
    def random(cls, rng: np.random.Generator) -> FixtureMotion:
        """Draw a push: radius about 2 m, 0.6 to 0.9 m/s, roll within about ±15°, disk tilted by 15 to 25°."""

        def waves(count: int, amplitude: float, slow: float, fast: float) -> np.ndarray:
            return np.stack(
                [
                    amplitude * rng.uniform(0.5, 1.0, count),
                    2.0 * math.pi * rng.uniform(slow, fast, count),
                    rng.uniform(0.0, 2.0 * math.pi, count),
                ]
            )

        return cls(
            radius=float(rng.uniform(1.8, 2.2)) * (1.0 if rng.random() < 0.5 else -1.0),
            speed=float(rng.uniform(0.6, 0.9)),
            heading=float(rng.uniform(-math.pi, math.pi)),
            tilt=math.radians(float(rng.uniform(15.0, 25.0))),
            spin=math.radians(float(rng.uniform(20.0, 40.0))) * (1.0 if rng.random() < 0.5 else -1.0),
            roll=waves(3, math.radians(6.0), 0.05, 0.4),
            surge=waves(2, 0.15, 0.05, 0.2),
            motor=waves(2, math.radians(15.0), 0.05, 0.3),
        )

    def sample(self, time: np.ndarray) -> tuple[dict[str, BodyState], np.ndarray]:
        """Motion of ``bicycle`` and ``disk`` at times ``(T,)`` (s), and the rear wheel's rate times its radius, m/s."""

        def sines(waves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            amplitude, frequency, phase = waves
            angle = frequency * time[:, None] + phase
            return np.sin(angle) @ amplitude, np.cos(angle) @ (amplitude * frequency)

        (roll, roll_rate), (surge, surge_rate), (swing, swing_rate) = map(sines, (self.roll, self.surge, self.motor))
        way, speed = self.speed * time + surge, self.speed + surge_rate
        yaw, zero = self.heading + way / self.radius, np.zeros_like(time)
        yaw_rate = speed / self.radius
        orientation = rotation.from_euler_zyx(yaw, zero, roll)
        c, s, c0, s0 = np.cos(yaw), np.sin(yaw), math.cos(self.heading), math.sin(self.heading)
        position = self.radius * np.stack([s - s0, c0 - c, zero], axis=-1)
        forward = np.stack([c, s, zero], axis=-1)
        turning = roll_rate[:, None] * forward + np.stack([zero, zero, yaw_rate], axis=-1)
        bicycle = BodyState(time, position, orientation, speed[:, None] * forward, turning)
        motor = half_turns(self.spin * time + swing, 2)
        relative = rotation.multiply(motor, half_turns(np.full_like(time, self.tilt), 0))
        lever = rotation.rotate(orientation, np.array(DISK_CENTRE))
        axis = rotation.rotate(orientation, np.array([0.0, 0.0, 1.0]))
        disk = BodyState(
            time,
            position + lever,
            rotation.multiply(orientation, relative),
            bicycle.velocity + rotation.cross(turning, lever),
            turning + (self.spin + swing_rate)[:, None] * axis,
        )
        return {"bicycle": bicycle, "disk": disk}, speed


class BicycleFixtureEnv(PoseEnv):
    """A bicycle is pushed around a circle; from two gyroscopes and a camera an agent estimates roll or orientation.

    ## Description

    A hand-pushed bicycle goes around a circle of about 2 m radius with varying roll and without pitch. A motor turns a
    tilted disk on it. Prescribed motion in closed form, no physics. World: x east, y north, z up; quaternions w, x,
    y, z, body to world.

    ## Action Space

    ``Box(float32)``: the estimate of the quantity ``score`` at the last observation (roll in rad, or a quaternion).

    ## Observation Space

    ``Dict``: ``bicycle_imu/gyr`` and ``disk/gyr`` (3,) rad/s, ``relative/distances`` (3,) m of three markers on the
    disk from a camera on the bicycle (or the channels in ``suite``), and ``new_sample``.

    ## Rewards

    Minus the error of the action in rad.

    ## Starting State

    In motion.

    ## Episode End

    Truncated after ``duration``.

    ## Info

    ``pose``: ``bicycle/roll`` (1,), ``bicycle/orientation``, ``disk/orientation`` and ``disk/relative_orientation``
    (4,), the last from the disk to the bicycle. ``truth``: ``bicycle/position``,
    ``bicycle/velocity``, ``disk/position`` (3,) in the world, and the biases of the sensors.

    ## Arguments

    Args:
        suite: ``two-gyro-fixture`` or a list of channels without those of a rider.
        sensors: ``paper``, ``ideal`` or the name of a device.
        rate: Hz; None for that of the suite.
        duration: s.
        score: one of the quantities of ``info["pose"]``.
        noise_scale: factor on all errors.
        render_mode: ``human`` (a window), ``rgb_array`` or None.

    Raises:
        ValueError: an argument out of its range or an unknown name.

    ## Version History

    * v0: first release.
    """

    def __init__(
        self,
        suite: str | Sequence[str] = "two-gyro-fixture",
        sensors: str = "paper",
        rate: float | None = None,
        duration: float = 60.0,
        score: str = "bicycle/roll",
        *,
        noise_scale: float = 1.0,
        render_mode: str | None = None,
    ) -> None:
        if not 0.1 <= duration < math.inf:
            raise ValueError(f"duration must be at least 0.1 s and finite, got {duration}")
        self._posture = sit(MOUNTAIN_BIKE, SUBJECTS[0])
        self.sites = fixture_sites(sensor_sites(self._posture), DISK_CENTRE)
        self._suite = rider_bicycle_suite(suite, sensors=sensors, rate=rate, noise_scale=noise_scale, sites=self.sites)
        missing = {sensor.body for sensor in self._suite.sensors} - {"bicycle", "disk"}
        forces = [s.channel.name for s in self._suite.sensors if s.channel.name.split("/")[0] in ("seat", "handlebar")]
        if missing or forces:
            raise ValueError(f"suite must not need a rider, but it has sensors on {sorted(missing) or forces}")
        super().__init__(self._suite, [choose_quantity(score, QUANTITIES)], self._suite.rate, render_mode)
        self.duration = float(duration)
        self._motion: FixtureMotion | None = None
        self._steps = 0

    @property
    def geometry(self) -> RiderGeometry:
        """Geometry of the bicycle, without a rider."""
        return rider_geometry(self._posture, self.sites)

    def begin(self, motion: np.random.Generator, sensors: np.random.Generator, options: Mapping[str, Any]) -> int:
        """Draw the push and the sensors' errors."""
        self._motion, self._steps = FixtureMotion.random(motion), 0
        self._suite.reset(sensors)
        return max(1, round(self.duration * self.rate))

    def next_block(self, most: int) -> Block:
        """Advance the push and simulate the sensors."""
        assert self._motion is not None
        time = (self._steps + np.arange(min(most, BLOCK))) / self.rate
        self._steps += len(time)
        bodies, speed = self._motion.sample(time)
        zero = np.zeros_like(time)
        ride = RideQuantities(bodies, self.sites, wheel_rate=speed / self.sites.wheel_radius, steer=zero, crank=zero)
        measurements, biases, _ = self._suite.simulate(bodies, ride)
        bicycle, disk = bodies["bicycle"], bodies["disk"]
        pose = {
            "bicycle/roll": rotation.to_euler_zyx(bicycle.orientation)[2][:, None],
            "bicycle/orientation": bicycle.orientation,
            "disk/orientation": disk.orientation,
            "disk/relative_orientation": rotation.multiply(rotation.conjugate(bicycle.orientation), disk.orientation),
        }
        truth = {
            "bicycle/position": bicycle.position,
            "bicycle/velocity": bicycle.velocity,
            "disk/position": disk.position,
            **biases,
        }
        return Block(time, measurements, pose, truth, np.ones(len(time), bool))

    def save_source(self) -> Any:
        """The push and the position in it."""
        return self._motion, self._steps

    def restore_source(self, saved: Any) -> None:
        """Undo :meth:`save_source`."""
        self._motion, self._steps = saved

    def make_scene(self, gui: bool) -> Scene:
        """Bicycle, disk and a level ground."""
        from .course.scene import FixtureScene

        return FixtureScene(MOUNTAIN_BIKE, DISK_CENTRE, gui=gui)
