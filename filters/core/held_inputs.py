r"""How uncertain an input becomes while its last sample stands in for missing ones.

A rate that is held at ω₀ is wrong by ω(a) − ω₀ after the age a, and the angle that it integrates to by a variance that
grows first with a⁴, as the rate changes smoothly, and then with a², as one wrong rate acts all the time:

    V(a) = s² (a² − 2 τ² ln(1 + a² / 2τ²)),   s² = s₀² + (κ ‖ω₀‖)²

with the correlation time τ of the motion and its deviation s, which is larger where the last sample was. A rotation
cannot be wronger than any rotation, so V_b(a) = V / (1 + V / B) levels out at B. In one interval V_b grows by ΔV, and
the noise of the input grows from σ² Δtⁿ to σ² Δtⁿ + ΔV: a sample of age zero changes nothing. Where the filter's own
variance p of the rotation is known, it stands in for V_b in dV_b = (1 − V_b / B)² dV: what other sensors correct in a
gap of the gyroscope is lost again as fast as the held rate is wrong, at any age.

After such a gap the vertical may be wrong by any angle, which no linearised measurement finds: it corrects sin δ, and
becomes certain of δ. Until the deviation of the tilt is small again, the direction of the specific force is measured
instead, by the whole angle (coarse levelling), and the magnetometer, whose heading is that of the vertical, waits:

    r = arccos(u₃) (u × e₃) / ‖u × e₃‖,  u = q f q* / ‖f‖,   σ = 0.2 + 2 | ‖f‖ / g − 1 |

An acceleration that changes the length of the force by a share turns its direction by about as much.

A rider keeps upright, which no held rate knows: after a second or two a prior is nearer than the prediction, whose
error is by then too large for a linearisation. Equations whose inputs were all lost so long start anew.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .backend import Array, constant, expand, is_torch, namespace
from .quantity import GRAVITY, MAGNETOMETER, Measurement
from .rotation import norm, rotate

UNCERTAIN_TILT, LARGEST_LINEAR_TILT = 0.2, 0.5
"""Deviation of the tilt about an axis, rad, beyond which the heading is not measured, and beyond which measurements
that are linear in the tilt are not used."""
FORCE_DEVIATION, FORCE_SHARE = 0.2, 2.0
"""rad: σ of the direction of a force as long as gravity, and what a relative error of its length adds. Of the hands
below a force within 5 % of gravity is 10° from the vertical, one within 20 % or more 35° (root mean squares)."""
SURER = 2.0
"""Variance of the tilt, in those of the direction of the force, beyond which the latter is used; so not at once again,
as the acceleration of the next sample is nearly the same."""


@dataclass(frozen=True)
class HeldInput:
    """An input that a model holds, and the parameter that stands for its noise.

    Where several inputs share a parameter, the largest noise counts.

    The numbers of a hand's angular rate are the defaults. They were chosen on simulated gestures alone
    (``poise/HandMotion-v0``: slow, fast, severe, turn, mixed, walk, pointing, shaking; seeds 1 and 2; 60 s at 100 Hz),
    by least squares on the logarithm of the mean V(a) of an axis after holding the true rate for 0.02 to 10 s, in four
    classes of ‖ω₀‖.

    Attributes:
        channel: name of the input.
        parameter: the model's field that is its noise σ.
        power: n; 1 for a density (per √Hz), 2 for the deviation of a sample.
        spread: s₀, unit of the channel.
        share: κ.
        time: τ, s.
        bound: B, squared unit of the channel's integral; infinite for what may grow without end.
        longest: s, after which a prior is nearer than what was predicted.
    """

    channel: str
    parameter: str
    power: int = 1
    spread: float = 0.2
    share: float = 0.6
    time: float = 0.085
    bound: float = 2.0
    longest: float = math.inf

    def noise(self, sigma: Array, age: Array, held: Array, dt: Array, known: Array | None = None) -> Array:
        """The parameter ``(...)`` for an interval that ends at an age ``(...)`` of a last sample ``(..., size)``.

        ``known`` is the variance ``(...)`` of the integral before it, where the filter has one.
        """
        squared = namespace(held).sum(held * held, axis=-1)
        return grown(sigma, age, squared, dt, dt**self.power, self.spread, self.share, self.time, self.bound, known)


RIDDEN: Mapping[str, tuple[float, float, float]] = {
    "bicycle": (0.113, 0.097, 1.5),
    "trunk": (0.36, 0.083, 1.5),
    "arm": (0.58, 0.069, 1.5),
    "leg": (2.3, 0.13, 0.2),
}
"""Part of a bicycle with its rider → s₀ in rad/s, τ in s and the longest age in s of its angular rate."""


def ridden(channel: str, parameter: str, power: int = 1, part: str = "bicycle") -> HeldInput:
    """The angular rate of a bicycle, or of its rider's trunk, upper arm or thigh.

    Chosen on rides of ``poise/RiderBicycle-v0`` with full physics by least squares on the logarithm of the mean square
    of the angle that is missed after holding the rate for 0.05 to 2 s; of the bicycle about its long axis (0.05 rad
    after 0.5 s), of the rider about the axis that is missed most (0.17, 0.28 and 1.2 rad after 0.5 s; training rides of
    the networks). The model is within 20 % of them. The longest age of the bicycle is that at which it reaches the 10°
    that the published filters assume at their start, of a leg that at which it reaches the 0.3 rad by which a hip moves
    about its usual posture.
    """
    spread, time, longest = RIDDEN[part]
    return HeldInput(channel, parameter, power, spread=spread, share=0.0, time=time, longest=longest)


def grown(
    sigma: Array,
    age: Array,
    squared: Array,
    dt: Array,
    weight: Array,
    spread: Array,
    share: Array,
    time: Array,
    bound: Array,
    known: Array | None = None,
) -> Array:
    """The noise σ for an interval that ends at an age, by the equations above; all arguments ``(...)``.

    Args:
        sigma: σ of a sample of age zero.
        age: a, s.
        squared: ‖ω₀‖² of the last sample.
        dt: s.
        weight: Δtⁿ.
        spread: s₀.
        share: κ.
        time: τ, s.
        bound: B.
        known: p; None for V_b.
    """
    xp = namespace(age, squared)
    missing, scale = xp.greater(age, 0.0), 2.0 * time * time
    motion = spread * spread + share * share * squared

    def variance(a: Array) -> Array:
        free = motion * (a * a - scale * xp.log(1.0 + a * a / scale))
        return free if known is not None else free / (1.0 + free / bound)

    end = xp.where(missing, age, 0.0 * age + dt)
    more = variance(end) - variance(end - dt)
    if known is not None:
        left = 1.0 - known / bound
        more = more * xp.where(xp.greater(left, 0.0), left * left, 0.0 * left)
    return xp.where(missing, xp.sqrt(sigma * sigma + more / weight), sigma + 0.0 * age)


def grown_parameters(model: Any, ages: Array, held: Measurement, P: Array) -> Mapping[str, Array]:
    """The noises of a model's held inputs: parameter → value, in the shape of the batch.

    Args:
        model: the equations.
        ages: ``(..., channels)`` s since the last sample of each channel.
        held: channel → ``(..., size)`` last samples.
        P: ``(..., e, e)`` covariance before the interval.
    """
    names, start = [channel.name for channel in model.channels], rotation_part(model)
    result: dict[str, Array] = {}
    known = None
    if start >= 0:
        known = (P[..., start, start] + P[..., start + 1, start + 1] + P[..., start + 2, start + 2]) / 3.0
        known = known.detach() if is_torch(known) else known
    for item in model.held_inputs:
        age = ages[..., names.index(item.channel)]
        noise = item.noise(_value(model, item.parameter), age, held[item.channel], model.dt, known)
        other = result.get(item.parameter)
        result[item.parameter] = noise if other is None else namespace(noise).maximum(noise, other)
    return result


def longest_gap(model: Any) -> tuple[float, list[int]]:
    """Age in s of all held inputs together beyond which the equations start anew, and the numbers of their channels."""
    names = [channel.name for channel in model.channels]
    longest = min((item.longest for item in model.held_inputs), default=math.inf)
    return longest, sorted({names.index(item.channel) for item in model.held_inputs})


def rotation_part(model: Any) -> int:
    """Where the error of a model has the rotation of one inertial sensor, in world axes; −1 without one."""
    return int(model.error_parts.get("relative_orientation", (-1, -1))[0])


def tilt_variance(P: Array, start: int) -> Array:
    """Mean variance ``(...)`` of the rotation about the horizontal axes, rad²."""
    return 0.5 * (P[..., start, start] + P[..., start + 1, start + 1])


def coarse_rows(model: Any, x: Array, z: Measurement, P: Array) -> tuple[Array, Array, Array]:
    """Residual, Jacobian and covariance of a sample while the tilt is uncertain, of the shapes of the model's.

    The first two rows are the direction of the force where that is surer than the prediction, and the others are none.
    Where it is not, the rows are the model's, unless the tilt is too uncertain for a linear measurement.

    Args:
        model: the equations, whose error has a :func:`rotation_part`.
        x: ``(..., n)`` predicted state.
        z: the samples, without that of the magnetometer.
        P: ``(..., e, e)`` predicted covariance.
    """
    xp, start = namespace(x), rotation_part(model)
    r, H, R = model.residual(x, z)
    pose, force = model.pose(x), z["imu/acc"]
    q = pose["orientation"] if "orientation" in pose else pose["relative_orientation"]
    length, tilt = norm(force), tilt_variance(P, start)[..., None]
    up = rotate(q, force) / length
    across = xp.sqrt(up[..., :1] * up[..., :1] + up[..., 1:2] * up[..., 1:2] + 1e-18)
    angle = xp.atan2(across, up[..., 2:3]) / across
    gravity = expand(getattr(model, "gravity", GRAVITY), 1)
    deviation = FORCE_DEVIATION + FORCE_SHARE * xp.abs(length / gravity - 1.0)
    variance = deviation * deviation
    direct = xp.greater(tilt, SURER * variance)
    linear = xp.less_equal(tilt, LARGEST_LINEAR_TILT**2)
    missing = xp.nan + 0.0 * tilt
    rows = [angle * up[..., 1:2], -angle * up[..., :1], *[missing] * (model.residual_size - 2)]
    r = xp.where(direct, xp.concat(rows, axis=-1), xp.where(linear, r, missing))
    whole = direct[..., None]
    axes, unit = constant(np.eye(2, model.error_size, start), x), constant(np.eye(model.residual_size), x)
    H = xp.concat([xp.where(whole, axes + 0.0 * H[..., :2, :], H[..., :2, :]), H[..., 2:, :]], axis=-2)
    return r, H, xp.where(whole, variance[..., None] * unit, R)


def without_field(z: Measurement, unsure: Array) -> dict[str, Array]:
    """The samples, without that of the magnetometer where the tilt is uncertain, ``(...)`` bool."""
    xp = namespace(*z.values())
    return {
        name: xp.where(unsure[..., None], xp.nan + 0.0 * value, value) if name == MAGNETOMETER.name else value
        for name, value in z.items()
    }


def heading_kept(before: Array, P: Array, unsure: Array, start: int) -> Array:
    """The covariance ``(..., e, e)`` after a measurement, with the variance of the heading before it where ``unsure``.

    No measurement but that of the field tells the heading. Linearised about a wrong one, that of a velocity seems to.
    """
    xp, size, place = namespace(P), P.shape[-1], start + 2
    more = before[..., place, place] - P[..., place, place]
    more = xp.where(unsure & (more > 0.0), more, xp.zeros_like(more))
    entry = constant([[float(i == j == place) for j in range(size)] for i in range(size)], P)
    return P + more[..., None, None] * entry


def _value(model: Any, parameter: str) -> Array:
    """The parameter of a name such as ``noise`` or ``noise[1]``."""
    name, _, index = parameter.rstrip("]").partition("[")
    return getattr(model, name)[int(index)] if index else getattr(model, name)
