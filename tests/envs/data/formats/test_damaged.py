"""Whatever the bytes: a recording, or a ValueError that names the file."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import poise
from poise.envs.data.trajectory import Trajectory

from .examples import write_examples

FILES = ("wrist.txt", "thigh.csv", "gait.csv", "logger.csv", "phone/Gyroscope.csv", "phone/Accelerometer.csv")


@pytest.fixture(scope="module")
def examples(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("examples")
    write_examples(folder)
    for name in FILES:
        path = folder / name
        path.write_bytes(b"\n".join(path.read_bytes().split(b"\n")[:60]) + b"\n")
    arrays = {"t": np.arange(50) / 100.0, "gyr": np.ones((50, 3)), "acc": np.full((50, 3), 5.0)}
    np.savez(folder / "a.npz", **arrays)
    Trajectory(arrays["t"], {"imu/gyr": arrays["gyr"], "imu/acc": arrays["acc"]}).save(folder / "own.h5")
    return folder


def check(folder: Path, name: str, content: bytes) -> None:
    original = (folder / name).read_bytes()
    path, unnamed = folder / name, False
    try:
        path.write_bytes(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            recording = poise.load_recording(path.parent if name.startswith("phone") else path)
        assert len(recording) > 0
        for values in recording.measurements.values():
            assert not np.isinf(values).any()
    except ValueError as reason:
        unnamed = Path(name).parts[0] not in str(reason)
    finally:
        path.write_bytes(original)
    assert not unnamed


def damaged(content: bytes, draw: st.DataObject) -> bytes:
    """Bytes with something cut out, doubled, or replaced."""
    begin = draw.draw(st.integers(0, len(content)))
    end = draw.draw(st.integers(begin, min(len(content), begin + draw.draw(st.sampled_from([1, 5, 60, 5000])))))
    inserted = draw.draw(
        st.one_of(
            st.binary(max_size=8),
            st.sampled_from(
                [b"", b"\n", b",", b";;;;", b"NaN", b"inf", b"1e400", b"-", b"\t", b"\0", b'"', b"\xff\xfe"]
            ),
            st.just(content[begin:end] * 2),
        )
    )
    return content[:begin] + inserted + content[end:]


SETTINGS = {"deadline": None, "suppress_health_check": [HealthCheck.function_scoped_fixture], "derandomize": True}


@pytest.mark.parametrize("name", [*FILES, "a.npz", "own.h5"])
@settings(max_examples=15, **SETTINGS)
@given(draw=st.data())
def test_damaged_files(examples, name, draw):
    check(examples, name, damaged((examples / name).read_bytes(), draw))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*FILES, "a.npz", "own.h5"])
@settings(max_examples=700, **SETTINGS)
@given(draw=st.data())
def test_many_damaged_files(examples, name, draw):
    check(examples, name, damaged((examples / name).read_bytes(), draw))
