import numpy as np
import pytest
from scipy.signal import welch

from poise.envs.hand.carried import CARRIAGES, Carried
from poise.envs.hand.everyday import EVERYDAY, SUMMARIES
from poise.envs.hand.hand_held import HandHeld
from poise.envs.hand.sensing import simulate_hand
from poise.envs.sensors.ideal import STANDARD_GRAVITY
from poise.filters.core import rotation


def draw(name, seed, duration=30.0):
    return EVERYDAY[name].draw(np.random.default_rng(seed), duration)


@pytest.mark.parametrize("name", EVERYDAY)
def test_strapdown_integration_of_ideal_sensors_returns_the_labels(name):
    place = {"lever_arm": (0.05, -0.02, 0.03), "mounting": rotation.exp(np.array([0.4, -1.0, 2.0]))}
    motion = simulate_hand(name, 1, "ideal", 100.0, 20.0, **place)
    q, v, p = (motion.truth[each][0] for each in ("orientation", "velocity", "position"))
    for gyr, acc in zip(motion.measurements["imu/gyr"][1:], motion.measurements["imu/acc"][1:], strict=True):
        middle = rotation.multiply(q, rotation.exp(0.005 * gyr))
        new = v + 0.01 * (rotation.rotate(middle, acc) - [0.0, 0.0, STANDARD_GRAVITY])
        p, v = p + 0.005 * (v + new), new
        q = rotation.multiply(q, rotation.exp(0.01 * gyr))
    error = rotation.multiply(q, rotation.conjugate(motion.truth["orientation"][-1]))
    assert np.degrees(rotation.angle(error)) < 1e-6
    np.testing.assert_allclose(v, motion.truth["velocity"][-1], atol=1e-8)
    # positions are sums of trapezoids of exact velocities
    np.testing.assert_allclose(p, motion.truth["position"][-1], atol=0.02)


def test_every_name_says_what_it_is():
    assert EVERYDAY.keys() == SUMMARIES.keys()


def share_above(name, frequency, seeds=5):
    """Of the power of the acceleration."""
    times, above, whole = np.arange(0.0, 30.0, 0.002), 0.0, 0.0
    for seed in range(seeds):
        at, power = welch(draw(name, seed).sample(times).acceleration, 500.0, nperseg=4096, axis=0)
        above, whole = above + power[at > frequency].sum(), whole + power.sum()
    return above / whole


def test_shocks_are_what_smooth_motion_lacks():
    smooth = share_above("rotation", 10.0)
    for name in ("taps", "vibration"):
        assert share_above(name, 10.0) > 3.0 * smooth
    assert share_above("tremor", 7.0) > 0.9


def test_rotation_is_as_fast_as_asked_and_about_all_axes():
    for seed in range(5):
        motion = draw("rotation", seed, 120.0).sample(np.arange(2.0, 120.0, 0.01))
        rate = rotation.rotate_back(motion.orientation, motion.angular_velocity)
        assert 0.3 < np.sqrt(np.mean(np.sum(rate**2, axis=1))) < 11.0
        up = rotation.up_in_body(motion.orientation)
        assert (up.max(axis=0) > 0.7).all()
        assert (up.min(axis=0) < -0.7).all()


def test_a_device_on_the_table_lies_still_and_one_in_the_hand_does_not():
    times, tremor = np.arange(3.0, 25.0, 0.01), EVERYDAY["tremor"].over
    for in_hand in (0.0, 1.0):
        config = HandHeld(rest_shares=(1.0,) * 4, in_hand_share=in_hand, over=tremor)
        speed = np.linalg.norm(config.draw(np.random.default_rng(0), 25.0).sample(times).velocity, axis=1)
        assert (speed.max() > 0.0) == bool(in_hand)


@pytest.mark.parametrize("carriage", CARRIAGES)
@pytest.mark.parametrize("running", [False, True])
def test_walkers_bounce_once_a_step(carriage, running):
    config = Carried(
        running_share=float(running),
        carriages=(carriage,),
        cadence=(1.9, 1.9),
        running_cadence=(2.7, 2.7),
        standing_share=0.0,
        step_jitter=(0.01, 0.01),
        over=EVERYDAY["rotation"].over,
        walk=(120.0, 120.0),
    )
    times = np.arange(5.0, 40.0, 0.01)
    total = 0.0
    for seed in range(6):
        motion = config.draw(np.random.default_rng(seed), 40.0).sample(times)
        frequency, power = welch(motion.acceleration[:, 2], 100.0, nperseg=1024)
        total = total + power / power.sum()
    step = 2.7 if running else 1.9
    # steps and their harmonics, and the stride of the swinging limb
    assert abs((frequency[total.argmax()] / step * 2.0) - round(frequency[total.argmax()] / step * 2.0)) < 0.15
    assert np.ptp(motion.position[:, :2], axis=0).max() > 5.0


def test_bad_configurations_are_refused_by_name():
    with pytest.raises(ValueError, match=r"carriages must be one or more of hand, swinging, pocket, got \('bag',\)"):
        Carried(carriages=("bag",))
    with pytest.raises(ValueError, match=r"rate must be a range .*got \(0.0, 1.0\)"):
        HandHeld(rate=(0.0, 1.0))
    with pytest.raises(ValueError, match="shortest must be positive and at most longest"):
        HandHeld(shortest=9.0)
    with pytest.raises(ValueError, match=r"rhythmic_share must lie in \[0, 1\], got 1.5"):
        HandHeld(rhythmic_share=1.5)
