"""``poise reproduce accelerometer-array``: tables and figures of the thesis on the game controller, beside ours."""

from __future__ import annotations

from ..kit import Study
from ..report import Report
from .calibration import calibration
from .comparison_report import comparison
from .planar_report import planar
from .rate_report import angular_rates
from .spatial_report import spatial


def reproduce(study: Study, report: Report) -> None:
    """Every chapter of the thesis that a simulator can answer, in its order, and a comparison across works."""
    report.text(
        "P. He: *Estimating the orientation of a game controller from inertial and magnetic measurements*, thesis, "
        "Université Laval. Equations are implemented as corrected; where print and correction differ in effect, "
        "both are "
        "shown. The thesis does not give all noises, the direction of the magnetic field, the acceleration of the "
        "simulated hand, or the start: those here are stated in the docstrings. Its experiments (real shaking, Figures "
        "5.18 to 5.21) can only be matched in kind."
    )
    angular_rates(study, report)
    planar(study, report)
    calibration(study, report)
    spatial(study, report)
    comparison(study, report)
    report.text(
        "* Table 2.1: the ranking comes back, and its size with residual errors of calibration.\n"
        "* Figure 2.13 does not: weights fall with the angular rate.\n"
        "* Figures 3.5 to 3.12: drift, and the extended filter's 10° as a usual value, come back. The failure of mean "
        "and linear filter is the wrap of angles; the failure of the complete pose on the ∞ is a misprint's.\n"
        "* Figures 5.6 to 5.8: ±3° come back for the controller, with exact transition and orthonormalisation.\n"
        "* Figures 5.9 to 5.11: ±3° for OCTA need the gyroscope that the thesis does without.\n"
        "* Table 5.1, experiment: ±10° and ±5° are of a real device; the abstract's 5° contradicts them.\n"
        "* Appendix B: (B.4) is a mirror.",
        "What comes back, and what does not",
    )
