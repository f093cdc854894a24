"""Tables out of frames of pandas: dates, labels, and cells that hold lists or objects."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .cells import labels_of, numeric
from .sequences import spread
from .table import Table, split_unit

if TYPE_CHECKING:
    import pandas


def table_of_frame(frame: pandas.DataFrame, kind: str) -> Table:
    """A table of a frame; texts are left out, dates become ns."""
    import pandas

    arrays: dict[str, np.ndarray] = {}
    labels: dict[str, np.ndarray] = {}
    for name, column in (part for each, whole in frame.items() for part in parts_of(str(each), whole)):
        if column.dtype.kind == "m":
            values: np.ndarray | None = column.to_numpy("timedelta64[ns]").astype(np.int64)
        elif column.dtype.kind == "M":
            values = pandas.to_datetime(column, utc=True).to_numpy("datetime64[ns]").astype(np.int64)
        else:
            values, _ = numeric(column)
        found = labels_of(name, column, values)
        labels |= {name: found} if found is not None else {}
        if values is not None:
            dates = column.dtype.kind in "mM" or (values.dtype.kind == "i" and column.dtype.kind not in "iufb")
            arrays[f"{name} (ns)" if dates else name] = values
    return replace(as_named(arrays, kind), labels=labels)


def parts_of(name: str, column: pandas.Series) -> Iterator[tuple[str, pandas.Series]]:
    """A column, or those of which its cells are lists (of one length) or objects; missing cells are missing in all."""
    cells = (
        [list(each) if isinstance(each, np.ndarray | tuple) else each for each in column]
        if column.dtype == object
        else []
    )
    lists, objects_ = ([each for each in cells if isinstance(each, kind)] for kind in (list, dict))
    if objects_:
        for key in objects_[0]:
            inner = [each.get(key) if isinstance(each, dict) else None for each in cells]
            yield from parts_of(f"{name}.{key}", column.__class__(inner, dtype=object).infer_objects())
    elif lists and all(isinstance(one, dict) for each in lists for one in each):
        for key in lists[0][0] if lists[0] else ():
            inner = [[one.get(key) for one in each] if isinstance(each, list) else None for each in cells]
            yield from parts_of(f"{name}.{key}", column.__class__(inner, dtype=object))
    elif lists:
        # The last packet may be shorter.
        size = len(lists[0])
        if size and all(len(each) == size for each in lists[:-1]) and len(lists[-1]) <= size:
            for place, label in enumerate(spread(name, size)):
                inner = [each[place] if isinstance(each, list) and place < len(each) else None for each in cells]
                yield from parts_of(label, column.__class__(inner, dtype=object).infer_objects())
    else:
        yield name, column


def as_named(arrays: dict[str, np.ndarray], kind: str) -> Table:
    """A table of arrays whose names may end with a unit."""
    parts = [split_unit(name) for name in arrays]
    units = {name: unit for name, unit in parts if unit}
    return Table({name: values for (name, _), values in zip(parts, arrays.values(), strict=True)}, units, kind=kind)
