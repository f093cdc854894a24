r"""Averages of force and field in axes that the gyroscope keeps still, which tell where up and north are, roughly.

    m ← exp(ω Δt)* m,   m ← m + k (f − m),   k = Δt / min(t + Δt, T)

Accelerations of something that stays nearby average out, so the mean force points up (the first half of VQF's idea: D.
Laidig, T. Seel, Information Fusion 91, 2023, section 3.1). An average is trusted if it was formed for a second and is
not short beside the root mean square of its samples, as it would be with a gyroscope in other units, without gravity or
in free fall.

Until a start has been confirmed, samples of two directions must not be mixed: a start from both is as wrong as their
share. Three rules let an average begin anew. One of a few samples begins with a sample that contradicts it, and so does
the estimator; after these few a sample that points elsewhere decides nothing, as a hand that is flung up and checked
feels forces from any direction. One that later samples make too short to be trusted begins with them. And one of forces
begins with the average force of the last moment where that is steady and contradicts it: in strong motion it is not.
It does so once in a while only.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .backend import Array, namespace
from .rotation import rotate_back

AVERAGED = 3.0
"""T, s: time constant of the averages."""
SETTLED = 1.0
"""s of averaging before an average is trusted."""
SHORTEST_FORCE, SHORTEST_FIELD = 0.2, 0.9
"""Least length of an average, in root mean squares of its samples."""
GYROSCOPE_GAP = 0.1
"""s without a gyroscope after which averaging begins anew."""
LARGEST_CHANGE = math.radians(30.0)
"""Angle between an average and the next sample beyond which they contradict each other, while one sample or less than
:data:`FEW` have been averaged."""
FEW = 0.05
"""s"""
MOMENT = 0.15
"""s: time constant of the average force of the last moment."""
LARGEST_MOVE = math.radians(20.0)
"""Angle between it and the average force beyond which the latter is of samples of two directions."""
STEADY = 0.8
"""Least length of the average of a moment, in root mean squares of its samples, that says so."""
PAUSE = 3.0
"""s for which no other moment does so: what moments contradict again and again is a motion, such as that of an arm that
swings, and an average that began anew each time would never be trusted."""


class Average(NamedTuple):
    """An average of vectors.

    Attributes:
        mean: ``(..., 3)`` in sensor axes.
        square: ``(..., 1)`` mean square of the samples.
        time: ``(..., 1)`` s for which it was formed, at most :data:`AVERAGED`.
    """

    mean: Array
    square: Array
    time: Array


class Step(NamedTuple):
    """What a time step is for all averages.

    Attributes:
        turn: ``(..., 4)`` rotation of the sensor in the interval.
        dt: ``(..., 1)`` s.
        broken: ``(..., 1)`` whether the gyroscope was missing for too long.
        unconfirmed: ``(..., 1)`` whether the start has not been confirmed yet.
    """

    turn: Array
    dt: Array
    broken: Array
    unconfirmed: Array


def averaged(memory: Array, sample: Array, step: Step, shortest: float, mixed: Array) -> tuple[Average, Array]:
    """The average after a sample, and whether the sample contradicts the few before it.

    Args:
        memory: ``(..., 5)`` mean, mean square and time before.
        sample: ``(..., 3)``; NaN where there is none.
        step: the time step.
        shortest: least length of an average that is trusted, in root mean squares.
        mixed: ``(..., 1)`` whether one that is shorter begins anew.
    """
    xp, there = namespace(memory, sample), present(sample)
    dt, zero = step.dt, 0.0 * step.dt
    sample = xp.where(there, sample, xp.zeros_like(sample))
    mean, square = rotate_back(step.turn, memory[..., :3]), memory[..., 3:4]
    time = xp.where(step.broken, zero, memory[..., 4:5])
    few = xp.logical_or(xp.less(time, 1.5 * dt), xp.less(time, FEW))
    lengths = xp.sqrt(xp.sum(mean * mean, axis=-1) * xp.sum(sample * sample, axis=-1) + 1e-30)[..., None]
    along = xp.sum(mean * sample, axis=-1)[..., None]
    contrary = xp.logical_and(there, xp.less(along, math.cos(LARGEST_CHANGE) * lengths))
    begun = xp.logical_and(xp.greater(time, 0.0), few)
    contrary = xp.logical_and(contrary, xp.logical_and(begun, step.unconfirmed))
    time = xp.where(contrary, zero, time)
    longer = time + dt
    longer = xp.where(xp.greater(longer, AVERAGED), zero + AVERAGED, longer)
    mean, square = blended(mean, square, sample, xp.where(there, dt / longer, zero))
    time = xp.where(there, longer, time)
    # Samples that point elsewhere shorten the average: what was before them must not bend it. From here on the few
    # samples behind it do not make a start that the next one could contradict.
    short = xp.less(xp.sum(mean * mean, axis=-1)[..., None], shortest**2 * square)
    short = xp.logical_and(xp.logical_and(there, mixed), xp.logical_and(short, xp.greater(time, FEW)))
    mean, square = xp.where(short, sample, mean), xp.where(short, squared(sample), square)
    return Average(mean, square, xp.where(short, zero + FEW + dt, time)), contrary


def of_moment(mean: Array, square: Array, sample: Array, step: Step, time: Array) -> tuple[Array, Array]:
    """Average force ``(..., 3)`` of the last moment and mean square ``(..., 1)`` of its samples, after a sample.

    Args:
        mean: before.
        square: before.
        sample: ``(..., 3)``; NaN where there is none.
        step: the time step.
        time: ``(..., 1)`` s for which the average force was formed, this sample included.
    """
    xp = namespace(mean, sample)
    mean = rotate_back(step.turn, mean)
    share = step.dt / xp.where(xp.less(time, MOMENT), time + 1e-9, 0.0 * time + MOMENT)
    there = xp.logical_and(present(sample), xp.less(share, 1.0 + 1e-6))
    after, scattered = blended(mean, square, sample, share)
    return xp.where(there, after, mean), xp.where(there, scattered, square)


def left_behind(
    force: Average, lately: Array, scattered: Array, calm: Array, step: Step
) -> tuple[Average, Array, Array]:
    """The average force, begun anew if a steady moment contradicts it; whether it does; s since it did.

    Args:
        force: the average.
        lately: ``(..., 3)`` that of the last moment.
        scattered: ``(..., 1)`` mean square of its samples.
        calm: ``(..., 1)`` s since the last moment that did, from -:data:`PAUSE`, or since the start.
        step: the time step.
    """
    xp, size = namespace(lately), squared(lately)
    lengths = xp.sqrt(size * squared(force.mean) + 1e-30)
    moved = xp.less(xp.sum(lately * force.mean, axis=-1)[..., None], math.cos(LARGEST_MOVE) * lengths)
    moved = xp.logical_and(moved, xp.greater(size, STEADY**2 * scattered))
    moved = xp.logical_and(xp.logical_and(moved, step.unconfirmed), xp.greater(force.time, MOMENT))
    moved = xp.logical_and(moved, xp.greater_equal(calm, 0.0))
    begun = Average(lately, size, 0.0 * step.dt + FEW + step.dt)
    calm = xp.where(moved, 0.0 * calm - PAUSE, calm + step.dt)
    return Average(*(xp.where(moved, new, old) for new, old in zip(begun, force, strict=True))), moved, calm


def trusted(average: Average, shortest: float) -> Array:
    """Whether an average ``(..., 1)`` was formed for long enough, and of samples that agree."""
    xp = namespace(average.mean)
    long = xp.greater(squared(average.mean), shortest**2 * average.square)
    return xp.logical_and(xp.greater_equal(average.time, SETTLED), long)


def blended(mean: Array, square: Array, sample: Array, share: Array) -> tuple[Array, Array]:
    """Mean and mean square of vectors, drawn towards a sample by its share ``(..., 1)``."""
    return mean + share * (sample - mean), square + share * (squared(sample) - square)


def squared(vector: Array) -> Array:
    """Squared length ``(..., 1)``."""
    return namespace(vector).sum(vector * vector, axis=-1)[..., None]


def present(sample: Array) -> Array:
    """Whether all coordinates of a sample are finite ``(..., 1)``."""
    xp = namespace(sample)
    return xp.all(xp.isfinite(sample), axis=-1)[..., None]
