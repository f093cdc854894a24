"""Analyse an array of accelerometers: rank, condition number and noise gains of each quantity."""

from __future__ import annotations

import math
from dataclasses import dataclass

import tyro

from .output import Output


@dataclass
class Args:
    """Arguments of ``poise array``."""

    array: tyro.conf.Positional[str]
    """octa, controller, planar or triaxial; or a JSON file with positions (m) and axes (unit vectors), a row
    for each accelerometer, and optionally name and reference (the point whose acceleration is meant)"""
    std: float = 1.0
    """σ_a of one accelerometer, m/s² per sample, a factor on the gains"""
    json: bool = False
    """print one JSON document instead of tables"""


def run(args: Args) -> int:
    """Print the report."""
    from ..filters.arrays.files import describe_array, load_array

    if not 0.0 < args.std < math.inf:
        raise ValueError(f"std must be positive and finite (m/s²), got {args.std}")
    array = load_array(args.array)
    rows = describe_array(array, args.std)
    condition = array.condition_number
    summary = {
        "array": array.name,
        "accelerometers": array.size,
        "rank": array.rank,
        "of": array.A.shape[1],
        "condition number": condition if math.isfinite(condition) else "infinite",
        "redundancy": array.redundancy,
    }
    with Output("array", args) as out:
        out.add(summary=summary | {"condition number": condition})
        out.show([summary], f"{array.name}: {array.size} accelerometers", digits=4)
        out.show(rows, f"standard deviations for {args.std:g} m/s² of noise a sample")
        out.rows(rows)
        if array.rank < array.A.shape[1]:
            out.say("What is not determined needs other sensors (a gyroscope) or a model of the motion.")
        if array.redundancy == 0:
            out.say("No redundancy: the fault of an accelerometer looks like motion.")
    return 0
