"""Physical checks of rider and bicycle: linear theory, momentum, strapdown, ripple, steps, resets."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ....envs.bicycle.course.path import Path, smooth_curvature
from ....envs.bicycle.course.scenarios import list_scenarios
from ....envs.bicycle.environment import RiderBicycleEnv
from ....envs.bicycle.frame.bicycle import Bicycle
from ....envs.bicycle.frame.parameters import AIR_DENSITY, BENCHMARK, MOUNTAIN_BIKE
from ....envs.bicycle.frame.tyre import BENCHMARK_TYRE, TyreParameters
from ....envs.bicycle.frame.whipple import whipple_model
from ....envs.bicycle.ride.contact_forces import contact, place_on
from ....envs.bicycle.ride.ride import Ride
from ....envs.bicycle.rider.anthropometry import SUBJECTS
from ....envs.bicycle.rider.posture import loop_closure_error, sit
from ....envs.bicycle.rider.style import STYLES, RiderMotion
from ....envs.bicycle.sensors.sites import BICYCLE_IMU_SITE, BICYCLE_IMU_TILT, pitched
from ....envs.data.trajectory import Trajectory
from ....envs.physics.world import Physics
from ....envs.record import record_once
from ....filters.core import rotation
from ....filters.core.quantity import STANDARD_GRAVITY
from .saddle import ACROSS, ALONG, APART, PULL, saddle_statistics

GRAVITY = 9.81
"""m/s²: that of the published benchmark"""
STARTS: tuple[dict[str, Any], ...] = ({"roll_rate": 2e-3}, {"steer": 1e-3}, {"steer_rate": 5e-3}, {"roll": 1e-3})
"""states from which the four modes are excited"""
SAMPLE, UNSETTLED = 0.01, 0.1
"""s: interval of the states from which modes are found, and what is left out of each ride before"""


class Check(NamedTuple):
    """One check."""

    check: str
    asked: str
    found: str
    holds: bool | None = None
    """whether what is found is within what is asked; None where nothing is asked"""


def measured_eigenvalues(speed: float, duration: float = 1.6, tyre: TyreParameters = BENCHMARK_TYRE) -> np.ndarray:
    """Eigenvalues (4,) of the linear map that best carries each sampled state of four passive rides to the next, 1/s.

    The benchmark bicycle rolls at ``speed`` (m/s) for ``duration`` s each.
    """
    before, after = [], []
    with Physics(gravity=GRAVITY) as physics:
        bicycle = Bicycle(physics, BENCHMARK, tyre=tyre)
        for start in STARTS:
            bicycle.start(speed, **start)
            rows = []
            for _ in range(round(duration / SAMPLE)):
                for _ in range(round(SAMPLE / physics.time_step)):
                    bicycle.act()
                    physics.step()
                s = bicycle.state()
                rows.append((s.roll, -s.steer, s.roll_rate, -s.steer_rate))
            states = np.array(rows)[round(UNSETTLED / SAMPLE) :]
            scale = np.abs(states).max()
            before.append(states[:-1] / scale)
            after.append(states[1:] / scale)
    matrix = np.linalg.lstsq(np.concatenate(before), np.concatenate(after), rcond=None)[0]
    return np.log(np.linalg.eigvals(matrix).astype(complex)) / SAMPLE


def by_kind(values: np.ndarray) -> tuple[complex, np.ndarray]:
    """Weave eigenvalue (positive imaginary part) and the real ones, rising."""
    real = np.sort(values[np.abs(values.imag) < 1e-2].real)
    return complex(values[np.argmax(values.imag)]), real


def eigenvalue_checks(speeds: tuple[float, ...] = (3.0, 5.0, 6.0)) -> Iterator[Check]:
    """The benchmark bicycle against Whipple's theory."""
    model = whipple_model(BENCHMARK, GRAVITY)
    for what, tyre in (("benchmark tyre", BENCHMARK_TYRE), ("default tyre", TyreParameters())):
        for speed in speeds:
            weave, real = by_kind(measured_eigenvalues(speed, tyre=tyre))
            theory, real_theory = by_kind(model.eigenvalues(speed))
            errors = (abs(weave - theory) / abs(theory), abs(real[0] / real_theory[0] - 1.0))
            found = f"{100.0 * errors[0]:.2f} %, {100.0 * errors[1]:.2f} %, {real[-1] - real_theory[-1]:+.4f} 1/s"
            asked = "5 %, 5 %, –" if tyre is BENCHMARK_TYRE else "5 %, –, –"
            holds = all(error <= 0.05 for error in (errors if tyre is BENCHMARK_TYRE else errors[:1]))
            yield Check(f"weave, castering, capsize at {speed:g} m/s, {what}, against theory", asked, found, holds)


