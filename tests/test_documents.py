"""Examples in the documents run; tables and links in them are true."""

import importlib
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import tyro

from poise.envs.sensors.kinds import KINDS
from poise.scripts.list import LISTS, PLACED
from poise.scripts.main import COMMANDS, without_backend

from .envs.data.formats.examples import write_examples

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "environments").glob("*.md")),
]
EXAMPLES = [
    pytest.param(path, code, id=f"{path.name}-{number}")
    for path in DOCUMENTS
    for number, code in enumerate(re.findall(r"```python\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL))
    if "import " in code
]


@pytest.mark.parametrize(("path", "code"), EXAMPLES)
def test_examples_run(path, code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    if path.name == "recordings.md":
        write_examples(tmp_path)
    kinds = dict(KINDS)
    exec(compile(code, "example", "exec"), {"__name__": "example"})
    for name in set(KINDS) - set(kinds):  # registered by the example, nobody else's business
        del KINDS[name]


def commands(path):
    """Words of every ``poise …`` in the blocks of a page, without comments, redirections and placeholders."""
    for block in re.findall(r"```\w*\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            found = re.match(r"\s*(?:[\w-]+ \| )?poise ([a-z].*)$", line)
            if found:
                words = shlex.split(re.sub(r"\$\w+", "0", re.split(r"\s#|\s[|>]\s", found[1])[0]))
                yield [word for word in without_backend(words)[0] if word != "…"]


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_commands_have_the_options_that_they_show(path):
    for name, *words in commands(path):
        module = importlib.import_module(COMMANDS[name].module, "poise.scripts")
        tyro.cli(module.Args, args=words)  # leaves the process if it does not understand


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path):
    for target in re.findall(r"\]\(([^)#]+)\)", path.read_text(encoding="utf-8")):
        # `make links` asks the servers
        outside = re.fullmatch(r"https://[\w-]+(\.[\w-]+)+(/[\w.~%/+-]*)?", target)
        assert outside or (path.parent / target).exists(), target


def test_lists_are_those_of_the_package():
    # a process of its own: examples may register kinds of sensors
    words = [sys.executable, "-m", "poise.scripts.main", "list", "--markdown"]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    for path in DOCUMENTS:
        for found in PLACED.finditer(path.read_text(encoding="utf-8")):
            assert found[0] in printed, f"run: poise list --update {path.relative_to(ROOT)}"


def test_every_list_is_in_a_document():
    texts = [path.read_text(encoding="utf-8") for path in DOCUMENTS]
    assert {name for text in texts for name in PLACED.findall(text)} == set(LISTS)


def test_the_table_of_environments_is_that_of_the_package():
    from poise.envs import list_environments

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `(poise/[^`]+)` \|", text, re.MULTILINE)) == set(list_environments())


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path):
    """All pages, references and tutorials."""
    pytest.importorskip("sphinx_gallery")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "-b", "html", str(ROOT / "docs"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    assert (tmp_path / "tutorials" / "06_leaderboard.html").exists()
