"""Rides for an environment: drawn from a generator, ridden sample by sample, saved and restored."""

from __future__ import annotations

import copy
import math
import uuid
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...sensors.ideal import BodyState, Sampling
from ..course.scenarios import Scenario
from ..course.surfaces import Surface
from ..course.terrain import Ground
from ..frame.parameters import BicycleParameters
from ..frame.tyre import TyreParameters
from ..rider.anthropometry import rider_body
from ..rider.head import HeadMotion, HeadState
from ..rider.posture import Posture, sit
from ..rider.rider import Fidelity
from ..rider.style import RiderMotion, RiderStyle, rider_style
from .log import RideLog, RideRecorder
from .pilot import IDEAL, PILOTS, RANDOM, PilotParameters
from .ride import Ride, RideMemory
from .tape import Tape
from .truth import Quaternions, continuous_pose, segment_states, true_pose

SETTLING = 1.0
"""s of riding before time 0, at which every suite of sensors takes its first sample"""
KEPT = 8
"""snapshots that can be restored without riding again"""


class Ridden(NamedTuple):
    """Some samples of a ride; times count from the first one."""

    log: RideLog
    bodies: dict[str, BodyState]
    pose: dict[str, np.ndarray]


class SavedRide(NamedTuple):
    """Enough to return to a sample, here or elsewhere."""

    plan: tuple[Scenario, Any, np.random.Generator]
    """scenario, subject and generator from which the ride was drawn"""
    samples: int
    fallen_at: float
    quaternions: Quaternions
    head: HeadState | None
    token: str
    """where PyBullet's state is kept for a quick return"""


