"""Time stamps of text tables: dates, zones, counters that wrap, units that nothing names."""

from __future__ import annotations

import warnings
from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from poise.envs.data.formats.load import load_recording
from poise.envs.data.formats.tables.arrays import read_table
from poise.envs.data.formats.tables.stamps import as_seconds


def written(folder: Path, content: str) -> Path:
    path = folder / "a.csv"
    path.write_text(content)
    return path


@pytest.mark.parametrize(
    "stamp",
    [
        lambda k: f"2024-05-01T12:00:{k / 100:09.6f}Z",
        lambda k: f"2024-05-01 12:00:{k / 100:06.3f}",
        lambda k: f"2024-05-01T12:00:{k / 100:06.3f}+02:00",
        lambda k: f"2024-05-01 12:00:{k / 100:09.6f} UTC",
        lambda k: f"31/05/2024 12:00:{k / 100:06.3f}",
        lambda k: f"12:00:{k / 100:06.3f}",
        lambda k: f"2024-05-01T23:59:{k / 100 + 59.8:06.3f}Z" if k < 20 else f"2024-05-02T00:00:{k / 100 - 0.2:06.3f}Z",
        *(
            lambda k, form=form: (datetime(2024, 3, 12, 23, 59, 59, 800000) + k * timedelta(milliseconds=10)).strftime(
                form
            )
            for form in (
                "%m/%d/%Y %I:%M:%S.%f %p",
                "%d/%m/%Y %I:%M:%S.%f %p",
                "%d/%m/%y %H:%M:%S.%f",
                "%d-%b-%Y %H:%M:%S.%f",
                "%Y%m%d %H:%M:%S.%f",
                "%Y%m%d_%H:%M:%S:%f",
                "%Y%m%dT%H%M%S.%f",
                "%Y-%m-%d %H-%M-%S-%f",
                "%Y/%m/%d %I:%M:%S.%f%p",
                "%d.%m.%Y %H:%M:%S.%f",
            )
        ),
        lambda k: (
            f"11:{59 + (k >= 20)}:{(k / 100 + 59.8) % 60:06.3f} AM" if k < 20 else f"12:00:{k / 100 - 0.2:06.3f} p.m."
        ),
    ],
)
def test_dates_are_times(tmp_path, stamp):
    rows = "".join(f"{stamp(k)},{k},1,2\n" for k in range(50))
    table = read_table(written(tmp_path, "timestamp,x,y,z\n" + rows))
    seconds = as_seconds(table.column("timestamp"), table.units["timestamp"]).elapsed
    np.testing.assert_allclose(seconds, np.arange(50) / 100.0, atol=1e-6)


def test_a_leap_second_is_one_second_long(tmp_path):
    stamps = [f"2016-12-31T23:59:{59 + k / 100:05.2f}Z" for k in range(200)]
    stamps += [f"2017-01-01T00:00:{k / 100:05.2f}Z" for k in range(100)]
    table = read_table(written(tmp_path, "timestamp,x,y,z\n" + "".join(f"{stamp},1,2,3\n" for stamp in stamps)))
    np.testing.assert_allclose(as_seconds(table.column("timestamp"), "ns").elapsed, np.arange(300) / 100, atol=1e-9)


@pytest.mark.parametrize("form", ["%Y%m%d%H%M%S%f", "%H%M%S.%f"])
def test_digits_of_a_calendar_are_times(form):
    moments = [datetime(2024, 3, 5, 11, 59, 59) + k * timedelta(milliseconds=20) for k in range(100)]
    stamps = [moment.strftime(form)[: 17 if "Y" in form else None] for moment in moments]
    values = np.array([int(stamp) if "Y" in form else float(stamp) for stamp in stamps])
    np.testing.assert_allclose(as_seconds(values, "").elapsed, 0.02 * np.arange(100.0), atol=1e-9)


def test_whole_nanoseconds_keep_their_digits(tmp_path):
    start = 1403715273262142976
    rows = "".join(f"{start + 5_000_001 * k},1,2,3\n" for k in range(50))
    table = read_table(written(tmp_path, "#timestamp [ns],x,y,z\n" + rows))
    stamps = as_seconds(table.column("timestamp"), table.units["timestamp"])
    np.testing.assert_allclose(np.diff(stamps.elapsed), 5.000001e-3, rtol=1e-9)
    assert stamps.first == start
    assert stamps.since(start - 1_000_000_000)[0] == 1.0


