"""What columns are called: from names to sensors, kinds of channels and axes."""

from __future__ import annotations

import itertools
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .table import UNITS, Table, plain

TRANSLATIONS = {
    "time": "zeit tijd temps tiempo tempo czas 时间 時間 시간 время",
    "acceleration": "beschleunigung aceleracion accelerazione aceleracao versnelling 加速度 가속도 ускорение",
    "gyro": "drehrate winkelgeschwindigkeit vitesse_angulaire velocidad_angular velocita_angolare velocidade_angular "
    "giroscopio gyroscoop 角速度 ジャイロ 자이로 각속도",
    "mag": "magnetfeld champ_magnetique campo_magnetico magnetometro magnetometre 磁场 磁場 地磁 자기장",
}
"""Word → what it is in other languages, without accents."""
OTHER_LANGUAGES = {word.replace("_", " "): known for known, others in TRANSLATIONS.items() for word in others.split()}
FOREIGN = re.compile("|".join(sorted(OTHER_LANGUAGES, key=len, reverse=True)), re.IGNORECASE)
WORDS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+|[µ°]")


def _words(text: str) -> set[str]:
    return set(text.split())


FILLERS = _words(
    "cal calibrated uncalibrated raw data s rs sensor field values value axis imu element measured rate velocity vel "
    "signal body b wideband float motion array high low highg lowg"
)
GRAVITY_FREE = _words("free linear user lin gravity increment global world")
SPREADS = _words("covariance cov variance std sigma")
"""Words for how uncertain a reading is."""
KINDS = {
    "gyr": _words("gyr gyro gyros gyroscope gyroscopes omega angvel angrate rotationrate as w g"),
    "acc": _words("acc accel accelerometer accelerometers acceleration accelerations accl a specific"),
    "mag": _words("mag magn magneto magnetometer magnetometers magnetic m mf h"),
    "quaternion": _words("q quat quats quaternion orientation attitude rotation ori"),
    "matrix": _words("mat matrix dcm rotmat"),
}
"""Kind → words that name it; single letters count only right before an axis."""
TIME = _words("time timestamp timestamps t seconds sampletimefine datetime epoch epoc clock ts cts stamp stmp")
COUNTER = _words("packetcounter counter sample samplenumber index frame packet samples n")
AXES = {"x": 0, "y": 1, "z": 2}
QUATERNION = {"w": 0, "scalar": 0, "x": 1, "y": 2, "z": 3, "0": 0, "1": 1, "2": 2, "3": 3, "4": 4}


@dataclass
class Group:
    """Columns that belong to one kind of one sensor, in the order of their axes."""

    sensor: str
    kind: str
    variant: str
    columns: list[str] = field(default_factory=list)
    unit: str = ""


def words(name: str) -> list[str]:
    """Words of a column's name in lower case, in English: ``Shimmer_Accel_LN_X`` → shimmer, accel, ln, x."""
    if not name.isascii() or FOREIGN.search(name):
        # Accents of Latin letters only: those of kana make other syllables.
        composed = unicodedata.normalize("NFC", re.sub(r"[\u0300-\u036f]", "", unicodedata.normalize("NFKD", name)))
        name = FOREIGN.sub(lambda match: f"{OTHER_LANGUAGES[match[0].lower()]} ", composed)
    return [word.lower() for word in WORDS.findall(name)]


