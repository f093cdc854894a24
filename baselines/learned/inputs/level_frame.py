"""Front ends for one inertial sensor: features in a level frame, kept by an observer or by a Kalman filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Self

from ....filters.core.backend import Array, namespace
from ....filters.core.estimator import check_measurements
from ....filters.core.kalman import KalmanFilter
from ....filters.core.quantity import ACCELEROMETER, GYROSCOPE, Channel, Estimate, Measurement
from ....filters.core.recursion import Observer
from ....filters.core.sampling import FilterState
from ..gains.gain_shares import filter_of, with_changed_numbers
from .filter_frame import ATTITUDE, BIAS, TILT_STD, FilterFrame, frame_of
from .front_end import Seen, check_interval
from .gravity_aligned_frame import GravityAlignedFrame


class LevelState(NamedTuple):
    """Memory of :class:`LevelFrame`: of the filter (None without one) and of the frame."""

    filter: FilterState | None
    frame: FilterState


@dataclass(frozen=True)
class LevelFrame:
    """One inertial sensor in a level frame, and of a filter that reads a magnetometer, the field beside it.

    Without a filter the frame is kept by an observer with fixed gains (:class:`GravityAlignedFrame`); with one, it is
    the filter's, the network corrects the filter's inclination, and ``spread`` is the filter's deviation of tilt.

    Attributes:
        kalman: a filter of six or nine axes whose covariance has a part of the orientation, or None.
        frame: settings of the features; the sampling interval is the filter's if there is one.
        compiled: use compiled loops for NumPy data.

    Raises:
        ValueError: sampling slower than the network, or a filter that estimates no relative orientation.
    """

    kalman: KalmanFilter | None = None
    frame: GravityAlignedFrame = field(default_factory=GravityAlignedFrame)
    compiled: bool = True

    kind: ClassVar[str] = "level-frame"

    def __post_init__(self) -> None:
        if self.kalman is None:
            check_interval(self.frame.dt, self.frame.interval)
            return
        if "relative_orientation" not in self.kalman.model.error_parts:
            raise ValueError(
                f"kalman must estimate a relative orientation; {type(self.kalman.model).__name__} does not"
            )
        if not isinstance(self.frame, FilterFrame):
            kept = {name: value for name, value in asdict(self.frame).items() if name not in ("tilt_gain", "bias_gain")}
            object.__setattr__(self, "frame", frame_of(self.kalman)(**{**kept, "dt": self.kalman.dt}))
        check_interval(self.frame.dt, self.frame.interval)
        kalman = replace(self.kalman, keep_covariance=True, compiled=self.compiled).with_dt(self.frame.dt)
        object.__setattr__(self, "kalman", kalman)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Of the six axes, or of the filter."""
        return (GYROSCOPE, ACCELEROMETER) if self.kalman is None else self.kalman.channels

    @property
    def dt(self) -> float:
        """Sampling interval, s."""
        return self.frame.dt

    @property
    def interval(self) -> float:
        """Time between updates of the network, s."""
        return self.frame.interval

    @property
    def size(self) -> int:
        """Number of features."""
        return type(self.frame).outputs[1].size

    def with_dt(self, dt: float) -> Self:
        """See :class:`.front_end.FrontEnd`."""
        check_interval(dt, self.interval)
        return replace(self, frame=self.frame.with_dt(dt))

    def configured(self, metadata: Mapping[str, Any]) -> Self:
        """Nothing to configure."""
        return self

    def describe(self) -> dict[str, Any]:
        """See :class:`.front_end.FrontEnd`."""
        frame = {name: value for name, value in asdict(self.frame).items() if name != "dt"}
        filter = None if self.kalman is None else with_changed_numbers(self.kalman.model)
        return {"kind": self.kind, "frame": frame, "filter": filter}

    @classmethod
    def read(cls, described: Mapping[str, Any], dt: float) -> Self:
        """The inverse of :meth:`describe`."""
        settings, inner = dict(described["frame"]), described.get("filter")
        if inner is None:
            return cls(None, GravityAlignedFrame(**settings, dt=dt))
        kalman = filter_of(inner, dt)
        return cls(kalman, frame_of(kalman)(**settings, dt=dt))

    def init(self, measurement: Measurement) -> LevelState:
        """See :class:`.front_end.FrontEnd`."""
        if self.kalman is None:
            return LevelState(None, self._observer.init(measurement))
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        inner = self.kalman.init(arrays)
        xp, like = namespace(arrays["imu/acc"]), 0.0 * arrays["imu/acc"][..., :1] + namespace(arrays["imu/acc"]).nan
        unknown = {c.name: xp.concat([like] * c.size, axis=-1) for c in (ATTITUDE, BIAS, TILT_STD)}
        return LevelState(inner, self._observer.init({**arrays, **unknown}))

    def step(self, state: LevelState, measurement: Measurement) -> tuple[LevelState, Seen]:
        """See :class:`.front_end.FrontEnd`."""
        if self.kalman is None:
            frame, seen = self._observer.step(state.frame, measurement)
            return LevelState(None, frame), self._seen(seen, None)
        arrays = check_measurements(self.channels, measurement, time_axis=False)
        assert state.filter is not None
        inner, estimate = self.kalman.step(state.filter, arrays)
        frame, seen = self._observer.step(state.frame, {**arrays, **self._told(estimate)})
        return LevelState(inner, frame), self._seen(seen, estimate)

    def run(self, measurements: Mapping[str, Any]) -> Seen:
        """See :class:`.front_end.FrontEnd`."""
        arrays = check_measurements(self.channels, measurements, time_axis=True)
        if self.kalman is None:
            return self._seen(self._observer.run(arrays), None)
        estimate = self.kalman.run(arrays)
        return self._seen(self._observer.run({**arrays, **self._told(estimate)}), estimate)

    @property
    def _observer(self) -> Observer:
        return Observer(self.frame, compiled=self.compiled)

    def _told(self, estimate: Estimate) -> dict[str, Array]:
        """The filter's outputs as channels."""
        orientation, bias = _orientation(estimate), estimate.pose["gyroscope_bias"]
        return {ATTITUDE.name: orientation, BIAS.name: bias, TILT_STD.name: self._deviation(estimate)}

    def _deviation(self, estimate: Estimate) -> Array:
        """Deviation of the tilt, rad: the root of the variances about both horizontal axes ``(..., 1)``."""
        assert self.kalman is not None
        assert estimate.covariance is not None
        start = self.kalman.model.error_parts["relative_orientation"][0]
        P = estimate.covariance
        return namespace(P).sqrt(P[..., start, start] + P[..., start + 1, start + 1])[..., None]

    def _seen(self, found: Estimate, estimate: Estimate | None) -> Seen:
        pose = found.pose
        q = pose["relative_orientation"]
        spread = q[..., :0] if estimate is None else self._deviation(estimate)
        base = q if estimate is None else _orientation(estimate)
        xp, due = namespace(q), pose["due"][..., 0]
        now = due == 1.0
        # before the start nothing is known, and no interval ends
        features = xp.where(now[..., None], pose["features"], xp.zeros_like(pose["features"]))
        return Seen(features, xp.where(now, due, xp.zeros_like(due)), {"relative_orientation": base}, spread)


def _orientation(estimate: Estimate) -> Array:
    """Of a filter of nine or six axes."""
    pose = estimate.pose
    return pose["orientation" if "orientation" in pose else "relative_orientation"]
