"""Prints the licences of the packages that poise needs, as installed: ``python docs/list_licences.py --update``."""

from __future__ import annotations

import re
import sys
import tomllib
from importlib import metadata
from pathlib import Path

PAGE = Path(__file__).with_name("licences.md")
PROJECT = Path(__file__).parents[1] / "pyproject.toml"
MARKS = "<!-- packages -->\n", "<!-- end of packages -->"


def licence_of(name: str) -> str:
    """SPDX expression, classifiers, or the first line of the free text of a package."""
    about = metadata.metadata(name)
    classifiers = [one.split(" :: ")[-1] for one in about.get_all("Classifier") or () if one.startswith("License ::")]
    text = about.get("License-Expression") or ", ".join(classifiers) or about.get("License") or "see the package"
    return text.strip().splitlines()[0]


def table() -> str:
    """Every direct requirement with the part of poise that needs it."""
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    needed: dict[str, list[str]] = {}
    for part, requirements in {"core": project["dependencies"], **project["optional-dependencies"]}.items():
        for requirement in requirements:
            name = re.split(r"[<>=!~\[; ]", requirement)[0].lower()
            if name != "poise":
                needed.setdefault(name, []).append(part)
    rows = ["| package | licence | needed by |", "|---|---|---|"]
    for name, parts in sorted(needed.items()):
        try:
            rows.append(f"| {name} | {licence_of(name)} | {', '.join(parts)} |")
        except metadata.PackageNotFoundError:
            continue
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    if "--update" in sys.argv:
        text = PAGE.read_text(encoding="utf-8")
        begin, end = (text.index(mark) for mark in MARKS)
        PAGE.write_text(text[: begin + len(MARKS[0])] + table() + text[end:], encoding="utf-8")
    else:
        print(table(), end="")
