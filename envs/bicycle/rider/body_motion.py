"""Random movements of a rider's body as smooth tables over time: coloured noise, posture changes, glances, breathing.

A table has one row every 1 / :data:`TABLE_RATE` s and is read by cubic interpolation, so that the motion is a function
of time alone, whatever the rates of control and sensors. A longer ride with the same seed begins with the same motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.signal import lfilter

from ....filters.compile.cache import jit

TABLE_RATE = 50.0
"""Hz"""
CHANNELS = ("flexion", "lean", "twist", "arm_left", "arm_right", "leg_left", "leg_right", "hands")
"""columns of a table: trunk, swivel of the limbs (rad), torque of unsteady hands (N·m); of a rider who stands up
another one, see :func:`standing_phases`"""
TRUNK, SWIVEL, HANDS, STANDING = slice(0, 3), slice(3, 7), 7, 8
CORNERS = (*[0.4] * 3, *[0.15] * 4, 1.0)
"""Hz: corner of each channel's noise. Above it the spectrum of the angle falls with 1/f² and that of its rate is flat,
as the chest sensor's of a recorded ride between 0.5 and 2 Hz"""
SMOOTHEST = 6.0
"""Hz: above it muscles move the trunk ever less: two more first-order lags"""
WARM_UP = 4.0
"""s of noise before the ride, in which the lags settle"""
SHIFT_TIME, GLANCE_TIME = (0.5, 1.5), (0.3, 0.5)
"""s: from one posture to another, and into a glance"""
GLANCE_HOLD = (0.3, 1.2)
"""s: looking aside"""
NODS, LOOKS_AHEAD, ACROSS = 0.4, 0.1, 0.8
"""1: pitch relative to yaw of the head's turns, share of looks that return ahead, and share of the others that go to
the other side than the last one; assumed"""
TURN_TIME, TURN_PACE = 0.3, 0.25
"""s, and s/rad: how long a turn of the head lasts. 38 deg peak at 155 deg/s: free movements of people reach 185 deg/s,
and voluntary ones far more (Grossman et al., Exp. Brain Res. 70, 1988)"""
STAND_TIME, RISE_TIME = (15.0, 30.0), 1.0
"""s: on the pedals at a time, and to get up or sit down"""
BREATHING_RATE = (0.25, 0.5)
"""Hz: 15 to 30 breaths a minute, from rest to moderate work"""


def coloured_noise(rng: np.random.Generator, deviations: np.ndarray, rows: int) -> np.ndarray:
    """Gauss–Markov noise ``(rows, channels)`` of given standard deviations, smoothed.

    Args:
        rng: draws row after row, so that fewer rows are the beginning of more.
        deviations: ``(channels,)`` of the noise before it is smoothed.
        rows: how many.
    """
    before = round(WARM_UP * TABLE_RATE)
    noise = rng.standard_normal((before + rows, len(deviations)))
    lag = math.exp(-2.0 * math.pi * SMOOTHEST / TABLE_RATE)
    for channel, corner in enumerate(CORNERS):
        keep = math.exp(-2.0 * math.pi * corner / TABLE_RATE)
        noise[1:, channel] *= math.sqrt(1.0 - keep**2)
        noise[:, channel] = lfilter([1.0], [1.0, -keep], noise[:, channel])
    for _ in range(2):
        noise = lfilter([1.0 - lag], [1.0, -lag], noise, axis=0)
    return noise[before:] * deviations


def events(rng: np.random.Generator, interval: float, duration: float) -> Iterator[float]:
    """Times (s) that are ``interval`` apart on average, exponentially distributed; none if it is infinite."""
    time = float(rng.exponential(interval)) if math.isfinite(interval) else math.inf
    while time < duration:
        yield time
        time += float(rng.exponential(interval))


def smooth_step(time: np.ndarray, begin: float, length: float) -> np.ndarray:
    """From 0 to 1 within ``length`` seconds with continuous velocity and acceleration."""
    part = np.clip((time - begin) / length, 0.0, 1.0)
    return part**3 * (10.0 - 15.0 * part + 6.0 * part**2)


def posture_changes(rng: np.random.Generator, time: np.ndarray, deviation: float, interval: float) -> np.ndarray:
    """Change of flexion, lean and twist ``(n, 3)``: held, and now and then another one."""
    now = deviation * rng.standard_normal(3)
    found = np.tile(now, (len(time), 1))
    for begin in events(rng, interval, float(time[-1])):
        following = deviation * rng.standard_normal(3)
        found += smooth_step(time, begin, float(rng.uniform(*SHIFT_TIME)))[:, None] * (following - now)
        now = following
    return found


def glances(rng: np.random.Generator, time: np.ndarray, turn: float, interval: float) -> np.ndarray:
    """Turns ``(n,)`` of the trunk to either side and back, in looks over a shoulder; ``turn`` rad."""
    found = np.zeros(len(time))
    for begin in events(rng, interval, float(time[-1])):
        size = to_a_side(rng, turn)
        there, hold, back = (float(rng.uniform(*each)) for each in (GLANCE_TIME, GLANCE_HOLD, GLANCE_TIME))
        found += there_and_back(time, begin, size, (there, hold, back))
    return found


