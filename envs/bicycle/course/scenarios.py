"""Registry of scenarios (course and speed), which are drawn from a generator and can be combined."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ....filters.support.names import unknown
from .events import Events, coasting_phases, gusts, usual_cadence
from .path import Path, smooth_curvature, wandering_path
from .surfaces import SURFACES, Surface
from .surfaces import surface as named_surface
from .terrain import Bump, FlatGround, Ground, GroundSum, Ramp

STOP_HOLD = 9.0
"""s from a stop to the next level, and from there to the next stop"""
Factory = Callable[[np.random.Generator, float], "SpeedProfile"]


class SpeedProfile:
    """Wanted speed over time: random levels, blended smoothly.

    Args:
        levels: m/s, one every ``hold`` seconds.
        hold: s.
        dwell: part of ``hold`` in which a level stays before the next begins.
    """

    def __init__(self, levels: np.ndarray, hold: float = 10.0, dwell: float = 0.0) -> None:
        self.levels, self.hold, self.dwell = np.atleast_1d(levels).astype(float), hold, dwell
        self._levels: list[float] = self.levels.tolist()

    @property
    def mean(self) -> float:
        """Mean level, m/s."""
        return float(self.levels.mean())

    def __call__(self, time: float) -> float:
        """Speed (m/s) at a time (s); the last level stays."""
        place = max(0.0, time / self.hold)
        levels = self._levels
        index = min(int(place), len(levels) - 1)
        following = min(index + 1, len(levels) - 1)
        part = max(0.0, min(1.0, (place - index - self.dwell) / (1.0 - self.dwell)))
        blend = 0.5 - 0.5 * math.cos(math.pi * part)
        return levels[index] + blend * (levels[following] - levels[index])


@dataclass(frozen=True)
class Course:
    """One drawn scenario."""

    path: Path
    speed: SpeedProfile
    ground: Ground
    """bumps and slopes, with the surface on them"""
    surface: Surface
    events: Events


@dataclass(frozen=True)
class Scenario:
    """Distribution of a kind of course. Replace a part (``dataclasses.replace``) to compose another scenario."""

    name: str
    summary: str
    speed: Factory
    """generator, duration (s) → wanted speed"""
    path: Callable[[np.random.Generator, float], Path]
    """generator, length (m) → path"""
    ground: Callable[[np.random.Generator, Path, SpeedProfile], Ground]
    """generator, path, speed → bumps and slopes, without the roughness of the surface"""
    style: str = "normal"
    """default riding style"""
    surface: str | Surface = "smooth"
    """default surface"""
    windy: bool = False
    """whether there are gusts and pushes from the side"""
    coasts: bool = False
    """whether the rider coasts now and then"""

    def draw(self, rng: np.random.Generator, duration: float, surface: str | Surface | None = None) -> Course:
        """Draw a course for a ride of ``duration`` s; a surface replaces the scenario's own, ``"random"`` draws one.

        Raises:
            ValueError: an unknown surface.
        """
        for_speed, for_path, for_ground, for_surface, for_events = rng.spawn(5)
        speed = self.speed(for_speed, duration)
        longest = float(speed.levels.max()) * duration + 10.0
        path = self.path(for_path, longest)
        laid = self.surface if surface is None else surface
        if laid == "random":
            laid = list(SURFACES)[int(for_surface.integers(1, len(SURFACES)))]
        laid = named_surface(laid)
        ground = GroundSum([self.ground(for_ground, path, speed), laid.draw(for_surface)])
        cadence = usual_cadence(for_events)
        side = gusts(for_events, speed.mean, duration) if self.windy else None
        events = Events(side, coasting_phases(for_events, duration) if self.coasts else (), cadence)
        return Course(path, speed, ground, laid, events)


def _steady_speed(rng: np.random.Generator, duration: float, low: float, high: float) -> SpeedProfile:
    return SpeedProfile(rng.uniform(low, high, 1))


def _steady(low: float, high: float) -> Factory:
    return partial(_steady_speed, low=low, high=high)


def _varied_speed(rng: np.random.Generator, duration: float, low: float, high: float, hold: float) -> SpeedProfile:
    """Levels from the whole range, each part of it once, in random order."""
    size = max(2, math.ceil(duration / hold) + 1)
    parts = (rng.permutation(size) + rng.uniform(size=size)) / size
    return SpeedProfile(low + (high - low) * parts, hold, dwell=0.5)


def _stops(rng: np.random.Generator, duration: float, low: float, high: float) -> SpeedProfile:
    """From rest to a level and back to rest, again and again."""
    size = max(2, math.ceil(duration / STOP_HOLD) + 1)
    levels = rng.uniform(low, high, size)
    levels[::2] = 0.0
    return SpeedProfile(levels, STOP_HOLD, dwell=0.35)


def _flat(rng: np.random.Generator, path: Path, speed: SpeedProfile) -> Ground:
    return FlatGround()


def _all_of(rng: np.random.Generator, path: Path, speed: SpeedProfile, scenes: tuple[Scenario, ...]) -> Ground:
    return GroundSum(
        [scene.ground(child, path, speed) for scene, child in zip(scenes, rng.spawn(len(scenes)), strict=True)]
    )


def _two_bumps(rng: np.random.Generator, path: Path, speed: SpeedProfile) -> Ground:
    """Two bumps of 4 cm, reached about 13 and 15 s after the start, as in the whole-body paper's ride."""
    bumps = []
    for time in (13.0, 15.0):
        point = path.at(speed.mean * (time + float(rng.uniform(-0.2, 0.2))))
        bumps.append(Bump((point.x, point.y), point.heading, float(rng.uniform(0.035, 0.045)), 0.4))
    return GroundSum(bumps)


