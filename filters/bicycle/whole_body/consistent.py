"""The whole-body filter with what is wrong for a whole ride as states, and noises that hold on rides.

The published form estimates neither biases of gyroscopes nor errors of the rider's geometry. A rotation of the elbow
about the line from shoulder to hand is observed within about forty seconds only, so a bias of 1 °/s turns the arm by
tens of degrees, and the trunk with it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ...core.backend import Array, constant, expand, namespace
from ...core.held_inputs import ridden
from ...core.matrices import block_diagonal, block_matrix, diagonal, diagonal_matrix, zeros
from ...core.model import Gain
from ...core.quantity import DEG, Measurement
from ...core.rotation import euler_matrix
from ...support.parameters import check_positive
from ..geometry import GEOMETRY_STD, Point, RiderGeometry, TapeMeasure
from .blocks import BLOCKS
from .filter import CONSTRAINTS, WholeBody
from .linkage import CRANK, ERROR_SIZE, GYROSCOPES, HIP, SHOULDER, SIDES, STEER, TRUNK

PUBLISHED = WholeBody.state_size
BIASES, ROLL_BIAS, TRUNK_OFFSET, CONSTRAINED = slice(0, 15), slice(15, 16), slice(16, 19), slice(19, 31)
"""What lasts, in its order after the published state."""
ADDED = CONSTRAINED.stop
BY_LENGTHS = (0.13, 0.0, 0.39, 0.0)
"""Share of lengths of segments in the variances of the offsets of C1, C2, C5, C6; the rest is that of joints' places.
Those of C3 and C7 are the rider's."""
LEAST_OFFSET = 0.002
"""of them where the geometry is exact: joints are not points"""
MIRRORED = 60.0 * DEG
"""Angle between an upper segment and its direction with elbows out or knees forward; mirrored postures are beyond."""