def stable_range() -> tuple[float, float]:
    """Speeds (m/s) between which the simulated benchmark bicycle is stable by itself, found by halving to 0.02 m/s."""

    def edge(low: float, high: float, unstable_below: Callable[[float], bool]) -> float:
        while high - low > 0.02:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if unstable_below(middle) else (low, middle)
        return 0.5 * (low + high)

    weave = edge(4.2, 4.4, lambda speed: by_kind(measured_eigenvalues(speed))[0].real > 0.0)
    capsize = edge(5.9, 6.15, lambda speed: bool(by_kind(measured_eigenvalues(speed))[1][-1] < 0.0))
    return weave, capsize


def momentum_checks() -> Iterator[Check]:
    """Seat, hands and feet, from the rider's motion, against what moves the bicycle: its mass, tyres and drag."""
    straight, circle = Path(np.zeros(2)), Path(smooth_curvature(lambda s: np.where(s > 3.0, 0.4, 0.0), 60.0))
    for fidelity in ("full", "lumped"):
        for name, path, speed in (("straight 4 m/s", straight, 4.0), ("circle 1.2 m/s", circle, 1.2)):
            force, moment = momentum_residual(fidelity, path, speed, 2500)
            limit = 1.0 if fidelity == "full" else 0.1
            asked, holds = f"{limit:g} %, {limit:g} %", 100.0 * max(force, moment) <= limit
            found = f"{100.0 * force:.4f} %, {100.0 * moment:.4f} %"
            yield Check(
                f"force and moment balance of the bicycle, {fidelity}, {name} (of weight, × 1 m)", asked, found, holds
            )


def momentum_residual(fidelity: Any, path: Path, speed: float, steps: int) -> tuple[float, float]:
    """Largest residual of force and moment (about the saddle, 1 m), as parts of the weight of rider and bicycle."""
    motion = RiderMotion(STYLES["normal"], np.random.default_rng(1))
    ride = Ride(sit(MOUNTAIN_BIKE, SUBJECTS[3]), motion, path, lambda _: speed, fidelity=fidelity)
    residuals = []
    with ride:
        rider, bicycle = ride.rider, ride.bicycle
        weight = (rider.masses.sum() + bicycle.own_masses.sum()) * ride.physics.gravity
        for step in range(steps):
            if step < steps // 3 or step % 100:
                ride.step()
                continue
            before, state = bicycle.body.frames.copy(), bicycle.body.state.copy()
            saddle = np.array(place_on(before[0], rider.saddle_arm))
            grips, pedals = rider.grips(), rider.pedals()
            velocity = np.array(ride.physics.base_tuples(bicycle.body.body)[2])
            ride.step()
            states, pushes = np.stack([state, bicycle.body.state]), np.reshape(rider.raw_forces(), (1, 4, 3))
            (seat, seat_moment, hands, feet), _ = contact(rider, states, pushes, 1)
            force, moment = bicycle.own_wrench(before, bicycle.body.frames, saddle)
            ground, ground_moment = bicycle.ground_wrench(saddle)
            drag = -0.5 * AIR_DENSITY * MOUNTAIN_BIKE.drag_area * np.linalg.norm(velocity) * velocity
            limbs, arms = np.concatenate([hands[0], feet[0]]), np.concatenate([grips, pedals]) - saddle
            force = force - seat[0] - limbs.sum(axis=0) - ground - drag
            moment = moment - seat_moment[0] - rotation.cross(arms, limbs).sum(axis=0) - ground_moment
            moment = moment - rotation.cross(before[0, :3] - saddle, drag)
            residuals.append((np.abs(force).max() / weight, np.abs(moment).max() / weight))
    # NaN stays NaN, and a ride too short to be looked at is an error
    worst_force, worst_moment = np.max(residuals, axis=0)
    return float(worst_force), float(worst_moment)