class RideSource:
    """Rides of people on one bicycle, one at a time.

    Args:
        bicycle: what is ridden.
        style: how riders move; None for the style of each scenario.
        duration: s of a ride.
        rate: samples per second, Hz.
        physics_rate: physics steps per second, Hz; a multiple of ``rate``.
        fidelity: ``full`` or ``lumped``.
        tyre: of both wheels.
        sampling: of the contact forces, see :class:`.RideRecorder`.
        surface: of the road; None for that of each scenario.
        pilot: who steers, see :func:`.pilot_parameters`; ``random`` draws one of the skills for each ride.

    Raises:
        ValueError: a sample takes longer than the ride before time 0.
    """

    def __init__(
        self,
        bicycle: BicycleParameters,
        style: str | RiderStyle | None,
        duration: float,
        rate: float,
        physics_rate: float,
        fidelity: Fidelity,
        tyre: TyreParameters,
        sampling: Sampling = "interval",
        surface: str | Surface | None = None,
        pilot: str | PilotParameters = IDEAL,
    ) -> None:
        self.pilot = pilot
        self.bicycle, self.style, self.duration, self.rate = bicycle, style, duration, rate
        self.physics_rate, self.fidelity = physics_rate, fidelity
        self.tyre, self.sampling, self.surface = tyre, sampling, surface
        if rate * SETTLING < 1.0:
            raise ValueError(f"rate must be at least {1.0 / SETTLING:g} Hz, got {rate:g}")
        self._settling, self._each = round(SETTLING * physics_rate), round(physics_rate / rate)
        self.ride: Ride | None = None
        self._tape: Tape | None = None
        self._taped = False
        self._leader: RideSource | None = None
        self.fallen_at = math.inf
        self._kept: dict[str, RideMemory] = {}
        self._motion_key: tuple[Any, ...]
        self._world_key: tuple[Any, ...]
        self._first: RideMemory
        self.posture: Posture
        self.ground: Ground

    def follow(self, leader: RideSource) -> None:
        """From now on read the rides of another source, which keeps them on a tape, instead of riding them again.

        Every ride must have begun there, with the same draw. Neither source can save its rides then.

        Raises:
            ValueError: the other source rides another bicycle, rider model or sampling.
        """
        for name in ("bicycle", "fidelity", "sampling"):
            ours, theirs = getattr(self, name), getattr(leader, name)
            if ours != theirs:
                raise ValueError(f"{name} must be that of the ride that is shared, {theirs!r}, got {ours!r}")
        self._leader, leader._taped = leader, True

    def begin(self, scenario: Scenario, subject: Any, motion: np.random.Generator) -> None:
        """Begin a ride one sample before its first second is over; what was drawn is kept to ride it again.

        The same draw restores the state kept there. Another draw of the same person begins in the same world; another
        person, or a previous fall, requires a new world. All three give the same ride, bit for bit.
        """
        seed = str(motion.bit_generator.seed_seq.state)  # type: ignore[attr-defined]
        key = (
            scenario,
            subject,
            self.style,
            self.duration,
            self.physics_rate,
            self.tyre,
            self.surface,
            self.pilot,
            seed,
        )
        if self._leader is not None:
            self._take_ride(self._leader, key)
        else:
            if self.ride is not None and (self.ride.fallen or self._taped):
                self.close()
            if self.ride is None or key != self._motion_key:
                plan = (scenario, subject, copy.deepcopy(motion))
                self._ride_first_second(scenario, subject, motion)
                self._plan, self._motion_key = plan, key
            else:
                self.ride.restore(self._first)
        assert self.ride is not None
        begin = self._settling - self._each
        self._recorder = RideRecorder(self.ride, self._each, self.sampling, self._tape, begin)
        self._began = self._settling * self.ride.physics.time_step
        self._samples, self.fallen_at, self._head.state = 0, math.inf, None
        self._quaternions: Quaternions = {}

    def _take_ride(self, leader: RideSource, key: tuple[Any, ...]) -> None:
        """Share the present ride of another source."""
        if leader.ride is None or leader._motion_key != key:
            raise ValueError("the ride that is shared must have begun, with the same scenario, rider and seed")
        self.ride, self._tape, self._motion_key = leader.ride, leader._tape, key
        self.posture, self.ground = leader.posture, leader.ground
        movement = self.ride.rider.motion
        self._head = HeadMotion(self.posture, movement.gaze, self.rate, movement.steadied)

    def _ride_first_second(self, scenario: Scenario, subject: Any, motion: np.random.Generator) -> None:
        """Draw rider, course and movements, and settle on the saddle."""
        for_body, for_course, for_movement, for_crank, for_pilot = motion.spawn(5)
        body = rider_body(subject, for_body)
        style = rider_style(scenario.style if self.style is None else self.style, for_movement.spawn(1)[0])
        world = (body, self.physics_rate, self.tyre, style.standing > 0.0)
        same = self.ride is not None and world == self._world_key
        posture = self.posture if same else sit(self.bicycle, body)
        length = self.duration + SETTLING + 1.0
        course = scenario.draw(for_course, length, self.surface)
        movement = RiderMotion(style, for_movement, length)
        crank = float(for_crank.uniform(0.0, 2.0 * math.pi))
        skills = list(PILOTS)
        pilot = skills[int(for_pilot.integers(len(skills)))] if self.pilot == RANDOM else self.pilot
        noise = np.random.SeedSequence(for_pilot.integers(2**63, size=2).tolist())
        chosen: dict[str, Any] = {"ground": course.ground, "events": course.events, "crank": crank}
        chosen |= {"pilot": pilot, "noise": noise}
        if self.ride is not None and same:
            for memory in (*self._kept.values(), self._first):
                self.ride.forget(memory)
            self._kept = {}
            self.ride.begin(movement, course.path, course.speed, **chosen)
        else:
            self.close()
            self.ride = Ride(
                posture,
                movement,
                course.path,
                course.speed,
                fidelity=self.fidelity,
                physics_rate=self.physics_rate,
                tyre=self.tyre,
                **chosen,
            )
            self._world_key, self.posture = world, posture
        self.ground = course.ground
        self._head = HeadMotion(posture, movement.gaze, self.rate, movement.steadied)
        if self._taped:
            self._tape = Tape(self.ride)
            return
        for _ in range(self._settling - self._each):
            self.ride.step()
        self._first = self.ride.save()

    @property
    def samples(self) -> int:
        """Number of samples recorded in the present ride."""
        return self._samples

    def record(self, most: int) -> Ridden:
        """Ride on for ``most`` samples, or to the one in which the rider fell."""
        log = self._recorder.record(most)
        bodies = segment_states(log)
        bodies["head"] = self._head.carry(bodies["trunk"])
        log = replace(log, time=log.time - self._began)
        bodies = {name: state._replace(time=log.time) for name, state in bodies.items()}
        pose, self._quaternions = continuous_pose(true_pose(log, bodies), self._quaternions)
        if log.fallen.any():
            self.fallen_at = self._samples + len(log.time) - 1
        self._samples += len(log.time)
        return Ridden(log, bodies, pose)

    def save(self) -> SavedRide:
        """The drawn ride and the position in it, with a reference to PyBullet's state for a quick return."""
        assert self.ride is not None
        if self._tape is not None:
            raise RuntimeError("a ride that several environments share cannot be saved")
        token = uuid.uuid4().hex
        self._kept[token] = self.ride.save()
        if len(self._kept) > KEPT:
            self.ride.forget(self._kept.pop(next(iter(self._kept))))
        return SavedRide(self._plan, self._samples, self.fallen_at, dict(self._quaternions), self._head.state, token)

    def restore(self, saved: SavedRide) -> None:
        """Undo :meth:`save`: from memory if the state is still there, else by simulating the ride again."""
        if self.ride is not None and saved.plan is self._plan and saved.token in self._kept:
            self.ride.restore(self._kept[saved.token])
        else:
            scenario, subject, motion = saved.plan
            self.begin(scenario, subject, copy.deepcopy(motion))
            self._plan = saved.plan
            if saved.samples:
                self._recorder.record(saved.samples)
        self._samples, self.fallen_at, self._quaternions = saved.samples, saved.fallen_at, dict(saved.quaternions)
        self._head.state = saved.head

    def close(self) -> None:
        """End the world; may be called twice."""
        ride, self.ride, self._tape = self.ride, None, None
        self._kept = {}
        if ride is not None and self._leader is None:
            ride.close()
