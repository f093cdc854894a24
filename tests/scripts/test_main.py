"""The command ``poise``: finding, parsing, failing; with subcommands made for the test, then over the real table."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import subprocess
import sys
import textwrap
from pathlib import Path
from types import ModuleType

import pytest

import poise
from poise.scripts import main as cli


@dataclasses.dataclass
class Args:
    """Arguments of the made-up subcommand."""

    count: int = 1
    """how many"""
    error: str = ""
    """what to raise"""


ERRORS: dict[str, BaseException] = {
    "value": ValueError("no estimator\nnamed 'x'"),
    "missing": FileNotFoundError(2, "No such file or directory", "rides.h5"),
    "interrupt": KeyboardInterrupt(),
    "defect": RuntimeError("a defect"),
}


@pytest.fixture(autouse=True)
def _fake(monkeypatch: pytest.MonkeyPatch) -> None:
    """Add the subcommand ``fake``, which returns ``count`` or raises ``error``."""

    def run(args: Args) -> int:
        if args.error:
            raise ERRORS[args.error]
        return args.count

    module = ModuleType("poise.scripts.fake", "Does nothing, for a test.")
    vars(module).update(Args=Args, run=run)
    monkeypatch.setitem(sys.modules, "poise.scripts.fake", module)
    monkeypatch.setitem(cli.COMMANDS, "fake", cli.Command(".fake", "do nothing"))
    monkeypatch.delenv("POISE_DEBUG", raising=False)


def test_arguments_arrive_and_the_status_returns() -> None:
    assert cli.main(["fake", "--count", "7"]) == 7


def test_help_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--help"]) == 0
    out = capsys.readouterr().out
    assert all(f"  {name}" in out and command.help in out for name, command in cli.COMMANDS.items())


def test_without_a_command_the_help_is_an_error() -> None:
    assert cli.main([]) == 2


def test_help_of_a_command_shows_the_sentences(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_:
        cli.main(["fake", "--help"])
    assert exit_.value.code == 0
    out = capsys.readouterr().out
    assert "poise fake" in out
    assert "how many" in out
    assert "Does nothing, for a test." in out


@pytest.mark.parametrize("command", ["estimate", "align", "reproduce"])
def test_help_is_silent_about_defaults_that_are_nothing(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main([command, "--help"])
    out = capsys.readouterr().out
    assert "PATH" in out
    assert not {part for part in ("{None}", "(default: )", "default: None", "default: False") if part in out}


def test_unknown_command_names_the_valid_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["benchmrak"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("poise: error: unknown command 'benchmrak', did you mean 'benchmark'?")
    assert all(name in err for name in cli.COMMANDS)
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--cuont", "7"], "--cuont"),
        (["--count", "seven"], "--count must be a whole number, got 'seven'; see"),
        (["--count"], "--count"),
        (["surplus"], "surplus"),
    ],
)
def test_unknown_options_are_one_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["fake", *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("poise: error: ")
    assert said in err
    assert err.endswith("; see poise fake --help\n")
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("error", "line"),
    [("value", "no estimator named 'x'"), ("missing", "rides.h5: No such file or directory")],
)
def test_wrong_input_is_one_line(error: str, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["fake", "--error", error]) == 2
    assert capsys.readouterr().err == f"poise: error: {line}\n"


def test_debug_shows_the_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="no estimator"):
        cli.main(["fake", "--error", "value", "--debug"])
    monkeypatch.setenv("POISE_DEBUG", "1")
    with pytest.raises(ValueError, match="no estimator"):
        cli.main(["fake", "--error", "value"])


def test_a_defect_keeps_its_traceback() -> None:
    with pytest.raises(RuntimeError, match="a defect"):
        cli.main(["fake", "--error", "defect"])


def test_interrupt(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["fake", "--error", "interrupt"]) == 130
    assert capsys.readouterr().err == "\npoise: interrupted\n"


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"poise {poise.__version__}\n"


def test_help_is_light() -> None:
    code = textwrap.dedent("""
        import sys
        from poise.scripts.main import main
        status = main(["--help"])
        heavy = {"torch", "pybullet", "stable_baselines3", "numba", "matplotlib", "pandas"} & set(sys.modules)
        sys.exit(status or ", ".join(heavy) or 0)
    """)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_reader_that_leaves_is_no_error() -> None:
    code = textwrap.dedent("""
        import os, sys
        from poise.scripts.main import main
        reader, writer = os.pipe()
        os.dup2(writer, 1)
        os.close(reader)
        sys.exit(main(["--help"]))
    """)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (141, "")


REAL = sorted(cli.COMMANDS)


@pytest.mark.parametrize("name", REAL)
def test_command_module(name: str) -> None:
    """Every command of the table has a documented ``Args``, every field a sentence."""
    module = importlib.import_module(cli.COMMANDS[name].module, "poise.scripts")
    assert dataclasses.is_dataclass(module.Args)
    assert list(inspect.signature(module.run).parameters) == ["args"]
    assert module.__doc__
    tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
    (args,) = (node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == "Args")
    for field, after in zip(args.body, [*args.body[1:], None], strict=True):
        if isinstance(field, ast.AnnAssign):
            documented = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            assert documented, f"{name}: no sentence under {ast.unparse(field.target)}"


def test_every_command_file_is_in_the_table() -> None:
    """A file with a class ``Args`` is a command, the others help."""
    folder = Path(str(cli.__file__)).parent
    listed = {command.module[1:] for name, command in cli.COMMANDS.items() if name != "fake"}
    files = {path: ".".join(path.relative_to(folder).with_suffix("").parts) for path in folder.rglob("*.py")}
    commands = {name for path, name in files.items() if "\nclass Args:\n" in path.read_text(encoding="utf-8")}
    assert commands == listed


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("benchmark --seed -1", "seed must be at least 0, got -1"),
        ("benchmark --processes 0", "processes must be at least 1, got 0"),
        ("benchmark --episodes 0", "episodes must be at least 1, got 0"),
        ("benchmark --trials -1", "trials must be at least 0, got -1"),
        ("benchmark --sensors nosuch", "unknown sensor preset 'nosuch'"),
        ("benchmark --reference nosuch", "unknown estimator 'nosuch'"),
        ("record hand-motion --seed -5", "seed must be at least 0, got -5"),
        ("record hand-motion --options duration=1 duration=2", "option 'duration' is given twice: 1 and 2"),
        ("train gru --episodes 0", "episodes must be at least 1, got 0"),
        ("train gru --replicate -1", "replicate must be at least 0, got -1"),
        ("train gru --start nosuch", "no weights 'nosuch'"),
        ("tune --agent optuna --trials 0", "trials must be at least 1, got 0"),
        ("tune --test-trajectories 0", "test_trajectories must be at least 1, got 0"),
        ("adapt --points 0", "points must be at least 1, got 0"),
        ("adapt --errors 0.1", "errors can only be given for simulated rides"),
        ("recommend nofile.csv --most 0", "most must be at least 1, got 0"),
        ("inspect", "name at least one file or folder of recordings"),
        ("evaluate --seed 1.5", "--seed must be a whole number"),
        ("benchmark --suite foo", "invalid choice 'foo' for argument '--suite'"),
    ],
)
def test_wrong_options_are_one_line_before_any_work(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(words.split()) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert line.startswith("poise: error: ")
    assert said in line
    assert "---" not in line
    assert not list(tmp_path.iterdir())
