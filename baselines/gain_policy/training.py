"""Train a gain policy by an agent of stable-baselines3; a stopped training resumes bit by bit.

The motions are simulated (:class:`poise.envs.hand.trajectories.HandTrajectories`), a fixed set drawn from a seed. First
the best constant gains are searched. The network starts from them, and its reward is relative to their error. This does
not change the optimal policy but removes most of the variance, since both process the same motion.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.gain_tuning import ReplayGainVectorEnv
from ...filters.adaptation.gains import tunable_filter
from ...filters.adaptation.named_features import features_of
from ...filters.adaptation.ruled_features import ruled_features
from ...filters.adaptation.tuned import TunedFilter
from ...filters.core.kalman import KalmanFilter
from ...filters.support.optional import extra
from ...filters.support.seeds import child_seeds, root_seed
from ...filters.support.version import package_version
from ..checkpoint import load_checkpoint, save_checkpoint
from .config import TrainingConfig
from .constant_gains import best_constant_gains
from .known_bias import bias_limit
from .oracle_warm_start import fit_oracle
from .policy import GainPolicy

if TYPE_CHECKING:
    from .agents.learners import Trained
    from .vec_env import SB3VecEnv

CHECKPOINT = "checkpoint.pt"
"""File of the run folder that a stopped training resumes from."""
HELD_BACK = 1 / 7
"""Share of the motions on which a training by the exact gradient chooses its policy."""
LOOKS = 6
"""Approximate number of validations during a training."""
CHECKPOINTS = 20
"""Approximate number of checkpoints of SAC and TD3, whose memory is large; other agents write one after each update."""

Report = Callable[[dict[str, float]], None]
Validate = Callable[[Any], float]


def train_policy(
    config: TrainingConfig,
    *,
    kalman: KalmanFilter | None = None,
    trajectories: Sequence[Trajectory] | None = None,
    start: np.ndarray | None = None,
    folder: str | Path | None = None,
    resume: bool = False,
    report: Report | None = None,
    validate: Validate | None = None,
) -> Trained:
    """Train a policy; the same arguments on the same machine give the same policy, interrupted and resumed or not.

    Args:
        config: settings.
        kalman: the filter, if it is not the one that ``config.filter`` names.
        trajectories: to train on, instead of simulated ones.
        start: constant action ``(k,)`` to start from; None searches it, or takes that of the checkpoint.
        folder: where checkpoints and TensorBoard logs go; None keeps nothing.
        resume: continue from the checkpoint in ``folder``; a longer ``total_timesteps`` than before is allowed.
        report: called after every update with ``steps``, ``gain`` (share of the error that is saved) and ``seconds``.
        validate: gives a score of a policy, the less the better; the best of about six validated policies is returned.

    Returns:
        The policy, a :class:`.RecurrentGainPolicy` of recurrent PPO; its card holds the configuration, the training
        time and the constant gains that it started from.

    Raises:
        ValueError: see :class:`TrainingConfig`; ``resume`` without a folder or a readable checkpoint; the checkpoint
            belongs to another configuration, filter, set of trajectories or version of the package.
    """
    if resume and folder is None:
        raise ValueError("resume needs a folder with a checkpoint")
    with extra("rl"):
        import stable_baselines3  # noqa: F401
        import torch

    filter = tunable_filter(config.filter) if kalman is None else kalman
    tuned = TunedFilter.of(filter, config.gains, features_of(filter, config.interval), config.smoothing)
    if config.rule is not None:
        tuned = replace(tuned, features=ruled_features(filter, config.rule, config.interval, tuned.ranges))
    motions = config.motions.draw_many(config.seed, config.trajectories) if trajectories is None else list(trajectories)
    home = None if folder is None else Path(folder)
    key = training_key(config, tuned, motions)
    if config.agent == "analytic":
        # Its learning rate falls to zero at the end, so another length is another training.
        key["config"]["total_timesteps"] = config.total_timesteps
    state = load_checkpoint(home / CHECKPOINT, key) if resume and home is not None else None
    if state is not None:
        start = state["start"]
    start = starting_action(config, tuned, motions) if start is None else np.asarray(start, float)
    limit = bias_limit(filter, motions)
    if config.agent == "analytic":
        return replace(analytic_policy(config, tuned, motions, start, home, key, report, state), bias_limit=limit)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        training = PolicyTraining(config, tuned, motions, start, home, key, report, validate)
        training.begin() if state is None else training.restore(state)
        policy = training.finish()
        return replace(policy, bias_limit=limit) if isinstance(policy, GainPolicy) else policy
    finally:
        torch.set_num_threads(threads)


def analytic_policy(
    config: TrainingConfig,
    tuned: TunedFilter,
    motions: list[Trajectory],
    start: np.ndarray,
    home: Path | None,
    key: dict[str, Any],
    report: Report | None,
    state: dict[str, Any] | None,
) -> GainPolicy:
    """A policy trained by the exact gradient; the last :data:`HELD_BACK` of the motions choose among its passes.

    ``report`` is given the decisions so far and the share of the cost that is saved on the motions held back;
    ``state`` is that of a checkpoint; see :class:`PolicyTraining` for the others.
    """
    from .analytic import train_analytically

    kept = max(1, round(HELD_BACK * len(motions)))
    train, unseen = (motions[:-kept], motions[-kept:]) if len(motions) > kept else (motions, [])
    decisions = sum(len(one) // tuned.features.interval_samples(one.dt) for one in train)
    epochs, started = max(1, round(config.total_timesteps / decisions)), time.perf_counter()
    earlier = 0.0 if state is None else state["seconds"]
    costs: list[float] = []

    def report_epoch(epoch: int, cost: float, unseen_cost: float) -> None:
        costs.append(unseen_cost if unseen else cost)
        if report is not None:
            report({"steps": float(decisions * (epoch + 1)), "gain": 1.0 - costs[-1], "seconds": seconds()})

    def save(content: dict[str, Any]) -> None:
        if home is not None:
            home.mkdir(parents=True, exist_ok=True)
            save_checkpoint(home / CHECKPOINT, key, {**content, "start": start, "seconds": seconds()})

    def seconds() -> float:
        return earlier + time.perf_counter() - started

    policy = train_analytically(
        tuned,
        train,
        start if config.rule is None else np.zeros_like(start),
        reference=start if config.rule or config.quantities else None,
        epochs=epochs,
        learning_rate=config.learning_rate,
        net_arch=config.net_arch,
        error_scale=config.error_scale,
        seed=config.seed,
        quantity=config.quantities or None,
        validation=unseen,
        report=report_epoch,
        save=save,
        state=state,
    )
    card = {
        "training": config.describe(),
        "constant_action": [float(value) for value in start],
        "steps": decisions * epochs,
        "chosen_steps": decisions * (1 + int(np.argmin(costs))),
        "costs": [round(cost, 4) for cost in costs],
        "seconds": round(seconds(), 1),
    }
    return replace(policy, card=json.loads(json.dumps(card)))


def starting_action(config: TrainingConfig, tuned: TunedFilter, motions: list[Trajectory]) -> np.ndarray:
    """The best constant gains ``(k,)`` on some of the motions, or the published ones if none are searched."""
    if not config.gain_search:
        return np.zeros(tuned.actions)
    common: dict[str, Any] = {"samples": config.gain_search, "refinements": config.gain_search, "seed": config.seed}
    return best_constant_gains(tuned, motions[:48], quantity=config.quantities or None, **common).action


def training_key(config: TrainingConfig, tuned: TunedFilter, motions: Sequence[Trajectory]) -> dict[str, Any]:
    """What a checkpoint must agree with; not the length, so that a longer training can continue a shorter one."""
    described = config.describe()
    del described["total_timesteps"]
    content = hashlib.sha256()
    for trajectory in motions:
        for name, values in sorted({**trajectory.measurements, **trajectory.truth, "mask": trajectory.mask}.items()):
            content.update(name.encode())
            content.update(np.ascontiguousarray(values).data)
    return {
        "config": described,
        "filter": repr(tuned.kalman),
        "trajectories": content.hexdigest()[:16],
        "versions": {name: package_version(name) for name in ("torch", "stable-baselines3")},
    }


class PolicyTraining:
    """Everything that changes during a training: model, normalisation, episodes, generators, the best policy so far.

    Args:
        config: settings.
        tuned: the filter with its actions and features.
        motions: training data.
        start: constant action ``(k,)`` to start from, the reference of the reward.
        home: folder of checkpoints and logs; None keeps nothing.
        key: what a checkpoint must agree with.
        report: see :func:`train_policy`.
        validate: likewise.
    """

    def __init__(
        self,
        config: TrainingConfig,
        tuned: TunedFilter,
        motions: list[Trajectory],
        start: np.ndarray,
        home: Path | None,
        key: dict[str, Any],
        report: Report | None,
        validate: Validate | None,
    ) -> None:
        from stable_baselines3.common.vec_env import VecNormalize

        from .agents.learners import make_learner
        from .vec_env import SB3VecEnv

        self.config, self.tuned, self.motions, self.start = config, tuned, motions, start
        self.home, self.key, self.report, self.validate = home, key, report, validate
        self.started, self.earlier = time.perf_counter(), 0.0
        self.rows = ReplayGainVectorEnv(
            config.n_envs,
            trajectory=motions,
            filter=tuned.kalman,
            gains=tuple(part.gain for part in tuned.ranges),
            interval=config.interval,
            reward="relative",
            reference=tuple(start.tolist()),
            error_scale=config.error_scale,
            smoothing=config.smoothing,
            privileged=config.agent == "ppo",
            autoreset_mode="SameStep",
            staggered=True,
            infos=False,
        )
        self.batch: SB3VecEnv = SB3VecEnv(self.rows)
        # Any, because its statistics are typed as those of observations in dictionaries too.
        self.env: Any = VecNormalize(self.batch, gamma=config.gamma, clip_obs=1e6)
        self.model: Any = make_learner(config, self.env, start, home)
        self.batch.seed(child_seeds(root_seed(config.seed), config.n_envs))
        self.best: Trained | None = None
        self.best_score, self.best_steps, self.looked, self.saved = np.inf, 0, 0, 0

    @property
    def steps(self) -> int:
        """Decisions so far."""
        return int(self.model.num_timesteps)

    @property
    def seconds(self) -> float:
        """Training time so far, also that before interruptions."""
        return time.perf_counter() - self.started + self.earlier

    def begin(self) -> None:
        """The oracle warm start, a first validation of its policy, and the first observation."""
        config = self.config
        if config.warm_start and config.agent == "ppo":
            from .actor_critic import warm_start

            centre = self.start if config.warm_start_centre is None else np.asarray(config.warm_start_centre)
            motions = self.motions[: config.warm_start]
            oracle = fit_oracle(self.tuned, motions, centre, net_arch=config.net_arch, seed=config.seed)
            warm_start(self.model, self.env, oracle, [self.rows.single.episode_over(motion) for motion in self.motions])
            self.look()
        # As the model itself would at the start of `learn`, but a checkpoint can be written before it.
        self.model._last_obs = self.env.reset()
        self.model._last_episode_starts = np.ones(config.n_envs, dtype=bool)
        if config.agent in ("sac", "td3"):
            self.model._last_original_obs = self.env.get_original_obs()
        self.save()

    def finish(self) -> Trained:
        """Train to the end and give the policy."""
        from .agents.progress import GainProgress

        remaining = self.config.total_timesteps - self.steps
        if remaining > 0:
            self.model.after_update = self.after_update
            progress = GainProgress()
            self.model.learn(remaining, progress, reset_num_timesteps=False, tb_log_name="tensorboard")
            self.model.after_update = None
        self.look()
        policy = self.exported() if self.best is None else self.best
        card = {
            "training": self.config.describe(),
            "constant_action": [float(value) for value in self.start],
            "steps": self.steps,
            "chosen_steps": self.steps if self.best is None else self.best_steps,
            "seconds": round(self.seconds, 1),
        }
        return replace(policy, card=json.loads(json.dumps(card)))

    def exported(self) -> Trained:
        """The current policy."""
        from .agents.learners import exported_policy

        return exported_policy(self.model, self.env, self.tuned, self.config.agent)

    def after_update(self) -> None:
        """Validate the policy if due, report, and write a checkpoint."""
        due = self.steps - self.looked >= self.config.total_timesteps / LOOKS
        if due and self.steps < self.config.total_timesteps:
            self.look()
        if self.report is not None:
            finished: list[Any] = list(self.model.ep_info_buffer or ())
            gain = float(np.mean([episode["r"] / episode["l"] for episode in finished])) if finished else float("nan")
            self.report({"steps": float(self.steps), "gain": gain, "seconds": self.seconds})
        large = self.config.agent in ("sac", "td3")
        if not large or self.steps - self.saved >= self.config.total_timesteps / CHECKPOINTS:
            self.save()

    def look(self) -> None:
        """Score the current policy, and keep it if it is the best so far."""
        if self.validate is None:
            return
        self.looked = self.steps
        policy = self.exported()
        score = float(self.validate(policy))
        if hasattr(self.model, "_logger"):
            self.model.logger.record("validation/score", score)
        if score < self.best_score:
            self.best, self.best_score, self.best_steps = policy, score, self.steps

    def save(self) -> None:
        """Write a checkpoint, if there is a folder: everything that the rest of the training depends on."""
        self.saved = self.steps
        if self.home is None:
            return
        import torch

        from .agents.learners import arrays_of_policy
        from .agents.snapshot import learner_state

        env = self.env
        self.home.mkdir(parents=True, exist_ok=True)
        # The global generator, because stable-baselines3 shuffles its batches with it.
        generator: Any = np.random.get_state()  # noqa: NPY002
        name, keys, *rest = generator
        normalisation = [env.obs_rms.mean, env.obs_rms.var, env.ret_rms.mean, env.ret_rms.var, env.returns]
        state = {
            "start": self.start,
            "learner": learner_state(self.model),
            "looks": [self.looked, self.best_steps],
            "normalisation": normalisation,
            "counts": [float(env.obs_rms.count), float(env.ret_rms.count)],
            "rows": self.rows.snapshot(),
            "unfinished": [self.batch.returns, self.batch.lengths],
            "best_score": float(self.best_score),
            "best": None if self.best is None else arrays_of_policy(self.best),
            "generators": {
                "torch": torch.get_rng_state(),
                "numpy": [str(name), keys.astype(np.int64), json.dumps(rest)],
            },
            "seconds": self.seconds,
        }
        save_checkpoint(self.home / CHECKPOINT, self.key, state)

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from the state of a checkpoint as if there had been no interruption."""
        import torch

        from .agents.learners import policy_of_arrays
        from .agents.snapshot import restore_learner

        env = self.env
        restore_learner(self.model, state["learner"])
        self.looked, self.best_steps = state["looks"]
        self.saved = self.steps
        obs_rms, ret_rms = env.obs_rms, env.ret_rms
        obs_rms.mean, obs_rms.var, ret_rms.mean, ret_rms.var, env.returns = state["normalisation"]
        obs_rms.count, ret_rms.count = state["counts"]
        self.rows.restore(state["rows"])
        self.batch.returns, self.batch.lengths = state["unfinished"]
        if state["best"] is not None:
            self.best = policy_of_arrays(state["best"], self.exported())
        self.best_score, self.earlier = state["best_score"], state["seconds"]
        generators = state["generators"]
        torch.set_rng_state(generators["torch"])
        name, keys, rest = generators["numpy"]
        np.random.set_state((name, keys, *json.loads(rest)))  # noqa: NPY002
