"""JSON as programs and apps write it: records, columns, rows below names, and sensors with a list each."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .frame import table_of_frame
from .head import decode
from .names import classify
from .packed import content_of
from .rows import kind_of
from .table import Table, plain

if TYPE_CHECKING:
    import pandas

DEEPEST = 6
"""Levels of lists and objects below which nothing is looked for."""
FEWEST = 3
"""Rows of a table."""
FEW_PARTS = 64
"""Most objects in a list that are sensors rather than samples."""
HEADS, ROWS = ("columns", "header", "headers", "fields", "names"), ("data", "rows", "values", "samples", "records")
NAMING = ("sensor", "type", "name", "kind", "device", "id")
"""Keys by which an object says whose data it holds."""
OTHERS = "others"
"""Attribute of a frame: lists beside it that have another length."""


def read_json(path: Path) -> Table:
    """The samples of a JSON file, or of one with a record a line.

    Warns:
        UserWarning: lists that are not read, as they have another length or are those of other sensors.

    Raises:
        ValueError: there are none, or it is truncated.
    """
    import pandas

    whole = parsed(decode(content_of(path)).strip())
    found = [(name, frame) for name, frame in frames(whole, "", 0) if len(frame) >= FEWEST]
    if not found:
        raise ValueError(
            "it is JSON without a list of samples, or truncated; save them as a table, such as CSV, one row a sample"
        )
    # Keys of what holds rows name no sensor.
    label = {
        name: [part for part in f"-/{name}".split("/") if part and part.lower() not in ROWS][-1] for name, _ in found
    }
    both = [(name, frame) for name, frame in found if {"gyr", "acc"} <= kinds(frame)]
    of_kinds = [(name, frame) for name, frame in found if kind_of(label[name])[0]]
    chosen = both or of_kinds
    if len(both) == 1 or (not both and len(of_kinds) < 2):
        chosen = [both[0] if both else max(found, key=lambda one: len(one[1]))]
        frame = chosen[0][1]
    else:
        frame = pandas.concat(
            [frame.assign(**{"device" if both else "sensor": label[name]}) for name, frame in chosen],
            ignore_index=True,
        )
    read = [name for name, _ in chosen]
    others = [f"{name.strip('/')} ({len(one)} rows)" for name, one in found if name not in read]
    others += [text for _, one in chosen for text in one.attrs.get(OTHERS, ())]
    if others:
        what = f"of its lists {', '.join(others)} {'are' if len(others) > 1 else 'is'} not read"
        warnings.warn(
            f"{path.name}: {what}, beside {', '.join(map(str, frame.columns))[:200]} ({len(frame)} rows)", stacklevel=4
        )
    table = table_of_frame(frame, "JSON records")
    told = dict(scalars(whole, 0))
    units = {
        column: unit
        for key, unit in told.items()
        if isinstance(unit, str) and plain(unit)
        for column in table.arrays
        if key.startswith("units/") and column.lower().startswith(key[6:].lower())
    }
    preamble = tuple(
        f"{key.rpartition('/')[2]}: {value}" for key, value in told.items() if not key.startswith("units/")
    )
    return replace(table, units=units | table.units, preamble=preamble)


def parsed(text: str) -> Any:
    """The content of a text of JSON, or of one record a line."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        pass
    try:
        return [json.loads(line) for line in text.splitlines() if line.strip()]
    except (ValueError, RecursionError):
        return None


def kinds(frame: pandas.DataFrame) -> set[str]:
    """Kinds of readings that the names of columns tell."""
    found = {classify(f"{name}{axis}") for name in frame.columns for axis in ("", " x")}
    return {one[1] for one in found if one is not None}


