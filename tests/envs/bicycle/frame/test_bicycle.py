"""The bicycle alone, against the linear theory of Whipple and Carvallo and against conservation laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from poise.baselines.studies.rides.checks import GRAVITY, by_kind, measured_eigenvalues
from poise.envs.bicycle.course.surfaces import surface
from poise.envs.bicycle.course.terrain import Bump, FlatGround, Ground, GroundSum, Ramp
from poise.envs.bicycle.frame.bicycle import Bicycle
from poise.envs.bicycle.frame.parameters import (
    BENCHMARK,
    MOUNTAIN_BIKE,
    DriveParameters,
    RigidPart,
    WheelParameters,
    combine,
)
from poise.envs.bicycle.frame.tyre import BENCHMARK_TYRE, Tyre, TyreParameters
from poise.envs.bicycle.frame.whipple import whipple_model
from poise.envs.physics.world import Physics


def test_whipple_matrices_are_those_of_the_benchmark():
    """Table 2 of Meijaard et al. (2007)."""
    model = whipple_model(BENCHMARK, GRAVITY)
    np.testing.assert_allclose(
        model.M, [[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]], rtol=1e-13
    )
    np.testing.assert_allclose(
        model.K0, [[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]], rtol=1e-13
    )
    np.testing.assert_allclose(model.K2, [[0.0, 76.59734589573222], [0.0, 2.65431523794604]], rtol=1e-13)
    np.testing.assert_allclose(model.C1, [[0.0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]], rtol=1e-13)
    # weave dies out above the lower speed, capsize grows above the higher one
    stable = [brentq(lambda speed: model.eigenvalues(speed)[0].real, *limits) for limits in ((4.0, 5.0), (5.5, 6.5))]
    np.testing.assert_allclose(stable, (4.29238253634111, 6.02426201538837), atol=2e-6)


def test_whipple_model_agrees_with_another_program():
    bicycle = pytest.importorskip("bicycleparameters.bicycle")
    bike = MOUNTAIN_BIKE.with_load(RigidPart(70.0, (0.32, 0.0, 1.1), (9.0, 9.5, 2.0, 0.3)))
    frame, front = bike.rear_frame, bike.front_assembly
    values = {
        "w": bike.wheelbase, "c": bike.trail, "lam": bike.steer_axis_tilt, "g": GRAVITY, "v": 1.0,
        "mB": frame.mass, "xB": frame.centre[0], "zB": -frame.centre[2],
        "IBxx": frame.inertia[0], "IByy": frame.inertia[1], "IBzz": frame.inertia[2], "IBxz": -frame.inertia[3],
        "mH": front.mass, "xH": front.centre[0], "zH": -front.centre[2],
        "IHxx": front.inertia[0], "IHyy": front.inertia[1], "IHzz": front.inertia[2], "IHxz": -front.inertia[3],
        "mR": bike.rear_wheel.mass, "rR": bike.rear_wheel.radius,
        "IRxx": bike.rear_wheel.inertia_diameter, "IRyy": bike.rear_wheel.inertia_axle,
        "mF": bike.front_wheel.mass, "rF": bike.front_wheel.radius,
        "IFxx": bike.front_wheel.inertia_diameter, "IFyy": bike.front_wheel.inertia_axle,
    }  # fmt: skip
    M, C1, K0, K2 = bicycle.benchmark_par_to_canonical(values)
    model = whipple_model(bike, GRAVITY)
    for ours, theirs in ((model.M, M), (model.C1, C1), (model.K0, K0), (model.K2, K2)):
        np.testing.assert_allclose(ours, np.asarray(theirs, dtype=float), rtol=1e-10, atol=1e-10)


CAPSIZE_ALLOWANCE = 0.02
"""1/s: capsize is -0.004 1/s at 6 m/s, near its change of sign, where a relative error means nothing"""


@pytest.mark.parametrize("speed", [3.0, 5.0, 6.0])
def test_eigenvalues_of_the_simulated_bicycle(speed):
    """All four within 5 % of theory with the thin, rigid tyre that the theory has."""
    weave, real = by_kind(measured_eigenvalues(speed))
    weave_theory, real_theory = by_kind(whipple_model(BENCHMARK, GRAVITY).eigenvalues(speed))
    assert len(real) == 2
    assert abs(weave - weave_theory) < 0.05 * abs(weave_theory)
    castering, capsize = real
    assert castering == pytest.approx(real_theory[0], rel=0.05)
    assert capsize == pytest.approx(real_theory[1], rel=0.05, abs=CAPSIZE_ALLOWANCE)


@pytest.mark.parametrize("speed", [3.0, 5.0, 6.0])
def test_eigenvalues_on_bicycle_tyres(speed):
    """Weave and capsize hardly feel a real tyre; castering, which dies within 0.1 s, does by 6 to 9 %."""
    weave, real = by_kind(measured_eigenvalues(speed, tyre=TyreParameters()))
    weave_theory, real_theory = by_kind(whipple_model(BENCHMARK, GRAVITY).eigenvalues(speed))
    assert abs(weave - weave_theory) < 0.05 * abs(weave_theory)
    assert real[-1] == pytest.approx(real_theory[-1], rel=0.05, abs=CAPSIZE_ALLOWANCE)
    assert real[0] == pytest.approx(real_theory[0], rel=0.1)


def test_self_stable_range_of_the_simulated_bicycle():
    """At 2 % inside and outside each limit of theory the bicycle is stable and unstable."""
    low, high = 4.292, 6.024
    assert by_kind(measured_eigenvalues(0.98 * low))[0].real > 0.0
    assert by_kind(measured_eigenvalues(1.02 * low))[0].real < 0.0
    assert by_kind(measured_eigenvalues(0.98 * high))[1][-1] < 0.0
    assert by_kind(measured_eigenvalues(1.02 * high))[1][-1] > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("speed", np.arange(1.0, 8.0, 0.5).tolist())
def test_weave_over_the_whole_range_of_speeds(speed):
    # fast growth leaves the linear range: a short window
    weave, _ = by_kind(measured_eigenvalues(speed, duration=0.8 if speed < 3.0 else 1.6))
    theory, _ = by_kind(whipple_model(BENCHMARK, GRAVITY).eigenvalues(speed))
    assert abs(weave - theory) < 0.05 * abs(theory)


def test_steady_turn():
    """A small constant steer torque at a self-stable speed leads to the roll and steer of linear theory."""
    speed, torque = 5.0, 0.02
    model = whipple_model(BENCHMARK, GRAVITY)
    roll, steer = np.linalg.solve(model.stiffness(speed), [0.0, torque])
    with Physics(gravity=GRAVITY) as physics:
        bicycle = Bicycle(physics, BENCHMARK, tyre=BENCHMARK_TYRE)
        bicycle.start(speed, roll=roll, steer=-steer)
        for _ in range(15000):
            bicycle.act(steer_torque=-torque)
            physics.step()
        state = bicycle.state()
    assert state.roll == pytest.approx(roll, rel=0.05)
    assert -state.steer == pytest.approx(steer, rel=0.05)
    yaw_rate = speed * math.tan(steer * math.cos(BENCHMARK.steer_axis_tilt)) / BENCHMARK.wheelbase
    assert -state.yaw_rate == pytest.approx(yaw_rate, rel=0.05)


def test_start_does_not_ring():
    """Coasting straight, no part of the specific force of the frame deviates from gravity."""
    with Physics() as physics:
        bicycle = Bicycle(physics, MOUNTAIN_BIKE)
        bicycle.start(4.0, heading=0.7, position=(20.0, -30.0))
        last, largest = np.array(physics.base_tuples(bicycle.body.body)[2]), 0.0
        for _ in range(500):
            bicycle.act()
            physics.step()
            now = np.array(physics.base_tuples(bicycle.body.body)[2])
            largest = max(largest, abs(now[2] - last[2]) / physics.time_step)
            last = now
        assert largest < 0.02  # m/s²
        drag = 0.5 * 1.2 * 0.5 * 16.0 + 0.006 * 25.0 * physics.gravity
        spinning = sum(w.inertia_axle / w.radius**2 for w in (MOUNTAIN_BIKE.rear_wheel, MOUNTAIN_BIKE.front_wheel))
        assert bicycle.state().speed == pytest.approx(4.0 - 0.5 * drag / (25.0 + spinning), abs=0.003)


def test_momentum_changes_by_the_ground_and_gravity_alone():
    with Physics() as physics:
        bicycle = Bicycle(physics, BENCHMARK)
        bicycle.start(4.0, roll_rate=0.3, steer=0.05)
        weight = bicycle.body.mass * physics.gravity
        for _ in range(400):
            before = bicycle.body.frames.copy()
            bicycle.act(steer_torque=0.3)
            physics.step()
            point = before[0, :3]
            force, moment = bicycle.own_wrench(before, bicycle.body.frames, point)
            ground_force, ground_moment = bicycle.ground_wrench(point)
            assert np.abs(force - ground_force).max() < 1e-4 * weight
            assert np.abs(moment - ground_moment).max() < 1e-3 * weight


def test_save_and_restore_are_bitwise():
    def ride(steps):
        for step in range(steps):
            bicycle.act(steer_torque=0.4 * math.sin(0.01 * step), wheel_torque=2.0)
            physics.step()
        return np.array(bicycle.state()), [tyre.bristles for tyre in bicycle.tyres], bicycle.drivetrain.save()

    with Physics() as physics:
        bicycle = Bicycle(physics, MOUNTAIN_BIKE, GroundSum([FlatGround(0.1), Bump((1.5, 0.0), 0.0)]))
        bicycle.start(3.0, roll_rate=0.1)
        ride(137)
        saved, memory = physics.save(), bicycle.save()
        first = ride(300)
        physics.restore(saved)
        bicycle.restore(memory)
        second = ride(300)
        assert np.array_equal(first[0], second[0])
        assert first[1:] == second[1:]


def test_chain_pulls_and_the_freewheel_slips():
    with Physics() as physics:
        bicycle = Bicycle(physics, MOUNTAIN_BIKE)
        bicycle.start(2.0)
        for _ in range(300):
            bicycle.act()
            physics.step()
        coasting = bicycle.state()
        # crank and wheel started together; the crank's own friction is nil, so it keeps its rate while the wheel slows
        assert coasting.crank_rate * bicycle.ratio == pytest.approx(coasting.wheel_rate, abs=0.3)
        crank = bicycle.links["crank"]
        bicycle.body.set_joint(crank, 0.0, 0.0)
        bicycle.drivetrain.engage(0.0, bicycle.body.joint_tuples([bicycle.links["rear_wheel"]])[0][0])
        before = bicycle.state().speed
        for _ in range(200):
            bicycle.act()
            physics.step()
        stopped = bicycle.state()
        assert abs(stopped.crank_rate) < 1e-4
        assert stopped.speed == pytest.approx(before, abs=0.1)


@pytest.mark.parametrize(
    "ground",
    [
        Bump((0.3, 0.0), 0.4),
        Ramp((-3.0, 0.0), -0.3),
        surface("cobbles").draw(np.random.default_rng(1)),
        GroundSum([Bump((0.3, 0.0), 0.4), FlatGround(0.2)]),
    ],
    ids=["bump", "ramp", "rough", "sum"],
)
def test_slopes_of_the_ground_are_its_derivatives(ground):
    rng, step = np.random.default_rng(0), 1e-5
    for x, y in rng.uniform(-6.0, 6.0, (200, 2)):
        _, slope_x, slope_y = ground.height_and_slope(x, y)
        for slope, dx, dy in ((slope_x, step, 0.0), (slope_y, 0.0, step)):
            rise = ground.height_and_slope(x + dx, y + dy)[0] - ground.height_and_slope(x - dx, y - dy)[0]
            assert rise / (2.0 * step) == pytest.approx(slope, abs=1e-4)


def test_a_ground_without_a_table_is_refused():
    with pytest.raises(NotImplementedError, match="Ground must define its table"):
        Ground().height_and_slope(0.0, 0.0)


def test_ramp_reaches_its_angle():
    ramp = Ramp((0.0, 0.0), 0.0, math.radians(20.0))
    slopes = [ramp.height_and_slope(x, 0.0)[1] for x in np.linspace(-1.0, 20.0, 2000)]
    assert math.degrees(math.atan(max(slopes))) == pytest.approx(20.0, abs=0.01)
    assert math.degrees(math.atan(min(slopes))) == pytest.approx(-20.0, abs=0.01)
    assert ramp.height_and_slope(30.0, 0.0)[0] == pytest.approx(0.0, abs=1e-12)


def test_tyre_alone():
    """Static load, grip in the wheel's plane when leaning, saturation, and flight."""
    tyre = Tyre(0.34, 0.02, TyreParameters())
    lean = 0.3
    axle = (0.0, math.cos(lean), math.sin(lean))  # leaning to the right
    height = 0.32 * math.cos(lean) + 0.02 - 0.005
    for _ in range(200):
        rolling = tyre.force(FlatGround(), 1e-3, (0.0, 0.0, height), axle, (3.0, 0.0, 0.0), (0.0, 3.0 / 0.34, 0.0))
    assert rolling.load == pytest.approx(1.2e5 * 0.005, rel=1e-6)
    # camber alone carries the load down the wheel's plane: the ground pushes to the right, as the wheel leans
    assert rolling.force[1] == pytest.approx(-rolling.load * math.tan(lean), rel=0.02)
    sliding = [
        tyre.force(FlatGround(), 1e-3, (0.0, 0.0, 0.335), (0.0, 1.0, 0.0), (3.0, 2.0, 0.0), (0.0, 0.0, 0.0))
        for _ in range(300)
    ][-1]
    assert math.hypot(*sliding.force[:2]) == pytest.approx(0.9 * sliding.load, rel=1e-6)
    assert sliding.force[0] < 0.0
    assert (
        tyre.force(FlatGround(), 1e-3, (0.0, 0.0, 0.4), (0.0, 1.0, 0.0), (3.0, 0.0, 0.0), (0.0, 0.0, 0.0)).load == 0.0
    )
    assert tyre.bristles == (0.0, 0.0)


