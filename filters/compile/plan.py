"""What the compiled loops know of a model: addresses of its printed functions, and the zeros of its Jacobians."""

from __future__ import annotations

import numpy as np

from ..core.monitor import LOST
from .cache import jit
from .printer import Printed

FUNCTIONS = (
    *("prior", "predict", "residual", "retract", "finish", "pose", "grow"),
    *("reject", "realign", "watch", "store", "fetch", "constants", "level"),
)
PRIOR, PREDICT, RESIDUAL, RETRACT, FINISH, POSE, GROW, REJECT, REALIGN, WATCH, STORE, FETCH, CONSTANTS = range(13)
LEVEL, DT, WHERE_LOST, LONGEST, TILT, FIELD, LISTS = range(13, 20)
"""Places in a plan: addresses of the functions (0 where a model has none), the place of the sampling interval among the
parameters, that of the mark of a lost filter in the monitor's memory, the longest gap of all inputs in µs, those of the
rotation in the error and of the magnetometer in a sample (−1 without one), and from here where the six lists begin."""


def plan_of(printed: Printed, addresses: dict[str, int]) -> np.ndarray:
    """What the loops know of a model, as whole numbers; see :data:`LISTS`."""
    head = [*(addresses.get(name, 0) for name in FUNCTIONS), printed.dt, LOST, round(1e6 * printed.longest)]
    head += [printed.tilt, printed.field]
    ends = LISTS + len(printed.lists) + 1 + np.cumsum([0, *map(len, printed.lists)])
    return np.concatenate([head, ends, *printed.lists]).astype(np.int64)


@jit
def part(plan, number):  # type: ignore[no-untyped-def]
    """One of the lists of a plan: 0, starts of the channels; 1 and 2, of F; 3 and 4, of H; 5, held inputs."""
    return plan[plan[LISTS + number] : plan[LISTS + number + 1]]
