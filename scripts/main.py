"""The command ``poise``: finds a subcommand by name, parses its arguments, runs it.

A subcommand is a module with a dataclass ``Args`` (a sentence under each field becomes its help) and
``run(args) -> int``, which returns the exit status. Only the module of the chosen subcommand is imported, so
``poise --help`` stays light.

Exit status: 0 done, 2 wrong input, 130 interrupted, 141 nobody reads the output; whatever ``run`` returns otherwise.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import re
import sys
from collections.abc import Sequence
from typing import Annotated, NamedTuple, get_args, get_type_hints

from gymnasium.error import UnregisteredEnv

from ..filters.support.names import unknown
from ..filters.support.optional import MissingExtraError, extra
from ..filters.support.parallel import BACKENDS, on_backend
from ..filters.support.version import poise_version

USAGE_ERROR = 2
INTERRUPTED = 130
"""128 + SIGINT, as shells report it."""
BROKEN_PIPE = 141
"""128 + SIGPIPE: the reader of our output left (`poise … | head`)."""

USER_ERRORS = (ValueError, OSError, UnregisteredEnv, MissingExtraError)
"""What wrong input raises; shown as one line. Anything else is a defect and keeps its traceback."""


FROM_ZERO = ("seed", "test_seed", "replicate", "trials")
FROM_ONE = (
    *("processes", "episodes", "trajectories", "training", "points", "steps", "epochs", "units", "subjects", "seeds"),
    *("test_episodes", "test_trajectories", "most"),
)
LEAST = dict.fromkeys(FROM_ZERO, 0) | dict.fromkeys(FROM_ONE, 1)
"""Option of any command that is a whole number → its least value."""


class Command(NamedTuple):
    """Where a subcommand lives and what it does."""

    module: str
    """Module name, relative to this package."""
    help: str
    """One line for the list of commands."""


COMMANDS: dict[str, Command] = {
    "list": Command(".list", "list estimators, environments, sensors, gestures, scenarios, file formats"),
    "record": Command(".record", "record trajectories of an environment into files"),
    "rides": Command(".rides", "simulate every scenario with every rider, with statistics beside those of the papers"),
    "realism": Command(".realism", "compare simulated motion with recordings and publications"),
    "train": Command(".train", "train a learned estimator"),
    "export": Command(".export", "write a trained network as ONNX, for programs without Python"),
    "tune": Command(".tune", "tune the gains of a filter: constant ones, or a policy that sets them"),
    "adapt": Command(
        ".recordings.adapt", "compare what can set the gains of a filter: constants, rules, policies, bounds"
    ),
    "inspect": Command(".recordings.inspect", "check a recording: format, channels, units, signs, clock"),
    "recommend": Command(".recordings.recommend", "rank estimators for a recording by their errors on similar ones"),
    "estimate": Command(".recordings.estimate", "write angles, quaternions and standard deviations of a recording"),
    "evaluate": Command(".recordings.evaluate", "compare estimators on recordings"),
    "stream": Command(".live.stream", "estimate sample by sample while lines of samples arrive: stdin, serial, UDP"),
    "align": Command(".recordings.align", "align clocks of several devices, axes of worn sensors, magnetometers"),
    "calibrate": Command(
        ".recordings.calibrate", "calibrate scale, offset and axes of raw sensors from rate-table and tumbling runs"
    ),
    "view": Command(".live.view", "show motion and estimates in the browser: recordings, environments, live samples"),
    "array": Command(".array", "analyse an array of accelerometers: rank and noise gains"),
    "benchmark": Command(".benchmark", "compare all estimators on simulated motion and on recordings"),
    "reproduce": Command(
        ".reproduce", "reproduce the study of a paper: published tables and figures beside those of this package"
    ),
    "speed": Command(".speed", "measure steps per second of environments and estimators"),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run ``poise`` with the words after its name (None: those of the process) and return its exit status."""
    words = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in words or os.environ.get("POISE_DEBUG", "0") not in ("", "0")
    try:
        words, backend = without_backend([word for word in words if word != "--debug"])
        with extra(), on_backend(backend) if backend else contextlib.nullcontext():
            status = dispatch(words)
        # Here rather than at exit, where a reader that left could not be handled.
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except KeyboardInterrupt:
        if debug:
            raise
        print("\npoise: interrupted", file=sys.stderr)
        return INTERRUPTED
    except USER_ERRORS as error:
        if debug:
            raise
        return fail(one_line(error))


def without_backend(words: list[str]) -> tuple[list[str], str]:
    """``words`` without ``--backend NAME``, and NAME, by default ``POISE_BACKEND``; empty: processes of this machine.

    Raises:
        ValueError: no name follows ``--backend``.
    """
    words = [part for word in words for part in (word.split("=", 1) if word.startswith("--backend=") else (word,))]
    if "--backend" not in words:
        return words, os.environ.get("POISE_BACKEND", "")
    place = words.index("--backend")
    if place + 1 == len(words):
        raise ValueError(f"--backend needs one of {', '.join(BACKENDS)}")
    return words[:place] + words[place + 2 :], words[place + 1]


