import numpy as np
import pybullet
import pytest

from poise.envs.physics.multibody import Multibody, connect_points, constraint_forces
from poise.envs.physics.world import BASE, Physics, PhysicsError, principal_axes
from poise.envs.sensors.ideal import BodyState
from poise.filters.core import rotation

TENSOR = np.array([[0.004, 0.0005, 0.0002], [0.0005, 0.006, -0.0003], [0.0002, -0.0003, 0.005]])
CENTRE = (0.1, -0.05, 0.03)

PENDULUM = """<robot name="pendulum">
<link name="base"><inertial><origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/><mass value="2"/>
<inertia ixx="1" ixy="0.1" ixz="0.05" iyy="2" iyz="-0.1" izz="1.5"/></inertial></link>
<link name="arm"><inertial><origin xyz="0 0.02 -0.4" rpy="0.3 0 0.1"/><mass value="1.5"/>
<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.025" iyz="0" izz="0.01"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.5"/><axis xyz="1 0 0"/>
</joint></robot>"""


def state(seed=0):
    rng = np.random.default_rng(seed)
    return BodyState(0.0, rng.normal(size=3), rotation.random(rng), rng.normal(size=3), rng.normal(size=3))


def assert_same_state(a, b, tolerance=1e-12):
    for name in ("position", "orientation", "velocity", "angular_velocity"):
        left, right = getattr(a, name), getattr(b, name)
        if name == "orientation":
            left, right = rotation.positive(left), rotation.positive(right)
        np.testing.assert_allclose(left, right, atol=tolerance, err_msg=name)


def test_principal_axes_rebuild_the_tensor():
    moments, axes = principal_axes(TENSOR)
    matrix = rotation.to_matrix(axes)
    np.testing.assert_allclose(matrix @ np.diag(moments) @ matrix.T, TENSOR, atol=1e-15)
    with pytest.raises(ValueError, match="symmetric"):
        principal_axes(np.arange(9.0).reshape(3, 3))


@pytest.mark.parametrize("kind", ["created", "loaded"])
def test_state_of_the_body_frame_survives_a_round_trip(kind):
    with Physics() as physics:
        body = physics.create_body(0.3, TENSOR, centre_of_mass=CENTRE) if kind == "created" else None
        body = physics.load_urdf(PENDULUM) if body is None else body
        wanted = state(3)
        physics.set_state(body, wanted)
        assert_same_state(physics.state(body), wanted)


def test_free_flight_keeps_momentum_and_falls():
    with Physics(time_step=1e-3, gravity=9.81) as physics:
        body = physics.create_body(0.3, TENSOR, centre_of_mass=CENTRE)
        first = state(1)
        physics.set_state(body, first)
        centre = first.position + rotation.rotate(first.orientation, np.array(CENTRE))
        speed = first.velocity + np.cross(first.angular_velocity, centre - first.position)

        def angular_momentum(s):
            return rotation.rotate(s.orientation, TENSOR @ rotation.rotate_back(s.orientation, s.angular_velocity))

        for _ in range(500):
            physics.step()
        last = physics.state(body)
        t = physics.time
        assert t == pytest.approx(0.5)
        centre_now = last.position + rotation.rotate(last.orientation, np.array(CENTRE))
        np.testing.assert_allclose(centre_now, centre + speed * t - [0, 0, 0.5 * 9.81 * t * (t + 1e-3)], atol=1e-9)
        np.testing.assert_allclose(angular_momentum(last), angular_momentum(first), rtol=0.0, atol=1e-5)


def test_link_velocities_are_those_of_the_body_frame():
    with Physics(time_step=1e-4) as physics:
        body = physics.load_urdf(PENDULUM, position=(0, 0, 5), fixed=True)
        links = physics.links(body)
        assert links == {"base": BASE, "arm": 0}
        Multibody(physics, body).set_joint(0, 0.7, 3.0)
        before = physics.states(body, [BASE, 0])
        physics.step()
        after = physics.states(body, [BASE, 0])
        velocity = (after.position - before.position) / physics.time_step
        np.testing.assert_allclose(velocity, after.velocity, atol=1e-3)
        np.testing.assert_allclose(after.position[1], [0, 0, 5.5], atol=1e-12)
        np.testing.assert_allclose(
            after.angular_velocity[1], [Multibody(physics, body).joint_tuples([0])[0][1], 0, 0], atol=1e-9
        )


