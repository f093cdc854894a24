"""Mistakes of units, signs, axes and clocks are named; sound recordings are left in peace."""

import warnings

import numpy as np
import pytest

import poise
from poise.envs.data.inspection import inspect_recording
from poise.envs.data.plausibility.rate_consistency import rate_consistency
from poise.envs.data.plausibility.recording import check_recording
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import rotation

GESTURES = ("slow", "fast", "severe", "mixed")


@pytest.fixture(scope="module")
def motions():
    return {gesture: simulate_hand(gesture, seed=3, duration=20.0) for gesture in GESTURES}


def changed(trajectory, truth=False, **channels):
    """The trajectory with other readings; ``gyr``, ``acc``, ``mag`` are functions of the old ones."""
    measurements = {
        name: channels[name[4:]](values) if name[4:] in channels else values
        for name, values in trajectory.measurements.items()
    }
    return trajectory.replace(measurements=measurements, truth=trajectory.truth if truth else {})


def warnings_of(trajectory):
    return [str(finding) for finding in check_recording(trajectory) if finding.severity == "warning"]


@pytest.mark.parametrize("gesture", GESTURES)
@pytest.mark.parametrize("truth", [True, False])
def test_sound_recordings_have_no_findings(motions, gesture, truth):
    assert check_recording(changed(motions[gesture], truth)) == []


@pytest.mark.parametrize("gesture", GESTURES)
@pytest.mark.parametrize("truth", [True, False])
@pytest.mark.parametrize(
    ("unit", "factor"),
    [("deg/s", 180 / np.pi), ("rev/s", 0.5 / np.pi), ("rpm", 30 / np.pi), ("mrad/s", 1e3), ("mdeg/s", 1.8e5 / np.pi)],
)
def test_units_of_the_gyroscope_are_named(motions, gesture, truth, unit, factor):
    found = warnings_of(changed(motions[gesture], truth, gyr=lambda values: factor * values))
    assert len(found) == 1
    assert f"rates in {unit}" in found[0]


@pytest.mark.parametrize("gesture", GESTURES)
@pytest.mark.parametrize(
    ("unit", "at_rest"),
    [
        ("g", 1.0),
        ("mg", 1e3),
        ("cm/s²", 980.665),
        ("counts of ±8 g in 16 bits", 4096.0),
        ("m/s² that were", 9.80665**2),
    ],
)
def test_units_of_the_accelerometer_are_named(motions, gesture, unit, at_rest):
    (found,) = warnings_of(changed(motions[gesture], acc=lambda values: values / 9.80665 * at_rest))
    # milli-g and cm/s² differ by 2 %
    assert f"readings in {unit}" in found or (unit == "cm/s²" and "readings in mg" in found)


@pytest.mark.parametrize("gesture", GESTURES)
def test_removed_gravity_is_named(motions, gesture):
    up = motions[gesture].truth_of("up")
    (found,) = warnings_of(changed(motions[gesture], acc=lambda values: values - 9.81 * up))
    assert "gravity was removed" in found


@pytest.mark.parametrize("gesture", GESTURES)
def test_the_sign_of_apple_is_named_where_the_truth_tells(motions, gesture):
    found = warnings_of(changed(motions[gesture], truth=True, acc=lambda values: -values))
    assert len(found) == 1
    assert "Apple's sign" in found[0]


def test_without_truth_a_level_sensor_tells_the_sign(motions):
    level = simulate_hand("slow", seed=3, duration=4.0)
    up = rotation.level(level.truth_of("up"))
    flat = {name: rotation.rotate(up, values) for name, values in level.measurements.items()}
    found = warnings_of(level.replace(measurements=flat | {"imu/acc": -flat["imu/acc"]}, truth={}))
    assert any("Apple's sign" in text and "upside down" in text for text in found)


@pytest.mark.parametrize("gesture", GESTURES)
@pytest.mark.parametrize(
    ("axes", "words"),
    [
        (np.diag([-1.0, 1.0, 1.0]), "sign of x"),
        (np.diag([1.0, -1.0, 1.0]), "sign of y"),
        (np.diag([1.0, 1.0, -1.0]), "sign of z"),
        (-np.eye(3), "all signs"),
        (np.eye(3)[[1, 0, 2]], "should be y, x, z"),
        (np.eye(3)[[1, 2, 0]], "should be z, x, y"),
    ],
)
def test_axes_of_the_gyroscope_are_named(motions, gesture, axes, words):
    (found,) = warnings_of(changed(motions[gesture], gyr=lambda values: values @ axes.T))
    assert "imu/gyr" in found
    assert words in found


