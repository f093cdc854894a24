"""Files appear whole or not at all."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
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


def test_a_full_disk_names_the_file(tmp_path: Path) -> None:
    """The system names none when it refuses what is written to an open file."""

    def full() -> None:
        with replacing(tmp_path / "x.csv"):
            raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OSError, match=r"No space left on device: '.*/x\.csv'"):
        full()


def test_the_part_keeps_the_suffix(tmp_path: Path) -> None:
    """``numpy.savez`` would append it to another name and leave nothing to move."""
    with replacing(tmp_path / "x.npz") as part:
        assert part.parent == tmp_path
        assert part.suffix == ".npz"
        part.write_bytes(b"")


@pytest.mark.skipif(os.name != "posix", reason="processes of other systems are not asked")
def test_the_next_write_removes_what_a_killed_one_left(tmp_path: Path) -> None:
    path = tmp_path / "x [1].csv"
    code = (
        "import os, signal, sys; from poise.filters.support.files import replacing\n"
        "with replacing(sys.argv[1]) as part:\n    part.write_text('half'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    for _ in range(2):
        assert subprocess.run([sys.executable, "-c", code, str(path)], check=False).returncode == -signal.SIGKILL
    (left,) = tmp_path.iterdir()  # of the second one
    assert left.read_text() == "half"
    other = tmp_path / "x.csv"
    write_text(other, "another file does not touch it")
    with replacing(path) as part:
        assert not left.exists()
        part.write_text("first")
        write_text(path, "a writer that lives keeps its part")
    assert path.read_text() == "first"
    abroad = part.with_name(part.name.replace(part.name.split(".")[-2][:4], "0bad"))
    abroad.write_text("of another machine")
    write_text(path, "next")
    assert abroad.exists()
    os.utime(abroad, 2 * (time.time() - 2e5,))
    write_text(path, "next")
    assert sorted(tmp_path.iterdir()) == sorted([path, other])
