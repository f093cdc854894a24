"""Lists of names: estimators and their measured errors, environments, sensors, gestures, scenarios, formats.

Each list is read from the table that the package itself uses. Pages of the documentation hold these lists between
``<!-- list: NAME -->`` and ``<!-- end of list -->``; ``--update`` rewrites them.
"""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import tyro

from ..filters.support.names import look_up
from ..filters.support.optional import MissingExtraError
from ..filters.support.rows import markdown_table
from .output import PIPE_WIDTH, Output
from .pages.measured import Rows, benchmark, benchmark_best, benchmark_limits, learned, riders, riders_best

BEGIN, END = "<!-- list: {} -->", "<!-- end of list -->"
PLACED = re.compile(r"<!-- list: ([a-z-]+) -->\n.*?<!-- end of list -->", re.DOTALL)
"""A list in a page, with its name."""
TITLE_WIDTH = 14
"""Characters of the column of titles in the overview."""


@dataclass
class Args:
    """Arguments of ``poise list``."""

    lists: tyro.conf.Positional[tuple[str, ...]] = ()
    """names of lists; without one the names in all lists are printed"""
    markdown: bool = False
    """print Markdown tables, of all lists if none is named"""
    update: tuple[Path, ...] = ()
    """pages in which the lists are replaced, such as docs/*.md"""
    weights: tuple[Path, ...] = ()
    """for the list `learned`: files of trained weights, or folders that are searched for them, instead of the
    shipped ones; trainings of one preset are in one row"""
    environments: Path | None = None
    """folder to which the page of every environment is written, such as docs/environments"""
    json: bool = False
    """print one JSON document, of all lists if none is named"""


def run(args: Args) -> int:
    """Print the lists, or write them into pages."""
    chosen = {name: look_up("list", name, LISTS) for name in args.lists or LISTS}
    for page in args.update:
        page.write_text(updated(page.read_text(encoding="utf-8")), encoding="utf-8")
    if args.environments is not None:
        from .pages.environments import write_pages

        write_pages(args.environments)
    if args.update or args.environments is not None:
        return 0
    if not (args.lists or args.markdown or args.json):
        print(overview(shutil.get_terminal_size((PIPE_WIDTH, 24)).columns))
        return 0
    with Output("list", args) as out:
        for name, rows in chosen.items():
            if args.markdown and not args.json:
                out.say(f"{placed(name)}\n")
            else:
                found = learned(args.weights) if name == "learned" else rows()
                shown = [key for row in found[:1] for key in row if key not in ("channels", "outputs", "source")]
                out.rows(found, name)
                out.show(found, name, shown)
    return 0


def overview(width: int) -> str:
    """The names of everything, without descriptions, in lines of ``width`` characters, and which lists hold results."""
    lines = [wrapped(name, [row["name"] for row in LISTS[name]()], width) for name in LISTS if name not in MEASURED]
    lines += ["", wrapped("measured", MEASURED, width), "", "poise list NAME prints a list with descriptions or values"]
    return "\n".join(lines)


def wrapped(title: str, names: Iterable[str], width: int) -> str:
    """Names in lines that stand beside a title; a name is never broken."""
    text = ", ".join(name.replace(" ", "\0") for name in names)
    indent = " " * TITLE_WIDTH
    return textwrap.fill(
        text,
        width,
        initial_indent=f"{title:<{TITLE_WIDTH}}",
        subsequent_indent=indent,
        break_on_hyphens=False,
        break_long_words=False,
    ).replace("\0", " ")


def placed(name: str) -> str:
    """One list in Markdown with the marks around it."""
    rows = [{**row, "name": f"`{row['name']}`"} for row in LISTS[name]()]
    return f"{BEGIN.format(name)}\n{markdown_table(rows)}\n{END}"


def updated(page: str) -> str:
    """The text of a page with updated lists.

    Raises:
        ValueError: the page marks a list that does not exist.
    """
    unknown = sorted(set(PLACED.findall(page)) - set(LISTS))
    if unknown:
        raise ValueError(f"unknown lists {unknown}; there are {sorted(LISTS)}")
    return PLACED.sub(lambda found: placed(found[1]), page)


def estimators() -> Rows:
    """Every estimator: kind, what it is, channels, outputs, source."""
    from ..baselines.registry import list_estimators

    return [
        {
            "name": info.name,
            "kind": info.kind,
            "description": info.description,
            "channels": short(info.channels),
            "outputs": short(info.outputs),
            "source": info.source,
        }
        for info in list_estimators().values()
    ]


def environments() -> Rows:
    """Every environment with the first sentence of its specification."""
    import importlib

    from ..envs import ENTRY_POINTS

    rows = []
    for name, place in ENTRY_POINTS.items():
        module, kind = place.split(":")
        try:
            described = first_sentence(getattr(importlib.import_module(module), kind).__doc__)
        except MissingExtraError as reason:
            described = str(reason)
        rows.append({"name": name, "description": described})
    return rows


def sensors() -> Rows:
    """Every preset of a sensor: a device by its data sheet, or the errors of a published study."""
    from ..envs.hand.devices import ARRAY_PRESETS
    from ..envs.sensors.presets import PRESETS

    kinds = ((PRESETS, "inertial sensor"), (ARRAY_PRESETS, "accelerometer array"))
    return [{"name": each.name, "kind": kind, "description": each.source} for some, kind in kinds for each in some]