@dataclass(frozen=True)
class ConsistentWholeBody(WholeBody):
    """:class:`.WholeBody` with 31 more states, a usual posture, and noises chosen on rides.

    Further states: biases (15) of the gyroscopes of trunk, arms and thighs in the paper's axes of their segments, that
    of the roll rate (1), offset of the trunk's accelerometer (3, the sensor's alignment above all), and what C1–C3 of
    an arm and C5–C7 of a leg are off by, right side first (12): lengths as measured, elbows that are not quite out.

    The usual posture, a weak measurement, is that of the rider, who leans and turns with the handlebar.

    Noises and offsets were chosen on simulated rides of training riders with devices from laboratory to phone grade,
    worn with placement errors, and a rider measured with a tape: offsets as they are there, noises by the likelihood of
    the true angles. Where the metadata of a recording say how exactly the rider was measured
    (:class:`.geometry.TapeMeasure`), the priors of what C1, C2, C5 and C6 are off by follow from that, up to a tape's.
    """

    usual_flexion: float = WholeBody.trunk_flexion
    """rad: forward lean of the trunk in the usual posture"""
    lean_follow: float = 0.38
    """lean of the trunk into a turn relative to the steering angle"""
    twist_follow: float = 0.45
    """rotation of the shoulders relative to the steering angle"""
    posture_noise: Point = (0.03, 0.06, 0.03)
    """rad √s, of the mean over one second: how far flexion, lean and twist are from the usual posture"""
    bias_prior: float = 3.0 * DEG
    """rad/s: turn-on bias of gyroscopes of phone grade"""
    bias_drift: float = 0.02 * DEG
    """rad/s/√s"""
    trunk_offset_prior: float = 0.85
    """m/s²: gravity on an accelerometer that is 5° askew"""
    arm_offsets: Point = (0.06, 0.05, 0.2)
    """of C1, C2, C3: lengths within 2 %, joints within 1 cm, elbows"""
    leg_offsets: Point = (0.033, 0.018, 0.1)
    """of C5, C6, C7"""
    swivel_time: float = 3.0
    """s: correlation time of the offsets of C3 and C7; others are constant"""
    bicycle_gyroscope_noise: float = 0.06
    """rad/s/√Hz; it stands for its biases across the bicycle too, which are not states"""
    trunk_gyroscope_noise: float = 0.05
    """rad/s/√Hz"""
    limb_gyroscope_noise: float = 0.02
    """rad/s/√Hz, of the arms"""
    leg_gyroscope_noise: float = 0.12
    """rad/s/√Hz: a thigh turns fast, so that a sensor that is askew shows much"""
    relative_acceleration_std: float = 1.25
    """m/s²"""
    trunk_noise: float = 1.0
    """m/s²"""
    torque_noise: float = 30.0
    """N·m: pedal forces, which have the period of the crank, and hands that support a lean"""
    length_noise: float = 0.1
    """of C1 and C5"""
    hinge_noise: float = 0.1
    """of C2 and C6"""
    swivel_noise: float = 1.0
    """of C3 and C7"""

    held_inputs: ClassVar = (
        *WholeBody.held_inputs[:4],
        *(ridden(f"thigh_{side}/gyr", "leg_gyroscope_noise", part="leg") for side in SIDES),
    )
    gains: ClassVar = {
        **WholeBody.gains,
        "leg": Gain("leg_gyroscope_noise", description="process variance of the hips' angles"),
    }
    state_size: ClassVar[int] = PUBLISHED + ADDED
    error_size: ClassVar[int] = ERROR_SIZE + ADDED

    def __post_init__(self) -> None:
        """Check what stands in denominators."""
        super().__post_init__()
        check_positive(self, "posture_noise", "swivel_time")

    @classmethod
    def rider_parameters(cls, geometry: RiderGeometry) -> dict[str, Any]:
        """As of the published filter, with the usual lean of the trunk."""
        return {**super().rider_parameters(geometry), "usual_flexion": geometry.trunk_flexion}

    @classmethod
    def parameters_from(cls, metadata: Mapping[str, Any]) -> dict[str, Any]:
        """As of every filter of a rider; offsets of lengths and hinges as the geometry was measured, or with a tape."""
        parameters = super().parameters_from(metadata)
        if parameters and metadata.get(GEOMETRY_STD) is not None:
            tape, usual = TapeMeasure.of(metadata), TapeMeasure()
            lengths, places = (tape.lengths / usual.lengths) ** 2, (tape.places / usual.places) ** 2
            # wider ones than of a usual tape made the errors larger
            parts = [min(1.0, math.sqrt(share * lengths + (1.0 - share) * places)) for share in BY_LENGTHS]
            for name, factors in (("arm_offsets", parts[:2]), ("leg_offsets", parts[2:])):
                length, hinge, swivel = getattr(cls, name)
                some = (max(each * by, LEAST_OFFSET) for each, by in zip((length, hinge), factors, strict=True))
                parameters[name] = (*some, swivel)
        return parameters

    @property
    def residual_size(self) -> int:  # type: ignore[override]
        """m: those of the published filter and the usual posture."""
        return super().residual_size + 3

    def prior(self, z: Measurement) -> tuple[Array, Array]:
        """As published; what lasts is zero."""
        x, P = super().prior(z)
        zero = 0.0 * x[..., :1]
        deviations = [
            *[self.bias_prior] * ROLL_BIAS.stop,
            *[self.trunk_offset_prior] * 3,
            *[*self.arm_offsets, *self.leg_offsets] * 2,
        ]
        return namespace(x).concat([x, *[zero] * ADDED], axis=-1), block_diagonal(
            [P, diagonal([each**2 for each in deviations], zero)]
        )

    def predict(self, x: Array, z: Measurement, previous: Measurement) -> tuple[Array, Array, Array]:
        """As published with the rates less their biases; biases drift, offsets of C3 and C7 fade."""
        xp, zero, dt = namespace(x), 0.0 * x[..., :1], expand(self.dt, 1)
        lasting = x[..., PUBLISHED:]
        now = self._unbiased(lasting, z)
        after, F, Q = super().predict(x, now, self._unbiased(lasting, previous))
        fade = xp.exp(zero - dt / expand(self.swivel_time, 1))
        keep = xp.concat([*[1.0 + zero] * CONSTRAINED.start, *[1.0 + zero, 1.0 + zero, fade] * 4], axis=-1)
        arm, leg = (
            [zero, zero, expand(each[2] ** 2, 1) * (1.0 - fade * fade)] for each in (self.arm_offsets, self.leg_offsets)
        )
        drift = [zero + expand(self.bias_drift**2 * self.dt, 1)] * ROLL_BIAS.stop
        spread = xp.concat([*drift, *[zero] * 3, *[*arm, *leg] * 2], axis=-1)
        F = block_matrix([[F, self._by_lasting(x, now)], [zeros(x, ADDED, ERROR_SIZE), diagonal_matrix(keep)]])
        roll = after[..., :1] - dt * lasting[..., ROLL_BIAS]
        return (
            xp.concat([roll, after[..., 1:], keep * lasting], axis=-1),
            F,
            block_diagonal([Q, diagonal_matrix(spread)]),
        )

    def _gyroscope_noises(self) -> dict[str, float]:
        """As published, the thighs with a noise of their own."""
        return {**super()._gyroscope_noises(), "leg": self.leg_gyroscope_noise}

    def _unbiased(self, lasting: Array, z: Measurement) -> dict[str, Array]:
        """Samples with the gyroscopes of trunk and limbs less their biases."""
        xp, found = namespace(lasting), dict(z)
        for index, name in enumerate(GYROSCOPES[1:]):
            # from the paper's axes to the environment's
            x, y, up = (lasting[..., 3 * index + axis : 3 * index + axis + 1] for axis in (0, 2, 1))
            found[name] = z[name] - xp.concat([x, -y, up], axis=-1)
        return found

    def _by_lasting(self, x: Array, z: Measurement) -> Array:
        """Derivative ``(..., 20, 31)`` of the published error state by what lasts."""
        xp, steps = namespace(x), self._turned(x, self.rates(z))
        place = {name: index for index, name in enumerate(GYROSCOPES[1:])}
        by: dict[tuple[int, int], Array] = {(2, 0): steps[2][2].by_child}
        for side, (arm, leg) in zip(SIDES, ((4, 5), (6, 7)), strict=True):
            by[arm, 0] = steps[arm][2].by_parent
            by[arm, place[f"upper_arm_{side}/gyr"]] = steps[arm][2].by_child
            by[leg, place[f"thigh_{side}/gyr"]] = steps[leg][2].by_child
        bands = []
        for row, block in enumerate(BLOCKS):
            height = block.stop - block.start
            rates = [by[row, column] if (row, column) in by else zeros(x, height, 3) for column in range(5)]
            roll = zeros(x, height, 1) + (1.0 if row == 0 else 0.0)
            bands.append(
                xp.concat([*(-expand(self.dt, 2) * each for each in (*rates, roll)), zeros(x, height, 15)], axis=-1)
            )
        return xp.concat(bands, axis=-2)

    def residual(self, x: Array, z: Measurement) -> tuple[Array, Array, Array]:
        """As published, less the offsets of the trunk's accelerometer and of the constraints; the usual posture."""
        xp, zero = namespace(x), 0.0 * x[..., :1]
        r, H, R = super().residual(x, z)
        # which of the offsets each row has: those of a_t after that of a_bz, those of the constraints after τ
        chosen = [i for i, name in enumerate(CONSTRAINTS) if name in self.constraints]
        columns = [
            None,
            *range(TRUNK_OFFSET.start, TRUNK_OFFSET.stop),
            None,
            *(CONSTRAINED.start + 6 * side + i for side in (0, 1) for i in chosen),
        ]
        columns += [None] * (r.shape[-1] - len(columns))
        lasting = x[..., PUBLISHED:]
        shift = xp.concat([zero if each is None else lasting[..., each : each + 1] for each in columns], axis=-1)
        pick = zeros(x, len(columns), ADDED) + constant(
            [[float(i == each) for i in range(ADDED)] for each in columns], x
        )
        steer, angles = x[..., STEER], x[..., TRUNK]
        usual = [
            zero - expand(self.usual_flexion, 1),
            -expand(self.lean_follow, 1) * steer,
            expand(self.twist_follow, 1) * steer,
        ]
        by_trunk = [zeros(x, 3, TRUNK.start), diagonal([1.0] * 3, zero), zeros(x, 3, self.error_size - TRUNK.stop)]
        H = xp.concat([xp.concat([H, pick], axis=-1), xp.concat(by_trunk, axis=-1)], axis=-2)
        spread = diagonal([each**2 / self.dt for each in self.posture_noise], zero)
        return xp.concat([r - shift, xp.concat(usual, axis=-1) - angles], axis=-1), H, block_diagonal([R, spread])

    def finish(self, x: Array, z: Measurement) -> Array:
        """A limb whose upper segment is beyond :data:`MIRRORED` from elbows out or knees forward begins there anew.

        Its constraints have a mirrored solution, into which one linear update may lead after a gap of the gyroscope.
        """
        xp, trunk = namespace(x), x[..., TRUNK]
        usual = self.limb_angles(trunk, x[..., STEER], x[..., CRANK])
        found = []
        for side in SIDES:
            for joint, part, sequence in (("shoulder", SHOULDER[side], "yxy"), ("hip", HIP[side], "zxy")):
                angles = usual[f"{joint}_{side}"]
                now, then = (euler_matrix(sequence, each)[..., :, 1] for each in (x[..., part], angles))
                away = xp.less(xp.sum(now * then, axis=-1)[..., None], math.cos(MIRRORED))
                found.append(xp.where(away, angles, x[..., part]))
        return xp.concat([x[..., : SHOULDER["right"].start], *found, x[..., ERROR_SIZE:]], axis=-1)

    def retract(self, x: Array, dx: Array) -> Array:
        """As published; what lasts is corrected additively."""
        parts = [super().retract(x[..., :PUBLISHED], dx[..., :ERROR_SIZE]), x[..., PUBLISHED:] + dx[..., ERROR_SIZE:]]
        return namespace(x).concat(parts, axis=-1)
