"""Tables whose rows are of several sensors: a column names the device of a row, or the kind of its reading.

Rows of several devices become a table each. The long form (a row a reading: sensor, time, x, y, z) becomes the usual
one, with columns for each kind on the stamps of the gyroscope.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .cells import OFTEN, SENSOR
from .names import AXES, FILLERS, GRAVITY_FREE, KINDS, classify, time_column, time_unit, words
from .sequences import unrolled
from .stamps import as_seconds
from .streams import Stream, joined
from .table import Table

SHARED = 0.3
"""Share of rows with the stamp of the row before, from which on texts beside them are those of sensors."""
OVERLAP = 0.1
"""Share of a device's time within which another one was recorded, too."""
FEWEST_ROWS = 3
ANDROID = {"1": "acc", "35": "acc", "4": "gyr", "16": "gyr", "2": "mag", "14": "mag"}
"""Numbers of sensor types of Android (``Sensor.TYPE_GYROSCOPE`` …)."""
GRAVITY_IN = ((0.65, 1.5), (6.4, 14.7))
"""g and m/s²: typical readings of an accelerometer with gravity in them."""


def texts_of(table: Table, name: str) -> dict[str, np.ndarray]:
    """Text → rows ``(N,)`` bool, of a column of labels, those of a few rows left out."""
    texts = table.labels[name]
    rows = {text: texts == text for text in dict.fromkeys(texts.tolist()) if text}
    return {text: chosen for text, chosen in rows.items() if chosen.sum() >= FEWEST_ROWS}


def devices_of(table: Table, time: str | None) -> list[str]:
    """Columns of labels that name devices which were recorded at the same time."""
    found, stamps = [], table.arrays.get(time or "")
    for name in table.labels:
        rows = texts_of(table, name)
        if len(rows) < 2 or name.lower() in ("unit", "units"):
            continue
        parts = [] if stamps is None else [stamps[chosen] for chosen in rows.values()]
        named = SENSOR.search(name) is not None
        if stamps is not None and not named:
            named = shared(stamps) > SHARED and max(map(shared, parts)) < 0.1 * SHARED
        # What was done, one thing after another, is told by labels too.
        texts = table.labels[name]
        mixed = float((texts[1:] != texts[:-1]).mean()) > OFTEN or (
            stamps is not None and bool((np.diff(stamps) < 0).any())
        )
        if named and mixed and (stamps is None or together(parts)):
            found.append(name)
    return found


def shared(stamps: np.ndarray) -> float:
    """Share of stamps that are those of the row before."""
    return float((np.diff(stamps) == 0).mean())


def by_device(table: Table, time: str | None) -> dict[str, Table]:
    """Device → its rows, where a column names devices that were recorded at the same time; empty of other tables."""
    for name in devices_of(table, time)[:1]:
        others = {label: texts for label, texts in table.labels.items() if label != name}
        return {device: replace(table, labels=others).rows(chosen) for device, chosen in texts_of(table, name).items()}
    return {}


def together(stamps: list[np.ndarray]) -> bool:
    """Whether every device was recorded while another one was."""
    spans = [(float(np.min(each)), float(np.max(each))) for each in stamps]
    return all(
        any(
            min(end, other_end) - max(begin, other_begin) > OVERLAP * (end - begin)
            for k, (other_begin, other_end) in enumerate(spans)
            if k != number
        )
        for number, (begin, end) in enumerate(spans)
    )


def kind_of(text: str) -> tuple[str, str]:
    """Kind (``gyr``, ``acc``, ``mag``; empty of others) and axis (or empty) of a reading that a text names."""
    if text in ANDROID:
        return ANDROID[text], ""
    axis = classify(text)
    if axis is not None and axis[1] in KINDS and axis[3] in AXES:
        return axis[1], axis[3]
    parts = words(text)
    joined_words = " ".join(parts)
    if GRAVITY_FREE & set(parts):
        return "", ""
    if "rotation rate" in joined_words or "angular" in parts:
        return "gyr", ""
    return next((kind for kind in ("gyr", "acc", "mag") if any(w in KINDS[kind] for w in parts)), ""), ""


def widened(table: Table) -> Table:
    """The table with columns for each kind of reading, if it is of the long form; else with the sums of parts.

    Several samples in a row are given a row each.
    """
    table = unrolled(table)
    for name in table.labels:
        if {"gyr", "acc"} <= {kind_of(text)[0] for text in texts_of(table, name)} and "unit" not in name.lower():
            break
    else:
        return with_whole_acceleration(table)
    if {"gyr", "acc"} <= {(classify(each) or ("", ""))[1] for each in table.arrays}:
        return table
    time, values = columns_of(table)
    if time is None or not values:
        return table
    device = next((label for label in devices_of(table, time) if label != name), None)
    if device is None:
        table, device = with_devices(table, name)
    parts = (
        {"": table} if device is None else {text: table.rows(rows) for text, rows in texts_of(table, device).items()}
    )
    wide = [(label, wide_rows(part, name, time, values)) for label, part in parts.items()]
    names = list(dict.fromkeys(column for _, arrays in wide for column in arrays))
    arrays = {
        column: np.concatenate([each.get(column, np.full(len(each[time]), np.nan)) for _, each in wide])
        for column in names
    }
    lengths = [len(each[time]) for _, each in wide]
    labels = {} if device is None else {device: np.repeat(np.array([*parts], dtype=object), lengths)}
    units = {time: "s"} | units_of_kinds(table, name, names)
    kind = f"{table.kind}, a row a reading"
    return Table(arrays, units, table.preamble, kind, labels=labels, texts=table.texts)


