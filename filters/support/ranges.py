"""Ranges from which recipes and gestures draw, and the checks of their fields."""

from __future__ import annotations

import math
import typing
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from .parameters import annotations_of, check_parameters

Range = tuple[float, float]
"""Lowest and highest value, both above zero: drawn from log-uniformly"""


def log_uniform(generator: np.random.Generator, bounds: Range) -> float:
    """Log-uniform random number between two positive bounds."""
    return float(np.exp(generator.uniform(*np.log(bounds))))


def log_uniforms(generator: np.random.Generator, bounds: Range, count: int) -> np.ndarray:
    """``count`` of them, ``(count,)``."""
    return np.exp(generator.uniform(math.log(bounds[0]), math.log(bounds[1]), count))


class Checked:
    """Base of configurations that are drawn from: types and ranges of their fields follow from annotations and names.

    Fields that are :data:`Range` must rise and be positive; those whose names end in ``share`` lie in [0, 1].

    Raises:
        ValueError: a field is of another type or out of its range; the message names field, value and what is accepted.
    """

    def __post_init__(self) -> None:
        assert is_dataclass(self)
        hints = annotations_of(type(self))
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        check_parameters(type(self), {name: value for name, value in values.items() if hints.get(name) != Range})
        for name, value in values.items():
            for part in ranges_in(hints.get(name), value, name):
                check_range(name, part)
            if name.endswith("share") and not 0.0 <= value <= 1.0:
                raise ValueError(f"{name} must lie in [0, 1], got {value}")


def ranges_in(hint: Any, value: Any, name: str) -> list[Any]:
    """The ranges among the values of a field: itself, or the members of a tuple of ranges."""
    if hint == Range:
        return [value]
    kinds = typing.get_args(hint) if typing.get_origin(hint) is tuple else ()
    if kinds and all(kind in (Range, Ellipsis) for kind in kinds):
        return list(value)
    if Range in typing.get_args(hint) and isinstance(value, tuple):
        # a range or None
        return [value]
    return []


def check_range(name: str, value: Any) -> None:
    """Refuse what is not two rising positive numbers.

    Raises:
        ValueError: with name and value.
    """
    good = isinstance(value, tuple | list) and len(value) == 2
    good = good and all(isinstance(each, int | float) and not isinstance(each, bool) for each in value)
    if not good or not 0.0 < value[0] <= value[1] < math.inf:
        raise ValueError(f"{name} must be a range (lowest, highest) with 0 < lowest <= highest, got {value!r}")
