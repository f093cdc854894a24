"""Random motion of a hand: segments and rests of any strength, vibration and taps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...filters.core import rotation
from ...filters.support.ranges import Checked, Range, log_uniform
from ..hand.motion import Segment, SegmentedGesture


@dataclass(frozen=True)
class VariedMotion(Checked):
    """Segments of random motion and rests, whose strengths, bands and lengths differ from episode to episode.

    All ranges are log-uniform. The hand stays in place: its position is a band-limited function between rests some
    decimetres apart.
    """

    first_rest: Range = (0.3, 40.0)
    """s at rest at the start"""
    moving_start: float = 0.15
    """share of episodes that start in motion instead"""
    rest_shares: tuple[float, ...] = (0.0, 0.05, 0.2, 0.5)
    """an episode draws one of these probabilities that a segment is a rest"""
    shortest: float = 1.5
    """s, of a segment"""
    longest: Range = (4.0, 60.0)
    """s; an episode draws the length of its longest segments"""
    acceleration: Range = (0.05, 12.0)
    """m/s², root mean square of an episode while it moves"""
    rate: Range = (0.05, 7.0)
    """rad/s, root mean square likewise"""
    single_share: float = 0.1
    """probability that an episode hardly turns, and that it hardly translates"""
    strength_std: float = 0.6
    """largest standard deviation of the logarithm of a segment's strength within an episode"""
    position_band: tuple[Range, Range] = ((0.2, 1.0), (0.8, 4.0))
    """Hz, ranges of the lower and the upper end"""
    angle_band: Range = (0.3, 2.0)
    """Hz, range of the upper end; the lower is 0.1 to 0.5 of it"""

    def draw(self, generator: np.random.Generator, duration: float) -> SegmentedGesture:
        """Draw a motion of ``duration`` seconds."""
        heading, axes = rotation.random(generator), rotation.random(generator)
        moving = generator.random() < self.moving_start
        start = 0.0 if moving else log_uniform(generator, self.first_rest)
        rest_share, longest = generator.choice(self.rest_shares), log_uniform(generator, self.longest)
        acceleration, rate = log_uniform(generator, self.acceleration), log_uniform(generator, self.rate)
        choice, std = generator.random(), generator.uniform(0.0, self.strength_std)
        if choice < 2.0 * self.single_share:
            acceleration, rate = (
                (acceleration, 0.1 * rate) if choice < self.single_share else (0.1 * acceleration, rate)
            )
        segments = []
        while start < duration:
            end = start + log_uniform(generator, (self.shortest, longest))
            strengths = np.exp(generator.normal(0.0, std, 2)) * (acceleration, rate)
            if generator.random() >= rest_share:
                segments.append(self._segment(generator, start, end, *np.minimum(strengths, (15.0, 9.0))))
            start = end
        return SegmentedGesture(duration, heading, np.zeros(3), tuple(segments), axes)

    def _segment(
        self, generator: np.random.Generator, start: float, end: float, acceleration: float, rate: float
    ) -> Segment:
        fastest, turning = log_uniform(generator, self.position_band[1]), log_uniform(generator, self.angle_band)
        slowest, slowly = log_uniform(generator, self.position_band[0]), turning * generator.uniform(0.1, 0.5)
        angle = rate / (np.pi * (slowly + turning)) / np.sqrt(3.0)
        return Segment.draw(
            generator,
            start=start,
            end=end,
            ramp=min(generator.uniform(0.1, 1.0), 0.3 * (end - start)),
            position_band=(min(slowest, 0.6 * fastest), fastest),
            angle_band=(slowly, turning),
            acceleration_rms=acceleration / np.sqrt(3.0),
            angle_rms=angle,
            turn=generator.uniform(-np.pi, np.pi, 3) * min(1.0, rate * (end - start) / 6.0),
        )


@dataclass(frozen=True)
class Shaking(Checked):
    """Vibration and taps, added to the accelerometer, without net velocity or rotation."""

    vibrating_share: float = 0.3
    """of episodes"""
    frequency: Range = (15.0, 120.0)
    """Hz"""
    vibration: Range = (0.3, 8.0)
    """m/s²"""
    tapped_share: float = 0.25
    """of episodes"""
    taps: Range = (0.1, 1.5)
    """1/s"""
    tap: Range = (3.0, 60.0)
    """m/s², peak"""
    width: Range = (0.004, 0.03)
    """s"""

    def draw(self, generator: np.random.Generator, times: np.ndarray, *, mean: bool) -> np.ndarray:
        """Acceleration ``(T, 3)`` in sensor axes at even ``times``, or (``mean``) over the intervals that they end."""
        dt = times[1] - times[0]
        grid = np.concatenate([[times[0] - dt], times])
        velocity, acceleration = np.zeros((2, len(grid), 3))
        if generator.random() < self.vibrating_share:
            for _ in range(generator.integers(1, 4)):
                w, strength = (
                    2.0 * np.pi * log_uniform(generator, self.frequency),
                    log_uniform(generator, self.vibration),
                )
                start, duration = generator.uniform(0.0, times[-1]), log_uniform(generator, (2.0, 60.0))
                window = strength * np.clip(np.minimum(grid - start, start + duration - grid) / 0.2, 0.0, 1.0)[:, None]
                phase = w * grid + np.cumsum(generator.normal(0.0, 0.5 * np.sqrt(dt), len(grid)))
                axis = rotation.normalize(generator.standard_normal(3))
                acceleration += window * np.sin(phase)[:, None] * axis
                velocity -= window / w * np.cos(phase)[:, None] * axis
        if generator.random() < self.tapped_share:
            count = int(times[-1] * log_uniform(generator, self.taps))
            for time in generator.uniform(0.0, times[-1], count):
                width, peak = log_uniform(generator, self.width), log_uniform(generator, self.tap)
                axis = rotation.normalize(generator.standard_normal(3))
                near = slice(*np.searchsorted(grid, (time - 6.0 * width, time + 6.0 * width)))
                u = (grid[near] - time)[:, None] / width
                acceleration[near] += peak * u * np.exp(0.5 - 0.5 * u * u) * axis
                velocity[near] -= peak * width * np.exp(0.5 - 0.5 * u * u) * axis
        return np.diff(velocity, axis=0) / dt if mean else acceleration[1:]
