"""Drafts of mappings for files that no reader knows, and the message about such a file."""

from __future__ import annotations

import json
from pathlib import Path

from .described import mapping_of, plausible_units, units_of
from .mapping import RecordingMap
from .tables.arrays import read_table
from .tables.stamps import as_seconds
from .tables.table import Table


def draft_map(path: str | Path) -> str:
    """The text of a TOML file that maps a file, as far as its names tell; the rest is to be filled in.

    Saved beside the data (``mine.toml``), it is read by :func:`poise.load_recording`.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it holds no table.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"no file at {path}")
    try:
        table = read_table(path)
    except ValueError as reason:
        raise ValueError(f"{path}: {reason}") from None
    return written(path, table, mapping_of(table))


def written(path: Path, table: Table, mapping: RecordingMap) -> str:
    """A draft as text."""
    names = list(table.arrays)
    lines = [
        f"# What the columns of {path.name} mean; check every line.",
        f"# Seen: {table.seen()}.",
        f"file = {json.dumps(path.name)}",
    ]
    if mapping.time is not None:
        lines.append(f"time = {json.dumps(str(mapping.time), ensure_ascii=False)}")
        lines += [f"rate = {mapping.rate:g}  # Hz, nominal"] if mapping.rate else ["# rate = 100  # Hz, nominal"]
    else:
        lines.append(
            f"rate = {mapping.rate:g}  # Hz" if mapping.rate else "rate = 100  # Hz: fill in; or time = a column"
        )
    lines += ["", "[columns]"]
    kinds = {channel.rpartition("/")[2] for channel in mapping.columns}
    for channel, columns in mapping.columns.items():
        key = channel.removeprefix("imu/")
        lines.append(f"{json.dumps(key) if '/' in key else key} = {json.dumps(list(columns), ensure_ascii=False)}")
    for kind, example in {"gyr": '["gx", "gy", "gz"]', "acc": '["ax", "ay", "az"]'}.items():
        if kind not in kinds:
            lines.append(f"{kind} = {example}  # fill in from: {', '.join(names[:30])}")
    lines += ["", "[units]"]
    guessed = plausible_units(table, mapping)
    for channel in mapping.columns:
        key = channel.removeprefix("imu/")
        unit = mapping.units.get(channel) or guessed.get(channel)
        if unit:
            note = "" if channel in mapping.units else "  # guessed from the magnitude"
            lines.append(f"{json.dumps(key) if '/' in key else key} = {json.dumps(unit, ensure_ascii=False)}{note}")
    if mapping.time is not None:
        lines.append(f'time = "{unit_of_time(table, mapping)}"')
    lines += ["", "# [signs]", "# acc = -1  # devices that report -1 g on an axis that points up, as Apple's do"]
    for reference in mapping.reference:
        lines += [
            "",
            "[[reference]]",
            f"columns = {json.dumps(list(reference.columns), ensure_ascii=False)}",
            'order = "wxyz"  # or "xyzw"',
            "conjugate = false",
            'frame = "enu"  # or "nwu", "ned", "y-up"',
            'role = "onboard"  # the device\'s own estimate; "truth" for a motion capture system',
        ]
        if reference.sensor and reference.sensor != "imu":
            lines.append(f"sensor = {json.dumps(reference.sensor, ensure_ascii=False)}")
    return "\n".join(lines) + "\n"


def unit_of_time(table: Table, mapping: RecordingMap) -> str:
    """The unit of the time, from the header or the interval."""
    import warnings

    name = str(mapping.time)
    if mapping.units.get("time"):
        return mapping.units["time"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            scale = as_seconds(table.column(name), "", name).scale
        except ValueError:
            return "s"
    named = {1.0: "s", 1e-3: "ms", 1e-6: "us", 1e-9: "ns", 86_400.0: "days"}
    return named.get(scale) or f"{1e6 * scale:.12g} us"


def explanation(path: Path) -> str:
    """What was seen in a file that no reader knows, and how to map it."""
    try:
        table = read_table(path)
        mapping = mapping_of(table)
    except (ValueError, ImportError) as reason:
        return str(reason)
    suggested = ", ".join(f"{channel} = {list(columns)}" for channel, columns in mapping.columns.items())
    known = {name.rpartition("/")[2] for name in mapping.columns if all(units_of(table, mapping, name))}
    if {"gyr", "acc"} <= known and mapping.time is None and mapping.rate is None:
        return (
            f"it holds a table ({table.seen()}) with gyroscope and accelerometer, but neither a column of the time nor "
            "a sampling rate is told: in Python poise.load_recording(path, rate=100.0) or time=…; or `poise inspect "
            f"{path.name} --write-map {path.stem}.toml` drafts a mapping to complete and to use in place of the file"
        )
    return (
        f"it holds a table ({table.seen()}) whose names and units do not identify gyroscope and accelerometer"
        f"{f' (they suggest {suggested})' if suggested else ''}. Describe the columns: `poise inspect {path.name} "
        f"--write-map {path.stem}.toml` drafts a mapping to complete and to use in place of the file; in Python "
        'poise.load_recording(path, columns={"gyr": […], "acc": […]}, units={"gyr": "deg/s", "acc": "g"}, '
        'time="…" or rate=…)'
    )
