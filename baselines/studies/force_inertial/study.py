"""``poise reproduce force-inertial``: the force/inertial paper's table and figures beside what this package gets."""

from __future__ import annotations

from ..coverage import cover
from ..kit import Study
from ..model_draws import within_bounds
from ..report import Report
from .figures import table_i
from .items import ITEMS
from .observability import ideal_consistency, observability
from .rides import lively, rides
from .simulation import offsets, simulations


def reproduce(study: Study, report: Report) -> None:
    """Rides first, as the paper's table II; then exact synthetic data, and consistency where the model is exact."""
    report.text(
        "Y. Zhang, K. Chen, J. Yi, IEEE Trans. Biomed. Eng. 60, 2013: trunk and bicycle pose from two inertial units, "
        "a six-axis force sensor and load cells under the saddle, and strain gauges on the handlebar. The paper gives "
        "neither the rider's masses nor any noise or tuning; what is used instead is in the filter's defaults."
    )
    table_i(report)
    rides(study, report)
    lively(study, report)
    simulations(study, report)
    offsets(study, report)
    observability(study, report)
    runs = 50 if study.quick else 100
    found = study.cached("consistency", ideal_consistency, runs, 6.0, study.seed)
    note = f"{runs} runs drawn from the model. Ratio to the degrees of freedom, and 95 % bounds of a consistent filter."
    report.claims("Consistency where the model is exact", within_bounds(found), note)
    report.text(LESSONS, "Where this filter differs from the published one, and why")
    cover(report, ITEMS)


LESSONS = """
* **(13) reads the apparent vertical.** The seat's force points along it, so in a turn the published reading of the roll
  is off by the angle atan(v ψ̇ / g). Here that angle is predicted.
* **Gravity cancels** when the accelerometers of (8) feed the torque model (9). The differentiated gyroscopes have no
  gravity in them.
* **A rider is more than a point mass on a saddle.** The saddle carries the pelvis and part of the legs, the trunk turns
  about a point above it, each hand pushes at its own grip, and grips turn with the handlebar. The pedals carry what
  seat and hands do not.
* **Zeros of the force sensors** look like a lean: a moment that lasts cannot be distinguished from one.
* **Shoulders are not level.** (17) decides φ, so φ is wrong by what the shoulders really tilt, times 1/cos θ.
* **The centre of pressure cancels** in (10) to (12), and with it the load cells.
"""
