"""Time stamps of tables in seconds: dates, units, whole numbers beyond float64, counters that wrap, order of rows."""

from __future__ import annotations

import re
import warnings
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...clock import USUAL_RATES
from .table import UNITS, factor

if TYPE_CHECKING:
    import pandas

ZONES = {"WET": 0, "BST": 1, "WEST": 1, "CET": 1, "CEST": 2, "EET": 2, "EEST": 3, "JST": 9, "EST": -5, "EDT": -4}
ZONES |= {"CST": -6, "CDT": -5, "MST": -7, "MDT": -6, "PST": -8, "PDT": -7}
"""Name of a time zone → hours east of Greenwich."""
CLOCK = r"\d\d?:\d\d(:\d\d([.,:]\d+)?|[.,]\d+)?(\s*[ap]\.?m\.?)?"
CALENDAR = r"(\d{4}([-/.]\d\d?[-/.]\d\d?|\d{4})|\d\d?[-/. ](\d\d?|[a-z]{3,9})[-/. ](\d{4}|\d\d))"
OTHER_CLOCK = r"(?P<h>\d\d)(?P<mark>[-.]?)(?P<m>\d\d)(?P=mark)(?P<s>\d\d)([-_.,](?P<f>\d+))?"
"""A time of the day without colons, after a date."""
DATE = re.compile(
    rf"(({CALENDAR}(T|_|,?\s+))?{CLOCK}|{CALENDAR}(T|_|\s){OTHER_CLOCK})"
    rf"\s*(Z|UTC|GMT|{'|'.join(ZONES)}|[-+]\d\d:?\d\d)?",
    re.IGNORECASE,
)
"""A date with a time, a time of the day of 24 or twice 12 hours, or minutes, seconds and their fraction; with a time
zone or without."""
HOUR, DAY, WEEK = 3600, 86_400, 604_800
WRAPS = (
    100,
    2**8,
    1000,
    2**10,
    2**12,
    10**4,
    2**16,
    10**5,
    2**24,
    2**32,
    10**6,
    *(period * per_second for period in (60, HOUR, DAY, WEEK) for per_second in (10**3, 10**6, 10**9)),
)
"""Ends of counters after which they start again at 0 (or at minus the half): seconds every minute, a time of the day at
midnight, a satellite's time of the week on Sundays."""
PERIODS = (60, HOUR, DAY, WEEK)
"""s after which seconds with a fraction start again."""
FURTHEST_BACK = 2.5
"""Intervals by which rows may be out of order."""
EPOCHS = (
    *(
        (1.0, 3e8, 4e9),
        (1e-3, 3e11, 4e12),
        (1e-4, 4e12, 4e13),
        (1e-6, 3e14, 4e15),
        (1e-7, 1.2e17, 1.5e17),
        (1e-7, 6.2e17, 6.6e17),
    ),
    *((1e-9, 3e17, 4e18), (86_400.0, 2.9e4, 7.7e5), (86_400.0, 2.44e6, 2.49e6)),
)
"""s per unit, and stamps in that unit of the years 1980 to 2090: since 1970 (since 1601 or the year 1 in 100 ns, as
Windows counts; since 1900 or the year 0 in days, as Excel and MATLAB do, and as Julian dates)."""
TICKS = {"ticks of 1/32768 s": 1.0 / 32_768.0, "ticks of 39.0625 µs": 39.0625e-6}
"""Units of clocks of quartzes and of motion sensors, which look like µs of a sensor that is too fast."""
TICK_RATES = (*USUAL_RATES, 51.2, 102.4, 204.8, 409.6)
"""Hz; rates of sensors with such a clock."""
FAST = 1000.0
"""Hz, faster than most recorders write."""
PLAUSIBLE = (2e-4, 0.2)
"""s; an interval in these bounds tells the unit of stamps without one: they are a thousand times apart."""


class Stamps(NamedTuple):
    """Stamps of a column: s from the first one, that one in its own unit, and s per unit."""

    elapsed: np.ndarray
    first: float | int
    scale: float

    def since(self, origin: float | int) -> np.ndarray:
        """Seconds ``(N,)`` from an origin in the unit of the stamps; whole numbers are subtracted as such."""
        return self.elapsed + (self.first - origin) * self.scale


