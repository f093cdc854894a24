"""The order of the house, read from the source: who may import whom, and where one thing alone may live."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FLOORS = ("filters", "envs", "baselines", "scripts")
FILES = [ROOT / "__init__.py", *(path for floor in FLOORS for path in sorted((ROOT / floor).rglob("*.py")))]

# Libraries that a floor may load inside a function that needs them, never just by being imported.
NOT_AT_IMPORT = {
    "filters": {"gymnasium", "pybullet", "torch", "stable_baselines3", "matplotlib", "pandas"},
    "envs": {"torch", "stable_baselines3"},
}
LOCAL_RANDOM = {"default_rng", "Generator", "SeedSequence", "BitGenerator", "PCG64", "PCG64DXSM", "Philox", "SFC64"}
QUATERNION_PRODUCT = re.compile(r"(quat\w*_?(mul|prod|conj|inv)|hamilton|qmul|quatmul)", re.IGNORECASE)


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


def module_of(path: Path) -> tuple[str, ...]:
    """Path of the package that relative imports of a file start from; the root is the empty one."""
    return path.relative_to(ROOT).parent.parts


def imported(node: ast.stmt, package: tuple[str, ...]) -> Iterator[tuple[bool, tuple[str, ...]]]:
    """Yield (inside poise?, dotted parts) of everything an import statement may load."""
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield False, tuple(alias.name.split("."))
    elif isinstance(node, ast.ImportFrom):
        parts = tuple(node.module.split(".")) if node.module else ()
        if node.level:
            parts = package[: len(package) - (node.level - 1)] + parts
        for alias in node.names:
            yield bool(node.level), (*parts, alias.name)


def violations(source: str, package: tuple[str, ...]) -> list[str]:
    """Return what is wrong with the imports of a file of ``package``."""
    found = []
    floor = package[0] if package else None
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if not isinstance(node, ast.Import | ast.ImportFrom):
            continue
        for inside, parts in imported(node, package):
            if not inside and parts[0] == "poise":
                found.append(f"line {node.lineno}: imports {'.'.join(parts)} absolutely")
            if inside and floor and parts[0] in FLOORS and FLOORS.index(parts[0]) > FLOORS.index(floor):
                found.append(f"line {node.lineno}: {floor} imports {parts[0]}, a floor above")
            at_import = node in tree.body
            if not inside and floor and at_import and parts[0] in NOT_AT_IMPORT.get(floor, ()):
                found.append(f"line {node.lineno}: {floor} loads {parts[0]} when imported")
    return found


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_imports_point_downwards(path: Path) -> None:
    assert violations(path.read_text(encoding="utf-8"), module_of(path)) == []


@pytest.mark.parametrize(
    ("source", "package"),
    [
        ("from ..envs import replay", ("filters",)),
        ("from ...envs.base import PoseEnv", ("filters", "accelerometer_array")),
        ("from .. import baselines", ("envs",)),
        ("def f():\n    from ..scripts.main import main", ("baselines",)),
        ("import poise.filters", ("envs",)),
        ("from poise.filters import rotation", ()),
        ("import torch", ("envs",)),
    ],
)
def test_a_wrong_import_is_seen(source: str, package: tuple[str, ...]) -> None:
    assert len(violations(source, package)) == 1


@pytest.mark.parametrize(
    ("source", "package"),
    [
        ("from ..filters import rotation", ("envs",)),
        ("from ...filters.rotation import rotate", ("envs", "bicycle")),
        ("from .envs import register", ()),
        ("def f():\n    import torch", ("envs",)),
        ("from .. import __version__", ("scripts",)),
    ],
)
def test_a_right_import_passes(source: str, package: tuple[str, ...]) -> None:
    assert violations(source, package) == []


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_no_global_random_state(path: Path) -> None:
    """``np.random.<function>``, ``random`` and ``torch.random`` share one state with everybody."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) in ("np.random", "numpy.random"):
            assert node.attr in LOCAL_RANDOM, f"{name_of(path)}:{node.lineno}: np.random.{node.attr}"
        if isinstance(node, ast.Import):
            assert all(alias.name != "random" for alias in node.names), f"{name_of(path)}:{node.lineno}: import random"
        if isinstance(node, ast.ImportFrom):
            assert node.level or node.module != "random", f"{name_of(path)}:{node.lineno}: from random"


@pytest.mark.parametrize("path", [p for p in FILES if name_of(p) != "filters/core/rotation.py"], ids=name_of)
def test_quaternions_are_multiplied_in_one_file(path: Path) -> None:
    """A second product, or SciPy's, would bring a second convention; SciPy's is an oracle for tests only."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            assert not QUATERNION_PRODUCT.search(node.name), f"{name_of(path)}:{node.lineno}: {node.name}"
        if isinstance(node, ast.ImportFrom) and not node.level:
            assert node.module != "scipy.spatial.transform", f"{name_of(path)}:{node.lineno}"
