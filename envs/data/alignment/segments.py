"""Axes of a worn or mounted sensor against those of the segment that carries it, from rest and one known movement.

While the segment rests in its reference pose, the accelerometer shows which way is up in sensor axes: two of the three
angles of the mounting. A movement about one known axis of the segment (a bicycle leant from side to side: x; a trunk
that bows: y) shows that axis as the main direction of the angular rate, which is the third (functional calibration:
J. Favre et al., "Functional calibration procedure for 3D knee joint angle description using inertial sensors",
J. Biomechanics 42, 2009). The direction of gravity is trusted more than the axis, since muscles do not turn about exact
axes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....filters.core import rotation
from ..trajectory import Trajectory

AXES: Mapping[str, np.ndarray] = {
    sign + name: factor * axis
    for sign, factor in (("", 1.0), ("-", -1.0))
    for name, axis in zip("xyz", np.eye(3), strict=True)
}
"""Name of an axis of the segment → its direction in segment axes (x forward, y left, z up)."""
LEAST_TURNING = 0.2
"""rad/s: RMS of the rate below which a movement does not show its axis."""
LEAST_DOMINANCE = 0.8
"""Share of the squared rate that must lie along the axis of the movement."""
LEAST_ANGLE = 20.0
"""deg between the axis and the vertical, without which it says nothing about the heading of the sensor."""


@dataclass(frozen=True)
class SegmentAlignment:
    """Mounting of a sensor.

    Attributes:
        rotation: ``(4,)`` unit quaternion w, x, y, z that turns sensor coordinates into segment coordinates.
        dominance: share of the squared rate along the axis of the movement; 1 for a hinge.
        disagreement: deg between the axis as the movement shows it and as gravity allows it.
        gyroscope_bias: ``(3,)`` rad/s, mean rate at rest, sensor axes.
    """

    rotation: np.ndarray
    dominance: float
    disagreement: float
    gyroscope_bias: np.ndarray

    def apply(self, trajectory: Trajectory, site: str = "imu") -> Trajectory:
        """The same recording with the vectors of one site in segment axes."""
        turned = {
            name: rotation.rotate(self.rotation, values)
            if name.rpartition("/")[0] == site and values.shape[1] == 3
            else values
            for name, values in trajectory.measurements.items()
        }
        done = {**trajectory.metadata.get("mounting", {}), site: self.rotation.tolist()}
        return trajectory.replace(measurements=turned, metadata={**trajectory.metadata, "mounting": done})

    def describe(self) -> dict[str, Any]:
        """Everything, for JSON."""
        return {
            "rotation": self.rotation.tolist(),
            "dominance": self.dominance,
            "disagreement_deg": self.disagreement,
            "gyroscope_bias": self.gyroscope_bias.tolist(),
        }


def align_segment(
    trajectory: Trajectory, rest: tuple[float, float], movement: tuple[float, float], axis: str, *, site: str = "imu"
) -> SegmentAlignment:
    """Find the mounting of a sensor.

    Args:
        trajectory: a recording with rest in the reference pose and the movement.
        rest: begin and end in s, in which the segment is upright and still.
        movement: begin and end in s of the movement.
        axis: of the segment about which it turned: ``x`` (forward), ``y`` (left) or ``z`` (up); ``-x`` where it began
            with a turn in the negative sense.
        site: of the sensor.

    Raises:
        ValueError: a channel, interval or axis that does not serve: moving rest, a movement that is too weak or about
            several axes, an axis along gravity.
    """
    if axis not in AXES:
        raise ValueError(f"axis must be one of {', '.join(AXES)}, got {axis!r}")
    gyr, acc = (vectors(trajectory, f"{site}/{kind}") for kind in ("gyr", "acc"))
    still, moving = (chosen(trajectory, name, part) for name, part in (("rest", rest), ("movement", movement)))
    force = known(acc[still])
    if len(force) < 5:
        raise ValueError(f"rest {rest} has {len(force)} valid samples of {site}/acc, at least 5 are needed")
    if force.std(axis=0).max() > 0.5:
        raise ValueError(f"rest {rest} is no rest: the accelerometer varies by {force.std(axis=0).max():.2f} m/s²")
    rates = known(gyr[still])
    if len(rates) < 5:
        raise ValueError(f"rest {rest} has {len(rates)} valid samples of {site}/gyr, at least 5 are needed")
    bias = rates.mean(axis=0)
    up = force.mean(axis=0) / np.linalg.norm(force.mean(axis=0))
    rate = known(gyr[moving]) - bias
    turning, shares = main_axis(rate)
    strength = float(np.sqrt(np.mean(np.sum(rate**2, axis=1)))) if len(rate) else 0.0
    if strength < LEAST_TURNING:
        raise ValueError(
            f"movement {movement} is too weak: {strength:.2f} rad/s RMS, at least {LEAST_TURNING} is needed"
        )
    if shares < LEAST_DOMINANCE:
        raise ValueError(
            f"movement {movement} is about several axes: {shares:.0%} of the squared rate lie along one, at least "
            f"{LEAST_DOMINANCE:.0%} are needed"
        )
    wanted = AXES[axis.removeprefix("-")]
    # The sense of the first large turn, where half of the largest rate is reached first, is that of the axis' name.
    along = rate @ turning
    first = along[int(np.argmax(np.abs(along) >= 0.5 * np.abs(along).max()))]
    sense = np.sign(first) * (-1.0 if axis.startswith("-") else 1.0)
    turning = turning * sense
    vertical = np.array([0.0, 0.0, 1.0])
    angle = math.degrees(math.acos(min(1.0, abs(float(up @ turning)))))
    if abs(float(wanted @ vertical)) > 0.5:
        raise ValueError(
            f"axis {axis} is along gravity at rest, which shows it already: choose a movement about x or y"
        )
    if angle < LEAST_ANGLE:
        raise ValueError(
            f"movement {movement} turned about the vertical ({angle:.0f}° from it), which gravity shows already"
        )
    # Triads of gravity and axis in both frames (TRIAD; gravity exact).
    sensor, segment = triad(up, turning), triad(vertical, wanted)
    matrix = segment @ sensor.T
    off = math.degrees(math.asin(min(1.0, abs(float(up @ turning)))))
    return SegmentAlignment(np.asarray(rotation.from_matrix(matrix)), shares, off, bias)


def vectors(trajectory: Trajectory, name: str) -> np.ndarray:
    """A channel of the recording."""
    if name not in trajectory.measurements:
        raise ValueError(f"{trajectory.name!r} has no channel {name}; it holds {', '.join(trajectory.measurements)}")
    return trajectory.measurements[name]


def chosen(trajectory: Trajectory, name: str, part: tuple[float, float]) -> np.ndarray:
    """Samples of an interval ``(T,)`` bool."""
    begin, end = part
    inside = (trajectory.time >= begin) & (trajectory.time <= end)
    first, last = trajectory.time[0] - trajectory.dt, trajectory.time[-1] + trajectory.dt
    if not first <= begin < end <= last or not inside.any():
        raise ValueError(
            f"{name} must be (begin, end) in s inside the recording, {trajectory.time[0]:.2f} to "
            f"{trajectory.time[-1]:.2f} s, got {part}"
        )
    return inside


def known(values: np.ndarray) -> np.ndarray:
    """Rows without NaN."""
    return values[np.isfinite(values).all(axis=1)]


def main_axis(rate: np.ndarray) -> tuple[np.ndarray, float]:
    """Unit direction of the largest squared rate, and the share along it."""
    if len(rate) < 5:
        return np.array([1.0, 0.0, 0.0]), 0.0
    values, directions = np.linalg.eigh(rate.T @ rate)
    return directions[:, -1], float(values[-1] / max(values.sum(), 1e-12))


def triad(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Right-handed axes as columns: ``first`` exactly, then across both, then the rest."""
    across = np.cross(first, second)
    across = across / np.linalg.norm(across)
    return np.column_stack([first, across, np.cross(first, across)])
