"""Which parts of a model's error state never meet, and where its matrices are zero whatever the values.

While a model is traced (:mod:`.trace`), zeros of F, Q, P₀, H and R are known. Two error states belong
together if F, Q or P₀ can couple them, or if measurement rows touch both that are one row or whose noise is correlated.
The recursion of the whole is then exactly that of its parts: P stays zero between them, S is zero between their rows,
so gain, innovation and its whitening fall apart too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Part:
    """Error states that meet, and the measurement rows that touch them.

    Attributes:
        states: indices, ascending.
        rows: indices, ascending.
        transition: for each state the positions in ``states`` where F can be other than zero.
        jacobian: for each row the positions in ``states`` where H can be other than zero.
        uncorrelated: whether R is diagonal on these rows.
    """

    states: tuple[int, ...]
    rows: tuple[int, ...]
    transition: tuple[tuple[int, ...], ...]
    jacobian: tuple[tuple[int, ...], ...]
    uncorrelated: bool


def can_differ_from_zero(matrix: np.ndarray) -> np.ndarray:
    """Bool array: False where a traced matrix is the number zero."""

    def check(item: Any) -> bool:
        value = getattr(item, "value", item)
        return value is None or float(value) != 0.0

    return np.array([check(item) for item in matrix.ravel()], dtype=bool).reshape(matrix.shape)


def find_parts(F: np.ndarray, Q: np.ndarray, P0: np.ndarray, H: np.ndarray, R: np.ndarray) -> list[Part]:
    """The parts of a model.

    Args:
        F: ``(e, e)`` bool, where the matrix can differ from zero.
        Q: likewise.
        P0: likewise, of the prior.
        H: ``(m, e)`` likewise.
        R: ``(m, m)`` likewise.

    Returns:
        Parts in the order of their first states; rows that touch no state belong to the first part.
    """
    together = F | Q | P0
    groups = _connected(R | R.T)
    for group in set(groups):
        touched = np.flatnonzero(np.any(H[groups == group], axis=0))
        if touched.size:
            together[touched[0], touched] = True
    labels = _connected(together | together.T)
    owner = np.zeros(H.shape[0], dtype=int)
    for row in range(H.shape[0]):
        touched = np.flatnonzero(np.any(H[groups == groups[row]], axis=0))
        owner[row] = labels[touched[0]] if touched.size else labels[0]
    order = sorted(set(labels.tolist()), key=lambda label: int(np.argmax(labels == label)))
    return [_part(np.flatnonzero(labels == label), np.flatnonzero(owner == label), F, H, R) for label in order]


def whole(F: np.ndarray, H: np.ndarray, R: np.ndarray) -> Part:
    """Everything as one part; arguments as for :func:`find_parts`."""
    return _part(np.arange(F.shape[0]), np.arange(H.shape[0]), F, H, R)


def _part(states: np.ndarray, rows: np.ndarray, F: np.ndarray, H: np.ndarray, R: np.ndarray) -> Part:
    own = R[np.ix_(rows, rows)]
    return Part(
        tuple(states.tolist()),
        tuple(rows.tolist()),
        tuple(tuple(np.flatnonzero(line).tolist()) for line in F[np.ix_(states, states)]),
        tuple(tuple(np.flatnonzero(line).tolist()) for line in H[np.ix_(rows, states)]),
        not np.any(own & ~np.eye(len(rows), dtype=bool)),
    )


def _connected(links: np.ndarray) -> np.ndarray:
    """Labels ``(n,)`` of the connected components of a symmetric bool matrix."""
    labels = np.arange(links.shape[0])
    changed = True
    while changed:
        changed = False
        for i, j in np.argwhere(links):
            low = min(labels[i], labels[j])
            if labels[i] != low or labels[j] != low:
                labels[i] = labels[j] = low
                changed = True
    return labels
