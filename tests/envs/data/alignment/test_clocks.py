"""Clocks of devices that move together."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.envs.data.alignment.clocks import align_clocks, merged
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.sensing import simulate_hand

MOTION = simulate_hand("mixed", seed=0, duration=90.0)
TURN = Rotation.from_euler("zyx", [70.0, -40.0, 110.0], degrees=True)


def other_device(offset: float, drift: float, rate: float = 62.5, noise: float = 0.01) -> Trajectory:
    """The same motion seen by a device with other axes, rate, clock and noise."""
    part = MOTION[500:].resampled(rate)
    gyr = TURN.apply(np.array(part.measurements["imu/gyr"])) + np.random.default_rng(1).normal(
        0.0, noise, (len(part), 3)
    )
    gyr[200:230] = np.nan
    # time of the reference = offset + (1 + drift) · own time
    return Trajectory((part.time - offset) / (1.0 + drift), {"imu/gyr": gyr}, {}, metadata={"name": "other"})


@pytest.mark.parametrize(("offset", "drift"), [(3.217, 0.0), (-1.5, 60e-6), (12.0, -200e-6)])
def test_offset_and_drift_are_found(offset: float, drift: float) -> None:
    """Within 2 ms over the whole recording, an eighth of the slower device's interval."""
    device = other_device(offset, drift)
    found = align_clocks(device, MOTION)
    error = (found.offset - offset) + (found.drift - drift) * device.time
    assert np.abs(error).max() < 2e-3
    assert found.drift == pytest.approx(drift, abs=30e-6)
    assert found.correlation > 0.95


def test_merged_devices_agree_in_their_common_time() -> None:
    device = other_device(3.217, 0.0, rate=100.0, noise=0.0)
    both = merged({"hand": MOTION, "other": align_clocks(device, MOTION).apply(device)})
    assert set(both.measurements) >= {"hand/gyr", "hand/acc", "other/gyr"}
    hand, other = (both.measurements[f"{site}/gyr"] for site in ("hand", "other"))
    seen = np.isfinite(other).all(axis=1)
    difference = TURN.inv().apply(np.array(other[seen])) - hand[seen]
    assert np.sqrt(np.mean(difference**2)) < 0.05 * np.sqrt(np.mean(hand**2))


def test_devices_that_do_not_move_together() -> None:
    stranger = simulate_hand("mixed", seed=9, duration=60.0)
    with pytest.raises(ValueError, match="do not turn alike"):
        align_clocks(stranger, MOTION)


def test_bad_input() -> None:
    with pytest.raises(ValueError, match="no channel trunk/gyr; gyroscopes there: imu/gyr"):
        align_clocks(MOTION, MOTION, site="trunk")
    with pytest.raises(ValueError, match="must last 2 s"):
        align_clocks(MOTION[:50], MOTION)
    with pytest.raises(ValueError, match="two devices"):
        merged({"hand": MOTION})
    late = MOTION.replace(time=MOTION.time + 1000.0)
    with pytest.raises(ValueError, match="share no time"):
        merged({"hand": MOTION, "late": late})
