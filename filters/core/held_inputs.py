r"""How uncertain an input becomes while its last sample stands in for missing ones.

A rate that is held at ω₀ is wrong by ω(a) − ω₀ after the age a, and the angle that it integrates to by a variance that
grows first with a⁴, as the rate changes smoothly, and then with a², as one wrong rate acts all the time:

    V(a) = s² (a² − 2 τ² ln(1 + a² / 2τ²)),   s² = s₀² + (κ ‖ω₀‖)²

with the correlation time τ of the motion and its deviation s, which is larger where the last sample was. A rotation
cannot be wronger than any rotation, so V_b(a) = V / (1 + V / B) levels out at B. In one interval V_b grows by ΔV, and
the noise of the input grows from σ² Δtⁿ to σ² Δtⁿ + ΔV: a sample of age zero changes nothing.

A rider keeps upright, which no held rate knows: after a second or two a prior is nearer than the prediction, whose
error is by then too large for a linearisation. Equations whose inputs were all lost so long start anew.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .backend import Array, namespace
from .quantity import Measurement


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

    def noise(self, sigma: Array, age: Array, held: Array, dt: Array) -> Array:
        """The parameter ``(...)`` for an interval that ends at an age ``(...)`` of a last sample ``(..., size)``."""
        squared = namespace(held).sum(held * held, axis=-1)
        return grown(sigma, age, squared, dt, dt**self.power, self.spread, self.share, self.time, self.bound)


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
    """
    xp = namespace(age, squared)
    missing, scale = xp.greater(age, 0.0), 2.0 * time * time
    motion = spread * spread + share * share * squared

    def variance(a: Array) -> Array:
        free = motion * (a * a - scale * xp.log(1.0 + a * a / scale))
        return free / (1.0 + free / bound)

    end = xp.where(missing, age, 0.0 * age + dt)
    more = variance(end) - variance(end - dt)
    return xp.where(missing, xp.sqrt(sigma * sigma + more / weight), sigma + 0.0 * age)


def grown_parameters(model: Any, ages: Array, held: Measurement) -> Mapping[str, Array]:
    """The noises of a model's held inputs: parameter → value, in the shape of the batch.

    Args:
        model: the equations.
        ages: ``(..., channels)`` s since the last sample of each channel.
        held: channel → ``(..., size)`` last samples.
    """
    names = [channel.name for channel in model.channels]
    result: dict[str, Array] = {}
    for item in model.held_inputs:
        age = ages[..., names.index(item.channel)]
        noise = item.noise(_value(model, item.parameter), age, held[item.channel], model.dt)
        other = result.get(item.parameter)
        result[item.parameter] = noise if other is None else namespace(noise).maximum(noise, other)
    return result


def longest_gap(model: Any) -> tuple[float, list[int]]:
    """Age in s of all held inputs together beyond which the equations start anew, and the numbers of their channels."""
    names = [channel.name for channel in model.channels]
    longest = min((item.longest for item in model.held_inputs), default=math.inf)
    return longest, sorted({names.index(item.channel) for item in model.held_inputs})


def _value(model: Any, parameter: str) -> Array:
    """The parameter of a name such as ``noise`` or ``noise[1]``."""
    name, _, index = parameter.rstrip("]").partition("[")
    return getattr(model, name)[int(index)] if index else getattr(model, name)
