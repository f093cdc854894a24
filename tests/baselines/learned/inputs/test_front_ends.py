"""Front ends: stepping is running, cards describe them, and drop-outs do not spoil them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from poise.baselines.learned.head import AngleHead
from poise.baselines.learned.inputs.filter_bank import FilterBank
from poise.baselines.learned.inputs.filter_features import FilterFeatures, standardisation
from poise.baselines.learned.inputs.front_end import FrontEnd, RawChannels, Seen, interval_ends
from poise.baselines.learned.inputs.heading_bank import HeadingBank
from poise.baselines.learned.inputs.level_frame import LevelFrame
from poise.envs.hand.sensing import simulate_hand
from poise.filters.bicycle.geometry import GEOMETRY_STD, RiderGeometry
from poise.filters.core import rotation
from poise.filters.core.estimator import run_by_steps
from poise.filters.core.metrics import heading_error
from poise.filters.core.model import equations_of
from poise.filters.core.quantity import ACCELEROMETER, GYROSCOPE, Estimate, Measurement
from poise.filters.registry import make

RATE = 137.0
PAIR = ("process", "velocity")
"""Gains of the bank."""
ENDS: dict[str, FrontEnd] = {
    "raw": RawChannels((GYROSCOPE, ACCELEROMETER), (3.0, 10.0)),
    "level": LevelFrame(),
    "level of a filter": LevelFrame(make("bounded-motion")),
    "bank": FilterBank(LevelFrame(make("bounded-motion")), ((0.3, 1.0), (1.0, 4.0)), PAIR),
    "headings": HeadingBank(LevelFrame(make("mekf-9")), ((1.0, 0.3), (0.5, 30.0))),
    "filter": FilterFeatures(make("mekf")),
}


@pytest.fixture(scope="module")
def samples() -> dict[str, np.ndarray]:
    motion = simulate_hand("fast", seed=1, duration=4.0, rate=RATE)
    found = {name: motion.measurements[name][:300].copy() for name in ("imu/gyr", "imu/acc")}
    found["imu/mag"] = np.asarray(rotation.rotate_back(motion.truth["orientation"][:300], np.array([2.0, 20.0, -45.0])))
    found["imu/mag"][150:200] += [0.0, 8.0, 0.0]
    found["imu/mag"][::2] = np.nan
    found["imu/mag"][0] = found["imu/mag"][1]
    found["imu/acc"][:3] = np.nan
    found["imu/acc"][100:140] = np.nan
    found["imu/gyr"][200:205] = np.nan
    return found


def seen_by_steps(front_end: FrontEnd, measurements: Mapping[str, Any]) -> Seen:
    """A front end run sample by sample, the reference of every faster ``run``."""

    class Stepped:
        channels, outputs, dt = front_end.channels, (), front_end.dt

        def init(self, measurement: Measurement) -> Any:
            return front_end.init(measurement)

        def step(self, state: Any, measurement: Measurement) -> tuple[Any, Estimate]:
            state, seen = front_end.step(state, measurement)
            base = {f"base {name}": values for name, values in seen.base.items()}
            return state, Estimate({"features": seen.features, "due": seen.due, "spread": seen.spread, **base})

    pose = run_by_steps(Stepped(), measurements).pose  # type: ignore[arg-type]
    base = {name.removeprefix("base "): values for name, values in pose.items() if name.startswith("base ")}
    return Seen(pose["features"], pose["due"], base, pose["spread"])


@pytest.mark.parametrize("name", ENDS)
def test_stepping_is_running(name: str, samples: dict[str, np.ndarray]) -> None:
    end = ENDS[name].with_dt(1.0 / RATE)
    whole, stepped = end.run(samples), seen_by_steps(end, samples)
    assert whole.features.shape == (300, end.size)
    assert whole.due.sum() == pytest.approx(300 / RATE / end.interval, abs=1.1)
    at = whole.due == 1.0
    np.testing.assert_array_equal(whole.due, stepped.due)
    np.testing.assert_allclose(whole.features[at], stepped.features[at], atol=1e-12)
    np.testing.assert_allclose(whole.spread, stepped.spread, atol=1e-12)
    for key, values in whole.base.items():
        np.testing.assert_allclose(values, stepped.base[key], atol=1e-12)
    assert np.isfinite(whole.features[at][1:]).all()


@pytest.mark.parametrize("name", ENDS)
def test_a_batch_is_its_members(name: str, samples: dict[str, np.ndarray]) -> None:
    end = ENDS[name].with_dt(1.0 / RATE)
    other = {key: np.roll(values, 1, axis=-1) for key, values in samples.items()}
    both = end.run({key: np.stack([samples[key], other[key]], axis=1) for key in samples})
    for index, alone in enumerate((samples, other)):
        one = end.run(alone)
        at = one.due == 1.0
        np.testing.assert_allclose(both.features[:, index][at], one.features[at], atol=1e-9)


@pytest.mark.parametrize("name", ENDS)
def test_a_card_describes_it(name: str, samples: dict[str, np.ndarray]) -> None:
    end = ENDS[name]
    again = type(end).read(json.loads(json.dumps(end.describe())), 1.0 / RATE)  # type: ignore[attr-defined]
    np.testing.assert_array_equal(again.run(samples).features, end.with_dt(1.0 / RATE).run(samples).features)


def test_candidates_are_the_filter_with_other_constants(samples: dict[str, np.ndarray]) -> None:
    """Each candidate is what a filter made with these constants finds, in the level frame of the published one."""
    dt = 1.0 / RATE
    usual = make("bounded-motion", dt=dt)
    seen = FilterBank(LevelFrame(usual), ((0.3, 1.0), (1.0, 4.0)), PAIR).run(samples)
    model: Any = equations_of(usual)
    for index, changed in enumerate(
        ({"gyroscope_noise": 0.3 * model.gyroscope_noise}, {"velocity_bound": 4.0 * model.velocity_bound})
    ):
        up = make("bounded-motion", dt=dt, **changed).run(samples).pose["up"]
        tilt = rotation.rotate(seen.base["relative_orientation"], up)[10:, :2]
        found = seen.spread[10:, 1 + 2 * index : 3 + 2 * index]
        np.testing.assert_allclose(found, tilt, atol=1e-12)
        assert np.abs(found).max() > 5e-5


def test_a_bank_does_not_see_the_heading(samples: dict[str, np.ndarray]) -> None:
    """The start of the level frame's heading is arbitrary: turned vectors give the same features."""
    bank = ENDS["bank"].with_dt(1.0 / RATE)
    assert isinstance(bank, FilterBank)
    seen = bank.level.run(samples)
    up = bank._others.run(
        bank._repeated(samples), {k: np.broadcast_to(f, (300, 2)) for k, f in bank._factors().items()}
    )
    turn = np.array([np.cos(0.4), 0.0, 0.0, np.sin(0.4)])
    vectors = rotation.rotate(turn, seen.features[:, :18].reshape(-1, 6, 3)).reshape(-1, 18)
    base = {"relative_orientation": rotation.multiply(turn, seen.base["relative_orientation"])}
    turned = seen._replace(features=np.concatenate([vectors, seen.features[:, 18:]], axis=1), base=base)
    one, other = (bank._seen(each, up) for each in (seen, turned))
    np.testing.assert_allclose(one.features, other.features, atol=1e-9)
    assert np.abs(one.spread[10:, 1:] - other.spread[10:, 1:]).max() > 1e-6