@pytest.mark.parametrize(
    ("end", "step"),
    [(2**16, 1), (2**32, 16667), (256, 1), (2**16, 3), (60_000, 10), (604_800_000, 5), (604_800 * 10**9, 10**7)],
)
def test_counters_wrap(end, step):
    count = (end - 20 * step + step * np.arange(50)) % end
    np.testing.assert_array_equal(as_seconds(count, "s").elapsed, step * np.arange(50.0))


@pytest.mark.parametrize("bits", [8, 16, 32])
def test_signed_counters_wrap(bits):
    step = max(1, 2**bits // 10_000)
    count = (2**bits - 20 * step + step * np.arange(50)) % 2**bits - 2 ** (bits - 1)
    np.testing.assert_array_equal(as_seconds(count, "s").elapsed, step * np.arange(50.0))


@pytest.mark.parametrize("period", [60, 3600, 86_400, 604_800])
def test_seconds_of_a_period_start_again(period):
    stamps = np.round((period - 0.203 + np.arange(50) / 100) % period, 3)
    np.testing.assert_allclose(as_seconds(stamps, "s").elapsed, np.arange(50) / 100, atol=1e-9)


@pytest.mark.parametrize(("tick", "rate"), [(1 / 32_768, 100.0), (1 / 32_768, 51.2), (39.0625e-6, 30.0)])
def test_ticks_of_a_quartz_are_told_by_the_rate(tick, rate):
    with pytest.warns(UserWarning, match="taken for ticks"):
        stamps = as_seconds(np.rint(np.arange(500) / rate / tick).astype(int), "")
    np.testing.assert_allclose(stamps.elapsed, np.arange(500) / rate, atol=tick)
    with pytest.raises(ValueError, match=r"ticks of 1/32768 s \(128 Hz\), ticks of 39.0625 µs \(100 Hz\)"):
        as_seconds(256 * np.arange(500), "")
    np.testing.assert_allclose(as_seconds(256 * np.arange(500), "39.0625 us").elapsed, np.arange(500) / 100)


@pytest.mark.parametrize(
    ("name", "scale"), [("t_ms", 1e3), ("timestampUs", 1e6), ("Time (0.1 ms)", 1e4), ("micros", 1e6)]
)
def test_the_name_of_a_column_tells_the_unit(tmp_path, name, scale):
    rows = "".join(f"{k / 100 * scale:.0f},0.1,0.2,0.3,0,0,1\n" for k in range(50))
    names = "gyr_x [rad/s],gyr_y [rad/s],gyr_z [rad/s],acc_x [g],acc_y [g],acc_z [g]"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        recording = load_recording(written(tmp_path, f"{name},{names}\n{rows}"))
    np.testing.assert_allclose(recording.time, np.arange(50) / 100, atol=1e-9)


def test_times_that_run_backwards_are_refused_and_neighbours_may_change_places():
    for stamps in (np.r_[0:50, 20:70] / 100.0, np.r_[0:50, 0:50] / 100.0):
        with pytest.raises(ValueError, match=r"column time must increase, got .* set back, or several recordings"):
            as_seconds(stamps, "s")
    assert as_seconds(np.r_[0:10, 11, 10, 12:50] / 100.0, "s").elapsed[11] == pytest.approx(0.10)
    with pytest.raises(ValueError, match="column time holds no time in row 3"):
        as_seconds(np.array([0.0, 1.0, 2.0, np.nan]), "s")


@pytest.mark.parametrize(("unit", "scale"), [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)])
@pytest.mark.parametrize("rate", [25.0, 100.0, 1000 / 3])
def test_the_unit_of_stamps_without_one_is_told_by_their_interval(unit, scale, rate):
    with pytest.warns(UserWarning, match=rf"taken for {unit} \({rate:.4g} Hz\)"):
        stamps = as_seconds(np.arange(100) / rate / scale, "")
    assert stamps.scale == scale


@pytest.mark.parametrize(
    ("stamps", "unit"),
    [
        ([f"{(23 + (3595 + k // 100) // 3600) % 24:02d}:{(3595 + k // 100) // 60 % 60:02d}:{(3595 + k // 100) % 60:02d}"
          f".{k % 100:02d}" for k in range(1000)], ""),
        ([str((86_399_000 + 10 * k) % 86_400_000) for k in range(1000)], "ms"),
        ([str((86_399_000_000 + 10_000 * k) % 86_400_000_000) for k in range(1000)], "us"),
    ],
)  # fmt: skip
def test_a_time_of_the_day_goes_on_after_midnight(tmp_path, stamps, unit):
    time = f"Time [{unit}]" if unit else "Time"
    rows = [f"{time},gyr_x [rad/s],gyr_y [rad/s],gyr_z [rad/s],acc_x [g],acc_y [g],acc_z [g]"]
    rows += [f"{stamp},0.1,0.2,0.3,0,0,1" for stamp in stamps]
    recording = load_recording(written(tmp_path, "\n".join(rows)))
    np.testing.assert_allclose(recording.time, np.arange(1000) / 100, atol=1e-9)


