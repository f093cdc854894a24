"""Claims of a study: each statement with the numbers of the run that decide whether it holds."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Claim:
    """A sentence that a run confirms or refutes; :meth:`.Report.claims` prints a table of them."""

    statement: str
    """what the paper says, or what one would read off the tables"""
    number: str
    """the numbers of this run that decide, with their unit"""
    holds: bool | None
    """whether they confirm the statement; None if the run has no such number (rides that are too short)"""

    def __post_init__(self) -> None:
        # Comparisons of arrays' elements give their booleans, which are not ``True`` or ``False`` themselves.
        object.__setattr__(self, "holds", None if self.holds is None else bool(self.holds))

    @classmethod
    def less(
        cls,
        statement: str,
        value: float,
        limit: float,
        unit: str = "deg",
        *,
        factor: float = 1.0,
        names: tuple[str, str] | None = None,
    ) -> Claim:
        """Holds if ``value < factor * limit``.

        Args:
            statement: the sentence.
            value: what is claimed to be smaller.
            limit: what it is compared with.
            unit: of both.
            factor: how much smaller it must be: 0.5 for less than half.
            names: of both numbers, where the statement does not say which is which.
        """
        one, other = (
            f"{name} {digits(number)}" for name, number in zip(names or ("", ""), (value, limit), strict=True)
        )
        share = "" if factor == 1.0 else f"{factor:.3g} × "
        number = f"{one.strip()} against {share}{other.strip()} {unit}".strip()
        return cls(statement, number, None if math.isnan(value) or math.isnan(limit) else value < factor * limit)

    @classmethod
    def within(cls, statement: str, value: float, low: float, high: float, unit: str = "") -> Claim:
        """Holds if ``low <= value <= high``."""
        number = f"{digits(value)} {unit}".strip() + f" ({low:.3g} … {high:.3g})"
        return cls(statement, number, None if math.isnan(value) else low <= value <= high)

    @classmethod
    def every(cls, statement: str, values: Mapping[str, float], limit: float, unit: str = "deg") -> Claim:
        """Holds if every value is below the limit; the number names the largest."""
        known = {name: value for name, value in values.items() if not math.isnan(value)}
        if not known:
            return cls(statement, "–", None)
        worst = max(known, key=known.__getitem__)
        number = f"largest: {known[worst]:.3g} {unit} ({worst}), limit {limit:.3g}"
        return cls(statement, number, known[worst] < limit)

    @classmethod
    def shares(
        cls,
        statement: str,
        values: Mapping[str, float],
        of: Mapping[str, float],
        limit: float = 1.0,
        unit: str = "of it",
    ) -> Claim:
        """Holds if every value is below ``limit`` times what has its name in ``of``; others do not count."""
        return cls.every(
            statement, {name: value / of[name] for name, value in values.items() if name in of}, limit, unit
        )

    @classmethod
    def best(cls, statement: str, name: str, values: Mapping[str, float], unit: str = "deg") -> Claim:
        """Holds if ``values[name]`` is the smallest; the number names the smallest of the others."""
        others = {key: value for key, value in values.items() if key != name and not math.isnan(value)}
        if not others:
            return cls(statement, "–", None)
        rival = min(others, key=others.__getitem__)
        return cls.less(statement, values[name], others[rival], unit, names=(name, rival))

    @classmethod
    def ranked(cls, statement: str, order: Sequence[str], values: Mapping[str, float], unit: str = "deg") -> Claim:
        """Holds if the values rise strictly in the claimed order of their names."""
        found = [values[name] for name in order]
        number = " < ".join(sorted(order, key=lambda name: values[name]))
        number += f" ({', '.join(f'{name} {values[name]:.3g}' for name in order)} {unit})"
        rises = all(one < other for one, other in itertools.pairwise(found))
        return cls(statement, number, None if any(map(math.isnan, found)) else rises)


def digits(value: float) -> str:
    """Three significant digits; a dash for what is not known."""
    return "–" if math.isnan(value) else f"{value:.3g}"
