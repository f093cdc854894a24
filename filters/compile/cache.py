"""Cache of compiled code: the folder, and the compiler that writes to it.

The folder is ``compiled`` below the one that the environment variable ``POISE_CACHE`` names, or below the user's cache
folder. Machine code is stored with a checksum, so that a damaged file is compiled anew. What cannot be written, for
want of a permission or of space, is compiled in memory, at every start, after one warning. A folder that was filled
before and cannot be written is read.
"""

from __future__ import annotations

import functools
import gc
import hashlib
import importlib
import pickle
import re
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..support.files import user_cache
from ..support.version import ROOT

_LOCK = threading.RLock()
_WARNED: set[Path] = set()
IMPORT = re.compile(r"^\s*from (\.+)([\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
PATIENCE = 1.0
"""s of compiling after which a line on standard error is printed"""


def cache_folder() -> Path | None:
    """Folder of what is compiled; None, with one warning, where it cannot be written and holds nothing."""
    folder = user_cache("compiled")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as reason:
        if next(folder.rglob("*.nbi"), None) or next(folder.glob("*.o"), None):
            return folder
        warn_once(folder, reason)
        return None


def warn_once(folder: Path, reason: OSError) -> None:
    """Warn, once a folder, that what is compiled is not kept in it."""
    if folder not in _WARNED:
        _WARNED.add(folder)
        warnings.warn(
            f"compiled filters cannot be kept in {folder} ({reason.strerror}): they are compiled anew at every start. "
            "Set the environment variable POISE_CACHE to a folder that can be written",
            stacklevel=3,
        )


@contextmanager
def unless_full(folder: Path) -> Iterator[None]:
    """Write a file of the folder, if there is space for it: the code is in memory and runs without it."""
    try:
        yield
    except OSError as reason:
        warn_once(folder, reason)


@functools.cache
def _digest(layer: str) -> str:
    """Digest of the source files of a layer whose functions are compiled, and of those that they import from.

    Compiled functions call each other across files, and hold the constants of other files as they were.
    """
    sources = {path: path.read_bytes() for path in (ROOT / layer).rglob("*.py")}
    compiled = {path for path, source in sources.items() if b"cache import" in source}
    digest = hashlib.sha256()
    for path in sorted(compiled.union(*(imported(path, sources[path]) for path in compiled))):
        source = sources[path] if path in sources else path.read_bytes()
        digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + source + b"\0")
    return digest.hexdigest()[:12]


def imported(path: Path, source: bytes) -> set[Path]:
    """Files of the package from which a source file imports, by relative imports."""
    found = set()
    for dots, module, names in IMPORT.findall(source.decode()):
        start = path.parents[len(dots) - 1].joinpath(*module.split("."))
        candidates = [start.with_suffix(".py"), *(start / f"{name}.py" for name in re.findall(r"\w+", names))]
        found |= {candidate for candidate in candidates if candidate.is_file()}
    return found


def jit(function: Callable[..., Any]) -> Any:
    """The function compiled by numba on first use, kept in :func:`cache_folder`.

    Numba compiles a function anew when its own file changes. Compiled functions call those of other files too, so
    those of a layer are kept in a folder that is named by the digest of all of them.

    Such functions assign the elements of an array to those of another one in loops: for ``a[:] = b`` numba would
    compile the words of an error message, too, which takes longer than most functions.
    """
    numba: Any = importlib.import_module("numba")
    options = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    folder = cache_folder()
    if folder is None:
        return _uncollected(numba.njit(**options)(function))
    source = Path(function.__code__.co_filename)
    if source.is_relative_to(ROOT):
        layer = source.relative_to(ROOT).parts[0]
        folder = folder / f"{layer}_{_digest(layer)}"
    with _LOCK:
        # numba reads the place when it decorates; other code that uses numba keeps its own.
        before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder)
        locator = importlib.import_module("numba.core.caching")._CacheLocator
        required, locator.ensure_cache_path = locator.ensure_cache_path, _made_if_possible
        try:
            compiled = numba.njit(cache=True, **options)(function)
        finally:
            numba.config.CACHE_DIR, locator.ensure_cache_path = before, required
    place = compiled._cache._impl.locator
    place.ensure_cache_path = functools.partial(_made_if_possible, place)
    files = compiled._cache._cache_file
    files.__class__ = _checked(type(files))
    return _uncollected(compiled)


def _uncollected(compiled: Any) -> Any:
    """The function, for which numba compiles without collecting garbage: nearly all that it makes lives to the end."""
    compiler = compiled._compiler
    compiler.compile = functools.partial(without_collecting, compiler.compile)
    return compiled


def without_collecting(function: Callable[..., Any], *arguments: Any) -> Any:
    """What a function returns, called while no garbage is collected."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        return function(*arguments)
    finally:
        if collecting:
            gc.enable()


def _made_if_possible(locator: Any) -> None:
    """Make the folder of a function; numba would not read one that cannot be written."""
    with suppress(OSError):
        Path(locator.get_cache_path()).mkdir(parents=True, exist_ok=True)


def _checked(files: Any) -> type:
    """Numba's index and data files with a checksum; what does not match it counts as not there."""

    class Checked(files):
        def save(self, key: Any, data: Any) -> None:
            with unless_full(user_cache("compiled")):
                super().save(key, data)

        def _load_index(self) -> dict[Any, str]:
            try:
                return dict(super()._load_index())
            except Exception:  # whatever unpickling a damaged file raises
                return {}

        def _save_data(self, name: str, data: Any) -> None:
            with self._open_for_write(self._data_path(name)) as file:
                file.write(sealed(self._dump(data)))

        def _load_data(self, name: str) -> Any:
            content = opened(Path(self._data_path(name)).read_bytes())
            if content is None:
                raise OSError(f"{name} is damaged")
            return pickle.loads(content)

    return Checked


def sealed(content: bytes) -> bytes:
    """Content behind its checksum."""
    return hashlib.sha256(content).digest() + content


def opened(content: bytes) -> bytes | None:
    """The content of :func:`sealed`; None if it is damaged."""
    digest, content = content[:32], content[32:]
    return content if hashlib.sha256(content).digest() == digest else None


def compile_now(function: Any, arguments: tuple[Any, ...], label: str) -> None:
    """Call a function of :func:`jit`, which is compiled for these types before; say so if that takes long."""
    if not function.signatures:
        _compile(function, arguments, label)
    function(*arguments)


def _compile(function: Any, arguments: tuple[Any, ...], label: str) -> None:
    """Compile a function for the types of ``arguments``, or load it from the cache."""
    import numba

    done = threading.Event()

    def tell() -> None:
        while not done.wait(PATIENCE):
            if function.stats.cache_misses:  # what is found in the cache needs no word
                folder = cache_folder()
                kept = "not kept, as no cache folder can be written" if folder is None else f"once; kept in {folder}"
                print(f"poise: compiling {label} for this machine ({kept})", file=sys.stderr, flush=True)
                return

    threading.Thread(target=tell, daemon=True).start()
    try:
        with _alone(function.py_func.__module__):
            function.compile(tuple(numba.typeof(argument) for argument in arguments))
    finally:
        done.set()


@contextmanager
def _alone(name: str) -> Iterator[None]:
    """One process at a time is inside with this name: the others then find in the cache what it has compiled."""
    folder = cache_folder()
    try:
        import fcntl
    except ImportError:  # not on Windows, where each process compiles for itself
        folder = None
    if folder is None:
        yield
        return
    try:
        file = open(folder / f"{name}.lock", "w")  # noqa: SIM115
    except OSError:  # nothing can be kept
        yield
        return
    with file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