def dispatch(words: Sequence[str]) -> int:
    """Do what ``words`` ask for: help, version, or a subcommand with its options."""
    if not words or words[0] in ("-h", "--help"):
        print(usage())
        return 0 if words else USAGE_ERROR
    name, *rest = words
    if name == "--version":
        print(f"poise {poise_version()}")
        return 0
    if name not in COMMANDS:
        return fail(unknown("command", name, COMMANDS))
    return run(name, rest)


def run(name: str, words: Sequence[str]) -> int:
    """Import the subcommand ``name``, parse ``words`` into its ``Args`` and run it."""
    import tyro  # a quarter of the time of `poise --help`, which does not need it

    command = COMMANDS[name]
    module = importlib.import_module(command.module, __package__)
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            typed = plain_help(module.Args)
            args: object = tyro.cli(typed, args=list(words), prog=f"poise {name}", description=module.__doc__)
    except SystemExit as stop:
        if not stop.code:
            raise
        return fail(unboxed(complaint.getvalue()))
    check_counts(args)
    return int(module.run(args))


def plain_help(arguments: type) -> type:
    """The dataclass ``arguments``, whose help is silent about defaults that are nothing: None, no words, no flag."""
    import tyro

    for name, hint in get_type_hints(arguments, include_extras=True).items():
        # What has aliases has a configuration of its own.
        if not any(isinstance(part, type(tyro.conf.arg())) for part in getattr(hint, "__metadata__", ())):
            label = placeholder(hint)
            arguments.__annotations__[name] = Annotated[hint, tyro.conf.arg(metavar=label, help_behavior_hint=stated)]
    return arguments


def placeholder(hint: object) -> str | None:
    """What stands for a value that may be left out, such as PATH; None for all others."""
    kinds = [kind for kind in get_args(hint) if kind is not type(None)]
    if type(None) not in get_args(hint) or len(kinds) > 1:
        return None
    names = [kind.__name__.upper() for kind in get_args(kinds[0]) or kinds if isinstance(kind, type)]
    return f"[{names[0]} [{names[0]} ...]]" if ... in get_args(kinds[0]) else " ".join(names) or None


def stated(default: str) -> str:
    """What a help text says of a default."""
    return "" if default in ("", "None", "False") else f"(default: {default})"


def check_counts(args: object) -> None:
    """Check whole numbers that mean the same in all commands, before one begins to work.

    Raises:
        ValueError: one is too small.
    """
    for option, least in LEAST.items():
        value = getattr(args, option, None)
        if isinstance(value, int) and value < least:
            raise ValueError(f"{option} must be at least {least}, got {value}")


PARSER_WORDS = {
    r"Error parsing (\S+): invalid literal for int\(\) with base 10:": r"\1 must be a whole number, got",
    r"Error parsing (\S+): could not convert string to float:": r"\1 must be a number, got",
    r"Argument helptext: .*(?=\.? For full helptext)": "",
    r"\s*\.? For full helptext, (?:run|see):?": "; see",
}
"""What the parser says, as a pattern → what a user needs of it."""


def unboxed(complaint: str) -> str:
    """A parser's message in a box of several lines, as one line."""
    frame = str.maketrans(dict.fromkeys("─╭╮╰╯│┌┐└┘", " "))
    # A terminal without these characters gets a box of hyphens.
    lines = [re.sub(r"-{3,}|^[+|]|[+|]$", " ", line.translate(frame)).strip() for line in complaint.splitlines()]
    content = [line for line in lines if line]
    # The first line is the title that its contents repeat.
    said = " ".join(content[1:] if len(content) > 1 else content)
    for pattern, plain in PARSER_WORDS.items():
        said = re.sub(pattern, plain, said)
    return said


def usage() -> str:
    """Return the help of ``poise`` itself."""
    width = max(len(name) for name in COMMANDS)
    return "\n".join(
        [
            "usage: poise COMMAND [options]",
            "",
            "Pose from inertial sensors: environments, estimators, comparisons.",
            "",
            "commands:",
            *(f"  {name:<{width}}  {command.help}" for name, command in COMMANDS.items()),
            "",
            "options:",
            "  -h, --help  this text; `poise COMMAND --help` explains a command",
            "  --version   the version",
            "  --debug     show the traceback of an error (also POISE_DEBUG=1)",
            "  --backend   loky, dask or ray: what runs parallel jobs (also POISE_BACKEND)",
        ]
    )


def one_line(error: BaseException) -> str:
    """Return the message of ``error`` on one line."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split()) or type(error).__name__


def fail(message: str) -> int:
    """Print an error in the form of compilers and return the exit status of wrong input."""
    print(f"poise: error: {message}", file=sys.stderr)
    return USAGE_ERROR


if __name__ == "__main__":
    sys.exit(main())