def sensor_drift() -> Rows:
    """The Allan deviation of every preset of a device at 1000 s, °/h and µg, and which of its errors are assumed."""
    from ..envs.sensors.allan import allan_floors

    return allan_floors()


def timings() -> Rows:
    """Every named timing of devices: ms, ppm and bursts of lost packets a second."""
    from ..envs.sensors.timing import TIMINGS

    return [
        {
            "name": name,
            "delay (ms)": 1e3 * each.delay,
            "jitter (ms)": 1e3 * each.jitter,
            "clock drift (ppm)": 1e6 * each.clock_drift,
            "lost packets (1/s)": each.burst_rate,
        }
        for name, each in TIMINGS.items()
    ]


def magnetics() -> Rows:
    """Every named disturbance of the magnetic field with the fields that differ from their defaults."""
    from ..envs.sensors.magnetics import MAGNETICS

    calm = MAGNETICS["undisturbed"].describe()
    changed = {name: {k: v for k, v in each.describe().items() if v != calm[k]} for name, each in MAGNETICS.items()}
    return [
        {"name": name, "fields": ", ".join(f"{k} {v:g}" for k, v in fields.items()) or None}
        for name, fields in changed.items()
    ]


def sensor_kinds() -> Rows:
    """Every kind of sensor that a preset or a user may give by name."""
    from ..envs.sensors.kinds import KINDS

    return [
        {
            "name": name,
            "channel": f"…/{kind.suffix}",
            "values": kind.size,
            "unit": kind.unit or None,
            "full scale": kind.full_scale if kind.unit else None,
            "description": kind.description,
        }
        for name, kind in KINDS.items()
    ]


def gestures() -> Rows:
    """Every motion of a hand with the first sentence of its configuration."""
    from ..envs.hand.everyday import SUMMARIES
    from ..envs.hand.gestures import GESTURES

    described = {name: SUMMARIES.get(name) or first_sentence(type(each).__doc__) for name, each in GESTURES.items()}
    return [{"name": name, "description": words} for name, words in described.items()]


def scenarios() -> Rows:
    """Every scenario of a ride."""
    from ..envs.bicycle.course.scenarios import SCENARIOS

    return [{"name": name, "description": each.summary} for name, each in SCENARIOS.items()]


def surfaces() -> Rows:
    """Every road surface of a ride, from smooth to rough."""
    from ..envs.bicycle.course.surfaces import SURFACES

    return [
        {
            "name": name,
            "description": each.summary,
            "G(0.1 cycles/m), 1e-6 m³": round(1e6 * each.roughness, 3),
            "waviness": each.waviness,
            "stones, m": each.stone or None,
            "relief, mm": 1e3 * each.relief or None,
        }
        for name, each in SURFACES.items()
    ]


def recipes() -> Rows:
    """Every recipe of domain randomisation."""
    from ..envs.recipes.registry import RECIPES

    return [{"name": name, "kind": each.kind, "description": each.summary} for name, each in RECIPES.items()]


def presets() -> Rows:
    """Every network that `poise train` trains."""
    from ..baselines.learned.gains.presets import all_presets

    return [{"name": name, "description": each.summary} for name, each in all_presets().items()]


def formats() -> Rows:
    """Every file format that :func:`poise.load_recording` reads."""
    from ..envs.data.formats.load import FORMATS

    return [{"name": each.name, "description": first_sentence(each.load.__doc__)} for each in FORMATS]


LISTS: Mapping[str, Callable[[], Rows]] = {
    function.__name__.replace("_", "-"): function
    for function in (
        *(estimators, environments, sensors, sensor_drift, timings, magnetics, sensor_kinds, gestures, scenarios),
        *(surfaces, recipes, presets, learned, formats),
    )
} | {
    "benchmark": benchmark,
    "benchmark-best": benchmark_best,
    "benchmark-heading": partial(benchmark, "heading"),
    "benchmark-limits": benchmark_limits,
    "riders": riders,
    "riders-best": riders_best,
    "riders-consistency": partial(riders, "consistency"),
    "riders-bound": partial(riders, "bound"),
}
"""Name → rows."""
MEASURED = ("sensor-drift", "learned", *(name for name in LISTS if name.startswith(("benchmark", "riders"))))
"""Lists of measured values rather than of what can be used by name."""


def first_sentence(text: str | None) -> str:
    """The first sentence of a docstring, on one line."""
    paragraph = " ".join((text or "").strip().split("\n\n")[0].split())
    sentence = re.split(r"(?<=\.)\s", paragraph)[0].rstrip(".")
    return re.sub(r":\w+:`[~.]*([^`]+)`", r"`\1`", sentence).replace("``", "`")


def short(names: Iterable[str]) -> str:
    """Names on one line; ``imu/`` is understood, and both sides of a body are one name."""
    seen = [re.sub(r"_(left|right)(?=/)", "_{left,right}", name.removeprefix("imu/")) for name in names]
    return ", ".join(dict.fromkeys(seen))
