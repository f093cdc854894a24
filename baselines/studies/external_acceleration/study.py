"""The study of the external-acceleration paper: tables I to III, figures 2 to 7, and recordings beside them.

J. K. Lee, E. J. Park, S. N. Robinovitch (2012), section IV. A trial of the paper was moved by hand; here random motion
of the same levels and intervals is drawn anew for every subject and index. A number of the paper is that of one trial.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ....envs.data.formats.load import load_recording, recording_files
from ....filters.core.estimator import run
from ....filters.core.metrics import DEGREES, direction_error, rms
from ....filters.imu.external_acceleration import ExternalAcceleration
from ...registry import make_estimator
from ...scoring import has_truth
from ..averages import mean
from ..claims import Claim
from ..coverage import cover
from ..kit import Study
from ..report import Report, result
from .figures import FIGURES
from .items import ITEMS, LEVELS, TABLE_I, TABLE_II, TABLE_III
from .simulation import MODES, RATE, TESTS, Trial, errors, reference, simulate
from .skill import beyond_the_trial, long_errors, skill, skill_of_test

NAME = "external-acceleration"
QUANTITIES = ("roll", "pitch", "a_x", "a_y", "a_z", "‖a‖")
STILL = {
    "motion_share": 0.25,
    "misalignment": (np.radians(1.84), np.radians(1.39)),
    "gyroscope_bias": np.radians(0.5),
    "duration": 180.0,
}
"""Test A with little motion, a reference that is turned by what table I reports, and a gyroscope that drifts."""
TRIALS = "mean, smallest … largest over trials"
BROAD_MODELS: dict[str, dict[str, Any]] = {
    "mode 1, published": {"exact_rotation": False, "gyroscope_sample": "previous"},
    "mode 1": {},
    "mode 1, c_a = 0.3": {"c_a": 0.3},
    "mode 2": {"mode": 2},
    "mode 3": {"mode": 3},
    "mode 2, σ_G² = 10⁻⁷": {"mode": 2, "gyroscope_noise": 10.0**-3.5},
}


def reproduce(study: Study, report: Report) -> None:
    """Do the study."""
    seeds = tuple(study.seed_of(NAME, subject, index) for subject in study.subjects for index in range(study.seeds))
    report.text(
        f"{len(seeds)} simulated trials of each test, as long as the paper's, at {RATE:g} Hz; one of the paper each. "
        "Motion, sensors and the misalignment of the optical reference (1.6° an axis) are drawn for each trial. The "
        "filter is the published one (first-order rotation, gyroscope sample t−1); columns named *exact* replace the "
        "first-order rotation by the exponential."
    )
    tests = dict(zip(TESTS, study.map("tests", errors_of_test, [(test, seeds) for test in TESTS]), strict=True))
    still = study.cached("still", sweep_of_mode_1, "A", seeds, STILL)
    levels(report, tests)
    table_i(report, tests)
    table_ii(report, tests, still)
    table_iii(report, tests)
    longer = study.cached("long", long_errors, seeds[: 3 if study.quick else 5])
    found = dict(zip(TESTS, study.map("skill", skill_of_test, [(test, seeds) for test in TESTS]), strict=True))
    more = [*skill(report, found), *beyond_the_trial(longer)]
    report.claims("What the paper says, and the inclination errors here", [*claims(tests, still), *more])
    for name, (title, note, draw) in FIGURES.items():
        report.figure(name, draw(seeds[0]), title, note)
    recordings(study, report)
    report.text(
        "Not reached by a simulation: the trials themselves, so no single number of the paper can be met, only level, "
        "order and shape; the optical tracker's noise and the flexing of its markers; Xsens MTx sensors beyond the "
        "noise, bias and scale that are assumed here. The paper says neither at which frequencies hands moved nor how "
        "the filter was started (here: at rest, P₀ = 10⁻² I).",
        "What the paper leaves open",
    )
    cover(report, ITEMS)


def errors_of_test(test: str, seeds: Sequence[int]) -> dict[str, Any]:
    """Everything that tables I to III want of one test; every list holds a number a trial."""
    trial = simulate(test, seeds)
    size = np.linalg.norm(trial.acceleration, axis=-1)
    apparent = np.linalg.norm(reference(trial), axis=-1)
    found: dict[str, Any] = {
        "level": {"true": (size.mean(axis=0), size.max(axis=0)), "apparent": (apparent.mean(0), apparent.max(0))},
        "modes": {},
    }
    for mode in MODES:
        for rotated, exact in (("published", False), ("exact", True)):
            found["modes"][f"{mode} {rotated}"] = errors(trial, ExternalAcceleration(mode=mode, exact_rotation=exact))
    found["c_a"] = sweep(trial)
    found["threshold"] = {
        f"{threshold:g}, {n}": errors(
            trial, ExternalAcceleration(mode=3, exact_rotation=False, threshold=threshold, window=n / RATE)
        )
        for threshold, n in TABLE_III
    }
    return found


def sweep_of_mode_1(test: str, seeds: Sequence[int], changes: dict[str, Any]) -> dict[str, Any]:
    """Errors against c_a in a changed test, and the level that its reference acceleration then has."""
    trial = simulate(test, seeds, **changes)
    return {"c_a": sweep(trial), "apparent": np.linalg.norm(reference(trial), axis=-1).mean(axis=0)}


def sweep(trial: Trial) -> dict[str, dict[str, np.ndarray]]:
    """Errors of mode 1, c_a → quantity → one a trial."""
    return {f"{c_a:g}": errors(trial, ExternalAcceleration(c_a=c_a, exact_rotation=False)) for c_a in TABLE_II}


def levels(report: Report, tests: dict[str, Any]) -> None:
    """Mean and peak of the acceleration."""
    rows = [
        {"test": test, "quantity": f"{what} ‖a‖, {kind}", "published": LEVELS[test][index], "unit": "m/s²"}
        | {"values": tests[test]["level"][kind][index]}
        for test in tests
        for kind in ("true", "apparent")
        for index, what in enumerate(("mean", "largest"))
    ]
    note = (
        "*True* is the motion, which is made to have the published levels; *apparent* is what the paper's reference "
        "y_A − g Z_ref would say of it, with the reference's misalignment and the sensor's errors in it."
    )
    report.compare("Levels of the tests (section III-B)", rows, note, interval=TRIALS)
    found = [
        Claim.within(
            f"Test {test}: {what} ‖a‖ is the published one within 5 %", mean(values) / level, 0.95, 1.05, "of it"
        )
        for test in tests
        for what, level, values in zip(("mean", "largest"), LEVELS[test], tests[test]["level"]["true"], strict=True)
    ]
    report.claims("Levels of the tests: what holds", found)


def table_i(report: Report, tests: dict[str, Any]) -> None:
    """Errors of the three modes."""
    rows: list[dict[str, Any]] = []
    for (test, mode), published in TABLE_I.items():
        found, exact = (tests[test]["modes"][f"{mode} {rotated}"] for rotated in ("published", "exact"))
        for quantity, value in zip(QUANTITIES, published, strict=True):
            rows.append(
                {"test": test, "mode": mode, "quantity": quantity, "published": value, "values": found[quantity]}
                | {"unit": "deg" if quantity in ("roll", "pitch") else "m/s²"}
            )
        report.numbers(
            [
                result(
                    f"{NAME} mode {mode} {rotated}", f"test {test} trial {number}", "up", "inclination", value, "deg"
                )
                for rotated, errors_ in (("published", found), ("exact", exact))
                for number, value in enumerate(errors_["inclination"])
            ]
        )
    note = (
        "a_x, a_y, a_z and ‖a‖ are against y_A − g Z_ref, as in the paper; there the accelerometer cancels, and what "
        "is left is g times the error of the vertical: these columns repeat the attitude. Roll is ill-conditioned "
        "near a pitch of ±90°; the inclination below is not."
    )
    report.compare("Table I: root mean square errors of the modes", rows, note, interval=TRIALS)
    more = [
        {
            "test": test,
            "mode": mode,
            "inclination, published rotation, deg": mean(tests[test]["modes"][f"{mode} published"]["inclination"]),
            "inclination, exact rotation, deg": mean(tests[test]["modes"][f"{mode} exact"]["inclination"]),
            "error of a against the true one, m/s²": mean(tests[test]["modes"][f"{mode} published"]["true a"]),
        }
        for test, mode in TABLE_I
    ]
    note = (
        "The published first-order rotation (12) turns too little, by ω³Δt²/3: 1.9 °/s at 10 rad/s. The last column is "
        "against the acceleration of the motion."
    )
    report.table("Beyond table I: inclination and true acceleration", more, note)


def table_ii(report: Report, tests: dict[str, Any], still: dict[str, Any]) -> None:
    """Errors of mode 1 against c_a."""
    rows = [{"test": test} | row for test in TESTS for row in rows_of_test(test, "c_a", TABLE_II, tests[test]["c_a"])]
    report.compare("Table II: mode 1 against c_a", rows, interval=TRIALS)
    note = "A quarter of the motion, a reference that is off by 1.84° and 1.39°, a bias of 0.5 °/s an axis, 180 s."
    rows = rows_of_test("A", "c_a", TABLE_II, still["c_a"])
    report.compare("Table II, test A nearly at rest", rows, note, interval=TRIALS)


def table_iii(report: Report, tests: dict[str, Any]) -> None:
    """Errors of mode 3 against its threshold."""
    found = {test: rows_of_test(test, "ε_A, n", TABLE_III, tests[test]["threshold"]) for test in TESTS}
    rows = [{"test": test} | row for test in TESTS for row in found[test]]
    report.compare("Table III: mode 3 against threshold and window", rows, interval=TRIALS)


def rows_of_test(test: str, constant: str, table: Mapping[Any, Any], found: dict[str, Any]) -> list[dict[str, Any]]:
    """Published and found errors of roll and pitch of a test, for every value of a constant."""
    return [
        {constant: value, "quantity": quantity, "published": published[list(TESTS).index(test)][which]}
        | {"values": each[quantity], "unit": "deg"}
        for (value, each), published in zip(found.items(), table.values(), strict=True)
        for which, quantity in enumerate(("roll", "pitch"))
    ]


def claims(tests: dict[str, Any], still: dict[str, Any]) -> list[Claim]:
    """What the paper says in words, and whether it holds here."""

    def inclination(test: str, mode: int, rotated: str = "published") -> float:
        return mean(tests[test]["modes"][f"{mode} {rotated}"]["inclination"])

    def against(found: dict[str, Any], what: str) -> dict[str, float]:
        return {key: mean(each["inclination"]) for key, each in found[what].items()}

    a, b, c = ([inclination(test, mode) for mode in MODES] for test in TESTS)
    sweeps = {test: against(tests[test], "c_a") for test in TESTS}
    best = {test: min(sweep, key=sweep.__getitem__) for test, sweep in sweeps.items()}
    losses = {test: sweep["0.1"] / min(sweep.values()) for test, sweep in sweeps.items()}
    # the same of table II, by the sum of roll and pitch
    published = max(
        sum(TABLE_II[0.1][index]) / min(sum(row[index]) for row in TABLE_II.values()) for index in range(len(TESTS))
    )
    trials = list(zip(*(tests["B"]["modes"][f"{mode} published"]["inclination"] for mode in (3, 1)), strict=True))
    wins = sum(three < one for three, one in trials)
    thresholds = against(tests["B"], "threshold").values()
    at_rest = against(still, "c_a")
    small = [value for key, value in at_rest.items() if float(key) <= 0.3]
    modes = ("mode 1", "mode 2", "mode 3")
    off = {test: mean(tests[test]["modes"]["1 published"]["true a"]) for test in "BC"}
    size = {test: mean(tests[test]["level"]["true"][0]) for test in "BC"}
    level, (fast, exact) = LEVELS["A"][0], (inclination(test, 1, "exact") for test in "BC")
    return [
        Claim.less("Test A: all modes are the same (within 1°)", max(a) - min(a), 1.0),
        Claim.less("Mode 2 fails in test B (more than three times mode 1)", b[0], b[1], factor=1 / 3, names=modes[:2]),
        Claim.less("Mode 2 fails in test C (more than three times mode 1)", c[0], c[1], factor=1 / 3, names=modes[:2]),
        Claim.less("Mode 3 is better than mode 1 in test B", b[2], b[0], names=("mode 3", "mode 1")),
        Claim(
            "In some trials of test B mode 3 is better, as in the paper's single one",
            f"{wins} of {len(trials)}",
            wins > 0,
        ),
        Claim.less("Mode 1 is better than mode 3 in test C", c[0], c[2], names=("mode 1", "mode 3")),
        Claim.less(
            "With the exact rotation mode 1 is better than mode 3 in test C",
            inclination("C", 1, "exact"),
            inclination("C", 3, "exact"),
            names=("mode 1", "mode 3"),
        ),
        Claim.every(
            "A properly chosen c_a works in every test: 0.1 loses no more to the best one than in table II",
            losses,
            published,
            "of the best",
        ),
        Claim(
            "The best c_a depends on the test",
            ", ".join(f"{test}: {value}" for test, value in best.items()),
            len(set(best.values())) > 1,
        ),
        Claim.less(
            "A large c_a harms in test A nearly at rest (c_a = 1 against 0.001, three times)",
            at_rest["0.001"],
            at_rest["1"],
            factor=1 / 3,
        ),
        Claim.less(
            "In test B it is the other way round (c_a = 1 against 0.001, a third)",
            sweeps["B"]["1"],
            sweeps["B"]["0.001"],
            factor=1 / 3,
        ),
        Claim.less(
            "Mode 3 is sensitive to its threshold (test B: by a factor of 1.5)",
            min(thresholds),
            max(thresholds),
            factor=1 / 1.5,
        ),
        Claim.less(
            "Errors grow in prolonged acceleration (mode 1: test C is 1.3 times as wrong as test B)",
            b[0],
            c[0],
            factor=1 / 1.3,
            names=("test B", "test C"),
        ),
        Claim.less("They do so with the exact rotation too", fast, exact, factor=1 / 1.3, names=("test B", "test C")),
        Claim.less("The exact rotation takes a third of the error of mode 1 in test C", exact, c[0], factor=2 / 3),
        Claim.within(
            "Nearly at rest, test A has the level that the paper reports (within a tenth)",
            mean(still["apparent"]),
            0.9 * level,
            1.1 * level,
            "m/s²",
        ),
        Claim.less(
            "Nearly at rest, a c_a up to 0.3 hardly matters, as in table II (within a tenth)",
            max(small),
            min(small),
            factor=1.1,
        ),
        *(
            Claim.less(
                f"Test {test}: the external acceleration errs by less than a third of its mean size",
                off[test],
                size[test],
                "m/s²",
                factor=1 / 3,
            )
            for test in "BC"
        ),
        Claim.less("Nearly at rest, c_a = 0.7 loses the vertical (above 5°), as in table II", 5.0, at_rest["0.7"]),
    ]


def recordings(study: Study, report: Report) -> None:
    """Inclination errors on recordings with a reference, where there are any."""
    title = "Recordings"
    if not study.recordings:
        report.text("None given (`--recordings`, or the folder in `POISE_DATA`).", title)
        return
    files = recording_files(study.recordings)
    rows = [row for row in study.map("recordings", recorded_errors, [(path,) for path in files]) if row]
    if not rows:
        report.text("None of them is a trial of one IMU with a known orientation.", title)
        return
    numbers = [name for name in rows[0] if name != "trial"]
    rows.append({"trial": "mean", **{name: mean([row[name] for row in rows]) for name in numbers}})
    note = (
        "Root mean square inclination error over the movement phase, deg, at the rate of the recording. Modes use the "
        "exact rotation and the current gyroscope sample unless they are *published*. The column with σ_G² = 10⁻⁷ has "
        "one constant gain and a gyroscope noise that is thirty times smaller than the paper's."
    )
    report.table("Recordings: inclination error, deg", rows, note)


def recorded_errors(path: Path) -> dict[str, Any]:
    """Errors of the modes on one recording; empty if it knows no orientation."""
    trial = load_recording(path)
    if not has_truth(trial) or not {"imu/gyr", "imu/acc"} <= set(trial.measurements):
        return {}  # what has no reference, or is not a single IMU
    row: dict[str, Any] = {"trial": trial.name}
    contenders = {
        name: make_estimator(NAME, dt=trial.dt, keep_covariance=False, **parameters)
        for name, parameters in BROAD_MODELS.items()
    }
    contenders["bounded-motion"] = make_estimator("bounded-motion", dt=trial.dt, keep_covariance=False)
    for name, estimator in contenders.items():
        up = run(estimator, trial.measurements).pose["up"]
        row[name] = float(rms(direction_error(up, trial.truth_of("up")), trial.mask)) * DEGREES
    return row