def scans(rng: np.random.Generator, time: np.ndarray, turn: float, interval: float) -> np.ndarray:
    """Turns ``(n,)`` of the head to either side and back, at the pace of :func:`turn_time`; ``turn`` rad."""
    found = np.zeros(len(time))
    for begin in events(rng, interval, float(time[-1])):
        size = to_a_side(rng, turn)
        length = turn_time(size)
        found += there_and_back(time, begin, size, (length, float(rng.uniform(*GLANCE_HOLD)), length))
    return found


def to_a_side(rng: np.random.Generator, turn: float) -> float:
    """An angle (rad) of half to one and a half times ``turn``, to either side."""
    return turn * float(rng.uniform(0.5, 1.5)) * (1.0 if rng.random() < 0.5 else -1.0)


def there_and_back(time: np.ndarray, begin: float, size: float, lengths: tuple[float, float, float]) -> np.ndarray:
    """A turn ``(n,)`` by ``size`` (rad) that takes, rests and returns for these times (s)."""
    there, hold, back = lengths
    return size * (smooth_step(time, begin, there) - smooth_step(time, begin + there + hold, back))


def turn_time(angle: float) -> float:
    """Time (s) that the head takes to turn by an angle (rad)."""
    return TURN_TIME + TURN_PACE * abs(angle)


def gaze_shifts(rng: np.random.Generator, time: np.ndarray, deviation: float, interval: float) -> np.ndarray:
    """Yaw and pitch of the head ``(n, 2)`` towards what the rider looks at: held, and now and then elsewhere.

    A look goes ahead, or to a side, mostly the other one than before; a turn begins when the last one has ended, and
    takes the time of :func:`turn_time`. Deviations of pitch are :data:`NODS` of those of yaw. Before the first look the
    rider looks ahead.
    """
    now, side, found = np.zeros(2), 1.0, np.zeros((len(time), 2))
    begin = next(events(rng, interval, float(time[-1])), math.inf)
    while begin < time[-1]:
        ahead, across = rng.random(2) < (LOOKS_AHEAD, ACROSS)
        where = deviation * rng.standard_normal(2) * (1.0, NODS)
        if ahead:
            where = np.zeros(2)
        else:
            side = -side if across else side
            where[0] = side * abs(where[0])
        length = turn_time(math.hypot(*(where - now)))
        found += smooth_step(time, begin, length)[:, None] * (where - now)
        now = where
        begin += length + float(rng.exponential(max(0.0, interval - length)))
    return found


def standing_phases(rng: np.random.Generator, time: np.ndarray, share: float) -> np.ndarray:
    """How far a rider has got up from the saddle ``(n,)``, from 0 to 1 on the pedals; seated at first.

    Args:
        rng: source of randomness.
        time: s.
        share: of the time that the rider stands, above 0.
    """
    found, begin = np.zeros(len(time)), RISE_TIME
    while begin < time[-1]:
        length = float(rng.uniform(*STAND_TIME))
        found += smooth_step(time, begin, RISE_TIME)
        if share < 1.0:
            found -= smooth_step(time, begin + length, RISE_TIME)
            begin += length / share
        else:
            break
    return found


def breathing(rng: np.random.Generator, time: np.ndarray, amplitude: float) -> np.ndarray:
    """Flexion of the trunk ``(n,)`` with each breath; the breaths vary in length."""
    rate, phase = float(rng.uniform(*BREATHING_RATE)), float(rng.uniform(0.0, 2.0 * math.pi))
    wander = np.cumsum(rng.standard_normal(len(time))) * math.sqrt(rate / TABLE_RATE)
    return amplitude * np.sin(2.0 * math.pi * rate * time + phase + wander)


@jit
def row_at(table, time):  # type: ignore[no-untyped-def]
    """Row of a table at a time (s), by cubic (Catmull–Rom) interpolation; the first row is of one step before 0."""
    place = time * TABLE_RATE
    index = math.floor(place)
    t = place - index
    before = -0.5 * t + t**2 - 0.5 * t**3
    now = 1.0 - 2.5 * t**2 + 1.5 * t**3
    after = 0.5 * t + 2.0 * t**2 - 1.5 * t**3
    later = -0.5 * t**2 + 0.5 * t**3
    return before * table[index] + now * table[index + 1] + after * table[index + 2] + later * table[index + 3]


def rows_at(table: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of a table ``(n, size)`` at many times (s) as :func:`row_at`, with their first and second derivatives."""
    place = time * TABLE_RATE
    index = np.floor(place).astype(int)
    t = (place - index)[:, None]
    p0, p1, p2, p3 = (table[index + each] for each in range(4))
    a, b, c = 0.5 * (p2 - p0), p0 - 2.5 * p1 + 2.0 * p2 - 0.5 * p3, 0.5 * (p3 - p0) + 1.5 * (p1 - p2)
    values = p1 + t * (a + t * (b + t * c))
    return values, TABLE_RATE * (a + t * (2.0 * b + 3.0 * t * c)), TABLE_RATE**2 * (2.0 * b + 6.0 * t * c)
