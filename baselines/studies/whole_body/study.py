"""``poise reproduce whole-body``: the whole-body paper's table and figures beside what this package gets."""

from __future__ import annotations

from ..averages import mean_of, windowed
from ..coverage import cover
from ..kit import Study
from ..report import Report
from .angles import short
from .items import ITEMS
from .motion import ExactRide
from .rides import bumps, rides
from .speed import speed_claims
from .synthetic import GEOMETRY, errors_of, synthetic


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


SPEEDS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
"""m/s, as in the paper's outdoor rides"""


def swept(speed: float, seed: int, duration: float) -> dict[str, float]:
    """RMS errors (deg) of an exact ride with turns both ways at a constant speed, first 5 s left out."""
    ride = ExactRide(GEOMETRY, "outdoor", seed=seed, constant_speed=speed).record(duration, sampling="interval")
    return windowed(errors_of(ride, swivel_noise=3.0), ride.time, 5.0)


def sweep(study: Study, report: Report) -> None:
    """The sweep on exact rides: table and claim."""
    seeds = [study.seed_of("exact", index) % 10_000 for index in range(2 if study.quick else 5)]
    duration = 20.0 if study.quick else 40.0
    jobs = [(speed, seed, duration) for speed in SPEEDS for seed in seeds]
    found = study.map("speed sweep", swept, jobs)
    means = {speed: mean_of(found[index * len(seeds) : (index + 1) * len(seeds)]) for index, speed in enumerate(SPEEDS)}
    report.table(
        "Speed sweep on exact rides",
        [{"m/s": speed, **short(row)} for speed, row in means.items()],
        f"RMS error, deg, mean of {len(seeds)} rides of {duration:g} s with turns both ways and biases within 30 % of "
        "table I.",
    )
    report.claims("Speed sweep: what holds", speed_claims({f"{key:g} m/s": row for key, row in means.items()}))
