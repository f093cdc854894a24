"""The viewer: its clock, motion that is finished or grows, the page, and the command."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import threading
import urllib.request
from functools import partial
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import poise
from poise.envs.data.trajectory import Trajectory
from poise.scripts.live.growing import environment_blocks
from poise.scripts.live.motion import Device, Rider, joined
from poise.scripts.live.online import Timed
from poise.scripts.live.player import Player
from poise.scripts.live.shown import (
    PlayedEnvironment,
    finished,
    live_motion,
    tuned_episode,
    tuned_estimators,
    usual_estimators,
)
from poise.scripts.main import main

viser = pytest.importorskip("viser")

NAMES = ("bounded-motion", "tilt")


@pytest.fixture(scope="module")
def motion() -> Trajectory:
    env = gymnasium.make("poise/HandMotion-v0", duration=4.0, drive="kinematic")
    try:
        return poise.record(env, seed=5)
    finally:
        env.close()


def test_the_player_advances_pauses_and_loops():
    player = Player(10.0, 12.0, speed=2.0)
    assert [player.advance(clock) for clock in (100.0, 100.5, 100.75)] == [10.0, 11.0, 11.5]
    player.toggle()
    assert player.advance(105.0) == 11.5
    player.toggle()
    assert player.advance(105.5) == pytest.approx(10.5)  # 12.5 is 0.5 s after the end
    player.seek(99.0)
    assert player.time == 12.0


def test_the_player_follows_what_grows_until_a_time_is_chosen():
    player = Player(0.0, 1.0, following=True)
    player.grow(0.0, 3.0)
    assert player.advance(0.0) == 3.0
    player.seek(0.5)
    player.grow(1.0, 4.0)
    assert player.advance(0.1) == pytest.approx(1.1)
    player.follow()
    assert player.advance(0.2) == 4.0


@pytest.mark.parametrize(("arguments", "said"), [({"end": -1.0}, "end"), ({"speed": 0.0}, "speed")])
def test_a_player_that_cannot_be_is_refused(arguments, said):
    with pytest.raises(ValueError, match=said):
        Player(**arguments)


def test_a_finished_recording_is_drawn_at_50_hz(motion):
    subject, shown = finished(motion, NAMES)
    assert isinstance(subject, Device)
    assert list(shown.figures) == ["truth", *NAMES]
    np.testing.assert_allclose(np.diff(shown.time), 0.02)
    placed = shown.figures["truth"]["device"]
    np.testing.assert_array_equal(placed.position, motion.truth["position"][::2])
    np.testing.assert_array_equal(placed.orientation, motion.truth["orientation"][::2])
    run = poise.run("tilt", motion)
    up = shown.figures["tilt"]["device"].orientation
    np.testing.assert_allclose(poise.filters.core.rotation.up_in_body(up), run.pose["up"][::2], atol=1e-9)
    assert list(shown.virtual) == ["bounded-motion"]


def samples_of(trajectory: Trajectory) -> list[Timed]:
    channels = trajectory.measurements
    return [
        Timed(float(t), {name: values[i] for name, values in channels.items()}, False, False)
        for i, t in enumerate(trajectory.time)
    ]


def test_motion_that_grows_equals_the_finished_one(motion):
    live = live_motion(NAMES, motion[:1].replace(metadata={**motion.metadata, "rate": 100.0}))
    samples = samples_of(motion)
    for begin in range(0, len(samples), 37):
        part = slice(begin, begin + 37)
        live.add(samples[part], {name: values[part] for name, values in motion.truth.items()})
    assert live.motion is not None
    expected = finished(motion, NAMES)[1]
    for label, poses in expected.figures.items():
        found = live.motion.figures[label]["device"].orientation
        np.testing.assert_allclose(found, poses["device"].orientation, atol=1e-7)
    np.testing.assert_allclose(live.motion.virtual["bounded-motion"], expected.virtual["bounded-motion"], atol=1e-7)
    for title, curves in expected.curves.items():
        for label, values in curves.items():
            np.testing.assert_allclose(live.motion.curves[title][label], values, atol=1e-6)


def test_an_environment_of_gains_shows_its_filter_and_what_sets_it():
    env = gymnasium.make("poise/HandMotionGain-v0", duration=4.0)
    try:
        names, trajectory = tuned_estimators(env), tuned_episode(env, 3)
        assert trajectory is not None
        assert names[0] == "external-acceleration"
        assert "external-acceleration+policy" in names
        np.testing.assert_array_equal(
            trajectory.measurements["imu/gyr"], env.unwrapped.trajectory.measurements["imu/gyr"]
        )
    finally:
        env.close()
    _, shown = finished(trajectory, names)
    gains = shown.curves["accelerometer_noise, set while it runs"]
    assert set(gains) == set(names[1:]), "the published filter sets nothing"
    assert len(gains["external-acceleration+policy"]) == len(shown.time)


def test_an_environment_of_gains_is_shown_live():
    env = gymnasium.make("poise/HandMotionGain-v0", duration=2.0)
    try:
        blocks = environment_blocks(env, 3)
        samples, truth, kind = next(block for block in blocks if block[0])
    finally:
        env.close()
    assert kind is not None
    assert kind.dt == pytest.approx(0.01)
    assert set(kind.measurements) == set(samples[0].measurement)
    assert len(truth["orientation"]) == len(samples)
    live = live_motion(("external-acceleration",), kind)
    live.add(samples, truth)
    assert live.motion is not None
    assert list(live.motion.figures) == ["truth", "external-acceleration"]


def test_old_motion_is_forgotten(motion):
    live = live_motion(("tilt",), motion[:1].replace(metadata={"rate": 100.0}))
    live.kept = 1.0
    for sample in samples_of(motion):
        live.add([sample])
    assert live.motion is not None
    assert live.motion.time[0] == pytest.approx(motion.time[-1] - 1.0)
    assert len(live.motion) == 51


def test_motions_are_joined_in_the_order_of_time(motion):
    whole = finished(motion, NAMES)[1]
    found = joined(whole.rows(slice(0, 50)), whole.rows(slice(50, None)))
    np.testing.assert_array_equal(found.time, whole.time)
    np.testing.assert_array_equal(found.virtual["bounded-motion"], whole.virtual["bounded-motion"])
    np.testing.assert_array_equal(
        found.figures["tilt"]["device"].orientation, whole.figures["tilt"]["device"].orientation
    )


def test_an_environment_is_played_as_it_would_be_recorded(motion):
    env = gymnasium.make("poise/HandMotion-v0", duration=4.0, drive="kinematic")
    played = PlayedEnvironment(env, seed=5)
    samples, truth = played.block(2.0)
    more, _ = played.block(100.0)
    env.close()
    assert played.over
    assert len(samples) + len(more) == len(motion)
    np.testing.assert_array_equal(more[-1].measurement["imu/acc"], motion.measurements["imu/acc"][-1])
    np.testing.assert_array_equal(truth["orientation"], motion.truth["orientation"][: len(samples)])
    np.testing.assert_array_equal(samples[30].measurement["imu/gyr"], motion.measurements["imu/gyr"][30])


def test_channels_decide_what_is_drawn_and_estimated():
    assert usual_estimators(("imu/gyr", "imu/acc"))[0] == "bounded-motion"
    assert usual_estimators(("wheel/speed",)) == ()
    channels = [each.name for each in poise.make_estimator("odometry-aided").channels]
    single = {name: np.zeros((1, 3 if "imu" in name else 1)) + 1.0 for name in channels}
    live = live_motion(("odometry-aided",), Trajectory([0.0], single, metadata={"rate": 100.0}))  # type: ignore[arg-type]
    assert isinstance(live.subject, Rider)
    live.add([Timed(0.01 * i, {name: values[0] for name, values in single.items()}, False, False) for i in range(3)])
    assert live.motion is not None
    assert "front_wheel" in live.motion.figures["odometry-aided"]


@pytest.mark.parametrize(
    ("names", "said"), [(("vqf-9",), "imu/mag"), (("whole-body",), "bicycle_imu"), (("nothing",), "nothing")]
)
def test_estimators_that_do_not_fit_are_named(names, said, motion):
    without = motion.replace(measurements={name: motion.measurements[name] for name in ("imu/gyr", "imu/acc")})
    with pytest.raises(ValueError, match=said):
        finished(without, names)
    with pytest.raises(ValueError, match=said):
        live_motion(names, without[:1].replace(metadata={"rate": 100.0}))


@pytest.fixture
def viewer(motion):
    from poise.scripts.live.viewer import Viewer

    subject, shown = finished(motion, NAMES)
    made = Viewer(subject, shown, "test", port=0, addable=("mahony", "array-rate"), more=partial(finished, motion))
    yield made
    made.close()


def test_the_page_is_served_and_everything_is_put_in_place(viewer):
    with urllib.request.urlopen(viewer.url, timeout=20.0) as page:
        assert page.status == 200
    viewer.begin(1.0, "roll", beside=True)
    viewer.tick(0.0)
    assert viewer._choice.value == "roll (deg)"
    assert [trace.name for trace in viewer._plot.figure.data] == ["truth", *NAMES]
    body = viewer.server.scene.get_handle_by_name("/world/truth/device")
    np.testing.assert_allclose(body.position, viewer.motion.figures["truth"]["device"].position[50], atol=1e-9)
    np.testing.assert_allclose(body.wxyz, viewer.motion.figures["truth"]["device"].orientation[50], atol=1e-6)
    viewer.options.visible["tilt"] = False
    viewer.options.beside = False
    viewer.options.virtual = True
    viewer._act(lambda: None)
    viewer.tick(0.1)
    assert not viewer.server.scene.get_handle_by_name("/world/tilt").visible
    moved = viewer.server.scene.get_handle_by_name("/world/bounded-motion").position
    place = viewer.motion.figures["truth"]["device"].position
    np.testing.assert_allclose(moved + place[50], viewer.motion.virtual["bounded-motion"][50] + place[0], atol=1e-9)


def test_an_estimator_is_added(viewer, motion):
    viewer.begin(1.0, "inclination")
    viewer.add("mahony")
    viewer.tick(0.0)
    assert list(viewer.motion.figures) == ["truth", *NAMES, "mahony"]
    assert [trace.name for trace in viewer._plot.figure.data] == [*NAMES, "mahony"]
    body = viewer.server.scene.get_handle_by_name("/world/mahony/device")
    up = poise.filters.core.rotation.up_in_body(np.array(body.wxyz))
    np.testing.assert_allclose(up, poise.run("mahony", motion).pose["up"][100], atol=1e-6)
    with pytest.raises(ValueError, match="array/acc"):
        viewer.add("array-rate")
    assert "mahony" in viewer.motion.figures


def test_an_unknown_place_hides_the_body_only(viewer):
    viewer.motion.figures["tilt"]["device"].orientation[0] = np.nan
    viewer.player.playing = False
    viewer.player.seek(0.0)
    viewer._act(lambda: None)
    viewer.tick(0.0)
    assert not viewer.server.scene.get_handle_by_name("/world/tilt/device").visible
    assert viewer.server.scene.get_handle_by_name("/world/truth/device").visible


@pytest.mark.parametrize(("at", "plot", "said"), [(99.0, None, "at must lie from 0 to 4"), (None, "speed", "speed")])
def test_a_beginning_that_cannot_be_is_refused(viewer, at, plot, said):
    with pytest.raises(ValueError, match=said):
        viewer.begin(at, plot)


def write_lines(motion: Trajectory, path: Path) -> Path:
    rows = np.column_stack([motion.time, motion.measurements["imu/gyr"], motion.measurements["imu/acc"]])
    np.savetxt(path, rows, delimiter=",")
    return path


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_the_command_serves_a_growing_file_and_ends_when_asked(motion, tmp_path):
    path = write_lines(motion, tmp_path / "samples.csv")
    words = ["view", str(path), "--live", "--no-browser", "--port", "0", "--estimators", "tilt"]
    command = [sys.executable, "-m", "poise.scripts.main", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert "samples at http://127.0.0.1:" in line
        url = line.split(" at ")[1].split()[0]
        with urllib.request.urlopen(url, timeout=20.0) as page:
            assert page.status == 200
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=30.0) == 0
        assert process.stdout.read().strip() == ""
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", int(url.rsplit(":", 1)[1]))) != 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere.csv"], "nowhere.csv: no such file"),
        (["hand-motion", "--options", "gestre=fast"], "gestre"),
        (["hand-motion", "--live", "--options", "duration=2.0", "--estimators", "whole-body"], "whole-body needs"),
        (["--udp", "99999"], "port"),
        (
            ["wheel.csv", "--live", "--columns", "time", "wheel/speed", "--estimators", "odometry-aided"],
            "bicycle_imu/gyr",
        ),
        (["array.csv", "--live", "--estimators", "array-rate"], "array/acc"),
        (["still.csv", "--live", "--columns", "time", "gx", "gy", "gz"], "neither a true attitude nor an estimate"),
    ],
)
def test_wrong_input_is_named(words, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, width in (("wheel.csv", 2), ("array.csv", 7), ("still.csv", 4)):
        np.savetxt(name, np.column_stack([0.01 * np.arange(60), np.ones((60, width - 1))]), delimiter=",")
    assert main(["view", *words, "--no-browser", "--port", "0"]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.slow
def test_a_browser_draws_the_page(motion, tmp_path):
    pytest.importorskip("playwright")
    from poise.scripts.live.picture import find_browser

    if find_browser() is None:
        pytest.skip("there is no Chromium")
    import matplotlib.image

    path = motion.save(tmp_path / "motion.h5")
    picture = tmp_path / "page.png"
    words = ["view", str(path), "--at", "1.0", "--screenshot", str(picture), "--port", "0", "--estimators", *NAMES]
    assert main(words) == 0
    pixels = matplotlib.image.imread(picture)
    assert pixels.shape[:2] == (720, 1280)
    scene = pixels[:, :800, :3]
    # the device in the middle of the picture is darker than the ground around it
    assert scene[250:450, 350:550].min() < 0.4 < scene[600:, :100].min()
    assert len(np.unique((255 * scene).astype(int).reshape(-1, 3), axis=0)) > 500


@pytest.mark.slow
def test_a_browser_draws_a_film(viewer, tmp_path):
    pytest.importorskip("playwright")
    from PIL import Image

    from poise.scripts.live.picture import find_browser, take_film

    if find_browser() is None:
        pytest.skip("there is no Chromium")
    viewer.begin(1.0)
    with pytest.raises(ValueError, match="until must lie after 1 s"):
        take_film(viewer, tmp_path / "film.webp", 0.5)
    with Image.open(take_film(viewer, tmp_path / "film.webp", 1.25, (320, 240))) as film:
        assert (film.size, film.n_frames) == ((320, 240), 4)
        first = np.asarray(film.convert("RGB"), float)
        film.seek(3)
        assert np.abs(np.asarray(film.convert("RGB"), float) - first).max() > 50.0


@pytest.mark.slow
def test_the_page_is_operated_in_a_browser(viewer):
    pytest.importorskip("playwright")
    from poise.scripts.live.picture import find_browser, opened_page

    if find_browser() is None:
        pytest.skip("there is no Chromium")
    viewer.begin(1.0)
    thread = threading.Thread(target=viewer.run, daemon=True)
    thread.start()
    patience = 100e3
    with opened_page(viewer, (1000, 700)) as page:
        page.get_by_role("button", name="Play").click(timeout=patience)
        page.get_by_role("button", name="Pause").click(timeout=patience)
        page.get_by_role("button", name="Play").wait_for(timeout=patience)
        assert not viewer.player.playing
        assert viewer.player.time != 1.0
        page.get_by_role("checkbox").first.click(timeout=patience, force=True)
        page.locator(".mantine-Select-input").last.click(timeout=patience, force=True)
        page.locator("[role=option]:visible", has_text="mahony").first.click(timeout=patience, force=True)
        page.get_by_text("mahony").first.wait_for(timeout=patience)
        for _ in range(60):
            if "mahony" in viewer.motion.figures:
                break
            page.wait_for_timeout(500.0)
        assert list(viewer.motion.figures) == ["truth", *NAMES, "mahony"]
        assert not viewer.options.visible["truth"]
    viewer.stopped.set()
    thread.join(10.0)
