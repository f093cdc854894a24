"""Contact of pelvis and saddle: three points that press and never pull, over a spring and damper that only press.

The pelvis rises off the saddle point and tips forwards and to the right about it. Both sit bones and the front of the
pelvis rest on the cover, which is stiff against tipping; saddle and buttocks below them give way together. The centre
of pressure therefore never leaves the triangle of the three points. Friction holds the pelvis sideways and along.
"""

from __future__ import annotations

from typing import NamedTuple

from ....filters.compile.cache import jit
from ...sensors.ideal import STANDARD_GRAVITY
from ..frame.parameters import Mass
from .posture import Posture, placed

STIFFNESS, DAMPING = 4.5e4, 950.0
"""N/m and N·s/m of saddle and buttocks together, vertically; round figures of this project, as all here. With 45 kg on
it: a bounce at 5 Hz with a third of critical damping, as seated people have it (ISO 5982: main resonance of the
driving-point mass at 4 to 6 Hz)."""
TISSUE_STIFFNESS, TISSUE_DAMPING = 1.2e5, 3e3
"""N/m and N·s/m of the cover and the tissue under each of the three points, against tipping"""
SIT_BONES = 0.05
"""m: each sit bone's distance from the middle (ischial tuberosities are 0.10 to 0.14 m apart)"""
BEHIND, FRONT = 0.035, 0.12
"""m of the sit bones behind the saddle point, and of the foremost support ahead of it"""


class SeatContact(NamedTuple):
    """A saddle under one rider, as numbers for :func:`press`."""

    load: float
    """N that rests on it when nothing moves"""
    ahead: float
    """m of the centre of pressure ahead of the saddle point then"""
    stiffness: float
    """N/m"""
    damping: float
    """N·s/m"""
    pitch_stiffness: float
    """N·m/rad"""
    pitch_damping: float
    """N·m·s/rad"""
    roll_stiffness: float
    """N·m/rad"""
    roll_damping: float
    """N·m·s/rad"""
    front: float
    """m ahead of the saddle point"""
    behind: float
    """m"""
    sit_bones: float
    """m from the middle"""


def seat_contact(load: float, ahead: float) -> SeatContact:
    """The saddle under one rider.

    Args:
        load: what rests on it when nothing moves, N; with it the pelvis is where the posture has it.
        ahead: of the saddle point is the centre of pressure then, m.
    """
    # three equal springs about their centroid
    along, across = 2.0 / 3.0 * (FRONT + BEHIND) ** 2, 2.0 * SIT_BONES**2
    return SeatContact(
        load=load,
        ahead=ahead,
        stiffness=STIFFNESS,
        damping=DAMPING,
        pitch_stiffness=along * TISSUE_STIFFNESS,
        pitch_damping=along * TISSUE_DAMPING,
        roll_stiffness=across * TISSUE_STIFFNESS,
        roll_damping=across * TISSUE_DAMPING,
        front=FRONT,
        behind=BEHIND,
        sit_bones=SIT_BONES,
    )


@jit
def press(
    seat: SeatContact, pitch: float, pitching: float, roll: float, rolling: float, rise: float, rising: float
) -> tuple[float, float, float]:
    """Force and moments of the saddle on the pelvis.

    Args:
        seat: the saddle.
        pitch: forward tip of the pelvis, rad.
        pitching: its rate, rad/s.
        roll: tip to the right, rad.
        rolling: its rate, rad/s.
        rise: height of the pelvis above its position at rest, m.
        rising: its rate, m/s.

    Returns:
        Moments about the saddle point, N·m, forwards and to the right; upward force, N, never negative.
    """
    force = seat.load - seat.stiffness * rise - seat.damping * rising
    if force <= 0.0:
        return 0.0, 0.0, 0.0
    forwards = force * seat.ahead + seat.pitch_stiffness * pitch + seat.pitch_damping * pitching
    rightwards = seat.roll_stiffness * roll + seat.roll_damping * rolling
    front = (forwards + seat.behind * force) / (seat.front + seat.behind)
    left = 0.5 * (force - front - rightwards / seat.sit_bones)
    right = force - front - left
    # a point that would have to pull lets go, and the others carry its load
    front, left, right = max(0.0, front), max(0.0, left), max(0.0, right)
    share = force / (front + left + right)
    front, left, right = share * front, share * left, share * right
    return seat.behind * (left + right) - seat.front * front, seat.sit_bones * (left - right), force


ARMS_ON_HANDS = 0.30
"""N/kg: weight of both arms carried by the hands, per mass of the rider (found in rides: 0.26 to 0.31)"""
AHEAD = 0.06
"""N·m/kg: moment of the trunk carried by the saddle, so that the weight rests just ahead of its middle"""
LEGS_ON_SADDLE = 0.4
"""1: part of the legs' weight that pedals do not carry (found in rides: 0.4)"""


def balanced_hand_load(posture: Posture) -> float:
    """Load (N) of each hand besides the arm's weight with which all of the saddle carries weight."""
    upper = upper_body(posture)
    moment = STANDARD_GRAVITY * sum(part.mass * float(part.centre[0] - posture.bicycle.saddle[0]) for part in upper)
    reach = posture.bicycle.grip[0] - posture.bicycle.saddle[0]
    mass = posture.body.mass
    return max(0.0, 0.5 * ((moment - AHEAD * mass) / reach - ARMS_ON_HANDS * mass))


def resting_load(posture: Posture, hand_load: float) -> float:
    """Weight (N) on the saddle of a rider who leans on each hand with ``hand_load`` (N)."""
    upper = STANDARD_GRAVITY * sum(part.mass for part in upper_body(posture))
    legs = STANDARD_GRAVITY * posture.body.mass - upper
    return upper - 2.0 * hand_load - ARMS_ON_HANDS * posture.body.mass + legs * LEGS_ON_SADDLE


def upper_body(posture: Posture) -> list[Mass]:
    """Pelvis, trunk and arms in the bicycle frame."""
    trunk = posture.trunk_orientation()
    arms = [mass for name, mass in posture.limbs_at(0.0).items() if name.startswith("arm")]
    return [posture.pelvis(), *(placed(mass, posture.lumbar, trunk) for mass in (posture.trunk(), *arms))]
