"""Simulate every preset scenario with every preset rider; statistics of each ride beside those of the papers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from .reproduce import studying


@dataclass
class Args:
    """Arguments of ``poise rides``."""

    duration: float = 16.0
    """of each ride, s; bumps and ramp come between 12 and 16 s"""
    fidelity: Literal["lumped", "full"] = "lumped"
    """lumped, or full with hands and feet in closed loops (about twice the time)"""
    scenarios: tuple[str, ...] = ()
    """names of scenarios (default: all)"""
    subjects: tuple[int, ...] = (0, 1, 2, 3, 4)
    """numbers of riders"""
    processes: int = 2
    """number of parallel processes"""
    seed: int = 0
    """root seed; every scenario and rider has a separate child"""
    resume: Path | None = None
    """folder of an interrupted run; its finished rides are kept"""
    runs: Path = Path("runs")
    """parent of the run folder"""
    checks: bool = False
    """check the physics and compare filters of one IMU on some rides instead (minutes)"""
    pilots: bool = False
    """print how riders of all skills steer instead: preset riders, and ten random ones of each skill, in every
    scenario"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Ride, print tables, draw one ride, and leave a run folder; 1 if anybody fell."""
    from ..baselines.studies.rides import study as work
    from ..envs.bicycle.course.scenarios import list_scenarios, scenario

    if args.checks and args.pilots:
        raise ValueError("--checks and --pilots are two reports: name one of them")
    scenarios = args.scenarios or tuple(list_scenarios())
    for name in scenarios:
        scenario(name)
    settings = {name: getattr(args, name) for name in ("seed", "subjects", "duration", "processes")}
    kind = " --checks" if args.checks else " --pilots" if args.pilots else ""
    with studying("rides", args, settings, f"poise rides{kind}", 190) as (study, out, report):
        if args.checks:
            work.checks(study, report)
            return 0
        found = (work.pilots if args.pilots else work.rides)(study, report, scenarios, args.fidelity)
        upright = sum(each["upright"] for each in found)
        out.say(f"{upright} of {len(found)} rides upright")
    return 0 if upright == len(found) else 1