def test_cornering_stiffness_is_shear_stiffness_times_relaxation_length():
    parameters = TyreParameters()
    tyre = Tyre(0.34, 0.0, parameters)
    speed, slip = 4.0, 0.005
    for _ in range(500):
        result = tyre.force(
            FlatGround(),
            1e-3,
            (0.0, 0.0, 0.335),
            (0.0, 1.0, 0.0),
            (speed, slip * speed, 0.0),
            (0.0, speed / 0.335, 0.0),
        )
    stiffness = parameters.shear_stiffness * parameters.relaxation_length + parameters.shear_damping * speed
    assert -result.force[1] / slip == pytest.approx(stiffness, rel=1e-3)


def test_rolling_over_a_bump_is_a_smooth_ride():
    with Physics() as physics:
        bicycle = Bicycle(physics, BENCHMARK, Bump((2.0, 0.0), 0.0, height=0.03, length=0.6))
        bicycle.start(4.5)
        heights, loads = [], []
        for _ in range(1500):
            bicycle.act()
            physics.step()
            heights.append(bicycle.state().z)
            loads.append(bicycle.tyre_forces[0].load)
        assert 0.02 < max(heights) < 0.045
        assert max(loads) < 8.0 * 612.0
        assert abs(bicycle.state().roll) < 1e-6


