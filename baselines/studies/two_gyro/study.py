"""``poise reproduce two-gyro``: the two-gyroscope paper's bounds, table and figures beside what this package gets.

Equations (3) to (15) are compared with derivatives of exact motions, with pitch and without.
"""

from __future__ import annotations

import numpy as np

from ....filters.bicycle.two_gyro.kinematics import (
    body_rate_matrix,
    in_paper_axes,
    platform_rate,
    platform_rate_matrix,
    substitution,
)
from ....filters.core.quantity import DEG
from ..claims import Claim
from ..coverage import cover
from ..kit import Study
from ..report import Report
from ..signals import derivative
from .bounds import bounds, observability
from .fixture import fixture
from .items import ITEMS
from .motion import MOTIONS, simulate
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
    bounds(report)
    exactness(report)
    observability(study, report)
    simulations(study, report)
    ideal_consistency(study, report)
    fixture(study, report)
    rides(study, report)
    segway(study, report)
    cover(report, ITEMS)


LEVEL, PITCHING = "circle", "vibration"
"""Motions without and with pitch (rates of 4 and 5 °/s)"""
EXACT = 0.01
"""°/s: numerical derivatives are good to less"""


def differences(motion: str, duration: float = 20.0, dt: float = 0.02) -> dict[str, float]:
    """Largest difference (°/s) of rates by (13), (15) and (8), from the true rates of both bodies, to the true ones."""
    moved = MOTIONS[motion]
    ride = simulate(moved, duration, dt, sampling="instant")
    theta = np.stack([angle(ride.time) for angle in moved.theta], axis=-1)
    rates = np.stack([derivative(angle, ride.time) for angle in moved.theta], axis=-1)
    body = in_paper_axes(ride.measurements["trunk_imu/gyr"])
    platform = platform_rate(ride.measurements["bicycle_imu/gyr"], 0.0)
    A, M = body_rate_matrix(theta), platform_rate_matrix(theta)
    two = substitution(moved.roll(ride.time), "bicycle") @ platform[:, [0, 2], None]
    own = (A @ body[..., None])[..., 0]
    found = {
        "Σ1": own + (M @ platform[..., None])[..., 0] - rates,
        "Σ2": own + (M @ two)[..., 0] - rates,
        "φ": platform[:, 0] - derivative(moved.roll, ride.time),
    }
    return {name: float(np.abs(values).max()) / DEG for name, values in found.items()}


def exactness(report: Report) -> None:
    """Table and claims."""
    found = {motion: differences(motion) for motion in (LEVEL, PITCHING)}
    named = {"Σ1": "(13), Σ1", "Σ2": "(15), Σ2", "φ": "(8), roll"}
    report.table(
        "Kinematics: largest error of the rates",
        [
            {"equation": name, "level, °/s": found[LEVEL][key], "with pitch, °/s": found[PITCHING][key]}
            for key, name in named.items()
        ],
        "Against numerical derivatives of exact motions; the pitch rate is up to 9 °/s.",
    )
    report.claims(
        "Kinematics: what holds",
        [
            *(Claim.less(f"Level: {name} is exact", found[LEVEL][key], EXACT, "°/s") for key, name in named.items()),
            *(
                Claim.less(f"With pitch: {name} is exact too", found[PITCHING][key], EXACT, "°/s")
                for key, name in named.items()
            ),
        ],
    )
