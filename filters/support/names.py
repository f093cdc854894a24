"""Look-up by name, with messages for unknown names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import TypeVar

T = TypeVar("T")


def unknown(kind: str, name: object, known: Iterable[str], begin: str = "") -> str:
    """Return ``unknown paper 'two-gyr', did you mean 'two-gyro'? (papers: two-gyro, …)``.

    Args:
        kind: what is named, in the singular.
        name: what is not known.
        known: all that are.
        begin: first words of the message, if not ``unknown`` and the kind.
    """
    names = [str(each) for each in known]
    near = difflib.get_close_matches(str(name), names, n=1)
    hint = f", did you mean {near[0]!r}?" if near else ""
    return f"{begin or f'unknown {kind}'} {name!r}{hint} ({kind}s: {', '.join(names)})"


def look_up(kind: str, name: str, known: Mapping[str, T]) -> T:
    """Return ``known[name]``.

    Raises:
        ValueError: there is none; the message names the nearest one and lists all.
    """
    if not isinstance(name, str) or name not in known:
        raise ValueError(unknown(kind, name, known))
    return known[name]
