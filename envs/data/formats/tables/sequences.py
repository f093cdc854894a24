"""Rows that hold several samples of a sensor, and cells that hold several numbers.

Columns with a number, ``gyr_x_0 … gyr_x_3``, are samples of one sensor that follow one another within a row, or several
sensors. The readings tell: samples go on from the last of a row to the first of the next, in steps that are smaller
than those from row to row. Samples get a row each.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np

from .names import AXES, Group, classify, counter_column, groups, time_column, time_unit
from .stamps import as_seconds
from .table import Table

ALIKE, SMALLER = (0.6, 1.5), 1.3
"""Steps across the end of a row over those within it, and from row to row over those within it, of samples in a row."""
LONGEST = 1.4
"""Usual intervals of rows from which on rows are lost between two."""
MOST, FEWEST = 1000, 10
"""Samples in a row, and rows that tell."""


def unrolled(table: Table) -> Table:
    """The table with a row a sample, if its rows hold several samples of each sensor."""
    bases, numbers = numbered(table)
    used = {name for columns in bases.values() for one in columns.values() for name in one}
    if len(table) < FEWEST or any(len(table.arrays[name]) != len(table) for name in used) or not used:
        return table
    values = {
        f"{base}_{axis}".strip("_"): np.stack([table.arrays[columns[number][place]] for number in numbers], axis=1)
        for base, columns in bases.items()
        for axis, place in AXES.items()
    }
    told = follow(np.stack([each.astype(float) for each in values.values()], axis=2))
    if told is None and any(not base.rpartition("_")[0] for base in bases):
        warnings.warn(
            f"the readings do not tell whether {next(iter(bases.values()))[numbers[0]][0]} and so on are "
            f"{len(numbers)} sensors or samples of one in a row; they are taken for sensors",
            stacklevel=4,
        )
    if not told:
        return table
    count = len(numbers)
    units = {
        f"{base}_{axis}".strip("_"): table.units[columns[numbers[0]][place]]
        for base, columns in bases.items()
        for axis, place in AXES.items()
        if columns[numbers[0]][place] in table.units
    }
    arrays = {}
    time, counter = time_column(table), counter_column(table)
    for name, column in table.arrays.items():
        if name == time:
            arrays[name] = within(as_seconds(column, time_unit(table, name), name).elapsed, count)
            units[name] = "s"
        elif name == counter:
            arrays[name] = np.rint(count * within(rows_of(column), count)).astype(int)
        elif name not in used and len(column) == len(table):
            # Of other sensors a row holds one sample.
            arrays[name] = np.full((len(table) * count, *column.shape[1:]), np.nan)
            arrays[name][::count] = column
            units |= {name: table.units[name]} if name in table.units else {}
    labels = {name: np.repeat(texts, count) for name, texts in table.labels.items()}
    arrays |= {name: each.reshape(-1) for name, each in values.items()}
    return replace(
        table, arrays=arrays, units=units, labels=labels, unreadable={}, kind=f"{table.kind}, {count} samples a row"
    )


def numbered(table: Table) -> tuple[dict[str, dict[int, list[str]]], list[int]]:
    """Sensor and kind → number → columns of x, y, z, of groups that differ in a number, and these numbers."""
    found: dict[str, dict[int, list[str]]] = {}
    for group in groups(table):
        base, number = number_of(group)
        if group.kind in ("gyr", "acc", "mag") and number is not None and len(group.columns) == 3:
            found.setdefault(f"{base}_{group.kind}".strip("_"), {})[number] = group.columns
    several = {base: columns for base, columns in found.items() if len(columns) > 1}
    numbers = sorted(next(iter(several.values()), {}))
    same = all(sorted(columns) == numbers for columns in several.values())
    consecutive = bool(numbers) and numbers == list(range(numbers[0], numbers[0] + len(numbers))) and numbers[0] < 2
    return (several, numbers) if same and consecutive and len(numbers) <= MOST else ({}, [])


def number_of(group: Group) -> tuple[str, int | None]:
    """The sensor of a group without its number, and the number."""
    if group.variant.isdigit():
        return group.sensor, int(group.variant)
    match = re.fullmatch(r"(.*?)[\s_]*(\d+)", group.sensor)
    return (match[1], int(match[2])) if match else (group.sensor, None)


def follow(values: np.ndarray) -> bool | None:
    """Whether values ``(N, k, columns)`` go on from row to row as they do within a row; None if they do not tell."""
    with np.errstate(invalid="ignore", divide="ignore"):
        inside, across, row = (
            np.sqrt(np.nanmean(np.square(steps).reshape(-1, values.shape[2]), axis=0))
            for steps in (np.diff(values, axis=1), values[1:, 0] - values[:-1, -1], np.diff(values[:, 0], axis=0))
        )
        moving = row > 0.0
        if not moving.any():
            return None
        on, larger = float(np.nanmedian((across / inside)[moving])), float(np.nanmedian((row / inside)[moving]))
    if larger > SMALLER:
        return ALIKE[0] < on < ALIKE[1]
    return False if larger < 1.0 / SMALLER else None


def rows_of(counter: np.ndarray) -> np.ndarray:
    """Numbers of rows ``(N,)`` by a counter of rows or of samples, which may wrap."""
    count = as_seconds(counter, "s", "counter").elapsed
    usual = float(np.median(np.diff(count)))
    return count / usual if usual > 0.0 else np.arange(len(count), dtype=float)


def within(rows: np.ndarray, count: int) -> np.ndarray:
    """Times ``(N * count,)`` of samples that begin at those of their rows and fill the usual interval before a gap."""
    steps = np.diff(rows, append=2.0 * rows[-1] - rows[-2])
    usual = float(np.median(steps))
    steps = np.where(steps > LONGEST * usual, usual, steps)
    return (rows[:, None] + steps[:, None] * np.arange(count) / count).reshape(-1)


CELL = re.compile(r'"\s*[\[({]?([^"\[\](){}]*)[\])}]?\s*"|[\[({]([^"\[\](){}]*)[\])}]')
"""A list in brackets or quotes."""
NUMBERS = re.compile(r"\s*[-+]?[\d.]+(?:[eE][-+]?\d+)?(?:(?:\s*[,;]\s*|\s+)[-+]?[\d.]+(?:[eE][-+]?\d+)?)+\s*")
BARE = re.compile(r"[-+]?[\d.]+(?:[eE][-+]?\d+)?(?:,[-+]?[\d.]+(?:[eE][-+]?\d+)?){2,}")
GROUPS = re.compile(r"[-+]?\d{1,3}([,.' ]\d{3})+([.,]\d*)?")
"""Digits in groups of thousands."""


def without_lists(lines: list[str]) -> list[str]:
    """Lines whose cells that hold several numbers are as many cells, with names for them; others as they are."""
    sample = [line for line in lines[-200:] if line.strip()][:-1]
    if sum(bool(split_lists(line)) for line in sample) <= 0.9 * len(sample) or not sample:
        return lines
    mark = ";" if any("\t" not in line and ";" in CELL.sub("", line) for line in sample) else ","
    mark = "\t" if any("\t" in line for line in sample) else mark
    begin = next(number for number, line in enumerate(lines) if split_lists(line))
    sizes = [len(cell.split("\0")) for cell in cells_of(lines[begin], mark)]
    head = [name.strip().strip('"') for name in lines[begin - 1].split(mark)] if begin else []
    result = lines[: max(begin - 1, 0)]
    if len(head) == len(sizes):
        result.append(mark.join(each for name, size in zip(head, sizes, strict=True) for each in spread(name, size)))
    elif begin:
        result.append(lines[begin - 1])
    return result + [mark.join(cells_of(line, mark)).replace("\0", mark) for line in lines[begin:]]


def split_lists(line: str) -> bool:
    """Whether a cell of a line holds several numbers."""
    if any(NUMBERS.fullmatch(cell[1] or cell[2] or "") and not is_one(cell) for cell in CELL.finditer(line)):
        return True
    return "\t" in line and any(BARE.fullmatch(cell) and not GROUPS.fullmatch(cell) for cell in line.split("\t"))


def is_one(cell: re.Match[str]) -> bool:
    """Whether a cell in quotes is one number, with a decimal comma or thousands."""
    content = (cell[1] or "").strip()
    bracket = cell[0].strip('" \t')[:1] in ("[", "(", "{")
    return not bracket and (GROUPS.fullmatch(content) is not None or (content.count(",") < 2 and " " not in content))


def cells_of(line: str, mark: str) -> list[str]:
    """Cells of a line, in those that hold several numbers a null character between them."""

    def marked(cell: re.Match[str]) -> str:
        content = cell[1] or cell[2] or ""
        return (
            "\0".join(re.split(r"[,;\s]+", content.strip()))
            if NUMBERS.fullmatch(content) and not is_one(cell)
            else cell[0]
        )

    cells = CELL.sub(marked, line).split(mark)
    return [cell.replace(",", "\0") if mark == "\t" and BARE.fullmatch(cell) else cell for cell in cells]


def spread(name: str, size: int) -> list[str]:
    """Names of the numbers of a cell: axes of a vector, else counted."""
    if size == 1:
        return [name]
    vector = size == 3 and classify(name) is None
    return [f"{name}_{each}" for each in ("xyz" if vector else range(size))]
