"""Text tables as devices and spreadsheets write them.

What is found out from the content: encoding (with or without byte order mark), line ends (LF, CRLF, CR), delimiter
(comma, semicolon, tab, bar, white space, or what ``sep=`` says), decimal mark, comments and key-value lines before the
table, lines of column names, a line of units, trailing delimiters, blank lines, texts for missing values, and dates
with time zones.
"""

from __future__ import annotations

import csv
import io
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .stamps import DATE, nanoseconds
from .table import Table, split_unit, units_row

if TYPE_CHECKING:
    import pandas

MISSING = (
    "", "-", "--", "---", "…", "...", "?", "*", "na", "n/a", "n.a.", "null", "<null>", "none", "nil", "missing",
    "undef", "undefined", "void", "nat", "<na>", "nan", "-nan", "nan(ind)", "-nan(ind)", "nan(snan)", "1.#qnan",
    "-1.#qnan", "1.#ind", "-1.#ind", "1.#inf", "-1.#inf", "1.#snan", "#n/a", "#na", "#value!", "#div/0!", "#num!",
    "#name?", "#ref!", "#null!",
)  # fmt: skip
"""Texts for no value, in lower case: of languages, databases, C libraries and spreadsheets."""
NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eEdD][-+]?\d+)?|[-+]?(inf|infinity)", re.IGNORECASE)
GROUPED = re.compile(r"[-+]?\d{1,3}('\d{3})+([.,]\d*)?|[-+]?\d{1,3}(,\d{3})*\.\d*|[-+]?\d{1,3}(\.\d{3})*,\d*")
"""Digits in groups of thousands, where the decimal mark is another one."""
ALIKE = str.maketrans({"\u2212": "-", "\u00a0": " ", "\u202f": " ", "\u2009": " ", "\ufeff": None})
"""Signs and spaces of typesetters → those of numbers."""
COMMENT = ("#", "//", "%")
DELIMITERS = (",", ";", "\t", "|", " ")
SENSOR = re.compile(
    r"(^|[\W_])(id|sensor|device|node|imu|mac|address|type|kind|channel|topic|stream)s?([\W_]*(id|no|number|name))?$",
    re.IGNORECASE,
)
OFTEN, MOST_SENSORS = 0.3, 64
"""Share of rows whose label is not that of the row before, and different ones, where labels name sensors."""
SAMPLE = 400
"""Lines that decide about the delimiter."""
NAMES = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "white space"}


def decode(content: bytes) -> str:
    """Text of a file with line feeds only."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = content.decode("utf-16", errors="replace")
    elif wide(content):
        text = content.decode(wide(content), errors="replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("cp1252", errors="replace")
    return text.translate(ALIKE).replace("\r\n", "\n").replace("\r", "\n")


def wide(content: bytes) -> str:
    """The encoding of a text of two bytes a letter without byte order mark; empty of others."""
    head = content[:4096]
    for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        if len(head) > 16 and head[first::2].count(0) > 0.95 * (len(head) // 2) and head[1 - first :: 2].count(0) == 0:
            return encoding
    return ""


def is_text(head: bytes) -> bool:
    """Whether the first bytes of a file are those of a text."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")) or wide(head):
        return True
    printable = sum(byte >= 32 or byte in (9, 10, 13) for byte in head)
    return bool(head) and b"\0" not in head and printable > 0.97 * len(head)


