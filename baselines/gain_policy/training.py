"""Train a gain policy by proximal policy optimisation (Stable-Baselines3) and export it to plain arrays.

The motions are simulated (:class:`poise.envs.hand.trajectories.HandTrajectories`), a fixed set drawn from a seed.
First the best constant gains are searched; the network starts from them and is rewarded for what it gains over them,
which changes no optimal policy but takes most of the variance away, since both see the same motion.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...envs.data.trajectory import Trajectory
from ...envs.hand.gestures import Mixed
from ...envs.hand.trajectories import HandTrajectories
from ...envs.sensors.presets import sensor_preset
from ...filters.adaptation.features import InnovationFeatures
from ...filters.adaptation.gains import tunable_filter
from ...filters.adaptation.tuned import TunedFilter
from ...filters.core.kalman import KalmanFilter
from .constant_gains import best_constant_gains
from .hindsight import Chooser, fit_hindsight
from .policy import GainPolicy

SUSTAINED = Mixed(lengths=(15.0, 40.0), rest_share=0.1, spread=0.5, single_share=0.25)
"""Motion of one kind that lasts, beside the quick changes of ``mixed``."""

VIBRATING = replace(
    sensor_preset("st-lsm6dsox"),
    name="vibrating",
    source="st-lsm6dsox on something that vibrates",
    accelerometer=replace(sensor_preset("st-lsm6dsox").accelerometer, white_noise=0.1),
    gyroscope=replace(sensor_preset("st-lsm6dsox").gyroscope, white_noise=1e-3),
)
"""A sensor that shakes at frequencies beyond those of a hand, at 100 Hz by 1 m/s² and 0.6 °/s."""

TRAINING_MOTIONS = HandTrajectories(
    gestures=("mixed", "mixed", "mixed", SUSTAINED, SUSTAINED, "slow", "fast", "severe", "rest"),
    rates=(100.0, 286.0),
    sensors=("paper-hand", "xsens-mtw-awinda", "st-lsm6dsox", VIBRATING),
    grade=(0.1, 1.0),
    duration=60.0,
)
"""What shipped policies are trained on."""

CHECKPOINT, STATISTICS, PROGRESS = "model.zip", "statistics.pkl", "progress.json"
"""Files of a checkpoint in the run folder."""


@dataclass(frozen=True)
class TrainingConfig:
    """How a policy is trained."""

    filter: str = "external-acceleration"
    """name of the filter"""
    gains: tuple[str, ...] | None = None
    """gains that the policy sets; None for all of the filter"""
    interval: float = 0.1
    """s from decision to decision"""
    motions: HandTrajectories = field(default=TRAINING_MOTIONS)
    """what is simulated"""
    trajectories: int = 240
    """number of simulated trajectories to train on"""
    seed: int = 0
    """root of all randomness"""
    steps: int = 1_000_000
    """decisions in total"""
    envs: int = 256
    """episodes at a time"""
    rollout: int = 64
    """decisions of each episode between two updates"""
    batch: int = 4096
    """decisions in a gradient step"""
    epochs: int = 8
    """passes over a rollout, fewer if the policy has changed enough"""
    learning_rate: float = 1e-4
    """at the start; falls linearly to a tenth"""
    discount: float = 0.995
    """factor a decision; 0.995 looks 20 s ahead at 10 decisions a second, as a biased gyroscope takes time to show"""
    trace: float = 0.95
    """λ of generalised advantage estimation"""
    error_scale: float = 5.0
    """deg: errors far above it count by their logarithm in the reward"""
    hidden: tuple[int, ...] = (64, 64)
    """units of the hidden layers"""
    spread: float = 0.1
    """standard deviation of the actions at the start, about"""
    persistence: int = 32
    """decisions for which the exploration stays the same function of what is seen; a filter forgets single ones"""
    hindsight: int = 150
    """trajectories on which the first policy is fitted to hindsight; 0 starts from the constant gains"""
    centre: tuple[float, ...] | None = None
    """action around which hindsight looks; None for the best constant gains"""
    search: int = 64
    """points of the search for constant gains, the reference of the reward; 0 takes the published tuning"""

    def __post_init__(self) -> None:
        for name in ("trajectories", "steps", "envs", "rollout", "batch", "epochs"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not 0.0 <= self.discount < 1.0:
            raise ValueError(f"discount must lie in [0, 1), got {self.discount}")
        if self.hindsight < 0 or self.search < 0 or self.spread <= 0.0 or self.learning_rate <= 0.0:
            raise ValueError("hindsight and search must not be negative, spread and learning_rate must be positive")
        if not self.error_scale > 0.0:
            raise ValueError(f"error_scale must be positive degrees, got {self.error_scale}")

    def describe(self) -> dict[str, Any]:
        """Everything, as JSON knows it."""
        values = {part.name: getattr(self, part.name) for part in fields(self)} | {"motions": self.motions.describe()}
        return json.loads(json.dumps(values))


def shipped_config(filter: str) -> TrainingConfig:
    """The configuration that the shipped weights of a filter were trained with.

    They begin from hindsight. Started from the best constant gains, the same number of steps wins little in simulation
    and loses on recordings; from hindsight over the whole box of actions, the filter is lost in single motions.
    """
    if filter == "bounded-motion":
        # The bias gain is left alone: motion that looks like a wandering bias is more frequent than one.
        return TrainingConfig(filter=filter, gains=("process", "velocity"), centre=(0.0, 0.0))
    # The valley in which the measurement variance does the work, and c_a, which trusts the filter's own error, little.
    return TrainingConfig(filter=filter, centre=(-0.7, 0.7, -0.7))


def train_policy(
    config: TrainingConfig,
    *,
    kalman: KalmanFilter | None = None,
    trajectories: Sequence[Trajectory] | None = None,
    start: np.ndarray | None = None,
    folder: str | Path | None = None,
    resume: bool = False,
    report: Callable[[dict[str, float]], None] | None = None,
    validate: Callable[[GainPolicy], float] | None = None,
) -> GainPolicy:
    """Train a policy; the same arguments on the same machine give the same policy.

    Args:
        config: what to do.
        kalman: the filter, if it is not the one that ``config.filter`` names.
        trajectories: to train on, instead of simulated ones.
        start: constant action ``(k,)`` to start from; None searches it, or takes that of the checkpoint.
        folder: where checkpoints and TensorBoard logs go; None keeps nothing.
        resume: go on from the checkpoint in ``folder``, if there is one.
        report: called after every update with ``steps``, ``gain`` (share of the error that is saved) and ``seconds``.
        validate: gives a score of a policy, the less the better; the best of about six looks is returned, not the last.

    Returns:
        The policy; its card holds the configuration, the training time and the constant gains that it started from.

    Raises:
        ValueError: see :class:`TrainingConfig`; ``resume`` without a folder; checkpoint of another configuration.
    """
    if resume and folder is None:
        raise ValueError("resume needs a folder with a checkpoint")
    import torch
    from stable_baselines3.common.vec_env import VecNormalize

    from .batch import TuningBatch

    started = time.perf_counter()
    filter = tunable_filter(config.filter) if kalman is None else kalman
    tuned = TunedFilter.of(filter, config.gains, InnovationFeatures(config.interval))
    motions = config.motions.draw_many(config.seed, config.trajectories) if trajectories is None else list(trajectories)
    home = None if folder is None else Path(folder)
    if home is not None:
        home.mkdir(parents=True, exist_ok=True)
    done = load_progress(home, config) if resume and home is not None else {}
    if done:
        start = np.asarray(done["constant"])
    elif start is not None:
        start = np.asarray(start, float)
    elif config.search:
        few = motions[:48]
        effort: dict[str, Any] = {"samples": config.search, "refinements": config.search, "seed": config.seed}
        start = best_constant_gains(tuned, few, **effort).action
    else:
        start = np.zeros(tuned.actions)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        scale = config.error_scale
        batch = TuningBatch(
            tuned, motions, config.envs, seed=config.seed, reference=start, error_scale=scale, relative=True
        )
        if done and home is not None:
            env = VecNormalize.load(str(home / STATISTICS), batch)
        else:
            env = VecNormalize(batch, gamma=config.discount, clip_obs=1e6)
        model = make_model(config, env, start, home if done else None, home)
        if config.hindsight and not done:
            centre = start if config.centre is None else np.asarray(config.centre)
            first = fit_hindsight(tuned, motions[: config.hindsight], centre, hidden=config.hidden, seed=config.seed)
            begin_with(model, env, first, batch)
        callback = make_callback(config, tuned, start, home, report, validate, started, float(done.get("seconds", 0.0)))
        remaining = config.steps - int(model.num_timesteps)
        if remaining > 0:
            model.learn(remaining, callback=callback, reset_num_timesteps=not done, tb_log_name="tensorboard")
    finally:
        torch.set_num_threads(threads)
    policy = callback.best if callback.best is not None else export_policy(model, env, tuned)
    seconds = time.perf_counter() - started + float(done.get("seconds", 0.0))
    card = {
        "training": config.describe(),
        "constant_action": [float(value) for value in start],
        "steps": int(model.num_timesteps),
        "chosen_steps": int(model.num_timesteps if callback.best_steps is None else callback.best_steps),
        "seconds": round(seconds, 1),
    }
    return replace(policy, card=json.loads(json.dumps(card)))


def make_model(config: TrainingConfig, env: Any, start: np.ndarray, checkpoint: Path | None, logs: Path | None) -> Any:
    """The PPO model, new or from a checkpoint; a new one begins with the constant action ``start``."""
    import torch
    from stable_baselines3 import PPO

    from .asymmetric import AsymmetricPolicy
    from .batch import PRIVILEGED

    def learning_rate(remaining: float) -> float:
        return config.learning_rate * (0.1 + 0.9 * remaining)

    if checkpoint is not None:
        return PPO.load(checkpoint / CHECKPOINT, env=env, device="cpu", custom_objects={"learning_rate": learning_rate})
    size = config.envs * config.rollout
    model = PPO(
        AsymmetricPolicy,
        env,
        learning_rate=learning_rate,
        n_steps=config.rollout,
        batch_size=min(config.batch, size),
        n_epochs=config.epochs,
        gamma=config.discount,
        gae_lambda=config.trace,
        clip_range=0.2,
        target_kl=0.01,
        use_sde=True,
        sde_sample_freq=config.persistence,
        ent_coef=0.0,
        policy_kwargs={
            "seen": env.observation_space.shape[0] - PRIVILEGED,
            "net_arch": list(config.hidden),
            "activation_fn": torch.nn.Tanh,
            # The noise is a linear function of the last hidden layer, whose tanh units have a mean square of about 0.3.
            "log_std_init": float(np.log(config.spread / np.sqrt(0.3 * config.hidden[-1]))),
        },
        seed=config.seed,
        device="cpu",
        tensorboard_log=None if logs is None else str(logs),
    )
    with torch.no_grad():
        parameters = dict(model.policy.action_net.named_parameters())
        parameters["bias"].copy_(torch.as_tensor(0.95 * start))
        parameters["weight"].mul_(0.1)
    return model


def begin_with(model: Any, env: Any, first: Chooser, batch: Any) -> None:
    """Give the actor the weights of a network, and ``env`` the normalisation that it was trained with."""
    import torch

    modules = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    linear = [module for module in modules if hasattr(module, "weight")]
    with torch.no_grad():
        for mine, theirs in zip(linear, first.linear, strict=True):
            mine.weight.copy_(theirs.weight)
            mine.bias.copy_(theirs.bias)
    privileged = batch.privileged_statistics()
    env.obs_rms.mean = np.concatenate([first.mean, privileged[0]])
    env.obs_rms.var = np.concatenate([first.deviation**2, privileged[1] ** 2])
    # From here on the normalisation is part of the actor and must not drift.
    env.obs_rms.count = 1e12


def export_policy(model: Any, env: Any, tuned: TunedFilter) -> GainPolicy:
    """The deterministic part of an SB3 policy as plain arrays, with the normalisation of ``env`` in the first layer.

    Args:
        model: from :func:`make_model`.
        env: its VecNormalize.
        tuned: what it was trained on.
    """
    modules = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    linear = [module for module in modules if hasattr(module, "weight")]
    layers = [(m.weight.detach().numpy().astype(float), m.bias.detach().numpy().astype(float)) for m in linear]
    seen = tuned.observation_size
    mean, deviation = env.obs_rms.mean[:seen], np.sqrt(env.obs_rms.var[:seen] + env.epsilon)
    weight, bias = layers[0]
    layers[0] = (weight / deviation, bias - (weight / deviation) @ mean)
    return GainPolicy(tuned.name, tuned.ranges, tuned.features, tuple(layers))


def make_callback(
    config: TrainingConfig,
    tuned: TunedFilter,
    start: np.ndarray,
    home: Path | None,
    report: Callable[[dict[str, float]], None] | None,
    validate: Callable[[GainPolicy], float] | None,
    started: float,
    earlier: float,
) -> Any:
    """The callback that reports, validates and saves after every update."""
    from stable_baselines3.common.callbacks import BaseCallback

    class Watch(BaseCallback):
        best: GainPolicy | None = None
        best_steps: int | None = None
        best_score = np.inf
        looked = 0

        def _on_rollout_start(self) -> None:
            if self.num_timesteps == 0:
                if validate is not None and config.hindsight:
                    self._look()
                return
            seconds = time.perf_counter() - started + earlier
            buffer: Any = self.model.ep_info_buffer or []
            gain = float(np.mean([episode["r"] for episode in buffer])) if buffer else float("nan")
            if validate is not None and self.num_timesteps - self.looked >= config.steps / 6:
                self._look()
            if report is not None:
                report({"steps": float(self.num_timesteps), "gain": gain, "seconds": seconds})
            if home is not None:
                self.model.save(home / CHECKPOINT)
                self.training_env.save(str(home / STATISTICS))  # type: ignore[attr-defined]
                progress = {"config": config_key(config), "constant": start.tolist(), "seconds": seconds}
                (home / PROGRESS).write_text(json.dumps(progress), encoding="utf-8")

        def _look(self) -> None:
            self.looked = self.num_timesteps
            policy = export_policy(self.model, self.training_env, tuned)
            score = validate(policy) if validate is not None else 0.0
            self.logger.record("validation/score", score)
            if score < self.best_score:
                self.best, self.best_score, self.best_steps = policy, score, self.num_timesteps

        def _on_training_end(self) -> None:
            if validate is not None:
                self._look()

        def _on_step(self) -> bool:
            return True

    return Watch()


def config_key(config: TrainingConfig) -> dict[str, Any]:
    """The configuration as JSON, without the length: a longer training may go on from a shorter one."""
    plain = config.describe()
    return {name: value for name, value in plain.items() if name != "steps"}


def load_progress(home: Path, config: TrainingConfig) -> dict[str, Any]:
    """What the checkpoint in ``home`` says; empty if there is none.

    Raises:
        ValueError: it belongs to another configuration.
    """
    path = home / PROGRESS
    if not all((home / name).is_file() for name in (PROGRESS, CHECKPOINT, STATISTICS)):
        return {}
    progress = json.loads(path.read_text(encoding="utf-8"))
    if progress["config"] != config_key(config):
        raise ValueError(f"{home} holds a checkpoint of another configuration; choose another folder")
    return progress