def ridden(seed: int, **options: Any) -> Trajectory:
    """One recorded episode with ideal sensors."""
    return record_once(RiderBicycleEnv(**{"sensors": "ideal", **options}), seed)


def strapdown_errors(ride: Trajectory) -> tuple[float, float]:
    """Error of position (m) and attitude (rad) after integrating the bicycle's ideal IMU over a ride."""
    mounting, lever, dt = np.array(pitched(BICYCLE_IMU_TILT)), np.array(BICYCLE_IMU_SITE), ride.dt
    frame, omega = ride.truth["bicycle/orientation"], ride.truth["bicycle/angular_rate"]
    places = ride.truth["bicycle/position"] + rotation.rotate(frame, lever)
    swing = rotation.rotate(frame, rotation.cross(omega, lever))
    q, v, p = rotation.multiply(frame[0], mounting), ride.truth["bicycle/velocity"][0] + swing[0], places[0]
    for rate, force in zip(*(ride.measurements[f"bicycle_imu/{kind}"][1:] for kind in ("gyr", "acc")), strict=True):
        middle = rotation.multiply(q, rotation.exp(0.5 * rate * dt))
        change = rotation.rotate(middle, force) - np.array([0.0, 0.0, STANDARD_GRAVITY])
        p, v = p + v * dt + 0.5 * change * dt**2, v + change * dt
        q = rotation.multiply(q, rotation.exp(rate * dt))
    last = rotation.multiply(frame[-1], mounting)
    angle = rotation.angle(rotation.multiply(rotation.conjugate(last), q))
    return float(np.linalg.norm(p - places[-1])), float(angle)


def sensor_checks(duration: float = 10.0) -> Iterator[Check]:
    """Strapdown, gaps, and what half the physics step changes."""
    channels = ["bicycle_imu/gyr", "bicycle_imu/acc", "trunk_imu/gyr"]
    for name in ("indoor_circle", "outdoor"):
        ride = ridden(2, scenario=name, suite=channels, duration=duration, surface="smooth")
        position, attitude = strapdown_errors(ride)
        what = f"strapdown of the ideal bicycle IMU, {name}, {duration:g} s"
        holds = position <= 0.01 and math.degrees(attitude) <= 0.01
        yield Check(what, "10 mm, 0.01°", f"{1e3 * position:.2f} mm, {math.degrees(attitude):.5f}°", holds)
        gap = loop_closure_error(ride.truth, sit(MOUNTAIN_BIKE, SUBJECTS[0])).max()
        yield Check(
            f"largest gap of hands and feet, {name}, {duration:g} s", "1 mm", f"{1e3 * gap:.3f} mm", bool(gap <= 1e-3)
        )
    rides = [
        ridden(3, suite=channels, duration=duration, physics_rate=rate, surface="smooth") for rate in (500.0, 1000.0)
    ]
    for channel, limit, unit in zip(channels, (0.02, 0.1, 0.02), ("rad/s", "m/s²", "rad/s"), strict=True):
        first, second = (ride.measurements[channel][1:] for ride in rides)
        found = float(np.sqrt(np.mean((first - second) ** 2)))
        what = f"RMS change of {channel} at half the physics step"
        yield Check(what, f"{limit:g} {unit}", f"{found:.4f} {unit}", found <= limit)


