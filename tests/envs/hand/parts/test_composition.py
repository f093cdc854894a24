import numpy as np

from poise.envs.hand.gestures import make_gesture
from poise.envs.hand.parts.composition import ComposedGesture, Gated, displaced, gate
from poise.envs.hand.parts.noise import Noise
from poise.envs.sensors.ideal import Mounting, mounted
from poise.filters.core import rotation

TIMES = np.arange(0.0, 8.0, 0.01)


def noise(seed, level, derivative=2):
    return Noise.draw(np.random.default_rng(seed), 8.0, (0.5, 4.0), level, derivative=derivative)


def test_a_constant_displacement_is_a_mounting():
    body = make_gesture("fast", np.random.default_rng(0), 8.0).sample(TIMES)
    lever, angles = np.array([0.1, -0.2, 0.3]), np.array([0.4, 0.5, -2.0])
    still = np.zeros((len(TIMES), 3))
    state = displaced(body, (still + lever, still, still), (still + angles, still, still))
    expected = mounted(body, Mounting(tuple(lever), tuple(rotation.from_euler_zyx(*angles))))
    for left, right in zip(state, expected, strict=True):
        np.testing.assert_allclose(left, right, atol=1e-12)


def test_offsets_in_both_axes_have_exact_derivatives():
    base = make_gesture("fast", np.random.default_rng(0), 8.0)
    inside = ((1.0, 3.0), (4.0, 7.5))
    parts = (
        Gated(inside, 0.3, noise(1, 3.0), noise(2, 2.0, 1)),
        Gated(inside, 0.3, noise(3, 3.0)),
        Gated(inside, 0.3, noise(4, 3.0), in_world=True),
    )
    gesture, h = ComposedGesture(base, parts), 1e-6
    left, here, right = (gesture.sample(TIMES[60:750] + shift) for shift in (-h, 0.0, h))
    np.testing.assert_allclose((right.position - left.position) / (2.0 * h), here.velocity, atol=1e-6)
    np.testing.assert_allclose((right.velocity - left.velocity) / (2.0 * h), here.acceleration, atol=1e-3)
    turned = rotation.log(rotation.multiply(right.orientation, rotation.conjugate(left.orientation)))
    np.testing.assert_allclose(turned / (2.0 * h), here.angular_velocity, atol=1e-6)
    change = (right.angular_velocity - left.angular_velocity) / (2.0 * h)
    np.testing.assert_allclose(change, here.angular_acceleration, atol=1e-3)
    plain = base.sample(TIMES)
    moved = gesture.sample(TIMES).position - plain.position
    outside = (TIMES < 1.0) | (TIMES > 7.5) | ((TIMES > 3.0) & (TIMES < 4.0))
    assert np.abs(moved[outside]).max() == 0.0
    assert np.abs(moved[~outside]).max() > 0.01


def test_gates_open_in_their_intervals_only():
    value = gate(TIMES, ((1.0, 2.0), (3.0, 3.3)), 0.5)[0][:, 0]
    assert value[(TIMES < 1.0) | ((TIMES > 2.0) & (TIMES < 3.0)) | (TIMES > 3.3)].max() == 0.0
    assert value[150] == 1.0
    assert value[315] == 1.0
