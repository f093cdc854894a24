"""Lines become samples, samples become estimates: over files, a pseudo-terminal and UDP."""

from __future__ import annotations

import io
import os
import socket
import sys
import threading

import numpy as np
import pytest

import poise
from poise.envs.data.trajectory import Trajectory
from poise.scripts.live.lines import BadLineError, LineReader
from poise.scripts.live.online import StreamClock, Timed
from poise.scripts.live.sources import datagrams, file_lines
from poise.scripts.main import main

RATE = 50.0


@pytest.fixture(scope="module")
def motion() -> Trajectory:
    return poise.record(_env(), seed=2)


def _env():
    import gymnasium

    return gymnasium.make("poise/HandMotion-v0", rate=RATE, duration=6.0, drive="kinematic")


def rows(motion: Trajectory) -> np.ndarray:
    return np.column_stack([motion.time, motion.measurements["imu/gyr"], motion.measurements["imu/acc"]])


def csv_lines(motion: Trajectory) -> list[str]:
    return [",".join(f"{value:.17g}" for value in row) for row in rows(motion)]


def test_lines_without_names_are_time_gyroscope_and_accelerometer():
    sample = LineReader().read("0.5, 1, 2, 3, 4, 5, 6")
    assert sample is not None
    assert sample.time == 0.5
    assert sample.measurement["imu/gyr"].tolist() == [1.0, 2.0, 3.0]
    assert sample.measurement["imu/acc"].tolist() == [4.0, 5.0, 6.0]


def test_names_units_and_ignored_columns():
    reader = LineReader(("time", "-", "gx", "gy", "gz", "ax", "ay", "az"), {"gyr": "deg/s", "acc": "g", "time": "ms"})
    sample = reader.read("250;99;180;0;0;0;0;1")
    assert sample is not None
    assert sample.time == 0.25
    np.testing.assert_allclose(sample.measurement["imu/gyr"], [np.pi, 0.0, 0.0])
    np.testing.assert_allclose(sample.measurement["imu/acc"], [0.0, 0.0, 9.80665])


def test_json_lines_and_missing_values():
    reader = LineReader()
    first = reader.read('{"t": 1.0, "gyr": [1, 2, 3], "acc": [0, 0, 9.81], "note": "start"}')
    second = reader.read('{"t": 1.1, "gyr": [1, null, 3]}')
    assert first is not None
    assert second is not None
    assert first.measurement["imu/acc"].tolist() == [0.0, 0.0, 9.81]
    assert np.isnan(second.measurement["imu/gyr"]).tolist() == [False, True, False]
    assert np.isnan(second.measurement["imu/acc"]).all()


def test_channels_of_an_estimator_are_found_by_their_own_names():
    channels = poise.make_estimator("odometry-aided").channels
    names = [f"{c.name}_{a}" if c.size == 3 else c.name for c in channels for a in ("xyz" if c.size == 3 else "x")]
    reader = LineReader(names, channels=channels)
    sample = reader.read(",".join(str(i) for i in range(len(names))))
    assert sample is not None
    assert {channel.name for channel in channels} <= set(sample.measurement)
    assert sample.measurement["wheel/speed"].shape == (1,)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("1,2,3", "3 values instead of 7"),
        ("1,2,3,x,5,6,7", "'x' is not a number"),
        (",1,2,3,4,5,6", "holds no time"),
        ("1,,,,,,", "no value of a sensor"),
        ("9" * 70000, "70000 characters"),
    ],
)
def test_bad_lines_say_why(line, said):
    reader = LineReader()
    reader.read("0,1,2,3,4,5,6")
    with pytest.raises(BadLineError, match=said):
        reader.read(line)


@pytest.mark.parametrize(
    ("columns", "units", "said"),
    [
        (("time", "temperature"), {}, "no columns of a sensor"),
        (("gx", "gx", "gz"), {}, "different names"),
        (("gx", "gy", "gz"), {"gry": "deg/s"}, "gry"),
        (("gx", "gy", "gz"), {"gyr": "furlong"}, "furlong"),
    ],
)
def test_wrong_columns_are_refused(columns, units, said):
    with pytest.raises(ValueError, match=said):
        LineReader(columns, units)


