"""Motion of a device in the hand, as broad as recordings: rotation about all axes, shaking, rests, parts over it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ...filters.core import rotation
from ...filters.support.ranges import Checked, Range, log_uniform
from .motion import Gesture, Segment, SegmentedGesture
from .parts.composition import ComposedGesture, Intervals, Part
from .parts.impacts import SetDowns, Taps
from .parts.noise import Noise
from .parts.shaking import Drift, SoftTissue, Tremor, Vibration


class Layer(Protocol):
    """The distribution of a part."""

    def draw(self, generator: np.random.Generator, intervals: Intervals) -> Part:
        """Draw a part that acts in these intervals."""
        ...


@dataclass(frozen=True)
class Over(Checked):
    """Parts that may lie over a motion, each in a share of the episodes.

    Attributes:
        tremor, drift: while the device is in the hand.
        taps, vibration: at any time after the first rest.
        set_downs: where the device is put down.
        tissue: under a worn sensor.
        clean_share: of the episodes, which have none but the drift, whatever the shares of the others.
    """

    tremor: Tremor = field(default_factory=Tremor)
    drift: Drift = field(default_factory=Drift)
    taps: Taps = field(default_factory=Taps)
    vibration: Vibration = field(default_factory=Vibration)
    set_downs: SetDowns = field(default_factory=SetDowns)
    tissue: SoftTissue = field(default_factory=SoftTissue)
    clean_share: float = 0.4
    tremor_share: float = 0.6
    drift_share: float = 0.5
    taps_share: float = 0.65
    vibration_share: float = 0.55
    set_down_share: float = 0.6
    tissue_share: float = 0.15

    def lay(self, generator: np.random.Generator, base: Gesture, held: Intervals, start: float) -> Gesture:
        """Draw the parts over a motion without them, whose first rest ends at ``start`` (s).

        The device is put down at the end of each interval in which it is ``held``.
        """
        shares = (self.tremor_share, self.drift_share, self.taps_share, self.vibration_share, self.set_down_share)
        # every part has a generator of its own, so that shares change which ones act and nothing else
        chosen = generator.random(6) < (*shares, self.tissue_share)
        if generator.random() < self.clean_share:
            chosen[[0, 2, 3, 4, 5]] = False
        streams = generator.spawn(6)
        whole = ((start, base.duration),) if start < base.duration else ()
        put_down = tuple(each for each in held if each[1] < base.duration)
        layers: list[tuple[Layer, Intervals]] = [
            *((self.tremor, held), (self.drift, held), (self.taps, whole), (self.vibration, whole)),
            (self.set_downs, put_down),
        ]
        parts = tuple(
            layer.draw(stream, active)
            for (layer, active), choice, stream in zip(layers, chosen[:5], streams[:5], strict=True)
            if choice and active
        )
        gesture: Gesture = ComposedGesture(base, parts) if parts else base
        if chosen[5]:
            gesture = ComposedGesture(gesture, (self.tissue.draw(streams[5], gesture),))
        return gesture


Band = tuple[float, float, float | None, int]


@dataclass(frozen=True)
class HandHeld(Checked):
    """A device in the hand: segments of broadband motion over all attitudes, rests on a table, tremor, taps, drift.

    Strengths, bands and lengths differ from episode to episode, and again from segment to segment; ranges are
    log-uniform. In a band the acceleration (angular rate) is white; above it, it falls as a power of the
    frequency; or noise drives an oscillator, which makes a rhythm. The ranges were set on trials 02, 08, 15, 24 and 28
    of BROAD and Test04 and Test09 of RepoIMU. Where the other trials at hand (06, 10, 21, 26 and 32; Test07 and Test11)
    lay outside, shares and edges of bands were widened once more, so no trial is independent of them; the rest of both
    data sets was not looked at.

    Attributes:
        duration: length where none is asked for, s.
        first_rest: at the start, s.
        moving_start_share: of episodes that start in motion instead.
        rest_shares: an episode draws one of these probabilities that a segment is a rest.
        in_hand_share: of the rests that are in the hand, not on a table.
        shortest: length of the shortest segment, s.
        longest: an episode draws the length of its longest segments, s.
        acceleration: root mean square of an episode while it moves, m/s².
        rate: angular, likewise, rad/s.
        single_share: probability that an episode hardly turns, and that it hardly translates.
        spread: largest standard deviation of the logarithm of a segment's strength within an episode.
        axis_spread: standard deviation of the logarithm of each axis' strength.
        largest_acceleration: of a segment, root mean square, m/s².
        largest_rate: likewise, rad/s.
        reach: largest root mean square displacement of a segment, m; stronger motion of that frequency is weakened.
        position_band: ranges of the lower and the upper end, Hz.
        angle_band: likewise.
        rhythmic_share: of episodes in which position, and in which attitude, swings in a rhythm instead.
        rhythm: its frequency, Hz.
        rhythm_damping: damping ratio of the oscillator that noise drives; the smaller, the purer the rhythm.
        over: parts over the motion.
    """

    duration: float = 60.0
    first_rest: Range = (1.0, 1.0)
    moving_start_share: float = 0.0
    rest_shares: tuple[float, ...] = (0.0, 0.05, 0.2, 0.5)
    in_hand_share: float = 0.5
    shortest: float = 1.5
    longest: Range = (4.0, 60.0)
    acceleration: Range = (0.1, 22.0)
    rate: Range = (0.2, 10.0)
    single_share: float = 0.1
    spread: float = 0.6
    axis_spread: float = 0.4
    largest_acceleration: float = 25.0
    largest_rate: float = 12.0
    reach: float = 0.35
    position_band: tuple[Range, Range] = ((0.15, 1.0), (0.25, 6.0))
    angle_band: tuple[Range, Range] = ((0.03, 0.5), (0.15, 6.0))
    rhythmic_share: float = 0.6
    rhythm: Range = (0.25, 5.5)
    rhythm_damping: Range = (0.001, 0.15)
    over: Over = field(default_factory=Over)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.shortest <= self.longest[0]:
            raise ValueError(f"shortest must be positive and at most longest {self.longest}, got {self.shortest}")

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> Gesture:
        """Draw a motion."""
        duration = self.duration if duration is None else duration
        motion, over = generator.spawn(2)
        heading, axes = rotation.random(motion), rotation.random(motion)
        moving = motion.random() < self.moving_start_share
        start = 0.0 if moving else log_uniform(motion, self.first_rest)
        begun, rest_share, longest = start, motion.choice(self.rest_shares), log_uniform(motion, self.longest)
        strengths = np.array([log_uniform(motion, self.acceleration), log_uniform(motion, self.rate)])
        choice, spread = motion.random(), motion.uniform(0.0, self.spread)
        if choice < 2.0 * self.single_share:
            strengths[int(choice < self.single_share)] *= 0.1
        bands = [self._band(motion, band) for band in (self.position_band, self.angle_band)]
        segments: list[Segment] = []
        held: list[tuple[float, float]] = []
        while start < duration:
            end = start + log_uniform(motion, (self.shortest, longest))
            resting = motion.random() < rest_share
            if not resting:
                strength = np.minimum(
                    strengths * np.exp(motion.normal(0.0, spread, 2)), (self.largest_acceleration, self.largest_rate)
                )
                segments.append(self._segment(motion, start, end, strength, bands))
            if not resting or motion.random() < self.in_hand_share:
                # consecutive intervals in the hand are one
                begin = held.pop()[0] if held and held[-1][1] == start else start
                held.append((begin, end))
            start = end
        held = [(first, min(last, duration)) for first, last in held]
        base = SegmentedGesture(duration, heading, np.zeros(3), tuple(segments), axes)
        return self.over.lay(over, base, tuple(held), begun)

    def _band(self, generator: np.random.Generator, band: tuple[Range, Range]) -> Band:
        """Lower and upper frequency, damping of the lower edge, steepness of the upper one."""
        low, high = (log_uniform(generator, each) for each in band)
        rhythm, damping = log_uniform(generator, self.rhythm), log_uniform(generator, self.rhythm_damping)
        steepness = int(generator.integers(1, 6))
        if generator.random() < self.rhythmic_share:
            return rhythm, 1.3 * rhythm, damping, steepness
        return min(low, 0.6 * high), high, None, steepness

    def _segment(
        self, generator: np.random.Generator, start: float, end: float, strength: np.ndarray, bands: list[Band]
    ) -> Segment:
        length, (acceleration, rate) = end - start, strength
        functions = []
        for level, (low, high, damping, steepness), order in zip(strength, bands, (2, 1), strict=True):
            faster = np.exp(generator.normal(0.0, 0.1))
            axes = np.exp(generator.normal(0.0, self.axis_spread, 3))
            functions.append(
                Noise.draw(
                    generator,
                    length,
                    (faster * low, faster * high),
                    (level * axes / np.linalg.norm(axes)).tolist(),
                    derivative=order,
                    steepness=steepness,
                    damping=damping,
                )
            )
        position, angles = functions
        position = position.scaled(min(1.0, self.reach / position.spread))
        ramp = min(generator.uniform(0.1, 1.0), 0.3 * length)
        # as far as the acceleration allows
        shift = generator.normal(0.0, 0.1, 3) * min(1.0, 0.3 * acceleration * length**2)
        turn = generator.uniform(-np.pi, np.pi, 3) * min(1.0, rate * length / 6.0)
        return Segment(start, end, ramp, position, angles, shift, turn)
