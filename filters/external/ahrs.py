"""The classical filters of the package ``ahrs`` with the interface of this one: Madgwick, Mahony, extended Kalman.

See :mod:`poise.filters.external.wrapper` for what all wrappers have in common. The filters of the package expect an
initial attitude in frames that differ between filters. Here all start from the first complete sample: inclination from
the accelerometer, heading from the magnetometer (zero without one). Their state is explicit. They are written in plain
Python and need about 0.1 ms per sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..core.rotation import conjugate, level, multiply, normalize
from ..imu.magnetic_heading import align, norm_and_dip
from .wrapper import QUARTER_TURN, ExternalPackage


@dataclass(frozen=True)
class AHRSFilter(ExternalPackage):
    """Initialisation, and prediction where a sample is missing; shared by the three filters."""

    package: ClassVar[str] = "ahrs.filters"

    def _start(self, sample: np.ndarray) -> np.ndarray:
        """Attitude of a first sample, sensor to world."""
        f = sample[3:6]
        return np.asarray(level(f) if self.axes == 6 else align(f, sample[6:], 0.0))

    def _parts(self, sample: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Rates, specific force (zeros, which these filters skip, if missing), field (None if missing or not read)."""
        gyroscope, f = sample[:3], sample[3:6]
        if not gyroscope.any():
            gyroscope = np.full(3, 1e-12)  # the package skips the correction too at a rate of exactly zero
        f = f if np.isfinite(f).all() else np.zeros(3)
        field = sample[6:] if self.axes == 9 and np.isfinite(sample[6:]).all() else None
        return gyroscope, f, field


@dataclass(frozen=True)
class AHRSMadgwick(AHRSFilter):
    """Madgwick's gradient descent.

    S. O. H. Madgwick, "An efficient orientation filter for inertial and inertial/magnetic sensor arrays", report,
    University of Bristol, 2010. The world frame of its nine-axis form is x north, y west, z up.
    """

    gain_imu: float = 0.033
    """β of six axes, rad/s"""
    gain_marg: float = 0.041
    """β of nine axes, rad/s"""

    def begin(self, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """The first sample gives the attitude."""
        q = self._start(sample)
        return np.asarray(multiply(conjugate(QUARTER_TURN), q)), q

    def advance(self, memory: Any, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """Memory: the quaternion to north-west-up."""
        gyroscope, f, field = self._parts(sample)
        gain = self.gain_imu if self.axes == 6 else self.gain_marg
        engine = self.load().Madgwick(Dt=self.dt, gain=gain)
        without = field is None
        q = engine.updateIMU(memory, gyroscope, f) if without else engine.updateMARG(memory, gyroscope, f, field)
        q = np.asarray(q, dtype=float)
        return q, np.asarray(multiply(QUARTER_TURN, q))


@dataclass(frozen=True)
class AHRSMahony(AHRSFilter):
    """Mahony's explicit complementary filter with bias; compare :class:`poise.filters.imu.classical.Mahony`.

    R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear Complementary Filters on the Special Orthogonal Group", IEEE
    Transactions on Automatic Control 53(5), 2008, doi 10.1109/TAC.2008.923738.
    """

    k_p: float = 1.0
    """rad/s"""
    k_i: float = 0.3
    """rad/s²"""

    gives_bias: ClassVar[bool] = True

    def begin(self, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """The first sample gives the attitude; the bias is zero."""
        output = np.concatenate([self._start(sample), np.zeros(3)])
        return output, output

    def advance(self, memory: Any, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """Memory: quaternion and bias."""
        gyroscope, f, field = self._parts(sample)
        if not f.any():
            # Without a sample the package also omits the bias; here the prediction uses it.
            gyroscope = gyroscope - memory[4:]
        engine = self.load().Mahony(Dt=self.dt, k_P=self.k_p, k_I=self.k_i, b0=memory[4:].copy())
        if field is None:
            q = engine.updateIMU(memory[:4], gyroscope, f)
        else:
            q = engine.updateMARG(memory[:4], gyroscope, f, field)
        output = np.concatenate([np.asarray(q, dtype=float), engine.b])
        return output, output


@dataclass(frozen=True)
class AHRSEKF(AHRSFilter):
    """Extended Kalman filter on the quaternion.

    Implemented by the package (see the documentation of ``ahrs.filters.ekf``). The default reference field of the
    package is that of Munich; here the dip is that of the first sample. Noises are per sample, so the filter depends on
    the rate.
    """

    gyroscope_variance: float = 0.09
    """rad²/s²"""
    accelerometer_variance: float = 0.25
    """of the unit vector"""
    magnetometer_variance: float = 0.64
    """of the unit vector"""

    def begin(self, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """The first sample gives the attitude and the dip of the field; the covariance is one."""
        q = self._start(sample)
        dip = float(norm_and_dip(q, sample[6:])[1]) if self.axes == 9 else 0.0
        return (q, np.eye(4), dip), q

    def advance(self, memory: Any, sample: np.ndarray) -> tuple[Any, np.ndarray]:
        """Memory: quaternion, covariance, dip of the field."""
        q, covariance, dip = memory
        gyroscope, f, field = self._parts(sample)
        engine = self.load().EKF(
            Dt=self.dt,
            frame="ENU",
            magnetic_ref=math.degrees(dip),
            P=covariance,
            noises=[self.gyroscope_variance, self.accelerometer_variance, self.magnetometer_variance],
        )
        if not f.any():
            # The package would skip the prediction too.
            F = engine.dfdq(gyroscope, self.dt)
            w, x, y, z = q
            # derivative of the predicted quaternion with respect to the rate
            W = 0.5 * self.dt * np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]])
            covariance = F @ covariance @ F.T + self.gyroscope_variance * W @ W.T
            q = np.asarray(normalize(engine.f(q, gyroscope, self.dt)))
            return (q, covariance, dip), q
        engine.mag = field  # determines the number of rows of its measurement
        # Its accelerometer points down in east-north-up.
        q = np.asarray(engine.update(q, gyroscope, -f, field), dtype=float)
        return (q, engine.P, dip), q
