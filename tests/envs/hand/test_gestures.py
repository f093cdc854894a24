import numpy as np
import pytest
import sympy
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from poise.envs.hand.gestures import FAST, GESTURES, SEVERE, SLOW, Rest, Trial, Turn, make_gesture
from poise.envs.hand.motion import euler_motion
from poise.envs.hand.smooth import Series, burst, smoothstep, smoothstep_integral, window
from poise.filters.core import rotation

LEVELS = {"slow": (0.40, 1.83), "fast": (3.06, 16.71), "severe": (6.29, 37.22)}


def draw(name, seed=0, duration=None):
    return make_gesture(name, np.random.default_rng(seed), duration)


@pytest.mark.parametrize("name", GESTURES)
@pytest.mark.parametrize("seed", [0, 1])
def test_derivatives_are_exact(name, seed):
    gesture = draw(name, seed, 12.0)
    # taps of a millisecond need a small step
    h = 1e-6
    middle = np.linspace(0.5, 11.5, 400)
    left, here, right = (gesture.sample(middle + shift) for shift in (-h, 0.0, h))
    np.testing.assert_allclose((right.position - left.position) / (2 * h), here.velocity, atol=1e-4)
    np.testing.assert_allclose((right.velocity - left.velocity) / (2 * h), here.acceleration, atol=3e-3)
    turned = rotation.multiply(right.orientation, rotation.conjugate(left.orientation))
    np.testing.assert_allclose(rotation.log(turned) / (2 * h), here.angular_velocity, atol=1e-4)
    spin = (right.angular_velocity - left.angular_velocity) / (2 * h)
    np.testing.assert_allclose(spin, here.angular_acceleration, atol=3e-3)
    np.testing.assert_allclose(np.linalg.norm(here.orientation, axis=1), 1.0, atol=1e-12)


def test_euler_motion_equals_sympy_mechanics():
    from sympy.physics.mechanics import ReferenceFrame, dynamicsymbols

    t = dynamicsymbols._t
    yaw, pitch, roll = 0.3 + 0.7 * t - 0.2 * t**2, -1.2 + 0.5 * t, 0.4 - 1.1 * t + 0.3 * t**3
    world = ReferenceFrame("N")
    body = world.orientnew("B", "Body", (yaw, pitch, roll), "ZYX")
    velocity = body.ang_vel_in(world).to_matrix(world).subs(t, 0.8)
    acceleration = body.ang_acc_in(world).to_matrix(world).subs(t, 0.8)
    jet = tuple(
        np.array([[float(sympy.diff(angle, t, order).subs(t, 0.8)) for angle in (yaw, pitch, roll)]])
        for order in range(3)
    )
    orientation, rate, rate_change = euler_motion(jet)
    np.testing.assert_allclose(rate[0], np.array(velocity, dtype=float)[:, 0], atol=1e-12)
    np.testing.assert_allclose(rate_change[0], np.array(acceleration, dtype=float)[:, 0], atol=1e-12)
    expected = Rotation.from_euler("ZYX", jet[0][0]).as_matrix()
    np.testing.assert_allclose(rotation.to_matrix(orientation)[0], expected, atol=1e-12)


@pytest.mark.parametrize("name", LEVELS)
def test_levels_of_acceleration_are_those_of_the_paper(name):
    mean, peak = LEVELS[name]
    for seed in range(5):
        gesture = draw(name, seed)
        length = np.linalg.norm(gesture.sample(np.arange(0.0, gesture.duration, 0.001)).acceleration, axis=1)
        assert length.mean() == pytest.approx(mean, rel=0.01)
        assert length.max() == pytest.approx(peak, rel=0.02)


@pytest.mark.parametrize(("config", "name"), [(SLOW, "slow"), (FAST, "fast"), (SEVERE, "severe")])
def test_motion_happens_in_the_intervals_of_the_paper(config, name):
    gesture = draw(name, 3)
    times = np.arange(0.0, gesture.duration, 0.01)
    motion = gesture.sample(times)
    inside = np.zeros(len(times), bool)
    for start, end, _ in config.intervals:
        inside |= (times > start) & (times < end)
    assert np.abs(motion.acceleration[~inside]).max() == 0.0
    assert np.abs(motion.angular_velocity[~inside]).max() == 0.0
    angles = np.degrees(np.array(rotation.to_euler_zyx(motion.orientation)[1:]))[:, inside]
    assert 5.0 < np.std(angles) < 60.0


@pytest.mark.parametrize("name", GESTURES)
def test_gestures_begin_at_rest_and_differ_by_seed(name):
    gesture, other = draw(name, 0), draw(name, 1)
    early = np.arange(0.0, 1.0, 0.01)
    # the equation of soft tissue is solved to rounding
    assert np.abs(gesture.sample(early).velocity).max() < 1e-12
    assert np.abs(gesture.sample(early).angular_velocity).max() < 1e-12
    if getattr(GESTURES[name], "planar", False):
        return
    starts = [g.sample(np.zeros(1)).orientation[0] for g in (gesture, other)]
    assert rotation.angle(rotation.multiply(starts[0], rotation.conjugate(starts[1]))) > 0.05


