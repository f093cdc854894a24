"""Simulated episodes that are kept: the last ones in memory, more of them in the user's cache folder.

A file belongs to everything that its episode depends on: the version of the code of ``filters`` and ``envs``, the
settings and the seed. Settings that have no exact JSON form, such as functions, keep their episodes in memory only.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..filters.support.files import user_cache
from ..filters.support.version import code_version
from .data.trajectory import Trajectory, load_trajectory

IN_MEMORY = 16
"""episodes of a store"""
ON_DISK = 10**9
"""bytes of all stores of one name"""
UNUSED = 30 * 86400.0
"""s after which an episode that nobody read is removed"""


class EpisodeStore:
    """Episodes of one environment.

    Args:
        name: folder below the user's cache folder.
        settings: everything that the episodes depend on besides code and key.
        in_memory: how many are kept in memory.
        on_disk: largest size of the folder, bytes; the files that were used longest ago are removed first. Versions of
            the code share it, since several checkouts may be at work; what was not used for a month is removed too.
    """

    def __init__(self, name: str, settings: Any, *, in_memory: int = IN_MEMORY, on_disk: int = ON_DISK) -> None:
        self.folder, self._in_memory, self._on_disk = user_cache(name), in_memory, on_disk
        self._settings: str | None = None
        with contextlib.suppress(TypeError):
            self._settings = json.dumps(exact(settings))
        self._kept: OrderedDict[Any, Trajectory] = OrderedDict()

    def episode(self, key: tuple[int, ...], simulate: Callable[[], Trajectory]) -> Trajectory:
        """The episode of a key, from memory, from disk, or simulated; the same numbers bit for bit."""
        if key not in self._kept:
            path = self.path(key)
            found = None if path is None else self._read(path)
            if found is None:
                found = simulate()
                if path is not None:
                    self._write(path, found)
            self._kept[key] = found
        self._kept.move_to_end(key)
        while len(self._kept) > self._in_memory:
            self._kept.popitem(last=False)
        return self._kept[key]

    def path(self, key: tuple[int, ...]) -> Path | None:
        """File of an episode; None if the settings have no exact JSON form."""
        if self._settings is None:
            return None
        digest = hashlib.sha256(json.dumps([self._settings, key]).encode()).hexdigest()[:24]
        return self.folder / code_version("filters", "envs") / f"{digest}.h5"

    @staticmethod
    def _read(path: Path) -> Trajectory | None:
        """The episode in a file; None if there is none, or a damaged one."""
        try:
            found = load_trajectory(path)
            path.touch()
        except (OSError, ValueError):
            return None
        return found

    def _write(self, path: Path, episode: Trajectory) -> None:
        """Keep an episode if the folder can be written, and remove the oldest ones, and others if there is too much."""
        with contextlib.suppress(OSError):
            episode.save(path)
            files = {file: file.stat() for file in self.folder.rglob("*.h5") if not file.name.startswith(".")}
            size, now = sum(stat.st_size for stat in files.values()), time.time()
            # whatever version they are of: another checkout may use the same folder
            for file in sorted(files, key=lambda each: files[each].st_mtime):
                if size <= self._on_disk and now - files[file].st_mtime <= UNUSED:
                    break
                file.unlink(missing_ok=True)
                size -= files[file].st_size
            for folder in {file.parent for file in files} - {path.parent}:
                with contextlib.suppress(OSError):
                    folder.rmdir()  # one that is not empty stays


def exact(value: Any) -> Any:
    """A value as JSON that no other value has.

    Raises:
        TypeError: it has no such form.
    """
    if value is None or isinstance(value, str | int | float | bool):
        return value
    if isinstance(value, list | tuple):
        return [exact(item) for item in value]
    if isinstance(value, Mapping):
        return {str(name): exact(item) for name, item in value.items()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {item.name: exact(getattr(value, item.name)) for item in dataclasses.fields(value)}
        kind = type(value)
        return {"type": f"{kind.__module__}.{kind.__qualname__}", **fields}
    raise TypeError(f"{value!r} has no exact JSON form")
