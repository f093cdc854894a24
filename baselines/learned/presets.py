"""How each shipped network is trained: data, front end, network, head and settings, by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ...envs.recipes.recipe import Recipe
from ...envs.recipes.registry import hand_recipe
from ...envs.recipes.rides import RideSource
from ...filters.core.quantity import MAGNETOMETER
from ...filters.registry import make
from ...filters.support.names import look_up
from ...filters.support.seeds import child_seeds
from .config import FitConfig
from .head import AngleHead, Head, TiltHead
from .heading_head import HeadingHead
from .inputs.filter_bank import TUNINGS, FilterBank
from .inputs.filter_features import FilterFeatures
from .inputs.front_end import FrontEnd, RawChannels
from .inputs.heading_bank import TUNINGS as HEADINGS
from .inputs.heading_bank import HeadingBank
from .inputs.level_frame import LevelFrame
from .mixture_head import MixtureHead


@dataclass(frozen=True)
class Preset:
    """The training of one network.

    Raises:
        ValueError: no episodes, or fewer than one unit.
    """

    summary: str
    """what it is, in one line"""
    sources: Mapping[str, int] = field(default_factory=dict)
    """recipe of hand motion → training episodes"""
    rides: RideSource | None = None
    """rides to train on instead"""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """of the filter, where they differ from the registered ones"""
    validation: float = 0.15
    """held-out episodes of each recipe, as a share of the training episodes"""
    network: str = "gru"
    """``gru`` or ``tcn``"""
    units: int = 64
    """units of a GRU, channels of a convolution network"""
    filter: str | None = None
    """that the network corrects; None: it stands alone"""
    bank: bool = False
    """whether the network chooses among tunings of the filter (:mod:`.inputs.filter_bank`)"""
    paper: str | None = None
    """filter whose sensors and angles a network has that stands alone on rides"""
    sites: tuple[str, ...] = ()
    """whose channels such a network sees; empty for all of the paper"""
    told: tuple[str, ...] = ()
    """parameters of a rider's filter that the network sees: how exactly the rider was measured"""
    limit: float | None = None
    """of corrections, in standard deviations of the filter"""
    scale: float = 0.1
    """rad: unit of the output"""
    noise: float = 0.0
    """on features while training: standardised ones, or those of a bank, which are of the order of one"""
    fit: FitConfig = field(default_factory=FitConfig)
    refined: FitConfig = field(default_factory=lambda: FitConfig(epochs=8, batch=16, learning_rate=4e-4))
    """settings of a training that starts from weights"""

    def __post_init__(self) -> None:
        if any(count < 1 for count in self.sources.values()) or bool(self.sources) == (self.rides is not None):
            raise ValueError(
                f"either rides, or sources that map recipes to 1 or more episodes, got {dict(self.sources)}"
            )
        if self.rides is not None and (self.filter is None) == (self.paper is None):
            raise ValueError(
                "a network for rides either corrects a filter or has the sensors of a paper's, "
                f"got filter={self.filter!r}, paper={self.paper!r}"
            )
        if self.bank and (self.rides is not None or self.filter is None):
            raise ValueError("a bank needs a filter of hand motion: name it, and sources instead of rides")
        if self.units < 1:
            raise ValueError(f"units must be at least 1, got {self.units}")

    @property
    def magnetic(self) -> bool:
        """Whether a bank is of headings: those of a filter that reads a magnetometer."""
        return self.bank and MAGNETOMETER in make(str(self.filter)).channels

    def recipe(self, name: str) -> Recipe:
        """The recipe of a source, one of hand motions."""
        return hand_recipe(name)

    def front_end(self) -> FrontEnd:
        """What the network sees."""
        kalman: Any = None if self.filter is None else make(self.filter, **self.parameters)
        if self.rides is None:
            bank = HeadingBank if self.magnetic else FilterBank
            return bank(LevelFrame(kalman)) if self.bank else LevelFrame(kalman)
        if self.paper is None:
            return FilterFeatures(kalman, parameters_seen=self.told)
        channels = [c for c in make(self.paper).channels if not self.sites or c.name.split("/")[0] in self.sites]
        return RawChannels(tuple(channels), paper=self.paper)

    def head(self) -> Head:
        """What it says: an inclination, or corrections of all angles of a rider's filter."""
        if self.magnetic:
            return HeadingHead(len(HEADINGS))
        if self.bank:
            return MixtureHead(len(TUNINGS))
        if self.rides is None:
            return TiltHead(self.limit)
        outputs = tuple(q for q in make(str(self.filter or self.paper)).outputs if q.kind == "angle")
        return AngleHead(outputs, (self.scale,) * sum(quantity.size for quantity in outputs), self.limit)

    def module(self, features: int, outputs: int, seed: int) -> Any:
        """The network before its training."""
        from .networks.modules import GruModule, TcnModule

        kinds: dict[str, Any] = {"gru": GruModule, "tcn": TcnModule}
        kind = look_up("network", self.network, kinds)
        # other heads have a scale of their own
        scale = self.scale if self.rides is None and not self.bank else 1.0
        made = kind(features, outputs, self.units, seed=seed, scale=scale, noise=self.noise)
        if self.bank:
            made.standardised.fit(np.zeros(features), np.ones(features))
        return made

    def quick(self) -> Preset:
        """A small version that learns visibly within minutes."""
        sources = {name: min(count, 40 if self.bank else 48) for name, count in self.sources.items()}
        rides = None if self.rides is None else replace(self.rides, rides=6, draws=3)
        fit = replace(self.fit, epochs=4, batch=8 if self.bank else 16)
        return replace(self, sources=sources, rides=rides, units=min(self.units, 32), fit=fit)

    def describe(self) -> dict[str, Any]:
        """All settings, for a card."""
        return {**asdict(self), "sources": dict(self.sources)}


