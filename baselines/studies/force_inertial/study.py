"""``poise reproduce force-inertial``: the force/inertial paper's table and figures beside what this package gets."""

from __future__ import annotations

from ..kit import Study
from ..report import Report
from .consistency import ideal_consistency
from .rides import rides
from .simulation import simulations


def reproduce(study: Study, report: Report) -> None:
    """Rides first, as the paper's table II; then exact synthetic data, and consistency where the model is exact."""
    report.text(
        "Y. Zhang, K. Chen, J. Yi, IEEE Trans. Biomed. Eng. 60, 2013: trunk and bicycle pose from two inertial units, "
        "a six-axis force sensor and load cells under the saddle, and strain gauges on the handlebar. The paper gives "
        "neither the rider's masses nor any noise or tuning; what is used instead is in the filter's defaults."
    )
    rides(study, report)
    simulations(study, report)
    runs = 50 if study.quick else 100
    found = study.cached("consistency", ideal_consistency, runs, 6.0, study.seed)
    rows = [{"of": name, **{key: round(value, 3) for key, value in each.items()}} for name, each in found.items()]
    report.table(
        "Consistency where the model is exact",
        rows,
        f"{runs} runs drawn from the model itself. Ratio to the degrees of freedom, with the 95 % bounds of a "
        "consistent filter.",
    )
    report.text(LESSONS, "Where we differ, and why")


LESSONS = """
* **(13) is no roll measurement in a turn.** The seat's force points along the apparent vertical; at face value the roll
  is off by the angle atan(v ψ̇ / g) of the turn. With the apparent vertical the roll is the best of all four angles.
* **Gravity cancels** when the accelerometers of (8) feed the torque model (9). The differentiated gyroscopes have no
  gravity in them.
* **A rider is no point mass on a saddle.** The saddle carries the pelvis and part of the legs, the trunk turns about a
  point above it, each hand pushes at its own grip, and grips turn with the handlebar. The pedals carry what seat and
  hands do not. Without these loads the trunk's torque is wrong by tens of N·m.
* **Zeros of the force sensors** are much of what is left of φ_h and θ: a moment that lasts cannot be told from a lean.
* **Shoulders are not level.** (17) decides φ, so φ is wrong by what the shoulders really tilt, times 1/cos θ.
* **Load cells add nothing**: the centre of pressure cancels in (10) to (12).
* **The static torque underestimates** how much τ_φh fluctuates, as the paper says. Outdoors most of what is read in
  τ_φh is the alternating push on the two pedals, which neither model knows.
* The bias model helps little, as in the paper: the forces hold the angles whatever the bias does.
"""
