"""Recurrent PPO of sb3-contrib, and its policy on plain arrays: one LSTM that remembers, a layer that acts.

The observation of a gain environment already holds averages over 16 s. A memory of its own can add what came before,
and orders of events that averages lose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....envs.gain_episode import filter_for
from ....envs.gain_reward import scored_quantity, true_values
from ....filters.adaptation.tuned import TunedFilter
from ....filters.core.metrics import error, rms
from ....filters.support.optional import extra
from ...weights_io import load_weights, save_weights
from ..actor_critic import AfterUpdate, ppo_settings
from ..config import TrainingConfig
from ..policy import Layer

KIND = "recurrent gain policy"
"""Field ``kind`` of the card."""
NAMES = ("input", "recurrent", "bias", "weight", "offset")
"""Arrays of a recurrent policy, as saved."""

Memory = tuple[np.ndarray, np.ndarray]
"""Hidden and cell state ``(B, units)``."""


@dataclass(frozen=True, eq=False)
class RecurrentGainPolicy:
    """Observations, one after the other → actions; runs without torch.

    Attributes:
        tuned: the filter that it sets, with actions, features and smoothing.
        cell: weights of the LSTM on observation ``(4 units, n)`` and hidden state ``(4 units, units)``, and the bias
            ``(4 units,)``; gates in torch's order: input, forget, cell, output.
        output: weight ``(k, units)`` and bias ``(k,)``.
        card: description of the training.
    """

    tuned: TunedFilter
    cell: tuple[np.ndarray, np.ndarray, np.ndarray]
    output: Layer
    card: dict[str, Any] = field(default_factory=dict)

    def begin(self, batch: int) -> Memory:
        """The memory of ``batch`` sequences at their start."""
        units = self.cell[1].shape[1]
        return np.zeros((batch, units)), np.zeros((batch, units))

    def __call__(self, observation: np.ndarray, memory: Memory) -> tuple[np.ndarray, Memory]:
        """Action ``(B, k)`` of an observation ``(B, n)``, and the memory after it."""
        hidden, cell = memory
        gates = np.asarray(observation, float) @ self.cell[0].T + hidden @ self.cell[1].T + self.cell[2]
        enter, forget, new, leave = np.split(gates, 4, axis=-1)
        cell = sigmoid(forget) * cell + sigmoid(enter) * np.tanh(new)
        hidden = sigmoid(leave) * np.tanh(cell)
        return np.clip(hidden @ self.output[0].T + self.output[1], -1.0, 1.0), (hidden, cell)

    def save(self, path: str | Path, card: Mapping[str, Any] | None = None) -> Path:
        """Write weights and card; see :func:`poise.baselines.weights_io.save_weights`."""
        arrays = {name: value.astype(np.float32) for name, value in zip(NAMES, (*self.cell, *self.output), strict=True)}
        own = {"kind": KIND, "filter": self.tuned.name, "smoothing": self.tuned.smoothing}
        described = dict(self.card if card is None else card)
        return save_weights(path, arrays, {**own, **{name: described[name] for name in described if name not in own}})

    @classmethod
    def load(cls, path: str | Path, tuned: TunedFilter) -> RecurrentGainPolicy:
        """Read a policy for a filter with the actions and features that it was trained with.

        Raises:
            FileNotFoundError: there is none.
            ValueError: the weights are damaged, are of another kind or filter, or do not fit ``tuned``.
        """
        arrays, card = load_weights(path)
        missing = [name for name in NAMES if name not in arrays]
        if card.get("kind") != KIND or missing:
            raise ValueError(f"{path} is not a {KIND} but {card.get('kind')!r}, missing {missing}")
        sizes = (tuned.name, tuned.observation_size, tuned.actions)
        found = (card["filter"], arrays["input"].shape[1], arrays["weight"].shape[0])
        if found != sizes:
            raise ValueError(f"{path} is for filter, features and actions {found}, not {sizes}")
        parts = [arrays[name].astype(float) for name in NAMES]
        tuned = replace(tuned, smoothing=float(card["smoothing"]))
        return cls(tuned, (parts[0], parts[1], parts[2]), (parts[3], parts[4]), card)


def sigmoid(x: np.ndarray) -> np.ndarray:
    """1 / (1 + exp(-x)), without overflow."""
    return 0.5 * (1.0 + np.tanh(0.5 * x))


def recurrent_errors(
    policy: RecurrentGainPolicy, trajectories: Sequence[Trajectory], quantity: str | None = None
) -> np.ndarray:
    """Root mean square error of a recurrent policy on each trajectory ``(trajectories,)``, rad."""
    output = scored_quantity(policy.tuned.kalman, quantity)
    errors = []
    for trajectory in trajectories:
        tuned = replace(policy.tuned, kalman=filter_for(policy.tuned.kalman, trajectory))
        samples = {name: trajectory.measurements[name][:, None] for name in (c.name for c in tuned.kalman.channels)}
        state, memory = tuned.init({name: values[0] for name, values in samples.items()}), policy.begin(1)
        parts = []
        for start in range(0, len(trajectory), tuned.interval_samples):
            action, memory = policy(tuned.observe(state), memory)
            chunk = {name: values[start : start + tuned.interval_samples] for name, values in samples.items()}
            estimate, state = tuned.advance(tuned.decide(state, action), chunk)
            parts.append(estimate.pose[output.name][:, 0])
        truth = true_values(trajectory, output, tuned.kalman)
        errors.append(float(rms(error(output, np.concatenate(parts), truth), trajectory.mask)))
    return np.array(errors)


def make_recurrent(config: TrainingConfig, env: Any, start: np.ndarray, logs: Path | None = None) -> Any:
    """A new model whose actions are about the constant action ``start``.

    Args:
        config: its settings.
        env: normalised environment.
        start: action ``(k,)``.
        logs: folder of the TensorBoard log; None for none.
    """
    with extra("rl"):
        import torch
        from sb3_contrib import RecurrentPPO

    class GainRecurrentPPO(AfterUpdate, RecurrentPPO):
        """Recurrent PPO with a checkpoint after every update."""

    model = GainRecurrentPPO(
        "MlpLstmPolicy",
        env,
        **ppo_settings(config, logs),
        # One LSTM for the actor, with its output layer straight behind it; the critic looks at the observation alone.
        policy_kwargs={
            "lstm_hidden_size": config.lstm_units,
            "enable_critic_lstm": False,
            "net_arch": {"pi": [], "vf": list(config.net_arch)},
            "log_std_init": float(np.log(config.initial_std)),
        },
    )
    with torch.no_grad():
        head: Any = model.policy.action_net
        head.bias.copy_(torch.as_tensor(0.95 * start))
        head.weight.mul_(0.1)
    return model


def export_recurrent(model: Any, tuned: TunedFilter, mean: np.ndarray, std: np.ndarray) -> RecurrentGainPolicy:
    """The deterministic policy on plain arrays, with the normalisation of observations in its weights.

    Args:
        model: trained.
        tuned: the filter that it sets.
        mean: of the observations ``(n,)``.
        std: their standard deviations ``(n,)``.
    """
    lstm, head = model.policy.lstm_actor, model.policy.action_net
    weights = (lstm.weight_ih_l0, lstm.weight_hh_l0, lstm.bias_ih_l0 + lstm.bias_hh_l0, head.weight, head.bias)
    inputs, recurrent, bias, weight, offset = (each.detach().numpy().astype(float) for each in weights)
    return RecurrentGainPolicy(tuned, (inputs / std, recurrent, bias - (inputs / std) @ mean), (weight, offset))
