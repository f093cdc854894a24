r"""Observation of a gain policy: statistics of innovations and sensors over several time scales, without the truth.

Five streams of vectors are monitored: the whitened innovation of the filter, the gyroscope, the accelerometer (if the
filter has one), the external acceleration a that the filter estimates, and the apparent tilt u × a / g with its
inclination vector u (both zero where a filter estimates no acceleration). A gyroscope bias b causes a steady tilt error
τ (b × u) at a time constant τ. The mean of the apparent tilt in sensor axes then points along b at any attitude, while
true accelerations of a hand average out. Of each stream, running means of

    1,  v,  |v|²,  |v − v_previous|²        and, of the accelerometer,  ‖f‖ − g  and its square

are computed over each time scale (:mod:`.time_scales`), without missing samples.

The features are invariants of these averages that do not depend on the mounting of the sensor. For every stream and
scale they are the logarithms of the root mean square, the standard deviation, the length of the mean, and the change
from sample to sample. A consistent filter has innovations of rms √m and zero mean; a nonzero mean or slow changes show
that a gain is too small (R. K. Mehra, "On the identification of variances and adaptive Kalman filtering", IEEE Trans.
Automatic Control 15(2), 1970).

All features are compressed to [−1, 1]. One memory holds a batch of sequences.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..core.kalman import KalmanFilter
from ..core.quantity import GRAVITY, Estimate
from ..core.rotation import cross
from ..core.sampling import latest
from .time_scales import FeatureMemory, Features

STREAMS = ("innovation", "gyr", "acc", "external", "lean")
STATISTICS = ("rms", "deviation", "mean", "change")
CENTRES = {
    "innovation": (0.0, 0.0, -0.5, 0.0),
    "gyr": (0.0, -0.5, -0.5, -1.0),
    "acc": (1.0, 0.0, 1.0, 0.0),
    "external": (0.0, 0.0, -0.5, -0.5),
    "lean": (-1.0, -1.0, -1.5, -1.5),
}
"""Stream → decimal logarithm of the value of each statistic that maps to 0: typical of hand motion."""
FLOOR = 1e-5
"""Smallest statistic that is distinguished from zero."""
CHANGE_TIME = 0.01
"""s: changes of the sensors from sample to sample are scaled to this time, so that they do not depend on the rate"""


@dataclass(frozen=True)
class InnovationFeatures(Features):
    """Statistics that do not depend on the mounting of the sensor, for filters of one inertial sensor."""

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every feature, in order; the actions of the last interval follow them."""
        parts = [f"{stream} {statistic}" for stream in STREAMS for statistic in STATISTICS]
        parts += ["norm excess", "norm excess rms"]
        return (*(f"{part} {scale:g} s" for scale in self.scales for part in parts), "time since start")

    def init(self, kalman: KalmanFilter, batch: tuple[int, ...] = ()) -> FeatureMemory:
        """Empty memory for sequences of shape ``batch``.

        Raises:
            ValueError: the filter reads no gyroscope.
        """
        stream_channels(kalman)
        width = max(3, kalman.model.residual_size)
        return self.empty(batch, len(STREAMS) * (width + 3) + 2, (len(STREAMS), width))

    def observe(self, memory: FeatureMemory, kalman: KalmanFilter, action: np.ndarray) -> np.ndarray:
        """Features at the end of an interval and its action ``(*batch, k)``: float32 ``(*batch, size)`` in [−1, 1]."""
        batch, scales = memory.averages.shape[:-2], len(self.scales)
        block = memory.averages[..., :-2].reshape(*batch, scales, len(STREAMS), -1)
        with np.errstate(divide="ignore", invalid="ignore"):
            means = block[..., 1:] / block[..., :1]
            excess = memory.averages[..., -2:] / block[..., STREAMS.index("acc"), :1]
        mean, square, change = means[..., :-2], means[..., -2], means[..., -1]
        mean_square = np.sum(mean * mean, axis=-1)
        # The change of innovations is per sample; the change of all other streams is per unit of time.
        pace = np.where(np.array(STREAMS) == "innovation", 1.0, (CHANGE_TIME / kalman.dt) ** 2)
        sizes = np.stack([square, square - mean_square, mean_square, change * pace], axis=-1)
        logarithms = 0.5 * np.log10(np.fmax(sizes, FLOOR**2)) - np.array([CENTRES[stream] for stream in STREAMS])
        excess = np.where(np.isfinite(excess), excess, 0.0)
        excess_rms = 0.5 * np.log10(np.fmax(excess[..., 1:], FLOOR**2)) + 0.5
        features = np.concatenate([logarithms.reshape(*batch, scales, -1), excess[..., :1], excess_rms], axis=-1)
        squashed = np.tanh(np.concatenate([features.reshape(*batch, -1), self.age(memory, kalman.dt)], axis=-1))
        return np.concatenate([squashed, action], axis=-1).astype(np.float32)

    def moments(
        self, memory: FeatureMemory, kalman: KalmanFilter, measurements: Mapping[str, np.ndarray], estimate: Estimate
    ) -> tuple[np.ndarray, np.ndarray]:
        """Moments ``(T, *batch, moments)`` of the samples, and the last one of every stream."""
        gyroscope, accelerometer = stream_channels(kalman)
        gyr = np.asarray(measurements[gyroscope], dtype=float)
        acc = np.full_like(gyr, np.nan) if accelerometer is None else np.asarray(measurements[accelerometer], float)
        gravity = getattr(kalman.model, "gravity", GRAVITY)
        innovation = np.asarray(estimate.innovation)
        # A whitened innovation is exactly 0 where there was no measurement.
        innovation = np.where((innovation != 0.0).any(axis=-1, keepdims=True), innovation, np.nan)
        external = np.asarray(estimate.pose.get("external_acceleration", np.zeros_like(gyr)))
        lean = cross(np.asarray(estimate.pose.get("up", np.zeros_like(gyr))), external) / gravity
        values = np.zeros((*acc.shape[:-1], *memory.previous.shape[-2:]))
        for index, stream in enumerate((innovation, gyr, acc, external, lean)):
            values[..., index, : stream.shape[-1]] = stream
        earlier, last = before(values, memory.previous)
        known = np.isfinite(values).all(axis=-1, keepdims=True)
        v = np.where(known, values, 0.0)
        change = np.where(known & np.isfinite(earlier).all(axis=-1, keepdims=True), values - earlier, 0.0)
        squares = [np.sum(part * part, axis=-1, keepdims=True) for part in (v, change)]
        moments = np.concatenate([known, v, *squares], axis=-1)
        size = np.sqrt(np.sum(acc * acc, axis=-1, keepdims=True))
        excess = np.where(np.isfinite(size), size - gravity, 0.0)
        flat = moments.reshape(*acc.shape[:-1], -1)
        return np.concatenate([flat, excess, excess * excess], axis=-1), last


def stream_channels(kalman: KalmanFilter) -> tuple[str, str | None]:
    """Names of the first gyroscope and the first accelerometer that a filter reads; None if it reads no accelerometer.

    Raises:
        ValueError: it reads no gyroscope.
    """
    names = [channel.name for channel in kalman.channels if channel.size == 3]
    found = [next((name for name in names if name.endswith(kind)), None) for kind in ("/gyr", "/acc")]
    if found[0] is None:
        raise ValueError(f"a tuned filter must read a gyroscope, this one reads {names}")
    return found[0], found[1]


def before(values: np.ndarray, held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The last valid vector before every sample ``(T, *batch, d)``, and that after the last one ``(*batch, d)``.

    A vector with any NaN is unknown; ``held`` is the last valid one before the first sample.
    """
    row = np.concatenate([held[None], values])
    known = np.isfinite(row).all(axis=-1)
    if not known[1:].all():
        row = np.take_along_axis(row, np.maximum(latest(known), 0)[..., None], axis=0)
    return row[:-1], row[-1]
