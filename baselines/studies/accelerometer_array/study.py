"""``poise reproduce accelerometer-array``: tables and figures of the thesis on the game controller, beside ours.

P. He, "Estimating the orientation of a game controller from inertial and magnetic measurements", thesis, Université
Laval. A module for each chapter; what runs in other processes returns rows that JSON can hold.
"""

from __future__ import annotations

from ..coverage import cover
from ..kit import Study
from ..report import Report
from .calibration import calibration
from .comparison import comparison
from .experiment import experiment
from .items import ITEMS
from .orientation_bounds import orientation_bounds
from .planar import planar
from .planar_figures import planar_pictures
from .rate import angular_rates
from .rate_figures import rate_pictures
from .rate_table import rate_table
from .spatial import spatial
from .virtual import virtual


def reproduce(study: Study, report: Report) -> None:
    """Every chapter of the thesis that a simulator can answer, in its order, and a comparison across works."""
    report.text(
        "P. He: *Estimating the orientation of a game controller from inertial and magnetic measurements*, thesis, "
        "Université Laval. Equations are implemented as corrected; where print and correction differ in effect, both "
        "are shown. The thesis does not give all noises, the direction of the magnetic field, the acceleration of the "
        "simulated hand, or the start: those here are stated in the docstrings. Its experiments are of a real device; "
        "here devices with the errors that a calibration leaves stand for them."
    )
    angular_rates(study, report)
    rate_pictures(study, report)
    planar(study, report)
    planar_pictures(study, report)
    calibration(study, report)
    rate_table(study, report)
    experiment(study, report, spatial(study, report))
    orientation_bounds(study, report)
    virtual(study, report)
    comparison(study, report)
    cover(report, ITEMS)
