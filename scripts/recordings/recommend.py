"""Recommend estimators for a recording, ranked by measured errors on benchmark recordings with similar motion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from ..output import Output


@dataclass
class Args:
    """Arguments of ``poise recommend``."""

    recordings: tyro.conf.Positional[tuple[Path, ...]]
    """files, or folders that are searched for recordings"""
    mounting: Literal["worn", "hand-held", "vehicle", "bicycle"] | None = None
    """mounting of the sensor; by default recordings of all mountings are considered"""
    most: int = 8
    """estimators to show"""
    calibration: Path | None = None
    """record of `poise calibrate` that turns raw readings of the recordings into SI units"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Describe the motion, find its neighbours, rank."""
    from dataclasses import asdict

    from ...baselines.comparison.recommendation import recommend
    from ...baselines.run import report_findings
    from .load import load_all, plain_warnings, sensors_of

    with plain_warnings(), Output("recommend", args) as out:
        loaded, _ = load_all(args.recordings, args.calibration)
        for sensor in (sensor for one in loaded for sensor in sensors_of(one)):
            report_findings(sensor)
            found = recommend(sensor, args.mounting)
            out.table([asdict(found.motion)], f"{sensor.name}: motion (Hz, deg/s, m/s², m/s² lasting a second)")
            sets = ", ".join(f"{name} {count}" for name, count in found.sets.items())
            title = f"{sensor.name}: errors in deg on the {len(found.nearest)} recordings most like it ({sets})"
            out.table(found.ranking[: args.most], title)
            for note in found.notes:
                out.say(f"note: {note}")
    return 0
