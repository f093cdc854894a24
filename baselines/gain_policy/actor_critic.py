"""Asymmetric actor–critic for PPO: the actor receives observations, the critic also the truth.

L. Pinto, M. Andrychowicz, P. Welinder, W. Zaremba, P. Abbeel, "Asymmetric Actor Critic for Image-Based Robot Learning",
Robotics: Science and Systems, 2018. The first numbers of an observation are inputs of the actor. The others are known
in simulation only and are inputs of the value function alone, so the policy runs without them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from ...envs.gain_episode import PRIVILEGED, GainEpisode
from ...filters.support.optional import extra
from .config import TrainingConfig
from .oracle_warm_start import OracleNetwork

with extra("rl"):
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.torch_layers import MlpExtractor
    from stable_baselines3.common.vec_env import VecNormalize


class AsymmetricExtractor(MlpExtractor):
    """Two networks, of which that of the actor takes the first ``seen`` features only.

    Args:
        seen: number of features of the actor.
        features: number of features of the critic.
        net_arch: units of the hidden layers of both.
        activation: class of the activation.
        device: where the weights are.
    """

    def __init__(
        self, seen: int, features: int, net_arch: list[int], activation: type[torch.nn.Module], device: torch.device
    ) -> None:
        super().__init__(features, net_arch, activation, device)
        self.seen = seen
        self.policy_net = MlpExtractor(seen, net_arch, activation, device).policy_net

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Hidden features of the actor ``(batch, units)``."""
        return self.policy_net(features[..., : self.seen])


class AsymmetricActorCriticPolicy(ActorCriticPolicy):
    """An MLP policy whose actor sees the first ``seen`` numbers of the observation.

    Args:
        seen: how many.
    """

    def __init__(self, *args: Any, seen: int, **kwargs: Any) -> None:
        self.seen = seen
        super().__init__(*args, **kwargs)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        return {**super()._get_constructor_parameters(), "seen": self.seen}

    def _build_mlp_extractor(self) -> None:
        assert isinstance(self.net_arch, list)
        self.mlp_extractor = AsymmetricExtractor(
            self.seen, self.features_dim, self.net_arch, self.activation_fn, self.device
        )


class AfterUpdate:
    """Added to a model of stable-baselines3: calls ``after_update`` after every update, between two rollouts.

    A callback of stable-baselines3 is called after the exploration noise of the next rollout was drawn, which is too
    late for a checkpoint.
    """

    after_update: Callable[[], None] | None = None

    def train(self, *args: Any, **kwargs: Any) -> None:
        """Update the networks."""
        super().train(*args, **kwargs)  # type: ignore[misc]
        if self.after_update is not None:
            self.after_update()


class GainPPO(AfterUpdate, PPO):
    """PPO with a checkpoint after every update."""


def ppo_settings(config: TrainingConfig, logs: Path | None) -> dict[str, Any]:
    """Arguments of PPO with a memory and without; the learning rate falls linearly to a tenth."""
    return {
        "learning_rate": lambda remaining: config.learning_rate * (0.1 + 0.9 * remaining),
        "n_steps": config.n_steps,
        "batch_size": min(config.batch_size, config.n_envs * config.n_steps),
        "n_epochs": config.n_epochs,
        "gamma": config.gamma,
        "gae_lambda": config.gae_lambda,
        "clip_range": 0.2,
        "ent_coef": 0.0,
        "target_kl": 0.01,
        "seed": config.seed,
        "device": "cpu",
        "tensorboard_log": None if logs is None else str(logs),
    }


def make_model(config: TrainingConfig, env: VecNormalize, start: np.ndarray, logs: Path | None = None) -> GainPPO:
    """A new PPO model whose actions are about the constant action ``start``.

    Args:
        config: its settings.
        env: normalised environment whose observations end with :data:`.PRIVILEGED` numbers for the critic.
        start: action ``(k,)``.
        logs: folder of the TensorBoard log; None for none.
    """
    model = GainPPO(
        AsymmetricActorCriticPolicy,
        env,
        **ppo_settings(config, logs),
        use_sde=True,
        sde_sample_freq=config.sde_sample_freq,
        policy_kwargs={
            "seen": spaces.flatdim(env.observation_space) - PRIVILEGED,
            "net_arch": list(config.net_arch),
            "activation_fn": torch.nn.Tanh,
            # The noise is a linear function of the last hidden layer, whose tanh units have a mean square of about 0.3.
            "log_std_init": float(np.log(config.initial_std / np.sqrt(0.3 * config.net_arch[-1]))),
        },
    )
    with torch.no_grad():
        output = actor_layers(model)[-1]
        output.bias.copy_(torch.as_tensor(0.95 * start))
        output.weight.mul_(0.1)
    return model


def actor_layers(model: PPO) -> list[Any]:
    """The linear layers of the actor, from observation to action."""
    policy: Any = model.policy
    return [module for module in (*policy.mlp_extractor.policy_net, policy.action_net) if hasattr(module, "weight")]


def warm_start(model: PPO, env: VecNormalize, oracle: OracleNetwork, episodes: Sequence[GainEpisode]) -> None:
    """Give the actor the weights of the oracle's clone, and ``env`` the normalisation that it was trained with."""
    with torch.no_grad():
        for mine, theirs in zip(actor_layers(model), oracle.linear, strict=True):
            mine.weight.copy_(theirs.weight)
            mine.bias.copy_(theirs.bias)
    known = np.concatenate([episode.foresight for episode in episodes])
    # The agent's own error is not known beforehand; it is about that of the reference.
    table = np.concatenate([known, known[:, 1:2]], axis=1)
    statistics: Any = env.obs_rms
    statistics.mean = np.concatenate([oracle.mean, table.mean(axis=0)])
    statistics.var = np.concatenate([oracle.std**2, (table.std(axis=0) + 1e-3) ** 2])
    # From here on the normalisation is part of the actor and must not drift.
    statistics.count = 1e12
