"""Examples in the documents run; tables and links in them are true."""

import re
from pathlib import Path

import pytest

import poise

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
EXAMPLES = [
    pytest.param(code, id=f"{path.name}-{number}")
    for path in DOCUMENTS
    for number, code in enumerate(re.findall(r"```python\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL))
    if "import " in code and "run_command" not in code
]


@pytest.mark.parametrize("code", EXAMPLES)
def test_examples_run(code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "example", "exec"), {"__name__": "example"})


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path):
    for target in re.findall(r"\]\(([^)#]+)\)", path.read_text(encoding="utf-8")):
        assert target.startswith("http") or (path.parent / target).exists(), target


def test_the_table_of_estimators_is_that_of_the_package():
    text = (ROOT / "docs" / "estimators.md").read_text(encoding="utf-8")
    listed = dict(re.findall(r"^\| `([^`]+)` \| ([a-z]+) \|", text, re.MULTILINE))
    assert listed == {name: info.kind for name, info in poise.list_estimators().items()}
    for info in poise.list_estimators().values():
        assert info.description in text


def test_the_table_of_environments_is_that_of_the_package():
    from poise.envs import list_environments

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `(poise/[^`]+)` \|", text, re.MULTILINE)) == set(list_environments())
