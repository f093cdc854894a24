"""Packed texts are read; what unpacks to more than it may is not."""

import bz2
import gzip
import lzma
import zipfile

import pytest

import poise

from ..motion import axes, readings, same, write_table


@pytest.fixture
def plain(tmp_path):
    time, gyr, acc, *_ = readings()
    return write_table(
        tmp_path / "walk.csv", {"Time (s)": time} | axes("Gyr_{} (rad/s)", gyr) | axes("Acc_{} (g)", acc)
    )


def zipped(path, content, *others, name="data/walk.csv"):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for each in (name, *others):
            archive.writestr(each, content)


WAYS = {
    ".gz": lambda path, content: path.write_bytes(gzip.compress(content)),
    ".bz2": lambda path, content: path.write_bytes(bz2.compress(content)),
    ".xz": lambda path, content: path.write_bytes(lzma.compress(content)),
    ".zip": lambda path, content: zipped(path, content, "__MACOSX/data/._walk.csv", "readme.md"),
}


@pytest.mark.parametrize("way", WAYS)
def test_packed_texts_are_read(plain, tmp_path, way):
    packed = tmp_path / f"other.csv{way}"
    WAYS[way](packed, plain.read_bytes())
    found = poise.load_recording(packed)
    assert found.metadata["name"] == "other"
    same(found.measurements["imu/gyr"], readings()[1])
    assert packed in poise.envs.data.formats.load.find_recordings(tmp_path)


@pytest.mark.parametrize("way", WAYS)
def test_bombs_and_damaged_files_are_refused(tmp_path, plain, way):
    bomb = tmp_path / f"bomb{way}"
    WAYS[way](bomb, b"time,gx,gy,gz,ax,ay,az\n" + b"0,0,0,0,0,0,0\n" * 500_000)
    if way in (".bz2", ".xz"):  # gzip cannot pack more than a text may be
        with pytest.raises(ValueError, match="unpacks to more than"):
            poise.load_recording(bomb)
    WAYS[way](bomb, plain.read_bytes())
    bomb.write_bytes(bomb.read_bytes()[:-40])
    with pytest.raises(ValueError, match=rf"bomb{way}.*(truncated|damaged)"):
        poise.load_recording(bomb)


def test_archives_of_several_tables_and_of_no_text_are_named(tmp_path, plain):
    path = tmp_path / "all.zip"
    zipped(path, plain.read_bytes(), "Gyroscope.csv")
    with pytest.raises(ValueError, match=r"ZIP archive of 2 files \(data/walk.csv, Gyroscope.csv\); unpack it"):
        poise.load_recording(path)
    (tmp_path / "image.gz").write_bytes(gzip.compress(bytes(range(256)) * 10))
    with pytest.raises(ValueError, match="no text is in it"):
        poise.load_recording(tmp_path / "image.gz")