def _hill(rng: np.random.Generator, path: Path, speed: SpeedProfile) -> Ground:
    """A ramp of up to 20°, reached about 12 s after the start."""
    point = path.at(speed.mean * 12.0)
    angle = math.radians(float(rng.uniform(17.0, 20.0)))
    return Ramp((point.x, point.y), point.heading, angle, rounding=1.8, steep=0.6, top=4.0)


def _straight(rng: np.random.Generator, length: float) -> Path:
    return Path(np.zeros(max(2, math.ceil(length / 0.02))), (0.0, 0.0, float(rng.uniform(-math.pi, math.pi))))


def _circle(rng: np.random.Generator, length: float) -> Path:
    radius = float(rng.uniform(2.3, 2.7)) * (1.0 if rng.random() < 0.5 else -1.0)
    curvature = smooth_curvature(lambda s: np.where(s > 2.5, 1.0 / radius, 0.0), length, blend=2.0)
    return Path(curvature, (0.0, 0.0, float(rng.uniform(-math.pi, math.pi))))


def _wander(rng: np.random.Generator, length: float) -> Path:
    start = (0.0, 0.0, float(rng.uniform(-math.pi, math.pi)))
    return wandering_path(rng, length, start=start, widest_radius=12.0, shortest_leg=20.0)


def _nudged(rng: np.random.Generator, length: float) -> Path:
    """A straight line with a short gentle turn, one way or the other, every 20 to 30 m."""
    places = np.cumsum(rng.uniform(20.0, 30.0, max(1, math.ceil(length / 20.0))))
    turns = rng.uniform(0.05, 0.08, len(places)) * rng.choice([-1.0, 1.0], len(places))

    def curvature(s: np.ndarray) -> np.ndarray:
        near = np.abs(s[:, None] - places) < 3.0
        return (near * turns).sum(axis=1)

    start = (0.0, 0.0, float(rng.uniform(-math.pi, math.pi)))
    return Path(smooth_curvature(curvature, length, blend=3.0), start)


def _weave(rng: np.random.Generator, length: float) -> Path:
    period, radius = float(rng.uniform(14.0, 18.0)), float(rng.uniform(6.0, 8.0))
    wave = 2.0 * math.pi / period
    curvature = smooth_curvature(lambda s: (s > 4.0) * np.sin(wave * (s - 4.0)) / radius, length, blend=2.0)
    return Path(curvature, (0.0, 0.0, float(rng.uniform(-math.pi, math.pi))))


SCENARIOS = {
    scenario.name: scenario
    for scenario in (
        Scenario(
            "indoor_circle",
            "a circle of about 2.5 m radius at about 1 m/s on a hall floor",
            _steady(0.9, 1.1),
            _circle,
            _flat,
            surface="hall",
        ),
        Scenario(
            "outdoor",
            "an arbitrary path in 50 × 40 m at 0.5 to 6 m/s on worn tarmac",
            partial(_varied_speed, low=0.6, high=6.4, hold=10.0),
            _wander,
            _flat,
            surface="rough-tarmac",
        ),
        Scenario(
            "straight",
            "nearly straight at 2.5 to 3.5 m/s, turning only now and then",
            _steady(2.5, 3.5),
            _nudged,
            _flat,
            "mild",
            "tarmac",
        ),
        Scenario("bumps", "two bumps at 13 and 15 s", _steady(2.8, 3.4), _straight, _two_bumps, "mild", "tarmac"),
        Scenario("pitch", "up and down a ramp of up to 20°", _steady(3.6, 4.2), _straight, _hill, "mild", "tarmac"),
        Scenario(
            "slalom",
            "left and right around cones at 2.5 to 3.5 m/s",
            _steady(2.5, 3.5),
            _weave,
            _flat,
            surface="tarmac",
        ),
        Scenario(
            "slow", "walking pace and less: 0.7 to 0.9 m/s", _steady(0.7, 0.9), _straight, _flat, "mild", "tarmac"
        ),
        Scenario(
            "stop-and-go",
            "from rest to 2.5 to 5 m/s and back to rest every 18 s, a foot on the ground at stops",
            partial(_stops, low=2.5, high=5.0),
            _nudged,
            _flat,
            "mild",
            surface="tarmac",
        ),
        Scenario(
            "commute",
            "an arbitrary path at 2.5 to 6.5 m/s on tarmac, coasting now and then",
            partial(_varied_speed, low=2.5, high=6.5, hold=12.0),
            _wander,
            _flat,
            surface="tarmac",
            coasts=True,
        ),
        Scenario(
            "gusts",
            "nearly straight at 3 to 6 m/s in gusts of cross wind and pushes from the side",
            _steady(3.0, 6.0),
            _nudged,
            _flat,
            "mild",
            surface="tarmac",
            windy=True,
        ),
    )
}
"""The scenarios by name."""


def list_scenarios() -> list[str]:
    """Names that :func:`scenario` takes."""
    return list(SCENARIOS)


def scenario(name: str | Scenario) -> Scenario:
    """A scenario by name, as given, or composed: ``"slalom+bumps"`` rides the first on the ground of both.

    The rougher surface of both is on it.

    Raises:
        ValueError: there is none of that name.
    """
    if isinstance(name, Scenario):
        return name
    parts = str(name).split("+")
    for part in parts:
        if part not in SCENARIOS:
            raise ValueError(f"{unknown('scenario', part, SCENARIOS)}; several are joined by '+', got {name!r}")
    first, *others = (SCENARIOS[part] for part in parts)
    if not others:
        return first

    scenes = (first, *others)
    summary = "; ".join(each.summary for each in scenes)
    # the roughest surface of all
    rough = max((each.surface for each in scenes), key=lambda each: named_surface(each).roughness)
    return replace(first, name=str(name), summary=summary, ground=partial(_all_of, scenes=scenes), surface=rough)