def test_parts_combine_like_rigid_bodies():
    a, b = RigidPart(2.0, (0.0, 0.0, 0.0), (0.1, 0.1, 0.1, 0.0)), RigidPart(1.0, (0.3, 0.0, 0.6), (0.2, 0.3, 0.2, 0.05))
    both = combine([a, b])
    assert both.mass == 3.0
    np.testing.assert_allclose(both.centre, (0.1, 0.0, 0.2))
    reduced = 2.0 / 3.0
    assert both.inertia[0] == pytest.approx(0.3 + reduced * 0.36)
    assert both.inertia[3] == pytest.approx(0.05 - reduced * 0.18)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: RigidPart(-1.0, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 0.0)), "mass"),
        (lambda: RigidPart(1.0, (0.0, 0.0, 0.0), (1.0, 5.0, 1.0, 0.0)), "triangle"),
        (lambda: DriveParameters((0.4, 0.0, 0.3), 0.17, 0.12, 1.6, (0.01, 0.01, 0.01), gears=(2.0, 1.0)), "gears"),
        (lambda: WheelParameters(0.0, 1.0, 0.1, 0.1), "radius"),
        (lambda: WheelParameters(0.3, 1.0, 0.1, 0.1, 0.2), "crown_radius"),
        (lambda: TyreParameters(stiffness=0.0), "stiffness"),
        (lambda: Bump((0.0, 0.0), 0.0, height=0.5, length=0.4), "bump"),
        (lambda: Ramp((0.0, 0.0), 0.0, angle=1.2), "ramp"),
        (lambda: whipple_model(BENCHMARK, 0.0), "gravity"),
    ],
)
def test_impossible_parameters_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
