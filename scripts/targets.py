"""Files and folders that a command is to write, checked before it works: they can be written, and are not its data."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

FIGURES = (".png", ".pdf", ".svg")
"""Endings of figures."""


def check_file(name: str, path: Path | None, sources: Iterable[Path] = (), endings: tuple[str, ...] = ()) -> None:
    """Refuse a file that cannot be written, or that is read too.

    Args:
        name: of the argument, for messages.
        path: what is to be written; None: nothing.
        sources: files and folders that the command reads.
        endings: accepted ones, in small letters; any if empty.

    Raises:
        ValueError: names argument, value and what is accepted.
    """
    if path is None:
        return
    if endings and path.suffix.lower() not in endings:
        raise ValueError(f"{name} must end in {one_of(endings)}, got {str(path)!r}")
    if path.is_dir():
        raise ValueError(f"{name} must be a file, {str(path)!r} is a folder")
    check_folder(name, path.parent)
    if path.exists():
        for source in read_files(sources):
            if source.exists() and path.samefile(source):
                raise ValueError(f"{name} must be another file than what is read, got {str(path)!r}")


def check_folder(name: str, path: Path | None) -> None:
    """Refuse a folder that cannot be made, or in which nothing can be written.

    Raises:
        ValueError: names argument, value and what is in the way.
    """
    if path is None:
        return
    nearest = path.absolute()
    while not nearest.exists() and not nearest.is_symlink():
        nearest = nearest.parent
    if not nearest.is_dir():
        raise ValueError(f"{name} must be in a folder, but {str(nearest)!r} is a file")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise ValueError(f"{name} must be in a folder that can be written to, which {str(nearest)!r} cannot")


def read_files(sources: Iterable[Path]) -> Iterator[Path]:
    """The files among sources, and those of the recordings in folders among them."""
    from ..envs.data.formats.load import recording_files

    for source in sources:
        if not source.is_dir():
            yield source
            continue
        for recording in recording_files((source,)):
            yield from (recording.rglob("*") if recording.is_dir() else (recording,))


def one_of(choices: tuple[str, ...]) -> str:
    """``.csv``; or ``one of .csv, .h5``."""
    return choices[0] if len(choices) == 1 else f"one of {', '.join(choices)}"
