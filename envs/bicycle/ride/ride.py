"""One ride: world, bicycle, rider and control model, which can be stepped, saved and restored."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....filters.core.quantity import STANDARD_GRAVITY
from ...physics.world import BASE, Physics
from ..course.events import Events
from ..course.path import Path
from ..course.terrain import Ground
from ..frame.bicycle import ROLL, SPEED, WHEEL_RATE, Bicycle, BicycleMemory, BicycleState
from ..frame.tyre import TyreParameters
from ..rider.muscles import RESTING
from ..rider.posture import Posture
from ..rider.rider import Fidelity, Rider, RiderMemory
from ..rider.style import RiderMotion
from .control import ControlSettings, Pilot, PilotMemory
from .foot import Foot
from .human import HumanPilot, leaning_trunk
from .pilot import IDEAL, PilotParameters, pilot_parameters

COASTING = 5.0
"""N of deceleration force left to drag before the brakes are used"""
SLOWLY = 6.8
"""rad/s (65 a minute): cadence at most that a rider prefers who stands on the pedals"""
FALLEN = 1.0
"""rad of roll at which a ride is over"""


@dataclass(frozen=True)
class RideMemory:
    """The whole state of a ride between two physics steps; valid in the world that made it."""

    physics: tuple[int, int]
    bicycle: BicycleMemory
    rider: RiderMemory
    pilot: PilotMemory
    control: int
    foot: float


class Ride:
    """A rider on a bicycle on a path.

    Args:
        posture: the person fitted to the bicycle.
        motion: how the rider moves.
        path: where to ride; the ride begins at its start.
        speed: wanted speed (m/s) over time (s).
        ground: None for a level plane.
        fidelity: ``full`` or ``lumped``.
        physics_rate: physics steps per second, Hz; a multiple of the control rate.
        tyre: None for default tyres.
        control: None for default settings.
        pilot: who steers: ``ideal``, or a human by name or parameters (:mod:`.pilot`).
        noise: seed of a human's senses and muscles; None for 0.
        events: gusts and pushes, coasting, cadence.
        crank: angle at the start, rad.
        gravity: m/s².
        gui: open PyBullet's window.

    Raises:
        ValueError: the physics rate is not a multiple of the control rate.
    """

    def __init__(
        self,
        posture: Posture,
        motion: RiderMotion,
        path: Path,
        speed: Callable[[float], float],
        *,
        ground: Ground | None = None,
        fidelity: Fidelity = "full",
        physics_rate: float = 500.0,
        tyre: TyreParameters | None = None,
        control: ControlSettings | None = None,
        pilot: str | PilotParameters = IDEAL,
        noise: np.random.SeedSequence | None = None,
        events: Events | None = None,
        crank: float = 0.3,
        gravity: float = STANDARD_GRAVITY,
        gui: bool = False,
    ) -> None:
        settings = ControlSettings() if control is None else control
        self._each = round(physics_rate / settings.rate)
        if self._each < 1 or abs(self._each * settings.rate - physics_rate) > 1e-6 * physics_rate:
            raise ValueError(f"physics_rate must be a multiple of {settings.rate:g} Hz, got {physics_rate:g} Hz")
        load = posture.load()
        self.physics = Physics(time_step=1.0 / physics_rate, gravity=gravity, gui=gui)
        self.rider = Rider(posture, fidelity, motion.stands)
        self.bicycle = Bicycle(self.physics, self.rider.ridden, ground, tyre, load=load, extend=self.rider.extend)
        self.rider.mount(self.bicycle)
        self._loaded, self._settings = posture.bicycle.with_load(load), settings
        trunk = posture.trunk()
        whole = sum(part.mass * part.centre[2] for part in self._loaded.parts)
        self._lean_effect = trunk.mass * float(trunk.centre[2]) * np.cos(posture.flexion) / whole
        self.foot, self._seen = Foot(), np.zeros(15)
        self.begin(motion, path, speed, ground=ground, pilot=pilot, noise=noise, events=events, crank=crank)

    def begin(
        self,
        motion: RiderMotion,
        path: Path,
        speed: Callable[[float], float],
        *,
        ground: Ground | None = None,
        pilot: str | PilotParameters = IDEAL,
        noise: np.random.SeedSequence | None = None,
        events: Events | None = None,
        crank: float = 0.3,
    ) -> None:
        """Start another ride of the same person in the same world; bit for bit what a new :class:`Ride` would do.

        States saved before can no longer be restored. Arguments as those of the class.
        """
        self.physics.steps = 0
        self.bicycle.lay(ground)
        self.pilot = self._pilot(pilot, noise, motion)
        self.path, self.speed, self.events = path, speed, Events() if events is None else events
        if self.bicycle.drivetrain is not None:
            cadence = self.events.cadence
            if motion.stands:
                cadence = SLOWLY if cadence is None else min(cadence, SLOWLY)
            self.bicycle.drivetrain.prefer(cadence)
        point, first = path.at(0.0), self.pilot.comfortable_speed(path, speed(0.0))
        self.bicycle.start(first, (point.x, point.y), point.heading, crank=crank)
        self.rider.start(motion, crank, self.bicycle.state().crank_rate)
        self.pilot.start(path, first)
        self.foot.start(first)
        self._count = 0
        self._look()

    def _pilot(self, name: str | PilotParameters, noise: np.random.SeedSequence | None, motion: RiderMotion) -> Pilot:
        human, gravity = pilot_parameters(name), self.physics.gravity
        if human is None:
            return Pilot(self._loaded, self._settings, gravity, lean_effect=self._lean_effect)
        seed = np.random.SeedSequence(0) if noise is None else noise
        trunk = leaning_trunk(self.rider.posture, self.rider.full, motion.style.levelling)
        return HumanPilot(self._loaded, human, seed, trunk, self._settings, gravity)

    @property
    def state(self) -> BicycleState:
        """Of the bicycle, as of the last control step."""
        return BicycleState(self._looked, *self._seen.tolist())

    def _look(self) -> None:
        self._looked = self.physics.time
        self.bicycle.look(self._seen)

    @property
    def fallen(self) -> bool:
        """Whether the bicycle fell or left the ground (as of the last control step)."""
        return not abs(self._seen.item(ROLL)) < FALLEN

    def step(self) -> None:
        """Advance by one physics step."""
        rider, bicycle = self.rider, self.bicycle
        if self._count % self._each == 0:
            self._control()
        self._count += 1
        brake = max(0.0, -self.pilot.command[1] - COASTING)
        side = self.events.side
        if side is None and self.foot.engaged == 0.0:
            rider.act_on_bicycle(brake)
        else:
            rider.act()
            self.foot.push(bicycle, self.state)
            if side is not None:
                self._push_aside(side(self.physics.time))
            bicycle.act(brake=brake)
        self.physics.step()

    def _control(self) -> None:
        self._look()
        time, seen, pilot = self._looked, self._seen, self.pilot
        self.bicycle.shift(seen.item(WHEEL_RATE))
        wanted, coasting = self.speed(time), self.events.coasts(time)
        pilot.coast(coasting)
        self.foot.update(seen.item(SPEED), wanted, pilot.period)
        torque, drive = pilot.update(self.rider.unswung(seen), wanted, self.rider.intended_lean)
        if self.foot.engaged:
            torque = self.foot.steer(torque, self.state)
        if coasting and drive >= -COASTING:
            drive = RESTING
        self.rider.plan(seen, pilot.curvature_ahead, torque, drive, self.foot.engaged)

    def _push_aside(self, force: float) -> None:
        """A force (N, to the left) on the frame, at the height of the saddle."""
        state, body = self.state, self.bicycle.body
        c, s = math.cos(state.yaw), math.sin(state.yaw)
        x, _, z = self.rider.posture.bicycle.saddle
        # a rolled bicycle carries its saddle to the side
        aside = -z * math.sin(state.roll)
        point = (state.x + c * x - s * aside, state.y + s * x + c * aside, state.z + z * math.cos(state.roll))
        body.push(BASE, (-s * force, c * force, 0.0), point)

    def save(self) -> RideMemory:
        """Keep the whole state; free it with :meth:`forget`."""
        return RideMemory(
            self.physics.save(),
            self.bicycle.save(),
            self.rider.save(),
            self.pilot.save(),
            self._count,
            self.foot.engaged,
        )

    def restore(self, memory: RideMemory) -> None:
        """Return to a saved state, bitwise."""
        self.physics.restore(memory.physics)
        self.bicycle.restore(memory.bicycle)
        self.rider.restore(memory.rider)
        self.pilot.restore(memory.pilot)
        self._count, self.foot.engaged = memory.control, memory.foot
        self._look()

    def forget(self, memory: RideMemory) -> None:
        """Free a saved state."""
        self.physics.forget(memory.physics)

    def close(self) -> None:
        """End the world."""
        self.physics.close()

    def __enter__(self) -> Ride:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