def placed(clock: StreamClock, stamps: list[float]) -> list[Timed]:
    reader = LineReader()
    found = []
    for number, stamp in enumerate(stamps):
        sample = reader.read(f"{stamp},{number},2,3,4,5,6")
        assert sample is not None
        found += clock.add(sample)
    return [*found, *clock.finish()]


def test_a_gap_becomes_predictions_and_a_long_one_a_restart():
    found = placed(clock := StreamClock(0.1), [0.0, 0.1, 0.4, 0.5, 20.0])
    assert [timed.predicted for timed in found] == [False, False, True, True, False, False, False]
    assert [timed.restart for timed in found] == [False] * 6 + [True]
    np.testing.assert_allclose([timed.time for timed in found], [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 20.0])
    assert (clock.missing, clock.restarts) == (2, 1)
    assert np.isnan(found[2].measurement["imu/gyr"]).all()


def test_jitter_and_drift_are_no_gaps():
    generator = np.random.default_rng(0)
    stamps = 0.0101 * np.arange(3000) + generator.uniform(-0.003, 0.003, 3000)
    found = placed(clock := StreamClock(0.01), sorted(stamps.tolist()))
    assert clock.missing <= 2
    assert abs(found[-1].time - stamps[-1]) < 0.01


def test_packets_of_samples_with_one_stamp_are_no_gaps():
    stamps = np.repeat(0.04 * np.arange(1, 100), 4)
    placed(clock := StreamClock(0.01), stamps.tolist())
    assert (clock.missing, clock.repeated) == (0, 0)


def test_the_rate_is_found_from_the_stamps():
    assert placed(clock := StreamClock(), [0.02 * i for i in range(60)])
    assert clock.dt == pytest.approx(0.02)
    with pytest.raises(ValueError, match="--rate"):
        placed(StreamClock(), [1.0, 1.0])


def test_time_that_runs_backwards_is_a_bad_line():
    with pytest.raises(BadLineError, match="lies before"):
        placed(StreamClock(0.1), [1.0, 0.9])


@pytest.mark.parametrize(
    ("stamps", "restarts"),
    [
        ([0.0, 0.1, 9.0, 0.2, 0.3, 0.4, 0.5], 0),  # one wild stamp
        ([0.0, 0.1, 1e300, 0.2, 0.3, 0.4, 0.5], 0),
        ([7.0, 7.1, 7.2, 0.0, 0.1, 0.2, 0.3], 1),  # a device that was started again
    ],
)
def test_wrong_stamps_do_not_end_the_stream(stamps, restarts):
    clock, reader, found, bad = StreamClock(0.1), LineReader(), [], 0
    for number, stamp in enumerate(stamps):
        sample = reader.read(f"{stamp},{number},2,3,4,5,6")
        assert sample is not None
        try:
            for timed in clock.add(sample):
                found.append(timed)
        except BadLineError:
            bad += 1
    found += clock.finish()
    assert [timed.measurement["imu/gyr"][0] for timed in found if not timed.predicted][-2:] == [5.0, 6.0]
    assert sum(timed.restart for timed in found) == clock.restarts == restarts
    assert bad == (2 if restarts else 1)
    assert clock.missing <= 1


def test_repeated_lines_are_dropped():
    clock, reader, found = StreamClock(0.1), LineReader(), []
    for number in np.repeat(np.arange(10), 3):
        sample = reader.read(f"{0.1 * number},{number},2,3,4,5,6")
        assert sample is not None
        found += clock.add(sample)
    assert len(found) == 10
    assert (clock.missing, clock.repeated) == (0, 20)


@pytest.mark.parametrize("factor", [0.1, 0.5, 2.0, 10.0])
def test_a_rate_that_contradicts_the_stamps_is_refused(factor):
    with pytest.raises(ValueError, match=r"rate=.* Hz contradicts the time of the lines: .*, 50 Hz"):
        placed(StreamClock(factor / RATE), (np.arange(200) / RATE).tolist())


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.1])
def test_lost_samples_do_not_contradict_the_rate(factor):
    stamps = np.sort(np.random.default_rng(0).choice(400, 150, replace=False)) / RATE
    assert placed(StreamClock(factor / RATE), stamps.tolist())


