"""``poise/Replay-v0``: a recorded or simulated trajectory as an environment."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ..filters.core.quantity import ORIENTATION, RELATIVE_ORIENTATION, UP, Channel, Quantity
from .base import Block, PoseEnv, choose_quantity
from .data.formats.load import load_recording
from .data.trajectory import Trajectory
from .drawn import Scene
from .hand.sensing import check_duration, simulate_hand
from .sensors.kinds import KINDS
from .sensors.observation import Sensing

UNITS = {kind.suffix: kind.unit for kind in KINDS.values() if kind.unit}
"""Units by the last part of a channel's name."""
POSE = ("orientation", "relative_orientation", "up")
"""Truth that belongs to the pose."""


class RecordedSensors(Sensing):
    """The channels of a trajectory.

    Args:
        trajectory: what was recorded; the largest magnitude of each channel bounds its observation.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        channels, limits = [], {}
        for name, values in trajectory.measurements.items():
            channels.append(Channel(name, values.shape[1], UNITS.get(name.rsplit("/", 1)[-1], "?")))
            limits[name] = float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0)) or 1.0
        super().__init__(channels, limits)
        self._described = {
            "rate": 1.0 / trajectory.dt,
            "recording": trajectory.name,
            "sensors": trajectory.metadata.get("sensors"),
        }

    def describe(self) -> dict[str, Any]:
        """What the trajectory's metadata hold about its sensors."""
        return dict(self._described)


