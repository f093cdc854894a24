"""Align devices and sensors of recordings of your own: clocks, axes of segments, magnetometers.

clocks: two or more devices that moved together; times of all become those of the first, and --output holds them as one.
segment: axes of a worn or mounted sensor from --rest and a --movement about one known --axis of the segment.
magnetometer: hard and soft iron and the axes, from any motion that turns the device about all axes; a record for
--calibration of other commands.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from ..output import Output
from ..targets import FIGURES, check_file

if TYPE_CHECKING:
    from ...envs.data.trajectory import Trajectory


@dataclass
class Args:
    """Arguments of ``poise align``."""

    what: tyro.conf.Positional[Literal["clocks", "segment", "magnetometer"]]
    """what is aligned"""
    files: tyro.conf.Positional[tuple[Path, ...]]
    """recordings: for clocks the reference first, for the others one"""
    site: str = "imu"
    """sensor of the recording, such as trunk_imu"""
    rest: tuple[float, float] | None = None
    """segment: begin and end, s, of the rest in the reference pose"""
    movement: tuple[float, float] | None = None
    """segment: begin and end, s, of the movement"""
    axis: str = "x"
    """segment: axis of the segment about which it turned (x forward, y left), with - if the first turn was negative"""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH", help_behavior_hint="")] = None
    """clocks, segment: the aligned recording, as .h5"""
    record: Path = Path("calibration.json")
    """magnetometer: file of the calibration; records of other channels in it are kept"""
    plot: Path | None = None
    """figure to check the alignment"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Load, align, write."""
    from .load import load_all, plain_warnings

    if args.what == "magnetometer":
        check_file("record", args.record, args.files)
    else:
        check_file("output", args.output, args.files, (".h5",))
    check_file("plot", args.plot, args.files, FIGURES)
    with plain_warnings(), Output("align", args) as out:
        recordings, _ = load_all(args.files)
        if args.what == "clocks":
            clocks(args, recordings, out)
        elif len(recordings) != 1:
            raise ValueError(f"poise align {args.what} takes one recording, got {len(recordings)}")
        elif args.what == "segment":
            segment(args, recordings[0], out)
        else:
            magnetometer(args, recordings[0], out)
    return 0


def clocks(args: Args, recordings: list[Trajectory], out: Output) -> None:
    """All times on the first device's clock."""
    from ...envs.data.alignment.clocks import RATE, align_clocks, merged, rate_on_grid

    if len(recordings) < 2:
        raise ValueError("poise align clocks takes two recordings at least, the reference first")
    reference, *others = recordings
    sites, rows = {reference.name: reference}, []
    for other in others:
        found = align_clocks(other, reference, site=args.site, reference_site=args.site)
        sites[other.name] = found.apply(other)
        rows.append(
            {"device": other.name, "offset, s": found.offset, "drift, ppm": 1e6 * found.drift}
            | {"residual, ms": 1e3 * found.residual, "correlation": found.correlation, "windows": found.windows}
        )
    out.table(rows, f"Clocks against {reference.name}")
    if args.output is not None:
        out.say(f"aligned: {merged(sites).save(args.output)}")
    if args.plot is not None:
        curves = {}
        for name, one in sites.items():
            start, rate = rate_on_grid(one, args.site)
            curves[name] = (start, 1.0 / RATE, rate)
        save_curves(args.plot, curves, "angular rate, rad/s", out)


def segment(args: Args, recording: Trajectory, out: Output) -> None:
    """Mounting of one sensor."""
    from ...envs.data.alignment.segments import align_segment

    if args.rest is None or args.movement is None:
        raise ValueError("poise align segment needs --rest BEGIN END and --movement BEGIN END, in s")
    found = align_segment(recording, args.rest, args.movement, args.axis, site=args.site)
    out.table([found.describe()], f"Mounting of {args.site}: turns sensor into segment axes")
    turned = found.apply(recording, args.site)
    if args.output is not None:
        out.say(f"aligned: {turned.save(args.output)}")
    if args.plot is not None:
        rate = turned.measurements[f"{args.site}/gyr"]
        curves = {f"about {name}": (turned.time[0], turned.dt, rate[:, i]) for i, name in enumerate("xyz")}
        save_curves(args.plot, curves, "angular rate in segment axes, rad/s", out)


def magnetometer(args: Args, recording: Trajectory, out: Output) -> None:
    """Record of the magnetometer."""
    import numpy as np

    from ...envs.data.alignment.magnetic import calibrate_magnetometer
    from ...envs.data.calibration.records import CalibrationRecord, apply_calibration, load_calibration

    earlier = load_calibration(args.record) if args.record.is_file() else CalibrationRecord({})
    found = calibrate_magnetometer(recording, args.site)
    (details,) = found.details.values()
    out.table([{name: value for name, value in details.items() if name != "centre"}], f"{args.site}/mag")
    out.say(f"record: {earlier.merged(found).save(args.record)}")
    if args.plot is not None:
        channel = f"{args.site}/mag"
        lengths = {
            name: np.linalg.norm(one.measurements[channel], axis=1)
            for name, one in (("raw", recording), ("calibrated", apply_calibration(recording, found)))
        }
        curves = {
            name: (recording.time[0], recording.dt, values / np.nanmean(values)) for name, values in lengths.items()
        }
        save_curves(args.plot, curves, "length of the field over its mean", out)


def save_curves(path: Path, curves: dict[str, tuple[float, float, Any]], label: str, out: Output) -> None:
    """Curves over time, as a figure."""
    import numpy as np

    from ...baselines.plots import legend_above, save, time_figure

    figure, (ax,) = time_figure(9.0, 3.2)
    for name, (start, dt, values) in curves.items():
        ax.plot(start + dt * np.arange(len(values)), values, linewidth=0.8, label=name)
    ax.set(ylabel=label)
    legend_above(ax)
    out.say(f"figure: {save(figure, path)}")
