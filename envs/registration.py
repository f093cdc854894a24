"""The registered environments. Nothing heavy is imported: entry points are strings."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from typing import Any

import gymnasium

from ..filters.support.names import unknown

ENTRY_POINTS: dict[str, str] = {
    "poise/HandMotion-v0": "poise.envs.hand.environment:HandMotionEnv",
    "poise/Replay-v0": "poise.envs.replay:ReplayEnv",
    "poise/BicycleFixture-v0": "poise.envs.bicycle.fixture:BicycleFixtureEnv",
    "poise/RiderBicycle-v0": "poise.envs.bicycle.environment:RiderBicycleEnv",
    "poise/RiderBicycleGain-v0": "poise.envs.ride_gain_tuning:RiderBicycleGainEnv",
    "poise/HandMotionGain-v0": "poise.envs.gain_tuning:HandMotionGainEnv",
    "poise/ReplayGain-v0": "poise.envs.gain_tuning:ReplayGainEnv",
}
"""Id → ``module:class``. Episodes end by themselves (gesture or recording), so no time limit is registered."""

VECTOR_ENTRY_POINTS: dict[str, str] = {
    "poise/Replay-v0": "poise.envs.replay_vector:ReplayVectorEnv",
    "poise/RiderBicycleGain-v0": "poise.envs.ride_gain_tuning:RiderBicycleGainVectorEnv",
    "poise/HandMotionGain-v0": "poise.envs.gain_tuning:HandMotionGainVectorEnv",
    "poise/ReplayGain-v0": "poise.envs.gain_tuning:ReplayGainVectorEnv",
}
"""Id → ``module:class`` of the environments whose episodes are computed together."""


def register_environments() -> None:
    """Register all environments with Gymnasium; calling it again changes nothing."""
    for identity, entry_point in ENTRY_POINTS.items():
        if identity not in gymnasium.registry:
            together = VECTOR_ENTRY_POINTS.get(identity)
            gymnasium.register(id=identity, entry_point=entry_point, vector_entry_point=together)


def make_environment(identity: str, **options: Any) -> gymnasium.Env[Any, Any]:
    """An environment of a registered id.

    Raises:
        ValueError: an unknown id, or whatever else :func:`gymnasium.make` or the environment refuses, in its words.
    """
    register_environments()
    try:
        return gymnasium.make(identity, **options)
    except (gymnasium.error.Error, TypeError, AttributeError) as reason:
        raise ValueError(str(reason).split(" was raised from the environment creator")[0]) from reason


def environment_class(identity: str) -> Any:
    """The class (or function) that makes the environments of a registered id."""
    entry_point = gymnasium.spec(identity).entry_point
    return gymnasium.envs.registration.load_env_creator(entry_point) if isinstance(entry_point, str) else entry_point


def accepted_arguments(identity: str) -> list[str]:
    """Names of the arguments of an environment, also of those that it hands on."""
    return arguments_of_class(environment_class(identity))


def arguments_of_class(kind: Any) -> list[str]:
    """The same of a class: what it hands on goes to its base, or, from a vector environment, to its single one."""
    names: dict[str, None] = {}
    for each in getattr(kind, "__mro__", (kind,)):
        made_by = each if not inspect.isclass(each) else vars(each).get("__init__")
        if made_by is None:
            continue
        parameters = inspect.signature(made_by).parameters
        names |= dict.fromkeys(name for name, one in parameters.items() if one.kind != one.VAR_KEYWORD)
        if all(one.kind != one.VAR_KEYWORD for one in parameters.values()):
            break
        if (single := getattr(kind, "kind", None)) is not None:
            names |= dict.fromkeys(arguments_of_class(single))
            break
    return [name for name in names if name != "self"]


def refuse_unknown_arguments(kind: type, given: Iterable[str]) -> None:
    """Refuse names that a registered environment has no argument for; other classes, as of users, have their own.

    Raises:
        TypeError: one is unknown; the message names environment, argument, the nearest one and all.
    """
    place = f"{kind.__module__}:{kind.__qualname__}"
    registered = (*ENTRY_POINTS.items(), *VECTOR_ENTRY_POINTS.items())
    identity = next((name for name, entry_point in registered if entry_point == place), None)
    if identity is None:
        return
    known = arguments_of_class(kind)
    for name in given:
        if name not in known:
            # Python's own words: TorchRL tries frameskip, and reads them to go on without.
            raise TypeError(f"{identity}: {unknown('argument', name, known, 'unexpected keyword argument')}")


def list_environments() -> tuple[str, ...]:
    """The registered ids."""
    return tuple(ENTRY_POINTS)
