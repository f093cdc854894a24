"""Lasting faults of a ride's sensors: what a filter with constant noises does not expect."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..data.trajectory import Trajectory

EARLIEST = 5.0
"""s after the start of the ride"""
LEAST = 15.0
"""s that a fault lasts at least, where the ride is long enough"""


@dataclass(frozen=True)
class Fault:
    """A number of a channel that is off for a while."""

    channel: str
    column: int
    size: float
    """in the channel's unit"""
    longest: float = math.inf
    """s after which it is over"""

    def applied(self, ride: Trajectory, generator: np.random.Generator) -> Trajectory:
        """The ride with this fault from a random time on.

        Raises:
            ValueError: the ride lacks the channel.
        """
        if self.channel not in ride.measurements:
            raise ValueError(f"ride {ride.name!r} lacks the channel {self.channel!r} of the fault")
        time = ride.time - ride.time[0]
        start = generator.uniform(EARLIEST, max(EARLIEST, time[-1] - min(self.longest, LEAST)))
        values = ride.measurements[self.channel].copy()
        values[(time >= start) & (time < start + self.longest), self.column] += self.size
        return ride.replace(measurements={**ride.measurements, self.channel: values})


FAULTS = {
    "bias step": Fault("bicycle_imu/gyr", 0, math.radians(1.0)),
    "seat offset": Fault("seat/wrench", 1, 40.0, 20.0),
}
"""Name → fault: 1 °/s more of the bicycle's roll rate until the end; 40 N of side force below the saddle for 20 s."""
