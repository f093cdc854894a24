"""The twenty angles of the whole-body paper's table III, and how they fit into eleven columns."""

from __future__ import annotations

from collections.abc import Mapping

from ....filters.bicycle.whole_body.linkage import HIP, SHOULDER, SIDES, TRUNK

ANGLES: dict[str, tuple[str, int]] = {"φ": ("bicycle/roll", 0)}
ANGLES |= {f"θ{i + 1}": ("trunk/angles", i) for i in range(3)}
STATES = {"φ": 0} | {f"θ{i + 1}": TRUNK.start + i for i in range(3)}
for _side in SIDES:
    ANGLES |= {f"φ{_side[0]}{i + 1}": (f"shoulder_{_side}/angles", i) for i in range(3)}
    ANGLES |= {f"α{_side[0]}": (f"elbow_{_side}/flexion", 0)}
    ANGLES |= {f"ψ{_side[0]}{i + 1}": (f"hip_{_side}/angles", i) for i in range(3)}
    ANGLES |= {f"β{_side[0]}": (f"knee_{_side}/flexion", 0)}
    STATES |= {f"φ{_side[0]}{i + 1}": SHOULDER[_side].start + i for i in range(3)}
    STATES |= {f"ψ{_side[0]}{i + 1}": HIP[_side].start + i for i in range(3)}
"""Angle in the paper → quantity and component, in the order of table III; and → element of the filter's state."""

TABLE_III = {
    course: dict(zip(ANGLES, values.split(), strict=True))
    for course, values in {
        "indoor": "0.61±.13 2.21±.46 2.98±.97 3.46±1.04 4.28±1.76 4.01±1.67 3.97±2.69 4.46±1.40 4.33±.83 4.71±1.35 "
        "4.80±1.32 5.01±1.22 3.23±1.66 4.33±2.54 4.81±1.50 4.86±1.31 4.28±1.38 3.88±1.68 5.23±3.22 4.93±2.43",
        "outdoor": "0.86±.20 3.13±.56 4.85±1.75 4.03±2.18 5.36±1.41 5.82±1.39 4.53±1.78 6.35±2.63 5.27±1.91 6.22±2.11 "
        "5.57±3.06 5.27±1.97 6.47±2.11 4.92±1.45 5.72±1.51 5.13±2.27 5.43±3.16 5.28±2.13 6.34±2.13 5.21±2.16",
    }.items()
}
"""Course → angle → published RMS error, deg, mean ± standard deviation over five subjects."""


def short(row: Mapping[str, float]) -> dict[str, str]:
    """A row of twenty angles in eleven columns, three angles of a joint in one cell."""
    cells = {"φ": f"{row['φ']:.2f}", "Θ": " ".join(f"{row[f'θ{i}']:.2f}" for i in (1, 2, 3))}
    for side in ("r", "l"):
        cells[f"Φ{side}"] = " ".join(f"{row[f'φ{side}{i}']:.2f}" for i in (1, 2, 3))
        cells[f"α{side}"] = f"{row[f'α{side}']:.2f}"
        cells[f"Ψ{side}"] = " ".join(f"{row[f'ψ{side}{i}']:.2f}" for i in (1, 2, 3))
        cells[f"β{side}"] = f"{row[f'β{side}']:.2f}"
    return cells