def fields_of(line: str, delimiter: str) -> list[str]:
    """Fields of a line, without quotes and white space around them."""
    if delimiter == " ":
        return line.split()
    if '"' in line:
        try:
            return [field.strip() for field in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
        except csv.Error:  # one line of a megabyte, as of JSON
            pass
    return [field.strip() for field in line.split(delimiter)]


def is_number(field: str) -> bool:
    """Whether a field is a number, with either decimal mark."""
    return NUMBER.fullmatch(field) is not None


def is_value(field: str) -> bool:
    """Whether a field may stand in a table of numbers."""
    return is_number(field) or field.lower() in MISSING or DATE.fullmatch(field) is not None


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
    """Read a text table, see :func:`table_of`."""
    return table_of(decode(path.read_bytes()), path.name)


def table_of(text: str, name: str) -> Table:
    """The table of a text.

    Args:
        text: with line feeds only.
        name: of its file, for warnings.

    Raises:
        ValueError: there is no table of numbers, or a row has more fields than the others.
    """
    lines = text.rstrip("\n\0 ").split("\n")
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
    widths = [len(fields_of(line, delimiter)) for line in data[:SAMPLE]]
    width = max(set(widths), key=widths.count)
    if len(data) > 1 and cut_off([fields_of(line, delimiter) for line in data[-30:]], width, text.endswith("\n")):
        warnings.warn(f"{name}: the last row is cut off ({data[-1][-40:]!r}) and left out", stacklevel=4)
        del data[-1]
    frame = parse(data, delimiter, width)
    above = lines[:begin]
    heads = header_lines(above, delimiter, width)
    names, units = names_and_units([head for _, head in heads], width)
    twice = [each for each in names if re.sub(r"\.\d+$", "", each) in names and re.search(r"\.\d+$", each)]
    if twice:
        warnings.warn(f"{name}: names of columns occur more than once; the later ones are called {twice}", stacklevel=4)
    used = {number for number, _ in heads}
    arrays, unreadable, labels, texts = {}, {}, {}, {}
    for column, name in enumerate(names):
        values, wrong = numeric(frame[column])
        texts_found = labels_of(name, frame[column], values)
        if texts_found:
            labels[name] = texts_found
        if values is None and frame[column].notna().any():
            texts[name] = str(frame[column].dropna().iloc[0])[:40]
        if values is None or (column >= len(names) - 2 and not name and np.isnan(values.astype(float)).all()):
            continue
        arrays[name or str(column)] = values
        if values.dtype.kind == "i" and frame[column].dtype.kind not in "iuf":
            units[name or str(column)] = "ns"
        if wrong is not None:
            unreadable[name or str(column)] = wrong
    # Rows of texts for missing values alone are blank lines.
    blank = np.all(
        [np.isnan(values) if values.dtype.kind == "f" else values != values for values in arrays.values()], 0
    )
    if blank.any():
        arrays = {name: values[~blank] for name, values in arrays.items()}
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


def labels_of(name: str, column: pandas.Series, values: np.ndarray | None) -> tuple[str, ...]:
    """Texts (or numbers of sensors) that change from row to row; empty of all other columns."""
    if values is not None and not SENSOR.search(name):
        return ()
    texts = column.dropna().astype("string").str.strip()
    changes = float((texts.to_numpy()[1:] != texts.to_numpy()[:-1]).mean()) if len(texts) > 1 else 0.0
    texts_found = tuple(texts.unique()) if changes > OFTEN else ()
    return texts_found if 2 <= len(texts_found) <= MOST_SENSORS else ()


def cut_off(rows: list[list[str]], width: int, ended: bool) -> bool:
    """Whether the last of some rows lacks fields, or (in a file that does not end with its line) digits of the last."""
    *before, last = rows
    if len(last) < width:
        return True
    digits = {len(row[width - 1]) - row[width - 1].replace(",", ".").rfind(".") for row in before if len(row) >= width}
    own = last[width - 1]
    return not ended and bool(digits) and len(own) - own.replace(",", ".").rfind(".") < min(digits)


def parse(data: list[str], delimiter: str, width: int) -> pandas.DataFrame:
    """Rows as a frame, its columns by their numbers."""
    import pandas

    decimal = "."
    if delimiter != ",":
        tokens = [field for line in data[:SAMPLE] for field in fields_of(line, delimiter)]
        decimal = (
            ","
            if sum("," in token and is_number(token) for token in tokens)
            > 0.5 * sum("." in token and is_number(token) for token in tokens)
            else "."
        )
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
        if not same or len(found) == 3 or (any(is_number(field) for field in content) and len(found)):
            break
        if content and content[0].endswith(":"):
            break
        found.insert(0, (number, fields[:width] + [""] * (width - len(fields))))
    return found


def names_and_units(heads: list[list[str]], width: int) -> tuple[list[str], dict[str, str]]:
    """Unique column names, and the units by name, of the lines of a header."""
    rows = [list(head) for head in heads]
    unit_line = [re.sub(r"^[(\[](.*)[)\]]$", r"\1", cell) for cell in rows.pop()] if units_below(rows) else [""] * width
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
        if name in names:
            name = f"{name}.{names.count(name)}" if name else ""
        names.append(name)
        if unit or unit_line[column]:
            units[name] = unit or unit_line[column]
    return names, units


def units_below(rows: list[list[str]]) -> bool:
    """Whether the last line of a header holds units."""
    return len(rows) > 1 and units_row(rows[-1])


def numeric(column: pandas.Series) -> tuple[np.ndarray | None, tuple[int, str] | None]:
    """Numbers of a column (None for texts), and row and content of the first cell that is none."""
    import pandas

    if column.dtype.kind in "iufb":
        return column.to_numpy(), None
    texts = column.astype("string").str.strip()
    filled = texts.notna() & ~texts.str.lower().isin(MISSING).fillna(False)
    values = pandas.to_numeric(texts, errors="coerce")
    if values[filled].isna().any():
        values = pandas.to_numeric(texts.str.replace(",", ".", regex=False), errors="coerce")
    if values[filled].isna().any():
        values = pandas.to_numeric(spelled_out(texts, filled), errors="coerce")
    wrong = filled & values.isna()
    if not filled.any() or wrong.sum() > 0.5 * filled.sum():
        first = str(texts[filled].iloc[0]) if filled.any() else ""
        return (nanoseconds(texts), None) if DATE.fullmatch(first) else (None, None)
    row = int(np.flatnonzero(wrong)[0]) if wrong.any() else None
    return values.to_numpy(dtype=float), None if row is None else (row, str(texts.iloc[row]))


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
            return texts.str.replace(f"[{group}']", "", regex=True).str.replace(decimal, ".", regex=False)
    return texts.str.replace("'", "", regex=False)
