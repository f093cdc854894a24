"""Draw the layers of the package from its own imports: ``python docs/draw_layers.py`` writes docs/figures/layers.svg.

A row imports from the rows below it only. A box is a folder, or all modules beside the folders of a layer that stand
between the same rows.
"""

from __future__ import annotations

import ast
import textwrap
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LAYERS = ("scripts", "baselines", "envs", "filters")
COLORS = {"scripts": "#f2e2c9", "baselines": "#d9e8d3", "envs": "#d4e4f1", "filters": "#e6dcee"}
WIDTH, LABEL, GAP, LINE, LETTER = 760, 100, 8, 16, 6.4
"""Width of the picture and of the names of layers, distances, height of a line of text, width of a letter, px."""
TOGETHER = {"filters/core": "filters/core, compile", "filters/compile": "filters/core, compile"}
"""Folders whose modules import each other in both directions, though no two of them do."""
SHIPPED = ROOT / "docs" / "figures" / "layers.svg"


def room(parts: tuple[str, ...]) -> str:
    """Layer and folder of a module, or the module itself where it lies beside folders."""
    name = "scripts" if parts[0] == "scripts" else "/".join(parts[:2])
    return TOGETHER.get(name, name)


def imports(path: Path) -> Iterator[tuple[str, ...]]:
    """Dotted parts of every module of the package that a file imports, also inside functions."""
    package = path.relative_to(ROOT).parent.parts
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = package[: len(package) - (node.level - 1)] + tuple(
                (node.module or "").split(".") * bool(node.module)
            )
            for alias in node.names:
                parts = (*base, alias.name)
                yield parts if ROOT.joinpath(*parts).with_suffix(".py").is_file() else base


def edges() -> dict[str, set[str]]:
    """Folder or module → folders and modules that it imports."""
    found: dict[str, set[str]] = {}
    for layer in LAYERS:
        for path in sorted((ROOT / layer).rglob("*.py")):
            own = room(path.relative_to(ROOT).with_suffix("").parts)
            if path.name == "__init__.py":
                continue
            others = {room(parts) for parts in imports(path) if len(parts) > 1}
            found.setdefault(own, set()).update(others - {own})
    return found


def heights(graph: dict[str, set[str]]) -> dict[str, float]:
    """Rank of everything in its layer: whole for folders, half a step above the highest folder used for modules.

    Raises:
        ValueError: folders import each other in a circle.
    """
    modules = {name for name in graph if (ROOT / f"{name}.py").is_file()}
    found: dict[str, float] = {}

    def height(name: str, above: tuple[str, ...] = ()) -> float:
        if name in above:
            raise ValueError(f"imports in a circle: {' > '.join((*above[above.index(name) :], name))}")
        if name not in found:
            layer = name.split("/")[0]
            used = [height(other, (*above, name)) for other in sorted(graph[name]) if other.split("/")[0] == layer]
            highest = max(used, default=-0.5)
            # a module keeps the half step of the modules that it uses; a folder stands on the next whole one
            half = highest % 1 == 0.5
            found[name] = highest + 0.5 * (not half) if name in modules else highest + (0.5 if half else 1.0)
        return found[name]

    for name in sorted(graph):
        height(name)
    return found


def rows(graph: dict[str, set[str]]) -> list[tuple[str, list[list[str]]]]:
    """Layer and boxes, each a list of names, of every row from top to bottom."""
    rank = heights(graph)
    found = []
    for layer in LAYERS:
        own = sorted(name for name in graph if name.split("/")[0] == layer)
        for number in sorted({rank[name] for name in own}, reverse=True):
            names = [name for name in own if rank[name] == number]
            found.append((layer, [names] if number % 1 == 0.5 else [[name] for name in names]))
    return found


def label(name: str) -> str:
    """What a box says: folders with a slash at the end."""
    inside = name.partition("/")[2] or name
    return inside if (ROOT / f"{name}.py").is_file() else inside.replace(",", "/,") + "/"


def draw() -> str:
    """The picture as SVG."""
    boxes, y, tops = [], float(GAP), dict.fromkeys(LAYERS, 0.0)
    last = ""
    for layer, row in rows(edges()):
        if layer != last:
            y += GAP
            tops[layer], last = y, layer
            y += GAP
        texts = [textwrap.wrap(", ".join(map(label, names)), 96) for names in row]
        size = max(map(len, texts)) * LINE + GAP
        wide = [max(map(len, text)) * LETTER + 2 * GAP for text in texts]
        x = LABEL + 0.5 * (WIDTH - LABEL - sum(wide) - GAP * (len(wide) - 1))
        for text, width in zip(texts, wide, strict=True):
            boxes.append(
                f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{size:g}" rx="4" fill="white" stroke="#777"/>'
            )
            boxes += [
                f'<text x="{x + 0.5 * width:g}" y="{y + 0.5 * GAP + (number + 0.75) * LINE:g}" text-anchor="middle">'
                f"{line}</text>"
                for number, line in enumerate(text)
            ]
            x += width + GAP
        y += size + GAP
    bands = []
    for layer, below in zip(LAYERS, [*list(tops.values())[1:], y + GAP], strict=True):
        top, size = tops[layer], below - tops[layer] - GAP
        bands.append(f'<rect x="0" y="{top:g}" width="{WIDTH}" height="{size:g}" rx="6" fill="{COLORS[layer]}"/>')
        bands.append(f'<text x="{GAP}" y="{top + 0.5 * size + 5:g}" font-size="15" font-weight="bold">{layer}</text>')
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {y + GAP:g}" font-family="sans-serif" '
            'font-size="12">',
            f'<rect width="{WIDTH}" height="{y + GAP:g}" fill="white"/>',
            *bands,
            *boxes,
            "</svg>",
            "",
        ]
    )


if __name__ == "__main__":
    SHIPPED.write_text(draw(), encoding="utf-8")
    print(SHIPPED.relative_to(ROOT))
