"""Riders: bodies, limbs, closed loops, contact forces against an independent balance, and whole rides."""

from __future__ import annotations

import math

import numpy as np
import pytest

from poise.envs.bicycle.course.events import Events
from poise.envs.bicycle.course.path import Path, smooth_curvature
from poise.envs.bicycle.frame.parameters import AIR_DENSITY, BENCHMARK, MOUNTAIN_BIKE
from poise.envs.bicycle.ride.contact_forces import Contact, LoadCells, contact, place_on
from poise.envs.bicycle.ride.ride import Ride
from poise.envs.bicycle.rider.anthropometry import MEN, SUBJECTS, WOMEN, RiderBody, random_body, rider_body
from poise.envs.bicycle.rider.limbs import Limb, forward, reach_to, three_angles, three_turns, tip_torques
from poise.envs.bicycle.rider.muscles import LIGAMENT, ligament
from poise.envs.bicycle.rider.posture import ARM_REACH, LEG_REACH, sit
from poise.envs.bicycle.rider.style import STYLES, RiderMotion, RiderStyle, rider_style
from poise.filters.core import rotation

TWICE = ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")
STRAIGHT = Path(np.zeros(2))
CIRCLE = Path(smooth_curvature(lambda s: np.where(s > 3.0, 0.4, 0.0), 60.0))


def make_ride(path=STRAIGHT, speed=3.0, style="normal", subject=3, seed=1, **options):
    motion = RiderMotion(STYLES[style], np.random.default_rng(seed))
    return Ride(sit(MOUNTAIN_BIKE, SUBJECTS[subject]), motion, path, lambda time: speed, **options)


def test_segments_add_up_to_the_body():
    for table in (MEN, WOMEN):
        assert sum(row.mass * (2 if name in TWICE else 1) for name, row in table.items()) == pytest.approx(
            1.0, abs=2e-4
        )
    for body in SUBJECTS:
        posture = sit(MOUNTAIN_BIKE, body)
        assert posture.load().mass == pytest.approx(body.mass, rel=2e-4)


def test_subjects_are_those_of_the_papers():
    statures, masses = (np.array([getattr(body, name) for body in SUBJECTS]) for name in ("stature", "mass"))
    assert statures.mean() == pytest.approx(1.76, abs=0.005)
    assert statures.std(ddof=1) == pytest.approx(0.05, abs=0.01)
    assert masses.mean() == pytest.approx(68.0, abs=0.5)
    assert masses.std(ddof=1) == pytest.approx(10.0, abs=1.0)
    assert sum(body.female for body in SUBJECTS) == 1


def test_random_riders_repeat_by_seed_and_fit_on_the_bicycle():
    rng = np.random.default_rng(2)
    bodies = [random_body(rng) for _ in range(60)]
    assert bodies[0] == random_body(np.random.default_rng(2))
    for body in bodies:
        posture = sit(MOUNTAIN_BIKE, body)
        assert 0.1 < posture.flexion < 1.2


@pytest.mark.parametrize("bend", [1.0, -1.0])
def test_inverse_kinematics_reach_their_target(bend):
    limb = Limb(0.43, (0.1, -0.42) if bend > 0.0 else (0.0, -0.3), bend)
    rng = np.random.default_rng(0)
    target = rng.uniform([-0.2, -0.2, -0.7], [0.4, 0.2, -0.4], (100, 3)) * (1.0, 1.0, 0.85)
    swivel = rng.uniform(-0.3, 0.3, 100)
    posture = reach_to(limb, target, np.array([1.0, 0.1, 0.0]), swivel)
    again, tip = forward(limb, posture.angles)
    np.testing.assert_allclose(tip, target, atol=1e-12)
    np.testing.assert_allclose(again.hinge, posture.hinge, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(posture.hinge, axis=1), limb.upper, atol=1e-12)


