"""Every estimator by name: filters and references of the ground floor, learned ones, filters with a gain policy.

The only place where names turn into estimators. The tables hold texts; an estimator is imported when it is made.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any, Literal

from ..filters.core.estimator import Estimator
from ..filters.registry import CATALOGUE
from ..filters.registry import make as make_filter
from ..filters.support.names import look_up

Kind = Literal["filter", "reference", "learned", "adaptive", "external"]


@dataclass(frozen=True)
class EstimatorInfo:
    """What :func:`list_estimators` tells of an estimator.

    Attributes:
        name: for :func:`make_estimator`.
        kind: ``filter`` (published or ours), ``reference`` (what everybody knows), ``learned``, ``adaptive`` (a filter
            whose gains a policy sets), ``external`` (another package's, if that is installed).
        description: one line.
        channels: channels that it needs.
        outputs: quantities that it gives.
    """

    name: str
    kind: Kind
    description: str
    channels: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Trained:
    """An estimator with shipped weights: what is listed of it, and the function ``module:name`` that makes it."""

    info: EstimatorInfo
    factory: str


def _trained(name: str, kind: Kind, description: str, outputs: tuple[str, ...], factory: str) -> Trained:
    return Trained(EstimatorInfo(name, kind, description, ("imu/gyr", "imu/acc"), outputs), factory)


TRAINED: dict[str, Trained] = {
    item.info.name: item
    for item in (
        _trained(
            "gru",
            "learned",
            "recurrent network, trained on simulated hand motion",
            ("up",),
            "learned.estimator:shipped",
        ),
        _trained(
            "external-acceleration+policy",
            "adaptive",
            "external-acceleration, gains set by a policy trained with PPO",
            CATALOGUE["external-acceleration"].outputs,
            "gain_policy.adaptive:shipped_external_acceleration",
        ),
        _trained(
            "bounded-motion+policy",
            "adaptive",
            "bounded-motion, gains set by a policy trained with PPO",
            CATALOGUE["bounded-motion"].outputs,
            "gain_policy.adaptive:shipped_bounded_motion",
        ),
    )
}


def list_estimators() -> dict[str, EstimatorInfo]:
    """All estimators by name: kind, description, channels that they need, quantities that they give."""
    filters = {
        name: EstimatorInfo(name, entry.kind, entry.description, entry.channels, entry.outputs)
        for name, entry in CATALOGUE.items()
    }
    listed = filters | {name: item.info for name, item in TRAINED.items()}
    order = ("filter", "adaptive", "learned", "reference", "external")
    return dict(sorted(listed.items(), key=lambda item: order.index(item[1].kind)))


def make_estimator(name: str, **parameters: Any) -> Estimator[Any]:
    """Make an estimator.

    Args:
        name: see :func:`list_estimators`.
        parameters: ``dt``, the sampling interval in s (0.01 by default), and constants of the method, by the names of
            its dataclass fields: ``make_estimator("external-acceleration", mode=3, dt=1 / 286)``.

    Returns:
        The estimator, ready for :func:`poise.run`.

    Raises:
        ValueError: an unknown name or parameter (the message lists the valid ones), or a value out of its range.
        ImportError: the package that an external estimator wraps is not installed.
    """
    look_up("estimator", name, list_estimators())
    if name in TRAINED:
        module, function = TRAINED[name].factory.split(":")
        return getattr(importlib.import_module(f".{module}", __package__), function)(**parameters)
    return make_filter(name, **parameters)
