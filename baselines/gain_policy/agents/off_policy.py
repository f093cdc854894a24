"""SAC and TD3 of stable-baselines3: deterministic policies whose last layer is squashed by tanh.

T. Haarnoja et al., "Soft Actor-Critic Algorithms and Applications", arXiv:1812.05905, 2018. S. Fujimoto, H. van Hoof,
D. Meger, "Addressing Function Approximation Error in Actor-Critic Methods", ICML 2018.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....filters.adaptation.tuned import TunedFilter
from ....filters.support.optional import extra
from ..actor_critic import AfterUpdate
from ..config import TrainingConfig
from ..policy import GainPolicy

with extra("rl"):
    import torch
    from stable_baselines3 import SAC, TD3
    from stable_baselines3.common.noise import NormalActionNoise

LARGEST = 0.98
"""largest size of a starting action: the squashed layer reaches 1 only at infinity"""


class GainSAC(AfterUpdate, SAC):
    """SAC with a checkpoint between its updates."""


class GainTD3(AfterUpdate, TD3):
    """TD3 with a checkpoint between its updates."""


def make_off_policy(config: TrainingConfig, env: Any, start: np.ndarray, logs: Path | None = None) -> GainSAC | GainTD3:
    """A new model whose actions are about the constant action ``start``.

    Args:
        config: its settings.
        env: normalised environment.
        start: action ``(k,)``.
        logs: folder of the TensorBoard log; None for none.
    """
    settings = config.off_policy
    common: dict[str, Any] = {
        "learning_rate": settings.learning_rate,
        "buffer_size": max(settings.buffer_size, config.n_envs),
        "learning_starts": settings.learning_starts,
        "batch_size": settings.batch_size,
        "gamma": config.gamma,
        "train_freq": 1,
        "gradient_steps": settings.gradient_steps,
        "policy_kwargs": {"net_arch": list(config.net_arch), "activation_fn": torch.nn.Tanh},
        "seed": config.seed,
        "device": "cpu",
        "tensorboard_log": None if logs is None else str(logs),
    }
    model: GainSAC | GainTD3
    if config.agent == "sac":
        model = GainSAC("MlpPolicy", env, **common)
    else:
        size = len(start)
        noise = NormalActionNoise(np.zeros(size), np.full(size, settings.noise))
        model = GainTD3("MlpPolicy", env, action_noise=noise, **common)
    with torch.no_grad():
        output = linear_layers(model)[-1]
        output.bias.copy_(torch.as_tensor(np.arctanh(np.clip(start, -LARGEST, LARGEST))))
        output.weight.mul_(0.1)
        if config.agent == "td3":
            model.actor_target.load_state_dict(model.actor.state_dict())  # type: ignore[union-attr]
    return model


def linear_layers(model: GainSAC | GainTD3) -> list[Any]:
    """The linear layers of the actor, from observation to the mean before it is squashed."""
    actor: Any = model.actor
    parts = [*actor.latent_pi, actor.mu] if isinstance(model, SAC) else list(actor.mu)
    return [part for part in parts if isinstance(part, torch.nn.Linear)]


def export_squashed(model: GainSAC | GainTD3, tuned: TunedFilter, mean: np.ndarray, std: np.ndarray) -> GainPolicy:
    """The deterministic policy as plain arrays: its tanh lies before an identity as the last layer.

    Args:
        model: trained.
        tuned: the filter that it sets.
        mean: of the observations ``(n,)``.
        std: their standard deviations ``(n,)``.
    """
    policy = GainPolicy.of_network(tuned, linear_layers(model), mean, std)
    identity = (np.eye(tuned.actions), np.zeros(tuned.actions))
    return replace(policy, layers=(*policy.layers, identity))
