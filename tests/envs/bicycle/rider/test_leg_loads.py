"""Weight and inertia of pedalling legs against the work that they do on the crank, and against their momentum."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE
from poise.envs.bicycle.rider.anthropometry import SUBJECTS
from poise.envs.bicycle.rider.leg_loads import leg_swing, legs_at_crank, weight_on_pedal
from poise.envs.bicycle.rider.limbs import reach_to
from poise.envs.bicycle.rider.posture import CRANKS, KNEE_OUT, sit
from poise.filters.core import rotation

POSTURE = sit(MOUNTAIN_BIKE, SUBJECTS[2])
STEP = 1e-3


def leg(crank):
    """Places ``(n, 2, 3)`` and orientations ``(n, 2, 4)`` of thigh and shank from the hip."""
    found, parts = reach_to(POSTURE.leg, POSTURE.leg_target("left", crank), KNEE_OUT), POSTURE.segments()
    thigh = rotation.rotate(found.upper, parts["thigh"].centre)
    shank = found.hinge + rotation.rotate(found.lower, parts["shank"].centre)
    return np.stack([thigh, shank], axis=1), np.stack([found.upper, found.lower], axis=1)


MASSES = np.array([POSTURE.segments()[part].mass for part in ("thigh", "shank")])
TENSORS = [POSTURE.segments()[part].tensor for part in ("thigh", "shank")]


def momentum(crank):
    """Momentum ``(n, 3)``, moment of momentum about the hip ``(n, 3)`` and twice the energy ``(n,)`` at 1 rad/s."""
    (late, turned), (early, before), (place, turn) = leg(crank + STEP), leg(crank - STEP), leg(crank)
    velocity = (late - early) / (2.0 * STEP) * MASSES[:, None]
    rate = rotation.log(rotation.multiply(turned, rotation.conjugate(before))) / (2.0 * STEP)
    spin = np.stack(
        [rotation.rotate(turn[:, k], rotation.rotate_back(turn[:, k], rate[:, k]) @ TENSORS[k]) for k in (0, 1)], axis=1
    )
    energy = (velocity**2 / MASSES[:, None] + spin * rate).sum(axis=(1, 2))
    return velocity.sum(axis=1), (rotation.cross(place, velocity) + spin).sum(axis=1), energy


def along_circle(force):
    """Torque on the crank of a force on the left pedal, N·m."""
    length, angles = MOUNTAIN_BIKE.drive.crank_length, CRANKS[: len(force)]
    return length * (-np.sin(angles) * force[:, 0] - np.cos(angles) * force[:, 2])


def test_the_weight_of_a_leg_turns_the_crank_as_it_sinks() -> None:
    heights = [(leg(CRANKS + step)[0][..., 2] * MASSES).sum(axis=1) for step in (STEP, -STEP)]
    rising = 9.81 * (heights[0] - heights[1]) / (2.0 * STEP)
    weight = weight_on_pedal(POSTURE, 9.81)
    np.testing.assert_allclose(along_circle(weight), -rising, atol=0.05)
    # hip and pedal share it
    assert 0.4 < -weight[:-1, 2].mean() / (9.81 * MASSES.sum()) < 0.65


def test_the_pedal_does_the_work_of_a_swinging_leg() -> None:
    """At a steady crank its power is the rate of change of the leg's energy."""
    energies = [0.5 * momentum(CRANKS[:-1] + step)[2] for step in (1e-2, -1e-2)]
    pedal = leg_swing(POSTURE)[:-1, 2:]
    np.testing.assert_allclose(along_circle(pedal), (energies[0] - energies[1]) / 2e-2, atol=2e-3)
    assert legs_at_crank(POSTURE) == pytest.approx(2.0 * momentum(CRANKS[:-1])[2].mean(), rel=1e-3)


def test_a_swing_is_the_pedals_force_less_the_change_of_momentum() -> None:
    late, early = (momentum(CRANKS[:-1] + step) for step in (1e-2, -1e-2))
    force, moment = ((after - before) / 2e-2 for after, before in zip(late[:2], early[:2], strict=True))
    swing, saddle = leg_swing(POSTURE), np.array(POSTURE.bicycle.saddle)
    pedal = swing[:-1, 2:]
    lift = pedal[:, 2] - force[:, 2]
    places = POSTURE.pedal("left", CRANKS[:-1]) - saddle
    tip = rotation.cross(places, pedal) - rotation.cross(POSTURE.hip - saddle, force) - moment
    np.testing.assert_allclose(swing[:-1, :2], np.stack([lift, tip[:, 0]], axis=1), atol=5e-3)
    assert np.array_equal(swing[0], swing[-1])
