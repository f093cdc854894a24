"""Linear-quadratic preview control of a bicycle along a path: the equations behind every pilot."""

from __future__ import annotations

import math

import numpy as np

from ..frame.parameters import BicycleParameters
from ..frame.whipple import WhippleModel
from .preview import PREVIEW_BIN, PREVIEW_BINS


def lateral_model(model: WhippleModel, bicycle: BicycleParameters, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Linear model of steering along a path: matrix ``(7, 7)`` and input column ``(7, 1)`` of the steer torque.

    State: roll, steer, roll rate, steer rate, heading error, offset, integral of the offset; all to the right positive.
    """
    cos = math.cos(bicycle.steer_axis_tilt) / bicycle.wheelbase
    A, B = np.zeros((7, 7)), np.zeros((7, 1))
    A[:4, :4] = model.state_matrix(speed)
    A[4, 1], A[4, 3] = speed * cos, bicycle.trail * cos
    A[5, 4] = speed
    A[6, 5] = 1.0
    B[:4, 0] = model.input_matrix()[:, 1]
    return A, B


def sampled(A: np.ndarray, B: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Exact discretisation of x' = A x + B u with inputs held over a step (s)."""
    size, inputs = B.shape
    block = exponential(step * np.block([[A, B], [np.zeros((inputs, size + inputs))]]))
    return block[:size, :size], block[:size, size:]


def exponential(matrix: np.ndarray) -> np.ndarray:
    """Matrix exponential ``(n, n)`` by scaling, a Taylor polynomial, and squaring.

    SciPy's changes in its last bits with the number of threads, as its library splits products of this size; a ride
    must be the same, bit for bit, whether it is simulated alone or by one of several processes.
    """
    halvings = max(0, math.ceil(math.log2(max(2.0 * np.abs(matrix).sum(axis=0).max(), 1.0))))
    scaled, identity = matrix / 2.0**halvings, np.eye(len(matrix))
    # of norm 0.5 at most: what follows the term of order 14 is below rounding
    result = identity
    for order in range(14, 0, -1):
        result = identity + scaled @ result / order
    for _ in range(halvings):
        result = result @ result
    return result


def riccati(A: np.ndarray, B: np.ndarray, cost: np.ndarray, effort: np.ndarray) -> np.ndarray:
    """Stabilising solution ``(n, n)`` of Aᵀ X A − X − Aᵀ X B (R + Bᵀ X B)⁻¹ Bᵀ X A + Q = 0, with Q and R as named.

    Structure-preserving doubling (E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, Structure-preserving algorithms for
    periodic discrete-time algebraic Riccati equations, Int. J. Control 77 (2004)): three times as fast as SciPy on
    systems of this size, with a smaller residual.

    Args:
        A: ``(n, n)``.
        B: ``(n, m)``.
        cost: ``(n, n)`` of the state.
        effort: ``(m, m)`` of the input.

    Raises:
        ValueError: the steps do not converge, because no input stabilises the system.
    """
    identity, G, X = np.eye(len(A)), B @ np.linalg.solve(effort, B.T), cost
    for _ in range(60):
        inverse = np.linalg.inv(identity + G @ X)
        change = A.T @ X @ inverse @ A
        G = G + A @ inverse @ G @ A.T
        X, A = X + change, A @ inverse @ A
        largest = np.abs(X).max()
        if not largest < 1e100:
            break
        if np.abs(change).max() <= 1e-15 * largest:
            return 0.5 * (X + X.T)
    raise ValueError("the Riccati equation of the pilot has no stabilising solution")


def preview_regulator(
    A: np.ndarray, B: np.ndarray, cost: np.ndarray, effort: float, step: float, changes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Feedback and preview gains of one input that is held between control steps.

    The state is relative to that of a steady turn, so that changes of the turn act as disturbances. They are known in
    advance, and the optimal input anticipates them (linear-quadratic preview control, M. Tomizuka, Optimal continuous
    finite preview problem, IEEE Trans. Autom. Control 20 (1975)).

    Args:
        A: ``(n, n)`` of the sampled system.
        B: ``(n, 1)``.
        cost: ``(n, n)`` of the squared state, per second.
        effort: of the squared input, per second.
        step: s between control steps.
        changes: ``(n, k)`` what each kind of change of the turn adds to the state of the steady turn.

    Returns:
        Gains ``(n,)`` on the state, and ``(k, PREVIEW_BINS)`` on the changes in each bin ahead.
    """
    solution = riccati(A, B, cost * step, np.array([[effort * step]]))
    left = np.linalg.solve(effort * step + B.T @ solution @ B, B.T)
    gains = left @ solution @ A
    # preview: the costate of a change of the turn, carried back from where it comes by the closed loop
    closed, effect = (A - B @ gains).T, -(solution @ changes)
    each = round(PREVIEW_BIN / step)
    power, total = np.eye(len(closed)), np.eye(len(closed))
    for _ in range(each - 1):
        power = closed @ power
        total += power
    kernel, bin_later = np.zeros((changes.shape[1], PREVIEW_BINS)), closed @ power
    for index in range(PREVIEW_BINS):
        kernel[:, index] = (left @ total @ effect)[0] / each
        effect = bin_later @ effect
    return gains[0], kernel
