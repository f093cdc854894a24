"""Parts of the report about the simulators themselves: gestures, rides, saddle, roads, sensors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ....envs.bicycle.course.scenarios import list_scenarios
from ....envs.sensors.allan import FLOOR_TIME, allan_floors
from ..kit import Study
from ..report import Report
from ..rides.saddle import SITTING, saddle_rows, worst_of
from ..rides.steering import by_speed
from ..rides.vibration import MEASURED, levels, vibration_checks
from .environments import BANDWIDTH, GESTURE_RATE, GESTURE_TIME, PLACES, SHOWN, SHOWN_OF_HANDS, gestures, medians, rides
from .motion import UNITS, motion_statistics
from .pedalling import BESIDE, WINDOW, pedalling, pedalling_row
from .ranges import judged
from .roles import ROLES, Recorded

STEERING = {
    "steer": ("steer std", "deg"),
    "steer_rate": ("steer rate std", "deg/s"),
    "roll": ("roll std", "deg"),
    "roll_rate": ("roll rate std", "deg/s"),
    "offset": ("path std", "cm"),
    "torque_99": ("99 % of torque", "N·m"),
}
"""Statistic of a ride → heading and unit"""
BUMPY = ("bumps", "pitch")
"""Scenarios in which the wheels leave the ground, or the rider is thrown: their saddle is shown, not judged"""


def titled(names: Iterable[str]) -> dict[str, str]:
    """Statistic → heading of its column."""
    return {name: f"{name} {UNITS[name]}".strip() for name in names}


def recorded_rows(groups: Sequence[Recorded], roles: Sequence[str], first: str, columns: Mapping[str, str]) -> list:
    """One row a recording of the roles."""
    found = []
    for group in groups:
        if group.role not in roles:
            continue
        for each in group.load():
            values = motion_statistics(each, bandwidth=BANDWIDTH if group.role in ("chest", "head") else None)
            found.append({first: f"recorded: {each.name}"} | {title: values[name] for name, title in columns.items()})
    return found


def hand_motion(study: Study, report: Report, episodes: int, groups: Sequence[Recorded]) -> None:
    """Every gesture, above the recordings of hands and carried phones."""
    columns = titled(SHOWN_OF_HANDS)
    rows = [
        {"gesture": name} | {title: values[statistic] for statistic, title in columns.items()}
        for name, values in gestures(study, max(2, episodes // 10)).items()
    ]
    report.table(
        "Gestures of poise/HandMotion-v0",
        rows + recorded_rows(groups, ("hand", "carried"), "gesture", columns),
        f"Medians over {max(2, episodes // 10)} episodes of {GESTURE_TIME:g} s at {GESTURE_RATE:g} Hz with ideal "
        "sensors; recordings at 0.45 of their own rates.",
    )


def ride_motion(study: Study, report: Report, count: int, groups: Sequence[Recorded]) -> None:
    """Trunk, bicycle, saddle and steering of every scenario, above the recordings of riders."""
    each_scenario = max(2, count // 5)
    found = rides(study, list_scenarios(), each_scenario)
    middle = {name: medians(values) for name, values in found.items()}
    for site in PLACES:
        columns = titled(SHOWN)
        rows = [
            {"scenario": name} | {title: values[f"{site}/{statistic}"] for statistic, title in columns.items()}
            for name, values in middle.items()
        ]
        roles = [name for name, role in ROLES.items() if role.site == site]
        recordings = recorded_rows(groups, roles, "scenario", columns)
        report.table(
            f"Motion at {site} by scenario",
            rows + recordings,
            f"Medians over {each_scenario} rides, up to {BANDWIDTH:g} Hz, ideal sensors, the trunk's on soft tissue.",
        )
    shaken(report, found, groups)
    report.table(
        "Trunk, against what is believable",
        [
            judged(f"trunk gyroscope {what}", {name: each[f"trunk_imu/{statistic}"] for name, each in middle.items()})
            for what, statistic in (("rms", "gyr_rms"), ("95 % frequency", "gyr_f95"))
        ],
    )
    saddle(report, found)
    report.table(
        "Steering by scenario",
        [
            {
                "scenario": name,
                "speed m/s": each["speed"],
                "steer rate std deg/s": each["steer_rate"],
                "roll rate std deg/s": each["roll_rate"],
                "roll std deg": each["roll"],
                "upright": f"{sum(one['upright'] for one in found[name]):.0f}/{len(found[name])}",
            }
            for name, each in middle.items()
        ],
    )


def shaken(report: Report, found: Mapping[str, Sequence[Mapping[str, float]]], groups: Sequence[Recorded]) -> None:
    """What pedalling does to the trunk in every ride straight on, above the chests of recorded riders."""
    rows = [{"ride": f"straight, {index}"} | pedalling_row(each) for index, each in enumerate(found["straight"])]
    for group in groups:
        if group.role == "chest":
            for each in group.load():
                values = pedalling(each.measurements["imu/gyr"], each.measurements["imu/acc"], 1.0 / each.dt)
                rows.append({"ride": f"recorded: {each.name}"} | pedalling_row(values))
    report.table(
        "Trunk at multiples of the cadence",
        rows,
        f"Medians over windows of {WINDOW:g} s, ±{BESIDE:g} Hz; recordings: the cadence with the strongest lines.",
    )


def saddle_values(found: Mapping[str, Sequence[Mapping[str, float]]]) -> dict[str, dict[str, float]]:
    """Quantity of :data:`.BELIEVABLE` → scenario (and end of the range) → worst of its rides; without :data:`BUMPY`."""
    firm = {name: rides for name, rides in found.items() if name not in BUMPY}
    values = {
        "share of samples in which a load cell pulls": {name: worst_of(firm[name], "seated_pulls") for name in firm},
        "least force of a load cell": {name: worst_of(firm[name], "seated_least") for name in firm},
    }
    for axis in ("across", "along"):
        ends = {f"{name}, {end} %": worst_of(firm[name], f"{axis}_{end}") for name in firm for end in (5, 95)}
        values[f"centre of pressure {axis}"] = ends
    return values


def saddle(report: Report, found: Mapping[str, Sequence[Mapping[str, float]]]) -> None:
    """Load cells and centre of pressure by scenario, worst of all rides."""
    report.table(
        "Saddle by scenario",
        list(saddle_rows(found)),
        "Largest shares, least force and widest 5 to 95 % of the centre of pressure over the rides of a scenario. "
        f"Off the saddle: less than {SITTING:g} N on it; all else is of the other samples.",
    )
    rows = [judged(quantity, values) for quantity, values in saddle_values(found).items()]
    report.table("Saddle, against what is believable", rows)


def steering(study: Study, report: Report, count: int) -> None:
    """Steering, roll, path and torque by speed, mild riders on a straight."""
    found = by_speed(study, count)
    report.table(
        "Steering by speed",
        [
            {"speed km/h": f"{speed:g}"} | {f"{title} {unit}": each[name] for name, (title, unit) in STEERING.items()}
            for speed, each in found.items()
        ],
        f"Means over {count} lumped rides of a minute, skilled pilot, mild style, even straight.",
    )
    steer = {speed: each["steer"] for speed, each in found.items()}
    paths = {f"{speed:g} km/h": each["offset"] for speed, each in found.items()}
    fast = {f"{speed:g} km/h": value for speed, value in steer.items() if speed > 10.0}
    report.table(
        "Steering, against what is believable",
        [
            judged("steering at 5 km/h, times that at 20", {"skilled": steer[5.0] / steer[20.0]}),
            judged("steering at 25 km/h, times that at 20", {"skilled": steer[25.0] / steer[20.0]}),
            judged("steering above 10 km/h", fast),
            judged(
                "steer rate at 5 km/h, times that at 25",
                {"skilled": found[5.0]["steer_rate"] / found[25.0]["steer_rate"]},
            ),
            judged("roll rate std", {f"{speed:g} km/h": each["roll_rate"] for speed, each in found.items()}),
            judged("distance from the path", paths),
            judged("torque, 99 %", {f"{speed:g} km/h": each["torque_99"] for speed, each in found.items()}),
        ],
    )


def vibrations(study: Study) -> dict[str, tuple[float, float]]:
    """:func:`.levels` of every surface, computed once a run folder."""
    return {name: (rms, edge) for name, (rms, edge) in study.cached("vibration", levels).items()}


def roads(study: Study, report: Report) -> None:
    """Vertical acceleration of the bicycle on every surface."""
    found = vibrations(study)
    report.table("Vibration by road surface", [each._asdict() for each in vibration_checks(found)])
    rows = [judged(f"vertical acceleration on {name}", {name: found[name][0]}) for name in MEASURED]
    rows.append(judged("bandwidth of vertical acceleration", {name: found[name][1] for name in MEASURED}))
    report.table("Roads, against what is believable", rows, "Subject 0 rides straight on at 12 km/h.")


def sensors(report: Report) -> None:
    """Allan deviation of the presets where drift shows."""
    found = allan_floors()
    report.table(
        f"Allan deviation at {FLOOR_TIME:g} s",
        [
            {"preset": each["name"], "gyroscope °/h": each["gyroscope"], "accelerometer µg": each["accelerometer"]}
            | {"assumed": each["assumed"]}
            for each in found
        ],
        "Expected from the parameters (IEEE Std 952); fields that no data sheet states are named assumptions.",
    )
    rows = [
        judged(f"{kind} Allan deviation", {str(each["name"]): float(each[kind]) for each in found})
        for kind in ("gyroscope", "accelerometer")
    ]
    report.table("Drift, against what is believable", rows)
