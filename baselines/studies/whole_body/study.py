"""``poise reproduce whole-body``: the whole-body paper's table and figures beside what this package gets."""

from __future__ import annotations

from ..coverage import cover
from ..kit import Study
from ..report import Report
from .items import ITEMS
from .rides import bumps, rides
from .sweep import sweep
from .synthetic import synthetic


def reproduce(study: Study, report: Report) -> None:
    """Every section of the study."""
    report.text(
        "Y. Zhang, K. Chen, J. Yi, T. Liu, Q. Pan: whole-body pose of a bicycle rider from six gyroscopes, two "
        "accelerometers, load cells and encoders. The paper gives neither lengths nor noises nor priors; used instead "
        "are the rider's own lengths and the defaults of `whole-body`. Its riders are people; these are simulated, "
        "lean on their hands rather than on the saddle, and hold their elbows less strictly than C3 wants."
    )
    rides(study, report)
    bumps(study, report)
    synthetic(study, report)
    sweep(study, report)
    cover(report, ITEMS)
