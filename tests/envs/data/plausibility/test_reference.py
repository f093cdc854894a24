"""A reference on another clock, in other axes, slower than the recording, or that jumps: each kind is named."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

import poise
from poise.envs.data.plausibility.recording import check_recording
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core import rotation

MOTIONS = {gesture: simulate_hand(gesture, seed, duration=30.0) for gesture, seed in (("mixed", 5), ("slow", 8))}


def about(axis: tuple[float, float, float], degrees: float) -> np.ndarray:
    return np.asarray(rotation.exp(np.radians(degrees) * np.array(axis)))


def in_body(axis: tuple[float, float, float], degrees: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda q: np.asarray(rotation.multiply(q, about(axis, degrees)))


def late(samples: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda q: np.roll(q, samples, axis=0)


def wrong(rows: slice, value: tuple[float, ...]) -> Callable[[np.ndarray], np.ndarray]:
    def changed(q: np.ndarray) -> np.ndarray:
        q[rows] = value
        return q

    return changed


def told(gesture: str, change: Callable[[np.ndarray], np.ndarray], ends: int = 100) -> list[str]:
    known = MOTIONS[gesture]
    q = change(np.array(known.truth["orientation"]))
    trajectory: Trajectory = known.replace(truth={"orientation": q})[ends:-ends]
    return [f"{each.severity}: {each.what}" for each in check_recording(trajectory) if each.channel == "orientation"]


@pytest.mark.parametrize("gesture", list(MOTIONS))
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (late(5), "behind the gyroscope"),
        (late(15), "behind the gyroscope"),
        (late(-30), "ahead of the gyroscope"),
        (late(45), "behind the gyroscope"),
        (in_body((1.0, 0.0, 0.0), 8.0), "its axes are turned by 8° against the sensor's"),
        (in_body((0.6, 0.8, 0.0), -5.0), "its axes are turned by 5°"),
        (in_body((0.0, 0.0, 1.0), 30.0), "its axes are turned by 30°"),
        (lambda q: rotation.multiply(about((1.0, 0.0, 0.0), 8.0), q), "its vertical leans by 8°"),
        (lambda q: q[np.arange(len(q)) // 10 * 10], "every orientation stands 10 times: the reference runs at 10 Hz"),
        (lambda q: q[np.arange(len(q)) // 5 * 5], "every orientation stands 5 times: the reference runs at 20 Hz"),
        (wrong(slice(1200, 1230), (1.0, 0.0, 0.0, 0.0)), "jumps of up to"),
        (wrong(slice(1200, 1201), (0.6, 0.0, 0.8, 0.0)), "2 jumps of up to"),
    ],
)
def test_each_kind_is_named(gesture: str, change: Callable[[np.ndarray], np.ndarray], words: str) -> None:
    if gesture == "slow" and words.startswith("jumps"):
        words = "1 jump of up to 34°"
    found = told(gesture, change)
    assert len(found) == 1, found
    assert found[0].startswith("warning")
    assert words in found[0]


@pytest.mark.parametrize("gesture", list(MOTIONS))
@pytest.mark.parametrize("samples", [80, 150, 300, 500, -100, -450])
def test_seconds_are_found(gesture: str, samples: int) -> None:
    (found,) = told(gesture, late(samples), 500)
    side = "behind" if samples > 0 else "ahead of"
    offset = re.search(rf"the reference is ([\d.]+) ms {side} the gyroscope", found)
    assert offset is not None
    assert float(offset[1]) == pytest.approx(10.0 * abs(samples), abs=2.0)


def fast(share: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda q: q[np.rint(np.arange(100, len(q) - 100) * (1.0 + share)).astype(int).clip(0, len(q) - 1)]


@pytest.mark.parametrize(
    ("gesture", "share"), [("mixed", 0.001), ("mixed", -0.0015), ("mixed", 0.002), ("slow", 0.001)]
)
def test_a_clock_that_drifts(gesture: str, share: float) -> None:
    known = MOTIONS[gesture][100:-100]
    truth = {"orientation": fast(share)(np.array(MOTIONS[gesture].truth["orientation"]))}
    found = [each.what + each.cause for each in check_recording(known.replace(truth=truth))]
    assert any(
        re.search(rf"a clock that runs about 0\.\d+ % {'fast' if share > 0 else 'slow'}", each) for each in found
    )


@pytest.mark.parametrize("gesture", list(MOTIONS))
@pytest.mark.parametrize("speed", [1.5, -2.0])
def test_a_heading_that_drifts(gesture: str, speed: float) -> None:
    def change(q: np.ndarray) -> np.ndarray:
        angle = np.radians(speed) * 0.01 * np.arange(len(q))
        return np.asarray(rotation.multiply(rotation.exp(angle[:, None] * [0.0, 0.0, 1.0]), q))

    (found,) = told(gesture, change)
    turning = re.search(r"it turns about the vertical by (-?[\d.]+) °/s", found)
    assert turning is not None
    assert float(turning[1]) == pytest.approx(speed, abs=0.2)


def test_a_reference_whose_samples_are_never_near_each_other_is_left_alone() -> None:
    known = simulate_hand("slow", 9, duration=60.0)
    truth = np.where((np.arange(len(known)) % 10 == 0)[:, None], known.truth["orientation"], np.nan)
    assert np.isfinite(truth).all(axis=1).sum() > 500
    assert [
        each for each in check_recording(known.replace(truth={"orientation": truth})) if each.channel != "time"
    ] == []


def test_two_kinds_are_told_apart() -> None:
    clock, axes = told("mixed", lambda q: np.roll(rotation.multiply(q, about((0.6, 0.0, 0.8), 20.0)), 10, axis=0))
    assert "100.0 ms behind" in clock
    assert "turned by 20°" in axes


@pytest.mark.parametrize("gesture", list(MOTIONS))
@pytest.mark.parametrize("samples", [0, 30, 80, -150])
@pytest.mark.parametrize(
    ("change", "cause"), [(rotation.conjugate, "conjugate quaternions"), (rotation.to_xyzw, "whose scalar is the last")]
)
def test_how_quaternions_are_read_shows_whatever_their_clock(
    gesture: str, samples: int, change: Callable[[np.ndarray], np.ndarray], cause: str
) -> None:
    known = MOTIONS[gesture]
    q = np.roll(change(np.array(known.truth["orientation"])), samples, axis=0)
    trajectory = known.replace(truth={"orientation": q})[200:-200]
    found = next(str(one) for one in check_recording(trajectory) if "the other way round" in one.what)
    assert cause in found
    assert (f"and moved by {-0.01 * samples:+.2f} s" in found) == (samples != 0)


def test_jumps_do_not_hide_the_axes() -> None:
    def change(q: np.ndarray) -> np.ndarray:
        return wrong(slice(1200, 1230), (1.0, 0.0, 0.0, 0.0))(in_body((1.0, 0.0, 0.0), 9.0)(q))

    axes, jumps = told("mixed", change)
    assert "its axes are turned by 9°" in axes
    assert "2 jumps of up to" in jumps


@pytest.mark.parametrize("gesture", list(MOTIONS))
@pytest.mark.parametrize(
    "change",
    [
        lambda q: q,
        lambda q: -q,
        lambda q: q * np.where(np.arange(len(q)) % 3, 1.0, -1.0)[:, None],
        lambda q: rotation.multiply(about((0.0, 0.0, 1.0), 40.0), q),
        lambda q: np.where((np.arange(len(q)) % 10 == 0)[:, None], q, np.nan),
        lambda q: np.where((np.arange(len(q)) > 1500)[:, None], q, np.nan),
    ],
)
def test_sound_references_are_silent(gesture: str, change: Callable[[np.ndarray], np.ndarray]) -> None:
    assert told(gesture, change) == []


def test_a_table_of_errors_warns_of_them() -> None:
    known = MOTIONS["mixed"]
    truth = {"orientation": in_body((1.0, 0.0, 0.0), 8.0)(np.array(known.truth["orientation"]))}
    with pytest.warns(UserWarning, match="its axes are turned by 8°"):
        poise.evaluate("tilt", known.replace(truth=truth))


@pytest.mark.parametrize("gesture", ["mixed", "severe"])
def test_a_reference_that_rests_beside_a_biased_gyroscope_is_not_frozen(gesture: str) -> None:
    motion = simulate_hand(gesture, 1, sensors="bosch-bmi160", duration=30.0)
    assert not [each for each in check_recording(motion) if each.channel == "orientation"]
