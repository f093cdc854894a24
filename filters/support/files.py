"""Files that appear whole or not at all."""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def as_path(value: Any, name: str = "path") -> Path:
    """A path that a user gave.

    Raises:
        ValueError: it is neither text nor a path; the message begins with ``name``.
    """
    if not isinstance(value, str | os.PathLike) or "\0" in os.fspath(value):
        raise ValueError(f"{name} must be a path (a text or pathlib.Path), got {value!r}")
    return Path(value)


def user_cache(name: str) -> Path:
    """Folder ``name`` below the one that ``POISE_CACHE`` names, or below the user's cache folder; it may not exist."""
    import platformdirs

    return Path(os.environ.get("POISE_CACHE") or platformdirs.user_cache_dir("poise")) / name


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a path to write to; it takes the place of ``path`` at the end, and is removed after an exception.

    A reader sees the earlier file or the whole new one, never half of it. Missing folders are made.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    # In the same folder, because os.replace is atomic only within one file system; with the same suffix, because some
    # writers append theirs where it is missing.
    part = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        yield part
        os.replace(part, path)
    except OSError as reason:
        if reason.filename is None or Path(reason.filename) != part:
            raise
        # The file that was asked for, not the temporary one that stands for it.
        raise type(reason)(reason.errno, reason.strerror, str(path)) from reason
    finally:
        part.unlink(missing_ok=True)


def write_bytes(path: str | Path, data: bytes) -> Path:
    """Write a whole file and return its path."""
    with replacing(path) as part:
        part.write_bytes(data)
    return Path(path)


def write_text(path: str | Path, text: str) -> Path:
    """Write a whole text file, UTF-8 with line feeds, and return its path."""
    return write_bytes(path, text.encode("utf-8"))


def write_json(path: str | Path, value: Any, indent: int | None = 2) -> Path:
    """Write a value of JSON's types and return the path.

    Raises:
        ValueError: a number is not finite.
        TypeError: a value is not one of JSON's.
    """
    return write_text(path, json.dumps(value, indent=indent, ensure_ascii=False, allow_nan=False) + "\n")
