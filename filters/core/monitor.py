r"""Whether an estimator still knows where up and north are, and where they are if it does not.

Independent of the estimator, specific force and magnetic field are averaged in axes that the gyroscope keeps still:

    m ← exp(ω Δt)* m,   m ← m + k (f − m),   k = Δt / min(t + Δt, T)

Accelerations of something that stays nearby average out, so m points up, roughly (the first half of VQF's idea: D.
Laidig, T. Seel, Information Fusion 91, 2023, section 3.1). It is trusted if it was averaged for a second and is not
short beside the root mean square of its samples, as it would be with a gyroscope in other units, without gravity or in
free fall. An estimate that contradicts a trusted average by more than any acceleration can for longer than
:data:`PATIENCE` is lost: it starts anew, from the averages. So neither a bad first sample nor a long gap decides for
good. The heading is watched until it has been confirmed once; after that the field may be disturbed, and only the
estimator decides. The inclination of a method without covariance is watched until then, too: what it makes of its drift
later is its own. Equations that keep the field of their start for good, dip included, are watched more closely until
then: a wrong dip turns their estimate for ever, and an error about the field's direction, which their magnetometer does
not see, hardly decays. Their dip and their east are compared with those of both averages.

Until a start has been confirmed, an average that later samples make too short to be trusted begins anew with them: it
held samples of two directions, and a start from both is as wrong as their share. So does one of forces that a steady
average of the last moment contradicts: in the mean of both directions a filter sees no contradiction, and takes the
rest for a bias of its gyroscope; what was contradicted so needs hardly any patience. In strong motion a moment is not
steady and decides nothing.

Two rules need no patience. An average of a few samples that the next one contradicts starts anew with that sample, and
so does the estimator, until a start has been confirmed. After these few a sample that points elsewhere decides
nothing: a hand that is flung up and checked feels forces from any direction. And a force that no motion explains
(:func:`without_impacts`) counts as missing for a moment.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from .backend import Array, constant, expand, namespace
from .model import Equations
from .quantity import ACCELEROMETER, GYROSCOPE, MAGNETOMETER, Channel, Quantity
from .rotation import cross, exp, rotate, rotate_back, up_in_body

AVERAGED = 3.0
"""T, s: time constant of the averages."""
SETTLED = 1.0
"""s of averaging before an average is trusted."""
LARGEST_LEAN, LARGEST_LEAN_AT_START = math.radians(40.0), math.radians(20.0)
"""Angle between estimated and averaged vertical beyond which they contradict each other: for good, and until they have
agreed, to half the latter, for :data:`CONFIRMED`."""
LARGEST_TURN = math.radians(15.0)
"""The same for the heading, which is watched until then only."""
LARGEST_ERROR = math.radians(10.0)
"""The same for dip and east of equations that keep the field of their start."""
PATIENCE = 1.5
"""s for which they must do so."""
REST_OF_PATIENCE = 0.2
"""What is left of it where the average force began anew, as the last moment had contradicted it."""
CONFIRMED = 2.0
"""s of agreement after which the inclination of a start counts as good."""
CONFIRMED_HEADING = 8.0
"""The same for the heading. After a start with a wrong inclination a filter takes every sample of the field for
disturbed until it has learned the field anew, and the heading drifts away meanwhile."""
GYROSCOPE_GAP = 0.1
"""s without a gyroscope after which averaging begins anew."""
SHORTEST_FORCE, SHORTEST_FIELD = 0.2, 0.9
"""Least length of an average, in root mean squares of its samples."""
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
IMPACT, IMPACT_SHARE = 300.0, 10.0
"""m/s² and root mean squares of the samples before: a force that exceeds both is no sample. The first is more than all
axes of a sensor with a range of ±16 g can show together."""
LONGEST_IMPACT = 0.05
"""s for which such samples count as missing; what lasts longer is a motion."""
INFLATION = 4.0
"""Factor on the covariance of a prior that is formed of averages in motion."""

INPUTS = 20
"""Of :func:`watch`: rate (3), force (3), field (3), up (3), orientation (4), age of the rate, dt, declination, and
whether the inclination is watched for good (1) or until it was confirmed (0). One more where equations keep the field
of their start: its vertical component."""
MEMORY = 19
"""Of :func:`watch`: average force (3), mean square, time, time of contradiction; the same of the field (3, 1, 1, 1);
times of agreement of the heading and of the inclination; zero, or if the estimate is lost the factor on the covariance
of its prior; average force of the last moment (3), its mean square."""
FORCE, SQUARE, TIME, FIELD, FIELD_TIME, LOST, LATELY = slice(0, 3), 3, 4, slice(6, 9), 10, 14, slice(15, 18)
"""Where some of it is."""


def watch(memory: Array, inputs: Array) -> Array:
    """Memory ``(..., 19)`` after a sample; the estimator starts anew at the next one if it is lost.

    Args:
        memory: ``(..., 19)``; zeros at the start.
        inputs: ``(..., 20)`` or ``(..., 21)``; force and field NaN where there is no sample, the vertical NaN for
            that of the orientation.
    """
    xp = namespace(memory, inputs)
    rate, up, q = inputs[..., :3], inputs[..., 9:12], inputs[..., 12:16]
    up = xp.where(xp.isfinite(up), up, up_in_body(q))
    age, dt, declination, always = (inputs[..., i : i + 1] for i in (16, 17, 18, 19))
    turn = exp(rate * dt)
    broken = xp.greater(age, GYROSCOPE_GAP)
    zero = 0.0 * dt
    unconfirmed = xp.less(memory[..., 13:14], CONFIRMED)

    def averaged(part: Array, sample: Array, shortest: float) -> tuple[Array, Array, Array, Array]:
        there = xp.all(xp.isfinite(sample), axis=-1)[..., None]
        sample = xp.where(there, sample, xp.zeros_like(sample))
        mean, square = rotate_back(turn, part[..., :3]), part[..., 3:4]
        time = xp.where(broken, zero, part[..., 4:5])
        few = xp.logical_or(xp.less(time, 1.5 * dt), xp.less(time, FEW))
        lengths = xp.sqrt(xp.sum(mean * mean, axis=-1) * xp.sum(sample * sample, axis=-1) + 1e-30)[..., None]
        contrary = xp.logical_and(
            there, xp.less(xp.sum(mean * sample, axis=-1)[..., None], math.cos(LARGEST_CHANGE) * lengths)
        )
        begun = xp.logical_and(xp.greater(time, 0.0), few)
        contrary = xp.logical_and(contrary, xp.logical_and(begun, unconfirmed))
        time = xp.where(contrary, zero, time)
        longer = time + dt
        share = xp.where(there, dt / xp.where(xp.greater(longer, AVERAGED), zero + AVERAGED, longer), zero)
        time = xp.where(there, xp.where(xp.greater(longer, AVERAGED), zero + AVERAGED, longer), time)
        squared = xp.sum(sample * sample, axis=-1)[..., None]
        mean, square = mean + share * (sample - mean), square + share * (squared - square)
        # Samples that point elsewhere shorten the average: what was before them must not bend it. From here on the few
        # samples behind it do not make a start that the next one could contradict.
        short = xp.less(xp.sum(mean * mean, axis=-1)[..., None], shortest**2 * square)
        short = xp.logical_and(xp.logical_and(there, unconfirmed), xp.logical_and(short, xp.greater(time, FEW)))
        mean, square = xp.where(short, sample, mean), xp.where(short, squared, square)
        return mean, square, xp.where(short, zero + FEW + dt, time), contrary

    def trusted(mean: Array, square: Array, time: Array, shortest: float) -> Array:
        length = xp.sum(mean * mean, axis=-1)[..., None]
        return xp.logical_and(xp.greater_equal(time, SETTLED), xp.greater(length, shortest**2 * square))

    force, force_square, force_time, force_contrary = averaged(memory[..., :6], inputs[..., 3:6], SHORTEST_FORCE)
    lately, sample = rotate_back(turn, memory[..., LATELY]), inputs[..., 3:6]
    share = dt / xp.where(xp.less(force_time, MOMENT), force_time + 1e-9, zero + MOMENT)
    there = xp.logical_and(xp.all(xp.isfinite(sample), axis=-1)[..., None], xp.less(share, 1.0 + 1e-6))
    lately = xp.where(there, lately + share * (sample - lately), lately)
    scattered, size = memory[..., 18:19], xp.sum(sample * sample, axis=-1)[..., None]
    scattered = xp.where(there, scattered + share * (size - scattered), scattered)
    squared = xp.sum(lately * lately, axis=-1)[..., None]
    lengths = xp.sqrt(squared * xp.sum(force * force, axis=-1)[..., None] + 1e-30)
    moved = xp.less(xp.sum(lately * force, axis=-1)[..., None], math.cos(LARGEST_MOVE) * lengths)
    moved = xp.logical_and(moved, xp.greater(squared, STEADY**2 * scattered))
    moved = xp.logical_and(xp.logical_and(moved, unconfirmed), xp.greater(force_time, MOMENT))
    force, force_square = xp.where(moved, lately, force), xp.where(moved, squared, force_square)
    force_time = xp.where(moved, zero + FEW + dt, force_time)
    field, field_square, field_time, field_contrary = averaged(memory[..., 6:12], inputs[..., 6:9], SHORTEST_FIELD)
    upright = trusted(force, force_square, force_time, SHORTEST_FORCE)
    aligned = xp.sum(up * force, axis=-1)[..., None]
    length = xp.sqrt(xp.sum(force * force, axis=-1)[..., None] + 1e-30)
    standing = xp.logical_and(upright, xp.greater(aligned, math.cos(0.5 * LARGEST_LEAN_AT_START) * length))
    stood = xp.where(moved, zero, xp.where(standing, memory[..., 13:14] + dt, memory[..., 13:14]))
    confirmed = xp.greater_equal(stood, CONFIRMED)
    least = xp.where(confirmed, zero + math.cos(LARGEST_LEAN), zero + math.cos(LARGEST_LEAN_AT_START))
    leaning = xp.logical_and(upright, xp.less(aligned, least * length))
    leant = xp.where(leaning, memory[..., 5:6] + dt, xp.where(upright, zero, memory[..., 5:6]))
    # Samples of two directions are a contradiction already: the filter must not take it for a bias meanwhile.
    leant = xp.where(moved, zero + (PATIENCE - REST_OF_PATIENCE), leant)

    world = rotate(q, field)
    east, north = world[..., :1], world[..., 1:2]
    s, c = xp.sin(declination), xp.cos(declination)
    along, across = east * s + north * c, east * c - north * s
    horizontal = xp.sqrt(along * along + across * across + 1e-30)
    heading = xp.logical_and(
        xp.logical_and(upright, xp.logical_not(leaning)), trusted(field, field_square, field_time, SHORTEST_FIELD)
    )
    turned = xp.logical_and(heading, xp.less(along, math.cos(LARGEST_TURN) * horizontal))
    # A heading counts as right with a right inclination only: a wrong one turns it while it is corrected.
    agreeing = xp.logical_and(standing, xp.greater(along, math.cos(0.5 * LARGEST_TURN) * horizontal))
    agreeing = xp.logical_and(heading, agreeing)
    if inputs.shape[-1] > INPUTS:
        supposed = inputs[..., INPUTS : INPUTS + 1]
        lengths = xp.sqrt(xp.sum(force * force, axis=-1) * xp.sum(field * field, axis=-1) + 1e-60)[..., None]
        sine = xp.sum(force * field, axis=-1)[..., None] / lengths
        cosine = xp.sqrt(1.0 + 1e-9 - sine * sine)
        supposed_cosine = xp.sqrt(1.0 + 1e-9 - supposed * supposed)
        dip = sine * supposed + cosine * supposed_cosine
        eastwards = rotate(q, cross(field, force)) / (cosine * lengths)
        about = eastwards[..., :1] * c - eastwards[..., 1:2] * s
        least = xp.where(xp.less(dip, about), dip, about)
        turned = xp.logical_or(turned, xp.logical_and(heading, xp.less(least, math.cos(LARGEST_ERROR))))
        agreeing = xp.logical_and(agreeing, xp.greater(least, math.cos(0.5 * LARGEST_ERROR)))
    off = xp.where(turned, memory[..., 11:12] + dt, xp.where(heading, zero, memory[..., 11:12]))
    agreed = xp.where(agreeing, memory[..., 12:13] + dt, memory[..., 12:13])

    watched = xp.logical_or(xp.greater(always, 0.5), xp.logical_not(confirmed))
    lost = xp.logical_or(
        xp.logical_and(xp.greater(leant, PATIENCE), watched),
        xp.logical_and(xp.greater(off, PATIENCE), xp.less(agreed, CONFIRMED_HEADING)),
    )
    early = xp.logical_or(force_contrary, field_contrary)
    leant, off, agreed = (xp.where(xp.logical_or(lost, early), zero, value) for value in (leant, off, agreed))
    parts = [force, force_square, force_time, leant, field, field_square, field_time, off, agreed, stood]
    factor = xp.where(early, zero + 1.0, xp.where(lost, zero + INFLATION, zero))
    return xp.concat([*parts, factor, lately, scattered], axis=-1)


@dataclass(frozen=True)
class Places:
    """Where the inputs of :func:`watch` are found: first element in a sample, a pose or a state; −1 for none."""

    rate: int
    force: int
    field: int
    up: int
    orientation: int
    supposed: int
    """in the state: the unit field in the world that equations keep"""


def places_of(model: Equations) -> Places | None:
    """Where a recursion finds what the monitor needs; None for a model that cannot be watched.

    It can if it reads one inertial sensor and estimates the inclination.
    """
    samples, pose = starts_of(model.channels), starts_of(model.outputs)
    heading = MAGNETOMETER.name in samples and "orientation" in pose
    orientation = pose.get("orientation", pose.get("relative_orientation", -1))
    up = pose.get("up", -1)
    if not ({GYROSCOPE.name, ACCELEROMETER.name} <= samples.keys() and max(up, orientation) >= 0):
        return None
    field = samples[MAGNETOMETER.name] if heading else -1
    supposed = model.supposed_field if heading else -1
    return Places(samples[GYROSCOPE.name], samples[ACCELEROMETER.name], field, up, orientation, supposed)


def starts_of(parts: Sequence[Channel | Quantity]) -> dict[str, int]:
    """Where each channel or quantity begins among all of them side by side."""
    sizes = [part.size for part in parts]
    return {part.name: sum(sizes[:index]) for index, part in enumerate(parts)}


def inputs_of(
    model: Equations, places: Places, held: Array, sample: Array, state: Array, pose: Array, age: Array
) -> Array:
    """The inputs of :func:`watch`.

    Args:
        model: the equations.
        places: of :func:`places_of`.
        held: ``(..., d)`` last samples, side by side.
        sample: ``(..., d)`` of this time step; NaN where there is none.
        state: ``(..., n)``.
        pose: ``(..., p)`` outputs of the model, side by side.
        age: ``(..., 1)`` s since the gyroscope's last sample.
    """
    xp, zero = namespace(held), 0.0 * age

    def part(source: Array, start: int, size: int) -> Array:
        missing = zero + constant([1.0, 0.0, 0.0, 0.0] if size == 4 else [math.nan] * size, zero)
        return source[..., start : start + size] if start >= 0 else missing

    declination = expand(getattr(model, "declination", 0.0), 1)
    parts = [part(held, places.rate, 3), part(sample, places.force, 3), part(sample, places.field, 3)]
    parts += [part(pose, places.up, 3), part(pose, places.orientation, 4), age]
    parts += [zero + expand(model.dt, 1), zero + declination, zero + float(model.error_size > 0)]
    parts += [state[..., places.supposed + 2 : places.supposed + 3]] if places.supposed >= 0 else []
    return xp.concat(parts, axis=-1)


def without_impacts(places: Places, sample: Array, memory: Array, age: Array) -> Array:
    """A sample ``(..., d)`` with NaN for a force that no motion explains.

    Args:
        places: of :func:`places_of`.
        sample: ``(..., d)``.
        memory: ``(..., 19)`` of the sample before.
        age: ``(..., 1)`` s since the last valid force, at the sample before.
    """
    xp = namespace(sample, memory)
    force = sample[..., places.force : places.force + 3]
    squared = xp.sum(force * force, axis=-1)[..., None]
    seen = xp.logical_and(xp.greater(memory[..., TIME : TIME + 1], 0.0), xp.less(age, LONGEST_IMPACT))
    beyond = xp.greater(squared, IMPACT_SHARE**2 * memory[..., SQUARE : SQUARE + 1])
    impact = xp.logical_and(xp.logical_and(seen, beyond), xp.greater(squared, IMPACT**2))
    force = xp.where(impact, xp.nan + 0.0 * force, force)
    return xp.concat([sample[..., : places.force], force, sample[..., places.force + 3 :]], axis=-1)


def realigned(places: Places, current: Array, memory: Array, dt: Array) -> Array:
    """Samples ``(..., d)`` with the averages of force and field in their places: a prior is formed of them.

    The averages are those of the sample before; they are turned by the rate of this one, to first order.
    """
    xp = namespace(current, memory)
    rate = expand(dt, 1) * current[..., places.rate : places.rate + 3]
    rate = xp.where(xp.isfinite(rate), rate, xp.zeros_like(rate))
    force, field = (part - cross(rate, part) for part in (memory[..., FORCE], memory[..., FIELD]))
    samples = xp.concat([current[..., : places.force], force, current[..., places.force + 3 :]], axis=-1)
    if places.field < 0:
        return samples
    known = xp.greater(memory[..., FIELD_TIME : FIELD_TIME + 1], 0.0)
    field = xp.where(known, field, current[..., places.field : places.field + 3])
    return xp.concat([samples[..., : places.field], field, samples[..., places.field + 3 :]], axis=-1)
