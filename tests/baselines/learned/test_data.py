"""Randomised episodes, features in the gravity-aligned frame, windows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from poise.baselines.learned.data import SequenceData, sequence_of, simulation_digest, split
from poise.baselines.learned.head import TiltHead, turned
from poise.baselines.learned.inputs.gravity_aligned_frame import FEATURES, GravityAlignedFrame
from poise.baselines.learned.inputs.level_frame import LevelFrame
from poise.envs.data.trajectory import Trajectory
from poise.envs.hand.hand_held import HandHeld
from poise.envs.recipes.hand import HandRecipe
from poise.filters.core import rotation
from poise.filters.core.estimator import run
from poise.filters.core.recursion import Observer

END, HEAD = LevelFrame(), TiltHead()
SHORT = HandRecipe(duration=12.0, carried_share=0.0, held=HandHeld(first_rest=(0.3, 2.0), longest=(4.0, 6.0)))


@pytest.fixture(scope="module")
def episodes() -> list[Trajectory]:
    return [SHORT.draw(seed, f"episode-{seed}") for seed in range(5)]


@pytest.fixture(scope="module")
def dataset(episodes: list[Trajectory]) -> SequenceData:
    return SequenceData.from_trajectories(episodes, END, HEAD)


def test_an_episode_is_a_function_of_its_seed(episodes: list[Trajectory]) -> None:
    again, other = SHORT.draw(3), SHORT.draw(4)
    for channel, values in episodes[3].measurements.items():
        np.testing.assert_array_equal(again.measurements[channel], values)
    assert not np.array_equal(other.measurements["imu/gyr"][:50], again.measurements["imu/gyr"][:50])


def test_rates_differ_and_the_hand_goes_nowhere(episodes: list[Trajectory]) -> None:
    rates = [1.0 / episode.dt for episode in episodes]
    assert min(rates) >= 50.0
    assert max(rates) <= 300.0
    assert max(rates) - min(rates) > 20.0
    for episode in episodes:
        force = rotation.rotate(episode.truth["orientation"], episode.measurements["imu/acc"])
        # a velocity of some decimetres a second after 12 s, and the errors of the sensor
        np.testing.assert_allclose(np.nanmean(force, axis=0), [0.0, 0.0, 9.80665], atol=0.6)


def test_the_vertical_in_the_level_frame_is_nearly_vertical(dataset: SequenceData) -> None:
    assert dataset.features.shape == (5, dataset.target.shape[1], FEATURES.size)
    assert dataset.features.dtype == np.float32
    assert np.isfinite(dataset.features).all()
    np.testing.assert_allclose(np.linalg.norm(dataset.target, axis=-1), 1.0, rtol=1e-5)
    assert np.median(dataset.target[..., 2]) > np.cos(np.deg2rad(10.0))


def test_intervals_are_counted_exactly_at_odd_rates(episodes: list[Trajectory], dataset: SequenceData) -> None:
    for index, episode in enumerate(episodes):
        # a late device has no samples of what was before the episode
        first = int(np.argmax(np.isfinite(episode.measurements["imu/gyr"][:, 0])))
        expected = (len(episode) - 1 - first) * episode.dt / GravityAlignedFrame().interval
        assert abs(dataset.mask[index].sum() - expected) <= 1.0


def test_what_the_mask_leaves_out_is_not_scored(episodes: list[Trajectory]) -> None:
    mask = episodes[0].time > 6.0
    scored = sequence_of(episodes[0].replace(mask=mask), END, HEAD)[3]
    assert 0.45 < scored.mean() < 0.55
    unknown = episodes[0].truth["orientation"].copy()
    unknown[: len(unknown) // 2] = np.nan
    _, vertical, _, scored = sequence_of(episodes[0].replace(truth={"orientation": unknown}), END, HEAD)
    assert 0.45 < scored.mean() < 0.55
    assert np.isfinite(vertical).all()


def test_heading_turns_the_vectors_and_nothing_else(episodes: list[Trajectory]) -> None:
    """Features of a frame with another heading are those of ``turned``: what augmentation rests on."""
    episode = episodes[1]
    observer = Observer(GravityAlignedFrame(), compiled=False).with_dt(episode.dt)
    angle = 0.7
    turn = np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])

    def features(heading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        samples = [{name: values[t] for name, values in episode.measurements.items()} for t in range(300)]
        state, _ = observer.step(observer.init(samples[0]), samples[0])
        x = state.x.copy()
        x[:4] = rotation.multiply(heading, x[:4])
        state = state._replace(x=x)
        rows, ups = [], []
        for t in range(1, 300):
            state, estimate = observer.step(state, samples[t])
            rows.append(estimate.pose["features"])
            ups.append(rotation.rotate(estimate.pose["relative_orientation"], episode.truth_of("up")[t]))
        return np.array(rows)[None], np.array(ups)[None]

    plain, other = features(np.array([1.0, 0.0, 0.0, 0.0])), features(turn)
    for expected, found in zip(turned(*plain, np.array([angle])), other, strict=True):
        np.testing.assert_allclose(found, expected, atol=2e-6)


def test_windows_hold_everything_once(dataset: SequenceData) -> None:
    windows = list(dataset.windows(2, 100))
    assert sum(window.mask.sum() for window in windows) == dataset.mask.sum()
    assert [window.first for window in windows[:3]] == [True, False, False]
    assert sum(window.first for window in windows) == 3
    joined = np.concatenate([window.features for window in windows[:3]], axis=1)
    np.testing.assert_array_equal(joined, dataset.features[:2])


def test_a_loader_of_torch_takes_whole_sequences(dataset: SequenceData) -> None:
    loader = torch.utils.data.DataLoader(dataset, batch_size=2)  # type: ignore[arg-type]
    features, target, spread, mask = next(iter(loader))
    np.testing.assert_array_equal(features, dataset.features[:2])
    assert [tuple(each.shape[:2]) for each in (target, spread, mask)] == [tuple(features.shape[:2])] * 3
    assert len(list(loader)) == 3


def test_sequences_of_other_front_ends_are_no_part_of_a_set(dataset: SequenceData) -> None:
    fewer = replace(dataset, features=dataset.features[..., 1:])
    with pytest.raises(ValueError, match="of one front end and head"):
        SequenceData.together([dataset, fewer])
    with pytest.raises(ValueError, match="size and length must be at least 1, got 0 and 50"):
        next(dataset.windows(0, 50))


def test_shuffled_windows_keep_errors(dataset: SequenceData) -> None:
    windows = list(dataset.windows(5, 10_000, np.random.default_rng(0), HEAD))
    assert len(windows) == 1
    assert not np.array_equal(windows[0].target, dataset.target)
    tilts = np.sort(windows[0].target[:, -1, 2])
    np.testing.assert_allclose(tilts, np.sort(dataset.target[:, -1, 2]), rtol=1e-6)
    again = list(dataset.windows(5, 10_000, np.random.default_rng(0), HEAD))
    np.testing.assert_array_equal(windows[0].features, again[0].features)


def test_a_data_set_is_kept_and_found(tmp_path: Path) -> None:
    first = SequenceData.from_recipe(SHORT, 3, 2, END, HEAD, cache=tmp_path)
    (path,) = tmp_path.iterdir()
    stamp = path.stat().st_mtime_ns
    second = SequenceData.from_recipe(SHORT, 3, 2, END, HEAD, cache=tmp_path)
    np.testing.assert_array_equal(first.features, second.features)
    assert second.names == ("custom-3-0", "custom-3-1")
    assert path.stat().st_mtime_ns == stamp
    names = {
        simulation_digest(SHORT, 3, 2, END, HEAD),
        simulation_digest(SHORT, 4, 2, END, HEAD),
        simulation_digest(replace(SHORT, duration=13.0), 3, 2, END, HEAD),
        simulation_digest(SHORT, 3, 2, LevelFrame(frame=GravityAlignedFrame(tilt_gain=0.03)), HEAD),
        simulation_digest(SHORT, 3, 2, END, TiltHead(floor=0.1)),
    }
    assert len(names) == 5


def test_more_episodes_keep_the_first_ones() -> None:
    few, more = (SequenceData.from_recipe(SHORT, 3, count, END, HEAD) for count in (1, 2))
    length = few.features.shape[1]
    np.testing.assert_array_equal(few.features[0], more.features[0, :length])


def test_wrong_input_is_refused(episodes: list[Trajectory]) -> None:
    episode = episodes[0]
    with pytest.raises(ValueError, match="at least one"):
        SequenceData.from_trajectories([], END, HEAD)
    with pytest.raises(ValueError, match="at least 1"):
        SequenceData.from_recipe(SHORT, 0, 0, END, HEAD)
    with pytest.raises(ValueError, match="knows no 'up'"):
        SequenceData.from_trajectories([episode.replace(truth={})], END, HEAD)
    with pytest.raises(ValueError, match="too short"):
        SequenceData.from_trajectories([episode[:2]], END, HEAD)
    lacking = episode.replace(measurements={"imu/gyr": episode.measurements["imu/gyr"]})
    with pytest.raises(ValueError, match=rf"{episode.name}: measurements lack the channels \['imu/acc'\]"):
        SequenceData.from_trajectories([episode, lacking], END, HEAD)
    silent = {**episode.measurements, "imu/acc": np.full_like(episode.measurements["imu/acc"], np.nan)}
    with pytest.raises(ValueError, match="one of its channels holds nothing"):
        SequenceData.from_trajectories([episode.replace(measurements=silent)], END, HEAD)
    with pytest.raises(ValueError, match="at least one sequence"):
        SequenceData.together([])
    with pytest.raises(ValueError, match="more than"):
        SequenceData.from_trajectories([episode.replace(time=episode.time * 30.0)], END, HEAD)


def test_gaps_of_a_recording_are_missing_samples(episodes: list[Trajectory]) -> None:
    """Rows that were lost leave gaps on the grid: updates stay where time says."""
    episode = episodes[0]
    kept = np.ones(len(episode), bool)
    kept[200:230] = False
    parts = {name: values[kept] for name, values in episode.measurements.items()}
    truth = {name: values[kept] for name, values in episode.truth.items()}
    lost = episode.replace(time=episode.time[kept], measurements=parts, truth=truth, mask=episode.mask[kept])
    whole, gap = (sequence_of(each, END, HEAD) for each in (episode, lost))
    assert len(whole[0]) == len(gap[0])
    assert gap[3].sum() < whole[3].sum()


def test_parts_of_a_set_do_not_depend_on_the_rest() -> None:
    names = [f"rider-{index}" for index in range(300)]
    parts = {part: split(names, part) for part in ("train", "validation", "test")}
    assert sorted(name for part in parts.values() for name in part) == sorted(names)
    assert 0.6 < len(parts["train"]) / 300 < 0.8
    assert set(split(names[:50], "test")) == set(parts["test"]) & set(names[:50])
    with pytest.raises(ValueError, match="part must be one of"):
        split(names, "tests")


def test_the_front_end_alone_is_a_sound_observer() -> None:
    """Constant gyroscope bias at rest is found, and the tilt it causes vanishes."""
    T, dt, bias = 30_000, 0.01, np.array([0.004, -0.006, 0.002])
    measurements = {
        "imu/gyr": np.tile(bias, (T, 1)),
        "imu/acc": np.tile([0.0, 0.0, 9.80665], (T, 1)),
    }
    pose = run(Observer(GravityAlignedFrame()).with_dt(dt), measurements).pose
    up = rotation.up_in_body(pose["relative_orientation"])
    assert np.rad2deg(np.arccos(np.clip(up[-1, 2], -1, 1))) < 0.02
    # 20 b in axes of the frame is the sixth vector; about the vertical nothing is observable
    found = pose["features"][-1, 15:18] / 20.0
    assert np.linalg.norm(found[:2]) == pytest.approx(np.linalg.norm(bias[:2]), rel=0.05)