def lean_checks() -> Iterator[Check]:
    """Mean lean of the trunk in the indoor circle, and the load cells of rider 0, style by style."""
    from .statistics import trunk_lean

    for style in ("mild", "normal", "aggressive"):
        ride = ridden(0, scenario="indoor_circle", style=style, suite=["seat/load_cells"], duration=20.0)
        turning = slice(len(ride) // 3, None)
        against, to_bicycle = (
            np.degrees(trunk_lean(ride.truth)[turning]),
            np.degrees(ride.truth["trunk/angles"][turning, 1]),
        )
        yield Check(
            f"mean lean of the trunk in the circle, {style}: to the vertical, to the bicycle",
            "15 … 25°, –" if style == "normal" else "–",
            f"{abs(against.mean()):.1f}°, {abs(to_bicycle.mean()):.1f}°",
            bool(15.0 <= abs(against.mean()) <= 25.0) if style == "normal" else None,
        )
        cells = ride.measurements["seat/load_cells"][turning]
        means, low = np.nanmean(cells, axis=0), np.nanpercentile(cells, 5.0, axis=0)
        found = ", ".join(f"{mean:.0f} ({least:.0f})" for mean, least in zip(means, low, strict=True))
        yield Check(f"load cells there, {style}: mean (5th percentile), N", "pressed", found, bool(min(low) > 0.0))


def saddle_checks() -> Iterator[Check]:
    """Cells and centre of pressure of a full and a lumped rider in every scenario."""
    for name in list_scenarios():
        pair = []
        for fidelity in ("full", "lumped"):
            options = {"suite": ["seat/load_cells"], "duration": 40.0, "fidelity": fidelity}
            pair.append(saddle_statistics(ridden(3, scenario=name, **options).measurements["seat/load_cells"]))
        full, lumped = pair
        # on bumps and rough roads a rider may leave the saddle, on which friction then still acts
        most = 1.0
        ends = [abs(each[f"{axis}_{end}"]) for each in pair for axis in ("along", "across") for end in (5, 95)]
        widest = [max(ends[0::4] + ends[1::4]), max(ends[2::4] + ends[3::4])]
        apart = abs(full["along_mean"] - lumped["along_mean"])
        text = "; ".join(
            f"{each['pulls']:.2g} %, {each['least']:.0f} N, {each['along_5']:.0f} … {each['along_95']:.0f} mm, "
            f"{each['across_5']:.0f} … {each['across_95']:.0f} mm"
            for each in pair
        )
        holds = max(each["pulls"] for each in pair) <= most
        holds = holds and widest[0] <= ALONG and widest[1] <= ACROSS and apart <= APART
        yield Check(
            f"saddle, {name}, full; lumped: cells below -{PULL:g} N, least cell, CoP along, across",
            f"{most:g} %, –, ±{ALONG:g} mm, ±{ACROSS:g} mm; means {APART:g} mm apart",
            f"{text}; {apart:.0f} mm apart",
            holds,
        )


def reset_checks() -> Iterator[Check]:
    """CPU time of the three kinds of reset, each done three times."""
    for fidelity in ("full", "lumped"):
        env = RiderBicycleEnv(fidelity=fidelity, duration=1.0)
        try:
            env.reset(seed=0)
            times = {
                "another person": [_cpu(env, seed, subject=1 + seed % 4) for seed in range(1, 4)],
                "another motion": [_cpu(env, seed, subject=1) for seed in range(20, 24)][1:],
                "the same motion": [_cpu(env, 23, subject=1) for _ in range(3)],
            }
        finally:
            env.close()
        for what, found in times.items():
            yield Check(f"reset to {what}, {fidelity}, CPU time", "–", f"{np.median(found):.2f} s")


def _cpu(env: RiderBicycleEnv, seed: int, **options: Any) -> float:
    begin = time.process_time()
    env.reset(seed=seed, options=options)
    return time.process_time() - begin


def all_checks() -> Iterator[Check]:
    """Everything above, a few minutes."""
    yield from eigenvalue_checks()
    low, high = stable_range()
    yield Check(
        "speeds at which the bicycle is stable by itself (theory 4.292 to 6.024 m/s)",
        "2 %",
        f"{low:.2f} to {high:.2f} m/s",
        abs(low / 4.292 - 1.0) <= 0.02 and abs(high / 6.024 - 1.0) <= 0.02,
    )
    yield from momentum_checks()
    yield from sensor_checks()
    yield from lean_checks()
    yield from saddle_checks()
    yield from reset_checks()
