"""The architecture page: its picture is that of the package's imports, and a sample passes the files that it names."""

import importlib.util
import re
import sys
from functools import cache
from pathlib import Path
from types import FrameType

from poise.baselines.evaluation import evaluate
from poise.baselines.plots import rms_bars, save
from poise.envs.hand.environment import HandMotionEnv
from poise.envs.record import record_once

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"


def test_the_picture_is_drawn_from_the_imports() -> None:
    spec = importlib.util.spec_from_file_location("draw_layers", ROOT / "docs" / "draw_layers.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.edges = cache(module.edges)
    drawn = module.draw()
    assert module.SHIPPED.read_text(encoding="utf-8") == drawn, "python docs/draw_layers.py draws it anew"
    graph = module.edges()
    place = {name: row for row, (_, boxes) in enumerate(module.rows(graph)) for names in boxes for name in names}
    assert set(place) == set(graph)
    for name, others in graph.items():
        # modules of one box may import each other
        assert all(place[other] > place[name] - (module.label(other)[-1] != "/") for other in others), name


def test_a_sample_passes_the_files_of_the_page(tmp_path: Path) -> None:
    section = PAGE.read_text(encoding="utf-8").split("## The path of a sample")[1].split("## ")[0]
    named = re.findall(r"^\| `(\S+\.py)` \|", section, flags=re.MULTILINE)
    entered: set[str] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        entered.add(frame.f_code.co_filename)

    def follow() -> None:
        episode = record_once(HandMotionEnv("fast", "dynamic", duration=1.0), 0)
        table = evaluate(["external-acceleration"], [episode], check=False)
        save(rms_bars(table, {}, "inclination", "hand"), tmp_path / "bars.png")

    follow()  # imports and compiles, which would take minutes under the profiler
    sys.setprofile(note)
    try:
        follow()
    finally:
        sys.setprofile(None)
    assert 10 <= len(named) <= 15
    assert [name for name in named if str(ROOT / name) not in entered] == []
