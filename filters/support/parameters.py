"""Checks of the parameters of an estimator by types and ranges that follow from annotations and names."""

from __future__ import annotations

import functools
import inspect
import math
import re
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any, Literal

import numpy as np

POSITIVE = re.compile(r"(dt|gravity|interval|time|step|window|length|width|wide|forearm|shank|thigh|arm)$|tau_")
"""Names of numbers that are above zero: times, lengths of limbs."""
NOT_NEGATIVE = re.compile(
    r"(noise|std|mass|wheelbase|deviation|variance|prior|drift|bound|range|tolerance|threshold|adaptation|rejection|decay|jerk|hold"
    r"|inflation|filter|gain|scale|share|weight|guard|follow|acceleration)$|^(gain|k)_"
)
"""Names of numbers that are zero or above: standard deviations, masses, limits, gains."""
MEASURED = re.compile(r"(accelerometer|magnetometer|array|orientation|distance)_(noise|std|variance)$")
"""Noises of measurements: without any, an innovation has no covariance."""
LARGEST, SMALLEST = 1e15, 1e-12
"""Magnitudes between which covariances made of parameters can be inverted; anything physical lies between."""


def check_parameters(maker: Callable[..., Any], given: Mapping[str, Any]) -> None:
    """Check values by the annotations of a dataclass or function that they are given to.

    Args:
        maker: class or function; names that it does not annotate are left to it.
        given: name → value.

    Raises:
        ValueError: a value of a wrong type or out of its range; the message names parameter, value and what is
            accepted.
    """
    hints = annotations_of(maker)
    for name, value in given.items():
        if name in hints:
            reason = refused(name, value, hints[name], getattr(maker, name, None))
            if reason:
                must = "must not be" if reason == "negative" else "must be"
                raise ValueError(f"{name} {must} {reason}, got {shown(value)}")


def check_positive(of: object, *names: str, or_zero: Sequence[str] = ()) -> None:
    """Refuse attributes (numbers or tuples of them) that are not positive, or negative where zero is allowed.

    Raises:
        ValueError: names the attribute and its value.
    """
    for name in (*names, *or_zero):
        value = getattr(of, name)
        numbers = value if isinstance(value, tuple) else (value,)
        if not all(0.0 <= number < math.inf and (number > 0.0 or name in or_zero) for number in numbers):
            wanted = "not be negative or infinite" if name in or_zero else "be positive and finite"
            raise ValueError(f"{name} must {wanted}, got {value}")


def arguments_of(maker: Callable[..., Any], args: Sequence[Any], kwargs: Mapping[str, Any]) -> dict[str, Any]:
    """Name → value of a call's arguments without ``self``; empty if they do not fit, which Python then reports."""
    signature = inspect.signature(maker)
    try:
        given = signature.bind(None, *args, **kwargs).arguments
    except TypeError:
        return {}
    variable = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    kinds = {name: parameter.kind for name, parameter in signature.parameters.items()}
    return {name: value for name, value in list(given.items())[1:] if kinds[name] not in variable}


@functools.lru_cache
def annotations_of(maker: Callable[..., Any]) -> dict[str, Any]:
    """Name → type, as far as it can be resolved."""
    try:
        return typing.get_type_hints(maker)
    except NameError:
        return {}


def refused(name: str, value: Any, kind: Any, default: Any = None) -> str:
    """What a value must be (or ``negative``, which it must not be); empty if it is accepted."""
    origin = typing.get_origin(kind)
    if origin is Literal:
        choices = typing.get_args(kind)
        same = any(type(value) is type(choice) and value == choice for choice in choices)
        return "" if same else f"one of {choices}"
    if origin in (typing.Union, types.UnionType):
        reasons = [refused(name, value, each, default) for each in typing.get_args(kind)]
        return "" if "" in reasons else " or ".join("0 or more" if each == "negative" else each for each in reasons)
    if kind is float:
        return number_refused(name, value)
    if kind is int:
        return "" if isinstance(value, int | np.integer) and not isinstance(value, bool) else "an integer"
    if kind is bool:
        return "" if isinstance(value, bool | np.bool_) else "True or False"
    if kind is type(None):
        return "" if value is None else "None"
    if origin is tuple:
        return tuple_refused(name, value, typing.get_args(kind), default)
    if origin is Sequence:
        several = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str | bytes)
        return "" if several else "a sequence"
    if isinstance(kind, type) and not getattr(kind, "_is_protocol", False):
        return "" if isinstance(value, kind) else f"of type {kind.__name__}"
    return ""


def number_refused(name: str, value: Any) -> str:
    """See :func:`refused`, for a number."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real) or not abs(float(value)) <= LARGEST:
        return f"a finite number (at most {LARGEST:g} in magnitude)"
    if POSITIVE.search(name) or MEASURED.match(name):
        return "" if float(value) >= SMALLEST else f"positive (at least {SMALLEST:g})"
    return "" if float(value) >= 0.0 or not NOT_NEGATIVE.search(name) else "negative"


def tuple_refused(name: str, value: Any, parts: tuple[Any, ...], default: Any) -> str:
    """See :func:`refused`, for a sequence of numbers, names or sequences of numbers."""
    if not isinstance(value, tuple | list | np.ndarray) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return "a sequence" + (f" like {default}" if isinstance(default, tuple) else "")
    size = len(default) if isinstance(default, tuple) and parts[-1] is Ellipsis and parts[0] is float else None
    kinds = parts if parts[-1] is not Ellipsis else parts[:1] * len(value)
    if len(value) != len(kinds) or size not in (None, len(value)):
        return f"a sequence of {size or len(kinds)}"
    reasons = [refused(name, each, kind) for each, kind in zip(value, kinds, strict=True)]
    return next((f"a sequence, each {reason}" for reason in reasons if reason), "")


def shown(value: Any) -> str:
    """A value in a message, in short."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}…"
