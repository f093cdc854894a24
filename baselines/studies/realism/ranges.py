"""Ranges within which simulated numbers are believable, each with its source."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..rides.saddle import ACROSS, ALONG, PULL
from ..rides.vibration import BANDWIDTH, MEASURED


@dataclass(frozen=True)
class Believable:
    """The range in which numbers lie."""

    low: float
    high: float
    unit: str
    source: str

    def holds(self, value: float) -> bool:
        """Whether a value is inside."""
        return self.low <= value <= self.high

    def met(self, values: Iterable[float]) -> bool:
        """Whether all values are inside."""
        return all(self.holds(each) for each in values)

    @property
    def text(self) -> str:
        """``3 … 10 Hz``, ``≥ -5 N``."""
        if math.isinf(self.high):
            return f"≥ {self.low:g} {self.unit}".strip()
        if math.isinf(self.low):
            return f"≤ {self.high:g} {self.unit}".strip()
        if self.low == self.high:
            return f"{self.low:g} {self.unit}".strip()
        return f"{self.low:g} … {self.high:g} {self.unit}".strip()


@dataclass(frozen=True)
class Covered(Believable):
    """Numbers that people or devices have: simulated ones must reach from the lowest to the highest."""

    def met(self, values: Iterable[float]) -> bool:
        """Whether some value is at the lower end or below, and some at the upper end or above."""
        found = list(values)
        return any(each <= self.low for each in found) and any(each >= self.high for each in found)

    @property
    def text(self) -> str:
        """``9 … 30 Hz among them``."""
        return f"{super().text} among them"


CHEST = "chest sensor of a recorded ride of 307 s (imt, head_chest_bike), with a margin for other riders and roads"
SADDLE = "a saddle is about 280 mm long and 140 to 280 mm wide, and nothing holds a rider down"
CARGO = "seat pan of cargo bicycles ridden at 12 km/h, measured"
DRIFT = (
    "data sheets state bias stabilities in run from 5 °/h and 13 µg (MTi-100, VN-100, ADIS16470) and none of consumer "
    "devices, which drift more: assumed up to 50 °/h and 400 µg"
)
TREADMILL = (
    "a bicycle with sensors on a treadmill: steering grows by more than 500 % from 20 to 5 km/h and stays about the "
    "same above 20; towed it is below 1 deg above 10 km/h, pedalled more (J. K. Moore, Human control of a bicycle, "
    "UC Davis (2012), chapter Delft instrumented bicycle)"
)
PATH = "the largest lateral drift on a treadmill at 10 km/h was 35 cm (the same, chapter Motion capture)"
LESS = "steering power falls with speed (S. M. Cain, J. A. Ashton-Miller, N. C. Perkins, PLoS ONE 11 (2016))"
RATES = "95 % of all values that were measured on a treadmill lie within 30 deg/s (the same, chapter Davis bicycle)"
TORQUE = "bound of this project for ordinary riding; no published table was found"
BELIEVABLE = {
    "trunk gyroscope rms": Believable(20.0, 45.0, "deg/s", CHEST),
    "trunk gyroscope 95 % frequency": Believable(3.0, 10.0, "Hz", CHEST),
    "share of samples in which a load cell pulls": Believable(0.0, 0.0, "%", SADDLE),
    "least force of a load cell": Believable(-PULL, math.inf, "N", SADDLE),
    "centre of pressure across": Believable(-ACROSS, ACROSS, "mm", SADDLE),
    "centre of pressure along": Believable(-ALONG, ALONG, "mm", SADDLE),
    **{f"vertical acceleration on {name}": Believable(*range_, "m/s²", CARGO) for name, range_ in MEASURED.items()},
    "bandwidth of vertical acceleration": Believable(*BANDWIDTH, "Hz", CARGO),
    "gyroscope Allan deviation": Believable(5.0, 50.0, "°/h", DRIFT),
    "accelerometer Allan deviation": Believable(10.0, 400.0, "µg", DRIFT),
    "steering at 5 km/h, times that at 20": Believable(6.0, 12.0, "", TREADMILL),
    "steering at 25 km/h, times that at 20": Believable(0.7, 1.3, "", TREADMILL),
    "steering above 10 km/h": Believable(0.3, 2.0, "deg", TREADMILL),
    "steer rate at 5 km/h, times that at 25": Believable(1.0, math.inf, "", LESS),
    "roll rate std": Believable(0.2, 15.0, "deg/s", RATES),
    "distance from the path": Believable(3.0, 25.0, "cm", PATH),
    "torque, 99 %": Believable(-math.inf, 10.0, "N·m", TORQUE),
}
"""Quantity → range."""


def judged(quantity: str, values: Mapping[str, float]) -> dict[str, Any]:
    """A row: range and source of a :data:`BELIEVABLE` quantity, how many of the values are inside, which are not."""
    within = BELIEVABLE[quantity]
    outside = [f"{where} ({value:.3g})" for where, value in values.items() if not within.holds(value)]
    return {
        "quantity": quantity,
        "found from": min(values.values()),
        "to": max(values.values()),
        "accepted": within.text,
        "inside": f"{len(values) - len(outside)}/{len(values)}",
        "outside": ", ".join(outside) or "none",
        "source": within.source,
    }