def test_three_angles_undo_three_turns():
    angles = np.random.default_rng(0).uniform(-1.4, 1.4, (50, 3))
    np.testing.assert_allclose(three_angles(three_turns(*angles.T)), angles, atol=1e-12)


def test_tip_torques_do_the_work_of_the_tip_force():
    limb, angles, force = Limb(0.43, (0.14, -0.46), 1.0), np.array([-0.5, 0.1, 0.05, 0.9]), np.array([10.0, -3.0, 5.0])
    step = 1e-6 * np.eye(4)
    jacobian = (forward(limb, angles + step)[1] - forward(limb, angles - step)[1]) / 2e-6
    hinges = (forward(limb, angles + step)[0].hinge - forward(limb, angles - step)[0].hinge) / 2e-6
    lift = np.array([1.0, 2.0, 8.0])
    found = tip_torques(np.array([limb.upper, *limb.tip]), tuple(angles), tuple(force), tuple(lift))
    np.testing.assert_allclose(found, jacobian @ force + hinges @ lift, atol=1e-7)


def test_posture_has_the_reach_it_was_fitted_for():
    posture = sit(MOUNTAIN_BIKE, SUBJECTS[3])
    legs = np.linalg.norm(posture.leg_target("left", np.linspace(0.0, 2.0 * math.pi, 721)), axis=1)
    assert legs.max() / posture.leg.reach == pytest.approx(LEG_REACH, abs=1e-5)
    arm = np.linalg.norm(posture.arm_target("right", 0.0, posture.trunk_orientation()))
    assert arm / posture.arm.reach == pytest.approx(ARM_REACH, abs=1e-9)
    # the papers' saddle is 0.26 m ahead of the rear contact, their trunk leans by 33 degrees
    assert posture.bicycle.saddle[0] == pytest.approx(0.26, abs=0.01)
    assert math.degrees(posture.flexion) == pytest.approx(33.0, abs=2.0)


@pytest.mark.parametrize("fidelity", ["full", "lumped"])
@pytest.mark.parametrize(("path", "speed"), [(STRAIGHT, 4.0), (CIRCLE, 1.2)], ids=["straight", "circle"])
def test_contact_forces_balance_the_bicycle(fidelity, path, speed):
    """Seat, hands and feet from the rider's motion move the bicycle as its own mass, tyres and drag say."""
    with make_ride(path, speed, fidelity=fidelity) as ride:
        rider, bicycle = ride.rider, ride.bicycle
        weight = (rider.masses.sum() + bicycle.own_masses.sum()) * ride.physics.gravity
        worst_force = worst_moment = worst_gap = worst_cells = 0.0
        for step in range(2500):
            look = step > 800 and step % 100 == 0
            if look:
                before, states = bicycle.body.frames.copy(), [bicycle.body.state.copy()]
                saddle = np.array(place_on(before[0], rider.saddle_arm))
                grips, pedals = rider.grips(), rider.pedals()
                velocity = np.array(ride.physics.base_tuples(bicycle.body.body)[2])
                roll_axes = ride.physics.state(bicycle.body.body).orientation
            ride.step()
            if not look:
                continue
            states = np.stack([*states, bicycle.body.state])
            steps, _ = contact(rider, states, np.reshape(rider.raw_forces(), (1, 4, 3)), 1)
            found = Contact(*(field[0] for field in steps))
            force, moment = bicycle.own_wrench(before, bicycle.body.frames, saddle)
            ground, ground_moment = bicycle.ground_wrench(saddle)
            drag = -0.5 * AIR_DENSITY * MOUNTAIN_BIKE.drag_area * np.linalg.norm(velocity) * velocity
            limbs = np.concatenate([found.hands, found.feet])
            arms = np.concatenate([grips, pedals]) - saddle
            expected = found.seat_force + limbs.sum(axis=0) + ground + drag
            expected_moment = found.seat_moment + np.cross(arms, limbs).sum(axis=0) + ground_moment
            expected_moment += np.cross(before[0, :3] - saddle, drag)
            worst_force = max(worst_force, np.abs(force - expected).max())
            worst_moment = max(worst_moment, np.abs(moment - expected_moment).max())
            worst_gap = max(worst_gap, rider.gaps().max())
            up = rotation.rotate_back(roll_axes, -found.seat_force)
            cells = LoadCells().share(up, rotation.rotate_back(roll_axes, -found.seat_moment))
            worst_cells = max(worst_cells, abs(cells.sum() - up[2]))
        assert worst_force < (0.01 if fidelity == "full" else 0.001) * weight
        assert worst_moment < (0.01 if fidelity == "full" else 0.001) * weight  # metre arms
        assert worst_gap < 1e-3
        assert worst_cells < 1e-9