def classify(name: str) -> tuple[str, str, str, str] | None:
    """Sensor, kind, variant and axis that a name says, or None."""
    parts = words(name)
    match = re.match(r"^(.*?)mat(?:rix)?\[(\d)\]\[(\d)\]$", name.strip(), re.IGNORECASE)
    if match:
        return match[1].strip("_./ "), "matrix", "", f"{match[2]}{match[3]}"
    if len(parts) == 1 and re.fullmatch(r"(gyr|gyro|acc|accel|mag|quat|[wagmqh])[xyzw0-3]", parts[0]):
        parts = [parts[0][:-1], parts[0][-1]]
    numbered = re.fullmatch(r"(gyr|gyro|acc|accel|mag|[gawm])_?([xyz])[_.\[]?(\d+)\]?", name.strip(), re.IGNORECASE)
    if numbered:
        return numbered[3], next(kind for kind in KINDS if numbered[1].lower() in KINDS[kind]), "", numbered[2].lower()
    if parts and re.fullmatch(r"(gyr|gyro|acc|accel|mag|quat)[xyzw0-3]", parts[-1]):
        parts = [*parts[:-1], parts[-1][:-1], parts[-1][-1]]
    where = next((i for i, word in enumerate(parts) if word in QUATERNION and i == len(parts) - 1), None)
    letters = [i for i, word in enumerate(parts) if word in AXES]
    if where is not None and parts[where].isdigit() and len(letters) == 1 and letters[0] == where - 1:
        where = letters[0]  # of ``ACC.X 1`` the letter is the axis
    if where is None:
        where = next((i for i, word in enumerate(parts) if word in QUATERNION and not word.isdigit()), None)
    if where is None or len(parts) < 2 or (GRAVITY_FREE | SPREADS) & set(parts) or "inc" in parts:
        return None
    axis, rest = parts[where], parts[:where] + parts[where + 1 :]
    joined = " ".join(rest)
    if re.search(r"\b(angular (velocity|rate)|rotation rate)\b", joined):
        first = next(i for i, word in enumerate(rest) if word in ("angular", "rotation"))
        return " ".join(word for word in rest[:first] if word not in FILLERS), "gyr", "", axis
    # Words tell more than letters: of ``high g accelerometer`` the g is no gyroscope.
    for letters_too in (False, len(rest) <= 3):
        for kind, known in KINDS.items():
            at = next((i for i, word in enumerate(rest) if word in known and (len(word) > 1 or letters_too)), None)
            if at is not None:
                others = [word for word in rest[at + 1 :] if word not in FILLERS and word not in known]
                others = [word for word in others if kind != "gyr" or word != "rotation"]
                if kind != "quaternion" and axis not in AXES and not axis.isdigit():
                    return None
                before = [word for word in rest[:at] if word not in FILLERS and (letters_too or word != "g")]
                return " ".join(before), kind, " ".join(others), axis
    return None


def groups(table: Table) -> list[Group]:
    """Complete groups of columns that the names of a table tell."""
    found: dict[tuple[str, str, str], dict[str, str]] = {}
    ros = is_ros(table)
    for name, values in table.arrays.items():
        if values.ndim == 2 and values.shape[1] in (3, 4, 9):
            whole = classify(f"{name} x") if values.shape[1] == 3 else classify(f"{name} w")
            if whole:
                found[whole[:3]] = {"all": name}
            continue
        # ROS calls linear acceleration what others call specific force; elsewhere gravity is taken from it.
        one = classify(name.replace("linear_acceleration", "acceleration").lstrip("/") if ros else name)
        if one is not None:
            found.setdefault(one[:3], {}).setdefault(one[3], name)
    add_unnamed_quaternions(table, found)
    result = []
    # Where the name of the sensor comes last, ``gyro_x_chest``, it looks like a variant of the gyroscope.
    sensors = {variant for (sensor, kind, variant) in found if kind == "gyr" and not sensor}
    for (sensor, kind, variant), by_axis in found.items():
        columns = ordered(kind, by_axis)
        if columns is not None:
            units = {table.units.get(column, "") for column in columns}
            if not sensor and variant in sensors:
                sensor, variant = variant, ""
            label = spelled(columns[0], sensor)
            result.append(Group(label, kind, variant, columns, units.pop() if len(units) == 1 else ""))
    return result


def is_ros(table: Table) -> bool:
    """Whether the columns are the fields of ROS's message ``sensor_msgs/Imu``."""
    fields = (r"angular_velocity[./]x$", r"linear_acceleration[./]x$")
    return all(any(re.search(field, name) for name in table.arrays) for field in fields)


