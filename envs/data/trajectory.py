"""A trajectory: measurements, truth and their metadata.

Simulated episodes and recordings have the same type, so that all functions accept both.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from weakref import WeakSet

import numpy as np

from ...filters.core import rotation
from ...filters.support.files import as_path
from .checks import check_metadata, columns, first, real_array, unit_or_unknown
from .clock import RATE_RANGE, Clock, check_interval, fit_clock, too_coarse
from .frames import trajectory_frame
from .resampling import fill_short_gaps, resampled_fields, shifted
from .storage import read_trajectory_file, write_trajectory_file

if TYPE_CHECKING:
    import pandas

DERIVED_FROM_ORIENTATION = {"up": rotation.up_in_body, "relative_orientation": lambda orientation: orientation}
"""Truth that an orientation contains: quantity name → function of the quaternions ``(T, 4)``."""
REFERENCE_CLOCK = "reference_clock_offset"
"""Key of the metadata: s by which the truth runs ahead of the gyroscope."""
INERTIAL = ("gyr", "acc", "mag")
"""Kinds of channels whose sampling interval must be that of an inertial sensor."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A sequence of measurements with the truth, where it is known.

    Arrays are copied and read-only. Masked entries become NaN. Truth that must have unit length (orientations, ``up``)
    and has not, such as the zeros of a tracker that lost its body, becomes NaN with a warning.

    Attributes:
        time: ``(T,)`` s, the stamps as recorded, not decreasing: they may jitter, have gaps, and be shared by the
            samples of a packet. Estimators run on :meth:`on_grid`.
        measurements: channel name (``site/kind``) → ``(T, size)``; NaN where a channel has no valid sample.
        truth: quantity name → ``(T, size)``; NaN where unknown; may be empty.
        mask: ``(T,)`` bool, evaluation mask; all samples by default.
        metadata: JSON-able description: name, environment, sensors, seed, version, rate, source, licence, …;
            ``nominal_rate`` is the rate in Hz that the device states; it decides the grid of irregular stamps.

    Raises:
        ValueError: an argument has the wrong shape or type, time decreases or stands still, there is no sample or no
            channel, a value is infinite, or the metadata are not JSON-able.
    """

    time: np.ndarray
    measurements: dict[str, np.ndarray]
    truth: dict[str, np.ndarray] = field(default_factory=dict)
    mask: np.ndarray = field(default=None)  # type: ignore[arg-type]
    metadata: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        time = real_array("time", self.time)
        if time.ndim != 1 or len(time) == 0:
            raise ValueError(f"time must have shape (T,) with at least one sample, got {time.shape}")
        if not np.isfinite(time).all():
            raise ValueError(
                f"time must be finite, got {time[~np.isfinite(time)][0]} at sample {first(~np.isfinite(time))}"
            )
        backwards = np.diff(time) < 0.0 if time[-1] > time[0] else np.diff(time) <= 0.0
        if backwards.any():
            sample = first(backwards) + 1
            with np.errstate(over="ignore"):
                single = time.astype(np.float32)
            coarse = np.array_equal(single, time) and float(np.spacing(np.abs(single).max())) > 1e-3
            hint = "; the stamps are of single precision, which is too coarse for times of this size" if coarse else ""
            raise ValueError(
                f"time must increase, got {time[sample]} s at sample {sample} after {time[sample - 1]} s{hint}"
            )
        measurements = columns("measurements", self.measurements, len(time))
        if not measurements:
            raise ValueError("measurements must hold at least one channel, got none")
        mask = np.ones(len(time), bool) if self.mask is None else np.array(np.ma.filled(self.mask, False))
        if mask.dtype != bool or mask.shape != time.shape:
            raise ValueError(f"mask must be bool of shape ({len(time)},), got {mask.dtype} of shape {mask.shape}")
        mask.flags.writeable = False
        values = {
            "time": time,
            "measurements": measurements,
            "truth": unit_or_unknown(columns("truth", self.truth, len(time))),
            "mask": mask,
            "metadata": check_metadata(self.metadata),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def name(self) -> str:
        """``metadata["name"]``, or ``"trajectory"``."""
        return str(self.metadata.get("name", "trajectory"))

    @cached_property
    def clock(self) -> Clock:
        """The uniform grid behind the stamps, see :func:`~poise.envs.data.clock.fit_clock`.

        Raises:
            ValueError: no sampling rate explains the stamps; or there is a single sample, and the metadata have no
                rate.
        """
        nominal = self.metadata.get("nominal_rate")
        if len(self) > 1:
            try:
                return fit_clock(self.time, nominal)
            except ValueError as reason:
                raise ValueError(f"{self.name}: {reason}") from None
        rate = nominal or self.metadata.get("rate")
        if rate is None:
            raise ValueError(f"{self.name} has a single sample and no rate in its metadata: its interval is unknown")
        return Clock(1.0 / float(rate), float(self.time[0]), np.zeros(1, int), 0.0, 0)

    @property
    def contradicted_rate(self) -> str:
        """What the stamps say against ``metadata["nominal_rate"]``; empty if they fit to it, or there is none."""
        nominal = self.metadata.get("nominal_rate")
        rate = 1.0 / self.clock.interval
        if nominal is None or abs(rate / float(nominal) - 1.0) <= RATE_RANGE:
            return ""
        return f"a nominal rate of {float(nominal):.4g} Hz is named, but the stamps are {rate:.4g} Hz"

    @property
    def dt(self) -> float:
        """Sampling interval, s, fitted to all stamps; of a single sample ``1 / metadata["rate"]``.

        Raises:
            ValueError: see :attr:`clock`.
        """
        return self.clock.interval

    @property
    def uniform(self) -> bool:
        """Whether the stamps are a uniform grid (to 1 % of an interval), so that :meth:`on_grid` changes nothing."""
        if len(self) == 1:
            return True
        steps = np.diff(self.time)
        typical = float(np.median(steps))
        return typical > 0.0 and bool(np.all(np.abs(steps / typical - 1.0) < 0.01)) and self.clock.missing == 0

    def on_grid(self) -> Trajectory:
        """The trajectory on its uniform grid, as estimators require it.

        Gaps become samples of NaN that are not scored, jitter is attributed to the stamps, and the samples of a
        packet lie in the interval before its stamp. Rows that repeat stamp and values of the row before are dropped.
        An exact grid is returned as it is.

        Raises:
            ValueError: no sampling rate explains the stamps, or the rate is not one of an inertial sensor: the message
                names the unit that time seems to have.
        """
        if len(self) == 1:
            return self
        kept = self.without_repeats()
        clock = kept.clock
        if kept.contradicted_rate:
            warnings.warn(f"{self.name}: {kept.contradicted_rate}; the stamps are believed", stacklevel=2)
        if any(name.rsplit("/", 1)[-1] in INERTIAL for name in self.measurements):
            check_interval(clock.interval, self.time)
        if kept.uniform:
            return kept
        length = int(clock.index[-1]) + 1

        def spread(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
            grids = {name: np.full((length, values.shape[1]), np.nan) for name, values in arrays.items()}
            for name, values in arrays.items():
                grids[name][clock.index] = values
            return grids

        mask = np.zeros(length, bool)
        mask[clock.index] = kept.mask
        found = {"missing": clock.missing, "jitter": clock.jitter, "packets": clock.packets}
        if clock.packets > 0.01 * len(self) or float(np.mean(np.diff(kept.time) == 0.0)) > 0.1:
            warnings.warn(
                f"{self.name}: {clock.packets} time stamps are shared by several samples; these are spread over the "
                f"interval before the stamp, {1.0 / clock.interval:.4g} Hz",
                stacklevel=2,
            )
        if clock.missing > length / 3 or too_coarse(kept.time, clock):
            named = "nominal_rate" in self.metadata
            hint = "" if named else "; if it is not the device's rate, name it in metadata['nominal_rate']"
            rate = f"{1.0 / clock.interval:.4g} Hz"
            warnings.warn(f"{self.name}: {clock.missing} of {length} samples at {rate} are missing{hint}", stacklevel=2)
        return self.replace(
            time=clock.start + clock.interval * np.arange(length),
            measurements=spread(kept.measurements),
            truth=spread(kept.truth),
            mask=mask,
            metadata=self.metadata | {"rate": 1.0 / clock.interval, "clock": found},
        )

    def interpolated(self, longest: float = 0.05) -> Trajectory:
        """The trajectory on its grid, with short gaps of gyroscopes and accelerometers filled by lines.

        This looks ahead, so it is for offline work: a zero-order hold of the rate adds an error of attitude in every
        gap. Filled samples are not scored, and ``metadata["interpolated"]`` says how many there are.

        Args:
            longest: s between the samples on both sides of a gap.

        Raises:
            ValueError: ``longest`` is not positive; or see :meth:`on_grid`.
        """
        if isinstance(longest, bool) or not isinstance(longest, Real) or not 0.0 < longest < np.inf:
            raise ValueError(f"longest must be a positive time in s, got {longest!r}")
        grid = self.on_grid()
        filled = {name: fill_short_gaps(values, longest / grid.dt) for name, values in grid.measurements.items()}
        kept = {name: values for name, values in filled.items() if name.rsplit("/", 1)[-1] in ("gyr", "acc")}
        count = {
            name: int((np.isnan(grid.measurements[name]) & ~np.isnan(kept[name])).any(axis=1).sum()) for name in kept
        }
        return grid.replace(
            measurements=grid.measurements | kept,
            metadata=grid.metadata | {"interpolated": {"longest": float(longest), "samples": count}},
        )

    def without_repeats(self) -> Trajectory:
        """Without rows that equal the row before, stamp and values alike."""
        repeated = np.append(False, np.diff(self.time) == 0.0)
        if not repeated.any():
            return self
        for values in self.measurements.values():
            same = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
            repeated[1:] &= same.all(axis=1)
        return self._rows(np.flatnonzero(~repeated)) if repeated.any() else self

    @property
    def onboard_orientation(self) -> np.ndarray | None:
        """The device's own estimate of its orientation ``(T, 4)``, which is not the truth; None if there is none."""
        return next(
            (values for name, values in self.measurements.items() if name.endswith("onboard_orientation")), None
        )

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names that :meth:`truth_of` accepts."""
        derived = [name for name in DERIVED_FROM_ORIENTATION if "orientation" in self.truth and name not in self.truth]
        return (*self.truth, *derived)

    def truth_of(self, quantity: str) -> np.ndarray:
        """The truth ``(T, size)`` of a quantity, derived from the orientation where only that is known.

        Raises:
            ValueError: the trajectory has no such truth.
        """
        if quantity in self.truth:
            return self.truth[quantity]
        if quantity not in self.quantities:
            raise ValueError(f"{self.name} knows no {quantity!r}; known are {list(self.quantities)}")
        return DERIVED_FROM_ORIENTATION[quantity](self.truth["orientation"])

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, part: slice) -> Trajectory:
        """The part ``trajectory[a:b]``; time is not shifted."""
        if not isinstance(part, slice) or part.step not in (None, 1):
            raise ValueError(f"a trajectory is cut by [a:b] in steps of one, got [{part}]; resample to thin it out")
        if len(self.time[part]) == 0:
            raise ValueError(f"{part} leaves no sample of the {len(self)} of {self.name}")
        return self._rows(part)

    def __repr__(self) -> str:
        known = f", truth {', '.join(self.truth)}" if self.truth else ""
        span = f"{self.time[0]:.6g} to {self.time[-1]:.6g} s"
        return f"Trajectory({self.name!r}, {len(self)} samples, {span}, channels {', '.join(self.measurements)}{known})"

    def _rows(self, rows: Any) -> Trajectory:
        return self.replace(
            time=self.time[rows],
            measurements={name: values[rows] for name, values in self.measurements.items()},
            truth={name: values[rows] for name, values in self.truth.items()},
            mask=self.mask[rows],
        )

    def replace(self, **changes: Any) -> Trajectory:
        """A copy with some attributes changed."""
        return dataclasses.replace(self, **changes)

    def resampled(self, rate: float, sampling: Literal["interval", "instant"] = "interval") -> Trajectory:
        """Resample to ``rate`` in Hz on the uniform grid that starts at the first sample.

        See :mod:`poise.envs.data.resampling` for what is kept.

        Args:
            rate: Hz.
            sampling: meaning of a sample: mean over the interval that it ends, or value at its time.

        Returns:
            The new trajectory. A sample is NaN if its interval overlaps a missing one, or an old neighbour is missing.
            Orientations are interpolated on the great circle, other truth linearly, both NaN beside unknown truth. A
            sample is scored if both its old neighbours are.

        Raises:
            ValueError: ``rate`` is not positive and finite, or ``sampling`` unknown.
        """
        if (np.diff(self.time) <= 0.0).any():
            return self.on_grid().resampled(rate, sampling)
        fields = resampled_fields(self.time, self.measurements, self.truth, self.mask, rate, sampling)
        old_rate = 1.0 / float(np.median(np.diff(self.time))) if len(self) > 1 else 1.0 / self.dt
        return self.replace(**fields, metadata=self.metadata | {"rate": float(rate), "resampled_from": old_rate})

    def reference_clock_corrected(self) -> Trajectory:
        """The trajectory with its truth on the clock of its gyroscope.

        Loaders measure by how much the reference runs ahead (``metadata["reference_clock_offset"]``, s). The truth at t
        is the recorded one at t − offset. Where that lies beside unknown truth, the orientation is turned back by the
        gyroscope instead, over no more than 10 ms. Without a measured offset nothing changes.
        """
        offset = self.metadata.get(REFERENCE_CLOCK)
        if not offset or not self.truth:
            return self
        truth = shifted(self.truth, self.time, offset)
        gyr = self.measurements.get("imu/gyr")
        if "orientation" in truth and gyr is not None and abs(offset) <= 0.01:
            turned = rotation.multiply(self.truth["orientation"], rotation.exp(-offset * gyr))
            lost = ~np.isfinite(truth["orientation"]).all(axis=1, keepdims=True)
            truth["orientation"] = np.where(lost, turned, truth["orientation"])
        details = {name: value for name, value in self.metadata.items() if name != REFERENCE_CLOCK}
        return self.replace(truth=truth, metadata=details | {"reference_clock_corrected": offset})

    def to_frame(self) -> pandas.DataFrame:
        """A table with one row per sample: see :func:`~poise.envs.data.frames.trajectory_frame`."""
        units = self.metadata.get("units")
        return trajectory_frame(
            self.time, self.measurements, self.truth, self.mask, units if isinstance(units, Mapping) else {}
        )

    def save(self, path: str | Path) -> Path:
        """Write the trajectory to an HDF5 file, see :mod:`poise.envs.data.storage`.

        Args:
            path: the file, by custom ``*.h5``; missing folders are made. A file that was there before stays whole
                until the new one is complete.

        Returns:
            The path.

        Raises:
            ValueError: a name cannot be stored, such as channels ``a`` and ``a/b`` together; or ``path`` is none.
            OSError: the folder cannot be written.
        """
        return write_trajectory_file(
            as_path(path), self.time, self.mask, {"measurements": self.measurements, "truth": self.truth}, self.metadata
        )


TRUSTED: WeakSet[Trajectory] = WeakSet()
"""Trajectories whose units and signs need no check: simulated in this process and not changed since, or checked."""


def load_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory that :meth:`Trajectory.save` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is another kind of file, of a newer version, truncated or damaged.
    """
    path = Path(path)
    fields = read_trajectory_file(path)
    try:
        return Trajectory(**fields)
    except ValueError as reason:
        raise ValueError(f"{path}: {reason}") from None


def trusted(trajectory: Trajectory) -> Trajectory:
    """The trajectory, whose units and signs need no check any more."""
    TRUSTED.add(trajectory)
    return trajectory
