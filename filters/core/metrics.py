"""Definition of errors, used by rewards, losses, tables and plots.

Errors are formed by the kind of a :class:`~poise.filters.core.quantity.Quantity`, per sample and without units changed
(radians, metres, …); degrees appear only in :func:`score`. Everything up to :func:`rms` works on NumPy arrays and torch
tensors and has finite gradients, also at zero error and where the truth is unknown.

Total, heading and inclination error are those of D. Laidig, M. Caruso, A. Cereatti, T. Seel, "BROAD — A Benchmark for
Robust Inertial Orientation Estimation", Data 6(7), 2021, https://doi.org/10.3390/data6070072, in a form that is
accurate near zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import rotation
from .backend import Array, is_torch, namespace, to_numpy
from .quantity import RELATIVE_ORIENTATION, UP, Quantity


def error(quantity: Quantity, estimate: Array, truth: Array) -> Array:
    """Size of the error of every sample, by the kind of the quantity.

    ============  ================================================================================
    rotation      angle of ``estimate ⊗ truth⁻¹``; its inclination alone if the heading is free
    direction     angle between the two
    angle         absolute difference, wrapped to [0, pi] (Euclidean length if there are several)
    vector        Euclidean distance
    ============  ================================================================================

    Args:
        quantity: what is compared.
        estimate: ``(..., quantity.size)``; rotations and directions may have any positive length.
        truth: the same, broadcasting.

    Returns:
        ``(...)`` in rad or in the quantity's unit; NaN where estimate or truth is not finite, or is a rotation or
        direction of length zero.

    Raises:
        ValueError: the last axis is not ``quantity.size`` long.
    """
    check_size(quantity, estimate, truth)
    if quantity.name == RELATIVE_ORIENTATION.name:
        return inclination_error(estimate, truth)
    return ERROR_OF_KIND[quantity.kind](estimate, truth)


def check_size(quantity: Quantity, estimate: Array, truth: Array) -> None:
    """Check that arrays have the size of ``quantity``."""
    for name, array in (("estimate", estimate), ("truth", truth)):
        shape = tuple(getattr(array, "shape", ()))
        if not shape or shape[-1] != quantity.size:
            raise ValueError(f"{name} of {quantity.name!r} must have shape (..., {quantity.size}), got {shape}")


def square_root(x: Array) -> Array:
    """Square root with gradient zero, not infinite, at zero."""
    xp = namespace(x)
    zero = x == 0.0
    return xp.where(zero, 0.0 * x, xp.sqrt(xp.where(zero, xp.ones_like(x), x)))


def length(v: Array) -> Array:
    """Euclidean length ``(...)`` of ``(..., n)``, with gradient zero, not NaN, at zero."""
    return square_root(namespace(v).sum(v * v, axis=-1))


def where_known(
    function: Callable[[Array, Array], Array], estimate: Array, truth: Array, *, directed: bool = False
) -> Array:
    """Apply ``function`` to samples where both are finite (and, if ``directed``, not zero); NaN elsewhere.

    The unknown is replaced before the computation, not after it, because a NaN that is masked afterwards still makes
    the gradient NaN.
    """
    xp = namespace(estimate, truth)
    if is_torch(estimate) != is_torch(truth):
        tensor = estimate if is_torch(estimate) else truth
        estimate, truth = (xp.asarray(x, dtype=tensor.dtype, device=tensor.device) for x in (estimate, truth))
    known = xp.all(xp.isfinite(estimate), axis=-1) & xp.all(xp.isfinite(truth), axis=-1)
    if directed:
        known = known & ~xp.all(estimate == 0.0, axis=-1) & ~xp.all(truth == 0.0, axis=-1)
    estimate = xp.where(known[..., None], estimate, xp.ones_like(estimate))
    truth = xp.where(known[..., None], truth, xp.ones_like(truth))
    value = function(estimate, truth)
    return xp.where(known, value, xp.full_like(value, float("nan")))


def total_error(estimate: Array, truth: Array) -> Array:
    """Angle ``(...)`` in [0, pi] between two orientations ``(..., 4)``: ``2 acos |w|`` of ``estimate ⊗ truth⁻¹``."""
    return rotation_error(lambda r: (r[..., 1:], r[..., :1]), estimate, truth)


def heading_error(estimate: Array, truth: Array) -> Array:
    """Part ``(...)`` in [0, pi] of the total error about the vertical: ``2 atan |z / w|`` of ``estimate ⊗ truth⁻¹``."""
    return rotation_error(lambda r: (r[..., 3:], r[..., :1]), estimate, truth)


def inclination_error(estimate: Array, truth: Array) -> Array:
    """Rest ``(...)`` in [0, pi] of the total error, about a horizontal axis: ``2 acos √(w² + z²)``.

    It is the angle between the two inclination vectors in sensor axes, independent of the headings.
    """
    upright = lambda r: namespace(r).stack([r[..., 0], r[..., 3]], axis=-1)  # noqa: E731
    return rotation_error(lambda r: (r[..., 1:3], upright(r)), estimate, truth)


def rotation_error(parts: Callable[[Array], tuple[Array, Array]], estimate: Array, truth: Array) -> Array:
    """Twice the angle between two parts of ``estimate ⊗ truth⁻¹``: the sides of a right triangle."""

    def angle(p: Array, q: Array) -> Array:
        opposite, adjacent = parts(rotation.multiply(p, rotation.conjugate(q)))
        return 2.0 * namespace(opposite).atan2(length(opposite), length(adjacent))

    return where_known(angle, estimate, truth, directed=True)


def direction_error(estimate: Array, truth: Array) -> Array:
    """Angle ``(...)`` in [0, pi] between vectors ``(..., n)`` of any positive length.

    ``2 atan2(|a − b|, |a + b|)`` of the unit vectors (W. Kahan, "How futile are mindless assessments of roundoff in
    floating-point computation?", 2006, section 12), accurate near 0 and near pi, where acos is not.
    """

    def angle(a: Array, b: Array) -> Array:
        a, b = rotation.normalize(a), rotation.normalize(b)
        return 2.0 * namespace(a).atan2(length(a - b), length(a + b))

    return where_known(angle, estimate, truth, directed=True)


def angle_error(estimate: Array, truth: Array) -> Array:
    """Absolute wrapped difference ``(...)`` of angles ``(..., n)``; the Euclidean length if ``n > 1``."""
    return where_known(lambda a, b: length(rotation.wrap(a - b)), estimate, truth)


def vector_error(estimate: Array, truth: Array) -> Array:
    """Euclidean distance ``(...)`` of vectors ``(..., n)``."""
    return where_known(lambda a, b: length(a - b), estimate, truth)


ERROR_OF_KIND: dict[str, Callable[[Array, Array], Array]] = {
    "rotation": total_error,
    "direction": direction_error,
    "angle": angle_error,
    "vector": vector_error,
}


def scored(error: Array, mask: Any = None) -> Array:
    """Boolean array of the shape of ``error``: finite, and True in ``mask`` ``(T,)`` (or any leading shape)."""
    xp = namespace(error)
    finite = xp.isfinite(error)
    if mask is None:
        return finite
    mask = xp.asarray(mask, device=error.device) if is_torch(error) else np.asarray(to_numpy(mask))
    if mask.dtype != xp.bool or tuple(mask.shape) != tuple(error.shape)[: mask.ndim]:
        raise ValueError(
            f"mask must be bool with the leading shape of the error {tuple(error.shape)}, "
            f"got {mask.dtype} {tuple(mask.shape)}"
        )
    return finite & mask[(..., *(None,) * (error.ndim - mask.ndim))]


def rms(error: Array, mask: Any = None, axis: int | tuple[int, ...] | None = 0) -> Array:
    """Root mean square of an error over the samples of the evaluation mask where it is finite.

    Args:
        error: ``(T, *batch)``.
        mask: bool ``(T,)`` or ``(T, *batch)``; None scores every sample.
        axis: what to average over; None averages over everything.

    Returns:
        The error without ``axis``; NaN where nothing could be scored.

    Raises:
        ValueError: ``mask`` is not boolean or does not fit.
    """
    xp = namespace(error)
    valid = scored(error, mask)
    axis = tuple(range(error.ndim)) if axis is None else axis
    squares = xp.where(valid, error, xp.zeros_like(error)) ** 2
    count = xp.sum(xp.astype(valid, error.dtype), axis=axis)
    nothing = count == 0.0
    mean = xp.sum(squares, axis=axis) / xp.where(nothing, xp.ones_like(count), count)
    root = square_root(mean)
    return xp.where(nothing, xp.full_like(root, float("nan")), root)


def valid_fraction(error: Array, mask: Any = None) -> float:
    """Share of the evaluation mask where the error is finite; NaN for an empty mask."""
    wanted = scored(namespace(error).zeros_like(error), mask)
    valid = scored(error, mask)
    total = int(wanted.sum())
    return int(valid.sum()) / total if total else float("nan")


@dataclass(frozen=True)
class Metric:
    """One column of a table of errors.

    Attributes:
        name: ``total``, ``heading``, ``inclination``, ``angle``, ``distance``.
        unit: of the tabulated value.
        error: error of every sample from ``(estimate, truth)``, in rad or the quantity's unit.
        scale: tabulated value of one unit of ``error``.
    """

    name: str
    unit: str
    error: Callable[[Array, Array], Array]
    scale: float = 1.0


DEGREES = float(np.degrees(1.0))


def metrics_of(quantity: Quantity) -> tuple[Metric, ...]:
    """What is tabulated of a quantity; the first metric is the one that :func:`error` computes."""
    inclination = Metric("inclination", "deg", inclination_error, DEGREES)
    if quantity.name == RELATIVE_ORIENTATION.name:
        return (inclination,)
    if quantity.kind == "rotation":
        heading = Metric("heading", "deg", heading_error, DEGREES)
        return Metric("total", "deg", total_error, DEGREES), heading, inclination
    if quantity.kind == "direction":
        name = "inclination" if quantity.name == UP.name else "angle"
        return (Metric(name, "deg", direction_error, DEGREES),)
    if quantity.kind == "angle":
        return (Metric("angle", "deg", angle_error, DEGREES),)
    return (Metric("distance", quantity.unit, vector_error),)


def score(quantity: Quantity, estimate: Array, truth: Array, mask: Any = None) -> dict[str, tuple[float, str]]:
    """Root mean square errors of a whole sequence, ready to be rows of a table.

    Args:
        quantity: what is compared.
        estimate: ``(T, *batch, quantity.size)``.
        truth: the same.
        mask: bool ``(T,)``, evaluation mask; None scores all.

    Returns:
        Metric name → (value, unit), and ``"valid"``: share of the evaluation mask where estimate and truth are known.
        A small error with a small share does not make a good estimator; report both.

    Raises:
        ValueError: shapes do not fit.
    """
    check_size(quantity, estimate, truth)
    table: dict[str, tuple[float, str]] = {}
    for metric in metrics_of(quantity):
        errors = metric.error(estimate, truth)
        table[metric.name] = (float(rms(errors, mask, axis=None)) * metric.scale, metric.unit)
    return table | {"valid": (valid_fraction(errors, mask), "1")}
