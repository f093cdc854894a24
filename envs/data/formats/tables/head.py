"""The beginning of a file, packed or not, by which formats are recognised; text in any encoding."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from .names import FOREIGN
from .packed import OPENERS, ZIP, content_of, is_archive_of_arrays

ALIKE = str.maketrans({"\u2212": "-", "\u00a0": " ", "\u202f": " ", "\u2009": " ", "\ufeff": None, "\x1a": None})
"""Signs and spaces of typesetters → those of numbers."""
HEAD_LENGTH = 16384
"""Bytes of a file that recognisers see."""


def decode(content: bytes) -> str:
    """Text of a file with line feeds only."""
    if content.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):
        text = content.decode("utf-32", errors="replace")
    elif content.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = content.decode("utf-16", errors="replace")
    elif wide(content):
        text = content.decode(wide(content), errors="replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = of_letters(content)
    return text.translate(ALIKE).replace("\r\n", "\n").replace("\r", "\n")


def of_letters(content: bytes) -> str:
    """A text of letters of one byte, or of a Chinese, Japanese or Korean encoding, if its first words are known so."""
    for encoding in ("gb18030", "shift_jis", "cp949"):
        begin = content[:4096].decode(encoding, errors="replace")
        if any(not match[0].isascii() and match[0][0] > "\u1100" for match in FOREIGN.finditer(begin)):
            return content.decode(encoding, errors="replace")
    return content.decode("cp1252", errors="replace")


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


@dataclass(frozen=True)
class Head:
    """The beginning of a file, or the names in a folder."""

    path: Path

    @cached_property
    def folder(self) -> bool:
        """Whether it is a folder."""
        return self.path.is_dir()

    @cached_property
    def content(self) -> bytes:
        """First bytes of a file, of a packed text those of the text; none of a folder."""
        if self.folder:
            return b""
        with self.path.open("rb") as file:
            head = file.read(HEAD_LENGTH)
        if not head.startswith((ZIP, *OPENERS)) or (head.startswith(ZIP) and is_archive_of_arrays(self.path)):
            return head
        try:
            unpacked = content_of(self.path, HEAD_LENGTH)
        except ValueError:
            return head
        return unpacked if is_text(unpacked) else head

    @cached_property
    def text(self) -> str:
        """First lines of a text file; empty of others."""
        if not is_text(self.content):
            return ""
        text = decode(self.content)
        # The last line is cut off, perhaps within quotes.
        return text[: text.rfind("\n") + 1] or text if len(self.content) == HEAD_LENGTH else text

    @cached_property
    def names(self) -> dict[str, Path]:
        """Visible files of a folder by their names in lower case."""
        if not self.folder:
            return {}
        return {each.name.lower(): each for each in sorted(self.path.iterdir()) if not each.name.startswith(".")}
