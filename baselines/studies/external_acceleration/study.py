"""The study of the external-acceleration paper: tables I to III, figures 2 to 7, and recordings beside them.

J. K. Lee, E. J. Park, S. N. Robinovitch (2012), section IV. A trial of the paper was moved by hand; here random motion
of the same levels and intervals is drawn anew for every subject and index. A number of the paper is that of one trial.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ....filters.core import rotation
from ....filters.core.metrics import DEGREES, direction_error, rms
from ....filters.imu.external_acceleration import ExternalAcceleration
from ..kit import Study
from ..report import Report
from .published import LEVELS, TABLE_I, TABLE_II, TABLE_III
from .simulation import MODES, RATE, TESTS, Trial, estimate, simulate

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
    "mode 1, printed": {"exact_rotation": False, "gyroscope_sample": "previous"},
    "mode 1": {},
    "mode 1, c_a = 0.3": {"c_a": 0.3},
    "mode 2": {"mode": 2},
    "mode 3": {"mode": 3},
    "mode 2, σ_G² = 10⁻⁷": {"mode": 2, "gyroscope_noise": 10.0**-3.5},
}


def reproduce(study: Study, report: Report) -> None:
    """Do the study."""
    from . import figures as figures

    seeds = tuple(
        study.seed_of("external-acceleration", subject, index)
        for subject in study.subjects
        for index in range(study.seeds)
    )
    report.text(
        f"{len(seeds)} simulated trials of each test, as long as the paper's, at {RATE:g} Hz; one of the paper each. "
        "Motion, sensors and the misalignment of the optical reference (1.6° an axis) are drawn for each trial. The "
        "filter is the printed one (first-order rotation, gyroscope sample t−1); columns named *exact* replace the "
        "first-order rotation by the exponential."
    )
    tests = dict(zip(TESTS, study.map("tests", errors_of_test, [(test, seeds) for test in TESTS]), strict=True))
    still = study.cached("still", sweep_of_mode_1, "A", seeds, STILL)
    levels(report, tests)
    table_i(report, tests)
    table_ii(report, tests, still)
    table_iii(report, tests)
    claims(report, tests)
    for name, draw in figures.FIGURES.items():
        title, note = figures.TITLES[name]
        report.figure(name, draw(seeds[0]), title, note)
    recordings(study, report)
    report.text(
        "Not reached by a simulation: the trials themselves, so no single number of the paper can be met, only level, "
        "order and shape; the optical tracker's noise and the flexing of its markers; Xsens MTx sensors beyond the "
        "noise, bias and scale that are assumed here. The paper says neither at which frequencies hands moved nor how "
        "the filter was started (here: at rest, P₀ = 10⁻² I).",
        "What print cannot be asked",
    )


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
        for rotated, exact in (("printed", False), ("exact", True)):
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


def reference(trial: Trial) -> np.ndarray:
    """The paper's reference acceleration y_A − g Z_ref, which holds the error of Z_ref, ``(T, trials, 3)``."""
    return trial.measurements["imu/acc"] - ExternalAcceleration().gravity * trial.up


def errors(trial: Trial, model: ExternalAcceleration) -> dict[str, np.ndarray]:
    """Root mean square errors, a number a trial: angles in deg, accelerations in m/s².

    a_x … and ‖a‖ are the paper's, against its reference; ``true a`` is the length of the error against the true
    acceleration, ``inclination`` the angle between both verticals.
    """
    pose = estimate(trial, model)
    up, acceleration = pose["up"], pose["external_acceleration"]
    angles = zip(rotation.roll_pitch(up), rotation.roll_pitch(trial.up), strict=True)
    roll, pitch = (rms(rotation.wrap(ours - true)) * DEGREES for ours, true in angles)
    off = acceleration - reference(trial)
    sizes = np.linalg.norm(acceleration, axis=-1) - np.linalg.norm(reference(trial), axis=-1)
    return {
        "roll": roll,
        "pitch": pitch,
        **{f"a_{axis}": rms(off[..., index]) for index, axis in enumerate("xyz")},
        "‖a‖": rms(sizes),
        "true a": rms(np.linalg.norm(acceleration - trial.acceleration, axis=-1)),
        "inclination": rms(direction_error(up, trial.up)) * DEGREES,
    }


def levels(report: Report, tests: dict[str, Any]) -> None:
    """Mean and peak of the acceleration."""
    rows = [
        {"test": test, "quantity": f"{what} ‖a‖, {kind}", "printed": LEVELS[test][index], "unit": "m/s²"}
        | {"values": tests[test]["level"][kind][index]}
        for test in tests
        for kind in ("true", "apparent")
        for index, what in enumerate(("mean", "largest"))
    ]
    note = (
        "*True* is the motion, which is made to have the printed levels; *apparent* is what the paper's reference "
        "y_A − g Z_ref would say of it, with the reference's misalignment and the sensor's errors in it."
    )
    report.compare("Levels of the tests (section III-B)", rows, note, interval=TRIALS)


