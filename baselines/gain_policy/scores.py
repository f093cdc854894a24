"""Reference scores of the gain environments, and scores of agents between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.gain_env import GainTuningEnv
from ...envs.gain_episode import filter_for
from ...envs.gain_reward import errors_of, true_values
from ...envs.registration import make_environment
from ...filters.core.metrics import rms
from ...filters.support.names import look_up
from ...filters.support.seeds import child_seed
from .constant_gains import best_constant_gains, constant_errors, left_out_errors

REPLAY = "poise/ReplayGain-v0"
"""Its episodes are recordings, so its scores depend on them."""
EPISODES, POINTS, SEED = 24, 64, 0
"""Episodes of each split, constant actions that the oracle chooses from, and root seed of the shipped table."""


class ReferenceScores(NamedTuple):
    """Mean over the test episodes of the root mean square error, deg.

    Attributes:
        random: uniform actions.
        neutral: the published gains.
        constant: the best constant gains of other episodes; of recordings, those of all other recordings.
        oracle: the best of :data:`POINTS` constant actions on each episode, which needs the truth.
    """

    random: float
    neutral: float
    constant: float
    oracle: float


SCORES: dict[str, ReferenceScores] = {
    "poise/HandMotionGain-v0": ReferenceScores(random=2.945, neutral=2.944, constant=2.447, oracle=2.338),
    "poise/RiderBicycleGain-v0": ReferenceScores(random=6.764, neutral=6.771, constant=5.571, oracle=5.57),
}
"""Id with its default arguments → reference scores, as :func:`reference_scores` gives them."""

RECORDED: dict[str, ReferenceScores] = {
    "broad": ReferenceScores(random=4.049, neutral=4.046, constant=2.795, oracle=2.62),
    "repoimu": ReferenceScores(random=1.403, neutral=1.404, constant=1.83, oracle=0.847),
    "smartphones": ReferenceScores(random=2.63, neutral=2.637, constant=3.185, oracle=1.902),
}
"""Recordings that ``poise/ReplayGain-v0`` runs over → reference scores: 10 trials of BROAD, 4 of RepoIMU, 6 of carried
phones, those of the other tables."""


def normalized_score(identity: str, error: float, data: str | None = None) -> float:
    """Score of an agent: 0 as the published gains, 1 as the oracle; negative where it is worse than the former.

    Args:
        identity: of a gain environment with its default arguments.
        error: mean over test episodes (:func:`episodes_of`, split 1) of the root mean square error, deg.
        data: of ``poise/ReplayGain-v0``: the recordings, a name in :data:`RECORDED`.

    Raises:
        ValueError: an id or recordings without reference scores, or an error that is negative or not finite.
    """
    scores = look_up("data set", data or "", RECORDED) if identity == REPLAY else look_up("id", identity, SCORES)
    if not 0.0 <= error < np.inf:
        raise ValueError(f"error must be 0 deg or more, got {error}")
    return (scores.neutral - error) / (scores.neutral - scores.oracle)


def episodes_of(identity: str, split: int, count: int = EPISODES, seed: int = SEED) -> list[Any]:
    """Trajectories of a gain environment with its default arguments; both splits of rides are drawn from one set.

    Args:
        identity: of the environment.
        split: 0 for training, 1 for the test.
        count: how many.
        seed: root seed.
    """
    env: Any = make_environment(identity).unwrapped
    assert isinstance(env, GainTuningEnv)
    generator = np.random.default_rng(child_seed(seed, split))
    try:
        return [env.draw(generator)[1]() for _ in range(count)]
    finally:
        env.close()


def reference_scores(
    identity: str,
    count: int = EPISODES,
    points: int = POINTS,
    seed: int = SEED,
    recordings: Sequence[Trajectory] | None = None,
) -> ReferenceScores:
    """Compute the reference scores of a gain environment with its default arguments.

    Args:
        identity: of the environment.
        count: episodes of each split.
        points: constant actions of the search and of the oracle.
        seed: root seed.
        recordings: of ``poise/ReplayGain-v0``, two or more: each is a test episode whose constants are the best of the
            points on all others.
    """
    from scipy.signal import lfilter

    env: Any = make_environment(identity).unwrapped
    tuned, quantity = env.tuned, env.quantities[0].name
    if recordings is None:
        train, test = (episodes_of(identity, split, count, seed) for split in (0, 1))
    else:
        train = test = [each.on_grid() for each in recordings]
    refinements = 0 if recordings is not None else points // 2
    found = best_constant_gains(tuned, train, quantity=quantity, samples=points, refinements=refinements, seed=seed)
    if recordings is None:
        constant = constant_errors(tuned, test, found.action, quantity)
        tried = np.stack([constant_errors(tuned, test, action, quantity) for action in found.tried[: points + 1]])
    else:
        tried = found.scores
        constant = left_out_errors(tried)
    neutral = tried[0]
    rng, random = np.random.default_rng(child_seed(seed, 2)), []
    for trajectory in test:
        kalman = filter_for(tuned.kalman, trajectory)
        interval = tuned.features.interval_samples(trajectory.dt)
        actions = rng.uniform(-1.0, 1.0, (len(trajectory) // interval + 1, tuned.actions))
        if tuned.smoothing:
            share = -np.expm1(-interval * trajectory.dt / tuned.smoothing)
            actions = lfilter([share], [1.0, share - 1.0], actions, axis=0)
        gains = tuned.gains(np.repeat(actions, interval, axis=0)[: len(trajectory)])
        pose = kalman.run(trajectory.measurements, gains).pose
        errors = errors_of(env.quantities, pose, true_values(trajectory, env.quantities[0], kalman))
        random.append(float(rms(errors, trajectory.mask)))
    env.close()
    means = (np.mean(random), neutral.mean(), constant.mean(), np.min(tried, axis=0).mean())
    return ReferenceScores(*(round(float(np.degrees(mean)), 3) for mean in means))
