"""The order of the package, read from the source: who may import whom, and where one thing alone may live."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator

import pytest

from .source import FILES, ROOT, TOP, module_of, name_of, tree_of

LAYERS: tuple[tuple[str, ...], ...] = (
    ("filters.support",),
    ("filters.core", "filters.compile"),
    ("filters.analysis", "filters.imu"),
    ("filters.arrays", "filters.bicycle", "filters.external"),
    ("filters",),  # the registry
    ("filters.adaptation",),
    ("envs.sensors",),
    ("envs.data", "envs.physics"),
    ("envs",),
    ("baselines",),
    ("baselines.learned", "baselines.gain_policy"),
    ("baselines.speed", "baselines.studies"),
    ("scripts",),
)
"""From the bottom; a module belongs to the longest name that it begins with. Imports point downwards or stay inside
one name; those of one layer do not know each other, except where :data:`TOGETHER` says so."""
TOGETHER = {frozenset({"filters.core", "filters.compile"})}
"""The Kalman filter runs compiled models, which are made from the core's; no two modules import each other."""
MODULES = 16
"""Modules of a folder at most."""

# Libraries that a layer may load inside a function that needs them, never just by being imported.
NOT_AT_IMPORT = {
    "filters": {"gymnasium", "pybullet", "torch", "stable_baselines3", "matplotlib", "pandas"},
    "envs": {"torch", "stable_baselines3", "matplotlib", "pandas"},
}
LOCAL_RANDOM = {"default_rng", "Generator", "SeedSequence", "BitGenerator", "PCG64", "PCG64DXSM", "Philox", "SFC64"}
# stable-baselines3 shuffles with the global generator, whose state belongs to a checkpoint.
KEPT_RANDOM = {"baselines/gain_policy/training.py": {"get_state", "set_state"}}
QUATERNION_PRODUCT = re.compile(r"(quat\w*_?(mul|prod|conj|inv)|hamilton|qmul|quatmul)", re.IGNORECASE)


MODULE_FILES = {module_of(path): path for path in FILES}


def layer_of(module: str) -> tuple[int, str]:
    """Height and name of the layer that a module belongs to; everything may import what lies in no layer."""
    found = (len(LAYERS), "")
    for height, names in enumerate(LAYERS):
        for name in names:
            if (module == name or module.startswith(f"{name}.")) and len(name) > len(found[1]):
                found = (height, name)
    return found


def imported(node: ast.AST, package: tuple[str, ...]) -> Iterator[tuple[bool, tuple[str, ...]]]:
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


def at_import(tree: ast.Module) -> Iterator[ast.AST]:
    """Statements that run when a module is imported, also those inside ``with``, ``try`` and ``if``."""
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop()
        yield node
        checking = isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        if not checking and not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            waiting += ast.iter_child_nodes(node)


def allowed(importer: str, target: str) -> bool:
    """Whether the layer ``importer`` may know ``target``, both of them modules of the package."""
    (high, above), (low, below) = layer_of(importer), layer_of(target)
    return low < high or above == below or frozenset({above, below}) in TOGETHER


def violations(tree: ast.Module, module: str, package: tuple[str, ...]) -> list[str]:
    """Return what is wrong with the imports of a module that lies in ``package``."""
    found = []
    loaded = {id(node) for node in at_import(tree)}
    for node in ast.walk(tree):
        for inside, parts in imported(node, package):
            if not inside and parts[0] == "poise":
                found.append(f"line {node.lineno}: imports {'.'.join(parts)} absolutely")
            if inside and module and parts[0] in TOP and not allowed(module, ".".join(parts)):
                found.append(f"line {node.lineno}: {module} imports {'.'.join(parts)}, which is not below it")
            if not inside and id(node) in loaded and parts[0] in NOT_AT_IMPORT.get(module.split(".")[0], ()):
                found.append(f"line {node.lineno}: loads {parts[0]} when imported")
    return found


def test_imports_point_downwards() -> None:
    found = {
        name_of(path): violations(tree_of(path), module_of(path), path.relative_to(ROOT).parent.parts) for path in FILES
    }
    assert {name: wrong for name, wrong in found.items() if wrong} == {}


@pytest.mark.parametrize(
    ("source", "module"),
    [
        ("from ..envs import replay", "filters.registry"),
        ("from ...envs.base import PoseEnv", "filters.arrays.rate"),
        ("from .. import baselines", "envs.base"),
        ("from ..base import PoseEnv", "envs.data.trajectory"),
        ("from ..data.trajectory import Trajectory", "envs.sensors.suite"),
        ("from ..compile.run import run", "filters.support.files"),
        ("from ...gain_policy.policy import GainPolicy", "baselines.learned.networks.gru"),
        ("def f():\n    from ...studies.kit import Study", "baselines.learned.networks.gru"),
        ("if TYPE_CHECKING:\n    from .studies.kit import Study", "baselines.evaluation"),
        ("def f():\n    from ..scripts.main import main", "baselines.evaluation"),
        ("import poise.filters", "envs.base"),
        ("from poise.filters import rotation", ""),
        ("import torch", "envs.base"),
        ("with extra('learn'):\n    import torch", "envs.base"),
    ],
)
def test_a_wrong_import_is_seen(source: str, module: str) -> None:
    assert len(violations(ast.parse(source), module, tuple(module.split(".")[:-1]))) == 1