def test_headings_are_told_apart_by_the_field_alone(samples: dict[str, np.ndarray]) -> None:
    """A world turned by its field gives the same features; candidates are the filter with other constants."""
    bank, dt = ENDS["headings"].with_dt(1.0 / RATE), 1.0 / RATE
    assert isinstance(bank, HeadingBank)
    kalman: Any = make("mekf-9")
    seen = bank.run(samples)
    usual: Any = equations_of(kalman)
    changed = make("mekf-9", dt=dt, magnetometer_noise=0.3 * usual.magnetometer_noise).run(samples)
    apart = heading_error(changed.pose["orientation"], seen.base["relative_orientation"])
    np.testing.assert_allclose(np.abs(seen.spread[10:, 1]), apart[10:], atol=1e-9)
    assert np.degrees(apart[10:].max()) > 1.0
    model = replace(usual, declination=1.0)
    turned = HeadingBank(LevelFrame(replace(kalman, model=model)), bank.tunings).with_dt(dt).run(samples)
    np.testing.assert_allclose(turned.features[20:], seen.features[20:], atol=1e-6)
    of_field = seen.features[seen.due == 1.0][:, 17:21]
    assert np.abs(of_field[27:35, :2]).max() > 5.0 * np.abs(of_field[10:25, :2]).max()


def test_filters_are_described_by_what_differs() -> None:
    end = LevelFrame(make("bounded-motion", velocity_bound=0.4))
    assert end.describe()["filter"] == {"name": "bounded-motion", "parameters": {"velocity_bound": 0.4}}


