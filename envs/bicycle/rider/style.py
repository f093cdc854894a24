"""Riding styles from mild to aggressive: how much a rider moves on the bicycle, and the motion of one ride."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from ....filters.compile.cache import jit
from ....filters.support.parameters import check_positive
from .body_motion import (
    CHANNELS,
    HANDS,
    SWIVEL,
    TABLE_RATE,
    TRUNK,
    breathing,
    coloured_noise,
    gaze_shifts,
    glances,
    posture_changes,
    row_at,
    scans,
    standing_phases,
)

START = 2.0
"""s over which the movements set in"""
LARGEST_LEAN = 0.4
"""rad into a turn, to the bicycle"""
AT_EASE, LEAST_EASE = 3.0, 0.3
"""m/s above which a rider sways and bends freely, and the part of it that is left at walking pace, to keep balance"""
AT_REST = 1.5
"""1: how much more than a riding one a rider with a foot on the ground, who has no balance to keep, sways from side to
side and turns the shoulders; assumed"""
MOST_TWISTED = 0.2
"""rad by which the shoulders turn at most against the bar: both hands stay on it"""
MOST_UPRIGHT = 0.04
"""rad by which the trunk straightens at most: beyond, the arms would be straight, above all the outer one in a turn"""


LOOK, MOST_TURNED = 5.0, 1.3
"""1: turn of the head in a look over the shoulder, relative to the twist of the trunk; rad that the neck turns at most
(ranges of motion of young adults are about 75°)"""


@dataclass(frozen=True)
class RiderStyle:
    """Parameters of a riding style: choices of this project, such that the trunk moves as the chest of a recorded ride.

    The spectra were compared with the chest sensor alone; see ``docs/rider_bicycle.md``.

    Raises:
        ValueError: a negative amplitude, or an implausible sway.
    """

    name: str
    lean: float
    """rad: standard deviation of the noise in the trunk's wanted sideways lean"""
    flexion: float
    """rad: the same of bending and straightening"""
    twist: float
    """rad: the same of turning the shoulders"""
    turn_lean: float
    """rad·m: lean into a turn, relative to the bicycle, times the path's curvature"""
    levelling: float
    """1: share of the bicycle's roll that the trunk compensates, so that the shoulders stay level"""
    swivel: float = math.radians(3.0)
    """rad: standard deviation of the swivel of elbows and knees and of its slow variation"""
    hand_load: float = 60.0
    """N that each hand leans on the handlebar, besides the arm's weight: about a fifth of the rider's weight in all.
    Of a rider of 1.76 m and 68 kg; others lean so that their weight rests on the same part of the saddle.

    The papers report no handlebar forces; with less, a trunk bent as far forward as theirs lifts the saddle's rear.
    """
    unsteadiness: float = 0.15
    """N·m: standard deviation of the hands' unsteady torque"""
    pedalling: float = 0.0
    """rad: amplitude of lean and twist with each turn of the cranks; of flexion half of it, twice a turn"""
    posture: float = 0.0
    """rad: standard deviation of the posture's change of flexion, lean and twist, each"""
    posture_interval: float = math.inf
    """s between changes of posture, on average"""
    glance: float = 0.0
    """rad: twist of the trunk in a look over the shoulder, on average"""
    glance_interval: float = math.inf
    """s between looks, on average"""
    breath: float = 0.0
    """rad: amplitude of the trunk's flexion with each breath"""
    gaze: float = 0.0
    """rad: standard deviation of the head's yaw to the trunk where the rider looks aside, before the neck's limit;
    assumed, up to that limit: a recorded rider looked around that far during a whole ride"""
    gaze_interval: float = math.inf
    """s between turns of the head, on average, or as long as a turn lasts; assumed"""
    standing: float = 0.0
    """1: share of the time that the rider stands on the pedals, in phases of 15 to 30 s, above walking pace"""
    swing: float = 0.0
    """rad: amplitude by which a standing rider swings the bicycle from side to side, once a turn of the cranks; riders
    who sprint swing it by 0.2 and more"""
    scan: float = 0.0
    """rad: turn of the head to either side where another road may come in, on average; the neck's limit keeps it
    smaller. Drivers before a crossing look 47° (about 67 years old) to 53° (27 years) aside with head and eyes"""
    scan_interval: float = math.inf
    """s between such turns, on average: the same drivers look aside 2.1 to 2.7 times a crossing, 16 times a minute of a
    rider at 5 m/s with crossings 50 m apart

    S. W. Savage, L. Zhang, G. Swan, A. R. Bowers, The effects of age on the contributions of head and eye movements to
    scanning behavior at intersections, Transp. Res. F 73 (2020).
    """

    def __post_init__(self) -> None:
        check_positive(self, or_zero=(*SIZES, "hand_load", "unsteadiness", "gaze", "scan"))
        for name in ("posture_interval", "glance_interval", "gaze_interval", "scan_interval"):
            if not getattr(self, name) >= 1.0:
                raise ValueError(f"{name} must be at least 1 s, got {getattr(self, name)}")
        if not 0.0 <= self.standing <= 1.0:
            raise ValueError(f"standing must lie in [0, 1], got {self.standing}")
        largest = max(SIZES, key=lambda name: getattr(self, name))
        if getattr(self, largest) > 0.2:
            raise ValueError(
                f"{largest} must be at most 0.2 rad: a rider could not stay in the saddle, got {getattr(self, largest)}"
            )


