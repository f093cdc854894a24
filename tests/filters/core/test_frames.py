"""Tables of estimates: angles, quaternions, standard deviations, units."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import poise
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.model import Model, equations_of

DECLARED = ("mekf", "mekf-9", "bounded-motion", "bounded-motion-9", "external-acceleration")


@pytest.fixture(scope="module")
def motion():
    return simulate_hand("mixed", seed=4, duration=8.0)


@pytest.mark.parametrize("name", ["mekf-9", "bounded-motion", "vqf", "marins"])
def test_angles_and_quaternions_are_those_of_scipy(motion, name):
    estimate = poise.run(name, motion)
    frame = estimate.to_frame()
    assert len(frame) == len(motion)
    np.testing.assert_array_equal(frame["time"], motion.time)
    known = frame["qw"].notna().to_numpy()
    turns = Rotation.from_quat(frame.loc[known, ["qx", "qy", "qz", "qw"]].to_numpy(copy=True))
    angles = turns.as_euler("ZYX", degrees=True)
    difference = frame.loc[known, ["yaw", "pitch", "roll"]].to_numpy() - angles
    np.testing.assert_allclose((difference + 180.0) % 360.0 - 180.0, 0.0, atol=1e-6)
    assert set(frame.attrs["units"]) == set(frame.columns)


def test_without_heading_there_is_no_yaw(motion):
    frame = poise.run("external-acceleration", motion).to_frame()
    assert {"roll", "pitch", "up_x", "external_acceleration_z", "std_roll"} <= set(frame.columns)
    assert not {"yaw", "qw", "std_yaw"} & set(frame.columns)


@pytest.mark.parametrize("name", DECLARED)
def test_declared_parts_of_the_error_move_the_pose_as_declared(motion, name):
    """A small error of each part, put into the state by the model's own retraction, is what the table says it is."""
    model = equations_of(poise.make_estimator(name, dt=motion.dt))
    assert isinstance(model, Model)
    z = {channel.name: motion.measurements[channel.name][0] for channel in model.channels}
    x, _ = model.prior(z)
    for quantity, (start, stop) in model.error_parts.items():
        shown = "orientation" if quantity == "relative_orientation" and "orientation" in model.pose(x) else quantity
        for axis in range(stop - start):
            dx = np.zeros(model.error_size)
            dx[start + axis] = 1e-6
            before, after = model.pose(x)[shown], model.pose(model.retract(x, dx))[shown]
            if "orientation" in shown:
                q = [Rotation.from_quat(value[[1, 2, 3, 0]]) for value in (before, after)]
                moved = (q[1] * q[0].inv()).as_rotvec()
            else:
                moved = after - before
            np.testing.assert_allclose(moved, 1e-6 * np.eye(3)[axis], atol=1e-11)


def test_standard_deviations_are_those_of_sampled_errors(motion):
    """Attitudes drawn from the covariance spread as the columns say."""
    estimate = poise.run("mekf-9", motion)
    frame, t = estimate.to_frame(), 500
    generator = np.random.default_rng(0)
    errors = generator.multivariate_normal(np.zeros(3), 1e-4 * estimate.covariance[t, :3, :3], 200_000)
    q = estimate.pose["orientation"][t, [1, 2, 3, 0]]
    yaw, pitch, roll = (Rotation.from_rotvec(errors) * Rotation.from_quat(q)).as_euler("ZYX", degrees=True).T
    for name, samples in (("roll", roll), ("pitch", pitch), ("yaw", yaw)):
        assert 100.0 * samples.std() == pytest.approx(frame[f"std_{name}"][t], rel=0.02)
    bias = np.sqrt(estimate.covariance[t, 4, 4])
    assert frame["std_gyroscope_bias_y"][t] == pytest.approx(bias, rel=1e-12)


def test_angles_of_joints_are_in_degrees():
    from poise.filters.core.quantity import Estimate, Layout, Quantity

    angles = Quantity("knee/flexion", "angle", 1, "rad"), Quantity("hip/angles", "angle", 3, "rad")
    pose = {"knee/flexion": np.full((4, 1), 0.5), "hip/angles": np.full((4, 3), -0.25)}
    frame = Estimate(pose, layout=Layout(angles, {})).to_frame()
    np.testing.assert_allclose(frame["knee/flexion"], np.degrees(0.5))
    np.testing.assert_allclose(frame["hip/angles_2"], np.degrees(-0.25))
    assert frame.attrs["units"]["hip/angles_1"] == "deg"
    assert list(frame["time"]) == [0, 1, 2, 3]


def test_batches_and_single_samples_are_refused(motion):
    measurements = {name: values[:, None] for name, values in motion.measurements.items()}
    with pytest.raises(ValueError, match="one sequence"):
        poise.run("mekf", measurements, dt=motion.dt).to_frame()
    estimator = poise.make_estimator("mekf")
    first = {name: values[0] for name, values in motion.measurements.items()}
    with pytest.raises(ValueError, match="one sequence"):
        estimator.step(estimator.init(first), first)[1].to_frame()


def test_a_filter_run_by_itself_has_a_table_too(motion):
    model = equations_of(poise.make_estimator("mekf", dt=motion.dt))
    frame = KalmanFilter(model).run(motion.measurements).to_frame()
    assert {"roll", "pitch", "yaw", "up_x"} <= set(frame.columns)


def test_an_estimate_is_one_line():
    from poise.filters.core.quantity import Estimate

    up = np.zeros((3001, 3))
    assert repr(Estimate({"up": up})) == "Estimate(shape (3001,), up; with no covariance)"
    whole = Estimate({"up": up[0], "bias": up[0]}, covariance=np.eye(3), nis=up[0, 0])
    assert repr(whole) == "Estimate(shape (), up, bias; with covariance, nis)"