def test_a_network_sees_how_exactly_a_rider_was_measured() -> None:
    plain = FilterFeatures(make("whole-body-consistent"))
    end = replace(plain, parameters_seen=("leg_offsets[0]",))
    assert end.size == plain.size + 1
    assert FilterFeatures.read(end.describe(), end.dt) == end
    assert "parameters_seen" not in plain.describe()
    channels = {channel.name: np.full(channel.size, np.nan) for channel in end.channels}
    for lengths, seen in ((0.0, 0.002 / 0.033), (1.0, 1.0), (3.0, 1.0)):
        tape = {"lengths": 0.02 * lengths, "places": 0.01 * lengths}
        told = end.configured({"geometry": RiderGeometry().describe(), GEOMETRY_STD: tape})
        state, _ = told.step(told.init(channels), channels)
        assert state.sums.sums[-1] == pytest.approx(seen)


@pytest.mark.parametrize("name", ENDS)
def test_too_slow_a_sensor_is_refused(name: str) -> None:
    ENDS[name].with_dt(0.04)
    with pytest.raises(ValueError, match=r"dt must be at most 0\.04 s"):
        ENDS[name].with_dt(0.05)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one"):
        RawChannels(())
    with pytest.raises(ValueError, match="scales must be 1"):
        RawChannels((GYROSCOPE,), (1.0, 2.0))
    with pytest.raises(ValueError, match="must estimate a relative orientation"):
        LevelFrame(make("external-acceleration"))
    with pytest.raises(ValueError, match="must have a filter with the gains"):
        FilterBank(LevelFrame())
    with pytest.raises(ValueError, match="rows of positive factors"):
        FilterBank(LevelFrame(make("bounded-motion")), ((1.0, 0.0),), PAIR)
    with pytest.raises(ValueError, match=r"channels_seen must be channels of the filter"):
        FilterFeatures(make("mekf"), channels_seen=("imu/mag",))
    with pytest.raises(ValueError, match=r"parameters_seen must be positive parameters of the filter, got \['tape'\]"):
        FilterFeatures(make("mekf"), parameters_seen=("tape",))


@pytest.mark.parametrize("rate", [25.0, 60.0, 286.0, 1000.0 / 7.0])
def test_intervals_end_where_time_says(rate: float) -> None:
    ends = interval_ends(0, 2000, 1.0 / rate, 0.04)
    times = (np.flatnonzero(ends) + 1) / rate
    np.testing.assert_allclose(times, 0.04 * np.round(times / 0.04), atol=0.5 / rate + 1e-9)
    parts = np.concatenate([interval_ends(0, 700, 1.0 / rate, 0.04), interval_ends(700, 1300, 1.0 / rate, 0.04)])
    np.testing.assert_array_equal(parts, ends)


def test_scales_come_from_what_is_scored() -> None:
    rng = np.random.default_rng(0)
    features = rng.standard_normal((4, 500, 3)) * [2.0, 0.0, 5.0] + [1.0, 7.0, 0.0]
    features[0] = 1e6
    mask = np.ones((4, 500), bool)
    mask[0] = False
    mean, deviation = standardisation(features, mask)
    np.testing.assert_allclose(mean, [1.0, 7.0, 0.0], atol=0.3)
    np.testing.assert_allclose(deviation[[0, 2]], [2.0, 5.0], rtol=0.05)
    # what hardly varies is removed
    assert np.isinf(deviation[1])


def test_a_filter_stands_alone_in_and_after_a_gap_of_its_inputs(samples: dict[str, np.ndarray]) -> None:
    end = FilterFeatures(make("platform-gyro", dt=0.01))  # type: ignore[arg-type]
    gyroscope = np.tile(samples["imu/gyr"][:160], (2, 1))
    gyroscope[60:70], gyroscope[100:170] = np.nan, np.nan
    data = {end.channels[0].name: gyroscope}
    seen = end.run(data)
    assert seen.alone is not None
    np.testing.assert_array_equal(np.flatnonzero(seen.alone), np.arange(150, 269))
    state = end.init({name: array[0] for name, array in data.items()})
    for t in range(len(gyroscope)):
        state, now = end.step(state, {name: array[t] for name, array in data.items()})
        assert now.alone == seen.alone[t]
    head = AngleHead((end.outputs[0],), (0.1,), deviations=(0.02,))
    found = head.estimate(seen, np.ones((len(gyroscope), 1)))
    roll, plain = found.pose["bicycle/roll"], end.kalman.run(data)
    assert found.covariance is not None
    assert plain.covariance is not None
    np.testing.assert_allclose(roll[150:269], plain.pose["bicycle/roll"][150:269], atol=1e-15)
    np.testing.assert_array_equal(found.covariance[150:269, 0, 0], plain.covariance[150:269, 0, 0])
    np.testing.assert_allclose(roll[269:] - plain.pose["bicycle/roll"][269:], 0.1)
    np.testing.assert_allclose(found.covariance[:150], 0.02**2)
