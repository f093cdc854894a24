"""The package as users get it, and the promises that the files around it make."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest
import yaml

from poise.filters.support.optional import EXTRAS

from .source import FILES, ROOT, TOP, tree_of

PYPROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
LINES = 400
HEAVY = {"pybullet", "torch", "stable_baselines3", "numba", "sympy", "pandas", "matplotlib", "tensorboard"}
FIVE_WORKS = {
    "10.1109/TMECH.2018.2811730": "Zhang",
    "10.1109/TBME.2013.2260339": "Zhang",
    "Whole-Body Pose Estimation in Human Bicycle Riding Using a Small Set of Wearable Sensors": "Zhang",
    "Estimating the orientation of a game controller from inertial and magnetic measurements": "He",
    "10.1109/TIM.2012.2187245": "Lee",
}


def project_files() -> list[Path]:
    """Files that are, or could be, in the repository: tracked ones and new ones that are not ignored."""
    listing = subprocess.run(
        ["git", "-C", str(ROOT), "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        capture_output=True,
        text=True,
    )
    if listing.returncode:
        pytest.skip("not a git checkout")
    return [ROOT / name for name in listing.stdout.split("\0") if name and (ROOT / name).is_file()]


def package_folders() -> set[str]:
    inits = [path for path in FILES if path.name == "__init__.py"]
    return {".".join(("poise", *path.relative_to(ROOT).parent.parts)) for path in inits}


def test_every_package_is_listed() -> None:
    assert set(PYPROJECT["tool"]["setuptools"]["packages"]) == package_folders()


def test_every_module_lies_in_a_package() -> None:
    assert [path for path in FILES if not (path.parent / "__init__.py").is_file()] == []


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> tuple[set[str], set[str]]:
    """Names of the files in a copy of the project and in the wheel built from it."""
    copy = tmp_path_factory.mktemp("copy")
    names = {path.relative_to(ROOT).as_posix() for path in project_files()}
    for name in names:
        target = copy / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, target)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*command, "--wheel-dir", str(copy / "wheels"), str(copy)], check=True, stdin=subprocess.DEVNULL)
    (built,) = (copy / "wheels").glob("*.whl")
    return names, set(zipfile.ZipFile(built).namelist())


def test_the_wheel_holds_the_package_and_nothing_else(wheel: tuple[set[str], set[str]]) -> None:
    project, packed = wheel
    code = {name for name in packed if not name.split("/")[0].endswith(".dist-info")}
    wanted = {name for name in project if name.endswith(".py") and name.split("/")[0] in ("__init__.py", *TOP)}
    assert {name for name in code if name.endswith(".py")} == {f"poise/{name}" for name in wanted}
    assert {name.split("/")[0] for name in code} == {"poise"}
    assert {name.split("/")[1] for name in code} <= {*TOP, "__init__.py", "py.typed"}


def test_the_wheel_holds_the_data_of_the_package(wheel: tuple[set[str], set[str]]) -> None:
    project, packed = wheel
    data = {name for name in project if name.startswith(("envs/assets/", "baselines/weights/"))}
    assert {f"poise/{name}" for name in data | {"py.typed"}} <= packed


def test_files_are_short() -> None:
    written = {".py", ".md", ".toml", ".cff"}
    kept = [path for path in project_files() if path.suffix in written or path.name == "Makefile"]
    kept = [path for path in kept if path.name != "pylock.toml"]
    lengths = {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in kept}
    assert {name: n for name, n in lengths.items() if n > LINES} == {}


def test_no_file_names_a_place_on_somebodys_machine() -> None:
    places = re.compile(rb"(?<![\w.)\]}])/(home|root|work|Users)/\w")
    guilty = [path.name for path in project_files() if path.suffix != ".npz" and places.search(path.read_bytes())]
    assert guilty == []


def test_importing_poise_is_light() -> None:
    code = "import sys, poise; print(*{name.split('.')[0] for name in sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) & HEAVY == set()


def test_the_readme_shows_the_two_commands() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "make benchmark" in readme
    assert "make test" in readme


def requirements() -> set[str]:
    project = PYPROJECT["project"]
    asked = project["dependencies"] + [r for group in project["optional-dependencies"].values() for r in group]
    return {name_of(requirement) for requirement in asked} - {"poise"}


IMPORTED = {"pillow": "PIL"}
"""Package → module, where the names differ."""


def name_of(requirement: str) -> str:
    return re.split(r"[<>=!~\[; ]", requirement)[0].lower()


def test_messages_about_missing_packages_name_the_extra_that_brings_them() -> None:
    offered = PYPROJECT["project"]["optional-dependencies"]
    core = {name_of(requirement) for requirement in PYPROJECT["project"]["dependencies"]}
    assert set(offered) == {*EXTRAS, "all", "dev", "docs"}
    assert set(re.findall(r"\w+", offered["all"][0])) - {"poise"} == set(EXTRAS) - {"cluster", "learn"}, (
        "rl brings learn"
    )
    for extra, modules in EXTRAS.items():
        groups = [offered[extra], offered["learn"]] if extra == "rl" else [offered[extra]]
        asked = {name_of(requirement) for group in groups for requirement in group}
        assert {name.replace("-", "_") for name in asked} - {"poise"} == set(modules) - {"pybullet_data"}
        assert not asked & core


def test_every_import_is_a_declared_requirement() -> None:
    names = {IMPORTED.get(name, name.replace("-", "_")) for name in requirements()}
    for path in FILES:
        for node in ast.walk(tree_of(path)):
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level and node.module:
                modules = [node.module]
            for top in {module.split(".")[0] for module in modules} - sys.stdlib_module_names - {"pybullet_data"}:
                assert top in names, f"{path.relative_to(ROOT)} imports {top}"


def test_constraints_pin_every_requirement_exactly() -> None:
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if line and not line.startswith("#")]
    pins = dict(line.split("==") for line in lines)
    assert requirements() <= set(pins)
    # A local suffix (+cpu) would tie the set to one index.
    assert not any("+" in pin for pin in pins.values())


def test_the_lock_file_is_that_of_the_constraints() -> None:
    """``uv pip compile -c constraints.txt …``; the command is in its first lines."""
    lock = tomllib.loads((ROOT / "pylock.toml").read_text(encoding="utf-8"))
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if line and not line.startswith("#")]
    pins = dict(line.split("==") for line in lines)
    locked = {package["name"]: package["version"] for package in lock["packages"]}
    assert requirements() - {"ray"} <= set(locked)
    assert {name: version for name, version in locked.items() if pins.get(name, version) != version} == {}


def test_the_citation_file_names_the_five_works() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert str(citation["version"]) == PYPROJECT["project"]["version"]
    assert PYPROJECT["project"]["authors"] == citation["authors"]
    assert {"message", "title", "authors"} <= set(citation)
    works = {
        work["doi"] if "doi" in work else work["title"]: work["authors"][0]["family-names"]
        for work in citation["references"]
    }
    assert works == FIVE_WORKS
    assert all({"type", "title", "authors", "year"} <= set(work) for work in citation["references"])
