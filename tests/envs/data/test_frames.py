"""Tables of trajectories."""

import numpy as np
from scipy.spatial.transform import Rotation

import poise
from poise.envs.hand.sensing import simulate_hand


def test_every_channel_and_truth_is_a_column():
    motion = simulate_hand("mixed", seed=4, duration=4.0)
    frame = motion.to_frame()
    assert len(frame) == len(motion)
    np.testing.assert_array_equal(frame["time"], motion.time)
    np.testing.assert_array_equal(frame["imu/gyr_y"], motion.measurements["imu/gyr"][:, 1])
    np.testing.assert_array_equal(frame["true_position_x"], motion.truth["position"][:, 0])
    np.testing.assert_array_equal(frame["mask"], motion.mask)
    angles = Rotation.from_quat(frame[["true_qx", "true_qy", "true_qz", "true_qw"]].to_numpy(copy=True))
    expected = angles.as_euler("ZYX", degrees=True)
    np.testing.assert_allclose(frame[["true_yaw", "true_pitch", "true_roll"]], expected, atol=1e-7)
    assert frame.attrs["units"]["true_roll"] == "deg"
    assert set(frame.attrs["units"]) == set(frame.columns)


def test_a_table_of_one_axis_and_of_orientations():
    time = np.arange(3) / 10.0
    channels = {"wheel/speed": np.ones((3, 1)), "imu/onboard_orientation": np.tile([1.0, 0, 0, 0], (3, 1))}
    frame = poise.Trajectory(time, channels, metadata={"units": {"wheel/speed": "m/s"}}).to_frame()
    assert list(frame) == ["time", "wheel/speed", *(f"imu/onboard_orientation_q{part}" for part in "wxyz"), "mask"]
    assert frame.attrs["units"]["wheel/speed"] == "m/s"