class ReplayEnv(PoseEnv):
    """Recorded measurements are replayed; the agent estimates the pose and is scored by the recorded truth.

    ## Description

    Any :class:`poise.Trajectory` as an environment with the interface of ``poise/HandMotion-v0``. It keeps the
    recording's time: on its uniform grid (:meth:`.Trajectory.on_grid`) a gap consists of samples without
    values, of its true length, that are not scored. Only the start of an episode is random.

    ## Action Space

    The agent's estimate for the last observation. If the trajectory knows an orientation, it is
    ``Box(-1, 1, (4,), float32)``: a quaternion w, x, y, z, sensor axes to world axes, of any length (zeros count as no
    rotation). If it knows only the gravity direction (``up``), ``Box(-1, 1, (3,), float32)``: the upward unit vector in
    sensor axes, of any length (zeros count as the z axis).

    ## Observation Space

    ``Dict``: each channel of the trajectory, for instance

    | key | shape | unit | rate |
    |---|---|---|---|
    | ``imu/gyr`` | (3,) float32 | rad/s | of the trajectory |
    | ``imu/acc`` | (3,) float32 | m/s² | of the trajectory |
    | ``new_sample`` | (channels,) int8 | 1 for a new sample, 0 where the last value is repeated | of the trajectory |

    Bounds are the largest recorded magnitudes.

    ## Rewards

    Minus the error of the action in rad, at the pose of the observation it answers: total angle
    (``score="orientation"``), inclination alone (``"relative_orientation"``), inclination error (``"up"``). 0 at
    samples outside the evaluation mask, and where the truth is unknown.

    ## Starting State

    The first sample of the trajectory or, with ``random_start``, any sample that leaves room for the duration.

    ## Episode End

    Truncated at the end of the duration or of the trajectory. Never terminated.

    ## Info

    One structure at ``reset`` and ``step``: ``time`` (s, that of the trajectory), ``pose`` (``orientation`` (4,) and
    ``up`` (3,) as far as known), ``truth`` (everything else that the trajectory knows), ``scored`` (bool). The keys are
    those of which the trajectory has any truth; where a value is unknown it is NaN of the same shape.

    ## Arguments

    Args:
        trajectory: a trajectory, or the path of one (see :func:`poise.load_recording`); None for a simulated motion of
            a hand of 30 s, always the same.
        duration: length of an episode, s; None for the rest of the trajectory.
        random_start: whether an episode starts anywhere instead of at the beginning.
            ``reset(options={"start": index})`` starts one episode at that sample.
        score: ``orientation``, ``relative_orientation`` or ``up``; None for the first of them with a truth.
        render_mode: ``human`` (a window), ``rgb_array`` or None.

    Raises:
        ValueError: the trajectory has a single sample, no reading or no true pose at a scored sample, or an argument is
            out of its range.

    ## Version History

    * v0: first release.
    """

    reset_options: ClassVar[tuple[str, ...]] = ("start",)

    def __init__(
        self,
        trajectory: Trajectory | str | Path | None = None,
        duration: float | None = None,
        random_start: bool = False,
        *,
        score: str | None = None,
        render_mode: str | None = None,
    ) -> None:
        if trajectory is None:
            trajectory = simulate_hand("mixed", seed=0, duration=30.0)
        elif not isinstance(trajectory, Trajectory):
            trajectory = load_recording(trajectory)
        check_duration(duration)
        trajectory = trajectory.on_grid()
        if len(trajectory) < 2:
            raise ValueError(f"trajectory must have two samples at least, {trajectory.name!r} has {len(trajectory)}")
        self.trajectory, self.random_start = trajectory, random_start
        self._length = len(trajectory)
        if duration is not None:
            self._length = max(1, math.floor(duration / trajectory.dt + 1e-6)) + 1
            if self._length > len(trajectory):
                raise ValueError(
                    f"duration must be at most {(len(trajectory) - 1) * trajectory.dt:g} s, the length of "
                    f"{trajectory.name!r}, got {duration}"
                )
        quantity = scored_quantity(trajectory, score)
        if not any(np.isfinite(values).all(axis=-1).any() for values in trajectory.measurements.values()):
            raise ValueError(f"trajectory {trajectory.name!r} has no sample of any channel: all are NaN")
        super().__init__(RecordedSensors(trajectory), [quantity], 1.0 / trajectory.dt, render_mode)
        # an orientation contains its relative orientation
        wanted = [name for name in POSE if name in trajectory.truth or name == "up"]
        self._pose = {name: trajectory.truth_of(name) for name in wanted if name in trajectory.quantities}
        self._truth = {name: values for name, values in trajectory.truth.items() if name not in POSE}

    def begin(self, motion: np.random.Generator, sensors: np.random.Generator, options: Mapping[str, Any]) -> int:
        """Choose where to start."""
        last_start = len(self.trajectory) - self._length
        if "start" in options:
            start = options["start"]
            if isinstance(start, bool) or not isinstance(start, int | np.integer):
                raise ValueError(f"start must be the index of a sample, got {start!r}")
            if not 0 <= start < len(self.trajectory) - 1:
                raise ValueError(f"start must lie in [0, {len(self.trajectory) - 2}], got {start}")
        else:
            start = motion.integers(last_start + 1) if self.random_start else 0
        self._start = int(start)
        self.suite.reset(sensors)
        return min(self._length, len(self.trajectory) - self._start) - 1

    def next_block(self, most: int) -> Block:
        """The whole episode."""
        recorded = self.trajectory
        whole = Block(recorded.time, recorded.measurements, self._pose, self._truth, recorded.mask)
        return whole.rows(slice(self._start, self._start + most))

    def make_scene(self, gui: bool) -> Scene:
        """A device above the ground, and the axes of the estimate."""
        from .rendering import DeviceScene

        return DeviceScene(gui=gui)


def scored_quantity(trajectory: Trajectory, score: str | None) -> Quantity:
    """What the agent is asked for.

    Raises:
        ValueError: the trajectory knows no pose, or not the one that is wanted, or at no scored sample.
    """
    candidates = (ORIENTATION, RELATIVE_ORIENTATION, UP)
    choices = [quantity for quantity in candidates if quantity.name in trajectory.quantities]
    if not choices:
        raise ValueError(
            f"trajectory {trajectory.name!r} knows neither orientation nor up, so that nothing can be scored; it knows "
            f"{list(trajectory.quantities)}"
        )
    wanted = choices if score is None else [choose_quantity(score, choices)]
    for quantity in wanted:
        if (trajectory.mask & np.isfinite(trajectory.truth_of(quantity.name)).all(axis=-1)).any():
            return quantity
    names = " or ".join(repr(quantity.name) for quantity in wanted)
    raise ValueError(f"trajectory {trajectory.name!r} has no scored sample with a known {names}")
