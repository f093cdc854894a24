"""Files appear whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from poise.filters.support.files import replacing, write_bytes, write_json, write_text


def test_writes_whole_files_into_new_folders(tmp_path: Path) -> None:
    assert write_bytes(tmp_path / "a" / "b.bin", b"\0x").read_bytes() == b"\0x"
    assert write_text(tmp_path / "c.txt", "ü\n").read_bytes() == "ü\n".encode()
    assert json.loads(write_json(tmp_path / "d.json", {"x": [1.5, None]}).read_text()) == {"x": [1.5, None]}
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "d.json", float("nan"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "c.txt", "d.json"]


def test_an_interrupted_write_leaves_the_earlier_file(tmp_path: Path) -> None:
    path = write_text(tmp_path / "x.txt", "before")

    def interrupted() -> None:
        with replacing(path) as part:
            part.write_text("half")
            assert path.read_text() == "before"
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_the_part_keeps_the_suffix(tmp_path: Path) -> None:
    """``numpy.savez`` would append it to another name and leave nothing to move."""
    with replacing(tmp_path / "x.npz") as part:
        assert part.parent == tmp_path
        assert part.suffix == ".npz"
        part.write_bytes(b"")
