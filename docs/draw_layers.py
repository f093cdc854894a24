"""Draw the layers of the package from its own imports: ``python docs/draw_layers.py`` writes docs/figures/layers.svg.

A box is a folder, or a module that lies beside folders; its color is that of its layer. A line leads down to what a box
imports; a line that a longer way implies is left out.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LAYERS = ("scripts", "baselines", "envs", "filters")
COLORS = {"scripts": "#f2e2c9", "baselines": "#d9e8d3", "envs": "#d4e4f1", "filters": "#e6dcee"}
WIDTH, HEIGHT, GAP, BETWEEN = 130, 28, 10, 24
TOGETHER = {"filters/core": "filters/core+compile", "filters/compile": "filters/core+compile"}
"""Folders whose modules import each other in both directions, though no two of them do."""
SHIPPED = ROOT / "docs" / "figures" / "layers.svg"


def room(parts: tuple[str, ...]) -> str:
    """The box of a module: its folder, at most two levels deep; a module beside folders has a box of its own."""
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
    """Box → boxes that it imports."""
    found: dict[str, set[str]] = {}
    for layer in LAYERS:
        for path in sorted((ROOT / layer).rglob("*.py")):
            own = room(path.relative_to(ROOT).with_suffix("").parts)
            if path.name == "__init__.py":
                continue
            others = {room(parts) for parts in imports(path) if len(parts) > 1}
            found.setdefault(own, set()).update(others - {own})
    return found


def reduced(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """The same graph without the edges that a longer way implies.

    Raises:
        ValueError: boxes import each other in a circle.
    """
    reach: dict[str, set[str]] = {}

    def below(name: str, above: tuple[str, ...] = ()) -> set[str]:
        if name in above:
            raise ValueError(f"boxes import each other: {' > '.join((*above[above.index(name) :], name))}")
        if name not in reach:
            reach[name] = set().union(*({other} | below(other, (*above, name)) for other in sorted(graph[name])))
        return reach[name]

    for name in sorted(graph):
        below(name)
    return {
        name: {other for other in others if not any(other in reach[third] for third in others - {other})}
        for name, others in graph.items()
    }


def rows(graph: dict[str, set[str]]) -> list[list[str]]:
    """Rows of boxes from top to bottom: layer by layer, inside a layer by the longest way down."""
    found = []
    for layer in LAYERS:
        own = {name for name in graph if name.split("/")[0] == layer}
        level: dict[str, int] = {}
        while len(level) < len(own):
            ready = [name for name in own - set(level) if graph[name] & own <= set(level)]
            level |= {name: 1 + max((level[other] for other in graph[name] & own), default=-1) for name in ready}
        for number in sorted(set(level.values()), reverse=True):
            found.append(sorted(name for name in own if level[name] == number))
    return found


def draw() -> str:
    """The picture as SVG."""
    graph = edges()
    lines_down = reduced(graph)
    levels = rows(graph)
    across = max(len(names) for names in levels)
    width, height = across * (WIDTH + GAP) + GAP, len(levels) * (HEIGHT + BETWEEN) + GAP
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        'font-family="sans-serif" font-size="11">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    middle: dict[str, tuple[float, float]] = {}
    for number, names in enumerate(levels):
        left = 0.5 * (width - len(names) * (WIDTH + GAP) + GAP)
        for place, name in enumerate(names):
            middle[name] = (
                left + place * (WIDTH + GAP) + 0.5 * WIDTH,
                GAP + number * (HEIGHT + BETWEEN) + 0.5 * HEIGHT,
            )
    for name, others in sorted(lines_down.items()):
        for other in sorted(others):
            (x0, y0), (x1, y1) = middle[name], middle[other]
            lines.append(f'<line x1="{x0:g}" y1="{y0:g}" x2="{x1:g}" y2="{y1 - 0.5 * HEIGHT:g}" stroke="#888"/>')
    for name, (x, y) in middle.items():
        layer, _, label = name.partition("/")
        box = f'x="{x - 0.5 * WIDTH:g}" y="{y - 0.5 * HEIGHT:g}" width="{WIDTH}" height="{HEIGHT}" rx="4"'
        lines.append(f'<rect {box} fill="{COLORS[layer]}" stroke="#777"/>')
        lines.append(f'<text x="{x:g}" y="{y + 4:g}" text-anchor="middle">{layer}/{label}</text>')
    return "\n".join([*lines, "</svg>", ""])


if __name__ == "__main__":
    SHIPPED.write_text(draw(), encoding="utf-8")
    print(SHIPPED.relative_to(ROOT))
