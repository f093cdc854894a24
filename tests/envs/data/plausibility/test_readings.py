"""Readings of one channel that cannot be what a sensor measures: each kind is named, clean recordings are silent."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from poise.envs.data.plausibility.recording import check_recording
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand

KNOWN = simulate_hand("mixed", seed=11, duration=12.0)
GYR, ACC = (np.asarray(KNOWN.measurements[f"imu/{kind}"]) for kind in ("gyr", "acc"))


def with_axis(values: np.ndarray, axis: int, column: np.ndarray | float) -> np.ndarray:
    changed = values.copy()
    changed[:, axis] = column
    return changed


def held(values: np.ndarray) -> np.ndarray:
    changed = values.copy()
    changed[400:600] = changed[400]
    return changed


def zeroed(values: np.ndarray) -> np.ndarray:
    return np.where((np.arange(len(values)) >= 400)[:, None] & (np.arange(len(values)) < 600)[:, None], 0.0, values)


def wrapped(values: np.ndarray, limit: float) -> np.ndarray:
    return (values + limit) % (2.0 * limit) - limit


def unsigned(values: np.ndarray, limit: float = 35.0) -> np.ndarray:
    return np.where(values < 0.0, values + 2.0 * limit, values)


def recording(**channels: np.ndarray) -> Trajectory:
    return KNOWN.replace(measurements=KNOWN.measurements | {f"imu/{kind}": v for kind, v in channels.items()}, truth={})


@pytest.mark.parametrize(
    ("made", "channel", "words"),
    [
        (lambda: recording(gyr=with_axis(GYR, 1, 0.0)), "imu/gyr", "axis y is always 0"),
        (lambda: recording(acc=with_axis(ACC, 2, 9.81)), "imu/acc", "axis z is always 9.81"),
        (lambda: recording(acc=with_axis(ACC, 1, ACC[:, 0])), "imu/acc", "axes x and y are the same"),
        (lambda: recording(gyr=held(GYR), acc=held(ACC)), "imu/gyr", "again and again, for 2.0 s from sample 400"),
        (lambda: recording(gyr=zeroed(GYR)), "imu/gyr", "0, 0, 0 for 2.0 s from sample 400; likely cause: drop-outs"),
        (lambda: recording(acc=KNOWN.measurements["imu/gyr"]), "imu/acc", "the same samples as imu/gyr"),
        (
            lambda: recording(mag=1e-12 * GYR),
            "imu/mag",
            "100 % of the samples are 0, 0, 0 or nearly; likely cause: a sens",
        ),
        (lambda: recording(gyr=wrapped(GYR, 1.0)), "imu/gyr", "overflow"),
        (lambda: recording(gyr=np.clip(GYR, -1.0, 1.0)), "imu/gyr", "saturation"),
        (lambda: recording(gyr=unsigned(GYR)), "imu/gyr", "x, y, z lie near 0 and near 70, none between"),
        (lambda: recording(acc=unsigned(ACC)), "imu/acc", "read as unsigned"),
        (lambda: recording(acc=9.81 * ACC / np.linalg.norm(ACC, axis=1, keepdims=True)), "imu/acc", "length one"),
        (lambda: recording(acc=0.8 * ACC), "imu/acc", "scale error"),
        (lambda: recording(gyr=np.radians(GYR)), "imu/gyr", "once too often"),
        (lambda: recording(gyr=1e-4 * np.random.default_rng(0).standard_normal(GYR.shape)), "imu/gyr", "leans by"),
    ],
)
def test_each_kind_is_named(made: Callable[[], Trajectory], channel: str, words: str) -> None:
    told = [str(each) for each in check_recording(made()) if each.channel == channel and each.severity == "warning"]
    assert any(words in text for text in told), told


def test_codes_within_the_range_of_a_sensor_are_no_fault_of_another() -> None:
    coded = ACC.copy()
    coded[7::50] = -999.0
    (finding,) = check_recording(recording(acc=coded))
    assert (finding.severity, finding.channel) == ("note", "imu/acc")
    assert finding.what.startswith(f"{len(coded[7::50])} samples stand alone")


@pytest.mark.parametrize("times", [2, 4])
def test_a_table_that_is_faster_than_its_sensor_is_told(times: int) -> None:
    findings = check_recording(recording(gyr=np.repeat(GYR[::times], times, axis=0)[: len(GYR)]))
    assert any(f"stands {times} times: the sensor runs at {100 / times:g} Hz" in each.what for each in findings)


def test_codes_for_no_value_do_not_hide_what_is_right() -> None:
    coded = GYR.copy()
    coded[::40] = -9999.0
    findings = check_recording(recording(gyr=coded))
    assert [each.severity for each in findings] == ["note"], findings
    assert "9999" in findings[0].what


@pytest.mark.parametrize("gesture", ["slow", "severe", "carried-walking", "shaking"])
def test_clean_recordings_are_silent(gesture: str) -> None:
    assert check_recording(simulate_hand(gesture, seed=2, duration=20.0)) == []
