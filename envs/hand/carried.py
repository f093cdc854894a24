"""Motion of a phone that is carried by somebody who walks or runs: in the hand, in a swinging hand, in a pocket."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from ...filters.core import rotation
from ...filters.support.ranges import Checked, Range, log_uniform
from ..sensors.ideal import BodyState, Mounting, mounted
from .hand_held import Over
from .motion import Gesture, euler_motion
from .parts.composition import ComposedGesture, Gated, Intervals, displaced
from .parts.gait import MARGIN, Path, Steps, Swing
from .parts.impacts import Ringing
from .parts.noise import Noise

CARRIED_OVER = Over(
    clean_share=0.0,
    tremor_share=0.3,
    drift_share=0.0,
    taps_share=0.05,
    vibration_share=0.05,
    set_down_share=0.0,
    tissue_share=0.05,
)
"""Parts over a carried device: nobody sets it down."""
HARMONICS = 8
"""of the stride"""
STILL = Noise(0.0, 1.0, np.zeros((6, 3)))
"""No displacement."""


@dataclass(frozen=True)
class Carriage(Checked):
    """How the device is carried; ranges are log-uniform.

    Attributes:
        sway: vertical acceleration of the carrying part of the body, amplitude at the step frequency, m/s².
        swing: amplitude of the limb about the lateral axis at the stride frequency, rad.
        limb: distance of the device from the joint that the limb swings about, m.
        twist: amplitude about the other two axes, as a share of the swing.
        strike: peak acceleration of the shock that a heel strike sends up, m/s².
        rotation: share of a strike that turns the device, 1/m.
        looking: root mean square of the rate of slow turns of the device in the hand, rad/s.
        jitter: root mean square of the acceleration of small irregular movements, m/s².
        jitter_turn: root mean square of their angular rate per that acceleration, s/m.
    """

    sway: Range
    swing: Range
    limb: Range
    twist: Range
    strike: Range
    rotation: Range
    looking: Range
    jitter: Range
    jitter_turn: Range = (0.05, 1.0)


CARRIAGES = {
    "hand": Carriage(
        sway=(0.02, 3.0),
        swing=(0.005, 0.1),
        limb=(0.2, 0.4),
        twist=(0.3, 1.0),
        strike=(0.02, 6.0),
        rotation=(0.5, 6.0),
        looking=(0.1, 0.8),
        jitter=(0.02, 0.6),
    ),
    "swinging": Carriage(
        sway=(0.2, 3.5),
        swing=(0.25, 0.8),
        limb=(0.5, 0.75),
        twist=(0.1, 0.5),
        strike=(0.03, 6.0),
        rotation=(0.5, 4.0),
        looking=(0.1, 0.5),
        jitter=(0.02, 0.5),
    ),
    "pocket": Carriage(
        sway=(1.0, 3.5),
        swing=(0.15, 0.45),
        limb=(0.15, 0.4),
        twist=(0.1, 0.6),
        strike=(2.0, 15.0),
        rotation=(0.5, 6.0),
        looking=(0.02, 0.2),
        jitter=(0.1, 1.0),
    ),
}
"""In a hand held before the body, in a hand that swings, in a pocket of the trousers."""


def running(carriage: Carriage) -> Carriage:
    """The same when running: the body bounces with 8 to 20 m/s², and strikes are four times as strong."""
    return replace(
        carriage,
        sway=(6.0, 18.0),
        strike=(4.0 * carriage.strike[0], 4.0 * carriage.strike[1]),
        swing=(carriage.swing[0], 1.5 * carriage.swing[1]),
    )


@dataclass(frozen=True)
class WalkerGesture:
    """A device on a limb of somebody who walks along a path.

    Attributes:
        duration: length, s.
        path: of the trunk.
        swing: of trunk and limb, about the joint.
        lever: ``(3,)`` from the joint to the device, limb axes (x forward, y left, z up), m.
        attitude: ``(4,)`` of the device on the limb.
        height: of the joint, m.
    """

    duration: float
    path: Path
    swing: Swing
    lever: tuple[float, float, float]
    attitude: np.ndarray
    height: float = 1.2

    def sample(self, times: np.ndarray) -> BodyState:
        """The motion at ``times`` ``(T,)``, s."""
        times = np.asarray(times, dtype=float)
        curve, heading = self.path.curve.sample(times), self.path.heading.sample(times)
        place = [np.concatenate([part, np.zeros((len(times), 1))], axis=1) for part in curve]
        place[0][:, 2] = self.height
        orientation, turning, faster = euler_motion(
            tuple(np.concatenate([part, np.zeros((len(times), 2))], axis=1) for part in heading)  # type: ignore[arg-type]
        )
        trunk = BodyState(times, place[0], orientation, place[1], turning, place[2], faster)
        limb = displaced(trunk, *self.swing.sample(times))
        return mounted(limb, Mounting(self.lever, tuple(self.attitude.tolist())))


@dataclass(frozen=True)
class Carried(Checked):
    """A phone carried by somebody who walks or runs, with pauses: sway, swinging limbs, heel strikes, looking about.

    Levels and bands were set on the trials person1_Nexus5_AR, person1_Nexus5_Swinging and person2_Nexus5_FrontPocket of
    the smartphone benchmark (T. Michel et al., "On attitude estimation with smartphones", PerCom 2017), and widened
    once more where the other three lay outside, so no trial at hand is independent of them; the rest of the benchmark
    was not looked at. Those of running are our choice: no recording of it is at hand.

    Attributes:
        duration: length where none is asked for, s.
        running_share: of episodes in which they run.
        carriages: names of :data:`CARRIAGES`; an episode draws one.
        first_rest: at the start, standing, s.
        cadence: steps a second, 1/s; walking.
        running_cadence: likewise, running.
        speed: mean, m/s; walking; three times as fast running.
        standing_share: of episodes in which they stand all the time and only look about.
        step_jitter: standard deviation of a step's length, relative.
        turning: root mean square of the rate of turning of the walker, rad/s.
        walk: length of a walk, s.
        pause: length of a pause between two, s.
        ring: frequency at which a strike rings in the body, Hz.
        contact: rise of the strike, s.
        over: parts over the motion.
    """

    duration: float = 60.0
    running_share: float = 0.0
    carriages: tuple[str, ...] = ("hand", "swinging", "pocket")
    first_rest: Range = (1.0, 1.0)
    cadence: Range = (1.4, 2.2)
    running_cadence: Range = (2.3, 3.1)
    speed: Range = (0.6, 1.8)
    standing_share: float = 0.2
    step_jitter: Range = (0.008, 0.1)
    turning: Range = (0.1, 0.8)
    walk: Range = (10.0, 120.0)
    pause: Range = (1.0, 10.0)
    ring: Range = (5.0, 25.0)
    contact: Range = (0.01, 0.06)
    over: Over = field(default_factory=lambda: CARRIED_OVER)

    def __post_init__(self) -> None:
        super().__post_init__()
        unknown = [name for name in self.carriages if name not in CARRIAGES]
        if unknown or not self.carriages:
            raise ValueError(f"carriages must be one or more of {', '.join(CARRIAGES)}, got {self.carriages}")

    def draw(self, generator: np.random.Generator, duration: float | None = None) -> Gesture:
        """Draw a motion."""
        duration = self.duration if duration is None else duration
        motion, over = generator.spawn(2)
        carriage = CARRIAGES[self.carriages[motion.integers(len(self.carriages))]]
        runs = motion.random() < self.running_share
        if runs:
            carriage = running(carriage)
        start, cadence = (
            log_uniform(motion, self.first_rest),
            log_uniform(motion, self.running_cadence if runs else self.cadence),
        )
        walks = self._walks(motion, start, duration)
        steps = Steps.draw(motion, duration, cadence, log_uniform(motion, self.step_jitter))
        speed = log_uniform(motion, self.speed) * (3.0 if runs else 1.0)
        path = Path.draw(motion, duration, speed, log_uniform(motion, self.turning), walks)
        swing = self._swing(motion, carriage, steps, cadence, walks, duration)
        lever = (0.0, 0.0, -log_uniform(motion, carriage.limb))
        walker = WalkerGesture(duration, path, swing, lever, rotation.random(motion))
        parts = self._strikes(motion, carriage, steps, walks), *self._hand(motion, carriage, start, duration)
        gesture = ComposedGesture(walker, parts)
        return self.over.lay(over, gesture, ((start, duration),) if start < duration else (), start)

    def _walks(self, generator: np.random.Generator, start: float, duration: float) -> Intervals:
        """When one walks."""
        walk, pause, walks = log_uniform(generator, self.walk), log_uniform(generator, self.pause), []
        standing = generator.random() < self.standing_share
        while start < duration and not standing:
            end = start + max(2.0, walk * generator.uniform(0.5, 1.5))
            walks.append((start, end))
            start = end + pause * generator.uniform(0.5, 1.5)
        return tuple(walks)

    def _swing(
        self,
        generator: np.random.Generator,
        carriage: Carriage,
        steps: Steps,
        cadence: float,
        walks: Intervals,
        duration: float,
    ) -> Swing:
        """Sway of the trunk and swing of the limb: harmonics of the stride that decay, even ones of the step."""
        k = np.arange(1, HARMONICS + 1)
        w = math.pi * cadence * k
        # up and forward in step with every foot (even harmonics), sideways with every stride (odd ones)
        even, odd = (k % 2 == 0).astype(float), (k % 2).astype(float)
        sway = log_uniform(generator, carriage.sway)
        decay = generator.uniform(1.0, 5.0)
        sizes = np.zeros((HARMONICS, 6))
        sizes[:, 0] = 0.5 * sway * even * (k / 2.0) ** -decay / w**2
        sizes[:, 1] = 0.4 * sway * odd * k**-decay / w**2
        sizes[:, 2] = sway * even * (k / 2.0) ** -decay / w**2
        # limbs swing once a stride, with some of the higher harmonics
        angle = log_uniform(generator, carriage.swing)
        smooth = k ** -generator.uniform(1.0, 5.0)
        twist = [log_uniform(generator, carriage.twist) for _ in range(2)]
        sizes[:, 3:] = angle * smooth[:, None] * np.array([twist[0], 1.0, twist[1]])
        sizes *= np.exp(generator.normal(0.0, 0.4, sizes.shape))
        phase = generator.uniform(-np.pi, np.pi, sizes.shape)
        amplitude = Noise.draw(
            generator, duration + MARGIN, (0.05, 0.5), generator.uniform(0.05, 0.4), derivative=0, size=1
        )
        return Swing(steps, sizes * np.cos(phase), sizes * np.sin(phase), amplitude, walks)

    def _strikes(self, generator: np.random.Generator, carriage: Carriage, steps: Steps, walks: Intervals) -> Ringing:
        """Shocks at every step: mostly along one direction, which turns the device as well."""
        times = steps.strikes
        inside = np.zeros(len(times), bool)
        for start, end in walks:
            inside |= (times > start + 0.5) & (times < end - 0.5)
        times = times[inside]
        peaks = log_uniform(generator, carriage.strike) * np.exp(generator.normal(0.0, 0.3, len(times)))
        main = rotation.normalize(generator.standard_normal(3))
        direction = rotation.normalize(main + 0.3 * generator.standard_normal((len(times), 3)))
        lever = log_uniform(generator, carriage.rotation) * rotation.normalize(generator.standard_normal(3))
        acceleration = peaks[:, None] * direction
        vectors = np.concatenate([acceleration, rotation.cross(lever, acceleration)], axis=1)
        contact, ring = log_uniform(generator, self.contact), log_uniform(generator, self.ring)
        spread = np.exp(generator.normal(0.0, 0.15, (2, len(times))))
        return Ringing(times, vectors, contact * spread[0], ring * spread[1], float(generator.uniform(0.15, 0.5)))

    def _hand(
        self, generator: np.random.Generator, carriage: Carriage, start: float, duration: float
    ) -> tuple[Gated, Gated]:
        """Slow turns of the device in the hand, and small irregular movements."""
        end = max(duration, start + 0.1)
        levels = (log_uniform(generator, each) for each in (carriage.looking, carriage.jitter, carriage.jitter_turn))
        looking, jitter, turn = (level / math.sqrt(3.0) for level in levels)

        def noise(band: Range, level: float, derivative: int) -> Noise:
            return Noise.draw(generator, end - start, band, level, derivative=derivative, steepness=1, start=start)

        slow = Gated(((start, end),), 0.5, STILL, noise((0.05, 0.6), looking, 1))
        quick = noise((0.5, 4.0), jitter, 2), noise((0.5, 5.0), jitter * turn * math.sqrt(3.0), 1)
        return slow, Gated(((start, end),), 0.5, *quick)
