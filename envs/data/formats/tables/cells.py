"""Cells of text tables: numbers in every spelling, texts for missing values, dates, and labels of sensors."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from .stamps import DATE, nanoseconds
from .table import factor

if TYPE_CHECKING:
    import pandas

MISSING = (
    "", "-", "--", "---", "…", "...", "?", "*", "na", "n/a", "n.a.", "null", "<null>", "none", "nil", "missing",
    "undef", "undefined", "void", "nat", "<na>", "nan", "-nan", "nan(ind)", "-nan(ind)", "nan(snan)", "1.#qnan",
    "-1.#qnan", "1.#ind", "-1.#ind", "1.#inf", "-1.#inf", "1.#snan", "#n/a", "#na", "#value!", "#div/0!", "#num!",
    "#name?", "#ref!", "#null!",
)  # fmt: skip
"""Texts for no value, in lower case: of languages, databases, C libraries and spreadsheets."""
HEX = re.compile(r"0x(?:[0-9a-f]{2}|[0-9a-f]{4}|[0-9a-f]{8})", re.IGNORECASE)
NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eEdD][-+]?\d+)?|[-+]?(inf|infinity)", re.IGNORECASE)
GROUPED = re.compile(
    r"[-+]?\d{1,3}((?P<mark>[' ])\d{3}((?P=mark)\d{3})*)?([.,]\d*)?"
    r"|[-+]?\d{1,3}(,\d{3})*\.\d*|[-+]?\d{1,3}(\.\d{3})*,\d*"
)
"""Digits in groups of thousands, where the decimal mark is another one."""
DURATION = re.compile(r"([-+]?\d+(?:[.,]\d+)?)\s*(s|secs?|seconds?|ms|msec|us|µs|min|minutes?|hr?|hours?)")
"""A duration with its unit, as MATLAB writes it."""
FEW = 16
"""Different whole numbers up to which a column may number sensors, whatever its name."""
SENSOR = re.compile(
    r"(^|[\W_])(id|sensor|device|node|imu|mac|address|type|kind|channel|topic|stream|inst|instance)s?([\W_]*(id|no|number|name))?$",
    re.IGNORECASE,
)
OFTEN, MOST_SENSORS = 0.3, 64
"""Share of rows whose label is not that of the row before, and different ones, where labels name sensors."""


def is_number(field: str) -> bool:
    """Whether a field is a number, with either decimal mark."""
    return NUMBER.fullmatch(field) is not None


def is_value(field: str) -> bool:
    """Whether a field may stand in a table of numbers."""
    spelled = HEX.fullmatch(field) or DATE.fullmatch(field) or DURATION.fullmatch(field)
    return is_number(field) or field.lower() in MISSING or bool(spelled)


def labels_of(name: str, column: pandas.Series, values: np.ndarray | None) -> np.ndarray | None:
    """Texts ``(N,)`` of a column that names the sensor of a row (or its number, by the column's name), or None."""
    named = SENSOR.search(name) is not None or name.lower() in ("unit", "units")
    few = values is not None and values.dtype.kind in "iu" and len(np.unique(values)) <= FEW
    if values is not None and not named and not few:
        return None
    texts = column.astype("string").str.strip().fillna("").to_numpy(dtype=object)
    changes = float((texts[1:] != texts[:-1]).mean()) if len(texts) > 1 else 0.0
    different = len(set(texts.tolist()) - {""})
    return texts if (named or changes > OFTEN) and 2 <= different <= MOST_SENSORS else None


def numeric(column: pandas.Series) -> tuple[np.ndarray | None, np.ndarray]:
    """Numbers of a column (None for texts), and the rows whose cells are none."""
    import pandas

    if column.dtype.kind in "iufb":
        return column.to_numpy(), np.array([], int)
    texts = column.astype("string").str.strip()
    filled = texts.notna() & ~texts.str.lower().isin(MISSING).fillna(False)
    values = pandas.to_numeric(texts, errors="coerce")
    if values[filled].isna().any():
        values = pandas.to_numeric(texts.str.replace(",", ".", regex=False), errors="coerce")
    if values[filled].isna().any():
        values = pandas.to_numeric(spelled_out(texts, filled), errors="coerce")
    if values[filled].isna().all() and texts[filled].str.fullmatch(HEX.pattern, flags=re.IGNORECASE).all():
        values[filled] = signed(texts[filled])
    wrong = filled & values.isna()
    if not filled.any() or wrong.sum() > 0.5 * filled.sum():
        first = str(texts[filled].iloc[0]) if filled.any() else ""
        if DURATION.fullmatch(first):
            return durations(texts), np.array([], int)
        found, none = (nanoseconds(texts) if DATE.fullmatch(first) else None), np.array([], int)
        if found is None and DATE.fullmatch(first):
            none = np.flatnonzero(~texts.str.fullmatch(DATE.pattern, flags=re.IGNORECASE).fillna(False).to_numpy(bool))
        return found, none
    return values.to_numpy(dtype=float), np.flatnonzero(wrong)


def signed(texts: pandas.Series) -> np.ndarray:
    """Hexadecimal numbers ``(N,)``, those of four or eight digits as registers of sensors hold them, with a sign."""
    values = np.array([int(text, 16) for text in texts], dtype=float)
    digits = {len(text) - 2 for text in texts}
    range_of = 16.0 ** digits.pop()
    return np.where(values >= range_of / 2.0, values - range_of, values) if not digits and range_of > 256.0 else values


def durations(texts: pandas.Series) -> np.ndarray | None:
    """Durations as whole ns; None if one of them is none."""
    parts = texts.str.extract(DURATION.pattern)
    if parts.isna().any(axis=None):
        return None
    scale = parts[1].map({unit: factor("time", unit) for unit in parts[1].unique()}).to_numpy(dtype=float)
    return np.rint(parts[0].str.replace(",", ".", regex=False).astype(float).to_numpy() * scale * 1e9).astype(np.int64)


def spelled_out(texts: pandas.Series, filled: pandas.Series) -> pandas.Series:
    """Numbers as Python writes them, of those with a Fortran exponent or with digits in groups of thousands."""
    texts = texts.str.replace(r"(?<=\d)[dD](?=[-+]?\d)", "e", regex=True)
    for mark in (".", ","):
        # A mark that occurs twice in a number is no decimal mark.
        whole = texts[filled].str.fullmatch(rf"[-+]?\d{{1,3}}(\{mark}\d{{3}})*").all()
        if whole and (texts[filled].str.count(rf"\{mark}") > 1).any():
            return texts.str.replace(mark, "", regex=False)
    if not texts[filled].str.fullmatch(GROUPED).all():
        return texts
    for group, decimal in ((",", "."), (".", ",")):
        marks = texts[filled].str.rfind(group), texts[filled].str.rfind(decimal)
        if (marks[1] >= 0).all() and (marks[0] < marks[1]).all():
            return texts.str.replace(f"[{group}' ]", "", regex=True).str.replace(decimal, ".", regex=False)
    return texts.str.replace("[' ]", "", regex=True)