@pytest.mark.parametrize("name", GESTURES)
def test_equal_seeds_give_equal_motion_and_any_selection_of_times(name):
    times = np.arange(0.0, 8.0, 0.013)
    one, two = draw(name, 5, 8.0).sample(times), draw(name, 5, 8.0).sample(times)
    for left, right in zip(one, two, strict=True):
        np.testing.assert_array_equal(left, right)
    backwards = draw(name, 5, 8.0).sample(times[::-1])
    np.testing.assert_allclose(backwards.acceleration[::-1], one.acceleration, atol=1e-9)
    part = draw(name, 5, 8.0).sample(times[100:200])
    np.testing.assert_allclose(part.acceleration, one.acceleration[100:200], atol=1e-9)


def test_longer_durations_repeat_the_trial_with_new_motion():
    gesture = draw("fast", 0, 30.0)
    times = np.arange(0.0, 10.0, 0.01)
    length = [np.linalg.norm(gesture.sample(times + shift).acceleration, axis=1) for shift in (0.0, 10.0, 20.0)]
    for cycle in length:
        assert cycle.max() == pytest.approx(16.71, rel=0.01)
        assert cycle.mean() == pytest.approx(3.06, rel=0.01)
    assert np.abs(length[0] - length[1]).max() > 1.0


def test_spectrum_of_the_position_stays_in_its_band():
    series = Series.draw(np.random.default_rng(0), (0.8, 3.5), 3)
    times = np.arange(0.0, 100.0, 0.02)
    power = np.abs(np.fft.rfft(series.sample(times)[0] * np.hanning(len(times))[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(times), 0.02)
    inside = (frequency > 0.75) & (frequency < 3.55)
    assert power[inside].sum() / power.sum() > 0.999


def test_mixed_reaches_all_attitudes():
    gesture = draw("mixed", 0, 600.0)
    up = rotation.up_in_body(gesture.sample(np.arange(0.0, 600.0, 0.1)).orientation)
    assert up.max(axis=0).min() > 0.95
    assert up.min(axis=0).max() < -0.95
    rates = np.linalg.norm(gesture.sample(np.arange(0.0, 600.0, 0.05)).angular_velocity, axis=1)
    assert rates.max() < np.radians(2000.0)


def test_turn_has_the_rate_and_radius_asked_for():
    gesture = make_gesture(Turn(rate=3.0, radius=0.5), np.random.default_rng(0))
    motion = gesture.sample(np.array([5.0, 6.0]))
    np.testing.assert_allclose(np.linalg.norm(motion.velocity, axis=1), 1.5)
    np.testing.assert_allclose(np.linalg.norm(motion.acceleration, axis=1), 4.5)
    np.testing.assert_allclose(motion.angular_velocity, [[0, 0, 3.0]] * 2)


def test_pieces_are_twice_continuously_differentiable():
    times = np.linspace(-1.0, 5.0, 60001)
    for jet in (smoothstep(times, 0.2, 1.5), window(times, 0.0, 3.0, 0.4), burst(times, 2.0, 0.6)):
        spline = CubicSpline(times, jet[0])
        np.testing.assert_allclose(spline(times, 1), jet[1], atol=1e-5)
        np.testing.assert_allclose(spline(times, 2), jet[2], atol=2e-2)
        assert np.abs(np.diff(jet[2])).max() < 0.1
    integral = CubicSpline(times, smoothstep(times, 0.2, 1.5)[0]).antiderivative()
    np.testing.assert_allclose(integral(times), smoothstep_integral(times, 0.2, 1.5), atol=1e-9)


def test_bad_gestures_are_refused_by_name():
    generator = np.random.default_rng(0)
    with pytest.raises(ValueError, match=r"unknown gesture 'wave' \(gestures: rest, slow"):
        make_gesture("wave", generator)
    with pytest.raises(ValueError, match="duration must be positive"):
        make_gesture("slow", generator, 0.0)
    with pytest.raises(ValueError, match="a gesture must be one of"):
        make_gesture(3.0, generator)
    impossible = Trial(10.0, ((1.0, 9.0, 1.0),), 5.0, 6.0, (0.8, 3.5), (0.3, 1.2), 0.3)
    with pytest.raises(ValueError, match="always more peaked"):
        impossible.draw(generator)


def test_rest_with_a_tilt_stays_near_level():
    tilts = [Rest(tilt=0.05).draw(np.random.default_rng(seed)).sample(np.zeros(1)) for seed in range(30)]
    up = np.array([rotation.up_in_body(motion.orientation)[0] for motion in tilts])
    assert np.degrees(np.arccos(up[:, 2])).max() < 12.0
