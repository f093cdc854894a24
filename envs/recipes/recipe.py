"""What all recipes share: JSON to and from, episodes by seed and index."""

from __future__ import annotations

import types
import typing
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from ...filters.support.names import unknown
from ...filters.support.parameters import annotations_of
from ...filters.support.ranges import Checked
from ..data.trajectory import Trajectory

T = TypeVar("T")


@dataclass(frozen=True)
class Recipe(Checked):
    """A distribution of episodes of one environment.

    Episode ``index`` of a data set of root ``seed`` is a function of the recipe, the seed and the index alone, bit for
    bit. It carries all three in ``metadata["recipe"]``.
    """

    kind: ClassVar[str]
    """``hand`` or ``rider``"""

    name: str = "custom"
    """of the recipe; the shipped ones are in :data:`poise.envs.recipes.registry.RECIPES`"""

    def draw(self, seed: int | np.random.SeedSequence, name: str = "randomised") -> Trajectory:
        """Simulate one episode from its seed; ``name`` goes into the metadata."""
        raise NotImplementedError

    def episode(self, seed: int, index: int, name: str | None = None) -> Trajectory:
        """Episode ``index`` of the data set of root ``seed``, by default named ``<recipe>-<seed>-<index>``.

        Raises:
            ValueError: a negative number.
        """
        for what, value in (("seed", seed), ("index", index)):
            if value < 0:
                raise ValueError(f"{what} must be 0 or more, got {value}")
        child = np.random.SeedSequence(seed, spawn_key=(index,))
        trajectory = self.draw(child, f"{self.name}-{seed}-{index}" if name is None else name)
        origin = {"definition": self.describe(), "seed": int(seed), "index": int(index)}
        return trajectory.replace(metadata=trajectory.metadata | {"recipe": origin})

    def draw_many(self, seed: int, count: int) -> list[Trajectory]:
        """The first episodes of the data set of root ``seed``; a larger ``count`` keeps the first ones."""
        return [self.episode(seed, index) for index in range(count)]

    def describe(self) -> dict[str, Any]:
        """All fields, for JSON; the inverse is :meth:`read`."""
        return {"kind": self.kind, **lists(asdict(self))}

    @classmethod
    def read(cls, described: Mapping[str, Any]) -> Self:
        """The recipe that :meth:`describe` gave; fields that are missing have their defaults.

        Raises:
            ValueError: an unknown field, or a value that is not accepted; the message names it.
        """
        return built(cls, {name: value for name, value in described.items() if name != "kind"}, "recipe")


def unspawned(seed: int | np.random.SeedSequence) -> np.random.SeedSequence:
    """A seed sequence of which no child was taken yet, so that drawing twice from one gives the same episode."""
    if isinstance(seed, np.random.SeedSequence):
        return np.random.SeedSequence(seed.entropy, spawn_key=seed.spawn_key, pool_size=seed.pool_size)
    return np.random.SeedSequence(seed)


def lists(value: Any) -> Any:
    """Tuples as lists, at any depth, as JSON would give them back."""
    if isinstance(value, Mapping):
        return {name: lists(item) for name, item in value.items()}
    return [lists(item) for item in value] if isinstance(value, tuple | list) else value


def tuples(value: Any) -> Any:
    """Lists as tuples, at any depth."""
    return tuple(tuples(item) for item in value) if isinstance(value, list | tuple) else value


def built(cls: type[T], described: Any, where: str) -> T:
    """A frozen dataclass, and those in its fields, from mappings; ``where`` are words before a field in messages.

    Raises:
        ValueError: not a mapping, an unknown field, or a value that the class rejects.
    """
    if not isinstance(described, Mapping):
        raise ValueError(f"{where} must be a mapping from field to value, got {described!r}")
    names = [field.name for field in fields(cls)]  # type: ignore[arg-type]
    for name in described:
        if name not in names:
            raise ValueError(f"{where}: {unknown('field', name, names)}")
    hints = annotations_of(cls)  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for name, value in described.items():
        part = dataclass_in(hints[name])
        if part is None or (value is None and type(None) in typing.get_args(hints[name])):
            values[name] = tuples(value)
        else:
            values[name] = built(part, value, f"{where}.{name}")
    try:
        return cls(**values)
    except (TypeError, ValueError) as reason:
        raise ValueError(f"{where}: {reason}") from None


def dataclass_in(hint: Any) -> type[Any] | None:
    """The dataclass that an annotation names, alone or as ``X | None``; None where it names none."""
    choices = typing.get_args(hint) if typing.get_origin(hint) in (typing.Union, types.UnionType) else (hint,)
    return next((each for each in choices if isinstance(each, type) and is_dataclass(each)), None)


def chosen(generator: np.random.Generator, values: tuple[Any, ...]) -> Any:
    """One of the values, all of them equally likely."""
    return values[int(generator.integers(len(values)))]


def check_some(name: str, values: tuple[Any, ...], known: tuple[Any, ...] | None = None) -> None:
    """Refuse an empty choice, and one of what is not known.

    Raises:
        ValueError: with the name, and what is accepted.
    """
    if not values:
        raise ValueError(f"{name} must hold one name at least, got none")
    for value in values:
        if known is not None and value not in known:
            raise ValueError(f"{name} must be among {list(known)}, got {value!r}")
