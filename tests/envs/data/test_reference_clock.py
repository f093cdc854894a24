"""The clock of a reference against the gyroscope's, measured without an estimator."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.data.formats.load import find_recordings, load_recording
from poise.envs.data.reference_clock import clock_offset, measured
from poise.envs.data.resampling import running_product
from poise.envs.data.trajectory import REFERENCE_CLOCK, Trajectory
from poise.filters.core import rotation


def swinging(rate: float, offset: float, seconds: float = 30.0, bias: float = 0.0, noise: float = 0.0) -> Trajectory:
    """A body that swings about all axes, its reference ``offset`` s ahead; both from the same closed form."""
    fine = 20
    steps = int(seconds * rate) * fine
    time = np.arange(steps + 1) / (rate * fine)
    rng = np.random.default_rng(1)
    waves = [(rng.uniform(0.5, 2.0, 3), rng.uniform(0.3, 3.0, 3), rng.uniform(0.0, 6.0, 3)) for _ in range(4)]

    def rates(t: np.ndarray) -> np.ndarray:
        return sum(a * np.sin(2 * np.pi * f * t[:, None] + p) for a, f, p in waves)

    # Midpoint integration of the closed form on a fine grid is exact to 1e-7 here.
    turns = rotation.exp(rates(time[:-1] + 0.5 / (rate * fine)) / (rate * fine))
    q = running_product(np.concatenate([[[1.0, 0.0, 0.0, 0.0]], turns]))
    truth = q[::fine]
    step = rotation.log(rotation.multiply(rotation.conjugate(truth[:-1]), truth[1:])) * rate
    gyr = np.concatenate([step[:1], step]) + bias + noise * rng.standard_normal((len(truth), 3))
    ahead = round(offset * rate * fine)
    index = np.arange(len(truth)) * fine + ahead
    known = (index >= 0) & (index < len(q))
    reference = np.where(known[:, None], q[np.clip(index, 0, len(q) - 1)], np.nan)
    reference *= np.where(np.arange(len(truth)) % 2, -1.0, 1.0)[:, None]
    position = np.sin(time[::fine, None] * np.ones(3))
    return Trajectory(
        np.arange(len(truth)) / rate,
        {"imu/gyr": gyr, "imu/acc": np.tile([0.0, 0.0, 9.81], (len(truth), 1))},
        {"orientation": reference, "position": position},
        known,
        {"name": "swing", "true": truth.tolist()},
    )


@pytest.mark.parametrize("rate", [60.0, 100.0, 286.0])
@pytest.mark.parametrize("offset", [0.0, 0.0023, -0.004, 0.025, 0.2])
def test_the_offset_is_found_and_corrected(rate, offset):
    offset = round(offset * rate * 20) / (rate * 20)
    recording = measured(swinging(rate, offset, bias=0.05, noise=0.01))
    # Rates up to 3 Hz and interpolation on the great circle leave a few per cent of a sample.
    assert recording.metadata[REFERENCE_CLOCK] == pytest.approx(offset, abs=0.03 / rate)
    corrected = recording.reference_clock_corrected()
    assert REFERENCE_CLOCK not in corrected.metadata
    true = np.array(recording.metadata["true"])
    error = rotation.angle(rotation.multiply(rotation.conjugate(corrected.truth["orientation"]), true))
    before = rotation.angle(rotation.multiply(rotation.conjugate(recording.truth["orientation"]), true))
    assert np.sqrt(np.nanmean(error**2)) < max(0.2 * np.sqrt(np.nanmean(before**2)), 0.003)
    if abs(offset) > 0.5 / rate:
        assert np.isnan(corrected.truth["position"]).any(axis=1).sum() >= 1
    assert abs(measured(corrected).metadata[REFERENCE_CLOCK]) < 1e-4


def test_unknown_truth_stays_unknown_and_rest_tells_nothing():
    recording = swinging(100.0, 0.002)
    orientation = recording.truth["orientation"].copy()
    orientation[1000:1100] = np.nan
    holed = measured(recording.replace(truth={"orientation": orientation}))
    assert holed.metadata[REFERENCE_CLOCK] == pytest.approx(0.002, abs=3e-4)
    known = np.isfinite(holed.reference_clock_corrected().truth["orientation"]).all(axis=1)
    # The truth of the last sample lies beyond the end.
    np.testing.assert_array_equal(np.flatnonzero(~known), [*range(1000, 1100), len(known) - 1])
    rest = np.tile([1.0, 0.0, 0.0, 0.0], (2000, 1))
    noise = 0.01 * np.random.default_rng(0).standard_normal((2000, 3))
    assert clock_offset(rest, noise, 0.01) is None
    still = Trajectory(np.arange(2000) / 100, {"imu/gyr": noise, "imu/acc": noise}, {"orientation": rest})
    assert measured(still) is still
    assert still.reference_clock_corrected() is still


def test_broad_runs_ahead_by_its_published_clock(recordings_folder):
    """2.3 to 2.4 ms on average over the trials, by an independent computation; single trials scatter by 0.1 ms."""
    trials = [load_recording(path) for path in find_recordings(recordings_folder / "broad")]
    offsets = np.array([trial.metadata[REFERENCE_CLOCK] for trial in trials])
    assert offsets.mean() == pytest.approx(2.4e-3, abs=0.05e-3)
    assert np.ptp(offsets) < 0.2e-3
