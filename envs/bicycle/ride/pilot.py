"""Human riders as controllers: delays, noise, muscles and skill, as named parameter sets.

The structure is that of the optimal control model (D. L. Kleinman, S. Baron, W. H. Levison, An optimal control model of
human response, Automatica 6 (1970)): what is sensed is delayed and noisy, an internal model of the bicycle filters it
and predicts across the delay, and the muscles lag behind and add noise in proportion to their effort. Its use for
bicycles, with delays of vestibular and visual organs that an internal model makes up for, follows G. Dialynas,
C. Christoforidis, R. Happee, A. L. Schwab, Rider control identification in cycling taking into account steering torque
feedback and sensory delays, Veh. Syst. Dyn. 61 (2023); second-order muscles as in R. Hess, J. K. Moore, M. Hubbard,
Modeling the manually controlled bicycle, IEEE Trans. Syst. Man Cybern. A 42 (2012).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ....filters.support.parameters import check_positive


@dataclass(frozen=True)
class PilotParameters:
    """A human control model of steering.

    Noise of a sense is white; its level is the standard deviation of the mean over one second. Delays and muscles are
    published. Levels and weights are choices of this project, made on rides with seeds below 13: riders stay up, and
    steering grows about six times from 20 to 5 km/h, as measured (``poise realism --parts steering``). What an
    error of a sense does to the steering depends on the speed: one of roll or roll rate is answered by a steering angle
    that grows with about the inverse square of the speed, one of steering or heading by the same at any speed. Balance
    therefore has to be the least exact sense, and the path must not be followed more closely the faster the bicycle is.

    Raises:
        ValueError: a number that is negative or not finite, a delay, frequency or torque that is zero, or senses of
            balance that are later than the eyes.
    """

    name: str
    vestibular_delay: float
    """s: of roll rate (semicircular canals), steer angle and steer rate (arms and hands)"""
    visual_delay: float
    """s: of roll angle, heading and distance from the path"""
    roll_rate_noise: float
    """rad/s; a tilt of 0.5 deg within a second is at the threshold of perception in the dark (K. Suri, T. K. Clark,
    Human vestibular perceptual thresholds for pitch tilt are slightly worse than for roll tilt across a range of
    frequencies, Exp. Brain Res. 238 (2020)); riders also see"""
    steer_noise: float
    """rad"""
    steer_rate_noise: float
    """rad/s"""
    roll_noise: float
    """rad"""
    heading_noise: float
    """rad"""
    offset_noise: float
    """m"""
    motor_noise: float
    """1: standard deviation of the torque relative to its size, by muscles that are not steady (remnant)"""
    tremor: float
    """N·m: standard deviation of the torque without any effort"""
    effort: float
    """cost of a squared N·m, in place of that of :class:`.ControlSettings`: high for those who steer reluctantly"""
    care: float
    """1: factor on the costs of heading and distance from the path; riders on a treadmill who keep their heading and
    balance drift by some decimetres (J. K. Moore, Human control of a bicycle, dissertation, UC Davis (2012))"""
    muscle_frequency: float = 30.0
    """rad/s: natural frequency of arms and muscles (Hess et al. 2012)"""
    muscle_damping: float = 0.7
    """1: damping ratio of the same (Hess et al. 2012: 0.707)"""
    arm_damping: float = 3.0
    """N·m·s/rad: of arms that hold the bar, without delay (round figure of this project): what unsteady hands and a
    swaying trunk do to the bar at high speed"""
    largest_torque: float = 20.0
    """N·m, approached softly: a reserve for recoveries, above all at walking pace; ordinary riding takes less than 10
    """
    sway: float = 2.0
    """N·m: standard deviation of the roll moment that the internal model expects from body and wind"""
    sway_time: float = 0.5
    """s: how long it lasts"""

    def __post_init__(self) -> None:
        or_zero = ("care", "arm_damping", "tremor", "motor_noise")
        check_positive(self, *(name for name in vars(self) if name not in ("name", *or_zero)), or_zero=or_zero)
        if not self.vestibular_delay <= self.visual_delay <= 0.5:
            raise ValueError(
                f"delays must be vestibular ≤ visual ≤ 0.5 s, got {self.vestibular_delay} and {self.visual_delay} s"
            )


def _skill(name: str, delays: tuple[float, float], noise: float, motor: float, care: float) -> PilotParameters:
    """A rider whose senses are ``noise`` times as noisy as those of the skilled one, and hands as well."""
    degree = math.radians(1.0)
    return PilotParameters(
        name,
        *delays,
        roll_rate_noise=0.16 * noise * degree,
        steer_noise=0.02 * noise * degree,
        steer_rate_noise=0.08 * noise * degree,
        roll_noise=0.1 * noise * degree,
        heading_noise=0.06 * noise * degree,
        offset_noise=0.0075 * noise,
        motor_noise=motor,
        tremor=0.025 * noise,
        effort=0.05,
        care=care,
    )


PILOTS = {
    pilot.name: pilot
    for pilot in (
        _skill("expert", (0.10, 0.15), 0.6, 0.03, 0.5),
        _skill("skilled", (0.11, 0.18), 1.0, 0.04, 0.3),
        _skill("novice", (0.12, 0.20), 1.15, 0.06, 0.2),
    )
}
"""Human pilots by name, from the most to the least skilled."""
IDEAL = "ideal"
"""Name of the pilot with the exact state, no delay, no noise and no muscles."""
RANDOM = "random"
"""Name of a human pilot that is drawn for each ride."""


def pilot_parameters(pilot: str | PilotParameters) -> PilotParameters | None:
    """A human pilot by name, or as given; None for ``"ideal"``.

    Raises:
        ValueError: there is none of that name.
    """
    if isinstance(pilot, PilotParameters):
        return pilot
    if pilot == IDEAL:
        return None
    if pilot not in PILOTS:
        raise ValueError(f"pilot must be one of {[IDEAL, *PILOTS]}, {RANDOM!r} or PilotParameters, got {pilot!r}")
    return PILOTS[pilot]


def check_pilot(pilot: str | PilotParameters) -> str | PilotParameters:
    """The same, if it names a pilot, or ``"random"``, one of the human ones for each ride.

    Raises:
        ValueError: there is none of that name.
    """
    if pilot != RANDOM:
        pilot_parameters(pilot)
    return pilot
