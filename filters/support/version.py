"""Version of poise, and a digest of its source files for results that are kept between runs."""

from __future__ import annotations

import functools
import hashlib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
"""Folder of the package."""


def package_version(name: str = "poise") -> str | None:
    """Return the installed version of a package, None if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def poise_version() -> str:
    """Return the version of poise; ``0+unknown`` in a checkout that is not installed."""
    return package_version() or "0+unknown"


@functools.cache
def code_version(*layers: str) -> str:
    """Return version and digest of the files that a result depends on, such as ``0.1.0-3f9c2a1b04de``.

    Args:
        layers: folders of the package whose files count (sources, assets, cards of weights); filters, envs and
            baselines if none are given. Simulated rides, for instance, depend on ``code_version("filters", "envs")``.
    """
    digest = hashlib.sha256()
    for layer in layers or ("filters", "envs", "baselines"):
        for path in sorted((ROOT / layer).rglob("*")):
            # Weights are large; the card beside them holds their digest.
            if path.is_file() and path.parent.name != "__pycache__" and path.suffix != ".safetensors":
                digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return f"{poise_version()}-{digest.hexdigest()[:12]}"
