"""Training configuration of gain policies; settings of agents have the names and meanings of stable-baselines3."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Literal, get_args

from ...envs.gain_episode import check_channels
from ...envs.hand.gestures import Mixed
from ...envs.hand.trajectories import HandTrajectories
from ...envs.sensors.presets import sensor_preset
from ...filters.adaptation.tuned import TunedFilter
from ...filters.core.quantity import DEG
from .motions import FLOWN_MOTIONS, GradedMotions, MixedMotions, Motions, RiddenMotions, uneven_rides

SUSTAINED = Mixed(lengths=(15.0, 40.0), rest_share=0.1, spread=0.5, single_share=0.25)
"""Sustained motion of one kind, in addition to the quick changes of ``mixed``."""

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
    noise_scale=(0.1, 1.0),
    duration=60.0,
)
"""Smooth gestures."""

CALIBRATED_MOTIONS = GradedMotions(
    gyroscope_biases=((0.03 * DEG, 0.8 * DEG),),
    accelerometer_biases=((0.01, 0.1),),
    first_rest=(0.3, 5.0),
    duration=40.0,
)
"""Calibrated devices in the hand and carried."""

UNCALIBRATED_MOTIONS = replace(
    CALIBRATED_MOTIONS,
    gyroscope_biases=((0.5 * DEG, 6.0 * DEG),),
    accelerometer_biases=((0.02, 0.2),),
    carried_share=0.5,
)
"""The same as phones without calibration, half of them carried."""

KNOWN_MOTIONS = MixedMotions((replace(TRAINING_MOTIONS, duration=40.0), CALIBRATED_MOTIONS))
"""Smooth gestures and calibrated devices, half each: training data of policies for filters without a gyroscope bias."""

VARIED_MOTIONS = MixedMotions((*KNOWN_MOTIONS.parts * 3, UNCALIBRATED_MOTIONS, FLOWN_MOTIONS))
"""Smooth gestures and calibrated devices, three eighths each, devices without calibration, and such as travel and
shake: training data of the other policies for one sensor."""

AgentName = Literal["ppo", "recurrent-ppo", "sac", "td3", "analytic"]
"""Agents that train a policy."""


@dataclass(frozen=True)
class OffPolicySettings:
    """What SAC and TD3 need besides.

    With 64 episodes at a time a gradient step follows on 16 decisions: fewer than by default (one on one), since the
    decisions of one motion resemble each other, and a step costs as much as a hundred decisions.
    """

    buffer_size: int = 100_000
    """decisions that are remembered"""
    learning_starts: int = 5_000
    """decisions before the first gradient step"""
    gradient_steps: int = 4
    """gradient steps after each decision of all episodes"""
    batch_size: int = 256
    """decisions in a gradient step"""
    learning_rate: float = 3e-4
    """constant"""
    noise: float = 0.1
    """standard deviation of TD3's exploration"""

    def __post_init__(self) -> None:
        for name in ("buffer_size", "gradient_steps", "batch_size"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        if self.learning_starts < 0:
            raise ValueError(f"learning_starts must be 0 or more, got {self.learning_starts}")
        for name in ("learning_rate", "noise"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")


@dataclass(frozen=True)
class TrainingConfig:
    """How a policy is trained.

    Raises:
        ValueError: a number is out of its range.
    """

    filter: str = "external-acceleration"
    """name of the filter"""
    agent: AgentName = "ppo"
    """who learns; PPO has a critic that sees the truth, and alone starts from the oracle"""
    gains: tuple[str, ...] | None = None
    """gains that the policy sets; None for all of the filter"""
    quantities: tuple[str, ...] = ()
    """outputs that are scored together; none: ``up``, or the first; the exact gradient alone takes several"""
    rule: str | None = None
    """rule that the policy corrects: its actions are added to those of the rule; the exact gradient alone has it"""
    interval: float = 0.1
    """s between decisions"""
    motions: Motions = TRAINING_MOTIONS
    """what is simulated, such as a recipe; at few rates, since the trajectories of one rate are computed together"""
    trajectories: int = 240
    """number of simulated trajectories to train on"""
    seed: int = 0
    """root of all randomness"""
    total_timesteps: int = 1_000_000
    """decisions in total"""
    n_envs: int = 256
    """parallel episodes"""
    n_steps: int = 64
    """decisions of each episode between two updates"""
    batch_size: int = 4096
    """decisions in a gradient step"""
    n_epochs: int = 8
    """passes over a rollout, fewer if the policy has changed enough"""
    learning_rate: float = 1e-4
    """at the start; falls linearly to a tenth"""
    gamma: float = 0.995
    """discount factor per decision; 0.995 looks 20 s ahead at 10 decisions per second, since the effect of a gyroscope
    bias takes time"""
    gae_lambda: float = 0.95
    """λ of generalised advantage estimation"""
    sde_sample_freq: int = 32
    """decisions for which the exploration (gSDE) keeps its noise matrix; single decisions have no lasting effect"""
    net_arch: tuple[int, ...] = (64, 64)
    """units of the hidden layers"""
    initial_std: float = 0.1
    """standard deviation of the actions at the start, about"""
    smoothing: float = 0.0
    """s; the gains follow the actions with this time constant, 0: at once"""
    off_policy: OffPolicySettings = field(default_factory=OffPolicySettings)
    """of SAC and TD3"""
    lstm_units: int = 64
    """units of the memory of recurrent PPO"""
    error_scale: float = 5.0
    """deg: errors far above it count by their logarithm in the reward"""
    warm_start: int = 150
    """trajectories of the oracle warm start; 0 starts from the constant gains"""
    warm_start_centre: tuple[float, ...] | None = None
    """action around which the oracle's candidates lie; None for the best constant gains"""
    gain_search: int = 64
    """points of the search for constant gains, the reference of the reward; 0 takes the published tuning"""

    def __post_init__(self) -> None:
        if self.agent not in get_args(AgentName):
            raise ValueError(f"agent must be one of {list(get_args(AgentName))}, got {self.agent!r}")
        if self.rule is not None and self.agent != "analytic":
            raise ValueError(f"rule must be None for the agent {self.agent}, got {self.rule!r}")
        if len(self.quantities) > 1 and self.agent != "analytic":
            raise ValueError(f"quantities must be one at most for the agent {self.agent}, got {list(self.quantities)}")
        for name in ("trajectories", "total_timesteps", "n_envs", "n_steps", "batch_size", "n_epochs", "lstm_units"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not 0.0 <= self.gamma < 1.0:
            raise ValueError(f"gamma must lie in [0, 1), got {self.gamma}")
        for name in ("warm_start", "gain_search", "smoothing"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be 0 or more, got {getattr(self, name)}")
        for name in ("initial_std", "learning_rate", "error_scale"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")

    def describe(self) -> dict[str, Any]:
        """Everything, in JSON's types."""
        values = {part.name: getattr(self, part.name) for part in fields(self)} | {"motions": self.motions.describe()}
        values["off_policy"] = asdict(self.off_policy)
        return json.loads(json.dumps(values))


RIDERS: dict[str, tuple[tuple[str, ...], str | None]] = {
    "two-gyro-level": (("constraint",), None),
    "platform-gyro": (("measurement",), None),
    "balanced-gyro": (("level", "balance"), None),
    "whole-body": (("trunk", "limb", "acceleration", "lateral"), None),
    "force-inertial": (("torque", "roll"), "seat offset"),
    "odometry-aided": (("process", "bias"), "bias step"),
    "two-gyro-consistent": (("process", "measurement"), None),
    "force-inertial-consistent": (("torque", "roll"), "seat offset"),
}
"""Filter of rides → gains that are acted on, and the fault of the sensors in all rides, if there is one."""


CORRECTED = {"two-gyro-level": "turning", "platform-gyro": "turning"}
"""Filter → rule that a policy trained by the exact gradient corrects."""
TOGETHER = {"force-inertial-consistent": ("bicycle/roll", "force-inertial/trunk_angles")}
"""Filter → outputs that a policy trained by the exact gradient is scored by together."""
SMALLER: dict[str, dict[str, int]] = {
    "force-inertial-consistent": {"trajectories": 24, "total_timesteps": 67_000, "gain_search": 8}
}
"""Filter → fewer rides, eight passes over them, and a shorter search, where a sample costs more."""
RIDES_SCALE = 15.0
"""deg, in place of the error scale of hands: angles that turn over must not count little."""


def shipped_config(filter: str) -> TrainingConfig:
    """The configuration of a filter with ``--preset shipped``; cards say how and at which commit weights were trained.

    They begin from the oracle warm start. From the best constant gains, the same number of steps gains little in
    simulation and loses on recordings. With an oracle over the whole box of actions the filter diverges in single
    motions.
    """
    if filter in RIDERS:
        gains, fault = RIDERS[filter]
        config = TrainingConfig(
            filter=filter,
            gains=gains,
            motions=RiddenMotions(replace(uneven_rides(), fault=fault)),
            trajectories=48,
            total_timesteps=260_000,
            n_envs=48,
            gain_search=16,
            warm_start=48,
        )
        return replace(config, **SMALLER.get(filter, {}))  # type: ignore[arg-type]
    # The valley in which the measurement variance does the work, and c_a, which trusts the filter's own error, little.
    centre = (-0.7, 0.36, -0.7) if filter == "external-acceleration" else None
    return TrainingConfig(
        filter=filter,
        # With motions of uncalibrated devices a filter without a bias gains in simulation and loses on recordings.
        motions=KNOWN_MOTIONS if filter == "external-acceleration" else VARIED_MOTIONS,
        trajectories=112,
        # Longer trainings, and less noise on the observations, gain in simulation and lose on recordings.
        total_timesteps=270_000,
        gain_search=16,
        warm_start=150,
        warm_start_centre=centre,
    )


def check_simulated(config: TrainingConfig, tuned: TunedFilter) -> None:
    """Refuse a filter that reads what is not simulated for it.

    Raises:
        ValueError: names the missing channels, and what is simulated.
    """
    if config.filter in RIDERS:  # their rides have every sensor of the filter
        return
    try:
        check_channels(config.motions.draw_many(config.seed, 1)[0], tuned)
    except ValueError as reason:
        raise ValueError(
            f"{reason}; gains are tuned on motions of one sensor, which has a magnetometer in the recipe "
            f"hand-held-magnetic, and on rides for {', '.join(RIDERS)}"
        ) from None


def config_of(agent: AgentName, config: TrainingConfig) -> TrainingConfig:
    """The configuration of PPO, changed to what suits another agent.

    Recurrent PPO walks through its memory decision by decision, so it takes few long rollouts; SAC and TD3 take few
    episodes at a time, since each of them waits for the gradient steps. The exact gradient needs no warm start, and
    memorises the motions with larger networks.
    """
    if agent == "ppo":
        return replace(config, agent=agent)
    if agent == "analytic":
        rule, together = CORRECTED.get(config.filter), TOGETHER.get(config.filter, ())
        scale = RIDES_SCALE if rule or together else config.error_scale
        changed: dict[str, Any] = {"warm_start": 0, "learning_rate": 2e-3, "net_arch": (32, 32), "error_scale": scale}
        return replace(config, agent=agent, rule=rule, quantities=together, **changed)
    common = {"agent": agent, "warm_start": 0, "n_envs": 64, "smoothing": config.smoothing or 0.5}
    if agent == "recurrent-ppo":
        return replace(config, **common, batch_size=1024, n_epochs=4, learning_rate=3e-4)  # type: ignore[arg-type]
    return replace(config, **common, gamma=0.98)  # type: ignore[arg-type]
