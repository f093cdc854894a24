"""``poise reproduce two-gyro``: the two-gyroscope paper's bounds, table and figures beside what this package gets."""

from __future__ import annotations

from ..coverage import cover
from ..kit import Study
from ..report import Report
from .bounds import bounds, observability
from .exactness import exactness
from .fixture import fixture
from .items import ITEMS
from .rides import rides
from .segway import segway
from .simulation import ideal_consistency, simulations


def reproduce(study: Study, report: Report) -> None:
    """Every section of the study, in the paper's order."""
    report.text(
        "Y. Zhang, K. Chen, J. Yi and colleagues: attitude of a rigid body on a moving platform from two gyroscopes "
        "and relative measurements. The paper gives no noises, no sampling period, no prior and no camera errors; what "
        "is used instead is in the defaults of `two-gyro` and in the table of the simulated sensors."
    )
    bounds(study, report)
    exactness(report)
    observability(study, report)
    simulations(study, report)
    ideal_consistency(study, report)
    fixture(study, report)
    rides(study, report)
    segway(study, report)
    cover(report, ITEMS)