def as_seconds(stamps: np.ndarray, unit: str, name: str = "time") -> Stamps:
    """Stamps ``(N,)`` in seconds.

    Args:
        stamps: whole or real numbers; whole ones are subtracted before they are converted, so that nanoseconds since
            1970 keep their last digits.
        unit: of the stamps; empty: the one in which the interval is that of an inertial sensor, with a warning if that
            is not the second.
        name: of the column, for messages.

    Raises:
        ValueError: a stamp is missing, the unit is unknown, or time runs backwards.
    """
    values = np.asarray(stamps)
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        raise ValueError(f"column {name} holds no time in row {int(np.flatnonzero(~np.isfinite(values))[0])}")
    if values.dtype.kind == "f" and np.all(values == np.rint(values)) and np.abs(values).max(initial=0.0) < 2**53:
        values = values.astype(np.int64)
    values = values.astype(np.int64) if values.dtype.kind in "iub" else values.astype(float)
    calendar = None if unit or not len(values) else unpacked(values)
    if calendar is not None:
        values, unit = calendar, "ns"
    steps = np.diff(values)
    repaired = unwrapped(steps, values)
    if values.dtype.kind == "f" and repaired is steps:
        elapsed = values - values[0]
    else:
        elapsed = np.concatenate([[0], np.cumsum(repaired)]).astype(float)
    steps = np.diff(elapsed)
    # The samples of a packet are much nearer to each other than usual.
    usual = max(float(np.median(np.abs(steps))), float(np.ptp(elapsed)) / len(steps)) if len(steps) else 0.0
    # A few rows that changed places are sorted later; a clock that was set back, or a second recording, is not.
    newest_first = len(steps) > 1 and bool((steps <= 0.0).all()) and float((steps < 0.0).mean()) > 0.5
    if len(steps) and not newest_first and ((steps < 0.0).mean() > 0.05 or steps.min() < -FURTHEST_BACK * usual):
        row = int(np.argmin(steps)) + 1
        raise ValueError(
            f"column {name} must increase, got {stamps[row]} in row {row} after {stamps[row - 1]}: a clock that was "
            "set back, or several recordings in one file"
        )
    scale = factor("time", unit) if unit else likely_unit(elapsed, name, float(values[0]))
    return Stamps(elapsed * scale, values[0].item(), scale)


