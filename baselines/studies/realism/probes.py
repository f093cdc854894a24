"""Quick measurements of single properties of the simulators, for the table of points: clock, forces, field, people."""

from __future__ import annotations

import numpy as np

from ....envs.bicycle.course.scenarios import scenario
from ....envs.bicycle.environment import RiderBicycleEnv
from ....envs.bicycle.fixture import BicycleFixtureEnv
from ....envs.bicycle.rider.anthropometry import random_body
from ....envs.data.trajectory import Trajectory
from ....envs.hand.environment import HandMotionEnv
from ....envs.hand.sensing import simulate_hand
from ....envs.recipes.registry import recipe
from ....envs.record import record_once
from ....envs.sensors.timing import PUNCTUAL
from ....filters.core import rotation
from ....filters.core.quantity import STANDARD_GRAVITY

SEED = 3
DRAWS = 400
"""people, devices and courses that are drawn"""


def ridden(name: str, duration: float, **options: object) -> Trajectory:
    """A ride of a lumped rider with ideal sensors."""
    settings = {"suite": ["seat/load_cells"], "sensors": "ideal", "fidelity": "lumped", "duration": duration} | options
    return record_once(RiderBicycleEnv(name, **settings), SEED)  # type: ignore[arg-type]


def force_interval() -> float:
    """RMS difference (N) of load cells at 50 Hz from the mean of those at 500 Hz over the same 20 ms, over bumps."""
    slow, fast = (ridden("bumps", 16.0, rate=rate).measurements["seat/load_cells"] for rate in (50.0, 500.0))
    count = len(slow) - 1
    means = fast[1 : 1 + 10 * count].reshape(count, 10, 3).mean(axis=1)
    return float(np.sqrt(np.nanmean((slow[1:] - means) ** 2)))


def start_apart() -> float:
    """How far apart (mm) two riders of one seed are at time 0, whose sensors have rates of 50 and 100 Hz."""
    places = [ridden("straight", 0.2, rate=rate).truth["bicycle/position"][0] for rate in (50.0, 100.0)]
    return 1e3 * float(np.linalg.norm(places[0] - places[1]))


def field_spread(surroundings: str) -> tuple[float, float]:
    """Standard deviation (µT) of the field's magnitude at a device moved by hand: least and most of six episodes."""
    found = []
    for seed in range(6):
        moved = simulate_hand("mixed", seed, "ideal", 50.0, 30.0, magnetometer=True, magnetics=surroundings)
        found.append(float(np.linalg.norm(moved.measurements["imu/mag"], axis=1).std()))
    return min(found), max(found)


def delays() -> tuple[float, float, float]:
    """Least and largest delay (ms) of late devices of the recipe ``hand-held``, and the share of lossy devices."""
    timing = recipe("hand-held").sensors.timing  # type: ignore[attr-defined]
    drawn = [timing.draw(np.random.default_rng([SEED, index])) for index in range(DRAWS)]
    late = [1e3 * each.delay for each in drawn if each.delay > 0.0]
    return min(late), max(late), float(np.mean([each.burst_rate > PUNCTUAL.burst_rate for each in drawn]))


def arm_apart() -> float:
    """RMS distance (mm) of a device that an arm shakes from where the gesture has it."""
    paths = []
    for drive in ("kinematic", "dynamic"):
        env = HandMotionEnv("severe", drive, "ideal", duration=10.0)
        paths.append(record_once(env, SEED).truth["position"])
    return 1e3 * float(np.sqrt(np.mean(np.sum((paths[0] - paths[1]) ** 2, axis=1))))


def default_drive() -> str:
    """What moves the hand by default."""
    return HandMotionEnv().drive_kind


def gravity_residual() -> float:
    """Largest difference (m/s²) of an ideal accelerometer from what the environment documents, of a shaken device."""
    found = record_once(HandMotionEnv("severe", sensors="ideal", duration=10.0), SEED)
    truth, dt = found.truth, found.dt
    up = rotation.rotate_back(truth["orientation"], np.array([0.0, 0.0, 1.0]))
    turned = rotation.rotate(rotation.exp(0.5 * dt * truth["angular_rate"]), up)
    expected = truth["external_acceleration"] + STANDARD_GRAVITY * turned
    return float(np.abs(found.measurements["imu/acc"] - expected)[1:].max())


def people() -> dict[str, tuple[float, float]]:
    """Mass (kg), stature (m) and share of women (%) of random riders: lowest and highest."""
    drawn = [random_body(np.random.default_rng([SEED, index])) for index in range(DRAWS)]
    masses, statures = ([getattr(each, name) for each in drawn] for name in ("mass", "stature"))
    women = 100.0 * float(np.mean([each.female for each in drawn]))
    return {
        "mass": (min(masses), max(masses)),
        "stature": (min(statures), max(statures)),
        "women": (women, women),
    }


def courses() -> dict[str, tuple[float, float]]:
    """Preferred cadence (1/min), share of coasting (%), largest gust (N) of courses: lowest and highest."""
    cadence, coasting, gust, duration = [], [], [], 60.0
    for index in range(DRAWS // 20):
        drawn = {
            name: scenario(name).draw(np.random.default_rng([SEED, index]), duration).events
            for name in ("straight", "commute", "gusts")
        }
        cadence.append(float(drawn["straight"].cadence or np.nan) * 30.0 / np.pi)
        rests = sum(max(0.0, min(end, duration) - begin) for begin, end in drawn["commute"].coasting)
        coasting.append(100.0 * rests / duration)
        side = drawn["gusts"].side
        gust.append(0.0 if side is None else float(np.abs(side.values).max()))
    found = {"cadence": cadence, "coasting": coasting, "gust": gust}
    return {name: (min(values), max(values)) for name, values in found.items()}


def risen() -> float:
    """How far (mm) the hips of a standing rider rise off the saddle."""
    ride = ridden("straight", 20.0, style="standing")
    return 1e3 * float(ride.truth["pelvis/height"].max())


def misplaced() -> float:
    """How far (mm) the trunk's sensor sits from its place on average, as the recipe ``rider`` draws it."""
    from ....envs.bicycle.sensors.placement import placement_errors
    from ....envs.sensors.ideal import Mounting

    errors = placement_errors(recipe("rider").placement_errors)  # type: ignore[attr-defined]
    place = {"trunk_imu": Mounting()}
    drawn = [errors.draw(place, np.random.default_rng([SEED, index]))["trunk_imu"].lever_arm for index in range(DRAWS)]
    return 1e3 * float(np.mean(np.linalg.norm(drawn, axis=1)))


def fixture_picture() -> float:
    """Standard deviation of the colours of a picture of ``poise/BicycleFixture-v0``: 0 of an empty one."""
    env = BicycleFixtureEnv(duration=2.0, render_mode="rgb_array")
    try:
        env.reset(seed=0)
        return float(np.asarray(env.render()).std())
    finally:
        env.close()
