"""Estimate sample by sample while lines of samples arrive; each estimate is a line.

Lines are comma-separated values or JSON objects: time, gyroscope, accelerometer, magnetometer. They come from standard
input, a file, a serial device or UDP. A missing sample is predicted. A line that is not a sample is counted and named
on standard error. At the end it says how long an estimate took.
"""

from __future__ import annotations

import json
import socket
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from ...filters.support.names import unknown
from ..targets import check_file
from .lines import LineFormat
from .sources import lines_of

if TYPE_CHECKING:
    from ...filters.core.quantity import Channel, Estimate
    from .lines import Layout, LineReader
    from .online import StreamClock, Timed

NAMED = 10
"""Bad lines that are named one by one; the others are only counted."""
CHECKED = 10.0
"""s from the beginning whose samples are checked for wrong units, signs and axes."""
HOPELESS = 20
"""Lines from the beginning that may be bad before the stream is refused: a serial line may begin in the middle."""


@dataclass
class Args:
    """Arguments of ``poise stream``."""

    source: tyro.conf.Positional[str] = "-"
    """where lines come from: - for standard input, or a file, named pipe or serial device"""
    estimator: str = "bounded-motion"
    """name of the estimator, see `poise list estimators`"""
    udp: int | None = None
    """receive lines as UDP datagrams on this port instead"""
    rate: float | None = None
    """sampling rate, Hz; by default estimated from the first 50 stamps, whose estimates are then late"""
    columns: tuple[str, ...] = ()
    """names of the values of a line, such as time gyr_x gyr_y gyr_z acc_x acc_y acc_z; - for one that is not read;
    by default those of a header, of a JSON object, or time, gyr, acc, mag"""
    units: tuple[str, ...] = ()
    """units where they are not SI, as kind=unit (gyr=deg/s acc=g time=ms)"""
    full_scale: tuple[str, ...] = ()
    """ranges of sensors as kind=number in the unit of the lines (gyr=2000 acc=16); samples at a range count as
    missing"""
    format: LineFormat = "auto"
    """format of the lines, also of the estimates"""
    follow: bool = False
    """wait for more lines at the end of a file"""
    baud: int = 115200
    """rate of a serial device"""
    output: Path | None = None
    """file of the estimates; standard output by default"""
    send: str | None = None
    """send estimates as UDP datagrams to HOST:PORT instead"""


@dataclass
class Counts:
    """What became of the lines.

    Attributes:
        samples: lines that were samples.
        bad: lines that were not.
        reason: why the last of these was not.
    """

    samples: int = 0
    bad: int = 0
    reason: str = ""

    def complain(self, number: int, reason: str) -> None:
        """Count a bad line, and name it if it is among the first.

        Raises:
            ValueError: there was no sample yet after so many lines.
        """
        self.bad += 1
        self.reason = reason
        if self.bad <= NAMED:
            print(f"poise: warning: line {number}: {reason}; it is skipped", file=sys.stderr, flush=True)
        if not self.samples and self.bad >= HOPELESS:
            raise ValueError(f"none of the first {self.bad} lines is a sample; the last one: {self.reason}")


def timed_samples(
    lines: Iterator[str | None], reader: LineReader, clock: StreamClock, counts: Counts
) -> Iterator[Timed | None]:
    """Samples of lines on the clock of the stream; None whenever none came for a moment.

    Raises:
        ValueError: the lines are not samples, or their rate is unknown.
    """
    from .lines import BadLineError

    for number, line in enumerate(lines, start=1):
        if line is None:
            yield None
            continue
        try:
            sample = reader.read(line)
            if sample is None:
                continue
            yield from clock.add(sample)
            counts.samples += 1
        except BadLineError as reason:
            counts.complain(number, str(reason))
    yield from clock.finish()


