"""A page for each environment, in the form of Gymnasium's own documentation, from the class and its docstring."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from ...filters.support.files import write_text
from ...filters.support.rows import markdown_table

HEADINGS = {
    "action space": "Action Space",
    "observation space": "Observation Space",
    "reward": "Rewards",
    "rewards": "Rewards",
    "start and end": "Starting State and Episode End",
    "info": "Info",
    "version history": "Version History",
}
"""Heading of a docstring, in small letters → heading of the page; others are kept."""
NOTE = "<!-- Written by `poise list --environments docs/environments` from the docstring of the class. -->"
ROLE = re.compile(r":\w+:`(?:[^`<]*<)?[~.]*([^`>]+)>?`")
ARGUMENT = re.compile(r"^(\w+): (.*)$")


def write_pages(folder: Path) -> list[Path]:
    """Write the page of every environment, and remove pages of environments that are no more."""
    from ...envs import list_environments

    written = [write_text(folder / name_of(identity), page(identity)) for identity in list_environments()]
    for stale in set(folder.glob("*.md")) - set(written):
        stale.unlink()
    return written


def name_of(identity: str) -> str:
    """``HandMotion-v0.md`` of ``poise/HandMotion-v0``."""
    return f"{identity.split('/')[-1]}.md"


def page(identity: str) -> str:
    """The page of an environment with its default arguments."""
    from ...envs.registration import VECTOR_ENTRY_POINTS, environment_class, make_environment

    kind = environment_class(identity)
    env = make_environment(identity)
    sections = dict(sections_of(kind))
    native = identity in VECTOR_ENTRY_POINTS
    many = f'`gymnasium.make_vec("{identity}", num_envs)`, ' + ("computed together" if native else "one by one")
    facts = [
        {"": "Action space", " ": f"`{short(env.action_space)}`"},
        {"": "Observation space", " ": f"`{short(env.observation_space)}`"},
        {"": "Made by", " ": f'`gymnasium.make("{identity}")`'},
        {"": "Many episodes", " ": many},
        {"": "Class", " ": f"`{kind.__module__}.{kind.__name__}`"},
    ]
    parts = [f"# {identity}", NOTE, sections.pop("", ""), markdown_table(facts)]
    if "Description" in sections:
        parts += ["## Description", sections.pop("Description")]
    for heading, space in (("Action Space", env.action_space), ("Observation Space", env.observation_space)):
        parts += [
            f"## {heading}",
            sections.pop(heading, ""),
            "With the default arguments:",
            markdown_table(rows_of(space)),
        ]
    env.close()
    written = sections.pop("Arguments", "")
    history = sections.pop("Version History", "")
    for heading, text in sections.items():
        parts += [f"## {heading}", text]
    parts += ["## Arguments", written, markdown_table(arguments_of(kind))]
    if (scores := reference_table(identity)) is not None:
        parts += ["## Reference Scores", scores]
    parts += ["## Version History", history]
    return "\n\n".join(part for part in parts if part) + "\n"


def sections_of(kind: type) -> Iterator[tuple[str, str]]:
    """Headings and texts of a docstring in Markdown; the text before the first heading has none.

    Of the section on arguments only the text besides their list remains (see :func:`arguments_of`).
    """
    text = inspect.getdoc(kind) or ""
    first, *others = re.split(r"^## +(.+)$", text, flags=re.MULTILINE)
    yield "", markdown(first.strip())
    for heading, body in zip(others[::2], others[1::2], strict=True):
        kept = re.split(r"^(?:Args|Raises):\n", body, maxsplit=1, flags=re.MULTILINE)[0]
        yield HEADINGS.get(heading.strip().lower(), heading.strip()), markdown(kept.strip())


def markdown(text: str) -> str:
    """Markdown of a docstring: roles and double backticks become code."""
    return ROLE.sub(r"`\1`", text).replace("``", "`")


def described(kind: type) -> dict[str, str]:
    """Argument → what the docstrings of a class and of its bases say of it; the class comes first."""
    found: dict[str, str] = {}
    for each in kind.__mro__:
        listed = re.search(r"^Args:\n((?:    .*\n?|\n)+)", inspect.cleandoc(each.__doc__ or ""), flags=re.MULTILINE)
        name = None
        for line in listed[1].splitlines() if listed else ():
            if (start := ARGUMENT.match(line[4:])) is not None:
                name = None if start[1] in found else start[1]
                if name is not None:
                    found[name] = start[2]
            elif name is not None:
                found[name] += f" {line.strip()}"
    return {name: markdown(text) for name, text in found.items()}


def arguments_of(kind: type) -> list[dict[str, Any]]:
    """Every argument of an environment, also those that it hands on to its bases, with its default."""
    texts = described(kind)
    rows: dict[str, dict[str, Any]] = {}
    for each in kind.__mro__:
        parameters = inspect.signature(each.__init__).parameters  # type: ignore[misc]
        for name, one in parameters.items():
            if name != "self" and one.kind not in (one.VAR_KEYWORD, one.VAR_POSITIONAL):
                # a long one by its type
                text = repr(one.default) if len(repr(one.default)) <= 40 else f"{type(one.default).__name__}(…)"
                default = None if one.default is one.empty else f"`{text}`"
                rows.setdefault(name, {"argument": f"`{name}`", "default": default, "meaning": texts.get(name)})
        if all(one.kind != one.VAR_KEYWORD for one in parameters.values()):
            break
    return list(rows.values())


def short(space: spaces.Space[Any]) -> str:
    """A space on one line."""
    if isinstance(space, spaces.Dict):
        return f"Dict of {len(space.spaces)}: {', '.join(space.spaces)}"
    if isinstance(space, spaces.Box):
        return f"Box({bound(space.low)}, {bound(space.high)}, {space.shape}, {space.dtype})"
    return str(space)


def rows_of(space: spaces.Space[Any]) -> list[dict[str, Any]]:
    """Keys, shapes and bounds of a space."""
    parts = space.spaces.items() if isinstance(space, spaces.Dict) else [("", space)]
    rows = []
    for name, each in parts:
        row = {"key": f"`{name}`"} if name else {}
        row |= {"shape": str(each.shape), "type": str(each.dtype)}
        low, high = (bound(each.low), bound(each.high)) if isinstance(each, spaces.Box) else ("0", "1")
        rows.append(row | {"low": low, "high": high})
    return rows


def bound(values: np.ndarray) -> str:
    """One number where all are equal, else the least and the greatest."""
    low, high = float(values.min()), float(values.max())
    return f"{low:.5g}" if low == high else f"{low:.5g} … {high:.5g}"


def reference_table(identity: str) -> str | None:
    """Errors of reference policies in Markdown; None where an environment has none."""
    from ...baselines.gain_policy.scores import RECORDED, REPLAY, SCORES, normalized_score

    sets = dict(RECORDED) if identity == REPLAY else {None: SCORES[identity]} if identity in SCORES else {}
    if not sets:
        return None
    meanings = {
        "random": "actions drawn evenly",
        "neutral": "the published gains",
        "constant": "the best constant gains of the training episodes",
        "oracle": "the best constant gains of each test episode, chosen with the truth known",
    }
    if identity == REPLAY:
        meanings["constant"] = "the best constant gains of all other recordings"
    rows = [
        {**({"data": data} if data else {}), "policy": meaning, "error (deg)": error, "score": score}
        for data, scores in sets.items()
        for name, meaning in meanings.items()
        for error in [getattr(scores, name)]
        for score in [round(normalized_score(identity, error, data), 3)]
    ]
    said = (
        "Mean over test episodes of the RMS error with the default arguments, and "
        f'`poise.normalized_score("{identity}", error{", data" if identity == REPLAY else ""})`:'
    )
    return f"{said}\n\n{markdown_table(rows)}"
