"""Inspect recordings: recognised format, rate, gaps, rest, units, signs, reference."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from ..output import Output
from ..targets import FIGURES, check_file


@dataclass
class Args:
    """Arguments of ``poise inspect``."""

    recordings: tyro.conf.Positional[tuple[Path, ...]]
    """files, or folders that are searched for recordings"""
    write_map: Path | None = None
    """file for the draft of a mapping (TOML) of the first recording, to be completed and kept beside the data"""
    plot: Path | None = None
    """figure of rates, specific force and field over time, of the first recording"""
    calibration: Path | None = None
    """record of `poise calibrate` that turns raw readings of the recordings into SI units"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Describe, check, draw."""
    from ...envs.data.inspection import inspect_recording
    from ...envs.data.plausibility.recording import check_recording
    from .load import load_all, plain_warnings, say_passed_over

    check_file("plot", args.plot, args.recordings, FIGURES)
    with plain_warnings(), Output("inspect", args) as out:
        if args.write_map is not None:
            from ...envs.data.formats.draft import draft_map
            from ...filters.support.files import write_text

            data = args.recordings[0]
            if args.write_map.resolve().parent != data.resolve().parent:
                raise ValueError(f"write_map must name a file beside the data, in {data.parent}, got {args.write_map}")
            check_file("write_map", args.write_map, args.recordings, (".toml",))
            if args.write_map.exists():
                raise ValueError(
                    f"write_map must be a new file: {args.write_map} is there, and may be complete already"
                )
            text = draft_map(data)
            out.say(f"{text}\ndraft of a mapping: {write_text(args.write_map, text)}")
            return 0
        loaded, passed_over = load_all(args.recordings, args.calibration)
        for trajectory in loaded:
            found, findings = inspect_recording(trajectory), check_recording(trajectory)
            rows = [{"property": name, "value": text} for name, text in found.clock.items()]
            out.table(rows, f"{trajectory.name}: recording")
            out.table(found.channels, f"{trajectory.name}: channels")
            out.table(found.sensors, f"{trajectory.name}: sensors")
            out.rows([vars(finding) for finding in findings], f"{trajectory.name}: findings")
            for finding in findings:
                out.say(f"{finding.severity}: {finding}")
            if not findings:
                out.say(f"{trajectory.name}: units, signs, axes and clock are plausible")
        say_passed_over(passed_over, out)
        if args.plot is not None:
            from ...baselines.plots import save, signals

            out.say(f"figure: {save(signals(loaded[0], inspect_recording(loaded[0]).rest), args.plot)}")
    return 0