def frames(value: Any, name: str, depth: int) -> Iterator[tuple[str, pandas.DataFrame]]:
    """Tables within a value, with the names of the keys that lead to them."""
    import pandas

    if depth > DEEPEST:
        return
    if isinstance(value, Mapping):
        yield from frames_of_object(value, name, depth)
    elif isinstance(value, list) and len(value) > 1:
        objects = [one for one in value if isinstance(one, Mapping)]
        if len(objects) <= FEW_PARTS:
            parts = [
                part
                for one in objects
                for part in frames(one, f"{name}/{next((str(one[k]) for k in NAMING if k in one), '')}", depth + 1)
            ]
            if max((len(frame) for _, frame in parts), default=0) > len(value):
                yield from parts
                return
        if len(objects) >= 0.9 * len(value):
            columns = [frozenset(one) for one in objects]
            usual = max(set(columns), key=columns.count)
            # A line of its own may tell of the device.
            objects = [one for one in objects if usual & set(one)] if len(columns) > 1 else objects
            yield name, pandas.json_normalize(objects, max_level=3)
        elif all(isinstance(one, list) for one in value) and all(isinstance(one, str) for one in value[0]):
            rows = [row for row in value[1:] if len(row) == len(value[0])]
            yield name, pandas.DataFrame(rows, columns=value[0])


def frames_of_object(value: Mapping[str, Any], name: str, depth: int) -> Iterator[tuple[str, pandas.DataFrame]]:
    """Tables of an object: rows below names, records by their numbers, columns, or one of these in a part of it."""
    import pandas

    head = next((value[key] for key in HEADS if isinstance(value.get(key), list)), None)
    rows = next((value[key] for key in ROWS if isinstance(value.get(key), list)), None)
    if head and rows and all(isinstance(row, list) and len(row) == len(head) for row in rows):
        yield name, pandas.DataFrame(rows, columns=[str(one) for one in head])
        return
    if len(value) >= FEWEST and all(key.isdigit() for key in value):
        yield from frames(list(value.values()), name, depth + 1)
        return
    parts = {key: one for key, one in value.items() if isinstance(one, Mapping)}
    columns = dict(columns_of({key: one for key, one in value.items() if key not in parts}, ""))
    own_times = [key for key, one in parts.items() if has_time(one)]
    if len(own_times) < 2:
        for key, part in parts.items():
            columns |= dict(columns_of({key: part}, ""))
    lengths = [len(one) for one in columns.values()]
    if len(lengths) > 1 and max(lengths) >= FEWEST:
        usual = max(set(lengths), key=lambda length: (lengths.count(length), length))
        frame = pandas.DataFrame({key: one for key, one in columns.items() if len(one) == usual})
        if kinds(frame) or depth:
            others = {key: len(one) for key, one in columns.items() if FEWEST <= len(one) != usual}
            frame.attrs[OTHERS] = tuple(f"{key} ({length} values)" for key, length in others.items())
            yield name, frame
            return
    for key, part in value.items():
        yield from frames(part, f"{name}/{key}".strip("/"), depth + 1)


def has_time(value: Mapping[str, Any]) -> bool:
    """Whether an object of columns brings times of its own."""
    return any(
        isinstance(one, list) and key.lower() in ("t", "time", "timestamp", "timestamps", "ts")
        for key, one in value.items()
    )


def columns_of(value: Mapping[str, Any], name: str) -> Iterator[tuple[str, list[Any]]]:
    """Lists of numbers or texts within an object, those of vectors by their axes."""
    for key, one in value.items():
        label = f"{name}.{key}" if name else str(key)
        if isinstance(one, Mapping) and one and all(k.isdigit() for k in one):
            one = list(one.values())
        if isinstance(one, Mapping):
            yield from columns_of(one, label)
        elif isinstance(one, list) and one and all(isinstance(each, int | float | str | None) for each in one):
            yield label, one
        elif isinstance(one, list) and one and all(isinstance(each, list) for each in one):
            sizes = {len(each) for each in one}
            numbers = all(isinstance(each, int | float | None) for row in one for each in row)
            if numbers and len(sizes) == 1:
                along = one if len(one) > 4 or sizes.pop() <= 4 else list(map(list, zip(*one, strict=True)))
                yield label, along


def scalars(value: Any, depth: int, name: str = "") -> Iterator[tuple[str, Any]]:
    """Numbers and texts beside the samples, by their keys; those of units begin with ``units/``."""
    if isinstance(value, Mapping) and depth <= 3:
        for key, one in value.items():
            if isinstance(one, Mapping):
                yield from scalars(one, depth + 1, "units/" if key.lower() in ("unit", "units") else "")
            elif isinstance(one, str | int | float):
                yield f"{name}{key}", one
