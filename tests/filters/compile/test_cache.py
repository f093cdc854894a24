"""What is kept of compiled filters, and what happens where it is damaged or cannot be kept."""

from __future__ import annotations

import errno
import gc
import os
import stat
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from poise.filters.compile import cache
from poise.filters.compile.trace import Tape

from .emitted import emitted


def double(x: float) -> float:
    return 2.0 * x


def compiled(folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[int, int]:
    """Make and call a compiled function as a new process would; hits and misses of the cache."""
    monkeypatch.setenv("POISE_CACHE", str(folder))
    function = cache.jit(double)
    cache.compile_now(function, (0.0,), "double")
    assert function(3.0) == 6.0
    return len(function.stats.cache_hits), len(function.stats.cache_misses)


def printed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> float:
    """Translate a printed function and call it."""
    monkeypatch.setenv("POISE_CACHE", str(folder))
    tape = Tape()
    call, found = emitted({"x": (1,), "out": (1,)}, {"out": 2.0 * tape.inputs("x", 1)}), np.empty(1)
    call(np.array([3.0]), found)
    return float(found[0])


def test_a_line_tells_what_takes_long_and_only_then(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cache, "PATIENCE", 1e-3)
    assert compiled(tmp_path, monkeypatch) == (0, 1)
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "compiling double" in told
    assert str(tmp_path) in told
    assert compiled(tmp_path, monkeypatch) == (1, 0)
    assert capsys.readouterr().err == ""


def test_garbage_is_collected_again_after_compiling() -> None:
    compiling = cache.jit(double)._compiler.compile
    assert compiling.func is cache.without_collecting
    assert not compiling.func(gc.isenabled)
    assert gc.isenabled()
    with pytest.raises(ZeroDivisionError):
        compiling.func(lambda: 1 // 0)
    assert gc.isenabled()


@pytest.mark.skipif(os.name != "posix", reason="processes wait for each other on POSIX only")
def test_processes_that_need_the_same_code_compile_it_once(tmp_path: Path) -> None:
    script = f"""
import sys
sys.path.insert(0, {str(tmp_path)!r})
from poise.filters.compile import cache
from doubled import double
function = cache.jit(double)
print("ready", flush=True)
sys.stdin.readline()
cache.compile_now(function, (0.0,), "double")
print(len(function.stats.cache_misses))
"""
    (tmp_path / "doubled.py").write_text("def double(x):\n    return 2.0 * x\n")
    environment = {**os.environ, "POISE_CACHE": str(tmp_path)}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "env": environment}
    both = [subprocess.Popen([sys.executable, "-c", script], **pipes) for _ in range(2)]  # type: ignore[call-overload]
    assert [one.stdout.readline() for one in both] == ["ready\n"] * 2
    for one in both:
        one.stdin.write("go\n")
        one.stdin.flush()
    assert sorted(int(one.communicate()[0]) for one in both) == [0, 1]


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "cut": lambda content: content[: len(content) // 2],
    "empty": lambda content: b"",
    "garbage": lambda content: b"garbage",
    "flipped": lambda content: content[:99] + bytes([content[99] ^ 255]) + content[100:],
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_a_damaged_entry_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, damage: str
) -> None:
    compiled(tmp_path, monkeypatch)
    (path,) = (tmp_path / "compiled").rglob(f"*{suffix}")
    path.write_bytes(DAMAGES[damage](path.read_bytes()))
    compiled(tmp_path, monkeypatch)
    assert compiled(tmp_path, monkeypatch) == (1, 0)


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_machine_code_of_a_model_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damage: str
) -> None:
    assert printed(tmp_path, monkeypatch) == 6.0
    (path,) = (tmp_path / "compiled").glob("*.o")
    content = path.read_bytes()
    path.write_bytes(DAMAGES[damage](content))
    assert printed(tmp_path, monkeypatch) == 6.0
    assert path.read_bytes() == content


def test_without_a_folder_there_is_one_warning_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocked, temporary = tmp_path / "file", tmp_path / "temporary"
    blocked.write_text("")
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    with pytest.warns(UserWarning, match="POISE_CACHE") as caught:
        assert compiled(blocked, monkeypatch) == (0, 1)
    assert len(caught) == 1
    assert list(temporary.iterdir()) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "temporary"]


@pytest.mark.filterwarnings("error")
def test_a_filled_folder_that_cannot_be_written_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    compiled(tmp_path, monkeypatch)
    assert printed(tmp_path, monkeypatch) == 6.0
    monkeypatch.setattr(tempfile, "TemporaryFile", refused)
    monkeypatch.setattr(os, "replace", refused)
    assert compiled(tmp_path, monkeypatch) == (1, 0)
    assert printed(tmp_path, monkeypatch) == 6.0
    next((tmp_path / "compiled").rglob("*.nbc")).unlink()
    with pytest.warns(UserWarning, match="Permission denied"):
        assert compiled(tmp_path, monkeypatch) == (0, 1)


@pytest.mark.filterwarnings("error")
def test_a_full_disk_costs_one_warning_and_no_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(source: object, target: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.warns(UserWarning, match="No space left on device"):
        assert compiled(tmp_path, monkeypatch) == (0, 1)
    assert printed(tmp_path, monkeypatch) == 6.0  # a second warning would be an error
    assert [path.name for path in (tmp_path / "compiled").rglob("*") if path.is_file()] == [f"{__name__}.lock"]


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_counts_as_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tmp_path.chmod(stat.S_IRUSR | stat.S_IXUSR)
    monkeypatch.setenv("POISE_CACHE", str(tmp_path))
    with pytest.warns(UserWarning, match="POISE_CACHE"):
        assert cache.cache_folder() is None


def test_the_folder_is_below_the_variable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("POISE_CACHE", str(tmp_path / "new"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cache.cache_folder() == tmp_path / "new" / "compiled"


def test_code_is_kept_for_the_constants_of_other_files_too(tmp_path, monkeypatch):
    held = cache.ROOT / "filters" / "core" / "held_inputs.py"
    kernel = cache.ROOT / "filters" / "compile" / "kernel.py"
    assert held in cache.imported(kernel, kernel.read_bytes())
    for name, text in {
        "core/constants.py": "LARGEST = 1.0\n",
        "core/other.py": "",
        "compile/kernel.py": "from .cache import jit\nfrom ..core.constants import (\n    LARGEST,\n)\n",
        "compile/cache.py": "",
    }.items():
        path = tmp_path / "filters" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.setattr(cache, "ROOT", tmp_path)

    def digest() -> str:
        return cache._digest.__wrapped__("filters")

    before = digest()
    (tmp_path / "filters" / "core" / "other.py").write_text("UNUSED = 1.0\n")
    assert digest() == before
    (tmp_path / "filters" / "core" / "constants.py").write_text("LARGEST = 2.0\n")
    assert digest() != before