def unwrapped(steps: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Steps of a counter, or of a time of the minute, hour, day or week, without its restarts."""
    back = steps < 0
    if not back.any() or back.sum() > max(2, 0.02 * len(back)):
        return steps
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    lowest, highest = values.min(), values.max()
    for end in WRAPS if values.dtype.kind == "i" else PERIODS:
        repaired = np.where(back, steps + end, steps)
        longest = min(50.0 * usual, 0.1 * end + 5.0 * usual)
        inside = (lowest >= 0 and highest < end) or (
            lowest >= -end // 2 and highest < end // 2 and end & (end - 1) == 0
        )
        if inside and np.all(repaired[back] >= 0) and np.all(repaired[back] <= longest):
            return repaired
    return steps


def likely_unit(elapsed: np.ndarray, name: str, first: float = 0.0) -> float:
    """Seconds per unit of stamps whose header names none: that of a calendar, or of a plausible interval."""
    steps = np.diff(elapsed)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    if PLAUSIBLE[0] <= usual < PLAUSIBLE[1] or usual == 0.0:
        return 1.0
    for scale, earliest, latest in EPOCHS:
        if earliest < first < latest and PLAUSIBLE[0] <= usual * scale < PLAUSIBLE[1]:
            return scale
    units = {unit: UNITS["time"][unit] for unit in ("ms", "us", "ns")}
    if PLAUSIBLE[0] <= usual * units["us"] < 1.0 / FAST:
        each = steps[np.abs(steps - usual) < 1.5].mean()
        rates = {unit: 1.0 / (each * scale) for unit, scale in TICKS.items()}
        fitting = {unit: rate for unit, rate in rates.items() if np.isclose(rate, TICK_RATES, rtol=1e-3).any()}
        if len(fitting) > 1:
            choices = ", ".join(f"{unit} ({rate:.4g} Hz)" for unit, rate in fitting.items())
            raise ValueError(f"column {name} counts {usual:g} a sample: {choices}? Say units={{'time': '39.0625 us'}}")
        units = {unit: TICKS[unit] for unit in fitting} | units
    for unit, scale in units.items():
        if PLAUSIBLE[0] <= usual * scale < PLAUSIBLE[1] and usual != 1.0:
            warnings.warn(
                f"column {name} names no unit; its interval of {usual:g} is taken for {unit} "
                f"({1 / (usual * scale):.4g} Hz): name units={{'time': …}} if it is another",
                stacklevel=6,
            )
            return scale
    return 1.0


def nanoseconds(texts: pandas.Series) -> np.ndarray | None:
    """Dates or times of the day as whole ns since the first midnight; None where a text is neither.

    Where day and month cannot be told apart, they are in the order in which the recording is the shorter.
    """
    import pandas

    plain = texts.str.replace(",", ".", regex=False).str.replace(r"\s*(UTC|GMT)$", "Z", regex=True, case=False)
    plain = plain.str.replace(r"(\d)_(\d)", r"\1 \2", regex=True).str.replace(r"(\d)\.(\s)", r"\1\2", regex=True)
    plain = plain.str.replace(r"([ap])\.?m\.?$", r"\1m", regex=True, case=False)
    if ":" not in str(plain.iloc[0]):
        clock = rf"(?<=[T_\s]){OTHER_CLOCK}"
        plain = plain.str.replace(clock, r"\g<h>:\g<m>:\g<s>.\g<f>", regex=True, case=False)
    leap = plain.str.contains(r":\d\d:60\b").to_numpy(dtype=bool)
    if leap.any():
        # The rows of a leap second, and all after it, are one second later than the calendar says.
        found = nanoseconds(plain.str.replace(r"(:\d\d):60\b", r"\1:59", regex=True))
        return None if found is None else found + 10**9 * (np.arange(len(found)) >= np.flatnonzero(leap)[0])
    plain = plain.str.replace(r"(:\d\d:\d\d):(\d+)", r"\1.\2", regex=True)
    for zone, hours in ZONES.items():
        plain = plain.str.replace(rf"\s*\b{zone}$", f"{hours:+03d}:00", regex=True, case=False)
    first = str(plain.iloc[0])
    if re.fullmatch(CLOCK, first, re.IGNORECASE):
        if not first.lower().endswith("m"):
            of_day = re.match(r"\d\d?:\d\d\.", first) is None
            found = whole(pandas.to_timedelta(plain if of_day else "00:" + plain, errors="coerce"))
            return with_one_clock(found) if of_day else found
        plain = "2000-01-01 " + plain
    readings: list[np.ndarray] = []
    for day_first in (True, False) if not re.match(r"\d{4}", first) else (False,):
        with warnings.catch_warnings():
            # pandas tells that some dates are of the other order
            warnings.simplefilter("ignore", UserWarning)
            read = pandas.to_datetime(plain, errors="coerce", utc=True, format="mixed", dayfirst=day_first)
        found = whole(read - read.iloc[0].normalize()) if read.notna().all() else None
        readings += [] if found is None else [found]
    earliest = min(readings, key=lambda stamps: int(np.ptp(stamps)), default=None)
    return earliest if re.search(r"(Z|[-+]\d\d:?\d\d)$", first) else with_one_clock(earliest)


def with_one_clock(stamps: np.ndarray | None) -> np.ndarray | None:
    """Local times ``(N,)`` in ns without the change of clocks in spring and autumn, with a warning.

    Such a change is a step of an hour or a half, forwards or back, to a full one.
    """
    if stamps is None or len(stamps) < 3:
        return stamps
    steps = np.diff(stamps)
    near = max(int(3 * np.median(np.abs(steps))), 1)
    for change, words in ((HOUR * 10**9, "one hour"), (HOUR * 10**9 // 2, "half an hour")):
        changes = (np.abs(np.abs(steps) - change) <= near) & (stamps[1:] % change <= near)
        if changes.sum() == 1:
            row = int(np.flatnonzero(changes)[0]) + 1
            warnings.warn(
                f"the local time steps by {words} in row {row}: taken for a change of the clocks", stacklevel=6
            )
            return stamps - change * np.sign(steps[row - 1]) * (np.arange(len(stamps)) >= row)
    return stamps


def whole(times: pandas.Series) -> np.ndarray | None:
    """Whole ns; None if one is missing."""
    return None if times.isna().any() else times.to_numpy(dtype="timedelta64[ns]").astype(np.int64)


def unpacked(values: np.ndarray) -> np.ndarray | None:
    """Whole ns of dates or times written as digits; None of other numbers.

    ``20240305115959000`` is 5 March 2024, 11:59:59.000; ``115959.5`` half a second before noon. The latter looks like
    seconds and is known by its jump of 40 where a minute begins.
    """
    import pandas

    seconds, minutes = values % 100, values // 100 % 100
    jumps = np.flatnonzero(np.diff(values) >= 40)
    of_day = values.min() >= 0 and values.max() < 240_000 and seconds.max() < 60 and minutes.max() < 60
    if of_day and len(jumps) and np.all(seconds[jumps] >= 59) and np.all(seconds[jumps + 1] < 1):
        return np.rint((3600.0 * (values // 10_000) + 60.0 * minutes + seconds) * 1e9).astype(np.int64)
    digits = len(str(abs(int(values[0]))))
    years = str(abs(int(values[0])))[:4]
    whole_digits = values.dtype.kind in "iu" and digits in (14, 17) and len(str(abs(int(values[-1])))) == digits
    if not whole_digits or not "1970" <= years <= "2100":
        return None
    texts = pandas.Series(values).astype("string")
    pattern = texts.str[:14] + "." + (texts.str[14:] if digits == 17 else "0")
    return whole(
        pandas.to_datetime(pattern, format="%Y%m%d%H%M%S.%f", errors="coerce", utc=True) - pandas.Timestamp(0, tz="utc")
    )
