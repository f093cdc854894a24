"""Run an estimator on recordings and write angles, quaternions, standard deviations and biases to a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from ..output import Output
from ..targets import FIGURES, check_file

if TYPE_CHECKING:
    from ...filters.core.quantity import Estimate


@dataclass
class Args:
    """Arguments of ``poise estimate``."""

    recordings: tyro.conf.Positional[tuple[Path, ...]]
    """files, or folders that are searched for recordings; several sensors are written together"""
    estimator: str = "bounded-motion"
    """name of the estimator, see `poise list estimators`"""
    offline: bool = False
    """run the smoother, which uses the whole recording for every estimate"""
    output: Path | None = None
    """file to write, .csv, .parquet, .h5, .npz, or .sto for OpenSim"""
    plot: Path | None = None
    """figure of the angles over time, .png, .pdf or .svg"""
    site: str | None = None
    """in recordings of several sensors, the one to use"""
    calibration: Path | None = None
    """record of `poise calibrate` that turns raw readings of the recordings into SI units"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Estimate, write, print a summary."""
    from ...baselines.export import WRITERS, write_estimates
    from ...baselines.registry import make_estimator
    from ...baselines.run import run as run_filter
    from ...baselines.run import smooth
    from .load import load_all, plain_warnings, say_passed_over, sensors_of

    check_file("output", args.output, args.recordings, tuple(WRITERS))
    check_file("plot", args.plot, args.recordings, FIGURES)
    with plain_warnings(), Output("estimate", args) as out:
        channels = [channel.name for channel in make_estimator(args.estimator).channels]
        loaded, passed_over = load_all(args.recordings, args.calibration, args.site)
        sensors = {sensor.name: sensor for one in loaded for sensor in sensors_of(one, channels)}
        estimates: dict[str, Estimate] = {}
        run_estimator = smooth if args.offline else run_filter
        for name, sensor in sensors.items():
            estimates[name] = run_estimator(args.estimator, sensor)
        rows = [summary_row(name, estimate) for name, estimate in estimates.items()]
        out.table(rows, f"Angles by {args.estimator}, deg (±: standard deviation at the end)")
        say_passed_over(passed_over, out)
        if args.output is not None:
            out.say(f"estimates: {write_estimates(estimates, args.output)}")
        if args.plot is not None:
            from ...baselines.plots import angle_curves, save

            out.say(f"figure: {save(angle_curves(sensors, estimates), args.plot)}")
    return 0


def summary_row(name: str, estimate: Estimate) -> dict[str, Any]:
    """Summary of an estimate in one row: samples, rate, ranges of the angles, final standard deviations."""
    import numpy as np

    frame = estimate.to_frame()
    time = frame["time"].to_numpy()
    rate = 1.0 / float(np.median(np.diff(time))) if len(time) > 1 else float("nan")
    row: dict[str, Any] = {"sensor": name, "samples": len(frame), "Hz": rate}
    for angle in ("roll", "pitch", "yaw"):
        if angle in frame:
            known = frame[angle].dropna()
            row[angle] = f"{known.min():.1f} to {known.max():.1f}" if len(known) else "–"
        if f"std_{angle}" in frame:
            row[f"± {angle}"] = float(frame[f"std_{angle}"].iloc[-1])
    return row
