"""An actor that sees observations and a critic that sees the truth as well: better advantages, the same policy to run.

L. Pinto, M. Andrychowicz, P. Welinder, W. Zaremba, P. Abbeel, "Asymmetric Actor Critic for Image-Based Robot Learning",
Robotics: Science and Systems, 2018. The first numbers of an observation are what the actor sees; those that follow
are known in simulation only and reach nothing but the value function.
"""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor


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


class AsymmetricPolicy(ActorCriticPolicy):
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
