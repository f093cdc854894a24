"""Files that are packed with gzip, bzip2 or xz, or into a ZIP archive with one table: unpacked in memory, bounded."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zipfile
import zlib
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO, TYPE_CHECKING, Any

from ...storage import LARGEST_RATIO

if TYPE_CHECKING:
    from collections.abc import Iterator

ZIP = b"PK\x03\x04"
OPENERS: dict[bytes, Callable[[Any], IO[bytes]]] = {
    b"\x1f\x8b": gzip.open,  # type: ignore[dict-item]
    b"BZh": bz2.open,
    b"\xfd7zXZ": lzma.open,
}
"""First bytes → what reads such a file."""
SUFFIXES = (".gz", ".bz2", ".xz", ".zip")
TABLES = (".csv", ".txt", ".tsv", ".dat", ".log", ".asc", ".json", ".jsonl")
LARGEST_TEXT = 2**30
"""bytes; a text takes several times its length as a table."""
SPARE = 2**20
"""bytes that any file may unpack to, whatever its size."""


def plain_stem(path: Path) -> str:
    """The stem of a file's name, without the suffix of packing: ``walk`` of ``walk.csv.gz``."""
    stem = path.stem
    return Path(stem).stem if path.suffix.lower() in SUFFIXES and Path(stem).suffix else stem


def content_of(path: Path, most: int | None = None) -> bytes:
    """Bytes of a file, unpacked if it is packed.

    Args:
        path: of the file.
        most: how many bytes of the beginning; None: all.

    Raises:
        ValueError: it is damaged, encrypted, unpacks to more than a file of its size can hold, or is an archive of
            several tables.
    """
    with path.open("rb") as file:
        head = file.read(8)
    if head.startswith(ZIP):
        return _unpacked(path, most, lambda: _only_member(path))
    opener = next((each for start, each in OPENERS.items() if head.startswith(start)), None)
    if opener is not None:
        return _unpacked(path, most, lambda: opener(path))
    with path.open("rb") as file:
        return file.read() if most is None else file.read(most)


def _unpacked(path: Path, most: int | None, opened: Callable[[], Any]) -> bytes:
    limit = min(LARGEST_TEXT, LARGEST_RATIO * path.stat().st_size + SPARE)
    try:
        with opened() as stream:
            content = bytes(stream.read(limit + 1 if most is None else most))
    except (EOFError, OSError, zlib.error, lzma.LZMAError, zipfile.BadZipFile, NotImplementedError) as reason:
        raise ValueError(f"it is packed and cannot be unpacked; it may be truncated or damaged: {reason}") from None
    except RuntimeError as reason:  # of zipfile, for encrypted members
        raise ValueError(f"it is packed and cannot be unpacked: {reason}") from None
    if len(content) > limit:
        raise ValueError(f"it unpacks to more than {limit / 2**20:.0f} MiB, more than a file of its size may hold")
    return content


@contextmanager
def _only_member(path: Path) -> Iterator[IO[bytes]]:
    with zipfile.ZipFile(path) as archive:
        entries = [one for one in archive.infolist() if not one.is_dir() and not hidden(one.filename)]
        tables = [one for one in entries if PurePosixPath(one.filename).suffix.lower() in TABLES] or entries
        if len(tables) != 1:
            names = ", ".join(one.filename for one in tables[:6]) + (", …" if len(tables) > 6 else "")
            raise ValueError(f"it is a ZIP archive of {len(tables)} files ({names}); unpack it and load its folder")
        with archive.open(tables[0]) as member:
            yield member


def hidden(name: str) -> bool:
    """Whether a member of an archive is one of the file system, such as ``__MACOSX/._walk.csv``."""
    return any(part.startswith((".", "__")) for part in PurePosixPath(name).parts)


def is_archive_of_arrays(path: Path) -> bool:
    """Whether a ZIP archive holds NumPy arrays or a spreadsheet rather than a packed text."""
    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.endswith(".npy") or name.startswith("xl/") for name in archive.namelist())
    except (zipfile.BadZipFile, OSError):
        return True