def test_steer_torque_comes_through_the_hands():
    """In a steady circle the hands' forces have the moment about the steering axis that was asked for, on average."""
    found = []
    with make_ride(CIRCLE, 1.2, "still") as ride:
        body, link = ride.bicycle.body.body, ride.bicycle.links["front_assembly"]
        for step in range(4500):
            ride.step()
            if step < 2500 or step % 5:
                continue
            forces, places = np.reshape(ride.rider.raw_forces(), (4, 3))[:2], ride.rider.grips()
            front = ride.physics.state(body, link)
            axis = rotation.rotate(front.orientation, MOUNTAIN_BIKE.steer_axis)
            found.append((axis @ np.cross(places - front.position, forces).sum(axis=0), ride.pilot.command[0]))
    moment, asked = np.mean(found, axis=0)
    assert asked < -0.5
    assert moment == pytest.approx(asked, abs=0.4)


def test_load_cells_are_in_balance():
    cells = LoadCells()
    force, moment = np.array([3.0, -2.0, 400.0]), np.array([5.0, -8.0, 1.0])
    shared = cells.share(force, moment)
    assert shared.sum() == pytest.approx(400.0)
    assert shared @ cells.y == pytest.approx(5.0)
    assert -(shared @ cells.x) == pytest.approx(-8.0)
    # the force-inertial paper's table I: Lx = 0.20, Ly = 0.12, Lm = 0.043
    assert cells.x == pytest.approx((0.157, -0.043, -0.043))
    assert cells.y == pytest.approx((0.0, 0.06, -0.06))
    with pytest.raises(ValueError, match="line"):
        LoadCells((0.1, 0.0, -0.1), (0.0, 0.0, 0.0))


def test_legs_pedal_and_the_chain_drives():
    with make_ride(speed=3.0, style="still") as ride:
        torque = []
        for step in range(4000):
            ride.step()
            if step > 1000:
                wheel, crank = (
                    ride.bicycle.body.joint_tuples([ride.bicycle.links[n]])[0] for n in ("rear_wheel", "crank")
                )
                chain = ride.bicycle.drivetrain
                torque.append(
                    max(0.0, chain.ratio * crank[0] - wheel[0] - chain.slipped) * chain.parameters.chain_stiffness
                )
        assert ride.state.speed == pytest.approx(3.0, abs=0.08)
        drag = 0.5 * AIR_DENSITY * 0.5 * 9.0 + 0.006 * 93.0 * 9.81
        assert np.mean(torque) / MOUNTAIN_BIKE.rear_wheel.radius == pytest.approx(drag, rel=0.25)


def test_the_crank_turns_evenly_and_the_pedals_feel_the_push_alone():
    """At 84 a minute and little power the swing of the legs would slacken the chain without muscles that make it."""
    cadence = Events(cadence=9.5)
    with make_ride(speed=3.0, style="still", events=cadence) as ride:
        rates, pedals = [], []
        for step in range(2500):
            ride.step()
            if step >= 1500:
                rates.append(ride.state.crank_rate)
                pedals.append(sum(ride.rider.raw_forces()[8::3]))
    rate = float(np.mean(rates))
    assert rate * 30.0 / math.pi > 75.0
    assert np.std(rates) < 0.02 * rate
    turns = rate * np.arange(len(pedals)) * ride.physics.time_step
    fourfold = 2.0 * abs(np.mean((np.array(pedals) - np.mean(pedals)) * np.exp(-4j * turns)))
    assert fourfold < 8.0


