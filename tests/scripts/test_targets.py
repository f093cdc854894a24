"""Commands never write over what they read, and say before they work where they cannot write."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from poise.baselines.plots import new_figure, save
from poise.envs.hand.sensing import simulate_hand
from poise.filters.support.files import replacing
from poise.scripts.main import main
from poise.scripts.targets import check_file, check_folder


@pytest.fixture
def data(tmp_path: Path) -> Path:
    file = simulate_hand("slow", seed=0, duration=4.0).save(tmp_path / "data.h5")
    (tmp_path / "link.h5").symlink_to(file)
    (tmp_path / "folder.h5").mkdir()
    (tmp_path / "data.csv").write_text("time,gyr_x\n0,1\n0.01,1\n0.02,1\n")
    return file


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("estimate {data} --output {data}", "output must be another file than what is read"),
        ("estimate {data} --output {folder}/link.h5", "output must be another file than what is read"),
        ("estimate {folder} --output {data}", "output must be another file than what is read"),
        ("estimate {data} --output {folder}/folder.h5", "output must be a file"),
        ("estimate {data} --output {data}/angles.csv", "output must be in a folder, but"),
        ("estimate {data} --plot {folder}/angles", "plot must end in one of .png, .pdf, .svg, got"),
        ("inspect {data} --plot {folder}/signals.bmp", "plot must end in one of .png, .pdf, .svg, got"),
        ("inspect {folder}/data.csv --write-map {folder}/data.csv", "write_map must end in .toml"),
        ("evaluate {data} --runs {data}", "runs must be in a folder, but"),
        ("align clocks {data} {data} --output {data}", "output must be another file than what is read"),
        ("align magnetometer {data} --record {data}", "record must be another file than what is read"),
        ("calibrate magnetometer {folder}/data.csv --record {folder}/data.csv", "record must be another file than"),
        ("stream {folder}/data.csv --output {folder}/data.csv", "output must be another file than what is read"),
        ("record hand-motion --folder {data}", "folder must be in a folder, but"),
        ("train gru --export {folder}", "export must be a file"),
        ("tune --export {data}/weights", "export must be in a folder, but"),
        ("export gru --onnx {folder}", "onnx must be a file"),
        ("benchmark --save {folder}", "save must be a file"),
        ("view {data} --screenshot {folder}/page.bmp", "screenshot must end in one of .png, .webp, .gif, got"),
    ],
)
def test_commands_refuse_what_they_cannot_write(
    data: Path, words: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {file: file.read_bytes() for file in data.parent.iterdir() if file.is_file()}
    assert main(words.format(data=data, folder=data.parent).split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert said in printed.err
    assert len(printed.err.splitlines()) == 1
    assert {file: file.read_bytes() for file in data.parent.iterdir() if file.is_file()} == before


def test_a_completed_mapping_is_not_drafted_again(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mapping = data.parent / "mine.toml"
    words = ["inspect", str(data.parent / "data.csv"), "--write-map", str(mapping)]
    assert main(words) == 0
    mapping.write_text("# completed")
    assert main(words) == 2
    assert "write_map must be a new file" in capsys.readouterr().err
    assert mapping.read_text() == "# completed"


def test_new_files_and_folders_are_accepted(tmp_path: Path) -> None:
    check_file("output", tmp_path / "new" / "deeper" / "angles.CSV", (tmp_path,), (".csv",))
    check_file("output", None)
    check_folder("runs", tmp_path / "new" / "deeper")
    assert not list(tmp_path.iterdir())


def test_errors_name_the_file_that_was_asked_for(tmp_path: Path) -> None:
    (tmp_path / "taken.csv").mkdir()
    with pytest.raises(OSError, match="directory") as caught, replacing(tmp_path / "taken.csv") as part:
        part.write_text("x")
    assert caught.value.filename == str(tmp_path / "taken.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["taken.csv"]


@pytest.mark.parametrize("ending", [".png", ".pdf", ".svg", ".PNG"])
def test_figures_are_written_by_their_ending(tmp_path: Path, ending: str) -> None:
    figure, (ax,) = new_figure(3.0, 2.0)
    ax.plot(np.arange(3))
    path = save(figure, tmp_path / "new" / f"figure{ending}")
    assert path.stat().st_size > 1_000
    with pytest.raises(ValueError, match=r"must end in one of \.png, \.pdf, \.svg"):
        save(figure, tmp_path / "figure.bmp")
