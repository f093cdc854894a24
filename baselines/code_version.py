"""Which code computes: what is kept in a run folder is worth nothing to another version."""

from __future__ import annotations

import functools
import hashlib
from importlib import metadata
from pathlib import Path

PRODUCT = ("filters", "envs", "baselines")
"""Folders whose source decides a result."""


@functools.cache
def code_version() -> str:
    """``<version of the package>+<8 hexadecimal digits of a SHA-256 over its source>``, found once a process."""
    root = Path(__file__).resolve().parents[1]
    sha = hashlib.sha256()
    for folder in PRODUCT:
        for path in sorted((root / folder).rglob("*.py")):
            sha.update(f"{path.relative_to(root).as_posix()}\0".encode())
            sha.update(path.read_bytes())
    try:
        version = metadata.version("poise")
    except metadata.PackageNotFoundError:
        version = "0"
    return f"{version}+{sha.hexdigest()[:8]}"
