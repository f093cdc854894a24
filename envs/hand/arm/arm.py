"""Properties of an arm that pulls a device along a gesture, and of a table that may be in the way."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ....filters.support.parameters import check_positive
from ....filters.support.ranges import Checked


@dataclass(frozen=True)
class Arm(Checked):
    """Hand, wrist and arm as one mass on damped springs between the motion that is meant and the one that happens.

    Three paths act on the device: a learned command that foresees ``anticipation`` of the inertial force and the whole
    weight; the muscles' own stiffness and damping, at once; and reflexes of ``reflex`` times that strength, after
    ``delay``. Signal-dependent noise is proportional to the command.

    Orders of magnitude: stiffness of the hand on a relaxed to moderately active arm 100 to 800 N/m (F. A. Mussa-Ivaldi,
    N. Hogan, E. Bizzi, J. Neuroscience 5, 1985), damping ratio of the arm 0.2 to 0.5 (E. J. Perreault, R. F. Kirsch,
    P. E. Crago, Exp. Brain Res. 157, 2004), force noise of 2 to 5 % of the force (K. E. Jones, A. F. C. Hamilton,
    D. M. Wolpert, J. Neurophysiology 88, 2002), reflex delays of 30 to 60 ms. The rest is our choice.

    Attributes:
        hand_mass: of the hand and of what moves with it, kg.
        hand_radius: of gyration of that mass, m.
        stiffness: N/m.
        wrist_stiffness: N·m/rad.
        damping: ratio of both.
        anticipation: share of the inertial force that the command foresees.
        reflex: strength of the delayed feedback relative to the muscles' own.
        delay: of the reflexes, s.
        noise: standard deviation of force and torque relative to the command.
        grip: lever of the force that makes torque noise, m.
        table: the top of the table lies this much below the centre of the device at the start, m (lower, if the device
            would touch it there); None: no table.
        table_stiffness: at each corner of the device, N/m.
        table_damping: ratio, of the device and hand on one corner.
        friction: coefficient between device and table.
    """

    hand_mass: float = 0.4
    hand_radius: float = 0.05
    stiffness: float = 300.0
    wrist_stiffness: float = 3.0
    damping: float = 0.4
    anticipation: float = 0.8
    reflex: float = 0.3
    delay: float = 0.05
    noise: float = 0.03
    grip: float = 0.05
    table: float | None = 0.25
    table_stiffness: float = 3e4
    table_damping: float = 0.2
    friction: float = 0.4

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, "hand_mass", "hand_radius", "stiffness", "wrist_stiffness", "delay", "table_stiffness")
        shares = ("damping", "anticipation", "reflex", "noise", "table_damping", "friction")
        check_positive(self, or_zero=(*shares, "grip"))
        if self.table is not None and not 0.0 < self.table < math.inf:
            raise ValueError(f"table must be metres below the device, above 0, or None, got {self.table}")

    def parameters(
        self, mass: float, inertia: tuple[float, float, float], factor: float, gravity: float, table: float
    ) -> np.ndarray:
        """What :func:`.pulled` needs.

        Args:
            mass: of the device as the arm knows it, kg.
            inertia: its moments about the body axes, kg·m².
            factor: of true mass and moments.
            gravity: m/s².
            table: height of the table, m; −inf for none.
        """
        hand = self.hand_mass * self.hand_radius**2
        known, true = mass + self.hand_mass, factor * mass + self.hand_mass
        moments = [factor * each + hand for each in inertia]
        # one number for all axes: the spring of the wrist does not know the axes of the device
        twist = sum(inertia) / 3.0 + hand
        damper, wrist_damper = (
            2.0 * self.damping * math.sqrt(spring * load)
            for spring, load in ((self.stiffness, known), (self.wrist_stiffness, twist))
        )
        return np.array(
            [
                *(known, true, *moments, *(each + hand for each in inertia)),
                *(self.stiffness, damper, self.wrist_stiffness, wrist_damper),
                *(self.anticipation, self.reflex, self.noise / math.sqrt(3.0), self.grip, gravity),
                *(table, self.table_stiffness),
                *(2.0 * self.table_damping * math.sqrt(self.table_stiffness * known), self.friction),
            ]
        )
