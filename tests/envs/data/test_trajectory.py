"""Trajectories: what they refuse, how they are cut, stored and recorded."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import h5py
import numpy as np
import pytest

import poise
from poise.envs.data.trajectory import Trajectory, load_trajectory
from poise.envs.hand.sensing import simulate_hand
from poise.envs.record import record
from poise.filters.core import rotation


def make(length: int = 20, **changes: Any) -> Trajectory:
    rng = np.random.default_rng(0)
    acc = rng.standard_normal((length, 3))
    acc[3:5] = np.nan
    arguments: dict[str, Any] = {
        "time": 0.5 + np.arange(length) / 100.0,
        "measurements": {"imu/gyr": rng.standard_normal((length, 3)), "imu/acc": acc},
        "truth": {"orientation": rotation.random(rng, (length,)), "position": rng.standard_normal((length, 3))},
        "mask": rng.uniform(size=length) < 0.5,
        "metadata": {"name": "test", "seed": 3, "pair": (1, 2), "rate": 100.0},
    }
    return Trajectory(**arguments | changes)


def assert_same(a: Trajectory, b: Trajectory) -> None:
    np.testing.assert_array_equal(a.time, b.time)
    np.testing.assert_array_equal(a.mask, b.mask)
    assert a.metadata == b.metadata
    for mine, other in ((a.measurements, b.measurements), (a.truth, b.truth)):
        assert set(mine) == set(other)
        for name in mine:
            np.testing.assert_array_equal(mine[name], other[name])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time": np.zeros((0,))}, "at least one sample"),
        ({"time": np.zeros((20, 1))}, r"time must have shape \(T,\).*\(20, 1\)"),
        ({"time": np.zeros(20)}, "time must increase, got 0.0 s at sample 1"),
        ({"time": np.append(np.arange(19.0), np.nan)}, "time must be finite, got nan at sample 19"),
        ({"time": ["a"] * 20}, "time must be an array of real numbers"),
        ({"measurements": {}}, "at least one channel"),
        ({"measurements": np.zeros((20, 3))}, "must be a mapping from name to array, got ndarray"),
        (
            {"measurements": {"imu/gyr": np.zeros((19, 3))}},
            r"measurements\['imu/gyr'\] must have shape \(20, size\).*19",
        ),
        ({"measurements": {"imu/gyr": np.zeros(20)}}, "must have shape"),
        ({"measurements": {"imu/gyr": np.full((20, 3), np.inf)}}, "infinite at sample 0"),
        ({"measurements": {3: np.zeros((20, 3))}}, "names as keys, got 3"),
        ({"truth": {"up": np.zeros((20, 3, 1))}}, r"truth\['up'\] must have shape"),
        ({"truth": {"up": [[1], [1, 2]]}}, r"truth\['up'\] must be an array of real numbers"),
        ({"mask": np.ones(20)}, "mask must be bool"),
        ({"mask": np.ones(19, bool)}, "mask must be bool"),
        ({"metadata": {"array": np.zeros(3)}}, "JSON-able"),
        ({"metadata": [1]}, "metadata must be a mapping"),
    ],
)
def test_wrong_arguments_are_named(changes, message):
    with pytest.raises(ValueError, match=message):
        make(**changes)


def test_interval_name_length_and_default_mask():
    trajectory = make(mask=None)
    assert trajectory.mask.all()
    assert len(trajectory) == 20
    assert trajectory.name == "test"
    assert trajectory.dt == pytest.approx(0.01)
    assert trajectory.uniform
    assert not make(time=np.arange(20.0) ** 1.5).uniform
    assert make(1).dt == 0.01
    with pytest.raises(ValueError, match="single sample"):
        _ = make(1, metadata={}).dt
    with pytest.raises(AttributeError):
        trajectory.time = np.zeros(3)


def test_arrays_are_copied_and_read_only():
    gyr, mask = np.zeros((20, 3)), np.ones(20, bool)
    trajectory = make(measurements={"imu/gyr": gyr}, mask=mask)
    gyr[:], mask[:] = 7.0, False
    assert (trajectory.measurements["imu/gyr"] == 0.0).all()
    assert trajectory.mask.all()
    for array in (trajectory.time, trajectory.mask, trajectory.measurements["imu/gyr"], trajectory.truth["position"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    assert trajectory[3:].measurements["imu/gyr"].base is not None, "a part shares what nobody can change"


@pytest.mark.parametrize("dtype", [float, int, np.float32])
def test_masked_entries_are_missing(dtype):
    values = np.ma.masked_array(np.full((20, 3), 999, dtype), mask=np.arange(60).reshape(20, 3) == 7)
    kept = make(measurements={"imu/acc": values}).measurements["imu/acc"]
    np.testing.assert_array_equal(np.isnan(kept), values.mask)
    assert type(kept) is np.ndarray
    with pytest.raises(ValueError, match="time must be finite"):
        make(time=np.ma.masked_equal(np.arange(20.0), 5.0))
    assert not make(mask=np.ma.masked_array(np.ones(20, bool), mask=np.arange(20) == 4)).mask[4]


@pytest.mark.parametrize("name", ["orientation", "up", "relative_orientation", "head/orientation"])
def test_truth_is_of_unit_length_or_unknown(name):
    values = np.tile([0.6, 0.0, 0.8] if name == "up" else [0.6, 0.0, 0.8, 0.0], (20, 1))
    values[4:6], values[9] = 0.0, 1.5 * values[9]
    with pytest.warns(UserWarning, match=rf"truth\['{name}'\].*3 of 20 rows.*sample 4.*unknown"):
        truth = make(truth={name: values}).truth[name]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(truth).all(axis=1)), [4, 5, 9])
    np.testing.assert_array_equal(truth[:4], values[:4])


def test_the_representation_is_one_line():
    assert repr(make()) == (
        "Trajectory('test', 20 samples, 0.5 to 0.69 s, channels imu/gyr, imu/acc, truth orientation, position)"
    )


def test_cutting_keeps_time_and_refuses_what_leaves_nothing():
    trajectory = make()
    part = trajectory[5:-3]
    assert len(part) == 12
    np.testing.assert_array_equal(part.time, trajectory.time[5:-3])
    np.testing.assert_array_equal(part.truth["position"], trajectory.truth["position"][5:-3])
    assert_same(trajectory[:], trajectory)
    for bad in (slice(3, 3), slice(100, None), slice(0, 10, 2), 3):
        with pytest.raises(ValueError, match=r"of the 20 of test|steps of one"):
            trajectory[bad]


def test_up_follows_from_the_orientation():
    trajectory = make()
    np.testing.assert_allclose(trajectory.truth_of("up"), rotation.up_in_body(trajectory.truth["orientation"]))
    assert trajectory.quantities == ("orientation", "position", "up", "relative_orientation")
    known = make(truth={"up": np.tile([0.0, 0.6, 0.8], (20, 1))})
    np.testing.assert_array_equal(known.truth_of("up"), np.tile([0.0, 0.6, 0.8], (20, 1)))
    with pytest.raises(ValueError, match=r"no 'velocity'; known are \['orientation'"):
        trajectory.truth_of("velocity")


def test_a_saved_trajectory_comes_back(tmp_path):
    trajectory = make(truth={})
    assert trajectory.save(tmp_path / "new" / "a.h5") == tmp_path / "new" / "a.h5"
    assert_same(load_trajectory(tmp_path / "new" / "a.h5"), trajectory)
    make().save(tmp_path / "new" / "a.h5")
    assert_same(load_trajectory(str(tmp_path / "new" / "a.h5")), make())
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["a.h5"]
    assert_same(pickle.loads(pickle.dumps(trajectory)), trajectory)


def test_a_failed_save_leaves_the_old_file(tmp_path):
    path = make().save(tmp_path / "a.h5")
    impossible = make(measurements={"imu": np.zeros((20, 1)), "imu/gyr": np.zeros((20, 1))})
    with pytest.raises(ValueError, match="cannot store 'imu/gyr'"):
        impossible.save(path)
    assert_same(load_trajectory(path), make())
    assert len(list(tmp_path.iterdir())) == 1


def test_files_that_are_none_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nothing\.h5"):
        load_trajectory(tmp_path / "nothing.h5")
    path = make(2000).save(tmp_path / "a.h5")
    content = path.read_bytes()
    for name, damaged in {"cut": content[: len(content) // 2], "text": b"time,acc\n", "empty": b""}.items():
        (tmp_path / name).write_bytes(damaged)
        with pytest.raises(ValueError, match=rf"{name} is not a readable HDF5 file"):
            load_trajectory(tmp_path / name)
    with h5py.File(tmp_path / "foreign", "w") as file:
        file["x"] = 1
    with pytest.raises(ValueError, match="not a poise-trajectory"):
        load_trajectory(tmp_path / "foreign")
    with h5py.File(path, "a") as file:
        del file["mask"]
    with pytest.raises(ValueError, match=r"lacks \['mask'\]"):
        load_trajectory(path)
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = 99
    with pytest.raises(ValueError, match="version 99 is newer"):
        load_trajectory(path)


@pytest.mark.parametrize("what", ["external link", "soft link", "external storage", "virtual", "size", "depth"])
def test_hostile_files_are_refused(tmp_path, what):
    """Nothing outside the file is read, and nothing is allocated that the file cannot hold."""
    secret = tmp_path / "secret"
    secret.write_bytes(np.arange(60.0).tobytes())
    path = make().save(tmp_path / "a.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["gyr"] = np.ones((20, 3))
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = 1
        group = file["measurements/imu"]
        del group["gyr"]
        if what == "external link":
            group["gyr"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "gyr")
        elif what == "soft link":
            group["gyr"] = h5py.SoftLink("/measurements/imu/acc")
        elif what == "external storage":
            group.create_dataset("gyr", (20, 3), float, external=[(str(secret), 0, 480)])
        elif what == "virtual":
            layout = h5py.VirtualLayout((20, 3), float)
            layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "gyr", (20, 3))
            group.create_virtual_dataset("gyr", layout)
        elif what == "size":
            group.create_dataset("gyr", (2**40, 3), float, chunks=(1024, 3), compression="gzip")
        else:
            group.create_group("/".join("abcdefghijklmnopqrst"))
    message = (
        "Link: links to other places"
        if "link" in what
        else {"size": "declares the shape", "depth": "nested"}.get(what, "outside the file")
    )
    with pytest.raises(ValueError, match=rf"a\.h5: .*{message}"):
        load_trajectory(path)


def test_names_attributes_and_metadata_have_a_checksum_and_old_files_are_read(tmp_path):
    def change(file: h5py.File, how: str) -> None:
        if how == "group":
            file.move("measurements/imu", "measurements/imv")
        elif how == "channel":
            file.move("measurements/imu/gyr", "measurements/imu/acd")
        elif how == "attribute":
            file["time"].attrs["unit"] = "ms"
        elif how == "metadata":
            text = file["metadata"].asstr()[()]
            del file["metadata"]
            file["metadata"] = text.replace("test", "best")

    for how in ("group", "channel", "attribute", "metadata"):
        path = make().save(tmp_path / f"{how}.h5")
        with h5py.File(path, "a") as file:
            change(file, how)
        with pytest.raises(ValueError, match="do not match their checksum"):
            load_trajectory(path)
        with h5py.File(path, "a") as file:
            del file.attrs["digest"]
            file.attrs["format_version"] = 1
        assert len(load_trajectory(path)) == 20
    assert list(load_trajectory(make().save(tmp_path / "order.h5")).measurements) == ["imu/gyr", "imu/acc"]


def test_a_flipped_bit_is_noticed(tmp_path):
    path = make(2000).save(tmp_path / "a.h5")
    with h5py.File(path) as file:
        chunk = file["measurements/imu/gyr"].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(ValueError, match="damaged"):
        load_trajectory(path)


@dataclass(frozen=True)
class Options:
    rate: float = 50.0


class Suite:
    def to_measurement(self, observation: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {"imu/gyr": np.where(observation["new_sample"][0], observation["imu/gyr"], np.nan)}

    def describe(self) -> dict[str, Any]:
        return {"imu": {"rate": np.float64(25.0)}}


class Spinner(gymnasium.Env):
    """Turns about z by what the action says; every second sample is new; ends after ten steps."""

    observation_space = gymnasium.spaces.Dict(
        {"imu/gyr": gymnasium.spaces.Box(-9, 9, (3,)), "new_sample": gymnasium.spaces.MultiBinary(1)}
    )
    action_space = gymnasium.spaces.Box(-1, 1, (1,))

    def __init__(self, options: Options = Options()) -> None:
        self.suite = Suite()

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.tick, self.angle = 0, 0.0
        return self.tell(np.zeros(1))

    def tell(self, rate: np.ndarray) -> tuple[Any, dict[str, Any]]:
        noise = 0.01 * self.np_random.standard_normal(3)
        gyr = (np.array([0, 0, rate[0]]) + noise).astype(np.float32)
        orientation = rotation.exp(np.array([0.0, 0.0, self.angle]))
        observation = {"imu/gyr": gyr, "new_sample": np.array([self.tick % 2 == 0], dtype=np.int8)}
        pose = {"orientation": orientation}
        return observation, {
            "time": self.tick / 50,
            "pose": pose,
            "truth": {"heading": self.angle},
            "scored": self.tick > 2,
        }

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.tick += 1
        self.angle += float(action[0]) / 50
        observation, info = self.tell(action)
        return observation, 0.0, self.tick >= 10, False, info


class NeutralSpinner(Spinner):
    neutral_action = np.zeros(1, np.float32)


def test_an_episode_is_recorded_from_reset_to_end():
    env = Spinner()
    episode = record(env, seed=5, policy=lambda observation: np.array([0.5]))
    assert len(episode) == 11
    assert episode.time[0] == 0.0
    np.testing.assert_allclose(episode.truth["heading"], 0.5 * episode.time[:, None])
    np.testing.assert_allclose(episode.truth_of("orientation")[-1], rotation.exp(np.array([0, 0, 0.1])))
    np.testing.assert_array_equal(np.isnan(episode.measurements["imu/gyr"][:, 0]), np.arange(11) % 2 == 1)
    np.testing.assert_array_equal(episode.mask, np.arange(11) > 2)
    assert episode.metadata["seed"] == 5
    assert episode.metadata["ended"] == "terminated"
    assert episode.metadata["rate"] == pytest.approx(50.0)
    assert episode.metadata["sensors"] == {"imu": {"rate": 25.0}}
    assert len(record(env, seed=5, steps=4, progress=True)) == 5
    assert record(env, seed=5, steps=4).metadata["ended"] == "steps"
    assert len(record(env, seed=5, steps=0)) == 1


def test_equal_seeds_give_equal_episodes():
    assert_same(record(Spinner(), seed=5), record(Spinner(), seed=5))
    drawn = record(Spinner())
    assert_same(drawn, record(Spinner(), seed=drawn.metadata["seed"]))
    assert np.any(record(Spinner(), seed=6).truth["heading"] != record(Spinner(), seed=5).truth["heading"])
    assert np.all(record(NeutralSpinner(), seed=5).truth["heading"] == 0.0)


def test_an_id_is_made_recorded_and_described(tmp_path):
    gymnasium.register("PoiseTest/Spinner-v0", entry_point=Spinner, max_episode_steps=6, kwargs={"options": Options()})
    try:
        episode = record("PoiseTest/Spinner-v0", seed=1)
    finally:
        del gymnasium.registry["PoiseTest/Spinner-v0"]
    assert len(episode) == 7
    assert episode.name == "PoiseTest/Spinner-v0-1"
    assert episode.metadata["ended"] == "truncated"
    options = {"options": {"type": "Options", "rate": 50.0}}
    assert episode.metadata["environment"] == {"id": "PoiseTest/Spinner-v0", "kwargs": options}
    assert_same(load_trajectory(episode.save(tmp_path / "episode.h5")), episode)


def test_what_cannot_be_recorded_is_refused():
    with pytest.raises(ValueError, match="no sensor suite"):
        record("CartPole-v1")
    with pytest.raises(ValueError, match="steps must be None or a whole number of at least 0, got -1"):
        record(Spinner(), steps=-1)
    with pytest.raises(ValueError, match="vector environment"):
        record(gymnasium.make_vec("CartPole-v1"))

    class Forgetful(Spinner):
        def step(self, action):
            *rest, info = super().step(action)
            del info["truth"]["heading"]
            return *rest, info

    with pytest.raises(ValueError, match=r"info\['truth'\] changed from \['heading'\] to \[\] at step 1"):
        record(Forgetful())


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda one: one.resampled("x"), "rate must be a positive number of Hz, got 'x'"),
        (lambda one: one.resampled(1e9), "would make"),
        (lambda one: one.interpolated("x"), "longest must be a positive time in s, got 'x'"),
        (lambda one: one.save(3), "path must be a path"),
        (lambda one: poise.run("tilt", one, grid="x"), "grid must be True or False, got 'x'"),
        (lambda one: poise.evaluate({1: "tilt"}, one), "labels of estimators must be texts, got 1"),
        (lambda one: poise.record(3), "env must be an environment or the id of one, got 3"),
        (lambda one: poise.record("poise/HandMotion-v0", steps=2.5), "steps must be None or a whole number"),
        (lambda one: poise.load_recording("x.csv", sensor=3), "sensor must be the name of one, got 3"),
    ],
)
def test_wrong_arguments_of_functions_are_named(call, said):
    with pytest.raises(ValueError, match=said):
        call(simulate_hand("slow", seed=0, duration=2.0))