def reader_of(args: Any, channels: Sequence[Channel]) -> LineReader:
    """What reads the lines, by the arguments of a command.

    Raises:
        ValueError: columns or units that cannot be.
    """
    from .lines import LineReader

    units = {}
    for text in args.units:
        kind, sign, unit = text.partition("=")
        if not sign:
            raise ValueError(f"units must be kind=unit, such as gyr=deg/s, got {text!r}")
        units[kind] = unit
    return LineReader(args.columns, units, channels, args.format)


def ranges_of(texts: Sequence[str], layout: Layout) -> dict[str, float]:
    """Channel → range in SI units, from texts kind=number in the unit of the lines.

    Raises:
        ValueError: an unknown kind, or no positive number.
    """
    ranges: dict[str, float] = {}
    kinds = sorted({name.rpartition("/")[2] for name in layout.channels})
    for text in texts:
        kind, _, number = text.partition("=")
        if kind not in kinds:
            raise ValueError(f"full_scale: {unknown('kind', kind, kinds)}")
        try:
            value = float(number)
        except ValueError:
            value = float("nan")
        if not 0.0 < value < float("inf"):
            raise ValueError(f"full_scale must be kind=number, a positive one, such as gyr=2000, got {text!r}")
        ranges |= {name: value * scale for name, (_, scale) in layout.channels.items() if name.endswith(f"/{kind}")}
    return ranges


@dataclass
class FirstSamples:
    """The beginning of a stream, which is checked like a recording (:func:`poise.check_recording`).

    Attributes:
        dt: sampling interval, s.
    """

    dt: float
    _samples: list[Timed] = field(default_factory=list, init=False)
    _thread: threading.Thread | None = field(default=None, init=False)

    def add(self, sample: Timed) -> None:
        """One more sample; when there are enough, they are checked beside the estimation."""
        if self._thread is None:
            self._samples.append(sample)
            if len(self._samples) * self.dt >= CHECKED:
                self._thread = threading.Thread(target=self._check, daemon=True)
                self._thread.start()

    def finish(self) -> None:
        """Check what there is, if it was not done yet."""
        if self._thread is None:
            self._check()
        else:
            self._thread.join()

    def _check(self) -> None:
        import numpy as np

        from ...envs.data.plausibility.recording import check_recording
        from ...envs.data.trajectory import Trajectory

        # A restart would be a gap.
        restarts = [place for place, sample in enumerate(self._samples) if sample.restart]
        whole = self._samples[restarts[-1] if restarts else 0 :]
        channels = {name: np.array([each.measurement[name] for each in whole]) for name in whole[0].measurement}
        metadata = {"name": "the stream", "nominal_rate": 1.0 / self.dt}
        for finding in check_recording(Trajectory(self.dt * np.arange(len(whole)), channels, metadata=metadata)):
            if finding.severity == "warning":
                print(f"poise: warning: {finding}", file=sys.stderr, flush=True)


def clock_of(rate: float | None) -> StreamClock:
    """The clock of a stream of a rate in Hz.

    Raises:
        ValueError: the rate is not positive.
    """
    from .online import StreamClock

    if rate is not None and not 0.0 < rate < float("inf"):
        raise ValueError(f"rate must be a positive number of Hz, got {rate}")
    return StreamClock(None if rate is None else 1.0 / rate)


def estimate_row(sample: Timed, estimate: Estimate, kinds: Mapping[str, str]) -> dict[str, float]:
    """Columns of an estimate, as those of `poise estimate`: angles in degrees, everything else in SI units."""
    import numpy as np

    from ...filters.core.frames import ORIENTATIONS, attitude_columns, quantity_columns

    pose = {name: np.asarray(values, float)[None] for name, values in estimate.pose.items()}
    columns = attitude_columns(pose)
    for name, values in pose.items():
        if name not in ORIENTATIONS:
            columns |= quantity_columns(name, values, kinds.get(name, "vector"))
    return {
        "time": sample.time,
        **{name: float(values[0]) for name, values in columns.items()},
        "predicted": int(sample.predicted),
    }


