"""Registry of all estimators: filters, learned estimators, and filters with gains set by a policy.

All names of estimators are resolved here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..filters.core.estimator import Estimator
from ..filters.core.offline import SUFFIX, Offline
from ..filters.registry import FILTERS, HERE, Entry, Kind
from ..filters.support.names import look_up

RULES = {
    "pitch-rate": "its belief in level ground lowered by a rule on the pitch rate",
    "innovation": "its measurement variance adapted to the innovations",
    "turning": "its belief in level ground set by the pitch rate's variance and the yaw rate",
    "acceleration": "its measurement variance in proportion to the mean square excess of the specific force",
}
"""Rule by hand → what it does; :mod:`poise.baselines.gain_policy.rules` has them."""
RULED = {
    "two-gyro-level": ("pitch-rate", "turning"),
    "platform-gyro": ("pitch-rate", "innovation", "turning"),
    "external-acceleration": ("innovation", "acceleration"),
    "mekf": ("innovation", "acceleration"),
}
"""Filter → rules that set one of its gains."""
POLICIES = ("external-acceleration",)
"""Filters with a shipped policy."""
WEIGHTS = ".safetensors"
"""End of a name that is a file of weights."""
NETWORKS = {
    "LearnedEstimator": "..baselines.learned.estimator:shipped",
    "GainFilter": "..baselines.learned.gains.gain_filter:shipped",
}
"""Class on the card of a network → what makes it of its weights."""
LOSING = frozenset({"mekf+innovation", "mekf+acceleration", "external-acceleration+noise", "gru-whole-body"})
"""Rules and networks that lose to the plain filter on most sets of recordings, or on rides to its consistent form."""
TRAINED: dict[str, Entry] = {
    **{
        f"{name}+policy": Entry(
            "..baselines.gain_policy.adaptive:shipped",
            f"{name}, gains set by a policy trained in simulation",
            HERE,
            "adaptive",
            {"weights": f"{name.replace('-', '_')}_policy"},
            name,
            experimental=f"{name}+policy" in LOSING,
        )
        for name in POLICIES
    },
    **{
        f"{name}+{rule}": Entry(
            "..baselines.gain_policy.rules:by_rule",
            f"{name}, {RULES[rule]}",
            HERE,
            "adaptive",
            {"filter": name, "rule": rule},
            name,
            experimental=f"{name}+{rule}" in LOSING,
        )
        for name, rules in RULED.items()
        for rule in rules
    },
    "gru": Entry(
        NETWORKS["LearnedEstimator"],
        "recurrent network, trained on simulated hand motion",
        HERE,
        "learned",
        {"weights": "gru"},
    ),
    "bounded-motion+network": Entry(
        NETWORKS["LearnedEstimator"],
        "bounded-motion-rest in ten tunings, weighed by a recurrent network trained on simulated motion",
        HERE,
        "learned",
        {"weights": "bounded-motion_network"},
    ),
    "bounded-motion-9+network": Entry(
        NETWORKS["LearnedEstimator"],
        "bounded-motion-rest-9 in four tunings, headings weighed by a recurrent network trained on simulated motion",
        HERE,
        "learned",
        {"weights": "bounded-motion-9_network"},
        experimental=True,
    ),
    **{
        f"{name}+network": Entry(
            NETWORKS["LearnedEstimator"],
            f"{name}, its angles corrected by a recurrent network trained on simulated rides",
            HERE,
            "learned",
            {"weights": f"{name}_network"},
        )
        for name in ("two-gyro", "force-inertial", "whole-body")
    },
    **{
        f"gru-{name}": Entry(
            NETWORKS["LearnedEstimator"],
            f"angles of {name} from its sensors by a recurrent network alone, trained on simulated rides",
            HERE,
            "learned",
            {"weights": f"gru-{name}"},
            experimental=f"gru-{name}" in LOSING,
        )
        for name in ("two-gyro", "force-inertial", "whole-body")
    },
    **{
        f"gru-{name}-bicycle": Entry(
            NETWORKS["LearnedEstimator"],
            f"the same from sensors of the bicycle alone: what a rider's habits tell, to compare with gru-{name}",
            HERE,
            "learned",
            {"weights": f"gru-{name}-bicycle"},
            experimental=True,  # a comparison: all lose to the filter of the paper
        )
        for name in ("two-gyro", "force-inertial", "whole-body")
    },
    **{
        f"{name}+noise": Entry(
            NETWORKS["GainFilter"],
            f"{name}, its noises set by a recurrent network that was trained through the filter",
            HERE,
            "learned",
            {"weights": f"{name}_noise"},
            name,
            experimental=f"{name}+noise" in LOSING,
        )
        for name in ("external-acceleration", "mekf", "two-gyro-level")
    },
}
"""Name → estimator with shipped weights."""

KINDS: dict[Kind, str] = {
    "filter": "published or this package's",
    "adaptive": "a filter whose gains a policy or a rule sets",
    "learned": "a trained network",
    "baseline": "a classical reference without tuning",
    "external": "another package's, if that is installed",
}
"""Kind → what it is, in the order of lists."""


@dataclass(frozen=True)
class EstimatorInfo:
    """One estimator in :func:`list_estimators`.

    Attributes:
        name: for :func:`make_estimator`.
        kind: one of :data:`KINDS`.
        description: what it estimates and how, in one line.
        channels: channels that it needs.
        outputs: quantities that it estimates.
        source: where it was published.
        experimental: not better on recordings or rides than the filter that it is built on.
    """

    name: str
    kind: Kind
    description: str
    channels: tuple[str, ...]
    outputs: tuple[str, ...]
    source: str
    experimental: bool = False


def list_estimators(experimental: bool = False) -> dict[str, EstimatorInfo]:
    """All estimators by name: kind, description, channels that they need, quantities that they estimate, source.

    Args:
        experimental: list also those that do not beat the filter that they are built on.
    """
    listed = {
        name: EstimatorInfo(
            name, entry.kind, entry.description, entry.channels, entry.outputs, entry.source, entry.experimental
        )
        for name, entry in {**FILTERS, **TRAINED}.items()
        if experimental or not entry.experimental
    }
    return dict(sorted(listed.items(), key=lambda item: list(KINDS).index(item[1].kind)))


def make_estimator(name: str, *, metadata: Mapping[str, Any] | None = None, **parameters: Any) -> Estimator[Any]:
    """Make an estimator.

    Args:
        name: see :func:`list_estimators`, or a file of weights that ``poise train`` wrote (``….safetensors``); the
            suffix `` (offline)`` selects the estimator's smoother.
        metadata: of the recording (``trajectory.metadata``): filters are configured with the rider's anthropometry, the
            bicycle's geometry or the device's array described there.
        parameters: ``dt``, the sampling interval in s (0.01 by default), and constants of the method, by the names of
            its dataclass fields: ``make_estimator("external-acceleration", mode=3, dt=1 / 286)``. They take precedence
            over ``metadata``.

    Returns:
        The estimator, ready for :func:`poise.run`.

    Raises:
        ValueError: an unknown name or parameter (the message lists the valid ones), or a value out of its range.
        ImportError: the package that an external estimator wraps is not installed.
    """
    if isinstance(name, str) and name.endswith(SUFFIX):
        return Offline(make_estimator(name.removesuffix(SUFFIX), metadata=metadata, **parameters))
    if isinstance(name, str) and name.endswith(WEIGHTS):
        return of_weights(name).make(name, parameters, metadata)
    return look_up("estimator", name, {**FILTERS, **TRAINED}).make(name, parameters, metadata)


def of_weights(path: str) -> Entry:
    """The estimator that the card of a file of weights describes.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, or holds weights of something else than a network of ``poise train``.
    """
    from .weights_io import load_card

    card = load_card(path)
    kind = str(card.get("estimator", "")).rpartition(".")[2]
    if kind not in NETWORKS:
        own = "; a network of your own is loaded by LearnedEstimator.load" if card.get("network") == "torch" else ""
        raise ValueError(
            f"{path}: its card describes no estimator of `poise train`, but {card.get('kind', kind)!r}{own}"
        )
    return Entry(NETWORKS[kind], str(card.get("description", "")), HERE, "learned", {"weights": path})