@pytest.mark.parametrize(
    ("source", "module"),
    [
        ("from ..filters import registry", "envs.base"),
        ("from ....filters.core.rotation import rotate", "envs.bicycle.ride.truth"),
        ("from ..compile.run import run", "filters.core.kalman"),
        ("from .envs import register", ""),
        ("def f():\n    import torch", "envs.base"),
        ("if TYPE_CHECKING:\n    import torch", "envs.base"),
        ("with extra('sim'):\n    import pybullet", "envs.physics.world"),
        ("from .. import __version__", "scripts.main"),
    ],
)
def test_a_right_import_passes(source: str, module: str) -> None:
    assert violations(ast.parse(source), module, tuple(module.split(".")[:-1])) == []


def import_graph() -> dict[str, set[str]]:
    """Module → modules that it imports anywhere: at the top, inside functions, for types alone."""
    graph: dict[str, set[str]] = {}
    for module, path in MODULE_FILES.items():
        package = path.relative_to(ROOT).parent.parts
        found = {parts for node in ast.walk(tree_of(path)) for parts in inside(node, package)}
        graph[module] = {next((name for name in parts if name in MODULE_FILES), "") for parts in found} - {module, ""}
    return graph


def inside(node: ast.AST, package: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield what a relative import may mean: a module, or a name in the module above it."""
    for relative, parts in imported(node, package):
        if relative:
            yield ".".join(parts), ".".join(parts[:-1])


def circles(graph: dict[str, set[str]]) -> list[frozenset[str]]:
    """Groups of modules each of which reaches all others of its group."""
    reach = {module: set(targets) for module, targets in graph.items()}
    for middle in graph:
        for module in graph:
            if middle in reach[module]:
                reach[module] |= reach[middle]
    groups = {frozenset(other for other in reach[module] if module in reach[other]) for module in graph}
    return sorted((group for group in groups if group), key=sorted)


def test_no_module_imports_itself_in_a_circle() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == [frozenset({"b", "c"})]
    assert circles(import_graph()) == []


def test_folders_are_small() -> None:
    sizes = Counter(path.parent for path in FILES if path.name != "__init__.py")
    assert {name_of(folder): count for folder, count in sizes.items() if count > MODULES} == {}


def test_tests_lie_where_the_modules_lie() -> None:
    tests = ROOT / "tests"
    folders = {path.relative_to(tests).parent for path in tests.rglob("test_*.py")}
    product = {path.relative_to(ROOT).parent for path in FILES}
    assert folders <= product


def is_numpy_random(node: ast.AST) -> bool:
    named = isinstance(node, ast.Attribute) and node.attr == "random" and isinstance(node.value, ast.Name)
    return named and node.value.id in ("np", "numpy")  # type: ignore[attr-defined]


def test_no_global_random_state() -> None:
    """``np.random.<function>``, ``random`` and ``torch.random`` share one state with everybody."""
    found = []
    for path in FILES:
        local = LOCAL_RANDOM | KEPT_RANDOM.get(name_of(path), set())
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Attribute) and is_numpy_random(node.value):
                wrong = node.attr not in local
            elif isinstance(node, ast.Import):
                wrong = any(alias.name == "random" for alias in node.names)
            else:
                wrong = isinstance(node, ast.ImportFrom) and not node.level and node.module == "random"
            if wrong:
                found.append(f"{name_of(path)}:{node.lineno}: {ast.unparse(node)}")  # type: ignore[attr-defined]
    assert found == []


def test_quaternions_are_multiplied_in_one_file() -> None:
    """A second product, or SciPy's, would bring a second convention; SciPy's is an oracle for tests only."""
    found = []
    for path in FILES:
        for node in ast.walk(tree_of(path)):
            product = isinstance(node, ast.FunctionDef) and QUATERNION_PRODUCT.search(node.name)
            if product and name_of(path) != "filters/core/rotation.py":
                found.append(f"{name_of(path)}:{node.lineno}: {node.name}")  # type: ignore[attr-defined]
            if isinstance(node, ast.ImportFrom) and not node.level and node.module == "scipy.spatial.transform":
                found.append(f"{name_of(path)}:{node.lineno}: {node.module}")
    assert found == []
