"""``poise/RiderBicycle-v0``: a rider on a bicycle, their sensors, and an agent that estimates the pose."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from ...filters.bicycle.geometry import RiderGeometry
from ...filters.core.quantity import Quantity
from ..base import Block, PoseEnv
from ..drawn import Scene
from ..sensors.ideal import Sampling
from ..sensors.magnetics import Magnetics
from ..sensors.sensor import Sensor
from ..sensors.timing import Timings
from .course.scenarios import Scenario
from .course.scenarios import scenario as named_scenario
from .course.surfaces import Surface
from .course.surfaces import surface as named_surface
from .course.terrain import Ground
from .frame.bicycles import BICYCLES
from .frame.parameters import BicycleParameters
from .frame.tyre import TyreParameters
from .ride.control import ControlSettings
from .ride.pilot import PilotParameters, check_pilot
from .ride.ride import Ride
from .ride.source import RideSource, SavedRide
from .ride.truth import QUANTITIES, other_truth
from .rider.anthropometry import RiderBody, rider_body
from .rider.posture import Posture, sit
from .rider.rider import Fidelity
from .rider.style import RiderStyle, rider_style
from .sensors.measured_geometry import rider_geometry
from .sensors.placement import PlacementErrors
from .sensors.placement import placement_errors as placing
from .sensors.readings import RideQuantities
from .sensors.suites import CHANNELS, suite_channels
from .sensors.worn import WornSensors, WornState

FIRST_BLOCK, BLOCK = 20, 500
"""time steps computed at once: by a reset, and later; the numbers do not depend on it"""


class RiderBicycleEnv(PoseEnv):
    """A rider balances a bicycle along a course; from few sensors an agent estimates the pose.

    ## Description

    Rider and bicycle are one multibody in PyBullet with the tyre model of this package. The rider steers with the arms,
    pedals with the legs, sways and leans (``fidelity="full"``), or is a rigid body with a moving trunk (``"lumped"``:
    limb angles follow by inverse kinematics). World: x east, y north, z up; quaternions w, x, y,
    z, body to world; bodies have x forward, y left, z up along the body. Actions do not change the ride.

    ## Action Space

    ``Box(float32)``: the agent's own estimate, at the last observation, of the quantities in ``score`` one after the
    other: quaternions w, x, y, z (normalised; zeros count as no rotation) or values in rad or m/s.

    ## Observation Space

    ``Dict``; bounds are the full scales of the sensors. Channels by suite:

    | key | shape | unit | suites |
    |---|---|---|---|
    | ``bicycle_imu/gyr``, ``trunk_imu/gyr`` | (3,) | rad/s | all |
    | ``bicycle_imu/acc``, ``trunk_imu/acc`` | (3,) | m/s², specific force | force-inertial, whole-body |
    | ``upper_arm_left/gyr``, ``…_right``, ``thigh_left/gyr``, ``…_right`` | (3,) | rad/s | whole-body |
    | ``seat/wrench`` | (6,) | N, N·m of the rider on the sensor in the seat post, its axes | force-inertial |
    | ``seat/load_cells`` | (3,) | N, compression: front, rear left, rear right | force-inertial, whole-body |
    | ``handlebar/force`` | (6,) | N of left and right hand on the bar, bicycle axes | force-inertial |
    | ``wheel/speed`` | (1,) | m/s | force-inertial, whole-body |
    | ``steer/angle``, ``crank/angle`` | (1,) | rad, left positive; 0 with the left pedal in front | whole-body |
    | ``relative/orientation`` | (4,) | trunk to bicycle, camera at 16 Hz | two-gyro |
    | ``relative/distances`` | (3,) | m, of three markers on the trunk from the camera, 16 Hz | all |
    | ``head_imu/gyr``, ``head_imu/acc`` | (3,) | rad/s; m/s² at the crown, head axes | only in a list of channels |
    | ``bicycle_imu/mag``, ``trunk_imu/mag`` | (3,) | µT | only in a list of channels |
    | ``new_sample`` | (channels,) int8 | 1 for a new sample, 0 where the last value is repeated | all |

    The bicycle's IMU sits 0.37 m ahead of the rear contact and 0.71 m high, nose 10° up; the trunk's at T6.

    ## Rewards

    Minus the sum of the errors of the scored quantities (rad; m/s for speed), at the pose that the action answers.

    ## Starting State

    Riding, one second after a start at static tyre deflection with consistent velocities. A reset to another motion
    simulates this second; a reset to the same motion of the same person restores its end at once.

    ## Episode End

    Terminated when the bicycle rolls beyond 57°; truncated after ``duration``.

    ## Info

    ``time`` (s), ``scored`` and, arrays float64:

    | key | size | meaning |
    |---|---|---|
    | ``pose/<body>/orientation`` | 4 | bicycle, trunk, head, upper_arm, … with ``_left`` and ``_right`` |
    | ``pose/bicycle/roll``, ``pitch``, ``yaw`` | 1 | rad, Z-Y-X angles, roll to the right, nose down positive |
    | ``pose/bicycle/steer``, ``crank``, ``speed`` | 1 | rad (left positive), rad, m/s |
    | ``pose/trunk/angles``, ``hip_…/angles`` | 3 | rad, ISB Z-X-Y to the bicycle |
    | ``pose/shoulder_…/angles`` | 3 | rad, ISB Y-X-Y to the trunk |
    | ``pose/elbow_…/flexion``, ``knee_…/flexion`` | 1 | rad |
    | ``truth/bicycle/position``, ``velocity``, ``acceleration`` | 3 | of the bicycle frame's origin, world |
    | ``truth/trunk/position``, ``acceleration`` | 3 | of the lumbar joint, world |
    | ``truth/head/position`` | 3 | of the neck's joint, world |
    | ``truth/…/angular_rate`` | 3 | rad/s, body axes |
    | ``truth/pelvis/height``, ``angles`` | 1, 2 | m off the saddle; rad of forward tip and of tip to the right |
    | ``truth/pelvis/shift`` | 2 | m ahead of the saddle and to the left of it; of styles with phases on the pedals |
    | ``truth/seat/force``, ``moment`` | 3 | of the rider on the saddle, bicycle axes, N, N·m |
    | ``truth/handlebar/force_…``, ``pedal/force_…`` | 3 | of hands and feet, bicycle axes, N |
    | ``truth/joints/angles``, ``torques`` | 19 | rad, N·m (torques of a lumped rider: 3) |
    | ``truth/steer/rate``, ``crank/rate``, ``wheel/rate``, ``wheel/angle`` | 1 | rad/s, rad |
    | ``truth/<site>/gyroscope_bias`` … | | bias of the last sample of each sensor |
    | ``truth/<site>/lever_arm``, ``rotation`` | 3, 4 | m, quaternion: where an inertial sensor really is on its body |

    ## Arguments

    Args:
        scenario: name, see :func:`.list_scenarios`; ``"slalom+bumps"`` composes; or a
            :class:`poise.envs.bicycle.course.scenarios.Scenario`. ``reset(options={"scenario": …})`` replaces it once.
        subject: 0…4, ``"random"``, or a :class:`poise.envs.bicycle.rider.anthropometry.RiderBody`; also a reset option.
        style: ``still``, ``mild``, ``normal``, ``aggressive``, ``standing`` (out of the saddle for most of the time),
            ``random`` (another one in each ride, seated), or a style; None for that of the scenario.
        suite: ``two-gyro``, ``force-inertial``, ``whole-body``, ``all``, or a list of channels
            (:mod:`poise.envs.bicycle.sensors.suites` has their sites and errors) and of your own :class:`.Sensor`
            objects on the bodies ``bicycle``, ``trunk``, ``head``, ….
        sensors: ``paper``, ``ideal``, or a device (:func:`poise.envs.sensors.presets.list_sensor_presets`) in place of
            the papers' inertial sensors.
        rate: Hz; None for that of the suite.
        duration: s.
        fidelity: ``full`` or ``lumped``.
        bicycle: ``mountain-bike``, ``city-bike``, ``racing-bike``, ``trail-bike``, ``cargo-bike``
            (:mod:`poise.envs.bicycle.frame.bicycles`) or parameters with a crank.
        physics_rate: physics steps per second, Hz; a multiple of 250 Hz and of ``rate``.
        score: one quantity or several of ``info["pose"]``; by default the orientations of bicycle and trunk.
        noise_scale: factor on all errors, 0 for none.
        pilot: who steers: ``expert``, ``skilled`` or ``novice``, human riders with delays, noise and muscles
            (:mod:`poise.envs.bicycle.ride.pilot`); ``random``, one of them for each ride; ``ideal``, a regulator of the
            exact state; or parameters.
        sampling: ``interval`` or ``instant``, of gyroscopes, accelerometers and contact forces: the mean over the
            interval that ends with the sample, or what acts at its end (forces: in the last physics step).
        surface: of the road: a name of :func:`poise.envs.bicycle.course.surfaces.list_surfaces` or a
            :class:`poise.envs.bicycle.course.surfaces.Surface`; ``smooth`` is exact, ``random`` draws one for each
            ride, and None takes that of the scenario.
        timing: delay, jitter, clock drift and lost packets of all sensors, or of each site (``trunk_imu``,
            ``relative``, ``seat`` …): a name of :data:`poise.envs.sensors.timing.TIMINGS` or a
            :class:`poise.envs.sensors.timing.Timing`; None for none.
        magnetics: disturbances of the magnetic field: a name of :data:`poise.envs.sensors.magnetics.MAGNETICS` or a
            :class:`poise.envs.sensors.magnetics.Magnetics`; None for none.
        placement_errors: factor on the default :class:`poise.envs.bicycle.sensors.placement.PlacementErrors`, or such
            errors: each ride has its sensors a little beside their places. :attr:`geometry` does not know.
        soft_tissue: factor on the motion of worn sensors on soft tissue
            (:mod:`poise.envs.bicycle.sensors.soft_tissue`); None for ``noise_scale``, and for 0 with ideal sensors.
        render_mode: ``human`` (a window), ``rgb_array`` or None.

    Raises:
        ValueError: an argument out of its range, an unknown name, or a rider who does not fit on the bicycle.

    ## Version History

    * v0: first release.
    """

    reset_options: ClassVar[tuple[str, ...]] = ("scenario", "subject")

    def __init__(
        self,
        scenario: str | Scenario = "indoor_circle",
        subject: int | str | RiderBody = 0,
        style: str | RiderStyle | None = None,
        suite: str | Sequence[str | Sensor] = "whole-body",
        sensors: str = "paper",
        rate: float | None = None,
        duration: float = 60.0,
        fidelity: Fidelity = "full",
        bicycle: str | BicycleParameters = "mountain-bike",
        physics_rate: float = 500.0,
        score: str | Sequence[str] = ("bicycle/orientation", "trunk/orientation"),
        *,
        noise_scale: float = 1.0,
        sampling: Sampling = "interval",
        surface: str | Surface | None = None,
        timing: Timings | None = None,
        magnetics: str | Magnetics | None = None,
        pilot: str | PilotParameters = "skilled",
        placement_errors: float | PlacementErrors = 0.0,
        soft_tissue: float | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.scenario, self.subject, self.style = named_scenario(scenario), subject, style
        if style not in (None, "random"):
            rider_style(style)
        if surface not in (None, "random"):
            named_surface(surface)
        self.parameters = _bicycle(bicycle)
        if fidelity not in ("full", "lumped"):
            raise ValueError(f"fidelity must be 'full' or 'lumped', got {fidelity!r}")
        if not 0.1 <= duration < math.inf:
            raise ValueError(f"duration must be at least 0.1 s and finite, got {duration}")
        self.fidelity, self.duration, self.physics_rate = fidelity, float(duration), float(physics_rate)
        names, own, _ = suite_channels(suite)
        if any(name.startswith("disk") for name in names):
            raise ValueError(f"suite must be one that a rider wears: there is no disk on this bicycle, got {suite!r}")
        self._sensors: dict[str, Any] = {
            "name": suite if isinstance(suite, str) else (*names, *own),
            "sensors": sensors,
            "rate": rate,
            "noise_scale": noise_scale,
            "sampling": sampling,
            "timing": timing,
            "magnetics": magnetics,
        }
        self.placement_errors = placing(placement_errors)
        self.soft_tissue = (0.0 if sensors == "ideal" else noise_scale) if soft_tissue is None else soft_tissue
        self.tyre = TyreParameters()
        self._fit(sit(self.parameters, RiderBody() if subject == "random" else rider_body(subject)))
        made = self._worn.suite
        limbs = [name for name in names if CHANNELS[name].body not in ("bicycle", "trunk")]
        if fidelity == "lumped" and sampling == "instant" and limbs:
            raise ValueError(
                f"a lumped rider's limbs have no instantaneous rates: sampling must be 'interval' for {limbs}"
            )
        control = ControlSettings().rate
        for name, value in (("the sensors' rate", made.rate), ("the control rate", control)):
            if abs(physics_rate / value - max(1, round(physics_rate / value))) > 1e-9:
                raise ValueError(f"physics_rate must be a multiple of {name} of {value:g} Hz, got {physics_rate:g} Hz")
        quantities = _quantities(score)
        self._source = RideSource(
            self.parameters,
            style,
            self.duration,
            made.rate,
            self.physics_rate,
            fidelity,
            self.tyre,
            sampling,
            surface,
            check_pilot(pilot),
        )
        bounds = [{"rotation": 1.0, "angle": math.pi}.get(quantity.kind, 20.0) for quantity in quantities]
        super().__init__(made, quantities, made.rate, render_mode, bounds)

    @property
    def ride(self) -> Ride | None:
        """The ride in progress; None before the first reset."""
        return self._source.ride

    @property
    def geometry(self) -> RiderGeometry:
        """Anthropometry and mounting with which a filter may be configured; before a reset that of the arguments."""
        return rider_geometry(self._worn.posture, self._worn.sites)

    @property
    def scenery(self) -> tuple[Posture, Ground]:
        """The person on the bicycle and the ground of the present ride, for a picture."""
        return self._worn.posture, self._source.ground

    def ride_with(self, leader: RiderBicycleEnv) -> None:
        """Sense the rides of another environment from now on instead of riding them again, with the same results.

        A reset must follow one of the other environment with the same seed and options. Neither can take snapshots.

        Raises:
            ValueError: bicycle, rider model or sampling differ.
        """
        self._source.follow(leader._source)

    def begin(self, motion: np.random.Generator, sensors: np.random.Generator, options: Mapping[str, Any]) -> int:
        """Draw rider, course and movements, and start the ride."""
        chosen = named_scenario(options.get("scenario", self.scenario))
        subject = options.get("subject", self.subject)
        self._source.begin(chosen, subject, motion)
        self._started()
        self._worn.reset(sensors)
        self.suite = self._worn.suite
        return max(1, round(self.duration * self.rate))

    def _started(self) -> None:
        """Sensors and picture of the new ride."""
        if self._source.posture is not self._worn.posture:
            self._fit(self._source.posture)
        if self._scene is not None and self._source.ground is not self._drawn_ground:
            self._scene.close()
            self._scene = None

    def _fit(self, posture: Posture) -> None:
        """Mount the sensors on a person on the bicycle."""
        self._worn = WornSensors(posture, self._sensors, self.placement_errors, self.soft_tissue)

    def next_block(self, most: int) -> Block:
        """Advance the ride and simulate the sensors."""
        log, bodies, pose = self._source.record(min(most, BLOCK if self._source.samples else FIRST_BLOCK))
        contact = log.contact
        ride = RideQuantities(
            bodies,
            self._worn.sites,
            wheel_rate=log.wheel_rate,
            steer=log.steer,
            crank=log.crank,
            seat_force=contact.seat_force,
            seat_moment=contact.seat_moment,
            hands=contact.hands,
        )
        measurements, of_sensors = self._worn.simulate(bodies, ride)
        truth = {**other_truth(log, bodies["head"]), **of_sensors}
        return Block(log.time, measurements, pose, truth, np.ones(len(log.time), bool))

    def ending(self) -> tuple[int, bool]:
        """The last step, or that of a fall, which terminates the episode."""
        fallen_at = self._source.fallen_at
        return (int(fallen_at), True) if fallen_at <= self._last_step else (self._last_step, False)

    def save_source(self) -> tuple[SavedRide, WornState]:
        """The ride, and the sensors' state."""
        return self._source.save(), self._worn.save()

    def restore_source(self, saved: tuple[SavedRide, WornState]) -> None:
        """Undo :meth:`save_source`."""
        ride, sensors = saved
        self._source.restore(ride)
        self._started()
        self._worn.restore(sensors)
        self.suite = self._worn.suite

    def make_scene(self, gui: bool) -> Scene:
        """Rider, bicycle and ground."""
        from .course.scene import RideScene

        self._drawn_ground = self._source.ground
        return RideScene(*self.scenery, gui=gui)

    def close(self) -> None:
        """Close window and physics; may be called twice."""
        super().close()
        self._source.close()
        self._block = None


def _bicycle(bicycle: str | BicycleParameters) -> BicycleParameters:
    if isinstance(bicycle, BicycleParameters):
        return bicycle
    if bicycle not in BICYCLES:
        raise ValueError(f"bicycle must be one of {list(BICYCLES)} or BicycleParameters, got {bicycle!r}")
    return BICYCLES[bicycle]


def _quantities(score: str | Sequence[str]) -> tuple[Quantity, ...]:
    names = (score,) if isinstance(score, str) else tuple(score)
    unknown = [name for name in names if name not in QUANTITIES]
    if unknown or not names or len(set(names)) < len(names):
        raise ValueError(f"score must name different ones of {list(QUANTITIES)}, got {list(names)}")
    return tuple(QUANTITIES[name] for name in names)
