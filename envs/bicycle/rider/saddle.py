"""Compliance between pelvis and seat post: a vertical spring and damper that transmit compression only.

The pelvis moves only along the frame's z axis; otherwise rider and saddle are rigidly connected.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...sensors.ideal import STANDARD_GRAVITY
from .anthropometry import Mass
from .posture import Posture, placed


@dataclass(frozen=True)
class SaddleParameters:
    """Buttocks, padding and springs of a saddle; round figures of this project.

    With 45 kg on it: a bounce at 5 Hz with a third of critical damping, as seated people have it (ISO 5982: main
    resonance of the driving-point mass at 4 to 6 Hz).

    Raises:
        ValueError: a stiffness that is not positive, or a negative damping.
    """

    stiffness: float = 4.5e4
    """N/m"""
    damping: float = 950.0
    """N·s/m"""

    def __post_init__(self) -> None:
        if not 0.0 < self.stiffness < float("inf"):
            raise ValueError(f"stiffness must be positive and finite (N/m), got {self.stiffness}")
        if not 0.0 <= self.damping < float("inf"):
            raise ValueError(f"damping must not be negative and be finite (N·s/m), got {self.damping}")


class Saddle:
    """The saddle under one rider.

    Args:
        load: what rests on it when nothing moves, N; with it the pelvis is where the posture has it.
        parameters: None for default ones.
    """

    def __init__(self, load: float, parameters: SaddleParameters | None = None) -> None:
        self.load, self.parameters = load, SaddleParameters() if parameters is None else parameters

    def force(self, height: float, rate: float) -> float:
        """Upward force on the pelvis, N, never negative: the contact is unilateral.

        Args:
            height: of the pelvis above its position at rest, m.
            rate: of that height, m/s.
        """
        return max(0.0, self.load - self.parameters.stiffness * height - self.parameters.damping * rate)


ARMS_ON_HANDS = 0.30
"""N/kg: weight of both arms carried by the hands, per mass of the rider (found in rides: 0.26 to 0.31)"""
AHEAD = 0.06
"""N·m/kg: moment of the trunk carried by the saddle, so that the weight rests just ahead of its middle"""
LEGS_ON_SADDLE = 0.4
"""1: part of the legs' weight that pedals do not carry (found in rides: 0.4)"""


def balanced_hand_load(posture: Posture) -> float:
    """Load (N) of each hand besides the arm's weight with which all of the saddle carries weight."""
    upper = _upper_body(posture)
    moment = STANDARD_GRAVITY * sum(part.mass * float(part.centre[0] - posture.bicycle.saddle[0]) for part in upper)
    reach = posture.bicycle.grip[0] - posture.bicycle.saddle[0]
    mass = posture.body.mass
    return max(0.0, 0.5 * ((moment - AHEAD * mass) / reach - ARMS_ON_HANDS * mass))


def resting_load(posture: Posture, hand_load: float, pedals: bool) -> float:
    """Weight (N) on the saddle of a rider who leans on each hand with ``hand_load`` (N), whether or not on pedals."""
    upper = STANDARD_GRAVITY * sum(part.mass for part in _upper_body(posture))
    legs = STANDARD_GRAVITY * posture.body.mass - upper
    hands = 2.0 * hand_load + ARMS_ON_HANDS * posture.body.mass * pedals
    return upper - hands + legs * (LEGS_ON_SADDLE if pedals else 1.0)


def _upper_body(posture: Posture) -> list[Mass]:
    """Pelvis, trunk and arms in the bicycle frame."""
    trunk = posture.trunk_orientation()
    arms = [mass for name, mass in posture.limbs_at(0.0).items() if name.startswith("arm")]
    return [posture.pelvis(), *(placed(mass, posture.lumbar, trunk) for mass in (posture.trunk(), *arms))]
