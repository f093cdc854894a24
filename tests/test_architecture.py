"""The picture of the architecture page is that of the package's imports."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_the_picture_is_drawn_from_the_imports() -> None:
    spec = importlib.util.spec_from_file_location("draw_layers", ROOT / "docs" / "draw_layers.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    drawn = module.draw()
    assert module.SHIPPED.read_text(encoding="utf-8") == drawn, "python docs/draw_layers.py draws it anew"
    assert drawn.count("<rect") == len(module.edges()) + 1
