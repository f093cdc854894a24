"""Linear theory of a bicycle that rolls upright at constant speed: the Whipple-Carvallo model.

M q̈ + v C1 q̇ + (g K0 + v² K2) q = f with q = (roll, steer), roll to the right and steer to the *right* positive, and
f = (roll moment, steer torque), as in J. P. Meijaard, J. M. Papadopoulos, A. Ruina, A. L. Schwab, Linearized dynamics
equations for the balance and steer of a bicycle, Proc. R. Soc. A 463 (2007), appendix A. Elsewhere in this package a
positive steering angle is to the left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ....filters.core.quantity import STANDARD_GRAVITY
from .parameters import BicycleParameters


@dataclass(frozen=True)
class WhippleModel:
    """The four matrices ``(2, 2)`` over (roll, steer), and gravity in m/s²."""

    M: np.ndarray
    C1: np.ndarray
    K0: np.ndarray
    K2: np.ndarray
    gravity: float = STANDARD_GRAVITY

    def stiffness(self, speed: float) -> np.ndarray:
        """Matrix g K0 + v² K2 ``(2, 2)``, N·m/rad."""
        return self.gravity * self.K0 + speed**2 * self.K2

    def state_matrix(self, speed: float) -> np.ndarray:
        """Matrix ``(4, 4)`` of the first-order system over (roll, steer, roll rate, steer rate)."""
        matrix = np.zeros((4, 4))
        matrix[:2, 2:] = np.eye(2)
        matrix[2:, :2] = -np.linalg.solve(self.M, self.stiffness(speed))
        matrix[2:, 2:] = -np.linalg.solve(self.M, speed * self.C1)
        return matrix

    def input_matrix(self) -> np.ndarray:
        """Matrix ``(4, 2)`` from (roll moment, steer torque) to the state's derivative."""
        return np.vstack([np.zeros((2, 2)), np.linalg.inv(self.M)])

    def eigenvalues(self, speed: float) -> np.ndarray:
        """Eigenvalues ``(4,)`` complex, 1/s, by falling real part."""
        values = np.linalg.eigvals(self.state_matrix(speed)).astype(complex)
        return values[np.argsort(-values.real)]

    def steady_turn(self, speed: float, steer: float) -> tuple[float, float]:
        """Roll angle (rad) and steer torque (N·m) that hold a small steering angle, all to the right positive."""
        stiffness = self.stiffness(speed)
        roll = -stiffness[0, 1] * steer / stiffness[0, 0]
        return float(roll), float(stiffness[1] @ (roll, steer))


def whipple_model(bicycle: BicycleParameters, gravity: float = STANDARD_GRAVITY) -> WhippleModel:
    """The linear model of a bicycle with knife-edge wheels; a crank counts as part of the rear frame.

    Raises:
        ValueError: gravity is not positive.
    """
    if not gravity > 0.0:
        raise ValueError(f"gravity must be positive (m/s²), got {gravity}")
    bicycle = bicycle.with_load()
    w, c, tilt = bicycle.wheelbase, bicycle.trail, bicycle.steer_axis_tilt
    sin, cos = math.sin(tilt), math.cos(tilt)
    R, F, B, H = bicycle.rear_wheel, bicycle.front_wheel, bicycle.rear_frame, bicycle.front_assembly
    # the paper's z axis points down
    (xB, _, zB), (xH, _, zH) = B.centre, H.centre
    zB, zH = -zB, -zH
    IBxx, _, IBzz, IBxz = B.inertia
    IHxx, _, IHzz, IHxz = H.inertia
    IBxz, IHxz = -IBxz, -IHxz

    # total system: mass, centre of mass, inertia about the rear contact
    mT = R.mass + B.mass + H.mass + F.mass
    xT = (xB * B.mass + xH * H.mass + w * F.mass) / mT
    zT = (-R.radius * R.mass + zB * B.mass + zH * H.mass - F.radius * F.mass) / mT
    ITxx = (
        R.inertia_diameter + IBxx + IHxx + F.inertia_diameter
        + R.mass * R.radius**2 + B.mass * zB**2 + H.mass * zH**2 + F.mass * F.radius**2
    )  # fmt: skip
    ITxz = IBxz + IHxz - B.mass * xB * zB - H.mass * xH * zH + F.mass * w * F.radius
    ITzz = (
        R.inertia_diameter + IBzz + IHzz + F.inertia_diameter + B.mass * xB**2 + H.mass * xH**2 + F.mass * w**2
    )  # fmt: skip

    # front assembly (fork and wheel): the same about its own centre
    mA = H.mass + F.mass
    xA = (xH * H.mass + w * F.mass) / mA
    zA = (zH * H.mass - F.radius * F.mass) / mA
    IAxx = IHxx + F.inertia_diameter + H.mass * (zH - zA) ** 2 + F.mass * (F.radius + zA) ** 2
    IAxz = IHxz - H.mass * (xH - xA) * (zH - zA) + F.mass * (w - xA) * (F.radius + zA)
    IAzz = IHzz + F.inertia_diameter + H.mass * (xH - xA) ** 2 + F.mass * (w - xA) ** 2
    # its centre's distance ahead of the steering axis; inertia about that axis, and products with x and z
    uA = (xA - w - c) * cos - zA * sin
    IAll = mA * uA**2 + IAxx * sin**2 + 2.0 * IAxz * sin * cos + IAzz * cos**2
    IAlx = -mA * uA * zA + IAxx * sin + IAxz * cos
    IAlz = mA * uA * xA + IAxz * sin + IAzz * cos

    # ratio of mechanical trail to wheelbase; spin angular momentum per speed of the wheels; static moment
    mu = c / w * cos
    SR, SF = R.inertia_axle / R.radius, F.inertia_axle / F.radius
    ST = SR + SF
    SA = mA * uA + mu * mT * xT

    # mass matrix, and stiffness by gravity and by speed squared, in (roll, steer)
    M = np.array([[ITxx, IAlx + mu * ITxz], [IAlx + mu * ITxz, IAll + 2.0 * mu * IAlz + mu**2 * ITzz]])
    K0 = np.array([[mT * zT, -SA], [-SA, -SA * sin]])
    K2 = np.array([[0.0, (ST - mT * zT) / w * cos], [0.0, (SA + SF * sin) / w * cos]])
    # damping by speed: gyroscopic moments and lateral acceleration of the contacts
    C1 = np.array(
        [
            [0.0, mu * ST + SF * cos + ITxz / w * cos - mu * mT * zT],
            [-(mu * ST + SF * cos), IAlz / w * cos + mu * (SA + ITzz / w * cos)],
        ]
    )
    return WhippleModel(M, C1, K0, K2, gravity)