SIZES = ("lean", "flexion", "twist", "swivel", "pedalling", "posture", "glance", "breath", "swing")
"""fields that are angles of movements"""
LOOKING = ("gaze", "gaze_interval", "scan", "scan_interval")
"""fields of how much a rider looks around"""
STYLES = {
    style.name: style
    for style in (
        RiderStyle("still", 0.0, 0.0, 0.0, 0.0, 0.0, swivel=0.0, unsteadiness=0.0),
        RiderStyle(
            "mild", 0.042, 0.05, 0.055, 0.25, 0.3,
            pedalling=0.025, posture=0.01, posture_interval=30.0, glance=0.1, glance_interval=40.0, breath=0.004,
            gaze=0.2, gaze_interval=5.0, scan=0.81, scan_interval=60.0,
        ),
        RiderStyle(
            "normal", 0.055, 0.05, 0.055, 0.6, 0.5,
            pedalling=0.036, posture=0.015, posture_interval=20.0, glance=0.15, glance_interval=25.0, breath=0.006,
            gaze=0.3, gaze_interval=3.0, scan=0.87, scan_interval=15.0,
        ),
        RiderStyle(
            "aggressive", 0.06, 0.05, 0.07, 0.8, 0.6, unsteadiness=0.25,
            pedalling=0.06, posture=0.015, posture_interval=15.0, glance=0.2, glance_interval=15.0, breath=0.01,
            gaze=1.3, gaze_interval=1.0, scan=0.93, scan_interval=3.7,
        ),
        RiderStyle(
            "standing", 0.04, 0.038, 0.05, 0.25, 0.3,
            posture=0.01, posture_interval=30.0, breath=0.01, gaze=0.2, gaze_interval=5.0, standing=0.85, swing=0.06,
            scan=0.81, scan_interval=60.0,
        ),
    )
}  # fmt: skip
"""The styles by name."""


def random_style(rng: np.random.Generator) -> RiderStyle:
    """A style between mild and aggressive, uniform on a logarithmic scale; always seated.

    Each parameter is drawn by itself, but those of :data:`LOOKING` are drawn together: who looks around does so often
    and far.
    """
    low, high = STYLES["mild"], STYLES["aggressive"]
    drawn: dict[str, float] = {}
    parts: dict[str, float] = {}
    for name in (field.name for field in fields(RiderStyle)[1:]):
        least, most = getattr(low, name), getattr(high, name)
        group = LOOKING[0] if name in LOOKING else name
        if least > 0.0 and group not in parts:
            parts[group] = float(rng.random())
        drawn[name] = least * (most / least) ** parts[group] if least > 0.0 else least
    return RiderStyle("random", **drawn)


def rider_style(style: str | RiderStyle, rng: np.random.Generator | None = None) -> RiderStyle:
    """A style by name, as ``"random"`` (drawn from ``rng``), or as given.

    Raises:
        ValueError: there is none of that name, or a random one without ``rng``.
    """
    if isinstance(style, RiderStyle):
        return style
    if style == "random":
        if rng is None:
            raise ValueError("a random style needs a generator")
        return random_style(rng)
    if style not in STYLES:
        raise ValueError(f"style must be one of {list(STYLES)}, 'random' or a RiderStyle, got {style!r}")
    return STYLES[style]


