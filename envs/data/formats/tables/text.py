"""Text tables as devices and spreadsheets write them.

What is found out from the content: encoding (with or without byte order mark), line ends (LF, CRLF, CR), delimiter
(comma, semicolon, tab, bar, white space, or what ``sep=`` says), decimal mark, comments and key-value lines before the
table, lines of column names, a line of units, trailing delimiters, blank lines, texts for missing values, and dates
with time zones.
"""

from __future__ import annotations

import csv
import io
import itertools
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .cells import MISSING, is_number, is_value, labels_of, numeric
from .head import decode
from .packed import content_of
from .sequences import without_lists
from .table import DAMAGED, Table, split_unit, units_row

if TYPE_CHECKING:
    import pandas

COMMENT = ("#", "//", "%")
DELIMITERS = (",", ";", "\t", "|", " ")
SAMPLE = 400
"""Lines that decide about the delimiter."""
NAMES = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "white space"}


def fields_of(line: str, delimiter: str) -> list[str]:
    """Fields of a line, without quotes and white space around them."""
    if delimiter == " ":
        return line.split() if '"' not in line else [one.strip('"') for one in re.findall(r'"[^"]*"|\S+', line)]
    if '"' in line:
        try:
            return [field.strip() for field in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
        except csv.Error:  # one line of a megabyte, as of JSON
            pass
    return [field.strip() for field in line.split(delimiter)]


def numbers(line: str, delimiter: str) -> int:
    """How many fields are numbers or dates; 0 if fewer than half of those with content are."""
    content = [field for field in fields_of(line, delimiter) if field.lower() not in MISSING]
    found = sum(is_value(field) for field in content)
    return found if 2 * found >= len(content) else 0


def cells(line: str, delimiter: str) -> int:
    """How many fields are numbers, dates or texts for missing values."""
    return sum(field != "" and is_value(field) for field in fields_of(line, delimiter))


def belongs(line: str, later: str, delimiter: str) -> bool:
    """Whether a line is a row like a later one: as full, or as long with nothing else than numbers."""
    fields, others = fields_of(line, delimiter), fields_of(later, delimiter)
    as_long = len(fields) == len(others) and all(is_value(field) for field in fields if field)
    return as_long or cells(line, delimiter) > 0.3 * cells(later, delimiter)


def guess_delimiter(lines: list[str]) -> str | None:
    """The delimiter that makes most numbers of most lines; None if there are no numbers."""
    step = max(1, len(lines) // SAMPLE)
    sample = [line for line in lines[::step] if line.strip()] or [""]
    score = {mark: float(np.mean([numbers(line, mark) for line in sample])) for mark in DELIMITERS}
    best = max(DELIMITERS, key=lambda mark: score[mark])
    return best if score[best] > 0.0 else None


def read_text(path: Path) -> Table:
    """Read a text table, packed or not, see :func:`table_of`."""
    return table_of(decode(content_of(path)), path.name)


def table_of(text: str, name: str) -> Table:
    """The table of a text.

    Args:
        text: with line feeds only.
        name: of its file, for warnings.

    Raises:
        ValueError: there is no table of numbers, or a row has more fields than the others.
    """
    lines = without_lists(text.rstrip("\n\0 ").split("\n"))
    first = next((line for line in lines if line.strip()), "")
    said = re.fullmatch(r'"?sep=(.)"?[,;\t]*', first.strip())
    delimiter = said[1] if said and said[1] in DELIMITERS else guess_delimiter(lines)
    if delimiter is None:
        raise ValueError(f"no table of numbers is in it; it begins with {first[:60]!r}")
    begin = next(
        (
            number
            for number, line in enumerate(lines)
            if numbers(line, delimiter)
            and not line.lstrip().startswith(COMMENT)
            and all(numbers(after, delimiter) or not after.strip() for after in lines[number + 1 : number + 3])
            and belongs(line, lines[min(number + 5, len(lines) - 1)], delimiter)
        ),
        None,
    )
    if begin is None:
        raise ValueError(f"no table of numbers is in it; it begins with {first[:60]!r}")
    data = [line for line in lines[begin:] if line.strip() and not line.lstrip().startswith(COMMENT)]
    heads_above = {line.strip() for line in lines[:begin] if line.strip()}
    repeated = sum(line.strip() in heads_above for line in data)
    if repeated:
        warnings.warn(
            f"{name}: the header stands {repeated} more times between the rows, as where recordings were "
            "appended to one another; these lines are left out",
            stacklevel=4,
        )
        data = [line for line in data if line.strip() not in heads_above]
    data = without_empty_fields(data, lines[:begin], delimiter)
    widths = [len(fields_of(line, delimiter)) for line in data[:SAMPLE]]
    width = max(set(widths), key=widths.count)
    data = whole_rows(data, delimiter, width, name)
    if len(data) > 1 and cut_off([fields_of(line, delimiter) for line in data[-30:]], width, text.endswith("\n")):
        warnings.warn(f"{name}: the last row is cut off ({data[-1][-40:]!r}) and left out", stacklevel=4)
        del data[-1]
    frame = parse(data, delimiter, width)
    above = lines[:begin]
    heads = header_lines(above, delimiter, width)
    if not heads and delimiter == "," and above:
        named = max(len(fields_of(line, delimiter)) for line in above[-2:])
        if 4 <= named < width <= 2 * named:
            raise ValueError(
                f"its header names {named} columns, but its rows have {width} fields: commas separate fields and mark "
                "decimals; export it with another delimiter, or with decimal points"
            )
    shifted = bool(heads) and all(not head[-1] for _, head in heads) and numbered(frame)
    names, units = names_and_units([[""] * shifted + head[: width - shifted] for _, head in heads], width)
    twice = [each for each in names if re.sub(r"\.\d+$", "", each) in names and re.search(r"\.\d+$", each)]
    if twice:
        warnings.warn(f"{name}: names of columns occur more than once; the later ones are called {twice}", stacklevel=4)
    used = {number for number, _ in heads}
    arrays, unreadable, labels, texts = {}, {}, {}, {}
    read = [numeric(frame[column]) for column in range(width)]
    # Of dates all must be readable.
    damaged = np.unique([row for values, wrong in read if values is None for row in wrong])
    if 0 < len(damaged) < DAMAGED * len(frame):
        row = int(damaged[0])
        found = ", ".join(str(frame[column].iloc[row]) for column in range(width))
        warnings.warn(
            f"{name}: {len(damaged)} rows hold no date and are left out, the first: {found[:60]}",
            stacklevel=4,
        )
        frame = frame.drop(index=damaged).reset_index(drop=True)
        read = [numeric(frame[column]) for column in range(width)]
    for column, name in enumerate(names):
        values, wrong = read[column]
        row_labels = labels_of(name, frame[column], values)
        if row_labels is not None:
            labels[name] = row_labels
        if values is None and frame[column].notna().any():
            texts[name] = str(frame[column].dropna().iloc[0])[:40]
        if values is None or (column >= len(names) - 2 and not name and np.isnan(values.astype(float)).all()):
            continue
        arrays[name or str(column)] = values
        if values.dtype.kind == "i" and frame[column].dtype.kind not in "iuf":
            units[name or str(column)] = "ns"
        if len(wrong):
            unreadable[name or str(column)] = int(wrong[0]), str(frame[column].iloc[int(wrong[0])]), len(wrong)
    # Rows of texts for missing values alone are blank lines.
    blank = np.all(
        [np.isnan(values) if values.dtype.kind == "f" else values != values for values in arrays.values()], 0
    )
    if blank.any():
        arrays = {name: values[~blank] for name, values in arrays.items()}
        labels = {name: values[~blank] for name, values in labels.items()}
    return Table(
        arrays=arrays,
        units=units,
        preamble=tuple(line.strip() for number, line in enumerate(above) if number not in used and line.strip()),
        kind=f"text, delimited by {NAMES[delimiter]}",
        named=bool(heads),
        unreadable=unreadable,
        labels=labels,
        texts=texts,
    )


def without_empty_fields(data: list[str], above: list[str], delimiter: str) -> list[str]:
    """Rows without the empty fields at their ends that no name stands over."""
    head = next((line for line in reversed(above) if line.strip()), "")
    if delimiter == " " or not head or not data[0].endswith(2 * delimiter):
        return data
    empty = min(len(line) - len(line.rstrip(delimiter)) for line in data)
    named = len(fields_of(data[0], delimiter)) - len(fields_of(head, delimiter))
    return [line[:-empty] for line in data] if empty == named > 1 else data


def cut_off(rows: list[list[str]], width: int, ended: bool) -> bool:
    """Whether the last of some rows lacks fields, or (in a file that does not end with its line) digits of the last."""
    *before, last = rows
    if len(last) < width:
        return True
    digits = {len(row[width - 1]) - row[width - 1].replace(",", ".").rfind(".") for row in before if len(row) >= width}
    own = last[width - 1]
    return not ended and bool(digits) and len(own) - own.replace(",", ".").rfind(".") < min(digits)


def whole_rows(data: list[str], delimiter: str, width: int, name: str) -> list[str]:
    """Rows without the few that have another number of fields, with a warning: lines that were cut off or merged.

    Raises:
        ValueError: many rows have more fields than there are columns.
    """
    quoted = any('"' in line for line in data)
    count = len if delimiter != " " and not quoted else None
    lengths = np.array(
        [line.count(delimiter) + 1 if count else len(fields_of(line, delimiter)) for line in data], dtype=int
    )
    bare = np.array([not line.rstrip(" ").endswith(delimiter) for line in data]) if delimiter != " " else True
    wrong = (lengths < width) | ((lengths > width) & ((lengths > width + 1) | bare))
    # The last row is looked at more closely than others.
    wrong[-1] &= lengths[-1] > width
    if not wrong.any():
        return data
    row = int(np.flatnonzero(wrong)[0])
    if wrong.sum() < DAMAGED * len(data):
        warnings.warn(
            f"{name}: {int(wrong.sum())} rows have another number of fields than {width} and are left out, the first, "
            f"row {row}: {data[row][:60]!r}",
            stacklevel=5,
        )
        return [line for line, bad in zip(data, wrong, strict=True) if not bad]
    if (lengths[wrong] > width).any():
        row = int(np.flatnonzero(wrong & (lengths > width))[0])
        raise ValueError(
            f"row {row} of its table has {lengths[row]} fields, most rows have {width}: {data[row][:60]!r}"
        )
    return data


def numbered(frame: pandas.DataFrame) -> bool:
    """Whether the first column numbers the rows, as R writes them without a name, and the last is not empty."""
    first, last = frame.iloc[:, 0], frame.iloc[:, -1]
    steps = np.diff(first.to_numpy()[:SAMPLE]) if first.dtype.kind == "i" else np.zeros(1)
    return bool((steps == 1).all() and last.notna().any())


def parse(data: list[str], delimiter: str, width: int) -> pandas.DataFrame:
    """Rows as a frame, its columns by their numbers."""
    import pandas

    decimal = "."
    if delimiter != ",":
        tokens = [field for line in data[:SAMPLE] for field in fields_of(line, delimiter)]
        commas, points = (sum(mark in token and is_number(token) for token in tokens) for mark in ",.")
        decimal = "," if commas > 0.5 * points else "."
    try:
        return pandas.read_csv(
            io.StringIO("\n".join(data)),
            header=None,
            names=range(width),
            index_col=False,
            sep=r"\s+" if delimiter == " " else delimiter,
            decimal=decimal,
            na_values=[*MISSING, *(text.upper() for text in MISSING), *(text.title() for text in MISSING)],
            skipinitialspace=True,
            low_memory=False,
        )
    except (pandas.errors.ParserError, pandas.errors.EmptyDataError) as reason:
        raise ValueError(f"its table is not readable: {reason}") from None


def header_lines(above: list[str], delimiter: str, width: int) -> list[tuple[int, list[str]]]:
    """Lines of names and units right before the data, with their numbers, from top to bottom."""
    found: list[tuple[int, list[str]]] = []
    for number in range(len(above) - 1, -1, -1):
        line = above[number].strip(" ")
        if not line.strip():
            continue
        fields = fields_of(re.sub(r"^\s*(#|//|%)\s*", "", line), delimiter)
        content = [field for field in fields if field]
        same = len(fields) in (width - 1, width, width + 1) and len(content) > 0.25 * width
        # pandas writes the name of its index below those of several levels.
        higher = fields_of(above[number - 1], delimiter) if number else []
        same |= len(fields) == width and bool(found) and not fields[0] and len(content) >= 2
        same |= not found and len(fields) == width == len(higher) and content == fields[:1] and not higher[0]
        if not same or len(found) == 3 or (any(is_number(field) for field in content) and len(found)):
            break
        if content and content[0].endswith(":"):
            break
        found.insert(0, (number, fields[:width] + [""] * (width - len(fields))))
    return found


def names_and_units(heads: list[list[str]], width: int) -> tuple[list[str], dict[str, str]]:
    """Unique column names, and the units by name, of the lines of a header."""
    rows = [[re.sub(r"^'(.*)'$", r"\1", cell) for cell in head] for head in heads]
    of_units = [row for row in rows if len(rows) > 1 and units_row(row)][-1:]
    rows = [row for row in rows if row not in of_units]
    unit_line = [re.sub(r"^[(\[](.*)[)\]]$", r"\1", cell) for cell in of_units[0]] if of_units else [""] * width
    if len(rows) > 1 and any(not cell for cell in rows[0][1:]):
        # A line of groups over a line of axes: the group's name stands over its first column.
        group = ""
        for column in range(width):
            group = rows[0][column] or group
            rows[0][column] = group
    names: list[str] = []
    units = {}
    for column in range(width):
        parts = [row[column] for row in rows if row[column]]
        name, unit = split_unit("/".join(parts))
        if name and name in names:
            name = next(each for each in (f"{name}.{number}" for number in itertools.count(1)) if each not in names)
        names.append(name)
        if unit or unit_line[column]:
            units[name] = unit or unit_line[column]
    return names, units
