"""Trials of BROAD, in all containers in which they are published."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from poise.envs.data.formats.broad import group_of
from poise.envs.data.formats.load import load_recording
from poise.filters.core import rotation

N = 40


def broad_fields() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    quat = rotation.random(rng, (N,))
    quat[7] = np.nan
    return {
        "imu_gyr": rng.standard_normal((N, 3)),
        "imu_acc": rng.standard_normal((N, 3)),
        "imu_mag": rng.standard_normal((N, 3)),
        "opt_quat": quat,
        "opt_pos": rng.standard_normal((N, 3)),
        "movement": (np.arange(N) >= 5).astype(np.uint8)[:, None],
        "sampling_rate": np.array([[2000 / 7]]),
    }


def write_mat5(path: Path, fields: dict[str, Any]) -> None:
    scipy.io.savemat(path, fields, do_compression=True)


def write_hdf5(path: Path, fields: dict[str, Any]) -> None:
    with h5py.File(path, "w") as file:
        for name, values in fields.items():
            file[name] = values[:, 0] if name == "movement" else values


def write_mat73(path: Path, fields: dict[str, Any]) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in fields.items():
            file[name] = values.T
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


WRITERS = {"mat5": write_mat5, "hdf5": write_hdf5, "mat73": write_mat73}


@pytest.mark.parametrize("kind", WRITERS)
def test_broad_is_read_whatever_the_container_and_extension(tmp_path, kind):
    path, fields = tmp_path / "06_undisturbed_fast_rotation_A.dat", broad_fields()
    # scipy would append its own extension.
    WRITERS[kind](tmp_path / "x.mat", fields)
    (tmp_path / "x.mat").rename(path)
    trial = load_recording(path)
    assert len(trial) == N
    assert 1 / trial.dt == pytest.approx(2000 / 7)
    for name, channel in {"imu_gyr": "imu/gyr", "imu_acc": "imu/acc", "imu_mag": "imu/mag"}.items():
        np.testing.assert_allclose(trial.measurements[channel], fields[name])
    np.testing.assert_allclose(trial.truth["orientation"], fields["opt_quat"])
    np.testing.assert_allclose(trial.truth["position"], fields["opt_pos"])
    assert np.isnan(trial.truth_of("up")[7]).all()
    np.testing.assert_array_equal(trial.mask, (np.arange(N) >= 5) & (np.arange(N) != 7))
    assert trial.metadata["group"] == "fast rotation"
    assert trial.metadata["licence"] == "CC BY 4.0"


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"opt_quat": None}, r"missing are \['opt_quat'\]"),
        ({"imu_acc": np.zeros((N - 1, 3))}, "equally long"),
        ({"imu_acc": np.zeros((N, 2))}, r"imu_acc must be a real array of shape \(T, 3\).*\(40, 2\)"),
        ({"opt_quat": 2.0 * np.ones((N, 4))}, "unit quaternions"),
        ({"sampling_rate": np.array([[0.0]])}, "sampling_rate must be one positive"),
        ({"imu_gyr": np.full((N, 3), np.inf)}, "infinite at sample 0"),
    ],
)
def test_wrong_broad_fields_are_named(tmp_path, kind, changes, message):
    fields = {name: value for name, value in (broad_fields() | changes).items() if value is not None}
    path = tmp_path / "trial.mat"
    WRITERS[kind](path, fields)
    with pytest.raises(ValueError, match=message) as caught:
        load_recording(path)
    assert "trial.mat" in str(caught.value)


def test_a_broad_trial_without_samples_is_refused(tmp_path):
    fields = {name: values if name == "sampling_rate" else values[:0] for name, values in broad_fields().items()}
    write_hdf5(tmp_path / "empty.hdf5", fields)
    with pytest.raises(ValueError, match="no samples"):
        load_recording(tmp_path / "empty.hdf5")


def test_groups_follow_from_the_names_of_trials():
    assert group_of("02_undisturbed_slow_rotation_B") == "slow rotation"
    assert group_of("18_undisturbed_fast_translation_with_breaks_B") == "fast translation"
    assert group_of("21_undisturbed_fast_combined") == "fast combined"
    assert group_of("32_disturbed_attached_magnet_1cm") == "disturbed"
    assert group_of("my own") is None