@contextmanager
def writer_of(args: Args) -> Iterator[Callable[[str], object]]:
    """What writes a line of text: to standard output, a file, or as a datagram.

    Raises:
        ValueError: the receiver is not HOST:PORT.
    """
    if args.send is not None:
        from .sources import check_port

        host, sign, port = args.send.rpartition(":")
        if not sign or not port.isdigit():
            raise ValueError(f"send must be HOST:PORT, got {args.send!r}")
        receiver = (host, check_port(int(port)))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            yield lambda line: sender.sendto(f"{line}\n".encode(), receiver)
    elif args.output is not None:
        with args.output.open("w", encoding="utf-8") as file:
            yield lambda line: file.write(f"{line}\n")
    else:
        yield lambda line: print(line, flush=True)


def as_line(row: Mapping[str, float], as_json: bool) -> str:
    """A row of numbers as a line of JSON or of comma-separated values; NaN is null or empty."""
    shown = {name: value if value == value else None for name, value in row.items()}
    if as_json:
        return json.dumps(shown)
    return ",".join("" if value is None else f"{value:.9g}" for value in shown.values())


def run(args: Args) -> int:
    """Estimate until the lines end or the command is interrupted."""
    from ...baselines.online import OnlineEstimator
    from ...baselines.registry import make_estimator

    if args.udp is not None and args.source != "-":
        raise ValueError(f"lines come from a source or from --udp, not from both; got {args.source!r} and {args.udp}")
    if args.output is not None and args.send is not None:
        raise ValueError(f"estimates go to --output or to --send, not to both; got {args.output} and {args.send}")
    check_file("output", args.output, () if args.source == "-" else (Path(args.source),))
    made = make_estimator(args.estimator)
    reader, clock, counts = reader_of(args, made.channels), clock_of(args.rate), Counts()
    kinds = {quantity.name: quantity.kind for quantity in made.outputs}
    OnlineEstimator(made).warm_up()
    lines = lines_of(args.source, udp=args.udp, follow=args.follow, baud=args.baud)
    online: OnlineEstimator | None = None
    try:
        with writer_of(args) as write:
            for sample in timed_samples(lines, reader, clock, counts):
                if sample is None:
                    continue
                if online is None:
                    assert clock.dt is not None
                    assert reader.layout is not None
                    online = OnlineEstimator(made.with_dt(clock.dt), ranges_of(args.full_scale, reader.layout))
                    first = FirstSamples(clock.dt)
                first.add(sample)
                row = estimate_row(sample, online.step(sample.measurement, sample.restart), kinds)
                if len(online.seconds) == 1 and reader.kind == "csv":
                    write(",".join(row))
                write(as_line(row, reader.kind == "json"))
    except KeyboardInterrupt:
        print(file=sys.stderr)
    if online is None:
        raise ValueError(f"no sample came; {counts.bad} lines were not samples{counts.reason and f': {counts.reason}'}")
    first.finish()
    print(summary(args.estimator, clock, counts, online.latency()), file=sys.stderr, flush=True)
    return 0


def summary(estimator: str, clock: StreamClock, counts: Counts, latency: Mapping[str, float]) -> str:
    """What a stream was, in one sentence each."""
    assert clock.dt is not None
    parts = [
        f"{counts.samples} samples at {1.0 / clock.dt:.4g} Hz, {clock.missing} missing ones predicted",
        f"{counts.bad} bad lines skipped",
    ]
    if clock.repeated:
        parts.append(f"{clock.repeated} repeated samples dropped")
    if clock.restarts:
        why = f"gaps of more than {clock.longest_gap:g} s or clocks that were set back"
        parts.append(f"{clock.restarts} restarts after {why}")
    times = ", ".join(
        f"{name.removesuffix(' (µs)')} {value:.0f} µs" for name, value in latency.items() if name != "samples"
    )
    return f"poise: {'; '.join(parts)}\npoise: time per estimate of {estimator}: {times}"
