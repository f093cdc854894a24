"""Record episodes of an environment into files, several at a time; call it again to resume after an interruption."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import tyro

from ..filters.support.names import look_up
from ..filters.support.parallel import progress_bar
from .output import Output
from .targets import check_folder


@dataclass
class Args:
    """Arguments of ``poise record``."""

    environment: tyro.conf.Positional[str] = "hand-motion"
    """environment: an id such as poise/HandMotion-v0, or its short form hand-motion"""
    folder: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("recordings")
    """folder of the files; finished episodes of the same kind in it are kept"""
    episodes: int = 10
    """total number of episodes"""
    seed: int = 0
    """root seed; every episode has a separate child"""
    processes: int = 2
    """number of parallel processes"""
    options: tuple[str, ...] = ()
    """arguments of the environment, as name=value (gesture=fast rate=200)"""
    recipe: str | None = None
    """instead of an environment: a recipe of domain randomisation, by name (`poise list recipes`) or as a JSON file"""
    minari: str | None = None
    """write a Minari data set of this name (poise/hand-motion-v0) instead of files"""
    json: bool = False
    """print one JSON document instead of tables"""


def environment_id(name: str) -> str:
    """The registered id of ``hand-motion`` or ``poise/HandMotion-v0``.

    Raises:
        ValueError: there is none; the message lists those that there are.
    """
    import gymnasium

    short = {short_name(id_): id_ for id_ in sorted(gymnasium.registry) if id_.startswith("poise/")}
    return name if name in short.values() else look_up("environment", name, short)


def short_name(env_id: str) -> str:
    """``hand-motion`` of ``poise/HandMotion-v0``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", env_id.split("/")[-1].rsplit("-v", 1)[0]).lower()


def option(text: str) -> tuple[str, Any]:
    """``rate=200`` → ("rate", 200); values that are not Python literals stay text.

    Raises:
        ValueError: there is no ``=``.
    """
    name, sign, value = text.partition("=")
    if not sign or not name:
        raise ValueError(f"an option must be name=value, got {text!r}")
    try:
        return name, ast.literal_eval(value)
    except (ValueError, SyntaxError):
        return name, value


def options_of(texts: Sequence[str]) -> dict[str, Any]:
    """Options by name.

    Raises:
        ValueError: one is not an option, or is named twice.
    """
    found: dict[str, Any] = {}
    for text in texts:
        name, value = option(text)
        if name in found:
            raise ValueError(f"option {name!r} is given twice: {found[name]!r} and {value!r}")
        found[name] = value
    return found


def run(args: Args) -> int:
    """Record and say where the files are."""
    if args.minari is not None:
        return record_minari(args, args.minari)
    check_folder("folder", args.folder)
    record, what = recorder(args)
    with Output("record", args) as out:
        with progress_bar(args.episodes, f"record {what}", "episode") as bar:
            paths = record(
                args.folder,
                episodes=args.episodes,
                seed=args.seed,
                processes=args.processes,
                report=lambda path: bar.update(),
            )
        out.rows({"episode": index, "file": str(path)} for index, path in enumerate(paths))
        out.say(f"{len(paths)} episodes in {args.folder}")
    return 0


def record_minari(args: Args, dataset_id: str) -> int:
    """Play the environment's neutral action and keep the episodes in Minari's folder.

    Raises:
        ValueError: a recipe was given too: its episodes are not those of one environment.
    """
    from ..envs.exchange.minari_data import to_minari
    from ..envs.registration import make_environment

    if args.recipe is not None:
        raise ValueError("--minari keeps episodes of one environment, and a recipe draws another one for each episode")
    env = make_environment(environment_id(args.environment), **options_of(args.options))
    try:
        dataset = to_minari(env, dataset_id, episodes=args.episodes, seed=args.seed, progress=True)
    finally:
        env.close()
    with Output("record", args) as out:
        out.rows([{"dataset": dataset_id, "episodes": dataset.total_episodes, "steps": dataset.total_steps}])
        out.say(f"minari.load_dataset({dataset_id!r}) opens them")
    return 0


def recorder(args: Args) -> tuple[Callable[..., list[Path]], str]:
    """What records episodes of the recipe or environment, and its name.

    Raises:
        ValueError: an unknown recipe, environment or option, or options beside a recipe, which has its own fields.
    """
    if args.recipe is not None:
        from ..envs.recipes.registry import recipe, record_recipe

        if args.options:
            raise ValueError(f"options belong to an environment, but --recipe is {args.recipe}: edit its JSON instead")
        made = recipe(args.recipe)
        return partial(record_recipe, made), made.name
    from ..envs.record import record_episodes
    from ..envs.registration import make_environment

    env_id = environment_id(args.environment)
    options = options_of(args.options)
    # once, here, where a wrong option is explained in one line
    make_environment(env_id, **options).close()
    return partial(record_episodes, env_id, options=options), env_id