@pytest.mark.parametrize("fidelity", ["full", "lumped"])
def test_save_and_restore_of_a_ride_are_bitwise(fidelity):
    def go(steps):
        for _ in range(steps):
            ride.step()
        return np.array(ride.state), np.array(ride.bicycle.body.joint_tuples(ride.rider.joints)), ride.pilot.save()

    with make_ride(CIRCLE, 1.5, fidelity=fidelity) as ride:
        go(333)
        saved = ride.save()
        first = go(400)
        ride.restore(saved)
        second = go(400)
        ride.forget(saved)
    assert np.array_equal(first[0], second[0])
    assert np.array_equal(first[1], second[1])
    assert first[2] == second[2]
    with make_ride(CIRCLE, 1.5, fidelity=fidelity) as another:
        for _ in range(733):
            another.step()
        assert np.array_equal(np.array(another.bicycle.body.joint_tuples(another.rider.joints)), first[1])


def test_coasting_straight_is_free_of_ripple():
    """High-pass specific force of the frame, without intended movements: rider full."""
    with make_ride(style="still", speed=4.0, physics_rate=1000.0) as ride:
        velocities = []
        for step in range(4000):
            ride.step()
            if step >= 2000:
                velocities.append(ride.physics.base_tuples(ride.bicycle.body.body)[2])
    acceleration = np.diff(velocities, axis=0) / 1e-3
    smooth = np.stack([np.convolve(column, np.ones(20) / 20.0, "same") for column in acceleration.T], axis=1)
    assert (acceleration - smooth)[50:-50].std(axis=0).max() < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("subject", range(5))
@pytest.mark.parametrize("fidelity", ["full", "lumped"])
def test_two_minutes_with_every_subject(subject, fidelity):
    with make_ride(CIRCLE, 1.0, subject=subject, fidelity=fidelity) as ride:
        for step in range(60000):
            ride.step()
            if step % 500 == 0:
                assert not ride.fallen
                assert ride.rider.gaps().max() < 1e-3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: RiderBody(0.9, 60.0), "stature"),
        (lambda: RiderBody(1.8, 500.0), "mass"),
        (lambda: RiderBody(2.2, 40.0), "impossible"),
        (lambda: rider_body(5), "subject"),
        (lambda: rider_body("random"), "generator"),
        (lambda: sit(BENCHMARK, SUBJECTS[0]), "pedals"),
        (lambda: sit(MOUNTAIN_BIKE, RiderBody(1.2, 40.0)), "reach"),
        (lambda: reach_to(Limb(0.3, (0.0, -0.3), 1.0), np.array([0.0, 0.0, -0.7]), np.array([1.0, 0.0, 0.0])), "reach"),
        (lambda: rider_style("wild"), "style"),
        (lambda: RiderStyle("x", 0.5, 0.0, 0.0, 0.0, 0.0), "saddle"),
        (lambda: make_ride(physics_rate=600.0), "physics_rate"),
    ],
)
def test_impossible_riders_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_ligaments_resist_beyond_their_range_and_never_pull_outwards():
    assert ligament(0.5, 3.0, 0.6) == ligament(-0.6, -3.0, 0.6) == 0.0
    assert ligament(0.7, 0.0, 0.6) == pytest.approx(-0.1 * LIGAMENT)
    assert ligament(-0.7, 0.0, 0.6) == pytest.approx(0.1 * LIGAMENT)
    assert ligament(0.7, -100.0, 0.6) == 0.0
    assert ligament(0.7, 1.0, 0.6) < ligament(0.7, 0.0, 0.6)
    # no blow where a fast joint reaches its limit
    assert abs(ligament(0.601, 8.0, 0.6)) < 5.0
