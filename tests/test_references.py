"""Cross-references in docstrings name things that exist."""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from functools import cache

from .source import FILES, module_of, name_of, tree_of

ROLE = re.compile(r":(mod|class|func|meth|attr|data|obj|exc):`~?\.?(?:[^`<]*<)?~?\.?([\w.]+)>?`")
ELSEWHERE = {"numpy", "scipy", "gymnasium", "torch", "pandas", "h5py", "stable_baselines3"} | sys.stdlib_module_names


def names_in(body: list[ast.stmt], prefix: str) -> Iterator[str]:
    """Dotted names that statements define: functions, classes and what is inside of them, assignments, attributes."""
    for node in body:
        if isinstance(node, ast.FunctionDef):
            yield f"{prefix}.{node.name}"
            for inner in ast.walk(node):
                if isinstance(inner, ast.Attribute) and isinstance(inner.value, ast.Name) and inner.value.id == "self":
                    yield f"{prefix.rsplit('.', 1)[0] if node.name == '__init__' else prefix}.{inner.attr}"
                    yield f"{prefix}.{inner.attr}"
        elif isinstance(node, ast.ClassDef):
            yield f"{prefix}.{node.name}"
            yield from names_in(node.body, f"{prefix}.{node.name}")
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                for name in ast.walk(target):
                    if isinstance(name, ast.Name):
                        yield f"{prefix}.{name.id}"
        elif isinstance(node, ast.If | ast.Try):
            yield from names_in(node.body, prefix)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                yield f"{prefix}.{alias.asname or alias.name}"


@cache
def defined() -> frozenset[str]:
    """Every dotted name of the package, and every suffix of one (``.KalmanFilter.step``), which Sphinx resolves too."""
    found: set[str] = set()
    inherits: list[tuple[str, str]] = []
    for path in FILES:
        module, tree = f"poise.{module_of(path)}".rstrip("."), tree_of(path)
        found.update((module, *names_in(tree.body, module)))
        classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
        inherits += [
            (f"{module}.{node.name}", ast.unparse(base).split(".")[-1]) for node in classes for base in node.bases
        ]
    for _ in range(3):  # generations
        members: dict[str, set[str]] = defaultdict(set)
        for owner, _, member in (name.rpartition(".") for name in found):
            members[owner.rpartition(".")[2]].add(member)
        for child, parent in inherits:
            found.update(f"{child}.{member}" for member in members[parent])
    every = [name.split(".") for name in found]
    return frozenset(".".join(parts[start:]) for parts in every for start in range(len(parts)))


def unresolved(tree: ast.Module) -> list[str]:
    """References of a file's docstrings to nothing that the package defines."""
    missing = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            for role, target in ROLE.findall(node.value):
                if target.split(".")[0] not in ELSEWHERE and target not in defined():
                    missing.append(f"line {node.lineno}: :{role}:`{target}`")
    return missing


def test_every_reference_resolves() -> None:
    found = {name_of(path): unresolved(tree_of(path)) for path in FILES}
    assert {name: missing for name, missing in found.items() if missing} == {}


def test_a_reference_to_nothing_is_seen() -> None:
    wrong = '"""See :class:`KalmanFilter` and :class:`poise.filters.core.kalman.NoSuchFilter`."""'
    right = '"""See :class:`KalmanFilter` and :meth:`~poise.filters.core.kalman.KalmanFilter.step`."""'
    assert unresolved(ast.parse(wrong))
    assert not unresolved(ast.parse(right))