def table_i(report: Report, tests: dict[str, Any]) -> None:
    """Errors of the three modes."""
    rows: list[dict[str, Any]] = []
    for (test, mode), printed in TABLE_I.items():
        found, exact = (tests[test]["modes"][f"{mode} {rotated}"] for rotated in ("printed", "exact"))
        for quantity, value in zip(QUANTITIES, printed, strict=True):
            rows.append(
                {"test": test, "mode": mode, "quantity": quantity, "printed": value, "values": found[quantity]}
                | {"unit": "deg" if quantity in ("roll", "pitch") else "m/s²"}
            )
        report.numbers(
            [
                {
                    "estimator": f"external-acceleration mode {mode} {rotated}",
                    "trajectory": f"test {test} trial {number}",
                    "quantity": "up",
                    "metric": "inclination",
                    "value": value,
                    "unit": "deg",
                }
                for rotated, errors_ in (("printed", found), ("exact", exact))
                for number, value in enumerate(errors_["inclination"])
            ]
        )
    note = (
        "a_x, a_y, a_z and ‖a‖ are against y_A − g Z_ref, as in the paper; there the accelerometer cancels, and what "
        "is left is g times the error of the vertical: these columns repeat the attitude. Roll is ill-conditioned "
        "near a pitch of ±90°, which the simulated test C reaches; the inclination below is not."
    )
    report.compare("Table I: root mean square errors of the modes", rows, note, interval=TRIALS)
    more = [
        {
            "test": test,
            "mode": mode,
            "inclination, printed rotation, deg": mean(tests[test]["modes"][f"{mode} printed"]["inclination"]),
            "inclination, exact rotation, deg": mean(tests[test]["modes"][f"{mode} exact"]["inclination"]),
            "error of a against the true one, m/s²": mean(tests[test]["modes"][f"{mode} printed"]["true a"]),
        }
        for test, mode in TABLE_I
    ]
    fast = [mean(tests["C"]["modes"][f"1 {rotated}"]["inclination"]) for rotated in ("printed", "exact")]
    note = (
        "The printed first-order rotation (12) turns too little, by ω³Δt²/3: 1.9 °/s at 10 rad/s. Where rotation is "
        f"fast (test C, mode 1) the exact one takes {100.0 * (1.0 - fast[1] / fast[0]):.0f} % of the error away. The "
        "last column is against the acceleration of the motion."
    )
    report.table("Beyond table I: inclination and true acceleration", more, note)


def table_ii(report: Report, tests: dict[str, Any], still: dict[str, Any]) -> None:
    """Errors of mode 1 against c_a."""
    rows = [
        {"test": test, "c_a": c_a, "quantity": quantity, "printed": printed[index][which], "unit": "deg"}
        | {"values": tests[test]["c_a"][f"{c_a:g}"][quantity]}
        for index, test in enumerate(TESTS)
        for c_a, printed in TABLE_II.items()
        for which, quantity in enumerate(("roll", "pitch"))
    ]
    report.compare("Table II: mode 1 against c_a", rows, interval=TRIALS)
    rows = [
        {"c_a": c_a, "quantity": quantity, "printed": printed[0][which], "unit": "deg"}
        | {"values": still["c_a"][f"{c_a:g}"][quantity]}
        for c_a, printed in TABLE_II.items()
        for which, quantity in enumerate(("roll", "pitch"))
    ]
    note = (
        f"A quarter of the motion, a reference that is off by 1.84° and 1.39°, a bias of 0.5 °/s an axis, 180 s. The "
        f"apparent acceleration is then {mean(still['apparent']):.2f} m/s² on average; the paper reports 0.40. Errors "
        f"that hardly depend on a small c_a, and the loss at 0.7 and above, look like the printed column: test A may "
        f"have measured the reference and the drift rather than the tracking of small accelerations."
    )
    report.compare("Table II, test A nearly at rest", rows, note, interval=TRIALS)


def table_iii(report: Report, tests: dict[str, Any]) -> None:
    """Errors of mode 3 against its threshold."""
    rows = [
        {"test": test, "ε_A, n": f"{threshold:g}, {n}", "quantity": quantity, "printed": printed[index][which]}
        | {"values": tests[test]["threshold"][f"{threshold:g}, {n}"][quantity], "unit": "deg"}
        for index, test in enumerate(TESTS)
        for (threshold, n), printed in TABLE_III.items()
        for which, quantity in enumerate(("roll", "pitch"))
    ]
    report.compare("Table III: mode 3 against threshold and window", rows, interval=TRIALS)


