"""Draw the layers of the package from its own imports: ``python docs/draw_layers.py`` writes docs/figures/layers.svg.

A box is a folder, or a module that lies beside folders. A row holds boxes that need only what lies below it; the arrows
at the right margin say which rows a row imports.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LAYERS = ("scripts", "baselines", "envs", "filters")
COLORS = {"scripts": "#f2e2c9", "baselines": "#d9e8d3", "envs": "#d4e4f1", "filters": "#e6dcee"}
WIDTH, HEIGHT, GAP, LABEL, MARGIN = 118, 30, 8, 20, 90
SHIPPED = ROOT / "docs" / "figures" / "layers.svg"


def room(parts: tuple[str, ...]) -> str:
    """The box of a module: its folder, at most two levels deep; a module beside folders has a box of its own."""
    return "scripts" if parts[0] == "scripts" else "/".join(parts[:2])


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


def rows(graph: dict[str, set[str]]) -> list[list[str]]:
    """Boxes by the length of the longest way down, lowest first.

    Raises:
        ValueError: folders import each other in a circle.
    """
    level: dict[str, int] = {}

    def depth(name: str, above: tuple[str, ...]) -> int:
        if name in above:
            raise ValueError(f"folders import each other: {' > '.join((*above[above.index(name) :], name))}")
        if name not in level:
            level[name] = 1 + max((depth(other, (*above, name)) for other in sorted(graph[name])), default=-1)
        return level[name]

    for name in sorted(graph):
        depth(name, ())
    return [sorted(name for name in level if level[name] == number) for number in range(max(level.values()) + 1)]


def draw() -> str:
    """The picture as SVG."""
    graph = edges()
    levels = rows(graph)[::-1]
    where = {name: number for number, names in enumerate(levels) for name in names}
    across = max(len(names) for names in levels)
    width = across * (WIDTH + GAP) + GAP + MARGIN
    height = len(levels) * (HEIGHT + LABEL) + GAP
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        'font-family="sans-serif" font-size="11">',
        '<defs><marker id="head" markerWidth="6" markerHeight="6" refX="5" refY="3" orient="auto">'
        '<path d="M0,0 L6,3 L0,6 Z" fill="#777"/></marker></defs>',
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for number, names in enumerate(levels):
        y = GAP + number * (HEIGHT + LABEL)
        for place, name in enumerate(names):
            x = GAP + place * (WIDTH + GAP)
            fill = COLORS[name.split("/")[0]]
            lines.append(
                f'<rect x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="4" fill="{fill}" stroke="#999"/>'
            )
            lines.append(f'<text x="{x + WIDTH / 2}" y="{y + 19}" text-anchor="middle">{name}</text>')
        reached = sorted({where[other] for name in names for other in graph[name]})
        for step, target in enumerate(reached):
            x = width - MARGIN + 4
            start, stop = y + HEIGHT / 2, GAP + target * (HEIGHT + LABEL) + HEIGHT / 2
            bend = x + 6 + 78 * (target - number) / len(levels)
            lines.append(
                f'<path d="M{x},{start} C{bend:.0f},{start} {bend:.0f},{stop} {x},{stop}" fill="none" stroke="#777" '
                f'stroke-width="0.8" opacity="{0.9 - 0.5 * step / max(len(reached), 2):.2f}" marker-end="url(#head)"/>'
            )
    return "\n".join([*lines, "</svg>", ""])


if __name__ == "__main__":
    SHIPPED.write_text(draw(), encoding="utf-8")
    print(SHIPPED.relative_to(ROOT))