@pytest.mark.parametrize("gesture", ["slow", "fast", "mixed"])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_reversed_axis_of_the_accelerometer_is_told_from_one_of_the_gyroscope(motions, gesture, axis):
    sign = 1.0 - 2.0 * np.eye(3)[axis]
    found = warnings_of(changed(motions[gesture], acc=lambda values: sign * values))
    assert any(f"imu/acc: gyroscope and accelerometer do not turn together; likely cause: of the accelerometer "
               f"the sign of {'xyz'[axis]}" in text for text in found)  # fmt: skip


@pytest.mark.parametrize(("unit", "scale"), [("ms", 1e3), ("µs", 1e6), ("ns", 1e9), ("sample numbers", 100.0)])
def test_units_of_time_are_named(motions, unit, scale):
    motion = motions["slow"]
    time = np.arange(len(motion)) * 1.0 if unit == "sample numbers" else motion.time * scale
    found = warnings_of(motion.replace(time=time, truth={}))
    assert len(found) == 1
    assert unit in found[0]


@pytest.mark.parametrize("channel", ["gyr", "acc", "mag"])
@pytest.mark.parametrize("kind", ["zeros", "constant", "missing"])
def test_dead_channels_are_named(motions, channel, kind):
    value = {"zeros": 0.0, "constant": 3.5, "missing": np.nan}[kind]
    found = warnings_of(changed(motions["fast"], **{channel: lambda values: np.full_like(values, value)}))
    assert any(text.startswith(f"imu/{channel}: ") and "Leave" in text for text in found)


def test_most_of_a_recording_may_be_rest(motions):
    motion = motions["mixed"]
    order = np.r_[np.zeros(4000, int), 0 : len(motion)]
    noise = np.random.default_rng(0).standard_normal((2, len(order), 3)) * [[[0.002]], [[0.02]]]
    rest = {"imu/gyr": 0.0, "imu/acc": motion.measurements["imu/acc"][0]}
    measurements = {
        name: np.where(order[:, None] > 0, motion.measurements[name][order], rest[name]) + noise[k]
        for k, name in enumerate(rest)
    }
    long = Trajectory(np.arange(len(order)) * motion.dt, measurements)
    assert warnings_of(long) == []
    for change, words in (
        (lambda values: np.radians(values), "converted from deg/s once too often"),
        (lambda values: values * [1.0, -1.0, 1.0], "sign of y"),
    ):
        (found,) = warnings_of(changed(long, gyr=change))
        assert words in found


@pytest.mark.parametrize("site", ["imu/acc", "imu/mag"])
def test_strong_accelerations_are_no_unit(site):
    motion = simulate_hand("walk", seed=5, duration=20.0)
    assert np.median(np.linalg.norm(motion.measurements["imu/acc"], axis=1)) > 20.0
    kept = {name: motion.measurements[name] for name in ("imu/gyr", "imu/acc", site)}
    strong = motion.replace(measurements=kept, truth={})
    assert warnings_of(strong) == []
    (found,) = warnings_of(changed(strong, acc=lambda values: values / 9.80665))
    assert "readings in g" in found
    (found,) = warnings_of(changed(strong, acc=lambda values: values - 9.81 * motion.truth_of("up")))
    assert "gravity was removed" in found


@pytest.mark.parametrize(("factor", "words"), [(1.0, None), (180.0 / np.pi, "rates in deg/s"), (30.0 / np.pi, "rpm")])
def test_a_steady_turn_is_no_bias(factor, words):
    turn = simulate_hand("turn", seed=5, duration=8.0)
    found = warnings_of(changed(turn, gyr=lambda values: factor * values))
    assert [words in text for text in found] == ([] if words is None else [True])


def test_minutes_are_noted(motions):
    motion = motions["slow"]
    found = [str(finding) for finding in check_recording(motion.replace(time=motion.time / 60.0, truth={}))]
    assert any("time in minutes (in seconds that would be 100 Hz)" in text for text in found)


@pytest.mark.parametrize("gesture", GESTURES)
@pytest.mark.parametrize("factor", [0.125, 0.25, 0.5, 2.0, 4.0, 8.0])
def test_another_full_scale_of_the_gyroscope_is_named(motions, gesture, factor):
    (found,) = warnings_of(changed(motions[gesture], gyr=lambda values: factor * values))
    assert "another full scale than assumed" in found


