"""What training makes small: the same errors that tables show, on torch tensors."""

from __future__ import annotations

from ...filters.core.backend import Array, namespace
from ...filters.core.metrics import direction_error, rms, scored


def vertical_of(tilt: Array) -> Array:
    """The vertical ``(..., 3)``, of any length, of a tilt ``(..., 2)`` in the level frame."""
    xp = namespace(tilt)
    return xp.concat([tilt, xp.ones_like(tilt[..., :1])], axis=-1)


def inclination_loss(tilt: Array, vertical: Array, known: Array) -> Array:
    """Mean over sequences of the root mean square inclination error in time, rad.

    This is what a table of trials shows. Its gradient weighs a sequence of small errors as much as one of large ones,
    which the mean square over all would not.

    Args:
        tilt: ``(B, N, 2)`` estimate.
        vertical: ``(B, N, 3)`` truth in the level frame.
        known: ``(B, N)`` bool, what is scored.

    Returns:
        A number; zero, with gradient zero, where nothing is scored.
    """
    xp = namespace(tilt)
    error = direction_error(vertical_of(tilt), vertical)
    counted = xp.any(scored(error, known), axis=1)
    each = rms(error, known, axis=1)
    each = xp.where(counted, each, xp.zeros_like(each))
    count = xp.sum(xp.astype(counted, each.dtype))
    return xp.sum(each) / xp.where(count > 0.0, count, xp.ones_like(count))
