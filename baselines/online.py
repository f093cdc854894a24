"""An estimator for a loop of one's own: glitches count as missing, and the time of every step is measured."""

from __future__ import annotations

import time
from array import array
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from ..envs.data.glitches import FEWEST, SamplesSoFar
from ..filters.core.estimator import Estimator, check_measurements
from ..filters.core.offline import Offline
from ..filters.core.quantity import Estimate


@dataclass
class OnlineEstimator:
    """An estimator with its state, for samples that arrive one by one, and the durations of its steps.

    Attributes:
        estimator: with the sampling interval of the stream.
        ranges: channel → range of the sensor in the channel's unit; samples at the range count as missing.
        seconds: duration of every step.

    Glitches and repeats count as missing, as in :func:`poise.run`. What looks like a glitch does at once; if later
    samples show that it was none, the estimate is computed again from there. Repeats do from the first one that a
    sensor would not give.

    Raises:
        ValueError: the estimator needs the whole recording.
    """

    estimator: Estimator[Any]
    ranges: Mapping[str, float] = field(default_factory=dict)
    seconds: array[float] = field(default_factory=lambda: array("d"))
    _state: Any = field(default=None, init=False)
    _before: deque[Any] = field(default_factory=lambda: deque(maxlen=FEWEST), init=False)
    _samples: SamplesSoFar = field(init=False)

    def __post_init__(self) -> None:
        if isinstance(self.estimator, Offline):
            raise ValueError(
                "a smoother needs the whole recording: name an estimator with steps, or use `poise estimate`"
            )
        self._samples = SamplesSoFar(self.ranges, self.estimator.dt)

    def warm_up(self) -> Self:
        """Run the estimator on a sensor at rest, so that compiled code is loaded before the first sample."""
        rest = {each.name: np.full(each.size, 1.0) for each in self.estimator.channels}
        state = self.estimator.init(rest)
        self.estimator.step(state, rest)
        return self

    def step(self, measurement: Mapping[str, Any], restart: bool = False) -> Estimate:
        """The estimate after a sample.

        Args:
            measurement: channel → ``(size,)``, one sampling interval after the last; NaN where there is none.
            restart: begin anew with this sample, as after a long gap.

        Raises:
            ValueError: the sample lacks a channel of the estimator, or has another shape.
        """
        start = time.perf_counter()
        sample = check_measurements(self.estimator.channels, measurement, time_axis=False)
        if self._state is None or restart:
            self._state = self.estimator.init(sample)
            self._samples = SamplesSoFar(self.ranges, self.estimator.dt)
            self._before.clear()
        others = {name: np.asarray(values, float) for name, values in measurement.items() if name not in sample}
        changed = self._samples.add({**others, **sample})
        for _ in changed[1:]:
            self._state = self._before.pop()
        for each in changed:
            self._before.append(self._state)
            self._state, estimate = self.estimator.step(self._state, each)
        self.seconds.append(time.perf_counter() - start)
        return estimate

    def latency(self) -> dict[str, float]:
        """Median, 95 % and largest time of a step, µs."""
        taken = 1e6 * np.array(self.seconds)
        if not len(taken):
            return {"samples": 0}
        median, high = np.quantile(taken, [0.5, 0.95])
        return {
            "samples": len(self.seconds),
            "median (µs)": float(median),
            "95 % (µs)": float(high),
            "largest (µs)": float(taken.max()),
        }