@pytest.mark.parametrize(("unit", "scale"), [("nT", 1e3), ("mG", 10.0), ("G", 1e-2)])
def test_units_of_the_magnetometer_are_noted(motions, unit, scale):
    (finding,) = check_recording(changed(motions["slow"], mag=lambda values: scale * values))
    assert finding.severity == "note"
    assert f"readings in {unit} " in str(finding)


@pytest.mark.parametrize("axes", [np.diag([-1.0, 1.0, 1.0]), np.eye(3)[[1, 0, 2]]])
def test_axes_of_the_magnetometer_are_named(motions, axes):
    found = warnings_of(changed(motions["slow"], mag=lambda values: values @ axes.T))
    assert any(text.startswith("imu/mag: gyroscope and magnetometer do not turn together") for text in found)


def test_saturation_gaps_and_clock_offsets_are_told(motions):
    motion = motions["severe"]
    clipped = changed(motion, gyr=lambda values: np.clip(values, -2.0, 2.0))
    rows = np.r_[0:500, 900:1500]
    cut = Trajectory(motion.time[rows], {name: values[rows] for name, values in motion.measurements.items()})
    late = motion.replace(metadata={**motion.metadata, "reference_clock_offset": 0.004})
    # so many samples at the extreme value lose the rotation: more than a note
    for trajectory, words, severity in (
        (clipped, "saturation", "warning"),
        (cut, "gaps of more than 1 s", "note"),
        (late, "4.0 ms ahead", "note"),
    ):
        told = [str(finding) for finding in check_recording(trajectory) if finding.severity == severity]
        assert any(words in text for text in told), words


def test_the_comparison_of_rates_is_that_of_scipy(motions):
    """Gravity turned back by SciPy's integration of the rates stands as still as the residual says."""
    from scipy.spatial.transform import Rotation

    motion = motions["slow"]
    rate, up = motion.measurements["imu/gyr"], motion.truth_of("up")
    found = rate_consistency(motion.time, rate, up)
    turned, attitude = [], Rotation.identity()
    for t in range(1, 300):
        attitude = attitude * Rotation.from_rotvec(rate[t] * motion.dt)
        turned.append(attitude.apply(up[t].copy()))
    means = np.reshape(turned[:297], (3, 99, 3)).mean(axis=1)
    spread = np.sqrt(np.var(means, axis=0).sum() / np.square(means.mean(axis=0)).sum())
    assert found.as_given < 0.03
    assert spread < 0.03
    assert found.at_rest > 5.0 * found.as_given


@pytest.mark.parametrize("seed", [0, 3])
@pytest.mark.parametrize("other", ["imu/mag", "imu/acc"])
def test_conjugate_reference_is_named(seed, other):
    motion = poise.record("poise/HandMotion-v0", seed=seed)
    truth = {"orientation": motion.truth["orientation"] * [1.0, -1.0, -1.0, -1.0]}
    kept = {name: motion.measurements[name] for name in {"imu/gyr", other} if name in motion.measurements}
    findings = [str(each) for each in check_recording(motion.replace(measurements=kept, truth=truth))]
    assert any("conjugate quaternions" in each for each in findings)


