"""The registered environments. Nothing heavy is imported: entry points are strings."""

from __future__ import annotations

import gymnasium

ENTRY_POINTS: dict[str, str] = {
    "poise/HandMotion-v0": "poise.envs.hand.environment:HandMotionEnv",
    "poise/Replay-v0": "poise.envs.replay:ReplayEnv",
    "poise/BicycleFixture-v0": "poise.envs.bicycle.fixture:BicycleFixtureEnv",
    "poise/RiderBicycle-v0": "poise.envs.bicycle.environment:RiderBicycleEnv",
    "poise/RiderBicycleGain-v0": "poise.envs.bicycle.gain_tuning:RiderBicycleGainEnv",
    "poise/HandMotionGain-v0": "poise.envs.gain_tuning:HandMotionGainEnv",
    "poise/ReplayGain-v0": "poise.envs.gain_tuning:ReplayGainEnv",
}
"""Id → ``module:class``. Episodes end by themselves (gesture or recording), so no time limit is registered."""


def register_environments() -> None:
    """Register all environments with Gymnasium; calling it again changes nothing."""
    for identity, entry_point in ENTRY_POINTS.items():
        if identity not in gymnasium.registry:
            gymnasium.register(id=identity, entry_point=entry_point)


def list_environments() -> tuple[str, ...]:
    """The registered ids."""
    return tuple(ENTRY_POINTS)