def test_time_in_milliseconds_is_named():
    with pytest.raises(ValueError, match="it seems to be in ms"):
        placed(StreamClock(), (20.0 * np.arange(60)).tolist())


def test_glitches_are_estimated_as_in_a_recording(motion, tmp_path):
    wrong = {name: np.array(values) for name, values in motion.measurements.items()}
    wrong["imu/gyr"][[60, 150]] = [40.0, -30.0, 20.0]
    wrong["imu/acc"][[90, 200]] = 0.0
    wrong["imu/acc"][120] = [100.0, 150.0, -90.0]
    path, out = tmp_path / "samples.csv", tmp_path / "estimates.csv"
    path.write_text("\n".join(csv_lines(glitched := motion.replace(measurements=wrong))) + "\n")
    assert main(["stream", str(path), "--output", str(out)]) == 0
    table = np.genfromtxt(out, delimiter=",", names=True)
    up = np.stack([table[f"up_{axis}"] for axis in "xyz"], axis=1)
    with pytest.warns(UserWarning, match="glitches"):
        expected = poise.run("bounded-motion", glitched).pose["up"]
    # After a glitch the estimates are those of a recording as soon as the next samples have shown what it was.
    np.testing.assert_allclose(up[[65, 100, 130, 170, 250, -1]], expected[[65, 100, 130, 170, 250, -1]], atol=1e-6)
    apart = np.degrees(np.linalg.norm(up - expected, axis=1))
    assert apart.max() < 5.0


@pytest.mark.parametrize(("units", "said"), [({"gyr": 57.3}, "rates in deg/s"), ({"acc": 1.0 / 9.81}, "readings in g")])
def test_implausible_units_of_a_stream_are_named(motion, units, said, tmp_path, capsys):
    wrong = {name: units.get(name[4:], 1.0) * values for name, values in motion.measurements.items()}
    path = tmp_path / "samples.csv"
    path.write_text("\n".join(csv_lines(motion.replace(measurements=wrong))) + "\n")
    assert main(["stream", str(path), "--output", str(tmp_path / "out.csv")]) == 0
    assert said in capsys.readouterr().err


def test_ranges_of_sensors_are_no_samples(motion, tmp_path):
    path, plain, ranged = (tmp_path / name for name in ("samples.csv", "plain.csv", "ranged.csv"))
    jumped = np.array(motion.measurements["imu/gyr"])
    jumped[100:105] = 35.0
    path.write_text("\n".join(csv_lines(motion.replace(measurements=motion.measurements | {"imu/gyr": jumped}))) + "\n")
    assert main(["stream", str(path), "--output", str(plain)]) == 0
    assert main(["stream", str(path), "--output", str(ranged), "--full-scale", "gyr=35"]) == 0
    assert plain.read_text() != ranged.read_text()