def test_pendulum_swings_like_the_equation_of_motion():
    from scipy.integrate import solve_ivp

    with Physics(time_step=2e-4, gravity=9.81) as physics:
        body = physics.load_urdf(PENDULUM, fixed=True)
        arm = Multibody(physics, body)
        arm.set_joint(0, 0.5)
        for _ in range(5000):
            physics.step()
        angle = arm.joint_tuples([0])[0][0]
    rotated = rotation.to_matrix(rotation.from_euler_zyx(*(np.array(a) for a in (0.1, 0.0, 0.3))))
    inertia = (rotated @ np.array([[0.02, 0.001, 0], [0.001, 0.025, 0], [0, 0, 0.01]]) @ rotated.T)[0, 0]
    inertia += 1.5 * (0.02**2 + 0.4**2)

    def motion(_, y):
        down = -0.4 * np.sin(y[0]) * 9.81 * 1.5 - 0.02 * np.cos(y[0]) * 9.81 * 1.5
        return [y[1], down / inertia]

    exact = solve_ivp(motion, (0.0, 1.0), [0.5, 0.0], rtol=1e-10, atol=1e-10).y[0, -1]
    assert angle == pytest.approx(exact, abs=2e-3)


def test_joint_torque_holds_the_arm():
    with Physics(gravity=9.81) as physics:
        body = physics.load_urdf(PENDULUM, fixed=True)
        arm = Multibody(physics, body)
        arm.set_joint(0, np.pi / 2)
        for _ in range(20):
            arm.forces[6] = 0.4 * 1.5 * 9.81
            arm.apply()
            physics.step()
        assert abs(arm.joint_tuples([0])[0][0] - np.pi / 2) < 1e-5


def test_point_to_point_carries_the_weight():
    with Physics(gravity=9.81) as physics:
        anchor = physics.create_body(0.0, (0.0, 0.0, 0.0))
        body = physics.create_body(0.3, TENSOR, centre_of_mass=(0.0, 0.0, -0.1))
        constraint = connect_points(physics, (anchor, BASE), (0, 0, 0), (body, BASE), (0, 0, 0))
        for _ in range(300):
            physics.step()
        np.testing.assert_allclose(constraint_forces(physics, [constraint])[0], [0, 0, 0.3 * 9.81], atol=1e-3)
        assert np.linalg.norm(physics.state(body).position) < 1e-4


def test_saved_states_replay_bitwise_and_can_be_forgotten():
    with Physics() as physics:
        body = physics.create_body(0.3, TENSOR, centre_of_mass=CENTRE)
        physics.set_state(body, state(2))
        physics.step()
        saved = physics.save()

        def play():
            for _ in range(50):
                frame, client = pybullet.WORLD_FRAME, physics.client
                pybullet.applyExternalTorque(body, BASE, (0.1, 0.2, -0.1), frame, physicsClientId=client)
                place = physics.base_tuples(body)[0]
                pybullet.applyExternalForce(body, BASE, (0.1, 0.2, 3.0), place, frame, physicsClientId=client)
                physics.step()
            return physics.base_tuples(body), physics.time

        first = play()
        physics.restore(saved)
        assert play() == first
        physics.forget(saved)
        with pytest.raises(PhysicsError, match="no state"):
            physics.restore(saved)


def test_worlds_are_separate_and_close_twice():
    one, two = Physics(), Physics()
    body = one.create_body(1.0, (1.0, 1.0, 1.0))
    other = two.create_body(1.0, (1.0, 1.0, 1.0))
    one.step()
    assert one.state(body).velocity[2] < 0.0
    assert two.state(other).velocity[2] == 0.0
    one.close()
    one.close()
    two.step()
    two.close()
    del one


def test_bad_arguments_are_refused():
    with pytest.raises(ValueError, match="time_step"):
        Physics(time_step=0.0)
    with Physics() as physics:
        with pytest.raises(ValueError, match="moments of inertia"):
            physics.create_body(1.0, (1.0, 0.0, 1.0))
        with pytest.raises(PhysicsError, match="cannot load"):
            physics.load_urdf("<robot></robot>")


def test_a_window_without_a_display_is_an_error_not_the_end(monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(PhysicsError, match="DISPLAY is not set"):
        Physics(gui=True)
