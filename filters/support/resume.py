"""Resuming interrupted work: results in files, each with a key of everything that it depends on."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from .files import write_text
from .version import code_version


def keep(path: Path, key: Mapping[str, Any], result: Any, **options: Any) -> Path:
    """Write a result of JSON's types, with what it depends on: ``key`` and the code.

    Args:
        path: file.
        key: JSON-able; a result is valid for an equal key only.
        result: what was computed.
        options: of :func:`json.dumps`, such as ``default``.
    """
    whole = {"code": code_version(), "key": dict(key), "result": result}
    return write_text(path, json.dumps(whole, **options) + "\n")


def is_kept(path: Path, key: Mapping[str, Any]) -> bool:
    """Whether the file holds a result of this key and of this version's code."""
    try:
        whole = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return False
    # As JSON, because tuples come back as lists.
    wanted = json.loads(json.dumps({"code": code_version(), "key": dict(key)}))
    return isinstance(whole, dict) and {name: whole.get(name) for name in wanted} == wanted


def kept(path: Path) -> Any:
    """Return the result in a file for which :func:`is_kept` holds."""
    return json.loads(path.read_text(encoding="utf-8"))["result"]


def refuse_changes(
    where: str | Path, before: Mapping[str, Any], now: Mapping[str, Any], names: Iterable[str] | None = None
) -> None:
    """Check that what is resumed was started with the same settings.

    Args:
        where: what is resumed, for the message.
        before: settings that it was started with, as read from JSON.
        now: settings of this call.
        names: those that must agree; all of ``now`` if None.

    Raises:
        ValueError: one differs; the message names it and both values.
    """
    for name in now if names is None else names:
        if before.get(name) != now[name]:
            raise ValueError(f"{where} was started with {name} {before.get(name)}, not {now[name]}")
