"""One IMU of a ride as a trajectory of its own: mounting, truth, filters; gaps of closed limbs from the truth."""

import numpy as np
import pytest

import poise
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.envs.bicycle.frame.parameters import MOUNTAIN_BIKE
from poise.envs.bicycle.rider.anthropometry import rider_body
from poise.envs.bicycle.rider.posture import loop_closure_error, sit
from poise.envs.bicycle.sensors.single_imu import SITES, imu_of
from poise.envs.bicycle.sensors.sites import BICYCLE_IMU_TILT, pitched
from poise.envs.bicycle.sensors.suites import IMUS
from poise.filters.core import rotation
from poise.filters.core.metrics import direction_error


def ridden(**options):
    env = RiderBicycleEnv(**{"suite": IMUS, "sensors": "ideal", "fidelity": "lumped", "duration": 4.0, **options})
    try:
        return poise.record(env, seed=3)
    finally:
        env.close()


@pytest.fixture(scope="module")
def ride():
    # means of velocities at the ends of an interval leave out what a road shakes in between
    return ridden(scenario="slalom", subject=2, surface="smooth", suite=(*IMUS, "head_imu/gyr", "head_imu/acc"))


@pytest.mark.parametrize("site", SITES)
def test_strapdown_from_noise_free_signals_returns_the_truth(ride, site):
    """Gyroscope, mounting and orientation belong together: integrated, one gives the other."""
    imu = imu_of(ride, site)
    orientation, dt = imu.truth["orientation"][0], imu.dt
    for tick in range(1, len(imu)):
        orientation = rotation.multiply(orientation, rotation.exp(imu.measurements["imu/gyr"][tick] * dt))
    lost = rotation.angle(rotation.multiply(rotation.conjugate(orientation), imu.truth["orientation"][-1]))
    assert np.degrees(lost) < 0.01


@pytest.mark.parametrize("site", SITES)
def test_accelerometer_and_position_belong_together(ride, site):
    """Specific force, turned into the world and less gravity, sums up to the velocity of the sensor's position."""
    imu = imu_of(ride, site)
    before, after = imu.truth["orientation"][:-1], imu.truth["orientation"][1:]
    after = after * np.sign(np.sum(before * after, axis=1, keepdims=True))
    middle = rotation.normalize(before + after)
    force = rotation.rotate(middle, imu.measurements["imu/acc"][1:])
    velocity = np.cumsum((force - [0.0, 0.0, 9.80665]) * imu.dt, axis=0)
    moved = np.diff(imu.truth["position"], axis=0)[1:] / imu.dt
    felt = 0.5 * (velocity[1:] + velocity[:-1])
    difference = moved - felt
    assert np.abs(difference - difference.mean(axis=0)).max() < 5e-3


def test_truth_is_that_of_the_mounted_sensor(ride):
    imu = imu_of(ride, "bicycle_imu")
    frame = ride.truth["bicycle/orientation"]
    back = rotation.multiply(imu.truth["orientation"], rotation.conjugate(np.array(pitched(BICYCLE_IMU_TILT))))
    np.testing.assert_allclose(back, frame, atol=1e-12)
    np.testing.assert_allclose(imu.truth["up"], rotation.up_in_body(imu.truth["orientation"]))
    np.testing.assert_allclose(
        np.linalg.norm(imu.truth["position"] - ride.truth["bicycle/position"], axis=1), 0.8006, atol=1e-3
    )
    assert np.abs(imu.truth["angular_rate"] - imu.measurements["imu/gyr"])[1:].max() < 0.2
    assert not imu.truth["gyroscope_bias"].any()
    assert imu.name.endswith("bicycle_imu")


def test_riding_slowly_and_straight_the_accelerometer_shows_the_mounting():
    imu = imu_of(ridden(scenario="slow", style="still", duration=2.0), "bicycle_imu")
    tilt = direction_error(
        np.nanmean(imu.measurements["imu/acc"], axis=0),
        np.array([np.sin(BICYCLE_IMU_TILT), 0.0, np.cos(BICYCLE_IMU_TILT)]),
    )
    assert np.degrees(tilt) < 0.5


def test_filters_run_on_it_and_files_keep_it(ride, tmp_path):
    names = ["bounded-motion", "mekf", "external-acceleration", "tilt"]
    table = poise.evaluate(names, [imu_of(ride, site) for site in SITES])
    assert set(table["estimator"]) == set(names)
    assert table["trajectory"].nunique() == len(SITES)
    assert table.loc[table["metric"] == "inclination", "value"].between(0.0, 20.0).all()
    loaded = imu_of(poise.load_recording(ride.save(tmp_path / "ride.h5")), "trunk_imu")
    np.testing.assert_array_equal(loaded.truth["orientation"], imu_of(ride, "trunk_imu").truth["orientation"])


def test_what_is_missing_is_named(ride):
    with pytest.raises(ValueError, match="site must be one of"):
        imu_of(ride, "thigh_left")
    channels = {name: values for name, values in ride.measurements.items() if name != "trunk_imu/acc"}
    half, anywhere, unknown = ride.replace(measurements=channels), ride.replace(metadata={}), ride.replace(truth={})
    with pytest.raises(ValueError, match=r"lacks the channels \['trunk_imu/acc'\]"):
        imu_of(half, "trunk_imu")
    with pytest.raises(ValueError, match="hold no mounting of"):
        imu_of(anywhere)
    with pytest.raises(ValueError, match="knows no 'bicycle/orientation'"):
        imu_of(unknown)


@pytest.mark.parametrize("fidelity", ["lumped", "full"])
def test_loop_closure_errors_from_the_truth_are_those_of_the_physics(fidelity):
    env = RiderBicycleEnv("outdoor", 4, suite=IMUS, fidelity=fidelity, duration=0.49)
    trajectory = poise.record(env, seed=1)
    gaps = loop_closure_error(trajectory.truth, sit(MOUNTAIN_BIKE, rider_body(4)))
    assert gaps.shape == (50, 4)
    assert gaps.max() < 1e-3
    # the only block of this short ride has just been computed: the world is in its last state
    np.testing.assert_allclose(gaps[-1], env.ride.rider.gaps(), atol=1e-9)
    env.close()
