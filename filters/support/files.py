"""Files that appear whole or not at all."""

from __future__ import annotations

import json
import os
import platform
import re
import secrets
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

ABANDONED = 86400.0
"""s without a change after which a temporary file of another machine counts as left behind."""


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

    A reader sees the earlier file or the whole new one, never half of it. Missing folders are made. What a process that
    was killed left behind while it wrote the same file is removed.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    _remove_abandoned(path)
    # In the same folder, because os.replace is atomic only within one file system; with the same suffix, because some
    # writers append theirs where it is missing.
    part = path.with_name(f".{path.stem}.{_machine()}-{os.getpid()}-{secrets.token_hex(2)}{path.suffix}")
    try:
        yield part
        os.replace(part, path)
    except OSError as reason:
        # A disk that is full names no file.
        if reason.errno is None or Path(reason.filename or part) != part:
            raise
        # The file that was asked for, not the temporary one that stands for it.
        raise type(reason)(reason.errno, reason.strerror, str(path)) from reason
    finally:
        part.unlink(missing_ok=True)


def _machine() -> str:
    """Short name of this machine, for process numbers hold on one machine only."""
    return f"{zlib.crc32(platform.node().encode()) & 0xFFFF:04x}"


def _remove_abandoned(path: Path) -> None:
    """Remove temporary files of ``path`` whose process has ended; of another machine those that are a day old."""
    names = re.compile(rf"\.{re.escape(path.stem)}\.([0-9a-f]{{4}})-(\d+)-[0-9a-f]{{4}}{re.escape(path.suffix)}")
    for entry in os.scandir(path.parent):
        if found := names.fullmatch(entry.name):
            with suppress(OSError):  # another process may remove it first
                ended = found[1] == _machine() and _has_ended(int(found[2]))
                if ended or time.time() - entry.stat().st_mtime > ABANDONED:
                    os.unlink(entry)


def _has_ended(process: int) -> bool:
    """Whether a process number of this machine belongs to no process; False where that cannot be asked."""
    if os.name != "posix":
        return False
    try:
        os.kill(process, 0)  # signal 0 asks only
    except ProcessLookupError:
        return True
    except OSError:  # somebody else's
        return False
    return False


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
