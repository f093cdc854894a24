"""Speed of the environments relative to the bare physics step."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from .measure import REPEATS, Speed, measure

if TYPE_CHECKING:
    from ...envs.bicycle.ride.ride import Ride

STEPS = 500
PHYSICS_PER_STEP = 10
"""1 kHz of physics under 100 Hz of observations."""
CLOCK = time.thread_time
"""CPU time of the thread that works: the threads of a BLAS library, which wait busily after each use, do not count"""
RIDER = "poise/RiderBicycle-v0"
RIDER_RATE, RIDER_PHYSICS = 100.0, 500.0
"""Hz of observations and of physics"""
RIDE_LENGTH, RIDES = 60.0, 1000
"""s and number of the rides of a data set, for the time that recording it takes"""


def environment_speeds() -> Iterator[Speed]:
    """Steps per CPU second of hand motion, replay and gain tuning; simulation without steps; riders on bicycles."""
    from ...envs.hand.sensing import simulate_hand

    group = "environments at 100 Hz"
    bare = measure(bare_steps(STEPS * PHYSICS_PER_STEP), STEPS * PHYSICS_PER_STEP, clock=CLOCK)
    yield Speed(group, "bare stepSimulation of one free body, 10 a step", bare / PHYSICS_PER_STEP, "steps/s", 1.0)
    for what, identity, options in (
        ("HandMotion, kinematic", "poise/HandMotion-v0", {"gesture": "fast"}),
        ("HandMotion, dynamic", "poise/HandMotion-v0", {"gesture": "fast", "drive": "dynamic"}),
        ("Replay", "poise/Replay-v0", {}),
        ("HandMotionGain, 100 ms a step", "poise/HandMotionGain-v0", {}),
    ):
        rate = environment_rate(identity, options)
        yield Speed(group, what, rate, "steps/s", rate / (bare / PHYSICS_PER_STEP))
    rate = measure(lambda: simulate_hand("mixed", seed=0, duration=60.0), 6001, clock=CLOCK)
    yield Speed(group, "simulate_hand, whole episode at once", rate, "steps/s", rate / (bare / PHYSICS_PER_STEP))
    yield from rider_speeds("full")
    yield from rider_speeds("lumped")
    yield from gain_speeds()


def rider_speeds(fidelity: Literal["full", "lumped"]) -> Iterator[Speed]:
    """Bare physics of rider and bicycle, the environment with all sensors, how much faster than life, and resets."""
    group = f"rider on a bicycle, {fidelity}, at {RIDER_RATE:.0f} Hz"
    per_step = round(RIDER_PHYSICS / RIDER_RATE)
    with standing_ride(fidelity) as ride:
        start = ride.save()

        def fall() -> None:
            ride.restore(start)
            for _ in range(STEPS):
                ride.physics.step()

        bare = measure(fall, STEPS, clock=CLOCK) / per_step
    yield Speed(group, f"bare stepSimulation of the same bodies, {per_step} a step", bare, "steps/s", 1.0)
    options = {"fidelity": fidelity, "suite": "all", "rate": RIDER_RATE, "physics_rate": RIDER_PHYSICS}
    # rides that end with the last step that is counted: an environment simulates seconds ahead of its steps
    rate = environment_rate(RIDER, options | {"duration": STEPS / RIDER_RATE})
    yield Speed(group, "RiderBicycle", rate, "steps/s", rate / bare)
    yield Speed(group, "RiderBicycle, real-time factor", rate / RIDER_RATE, "s of riding/s")
    yield Speed(group, "RiderBicycle, reset to another motion", reset_rate(RIDER, options), "resets/s")
    another = options | {"subject": "random"}
    yield Speed(group, "RiderBicycle, reset to another person", reset_rate(RIDER, another), "resets/s")
    rate = recording_rate(options)
    yield Speed(group, f"recording rides of {RIDE_LENGTH:.0f} s to files", rate, "s of riding/s")
    hours = RIDES * RIDE_LENGTH / rate / 3600.0
    yield Speed(group, f"recording {RIDES} of them in two processes", 2.0 / hours, "data sets/h")


def gain_speeds() -> Iterator[Speed]:
    """Resets of gain tuning on rides: to rides that were simulated before, and to new ones."""
    group = "gain tuning on rides of 20 s, lumped"
    identity = "poise/RiderBicycleGain-v0"
    kept = reset_rate(identity, {"rides": 1})
    yield Speed(group, "RiderBicycleGain, reset to a ride in memory", kept, "resets/s")
    yield Speed(group, "RiderBicycleGain, reset to a ride on disk", stored_rate(identity), "resets/s")
    new = reset_rate(identity, {"rides": None})
    yield Speed(group, "RiderBicycleGain, reset to a new ride", new, "resets/s")
    rate = environment_rate(identity, {"rides": 1})
    yield Speed(group, "RiderBicycleGain, 100 ms a step", rate, "steps/s")


def stored_rate(identity: str) -> float:
    """Median rate of the first resets of environments whose ride another one has written to the cache folder."""
    from ...envs.registration import make_environment

    rates = []
    for _ in range(REPEATS + 1):
        env = make_environment(identity, rides=1)
        start = CLOCK()
        env.reset(seed=0)
        rates.append(1.0 / (CLOCK() - start))
        env.close()
    return sorted(rates[1:])[REPEATS // 2]


def recording_rate(options: dict[str, Any]) -> float:
    """Seconds of riding per CPU second of simulating a ride and writing it to a file, all in all."""
    import tempfile
    from pathlib import Path

    from ...envs.record import record_episode

    with tempfile.TemporaryDirectory() as folder:
        start = CLOCK()
        record_episode(RIDER, options | {"duration": RIDE_LENGTH}, 0, Path(folder) / "ride.h5")
        return RIDE_LENGTH / (CLOCK() - start)


def standing_ride(fidelity: Literal["full", "lumped"]) -> Ride:
    """A rider on a mountain bike about to ride straight on, without the environment around them."""
    from ...envs.bicycle.course.path import Path
    from ...envs.bicycle.frame.bicycles import BICYCLES
    from ...envs.bicycle.ride.ride import Ride
    from ...envs.bicycle.rider.anthropometry import rider_body
    from ...envs.bicycle.rider.posture import sit
    from ...envs.bicycle.rider.style import RiderMotion, rider_style

    posture = sit(BICYCLES["mountain-bike"], rider_body(0))
    motion = RiderMotion(rider_style("normal"), np.random.default_rng(0))
    return Ride(posture, motion, Path(np.zeros(2)), lambda _: 3.0, fidelity=fidelity, physics_rate=RIDER_PHYSICS)


def reset_rate(identity: str, options: dict[str, Any]) -> float:
    """Median resets per CPU second, each to a new motion."""
    import gymnasium

    with closing(gymnasium.make(identity, disable_env_checker=True, **options)) as env:
        env.reset(seed=0)
        return measure(env.reset, 1, clock=CLOCK)


def bare_steps(count: int) -> Callable[[], None]:
    """A function that steps a physics client with one free body ``count`` times and does nothing else."""
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=1e-3, numSolverIterations=30, physicsClientId=client)
    pybullet.createMultiBody(0.25, -1, -1, [0.0, 0.0, 1.0], physicsClientId=client)
    step = partial(pybullet.stepSimulation, physicsClientId=client)

    def run() -> None:
        for _ in range(count):
            step()

    return run


def environment_rate(identity: str, options: dict[str, Any]) -> float:
    """Median steps per CPU second; episodes are reset where they end, outside the clock."""
    import gymnasium

    env = gymnasium.make(identity, disable_env_checker=True, **options).unwrapped
    action = env.neutral_action  # type: ignore[attr-defined]
    rates = []
    try:
        for repeat in range(REPEATS + 1):
            env.reset(seed=repeat)
            spent, steps, over = 0.0, 0, False
            while steps < STEPS:
                if over:
                    env.reset()
                start = CLOCK()
                over = False
                while steps < STEPS and not over:
                    _, _, terminated, truncated, _ = env.step(action)
                    steps, over = steps + 1, terminated or truncated
                spent += CLOCK() - start
            rates.append(steps / spent)
    finally:
        env.close()
    return sorted(rates[1:])[REPEATS // 2]
