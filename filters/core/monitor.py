"""Whether an estimator still knows where up and north are, and where they are if it does not.

Independent of the estimator, force and field are averaged (:mod:`.averages`). An estimate that contradicts a trusted
average by more than any acceleration can for longer than :data:`PATIENCE` is lost: it starts anew, from the averages.
So neither a bad first sample nor a long gap decides for good. The heading is watched until it has been confirmed once;
after that the field may be disturbed, and only the estimator decides. The inclination of a method without covariance is
watched until then, too: what it makes of its drift later is its own. Equations that keep the field of their start for
good, dip included, are watched more closely until then: a wrong dip turns their estimate for ever, and an error about
the field's direction, which their magnetometer does not see, hardly decays. Their dip and their east are compared with
those of both averages.

What a steady average of the last moment contradicts until a start has been confirmed needs hardly any patience: in the
mean of both directions a filter sees no contradiction, and takes the rest for a bias of its gyroscope. What a sample
among the first few contradicts needs none. And a force that no motion explains (:func:`without_impacts`) counts as
missing for a moment.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from .averages import (
    GYROSCOPE_GAP,
    SHORTEST_FIELD,
    SHORTEST_FORCE,
    Average,
    Step,
    averaged,
    left_behind,
    of_moment,
    squared,
    trusted,
)
from .backend import Array, constant, expand, namespace
from .model import Equations
from .quantity import ACCELEROMETER, GYROSCOPE, GYROSCOPE_BIAS, MAGNETOMETER, Channel, Quantity
from .rotation import cross, exp, rotate, up_in_body

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
LEARNED_BIAS, LARGEST_BIAS = 8.0, math.radians(10.0)
"""s after a start from which on the estimated bias of the gyroscope counts, and rad/s that none exceeds: meanwhile a
filter takes a part of a wrong start for one."""
CONFIRMED_HEADING = 8.0
"""The same for the heading. After a start with a wrong inclination a filter takes every sample of the field for
disturbed until it has learned the field anew, and the heading drifts away meanwhile."""
IMPACT, IMPACT_SHARE = 300.0, 10.0
"""m/s² and root mean squares of the samples before: a force that exceeds both is no sample. The first is more than all
axes of a sensor with a range of ±16 g can show together."""
LONGEST_IMPACT = 0.05
"""s for which such samples count as missing; what lasts longer is a motion."""
INFLATION = 4.0
"""Factor on the covariance of a prior that is formed of averages in motion."""

INPUTS = 23
"""Of :func:`watch`: rate (3), force (3), field (3), up (3), orientation (4), age of the rate, dt, declination, whether
the inclination is watched for good (1) or until it was confirmed (0), and estimated bias of the rate (3). One more
where equations keep the field of their start: its vertical component."""
MEMORY = 20
"""Of :func:`watch`: average force (3), mean square, time, time of contradiction; the same of the field (3, 1, 1, 1);
times of agreement of the heading and of the inclination; zero, or if the estimate is lost the factor on the covariance
of its prior; average force of the last moment (3), its mean square; s since the start or a moment that decided."""
FORCE, SQUARE, TIME, FIELD, FIELD_TIME, LOST, LATELY = slice(0, 3), 3, 4, slice(6, 9), 10, 14, slice(15, 18)
"""Where some of it is."""


def watch(memory: Array, inputs: Array) -> Array:
    """Memory ``(..., 20)`` after a sample; the estimator starts anew at the next one if it is lost.

    Args:
        memory: ``(..., 20)``; zeros at the start.
        inputs: ``(..., 23)`` or ``(..., 24)``; force and field NaN where there is no sample, the vertical NaN for
            that of the orientation.
    """
    xp = namespace(memory, inputs)
    up, q = inputs[..., 9:12], inputs[..., 12:16]
    up = xp.where(xp.isfinite(up), up, up_in_body(q))
    age, dt, declination, always = (inputs[..., i : i + 1] for i in (16, 17, 18, 19))
    stood, zero = memory[..., 13:14], 0.0 * dt
    unconfirmed = xp.less(stood, CONFIRMED)
    step = Step(
        exp((inputs[..., :3] - bias(inputs, memory[..., 19:20])) * dt), dt, xp.greater(age, GYROSCOPE_GAP), unconfirmed
    )
    force, force_contrary = averaged(memory[..., :5], inputs[..., 3:6], step, SHORTEST_FORCE, unconfirmed)
    lately, scattered = of_moment(memory[..., LATELY], memory[..., 18:19], inputs[..., 3:6], step, force.time)
    force, moved, calm = left_behind(force, lately, scattered, memory[..., 19:20], step)
    keeps = inputs.shape[-1] > INPUTS
    # A device that calibrates its magnetometer meanwhile gives another field from one sample to the next.
    mixed = xp.less(memory[..., 12:13], CONFIRMED_HEADING) if keeps else unconfirmed
    field, field_contrary = averaged(memory[..., 6:11], inputs[..., 6:9], step, SHORTEST_FIELD, mixed)
    leaning, standing, leant, stood = inclination(force, up, moved, memory[..., 5:6], stood, dt)
    confirmed = xp.greater_equal(stood, CONFIRMED)
    known = xp.logical_and(trusted(force, SHORTEST_FORCE), xp.logical_not(leaning))
    known = xp.logical_and(known, trusted(field, SHORTEST_FIELD))
    turned, agreeing = heading(rotate(q, field.mean), declination)
    if keeps:
        wrong, right = kept_field(force.mean, field.mean, q, declination, inputs[..., INPUTS : INPUTS + 1])
        turned, agreeing = xp.logical_or(turned, wrong), xp.logical_and(agreeing, right)
    off = xp.where(xp.logical_and(known, turned), memory[..., 11:12] + dt, xp.where(known, zero, memory[..., 11:12]))
    # A heading counts as right with a right inclination only: a wrong one turns it while it is corrected.
    agreeing = xp.logical_and(known, xp.logical_and(standing, agreeing))
    agreed = xp.where(agreeing, memory[..., 12:13] + dt, memory[..., 12:13])
    watched = xp.logical_or(xp.greater(always, 0.5), xp.logical_not(confirmed))
    lost = xp.logical_or(
        xp.logical_and(xp.greater(leant, PATIENCE), watched),
        xp.logical_and(xp.greater(off, PATIENCE), xp.less(agreed, CONFIRMED_HEADING)),
    )
    early = xp.logical_or(force_contrary, field_contrary)
    leant, off, agreed, calm = (
        xp.where(xp.logical_or(lost, early), zero, value) for value in (leant, off, agreed, calm)
    )
    factor = xp.where(early, zero + 1.0, xp.where(lost, zero + INFLATION, zero))
    return xp.concat([*force, leant, *field, off, agreed, stood, factor, lately, scattered, calm], axis=-1)


def bias(inputs: Array, calm: Array) -> Array:
    """The bias ``(..., 3)`` of the gyroscope as far as it is known; zero until a start is that old.

    One of degrees per second turns averages of seconds further than some errors that they tell.
    """
    xp, estimated = namespace(inputs), inputs[..., 20:23]
    known = xp.logical_and(xp.greater_equal(calm, LEARNED_BIAS), xp.less(squared(estimated), LARGEST_BIAS**2))
    return xp.where(known, estimated, xp.zeros_like(estimated))


def inclination(
    force: Average, up: Array, moved: Array, leant: Array, stood: Array, dt: Array
) -> tuple[Array, Array, Array, Array]:
    """Whether estimate and average force contradict each other and whether they agree, and for how long they did.

    Args:
        force: the average.
        up: ``(..., 3)`` of the estimate.
        moved: ``(..., 1)`` whether the average began anew, as the last moment contradicted it.
        leant: ``(..., 1)`` s of contradiction before.
        stood: ``(..., 1)`` s of agreement before.
        dt: ``(..., 1)`` s.
    """
    xp, zero, upright = namespace(up), 0.0 * dt, trusted(force, SHORTEST_FORCE)
    aligned, length = xp.sum(up * force.mean, axis=-1)[..., None], xp.sqrt(squared(force.mean) + 1e-30)
    standing = xp.logical_and(upright, xp.greater(aligned, math.cos(0.5 * LARGEST_LEAN_AT_START) * length))
    stood = xp.where(moved, zero, xp.where(standing, stood + dt, stood))
    confirmed = xp.greater_equal(stood, CONFIRMED)
    least = xp.where(confirmed, zero + math.cos(LARGEST_LEAN), zero + math.cos(LARGEST_LEAN_AT_START))
    leaning = xp.logical_and(upright, xp.less(aligned, least * length))
    leant = xp.where(leaning, leant + dt, xp.where(upright, zero, leant))
    # Samples of two directions are a contradiction already: the filter must not take it for a bias meanwhile.
    return leaning, standing, xp.where(moved, zero + (PATIENCE - REST_OF_PATIENCE), leant), stood


def heading(world: Array, declination: Array) -> tuple[Array, Array]:
    """Whether the average field ``(..., 3)`` in world axes contradicts magnetic north, and whether it agrees."""
    xp, east, north = namespace(world), world[..., :1], world[..., 1:2]
    s, c = xp.sin(declination), xp.cos(declination)
    along, across = east * s + north * c, east * c - north * s
    horizontal = xp.sqrt(along * along + across * across + 1e-30)
    turned = xp.less(along, math.cos(LARGEST_TURN) * horizontal)
    return turned, xp.greater(along, math.cos(0.5 * LARGEST_TURN) * horizontal)


def kept_field(force: Array, field: Array, q: Array, declination: Array, supposed: Array) -> tuple[Array, Array]:
    """Whether dip and east of both averages contradict those of equations that keep a field, and whether they agree.

    Args:
        force: ``(..., 3)`` average.
        field: ``(..., 3)`` average.
        q: ``(..., 4)`` orientation.
        declination: ``(..., 1)`` rad.
        supposed: ``(..., 1)`` vertical component of the unit field that is kept.
    """
    xp, s, c = namespace(force), namespace(force).sin(declination), namespace(force).cos(declination)
    lengths = xp.sqrt(xp.sum(force * force, axis=-1) * xp.sum(field * field, axis=-1) + 1e-60)[..., None]
    sine = xp.sum(force * field, axis=-1)[..., None] / lengths
    cosine = xp.sqrt(1.0 + 1e-9 - sine * sine)
    dip = sine * supposed + cosine * xp.sqrt(1.0 + 1e-9 - supposed * supposed)
    east = rotate(q, cross(field, force)) / (cosine * lengths)
    about = east[..., :1] * c - east[..., 1:2] * s
    least = xp.where(xp.less(dip, about), dip, about)
    return xp.less(least, math.cos(LARGEST_ERROR)), xp.greater(least, math.cos(0.5 * LARGEST_ERROR))


@dataclass(frozen=True)
class Places:
    """Where the inputs of :func:`watch` are found: first element in a sample, a pose or a state; −1 for none."""

    rate: int
    force: int
    field: int
    up: int
    orientation: int
    bias: int
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
    return Places(
        samples[GYROSCOPE.name],
        samples[ACCELEROMETER.name],
        field,
        up,
        orientation,
        pose.get(GYROSCOPE_BIAS.name, -1),
        supposed,
    )


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
    parts += [part(pose, places.bias, 3) if places.bias >= 0 else zero + constant([0.0] * 3, zero)]
    parts += [state[..., places.supposed + 2 : places.supposed + 3]] if places.supposed >= 0 else []
    return xp.concat(parts, axis=-1)


def without_impacts(places: Places, sample: Array, memory: Array, age: Array) -> Array:
    """A sample ``(..., d)`` with NaN for a force that no motion explains.

    Args:
        places: of :func:`places_of`.
        sample: ``(..., d)``.
        memory: ``(..., 20)`` of the sample before.
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
