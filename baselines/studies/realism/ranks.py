"""Whether estimators have the same order in simulation as on recordings: Kendall's rank correlation."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.recipes.recipe import Recipe
from ....envs.recipes.registry import recipe
from ....filters.support.optional import MissingExtraError
from ...evaluation import evaluate
from ...registry import make_estimator
from ..kit import Study
from .roles import ROLES, Recorded

ESTIMATORS = (
    "bounded-motion",
    "mekf",
    "external-acceleration",
    "vqf",
    "mahony",
    "imufusion",
    "gyroscope-integration",
    "tilt",
)
"""Estimators of one inertial sensor that are ranked: those whose packages are installed"""
DRAWS = 1000
"""bootstrap draws of the episodes, for the interval of τ"""


class Ranked(NamedTuple):
    """Estimators on a group of recordings and on the recipe that should contain them."""

    names: list[str]
    simulated: np.ndarray
    """errors ``(episodes, estimators)``, deg"""
    recorded: np.ndarray
    """errors ``(recordings, estimators)``, deg"""
    tau: float
    low: float
    """5 % of the bootstrap draws of τ"""
    high: float
    """95 % of them"""


def installed() -> list[str]:
    """Those of :data:`ESTIMATORS` whose packages are installed."""
    found = []
    for name in ESTIMATORS:
        try:
            make_estimator(name)
        except (ImportError, MissingExtraError):
            continue
        found.append(name)
    return found


def inclination_errors(trajectory: Trajectory, estimators: Sequence[str]) -> dict[str, float]:
    """Estimator → root mean square error of the inclination, deg; the reference on the gyroscope's clock."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        table = evaluate(list(estimators), trajectory, reference_clock="corrected", check=False)
    found = table[table["metric"] == "inclination"].set_index("estimator")["value"]
    return {name: float(found[name]) for name in estimators if name in found.index}


def episode_errors(described: Mapping[str, Any], seed: int, index: int, estimators: Sequence[str]) -> dict[str, float]:
    """Errors on one episode of a recipe, for :meth:`.Study.map`."""
    return inclination_errors(recipe(described).episode(seed, index), estimators)


def simulated_errors(study: Study, made: Recipe, episodes: int, estimators: Sequence[str]) -> list[dict[str, float]]:
    """Errors on the first episodes of a recipe, computed once a run folder."""
    seed = study.seed_of("realism", made.name)
    jobs = [(made.describe(), seed, index, tuple(estimators)) for index in range(episodes)]
    return study.map(f"estimators on {made.name}", episode_errors, jobs)


def recorded_errors(group: Recorded, estimators: Sequence[str]) -> list[dict[str, float]]:
    """Errors on the recordings of a group whose inclination is known."""
    return [inclination_errors(each, estimators) for each in group.load() if "up" in each.quantities]


def matrix(errors: Sequence[Mapping[str, float]], estimators: Sequence[str]) -> np.ndarray:
    """Errors ``(trajectories, estimators)``; NaN where one was not run."""
    return np.array([[each.get(name, np.nan) for name in estimators] for each in errors], dtype=float)


def kendall(one: np.ndarray, other: np.ndarray) -> float:
    """Kendall's τ-b of two rows of mean errors; NaN if fewer than two estimators have both."""
    from scipy.stats import kendalltau

    both = np.isfinite(one) & np.isfinite(other)
    return float(kendalltau(one[both], other[both]).statistic) if both.sum() > 1 else float("nan")


def agreement(simulated: np.ndarray, recorded: np.ndarray, seed: int) -> tuple[float, tuple[float, float]]:
    """τ of the order of mean errors ``(draws, estimators)``, and its 5 to 95 % interval over draws of both."""
    generator = np.random.default_rng(seed)

    def mean(errors: np.ndarray, rows: np.ndarray) -> np.ndarray:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            return np.asarray(np.nanmean(errors[rows], axis=0))

    def everything(errors: np.ndarray) -> np.ndarray:
        return np.arange(len(errors))

    tau = kendall(mean(simulated, everything(simulated)), mean(recorded, everything(recorded)))
    drawn = [
        kendall(*(mean(each, generator.integers(len(each), size=len(each))) for each in (simulated, recorded)))
        for _ in range(DRAWS)
    ]
    low, high = np.nanpercentile(drawn, [5.0, 95.0])
    return tau, (float(low), float(high))


def ranked(study: Study, episodes: int, group: Recorded) -> Ranked | None:
    """Order of the estimators on a group of recordings and on its recipe; None where no inclination can be judged."""
    role, names = ROLES[group.role], installed()
    errors = (
        study.cached(f"estimators on recordings {group.group}", recorded_errors, group, names) if role.ranked else []
    )
    if not errors:
        return None
    simulated, recorded = (
        matrix(each, names) for each in (simulated_errors(study, recipe(role.recipe), episodes, names), errors)
    )
    tau, (low, high) = agreement(simulated, recorded, study.seed_of("bootstrap", group.group))
    return Ranked(names, simulated, recorded, tau, low, high)
