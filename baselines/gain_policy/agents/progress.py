"""A callback of stable-baselines3 that logs pose errors and gains to TensorBoard."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ....filters.support.optional import extra

with extra("rl"):
    from stable_baselines3.common.callbacks import BaseCallback


class GainProgress(BaseCallback):
    """Logs ``pose/error_deg`` and ``gains/<name>`` of every gain environment, native or not.

    Args:
        every: environment steps between two looks.
    """

    def __init__(self, every: int = 8) -> None:
        super().__init__()
        if every < 1:
            raise ValueError(f"every must be at least 1 step, got {every}")
        self.every = every

    def _on_step(self) -> bool:
        if self.n_calls % self.every:
            return True
        errors, gains = self.present()
        known = errors[np.isfinite(errors)]
        if known.size:
            self.logger.record_mean("pose/error_deg", float(known.mean()))
        for name, sizes in gains.items():
            self.logger.record_mean(f"gains/{name}", float(np.mean(sizes)))
        return True

    def present(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Mean errors of the last interval, deg, and gains, of every episode."""
        from ..vec_env import SB3VecEnv

        together = self.training_env.unwrapped
        if isinstance(together, SB3VecEnv) and hasattr(together.env.unwrapped, "gain_sizes"):
            rows: Any = together.env.unwrapped
            return rows.errors_deg, rows.gain_sizes()
        infos = [info for info in self.locals["infos"] if isinstance(info.get("gains"), Mapping)]
        errors = np.array([info["error_deg"] for info in infos], dtype=float)
        names = infos[0]["gains"] if infos else ()
        return errors, {name: np.array([info["gains"][name] for info in infos]) for name in names}
