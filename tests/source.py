"""The source files of the package, for tests that read them."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TOP = ("filters", "envs", "baselines", "scripts")
FILES = [ROOT / "__init__.py", *(path for top in TOP for path in sorted((ROOT / top).rglob("*.py")))]


def name_of(path: Path) -> str:
    """``filters/core/kalman.py`` of a file."""
    return path.relative_to(ROOT).as_posix()


def module_of(path: Path) -> str:
    """``filters.core.kalman`` of its file, ``filters.core`` of the folder's ``__init__.py``, empty for the root's."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def tree_of(path: Path) -> ast.Module:
    """The syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))
