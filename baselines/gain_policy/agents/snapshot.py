"""All that changes in a model of stable-baselines3 while it learns, as arrays: for checkpoints that continue exactly.

``model.save`` leaves out the episode in progress and pickles the replay buffer, which only trusted files may hold.
"""

from __future__ import annotations

import json
from collections import deque
from typing import Any

import numpy as np

COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")
"""Numbers of a model that count on."""
LAST = ("_last_obs", "_last_episode_starts", "_last_original_obs")
"""Arrays of the step in progress; None where a model has none."""
REMEMBERED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
"""Arrays of a replay buffer."""


def learner_state(model: Any) -> dict[str, Any]:
    """State of a model between two rollouts: weights, optimisers, memory, counters, the generator of its actions."""
    state: dict[str, Any] = {
        "parameters": model.get_parameters(),
        "counters": [int(getattr(model, name, 0)) for name in COUNTERS],
        "episodes": [dict(episode) for episode in model.ep_info_buffer or []],
        "last": [getattr(model, name, None) for name in LAST],
        "sampling": json.dumps(model.action_space.np_random.bit_generator.state),
    }
    if getattr(model, "log_ent_coef", None) is not None:
        state["entropy"] = model.log_ent_coef.detach().clone()
    if getattr(model, "_last_lstm_states", None) is not None:
        state["memory"] = [part for pair in model._last_lstm_states for part in pair]
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        filled = buffer.buffer_size if buffer.full else buffer.pos
        state["replay"] = {name: np.array(getattr(buffer, name)[:filled]) for name in REMEMBERED}
        state["place"] = [int(buffer.pos), int(buffer.full)]
    return state


def restore_learner(model: Any, state: dict[str, Any]) -> None:
    """Continue from :func:`learner_state`, in a model made with the same arguments."""
    import torch

    model.set_parameters(state["parameters"], exact_match=True, device="cpu")
    for name, value in zip(COUNTERS, state["counters"], strict=True):
        setattr(model, name, value)
    model.ep_info_buffer = deque(state["episodes"], maxlen=model._stats_window_size)
    model.ep_success_buffer = deque(maxlen=model._stats_window_size)
    for name, value in zip(LAST, state["last"], strict=True):
        setattr(model, name, value)
    model.action_space.np_random.bit_generator.state = json.loads(state["sampling"])
    if "entropy" in state:
        with torch.no_grad():
            model.log_ent_coef.copy_(state["entropy"])
    if "memory" in state:
        parts = state["memory"]
        model._last_lstm_states = type(model._last_lstm_states)(tuple(parts[:2]), tuple(parts[2:]))
    if "replay" in state:
        for name, values in state["replay"].items():
            getattr(model.replay_buffer, name)[: len(values)] = values
        model.replay_buffer.pos, model.replay_buffer.full = state["place"][0], bool(state["place"][1])
