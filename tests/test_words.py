"""Pages, docstrings and comments use the field's terms, not a dialect of their own."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from pathlib import Path

from .source import FILES, ROOT, name_of, tree_of

PAGES = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
TERMS = {
    r"differs? from print|\b(?:is|as|in|of) print\b|which print\b|print (?:has|lacks|leaves)": "as published, errata",
    r"\bas printed|the printed (?:form|sign|first|filter|one|version)": "as published",
    r"\b(?:tell|say)s? (?:a|the|its|the true) pose\b|\btold (?:who|so)\b": "output a pose; configured with",
    r"\bmeets? (?:the|a) ride\b|never meet": "bind to a recording; decoupled",
    r"what everybody knows": "baseline, classical reference",
    r"with the face of|public face": "with the interface of; public names",
    r"\b(?:four|five|upper|lower) floors\b|\bfloor (?:above|below)\b|\bthe house\b": "package, layers",
    r"nervous system|by heart": "control model; lookup table; memorise",
    r"\b(?:a|an?other|all|at|each|every|per) ticks?\b": "sample, time step",
    r"exceeded_with": "norm.isf",
    r"corrects? nothing": "measurement update skipped",
    r"(?<!rider )starts by itself": "self-initialises",
    r"brought (?:a|no) sample": "had a valid sample",
    r"hands? of every temper": "domain randomisation",
    r"upward vertical": "inclination vector, gravity direction",
    r"(?:rides?|bicycle) in numbers\b": "statistics",
    r"loop gaps?": "loop-closure error",
    r"errors? that lasts?\b": "time-correlated errors",
    r"\b(?:that|which|it) (?:is|are) no (?!longer|more|less|worse|better|different|further|other)[a-z]": "is not a",
}
"""Pattern of words that are not the field's → what is."""
PLAIN = {pattern: re.compile(pattern, re.IGNORECASE) for pattern in TERMS}


def prose_of(path: Path) -> str:
    """The text of a page without its code, or the docstrings and comments of a module."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return re.sub(r"```.*?```|`[^`]*`", "", text, flags=re.DOTALL)
    strings = [
        node.value.value
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    ]
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    comments = [token.string for token in tokens if token.type == tokenize.COMMENT]
    return "\n\n".join([*strings, *comments])


def found_in(prose: str) -> list[str]:
    """Each use of a word that is not the field's, with the term that is."""
    prose = " ".join(prose.split())
    return [
        f"{prose[max(0, match.start() - 40) : match.end() + 20]!r}: {TERMS[pattern]}"
        for pattern, compiled in PLAIN.items()
        for match in compiled.finditer(prose)
    ]


def test_words_are_those_of_the_field() -> None:
    # a file without these words anywhere need not be taken apart, which is slow
    written = [path for path in [*PAGES, *FILES] if found_in(path.read_text(encoding="utf-8"))]
    found = {name_of(path): found_in(prose_of(path)) for path in written}
    assert {name: words for name, words in found.items() if words} == {}


def test_the_dialect_is_seen_and_the_field_is_not() -> None:
    assert found_in("Differs from print: the sign.")
    assert found_in("a body that is no bicycle")
    assert not found_in("There is no sample, the noise floor is low, and it is no longer held.")
