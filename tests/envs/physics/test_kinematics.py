"""Compiled kinematics against PyBullet's own, and forces on links against the same forces on base and joints."""

from __future__ import annotations

import numpy as np
import pybullet
import pytest

from poise.baselines.speed.environments import standing_ride
from poise.envs.physics.kinematics import POSITION, TURNING, VELOCITY, carry_frames, orientations
from poise.envs.physics.multibody import Multibody
from poise.envs.physics.world import BASE, Physics
from poise.filters.core import rotation

ARM = """<robot name="arm">
<link name="base"><inertial><origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/><mass value="2"/>
<inertia ixx="1" ixy="0.1" ixz="0.05" iyy="2" iyz="-0.1" izz="1.5"/></inertial></link>
<link name="slide"><inertial><origin xyz="0.1 0 0.2" rpy="0.4 0 0.2"/><mass value="1"/>
<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.025" iyz="0" izz="0.01"/></inertial></link>
<link name="hand"><inertial><origin xyz="0 0.02 -0.4" rpy="0.3 0 0.1"/><mass value="1.5"/>
<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.025" iyz="0" izz="0.01"/></inertial></link>
<joint name="rail" type="prismatic"><parent link="base"/><child link="slide"/><origin xyz="0 0.1 0.5"/>
<axis xyz="0 0.6 0.8"/><limit lower="1" upper="-1" effort="1e9" velocity="1e9"/></joint>
<joint name="hinge" type="continuous"><parent link="slide"/><child link="hand"/><origin xyz="0.2 0 0.1"/>
<axis xyz="0.8 0.6 0"/></joint></robot>"""


def moved_arm(physics: Physics) -> Multibody:
    """A free arm away from its zero position, turning and sliding."""
    arm = Multibody(physics, physics.load_urdf(ARM))
    turn = rotation.exp(np.array([0.3, -0.4, 0.9])).tolist()
    where, how = ((1.0, 2.0, 3.0), (*turn[1:], turn[0])), ((0.4, -0.2, 0.1), (0.7, 0.5, -0.6))
    pybullet.resetBasePositionAndOrientation(arm.body, *where, physicsClientId=physics.client)
    pybullet.resetBaseVelocity(arm.body, *how, physicsClientId=physics.client)
    for link, angle, rate in ((0, 0.3, -0.7), (1, -1.1, 2.0)):
        arm.set_joint(link, angle, rate)
    return arm


def link_states(body: Multibody, links) -> list:
    """Position, quaternion (w, x, y, z), velocity and angular velocity of links as PyBullet computes them."""
    more = {"computeLinkVelocity": 1, "computeForwardKinematics": 1, "physicsClientId": body.physics.client}
    rows = pybullet.getLinkStates(body.body, links, **more)
    return [(row[0], (row[1][3], *row[1][:3]), row[6], row[7]) for row in rows]


def motion_of(frames):
    """Position, quaternion, velocity and angular velocity of frames."""
    return frames[:, POSITION], orientations(frames), frames[:, VELOCITY], frames[:, TURNING]


def assert_same_motion(frames, body: Multibody) -> None:
    theirs = link_states(body, range(len(body.links) - 1))
    for field, values in enumerate(motion_of(frames)):
        expected = np.array([state[field] for state in theirs])
        if field == 1:
            values, expected = rotation.positive(values), rotation.positive(expected)
        np.testing.assert_allclose(values, expected, atol=1e-13)


def test_an_arm_moves_as_pybullet_moves_it():
    with Physics() as physics:
        arm = moved_arm(physics)
        assert_same_motion(arm.frames[1:], arm)
        for ours, theirs in zip(motion_of(arm.frames[:1]), physics.base_tuples(arm.body), strict=True):
            np.testing.assert_allclose(ours[0], theirs, atol=1e-14)


@pytest.mark.parametrize("fidelity", ["full", "lumped"])
def test_rider_and_bicycle_move_as_pybullet_moves_them(fidelity):
    with standing_ride(fidelity) as ride:
        for _ in range(100):
            ride.step()
        body = ride.bicycle.body
        assert_same_motion(body.frames[1:], body)


def test_body_frames_move_as_pybullet_moves_them():
    with Physics() as physics:
        arm = moved_arm(physics)
        frames, links = [arm.frames.copy()], [BASE, 0, 1]
        physics.step()
        frames.append(arm.frames)
        mounts = [physics.inertial_frame(arm.body, link) for link in links]
        arms = np.array([rotation.rotate_back(axes, -centre) for centre, axes in mounts])
        found = np.empty((4, 3, 1, 3))
        carry_frames(np.array([frames]), arms, physics.time_step, found)
        expected = physics.states(arm.body, links)
        np.testing.assert_allclose(found[0, :, 0], expected.position, atol=1e-13)
        np.testing.assert_allclose(found[1, :, 0], expected.velocity, atol=1e-13)
        gained = (frames[1][:, TURNING] - frames[0][:, TURNING]) / physics.time_step
        np.testing.assert_allclose(found[3, :, 0], gained, atol=1e-12)


def test_a_force_on_a_link_acts_as_in_pybullet():
    force, point, moved = (3.0, -5.0, 2.0), (1.3, 2.1, 3.6), []
    for pushed in (False, True):
        with Physics() as physics:
            arm = moved_arm(physics)
            if pushed:
                arm.push(1, force, point)
                arm.apply()
            else:
                link_states(arm, [1])
                args = (arm.body, 1, force, point, pybullet.WORLD_FRAME)
                pybullet.applyExternalForce(*args, physicsClientId=physics.client)
            physics.step()
            moved.append(arm.state.copy())
    np.testing.assert_allclose(moved[1], moved[0], atol=1e-12)


def test_what_was_read_is_read_anew_after_every_change():
    with Physics() as physics:
        arm = moved_arm(physics)
        saved, first = physics.save(), arm.state.copy()
        physics.step()
        assert not np.array_equal(arm.state, first)
        physics.restore(saved)
        assert np.array_equal(arm.state, first)
        arm.set_joint(1, 0.5)
        assert arm.joint_tuples([1]) == [(0.5, 0.0)]


def test_a_joint_with_three_axes_is_refused():
    with Physics() as physics:
        ball = physics.load_urdf(ARM.replace('type="continuous"', 'type="spherical"'))
        with pytest.raises(ValueError, match="hinge"):
            Multibody(physics, ball)
