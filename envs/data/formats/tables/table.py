"""A table of numbers, whatever file it comes from, and the units that its header names."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .....filters.core.quantity import STANDARD_GRAVITY
from .....filters.support.names import unknown

UNIT = re.compile(r"^(?P<name>.*?)[\s_]*(\((?P<a>(?:[^()]|\([^()]*\))*)\)|\[(?P<b>[^\[\]]*)\])$")
FORCE, FIELD = "acc|^a_?[xyz]?$", "mag|^m"
ONLY_OF = {"g": FORCE, "gs": f"{FORCE}|{FIELD}", "mg": f"{FORCE}|{FIELD}", "a/m": FIELD, "s": "^time"}
ONLY_OF |= dict.fromkeys(("t", "ut", "µt", "nt", "mt"), FIELD) | dict.fromkeys(
    ("rad", "d/s", "r/min"), "gyr|^g_?[xyz]?$"
)
"""Short units at the end of a name → what the name before it must match."""
MULTIPLE = re.compile(r"(?P<times>\d+\.?\d*|\.\d+)(?:/(?P<parts>[1-9]\d*\.?\d*))?(?P<unit>\D.*)")
"""A number of units, or parts of one as raw readings have, ``1/16 deg/s``."""
RATE = re.compile(r"(\d+(?:[.,]\d+)?)\s*(k?hz|[mµu]?s\b(?![-^⁻]))?", re.IGNORECASE)
"""A rate, or the interval of a sample."""
QUOTIENT = re.compile(r"^(?P<name>.*?(?:[xyz]|time|\bt))\s*(?:/|:| - )\s*(?P<unit>\S+)$", re.IGNORECASE)
"""Quantity over unit as ISO 80000 writes it, ``acc_x/(m/s²)`` or ``t/s``, and the same with a colon or a dash."""


def _spellings(factors: dict[float, str]) -> dict[str, float]:
    return {spelling: factor for factor, names in factors.items() for spelling in names.split()}


UNITS = {
    "gyr": _spellings(
        {
            1.0: "rad/s rads-1 rad*s-1 rads",
            np.pi / 180: "deg/s dps degs-1 d/s degs",
            np.pi / 180e2: "cdeg/s",
            np.pi / 180e3: "mdps mdeg/s millideg/s millidegrees/s",
            np.pi / (180.0 * 60.0): "deg/min",
            np.pi / (180.0 * 3600.0): "deg/h deg/hr",
            1e-3: "mrad/s mrads",
            1e-6: "urad/s µrad/s",
            2.0 * np.pi: "rev/s rps turn/s turns/s",
            np.pi / 30.0: "rpm rev/min r/min",
        }
    ),
    "acc": _spellings(
        {
            1.0: "m/s2 m/(s2) ms-2 mps2 ms2 m/s/s m*s-2 n/kg",
            STANDARD_GRAVITY: "g g0 gs gee gn g-force gforce g's",
            STANDARD_GRAVITY / 1000.0: "mg milli-g mgs",
            STANDARD_GRAVITY / 1e6: "ug µg",
            1e3: "km/s2",
            0.1: "dm/s2",
            0.01: "cm/s2 gal",
            0.001: "mm/s2",
            1e-5: "mgal",
            0.3048: "ft/s2",
        }
    ),
    "mag": _spellings(
        {
            1.0: "ut µt microt microtesla a.u. au arb.u. local_flux 1 normalized",
            1000.0: "mt",
            1e6: "t tesla",
            0.001: "nt",
            100.0: "gauss gs g ga",
            0.1: "mgauss mg mga milligauss",
            0.4 * np.pi: "a/m",
        }
    ),
    "time": _spellings(
        {1.0: "s sec secs second seconds", 1e-3: "ms msec millis milliseconds", 1e-6: "us µs usec micros microseconds"}
        | {1e-9: "ns nsec nanos nanoseconds", 60.0: "min minutes", 3600.0: "h hours", 86400.0: "days"}
    ),
    "angle": _spellings({1.0: "rad radians", np.pi / 180: "deg degree degrees"}),
}
"""Kind of quantity → spelling of a unit without white space, in lower case → factor to rad/s, m/s², µT, s, rad."""
KNOWN_UNITS = {spelling for spellings in UNITS.values() for spelling in spellings}
NAMED_UNITS = {unit for kind in ("gyr", "acc", "mag") for unit in UNITS[kind] if len(unit) > 2} | set(ONLY_OF)
OTHER_UNITS = {"c", "degc", "°c", "kpa", "hpa", "pa", "mv", "v", "%", "m", "mm", "cm", "hz", "counts", "lsb", "n", "nm"}


SPELLINGS = (
    (r"â(?=[°µμ²])", ""),  # a text of UTF-8 that was read as another
    (r"−", "-"),
    (r"⁻¹", "-1"),
    (r"⁻²|\^-2", "-2"),
    (r"\^-1", "-1"),
    (r"μ", "µ"),
    (r"\bper\b|(?<=[a-z])per(?=s)", "/"),
    (r"(?<=[a-z°])\s*[.*·]\s*(?=[a-z])|\s+", " "),
    (r"[°º˚¡]|\b(degrees?|grad)\b", "deg"),
    (r"\bradians?\b", "rad"),
    (r"\bmet(er|re)s?\b", "m"),
    (r"(?<=[/ ])(seconds?|sec)\b", "s"),
    (r" ?squared|\*\*2|\^2|²", "2"),
    (r"\bmilli[- ]", "m"),
    (r"\bmicro[- ]", "u"),
    (r" ", ""),
)
"""Ways to write a unit → that of the table of units, one after another."""


def plain(unit: str) -> str:
    """A unit as the table of units spells it: ``deg.s⁻¹``, ``radians per second`` and the like by their short forms."""
    short = re.sub(r"\s+", "", unit).lower()
    if short in KNOWN_UNITS or short in OTHER_UNITS:
        return short
    short = unit.strip().lower()
    for pattern, spelling in SPELLINGS:
        short = re.sub(pattern, spelling, short)
    return short


def factor(kind: str, unit: str) -> float:
    """What a value of a kind in a unit is multiplied by.

    Raises:
        ValueError: the unit is none of the kind.
    """
    known = UNITS.get(kind)
    if known is None:
        return 1.0
    if isinstance(unit, str):
        if plain(unit) in known:
            return known[plain(unit)]
        parts = MULTIPLE.fullmatch(plain(unit))
        if parts is not None and parts["unit"] in known and float(parts["times"]) > 0.0:
            return float(parts["times"]) / float(parts["parts"] or 1.0) * known[parts["unit"]]
    raise ValueError(f"units[{kind!r}]: {unknown('unit', unit, known)}")


def split_unit(name: str) -> tuple[str, str]:
    """Name and unit of ``name (unit)``, ``name [unit]``, ``name/unit``, ``name, unit``, ``name_unit``, ``t in unit``.

    An index like ``Mat[1]`` is of the name.
    """
    quotient = QUOTIENT.match(name.strip())
    if quotient is not None and plain(quotient["unit"].strip("()[]")) in KNOWN_UNITS - {"1"}:
        return quotient["name"], quotient["unit"].strip("()[]")
    match = UNIT.match(name.strip())
    if match is None or (match["b"] and match["b"].isdigit()):
        stem, unit = split_ending(name.strip())
        if unit:
            return stem, unit
    if match is None:
        stem, said, unit = name.strip().rpartition(" in ")
        if said and plain(unit) in UNITS["time"]:
            return stem, unit
        stem, said, unit = name.strip().rpartition(", ")
        return (stem, unit) if said and plain(unit) in KNOWN_UNITS and not unit.isdigit() else (name.strip(), "")
    unit = (match["a"] if match["a"] is not None else match["b"]).strip()
    multiple = MULTIPLE.fullmatch(plain(unit))
    known = (plain(unit) in KNOWN_UNITS or plain(unit) in OTHER_UNITS) and not unit.isdigit()
    # A number before another unit may be a range, (16 g).
    known = known or bool(multiple and multiple["unit"] in (KNOWN_UNITS if multiple["parts"] else UNITS["time"]))
    return (match["name"].strip(), unit) if unit == "" or known else (name.strip(), "")


def split_ending(name: str) -> tuple[str, str]:
    """Name and unit of ``name_unit``, ``name_unit_axis`` and ``name_unit[0]``; the unit may have underscores."""
    parts = re.fullmatch(r"(?P<words>.*?)(?P<axis>_[xyz]|\[\d\])?", name, re.IGNORECASE | re.DOTALL)
    assert parts is not None  # the axis may be missing, and the words may be anything
    words = parts["words"].split("_")
    for start in range(1, len(words)):
        stem, ending = "_".join(words[:start]), words[start:]
        quotient = f"{ending[0]}/{''.join(ending[1:])}" if len(ending) > 1 else ending[0]
        for unit in (plain(quotient), plain(" ".join(ending))):
            if unit in NAMED_UNITS and re.search(ONLY_OF.get(unit, "[a-z]$"), stem, re.IGNORECASE):
                return stem + (parts["axis"] or ""), "rad/s" if unit == "rad" else unit
    return name, ""


def units_row(cells: Sequence[str]) -> bool:
    """Whether the cells of a line are units."""
    content = [plain(cell) if plain(cell) in KNOWN_UNITS else plain(cell).strip("()[]") for cell in cells if cell]
    known = sum(cell in KNOWN_UNITS or cell in OTHER_UNITS for cell in content)
    return bool(content) and known > 0.6 * len(content) and not all(len(cell) == 1 for cell in content)


DAMAGED = 0.02
"""Share of rows that may be damaged: from there on the whole table is suspect."""


@dataclass(frozen=True)
class Table:
    """Columns of numbers, equally long in one file where they are text, of any length in others.

    Attributes:
        arrays: name → ``(N,)`` or, of array files, ``(N, k)``; whole numbers stay whole.
        units: name → unit, where the header tells it.
        preamble: lines before the table.
        kind: of the file, for messages.
        named: whether the columns have names of their own.
        unreadable: name → row and content of the first cell that is not a number, and their count.
        labels: name → texts ``(N,)`` of a column that tells rows apart, such as names of sensors.
        texts: name → first content of a column that holds no numbers.
    """

    arrays: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)
    preamble: tuple[str, ...] = ()
    kind: str = "table"
    named: bool = True
    unreadable: dict[str, tuple[int, str, int]] = field(default_factory=dict)
    labels: dict[str, np.ndarray] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return max((len(values) for values in self.arrays.values()), default=0)

    def __contains__(self, names: str | Iterable[str]) -> bool:
        return all(name in self.arrays for name in ([names] if isinstance(names, str) else names))

    def column(self, name: str) -> np.ndarray:
        """One array as it is.

        Raises:
            ValueError: there is none of that name, or one of its cells is not a number.
        """
        if name not in self.arrays and split_unit(name)[0] in self.arrays:
            # As the header spells it, with its unit.
            name = split_unit(name)[0]
        if name not in self.arrays:
            raise ValueError(f"{unknown('column', name, self.arrays)}")
        if name in self.unreadable:
            row, content, count = self.unreadable[name]
            what = f"column {name} holds no number in row {row} of the table: {content!r}"
            if count >= DAMAGED * len(self.arrays[name]):
                raise ValueError(what)
            warnings.warn(f"{what}; such cells ({count} in all) count as missing", stacklevel=2)
        return self.arrays[name]

    def rows(self, kept: np.ndarray) -> Table:
        """Some rows of all columns of full length."""
        length = len(self)
        arrays = {name: values[kept] if len(values) == length else values for name, values in self.arrays.items()}
        labels = {name: texts[kept] for name, texts in self.labels.items()}
        return replace(self, arrays=arrays, labels=labels, unreadable={})

    def matrix(self, names: str | Sequence[str]) -> np.ndarray:
        """Columns side by side, ``(N, k)`` float64; a single name may be an array of several columns."""
        wanted = [names] if isinstance(names, str) else list(names)
        parts = [np.asarray(self.column(name), dtype=float) for name in wanted]
        parts = [part[:, None] if part.ndim == 1 else part for part in parts]
        lengths = {len(part) for part in parts}
        if len(lengths) != 1:
            raise ValueError(f"columns {wanted} are of different lengths {sorted(lengths)}")
        return np.concatenate(parts, axis=1)

    def unit(self, names: str | Sequence[str]) -> str:
        """The unit of columns, empty where the header tells none.

        Raises:
            ValueError: the columns have different units.
        """
        wanted = [names] if isinstance(names, str) else list(names)
        units = {self.units.get(name if name in self.arrays else split_unit(name)[0], "") for name in wanted}
        if len(units) > 1:
            raise ValueError(f"columns {wanted} have different units {sorted(units)}")
        return units.pop()

    def value_of(self, *keys: str) -> str | None:
        """What the preamble says after a key (``// Update Rate: 100.0Hz``), case aside; None if it says nothing."""
        for line in self.preamble:
            text = re.sub(r'^\s*(#|//|%)\s*|"', "", line)
            match = re.match(r"([^:=,;\t]+?)\s*[:=,;\t]\s*[:=,;\t]*\s*(.*)", text)
            if match and re.sub(r"[\s_]+", "", match[1]).lower() in [key.replace(" ", "").lower() for key in keys]:
                return match[2].strip(" ,;\t")
        return None

    def rate_in_header(self, *keys: str) -> float | None:
        """A sampling rate in Hz that the preamble names, itself or by an interval (``10 ms``), or None.

        An interval without a unit is in s if it is below 1, else in ms.
        """
        for key in keys:
            number = RATE.search(self.value_of(key) or "")
            if number is None or float(number[1].replace(",", ".")) <= 0.0:
                continue
            value, unit = float(number[1].replace(",", ".")), (number[2] or "").lower()
            if not unit and key.endswith(("Interval", "Period")):
                unit = "s" if value < 1.0 else "ms"
            parts = {"s": 1.0, "ms": 1e3, "us": 1e6, "µs": 1e6}.get(unit)
            return parts / value if parts is not None else 1e3 * value if unit == "khz" else value
        return None

    def renamed(self, spelling: Callable[[str], str]) -> Table:
        """The table with other names of columns."""
        return replace(
            self,
            arrays={spelling(name): values for name, values in self.arrays.items()},
            units={spelling(name): unit for name, unit in self.units.items()},
            unreadable={spelling(name): cell for name, cell in self.unreadable.items()},
        )

    def seen(self) -> str:
        """What the file holds, in one sentence."""
        names = list(self.arrays)
        listed = ", ".join(names[:24]) + (f", … ({len(names)} in all)" if len(names) > 24 else "")
        texts = ", ".join(f"{name or 'a column'} ({text!r} …)" for name, text in list(self.texts.items())[:4])
        listed = listed if self.named else f"{len(names)} without names"
        return f"{self.kind}; {len(self)} rows; columns {listed}{f'; texts, not numbers, in {texts}' if texts else ''}"