@jit
def intentions(table, habits, time, curvature, roll, crank, speed, foot):  # type: ignore[no-untyped-def]
    """Intended movements ``(8,)`` at a time; see :meth:`RiderMotion.at`.

    Args:
        table: ``(n, 8)`` random movements, see :mod:`.body_motion`.
        habits: ``(6,)`` lean into turns (rad·m), levelling, amplitude with the cranks (rad) and three phases (rad).
        time: s.
        curvature: 1/m.
        roll: rad.
        crank: rad.
        speed: m/s.
        foot: 1 on the ground, 0 in the air.
    """
    onset = min(1.0, time / START)
    onset = onset * onset * (3.0 - 2.0 * onset)
    values = row_at(table, time)
    ease = max(LEAST_EASE, min(1.0, speed / AT_EASE))
    stopped = foot * foot * (3.0 - 2.0 * foot)
    ease += stopped * (1.0 - ease)
    freed = 1.0 + stopped * (AT_REST - 1.0)
    values[0] *= ease
    values[1] *= ease * freed
    values[2] *= freed
    values[0] += 0.5 * habits[2] * math.sin(2.0 * crank + habits[3])
    if values[0] < 0.0:
        values[0] = MOST_UPRIGHT * math.tanh(values[0] / MOST_UPRIGHT)
    values[1] += habits[2] * math.sin(crank + habits[4])
    values[2] += habits[2] * math.sin(crank + habits[5])
    values[2] = MOST_TWISTED * math.tanh(values[2] / MOST_TWISTED)
    turn = max(-LARGEST_LEAN, min(LARGEST_LEAN, habits[0] * curvature))
    values[1] += -turn - habits[1] * roll
    for index in (0, 1, 2, 7):
        values[index] *= onset
    return values


class RiderMotion:
    """Intended motion of one rider: random functions of time, a part locked to the pedals, and a lean into turns.

    Args:
        style: habits.
        rng: draws everything random.
        duration: s; a longer motion of the same ``rng`` begins with a shorter one.
    """

    def __init__(self, style: RiderStyle, rng: np.random.Generator, duration: float = 120.0) -> None:
        self.style, self.duration = style, duration
        for_noise, for_posture, for_glances, for_breath, for_rest, for_gaze, for_standing, for_scans, for_neck = (
            rng.spawn(9)
        )
        # one row before time 0 and two after the end, for the interpolation
        rows = math.ceil(duration * TABLE_RATE) + 4
        time = (np.arange(rows) - 1.0) / TABLE_RATE
        deviations = [style.flexion, style.lean, style.twist, *[style.swivel] * 4, style.unsteadiness]
        self.table = coloured_noise(for_noise, np.array(deviations), rows)
        self.table[:, TRUNK] += posture_changes(for_posture, time, style.posture, style.posture_interval)
        looks = glances(for_glances, time, style.glance, style.glance_interval)
        self.table[:, CHANNELS.index("twist")] += looks
        self.table[:, CHANNELS.index("flexion")] += breathing(for_breath, time, style.breath)
        self.table[:, SWIVEL] += style.swivel * for_rest.standard_normal(4)
        if self.stands:
            phases = standing_phases(for_standing, time, style.standing)
            self.table = np.column_stack([self.table, phases])
        phases = for_rest.uniform(0.0, 2.0 * math.pi, 3)
        self.gaze = gaze_shifts(for_gaze, time, style.gaze, style.gaze_interval)
        """yaw and pitch of the head to the trunk, a table of :mod:`.body_motion`, rad"""
        self.gaze[:, 0] += LOOK * looks + scans(for_scans, time, style.scan, style.scan_interval)
        self.gaze = MOST_TURNED * np.tanh(self.gaze / MOST_TURNED)
        self.steadied = float(for_neck.random())
        """share of the acceleration of the neck's joint that spine and muscles keep from the head, see :mod:`.head`"""
        self.habits = np.array([style.turn_lean, style.levelling, style.pedalling, *phases])

    @property
    def stands(self) -> bool:
        """Whether the rider gets out of the saddle."""
        return self.style.standing > 0.0

    def at(
        self,
        time: float,
        curvature: float,
        roll: float,
        crank: float = 0.0,
        speed: float = AT_EASE,
        foot: float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Intentions at a time.

        Args:
            time: s since the start.
            curvature: of the path a little ahead, 1/m, left positive.
            roll: of the bicycle, rad, right positive.
            crank: angle of the cranks, rad.
            speed: of the bicycle, m/s.
            foot: 1 on the ground, 0 in the air.

        Returns:
            Change ``(3,)`` of the trunk's flexion, lean (right positive) and twist to the bicycle, rad; swivel
            ``(4,)`` of left arm, right arm, left leg, right leg, rad; unsteady steer torque, N·m.

        Raises:
            ValueError: a time outside the duration.
        """
        values = intentions(self.table, self.habits, self.checked(time), curvature, roll, crank, speed, foot)
        return values[TRUNK], values[SWIVEL], float(values[HANDS])

    def checked(self, time: float) -> float:
        """The time (s), if it lies in the duration.

        Raises:
            ValueError: it does not.
        """
        if not 0.0 <= time <= self.duration:
            raise ValueError(f"time must lie in the {self.duration:g} s of this motion, got {time:g} s")
        return time