@pytest.mark.parametrize("gesture", ["mixed", "fast"])
@pytest.mark.parametrize(
    ("reading", "words"),
    [
        (rotation.to_xyzw, "quaternions whose scalar is the last"),
        (rotation.from_xyzw, "quaternions whose scalar is the first"),
        (lambda q: q * [1.0, -1.0, 1.0, 1.0], "do not turn together"),
        (lambda q: np.where((np.arange(len(q)) > len(q) // 2)[:, None], q[len(q) // 2], q), "% of it repeat one"),
        (lambda q: np.tile(q[:1], (len(q), 1)), "100 % of it repeat"),
    ],
)
def test_a_reference_that_is_misread_is_named(motions, gesture, reading, words):
    motion = motions[gesture]
    truth = {"orientation": reading(motion.truth["orientation"])}
    assert any(words in text for text in warnings_of(motion.replace(truth=truth)))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(
    ("factor", "words"), [(np.pi / 180, "converted from deg/s once too often"), (180 / np.pi, "rates in deg/s")]
)
@pytest.mark.parametrize("sway", [0.0, 0.05])
def test_rates_of_a_quiet_sensor_are_of_one_unit(seed, factor, words, sway):
    """Noise tells at rest, a sway of 3° when little else moves."""
    rng, time = np.random.default_rng(seed), np.arange(800) / 100.0
    angles = sway * np.sin(0.4 * np.pi * time)[:, None] * [1.0, 0.5, 0.2]
    gyr = np.gradient(angles, 0.01, axis=0) + 0.002 * rng.standard_normal((800, 3)) + [0.005, -0.004, 0.002]
    acc = 9.81 * rotation.up_in_body(rotation.exp(angles)) + 0.03 * rng.standard_normal((800, 3))
    motion = Trajectory(time, {"imu/gyr": gyr, "imu/acc": acc}, metadata={"name": "quiet"})
    assert warnings_of(motion) == []
    assert any(words in text for text in warnings_of(changed(motion, gyr=lambda values: factor * values)))


@pytest.mark.parametrize("readings", [lambda motion: np.cumsum(motion.measurements["imu/gyr"], axis=0) * 0.01,
    lambda motion: rotation.rotate(motion.truth["orientation"], motion.measurements["imu/gyr"])])  # fmt: skip
def test_angles_and_rates_in_the_world_are_no_rates(motions, readings):
    motion = motions["mixed"]
    assert warnings_of(changed(motion, gyr=lambda _: readings(motion)))


def test_a_wrong_clock_and_a_wrong_sign_are_named(motions):
    motion = motions["mixed"]
    for time, words in ((motion.time / 60.0, "time in minutes"), (2.0 * motion.time, "a clock of half the rate")):
        assert any(words in text for text in warnings_of(motion.replace(time=time, truth={})))
    assert any("Apple's sign" in text for text in warnings_of(changed(motion, acc=lambda values: -values)))
    late = motion.replace(metadata={**motion.metadata, "reference_clock_offset": 0.05})
    assert any("50.0 ms ahead" in text for text in warnings_of(late))


@pytest.mark.parametrize(("channel", "severity"), [("mag", "note"), ("acc", "note"), ("gyr", "warning")])
def test_zeros_between_the_samples_of_a_slow_sensor_are_told(motions, channel, severity):
    def thinned(values):
        return np.where((np.arange(len(values)) % 4 == 0)[:, None], values, 0.0)

    findings = check_recording(changed(motions["mixed"], **{channel: thinned}))
    assert any(each.severity == severity and "a slower sensor, and zeros" in str(each) for each in findings)


@pytest.mark.parametrize("given", ["a.csv", None, 3, {}])
def test_what_is_no_trajectory_is_named(given):
    with pytest.raises(ValueError, match="trajectory must be a Trajectory"):
        check_recording(given)


@pytest.mark.parametrize("share", [0.4, 0.6, 0.9])
def test_a_gyroscope_that_fails_is_named(share):
    motion = simulate_hand("mixed", seed=1, duration=10.0)
    gyr = motion.measurements["imu/gyr"].copy()
    gyr[int((1.0 - share) * len(gyr)) :] = np.nan
    findings = check_recording(motion.replace(measurements={**motion.measurements, "imu/gyr": gyr}))
    assert any(f"{100 * share:.0f} % of the samples are missing" in str(each) for each in findings)


@pytest.mark.parametrize("kind", ["gyr", "acc", "mag"])
@pytest.mark.parametrize("value", [np.nan, 1e200, 0.0])
def test_channels_without_a_reading_are_named_once(motions, kind, value):
    dead = changed(motions["mixed"], **{kind: lambda values: np.full_like(values, value) * (1.0 + values[:1] ** 2)})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = warnings_of(dead)
        inspect_recording(dead)
    assert len(found) == 1
    assert found[0].startswith(f"imu/{kind}: ")


def test_unreadable_samples_are_named_and_left_out(motions):
    def damaged(values):
        number = np.arange(len(values))[:, None]
        return np.where(number % 200 == 7, 1e300 / (1.0 + number), values)

    (found,) = warnings_of(changed(motions["mixed"], gyr=damaged))
    assert "0.5 % of the samples reach 1.3e+299; likely cause: a damaged file" in found


def test_a_single_sample_is_named(motions):
    (found,) = warnings_of(motions["slow"][:1].replace(metadata={}))
    assert "a single sample; likely cause: a recording that was cut off" in found
