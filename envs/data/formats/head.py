"""What recognisers see of a file or a folder."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from .text import decode, is_text

HEAD_LENGTH = 16384
"""Bytes of a file that recognisers see."""


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
        """First bytes of a file; none of a folder."""
        if self.folder:
            return b""
        with self.path.open("rb") as file:
            return file.read(HEAD_LENGTH)

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
