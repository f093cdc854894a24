"""``poise reproduce accelerometer-array``: tables and figures of the thesis on the game controller, beside ours.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval. A module for each chapter; what runs in other processes returns rows that JSON can hold.
"""

from __future__ import annotations

from ..kit import Study
from ..report import Report
from .calibration import calibration
from .comparison import comparison
from .planar import planar
from .rate import angular_rates
from .spatial import spatial


def reproduce(study: Study, report: Report) -> None:
    """Every chapter of the thesis that a simulator can answer, in its order, and a comparison across works."""
    report.text(
        "P. He: *Estimating the orientation of a game controller from inertial and magnetic measurements*, thesis, "
        "Université Laval. Equations are implemented as corrected; where print and correction differ in effect, both "
        "are shown. The thesis does not give all noises, the direction of the magnetic field, the acceleration of the "
        "simulated hand, or the start: those here are stated in the docstrings. Its experiments (real shaking, Figures "
        "5.18 to 5.21 and the experimental columns of Table 5.1) are of a real device and have no counterpart here."
    )
    angular_rates(study, report)
    planar(study, report)
    calibration(study, report)
    spatial(study, report)
    comparison(study, report)