TRAINED = {"scenarios": ["indoor_circle", "outdoor", "straight", "slalom"], "styles": ["mild", "normal"]}
"""Rides that networks train on; other scenarios and aggressive riders are kept aside."""
RIDES = RideSource(rides=160, draws=4, duration=40.0, changes=TRAINED)
KEPT = 0.4
"""Rides for the best epoch and the covariance, as a share of those of the training; riders differ: 24 are too few."""
MEASURED = {"whole-body": (replace(RIDES, draws=5, exact_draws=1), ("leg_offsets[0]",))}
"""Paper whose filter knows how exactly a rider was measured → rides, of which some are exact, and what tells which"""
RIDDEN = FitConfig(epochs=14, window=125, learning_rate=3e-3)
CORRECTED = {
    "two-gyro": "two-gyro",
    "force-inertial": "force-inertial-consistent",
    "whole-body": "whole-body-consistent",
}
"""Paper → filter that the network corrects: the consistent form where the published one diverges in some rides;
two-gyro from the published one, whose roll errs less on roads that are not level"""
BICYCLE_SITES = {
    "two-gyro": ("bicycle_imu",),
    "force-inertial": ("bicycle_imu", "wheel"),
    "whole-body": ("bicycle_imu", "wheel", "steer", "crank"),
}
"""Paper → sites of its sensors of which none is worn or held by the rider"""
HANDS = {"hand-held-prompt": 300, "carried-prompt": 80, "gestures-varying": 40}
PRESETS: dict[str, Preset] = {
    "gru": Preset("inclination from six axes by a recurrent network alone", HANDS, fit=FitConfig(epochs=7)),
    "tcn": Preset(
        "inclination from six axes by a causal convolution network alone", HANDS, network="tcn", units=32,
        fit=FitConfig(epochs=6),
    ),
    "bounded-motion+network": Preset(
        "bounded-motion-rest in ten tunings, weighed by a recurrent network",
        {"hand-held-varying": 200, "carried-varying": 70, "gestures-varying": 40},
        filter="bounded-motion-rest",
        bank=True,
        units=48,
        noise=0.05,
        fit=FitConfig(epochs=5, batch=24, learning_rate=3e-3),
    ),
    "bounded-motion-9+network": Preset(
        "bounded-motion-rest-9 in four tunings, whose headings are weighed by a recurrent network",
        {"hand-held-magnetic": 120, "carried-magnetic": 40},
        filter="bounded-motion-rest-9",
        bank=True,
        units=32,
        noise=0.05,
        fit=FitConfig(epochs=5, batch=16, window=1000, learning_rate=8e-3),
    ),
    **{
        f"{paper}+network": Preset(
            f"{filter}, all its angles corrected by a recurrent network", rides=rides, filter=filter, told=told,
            validation=KEPT, scale=0.03, noise=0.1, fit=RIDDEN,
        )
        for paper, filter in CORRECTED.items()
        for rides, told in (MEASURED.get(paper, (RIDES, ())),)
    },
    **{
        f"gru-{paper}{end}": Preset(
            f"angles of {paper} by a recurrent network alone, {words}", rides=RIDES, paper=paper, sites=sites,
            validation=KEPT, scale=0.1, noise=0.1, fit=RIDDEN,
        )
        for paper, bicycle in BICYCLE_SITES.items()
        for end, words, sites in (
            ("", "from the paper's sensors", ()),
            ("-bicycle", "from sensors of the bicycle: a rider's habits", bicycle),
        )
    },
}  # fmt: skip
"""Name of the weights → training."""


def seeds_of(seed: int) -> tuple[int, int, int, int]:
    """Children of a root seed: training data, validation data, initial weights and order, test data."""
    train, validation, weights, test = child_seeds(seed, 4)
    return train, validation, weights, test