def claims(report: Report, tests: dict[str, Any]) -> None:
    """What the paper says in words, and whether it holds here."""

    def inclination(test: str, mode: int, rotated: str = "printed") -> float:
        return mean(tests[test]["modes"][f"{mode} {rotated}"]["inclination"])

    def against(test: str, what: str) -> dict[str, float]:
        return {key: mean(each["inclination"]) for key, each in tests[test][what].items()}

    a, b, c = ([inclination(test, mode) for mode in MODES] for test in TESTS)
    best = {test: min(against(test, "c_a"), key=against(test, "c_a").__getitem__) for test in TESTS}
    spread = {
        name: {test: max(found.values()) / min(found.values()) for test in TESTS if (found := against(test, what))}
        for name, what in (("c_a", "c_a"), ("threshold", "threshold"))
    }
    middle = {key: value for key, value in against("C", "c_a").items() if 0.01 <= float(key) <= 0.5}
    rows = [
        ("Test A: all modes are the same", max(a) - min(a) < 1.0, f"{a[0]:.2f}, {a[1]:.2f}, {a[2]:.2f}°"),
        ("Mode 2 fails in test B", b[1] > 3.0 * b[0], f"{b[1]:.1f}° against {b[0]:.1f}° of mode 1"),
        ("Mode 2 fails in test C", c[1] > 3.0 * c[0], f"{c[1]:.1f}° against {c[0]:.1f}° of mode 1"),
        ("Mode 3 is slightly better than mode 1 in test B", b[2] < b[0], f"{b[2]:.2f}° against {b[0]:.2f}°"),
        ("Mode 1 is slightly better than mode 3 in test C", c[0] < c[2], f"{c[0]:.2f}° against {c[2]:.2f}°"),
        (
            "A properly chosen c_a works in most scenarios",
            max(middle.values()) < 2.0 * min(middle.values()),
            f"test C, c_a 0.01 to 0.5: {min(middle.values()):.1f} … {max(middle.values()):.1f}°",
        ),
        (
            "Each test has another best c_a",
            len(set(best.values())) > 1,
            ", ".join(f"{test}: {value}" for test, value in best.items()),
        ),
        (
            "Mode 3 is sensitive to its threshold (test B)",
            spread["threshold"]["B"] > 1.5,
            f"largest over smallest error {spread['threshold']['B']:.1f}",
        ),
        (
            "Errors grow in prolonged acceleration (test C, mode 1)",
            c[0] > 1.3 * b[0],
            f"{c[0]:.2f}° against {b[0]:.2f}° in test B; with the exact rotation {inclination('C', 1, 'exact'):.2f}°",
        ),
    ]
    title = "What the paper says, and the inclination errors here"
    report.table(title, [{"claim": claim, "holds": bool(holds), "here": text} for claim, holds, text in rows])


def recordings(study: Study, report: Report) -> None:
    """Inclination errors on recordings with a reference, where there are any."""
    from ....envs.data.formats.load import recording_files

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
        "exact rotation and the current gyroscope sample unless they are *printed*. The column with σ_G² = 10⁻⁷ has "
        "one constant gain and a gyroscope noise that is thirty times smaller than the paper's."
    )
    report.table("Recordings: inclination error, deg", rows, note)


def recorded_errors(path: Path) -> dict[str, Any]:
    """Errors of the modes on one recording; empty if it knows no orientation."""
    from ....envs.data.formats.load import load_recording
    from ....filters.core.estimator import run
    from ...evaluation import has_truth
    from ...registry import make_estimator

    trial = load_recording(path)
    if not has_truth(trial) or not {"imu/gyr", "imu/acc"} <= set(trial.measurements):
        return {}  # what has no reference, or is not a single IMU
    row: dict[str, Any] = {"trial": trial.name}
    contenders = {
        name: make_estimator("external-acceleration", dt=trial.dt, keep_covariance=False, **parameters)
        for name, parameters in BROAD_MODELS.items()
    }
    contenders["bounded-motion"] = make_estimator("bounded-motion", dt=trial.dt, keep_covariance=False)
    for name, estimator in contenders.items():
        up = run(estimator, trial.measurements).pose["up"]
        row[name] = float(rms(direction_error(up, trial.truth_of("up")), trial.mask)) * DEGREES
    return row


def mean(values: Any) -> float:
    """Mean of what is finite."""
    found = np.asarray(values, dtype=float)
    return float(found[np.isfinite(found)].mean())
