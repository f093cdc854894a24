"""Compare the simulators with recordings and publications: motion, roads, control, saddle, sensors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..filters.support.names import look_up
from .reproduce import made_with, studying

MADE = ("parts", "episodes", "rides", "seed")
"""arguments that a page names"""


@dataclass
class Args:
    """Arguments of ``poise realism``."""

    recordings: tuple[str, ...] = ()
    """recorded data as role=path, where path is a file or folder and role one of hand, carried, chest, head"""
    parts: tuple[str, ...] = ()
    """parts of the report: points (fifteen properties in one table), gestures, rides, steering, roads, sensors;
    with recordings motion, ranks (default: all)"""
    episodes: int = 60
    """simulated episodes of each recipe of hands"""
    rides: int = 20
    """simulated rides of each recipe of riders"""
    pages: tuple[Path, ...] = ()
    """pages in which the tables of realism are replaced by those of this run"""
    processes: int = 2
    """number of parallel processes"""
    seed: int = 0
    """root seed; every recipe and ride has a separate child"""
    resume: Path | None = None
    """folder of an interrupted run; finished episodes are kept"""
    runs: Path = Path("runs")
    """parent of the run folder"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Simulate, compare, and leave a run folder."""
    from ..baselines.studies.realism import study as work
    from ..baselines.studies.realism.roles import recorded
    from .pages.studies import update

    for name in args.parts:
        look_up("part", name, work.PARTS)
    groups = recorded(args.recordings)
    amounts = work.Settings(args.episodes, args.rides)
    settings = {"seed": args.seed, "subjects": (0,), "processes": args.processes}
    with studying("realism", args, settings, "poise realism", 200) as (study, _, report):
        work.realism(study, report, amounts, groups, args.parts)
    update(args.pages, {"realism": study.folder}, made_with(args, study.folder, "realism", MADE))
    return 0