@pytest.mark.parametrize("form", ["%d.%m.%Y %H:%M:%S.%f", "%Y-%m-%d %H:%M:%S.%f", "%I:%M:%S.%f %p"])
@pytest.mark.parametrize(("month", "day"), [(3, 29), (10, 25)])
def test_local_times_without_a_zone_go_on_where_clocks_change(tmp_path, form, month, day):
    start = datetime(2026, month, day, 0, 59, 58, tzinfo=UTC)
    local = [(start + k * timedelta(milliseconds=20)).astimezone(ZoneInfo("Europe/Berlin")) for k in range(300)]
    rows = "".join(f"{moment.strftime(form)},{k},1,2\n" for k, moment in enumerate(local))
    with pytest.warns(UserWarning, match="change of the clocks"):
        table = read_table(written(tmp_path, "timestamp,x,y,z\n" + rows))
    np.testing.assert_allclose(as_seconds(table.column("timestamp"), "ns").elapsed, 0.02 * np.arange(300.0), atol=1e-6)


def test_an_hour_without_samples_is_no_change_of_the_clocks(tmp_path):
    """It does not end at a full hour, or the zone is told."""
    for forms in (("12:10:{:06.3f}", "13:10:{:06.3f}"), ("2026-03-29T01:59:{:06.3f}Z", "2026-03-29T03:00:{:06.3f}Z")):
        stamps = [form.format(k / 50) for form in forms for k in range(60)]
        table = read_table(written(tmp_path, "timestamp,x\n" + "".join(f"{stamp},1\n" for stamp in stamps)))
        assert as_seconds(table.column("timestamp"), "ns").elapsed[-1] > 3600.0


@pytest.mark.parametrize(("before", "after"), [("CET", "CEST"), ("EST", "EDT"), ("PST", "PDT")])
def test_zones_have_names(tmp_path, before, after):
    stamps = [f"2026-03-29 01:59:{59 + k / 50:06.3f} {before}" for k in range(50)]
    stamps += [f"2026-03-29 03:00:{k / 50:06.3f} {after}" for k in range(50)]
    table = read_table(written(tmp_path, "time,x\n" + "".join(f"{stamp},1\n" for stamp in stamps)))
    np.testing.assert_allclose(as_seconds(table.column("time"), "ns").elapsed, 0.02 * np.arange(100.0), atol=1e-6)


@pytest.mark.parametrize("start", [12.0, 3598.5])
def test_minutes_and_seconds_are_a_time(tmp_path, start):
    """Spreadsheets show times of the day so, and lose the hour."""
    stamps = [f"{int(t // 60 % 60):02d}:{t % 60:06.3f}" for t in start + np.arange(200) / 100]
    table = read_table(written(tmp_path, "Time,x\n" + "".join(f"{stamp},1\n" for stamp in stamps)))
    np.testing.assert_allclose(as_seconds(table.column("Time"), "ns").elapsed, np.arange(200) / 100, atol=1e-6)


@pytest.mark.parametrize("origin", [46000.5, 739000.5])
def test_days_of_spreadsheets_and_matlab_are_a_time(origin):
    stamps = as_seconds(origin + np.arange(500) / 100 / 86_400, "")
    np.testing.assert_allclose(stamps.elapsed, np.arange(500) / 100, atol=1e-4)


@pytest.mark.parametrize(
    ("seconds", "fraction", "unit"),
    [("sec", "msec", 1e3), ("stamp.secs", "stamp.nsecs", 1e9), ("time_s", "time_us", 1e6), ("t_seconds", "t_ms", 1e3)],
)
def test_fractions_of_seconds_may_have_a_column_of_their_own(tmp_path, seconds, fraction, unit):
    rows = [f"{7 + (50 + k) // 100},{(50 + k) % 100 * unit / 100:.0f},0,0,0,0,0,9.8" for k in range(400)]
    head = f"{seconds},{fraction},gx,gy,gz,ax,ay,az"
    path = written(tmp_path, "\n".join([head, *rows, ""]))
    recording = load_recording(path, columns={"gyr": ["gx", "gy", "gz"], "acc": ["ax", "ay", "az"]}, time=seconds)
    np.testing.assert_allclose(recording.time, np.arange(400) / 100, atol=1e-9)