def test_estimates_of_a_file_equal_those_of_the_recording(motion, tmp_path, capsys):
    path, out = tmp_path / "samples.csv", tmp_path / "estimates.csv"
    lines = csv_lines(motion)
    path.write_text("\n".join([*lines[:100], "broken", *lines[100:]]) + "\n")
    assert main(["stream", str(path), "--output", str(out)]) == 0
    table = np.genfromtxt(out, delimiter=",", names=True)
    up = np.stack([table[f"up_{axis}"] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(up, poise.run("bounded-motion", motion).pose["up"], atol=1e-6)
    said = capsys.readouterr().err
    assert "line 101: 'broken' is not a number; it is skipped" in said
    assert f"{len(motion)} samples at 50 Hz, 0 missing ones predicted; 1 bad lines skipped" in said
    assert "time per estimate of bounded-motion: median" in said


@pytest.mark.parametrize(
    ("words", "text", "said"),
    [
        (["--rate", "-1"], "0,1,2,3,4,5,6\n", "rate must be a positive number"),
        (["--units", "gyr"], "0,1,2,3,4,5,6\n", "kind=unit"),
        (["--send", "nowhere"], "0,1,2,3,4,5,6\n", "HOST:PORT"),
        (["--send", "127.0.0.1:9901", "--output", "out.csv"], "", "--output or to --send, not to both"),
        (["--udp", "9900"], "", "a source or from --udp, not from both"),
        (["--estimator", "vqf-9", "--rate", "50"], "0,1,2,3,4,5,6\n" * 60, "imu/mag"),
        ([], "a,b\n" * 30, "none of the first 20 lines is a sample"),
        ([], "1,2,3,4,5,6\n" * 60, "--rate"),
        ([], "", "no sample came"),
        ([], "1,2\n", "lines of 2 values without names"),
        (["--units", "gyr=furlong"], "0,1,2,3,4,5,6\n", "furlong"),
        (["--estimator", "mekf (offline)"], "0,1,2,3,4,5,6\n", "a smoother needs the whole recording"),
        (["--full-scale", "gyr=-1", "--rate", "50"], "0,1,2,3,4,5,6\n", "full_scale must be kind=number"),
        (["--full-scale", "temp=1", "--rate", "50"], "0,1,2,3,4,5,6\n", "full_scale: unknown kind 'temp'"),
    ],
)
def test_wrong_input_is_named(words, text, said, tmp_path, capsys):
    path = tmp_path / "samples.csv"
    path.write_text(text)
    assert main(["stream", str(path), *words]) == 2
    assert said in capsys.readouterr().err


def test_standard_input_and_output(motion, monkeypatch, capsys, tmp_path):
    path = tmp_path / "lines.json"
    numbers = rows(motion)[:80]
    path.write_text(
        "".join(f'{{"time": {r[0]}, "gyr": {r[1:4].tolist()}, "acc": {r[4:].tolist()}}}\n' for r in numbers)
    )
    with path.open() as file:
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.FileIO(file.fileno(), closefd=False)))
        assert main(["stream", "--estimator", "tilt", "--rate", "50"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert len(out) == 80
    assert out[0].startswith('{"time": 0.0, "roll": ')


def test_a_growing_file_is_followed(tmp_path):
    path = tmp_path / "growing.csv"
    path.write_text("one\ntw")
    lines = file_lines(path, follow=True, baud=115200)
    assert next(lines) == "one"
    assert next(lines) is None
    with path.open("a") as file:
        file.write("o\nthree\n")
    assert [line for line in (next(lines) for _ in range(4)) if line is not None][:2] == ["two", "three"]
    lines.close()


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="there are no pseudo-terminals")
def test_a_serial_device_is_read_until_it_is_closed():
    master, slave = os.openpty()
    lines = file_lines(os.ttyname(slave), follow=False, baud=9600)  # type: ignore[arg-type]
    os.write(master, b"0.01,1,2\n0.02,")
    assert [line for line in (next(lines) for _ in range(3)) if line] == ["0.01,1,2"]
    os.write(master, b"3,4\n")
    assert next(line for line in lines if line) == "0.02,3,4"
    os.close(slave)
    os.close(master)
    assert list(lines) == []
    slave = os.openpty()[1]
    with pytest.raises(ValueError, match="baud must be one of"):
        file_lines(os.ttyname(slave), follow=False, baud=12345)  # type: ignore[arg-type]


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_datagrams_hold_one_or_several_lines():
    port = free_port()
    lines = datagrams(port)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(b"a\nb\n", ("127.0.0.1", port))
        sender.sendto(b"c", ("127.0.0.1", port))
    assert [next(lines) for _ in range(3)] == ["a", "b", "c"]
    assert next(lines) is None
    lines.close()
    with pytest.raises(ValueError, match="port"):
        datagrams(70000)


def test_estimates_are_sent_as_datagrams(motion, tmp_path):
    path = tmp_path / "samples.csv"
    path.write_text("\n".join(csv_lines(motion)[:60]))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)
        port = receiver.getsockname()[1]
        words = ["stream", str(path), "--estimator", "tilt", "--send", f"127.0.0.1:{port}"]
        thread = threading.Thread(target=main, args=(words,))
        thread.start()
        header = receiver.recv(4096).decode()
        first = receiver.recv(4096).decode()
        thread.join(10.0)
    assert header.startswith("time,roll,pitch")
    assert float(first.split(",")[0]) == pytest.approx(0.0)
    assert not thread.is_alive()