def add_unnamed_quaternions(table: Table, found: dict[tuple[str, str, str], dict[str, str]]) -> None:
    """Columns that differ in w, x, y and z only, such as ``vicon_w``, are a quaternion whatever they are called."""
    by_stem: dict[str, dict[str, str]] = {}
    for name in table.arrays:
        match = re.fullmatch(r"(.+?)[_. ]?([wxyz])", name, re.IGNORECASE)
        if match and classify(name) is None:
            by_stem.setdefault(match[1], {})[match[2].lower()] = name
    for stem, axes in by_stem.items():
        if set(axes) == set("wxyz"):
            found[" ".join(words(stem)), "quaternion", ""] = axes


def spelled(column: str, sensor: str) -> str:
    """The name of a sensor as a column has it: ``Right Foot`` of ``Right Foot/Acceleration/X``."""
    for end in range(1, len(column)):
        if " ".join(word for word in words(column[:end]) if word not in FILLERS) == sensor != "":
            return column[:end].strip(" _-./")
    return sensor


def ordered(kind: str, by_axis: Mapping[str, str]) -> list[str] | None:
    """Columns by axis: x, y, z; w, x, y, z; rows of a matrix. None if one is missing."""
    if "all" in by_axis:
        return [by_axis["all"]]
    if kind == "matrix":
        wanted = [f"{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)]
        wanted = wanted if "33" in by_axis else [f"{row}{column}" for row in (0, 1, 2) for column in (0, 1, 2)]
        return [by_axis[axis] for axis in wanted] if set(wanted) <= set(by_axis) else None
    table: Mapping[str, Any] = QUATERNION if kind == "quaternion" else AXES
    if kind == "quaternion" and "4" in by_axis and "0" not in by_axis:
        table = {"1": 0, "2": 1, "3": 2, "4": 3}
    if kind != "quaternion" and not AXES.keys() & by_axis.keys():
        table = {"0": 0, "1": 1, "2": 2} if "0" in by_axis else {"1": 0, "2": 1, "3": 2}
    places = {table[axis]: column for axis, column in by_axis.items() if axis in table}
    size = 4 if kind == "quaternion" else 3
    return [places[i] for i in range(size)] if set(places) >= set(range(size)) else None


def time_column(table: Table) -> str | None:
    """The column that holds the time, by its name or its unit; the finest if there are several."""

    def rank(name: str) -> int:
        flat = "".join(words(name))
        said = plain(table.units.get(name, "")) in UNITS["time"]
        if flat in ("sampletimefine", "secondselapsed") or words(name)[-2:] == ["header", "stamp"]:
            return 4
        if flat in TIME or flat in UNITS["time"] or (words(name) and words(name)[-1] in ("timestamp", "time")):
            return 3 + said
        return 2 if said and {"time", "timestamp"} & set(words(name)) else int(bool(TIME & set(words(name))))

    named = [name for name, values in table.arrays.items() if values.ndim == 1 and len(values) == len(table)]
    known = [name for name in named if "utc" not in words(name) and rank(name) > 0]
    timed = [name for name in named if plain(table.units.get(name, "")) in UNITS["time"]]
    best = max(known, key=rank, default=timed[0] if timed else None)
    # Programs that write a time beside each channel call all of them alike: that of the gyroscope is meant.
    stem = re.sub(r"[.]\d+$", "", best or "")
    alike = [name for name in named if best and re.sub(r"[.]\d+$", "", name) == stem]
    before = list(itertools.takewhile(lambda name: (classify(name) or ("", ""))[1] != "gyr", table.arrays))
    return next((name for name in reversed(before) if name in alike), best) if len(alike) > 1 else best


def time_unit(table: Table, name: str) -> str:
    """The unit of a column of time, of the header or the end of its name (``t_ms``); empty where neither tells."""
    last = (words(name) or [""])[-1]
    return table.units.get(name, "") or (last if last in UNITS["time"] and name.lower().endswith(last) else "")


def counter_column(table: Table) -> str | None:
    """The column that counts packets or samples, or None."""
    return next((name for name in table.arrays if "".join(words(name)) in COUNTER), None)