def with_devices(table: Table, name: str) -> tuple[Table, str | None]:
    """The table with a column of the devices that the kinds of readings name, and its name, if there are several."""
    kinds: dict[str, set[str]] = {}
    devices = {}
    for text in texts_of(table, name):
        kind, known = kind_of(text)[0], {word for each in KINDS.values() for word in each} | FILLERS | set(AXES)
        devices[text] = " ".join(word for word in words(text) if word not in known) if kind else ""
        kinds.setdefault(devices[text], set()).add(kind)
    complete = {device for device, found in kinds.items() if {"gyr", "acc"} <= found}
    if len(complete) < 2:
        return table, None
    own = [devices.get(text, "") if devices.get(text, "") in complete else "" for text in table.labels[name].tolist()]
    column = f"device of {name}"
    return replace(table, labels=table.labels | {column: np.array(own, dtype=object)}), column


def columns_of(table: Table) -> tuple[str | None, list[str]]:
    """The column of the time, and those of x, y and z, or of the only value."""
    if not table.named:
        numbers = [name for name in table.arrays if name not in table.labels]
        return (numbers[0], numbers[1:4]) if len(numbers) >= 4 else (None, [])
    time = time_column(table)
    found: dict[int, str] = {}
    for name in table.arrays:
        last = (words(name) or [""])[-1]
        if name not in (time, *table.labels) and last in AXES:
            found.setdefault(AXES[last], name)
    if set(found) == {0, 1, 2}:
        return time, [found[axis] for axis in range(3)]
    rest = [name for name in table.arrays if name not in (time, *table.labels)]
    numbered = [name for name in rest if (words(name) or [""])[-1].isdigit()]
    single = [name for name in rest if {"value", "reading", "val", "data"} & set(words(name))]
    return time, numbered[:3] if len(numbered) >= 3 else single[:1]


def wide_rows(table: Table, name: str, time: str, columns: list[str]) -> dict[str, np.ndarray]:
    """Columns of the rows of one device, on the stamps of its gyroscope."""
    stamps, values, unit = table.column(time), table.matrix(columns), time_unit(table, time)
    streams: dict[str, list[Stream]] = {}
    axes: dict[str, dict[str, Stream]] = {}
    clocks = [as_seconds(stamps[chosen], unit, time) for chosen in texts_of(table, name).values()]
    origin = min(each.first for each in clocks)
    for (text, chosen), clock in zip(texts_of(table, name).items(), clocks, strict=True):
        kind, axis = kind_of(text)
        stream = Stream(clock.since(origin), values[chosen])
        if axis and len(columns) == 1:
            axes.setdefault(kind, {})[axis] = stream
        elif kind and len(columns) == 3:
            streams.setdefault(kind, []).append(stream)
    for kind, by_axis in axes.items():
        if set(by_axis) == set(AXES) and len({len(each.time) for each in by_axis.values()}) == 1:
            together_values = np.concatenate([by_axis[axis].values for axis in "xyz"], axis=1)
            streams[kind] = [Stream(by_axis["x"].time, together_values)]
    seconds, channels = joined({f"imu/{kind}": chosen_stream(kind, found) for kind, found in streams.items()})
    found = {time: seconds}
    for channel, samples in channels.items():
        found |= {f"{channel.removeprefix('imu/')}_{axis}": samples[:, place] for axis, place in AXES.items()}
    return found


def chosen_stream(kind: str, streams: list[Stream]) -> Stream:
    """Of several streams of a kind the first; of accelerometers the first with gravity in it."""
    for stream in streams:
        usual = float(np.nanmedian(np.linalg.norm(stream.values, axis=1)))
        if kind != "acc" or any(low < usual < high for low, high in GRAVITY_IN):
            return stream
    return streams[0]


def units_of_kinds(table: Table, name: str, columns: list[str]) -> dict[str, str]:
    """Units of the new columns, where a column of the table names them."""
    said = next((label for label in table.labels if (words(label) or [""])[-1] in ("unit", "units")), None)
    if said is None:
        return {}
    found: dict[str, str] = {}
    for text, chosen in texts_of(table, name).items():
        found.setdefault(kind_of(text)[0], str(table.labels[said][chosen][0]))
    return {column: found[column[:-2]] for column in columns if found.get(column[:-2])}


def with_whole_acceleration(table: Table) -> Table:
    """The table with accelerations that are written in two parts, gravity and the user's, and nowhere as a whole."""
    parts: dict[str, dict[str, str]] = {"user": {}, "gravity": {}}
    for name in table.arrays:
        said = words(name)
        for part in parts:
            if part in said and said[-1] in AXES and "quaternion" not in said:
                parts[part].setdefault(said[-1], name)
    whole = any((classify(name) or ("", ""))[1] == "acc" for name in table.arrays)
    if whole or any(set(found) != set(AXES) for found in parts.values()):
        return table
    user, gravity = ([found[axis] for axis in AXES] for found in parts.values())
    if {table.units.get(name) for name in user} != {table.units.get(name) for name in gravity}:
        return table
    names = [f"acceleration_{axis}" for axis in AXES]
    sums = {
        name: table.column(one) + table.column(other) for name, one, other in zip(names, user, gravity, strict=True)
    }
    units = {name: table.units[one] for name, one in zip(names, user, strict=True) if one in table.units}
    return replace(table, arrays=table.arrays | sums, units=table.units | units)
