"""Parameters of bicycles: geometry, masses and inertias, with units and source.

Positions are in the *bicycle frame* of the upright bicycle with straight steering: origin on the ground under the rear
hub, x forward, y left, z up. Inertias are matrix elements about the part's own centre of mass along these axes; a
bicycle is symmetric about its x-z plane, so (xx, yy, zz, xz) are complete.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from ....filters.support.parameters import check_positive

Vector3 = tuple[float, float, float]

AIR_DENSITY = 1.2
"""kg/m³"""


class Mass(NamedTuple):
    """A rigid body in some frame."""

    mass: float
    """kg"""
    centre: np.ndarray
    """(3,) m"""
    tensor: np.ndarray
    """(3, 3) kg·m² about the centre of mass"""


@dataclass(frozen=True)
class RigidPart:
    """A rigid body that is symmetric about the x-z plane.

    Raises:
        ValueError: an impossible mass or inertia.
    """

    mass: float
    """kg"""
    centre: Vector3
    """m: centre of mass"""
    inertia: tuple[float, float, float, float]
    """kg·m²: matrix elements xx, yy, zz, xz (= −∫ x z dm) about the centre of mass"""

    def __post_init__(self) -> None:
        check_positive(self, "mass")
        if not np.all(np.isfinite((*self.centre, *self.inertia))):
            raise ValueError(f"centre and inertia must be finite, got {self.centre} and {self.inertia}")
        moments = np.linalg.eigvalsh(self.tensor)
        if not (moments[0] > 0.0 and moments[2] <= (moments[0] + moments[1]) * (1.0 + 1e-9)):
            raise ValueError(
                f"inertia must have positive principal moments that obey the triangle inequality, got {moments} kg·m²"
            )

    @property
    def tensor(self) -> np.ndarray:
        """Inertia ``(3, 3)`` about the centre of mass, kg·m²."""
        xx, yy, zz, xz = self.inertia
        return np.array([[xx, 0.0, xz], [0.0, yy, 0.0], [xz, 0.0, zz]])

    @classmethod
    def of(cls, body: Mass) -> Self:
        """A body as one that is symmetric about the x-z plane."""
        (x, _, z), tensor = body.centre.tolist(), body.tensor
        inertia = (float(tensor[0, 0]), float(tensor[1, 1]), float(tensor[2, 2]), float(tensor[0, 2]))
        return cls(float(body.mass), (x, 0.0, z), inertia)


@dataclass(frozen=True)
class WheelParameters:
    """A wheel with its tyre, thin and balanced.

    Raises:
        ValueError: a length, mass or inertia that is not positive, or a crown as large as the wheel.
    """

    radius: float
    """m, to the tread of the unloaded tyre"""
    mass: float
    """kg"""
    inertia_axle: float
    """kg·m² about the axle"""
    inertia_diameter: float
    """kg·m² about a diameter"""
    crown_radius: float = 0.0
    """m: radius of the tyre's cross-section; 0 for a knife edge"""

    def __post_init__(self) -> None:
        check_positive(self, "radius", "mass", "inertia_axle", "inertia_diameter")
        if not 0.0 <= self.crown_radius < 0.5 * self.radius:
            raise ValueError(f"crown_radius must lie in [0, radius / 2), got {self.crown_radius} m")


@dataclass(frozen=True)
class DriveParameters:
    """Crank, pedals, chain and freewheel."""

    axle: Vector3
    """m: bottom bracket"""
    crank_length: float
    """m, axle to pedal"""
    pedal_offset: float
    """m: pedals' distance from the x-z plane"""
    mass: float
    """kg: both cranks, chain ring and pedals"""
    inertia: Vector3
    """kg·m²: moments about the axle along x, y, z"""
    gears: tuple[float, ...] = (0.6, 0.8, 1.05, 1.4, 1.85, 2.4, 3.1)
    """revolutions of the rear wheel per revolution of the crank, rising"""
    chain_stiffness: float = 400.0
    """N·m/rad at the rear hub"""
    chain_damping: float = 8.0
    """N·m·s/rad at the rear hub"""

    def __post_init__(self) -> None:
        check_positive(self, "crank_length", "mass", "chain_stiffness")
        if not self.gears or self.gears[0] <= 0.0 or list(self.gears) != sorted(set(self.gears)):
            raise ValueError(f"gears must be positive and rise, got {self.gears}")


@dataclass(frozen=True)
class BicycleParameters:
    """A bicycle.

    Raises:
        ValueError: a length that is not positive, or a steering axis that is nearly horizontal.
    """

    name: str
    source: str
    """where the numbers come from"""
    wheelbase: float
    """m"""
    trail: float
    """m: distance of the front contact behind the point where the steering axis meets the ground"""
    steer_axis_tilt: float
    """rad: backward tilt of the steering axis from the vertical (90° − head angle)"""
    rear_wheel: WheelParameters
    front_wheel: WheelParameters
    rear_frame: RigidPart
    front_assembly: RigidPart
    """fork and handlebar"""
    drive: DriveParameters | None = None
    saddle: Vector3 = (0.25, 0.0, 0.95)
    """m: the point where rider and seat post exchange forces"""
    grip: Vector3 = (0.79, 0.27, 1.04)
    """m: left hand's point on the handlebar; the right one mirrors it"""
    drag_area: float = 0.0
    """m²: drag coefficient times frontal area of rider and bicycle"""
    rolling_resistance: float = 0.0
    """1: ratio of rolling drag to load"""

    def __post_init__(self) -> None:
        check_positive(self, "wheelbase")
        if not (math.isfinite(self.trail) and abs(self.steer_axis_tilt) < 1.2):
            raise ValueError(
                f"trail must be finite and steer_axis_tilt within ±1.2 rad, got {self.trail} m, {self.steer_axis_tilt}"
            )
        if not (self.drag_area >= 0.0 and self.rolling_resistance >= 0.0):
            raise ValueError("drag_area and rolling_resistance must not be negative")

    @property
    def steer_axis(self) -> np.ndarray:
        """Unit vector ``(3,)`` along the steering axis, upwards; a positive angle steers to the left."""
        return np.array([-math.sin(self.steer_axis_tilt), 0.0, math.cos(self.steer_axis_tilt)])

    @property
    def steer_origin(self) -> np.ndarray:
        """A point ``(3,)`` of the steering axis, at the height of the front assembly's centre of mass, m."""
        height = self.front_assembly.centre[2]
        return np.array([self.wheelbase + self.trail - height * math.tan(self.steer_axis_tilt), 0.0, height])

    @property
    def parts(self) -> tuple[RigidPart, ...]:
        """All bodies: rear frame, front assembly, wheels and crank."""
        parts = [self.rear_frame, self.front_assembly]
        for wheel, x in ((self.rear_wheel, 0.0), (self.front_wheel, self.wheelbase)):
            across, axle = wheel.inertia_diameter, wheel.inertia_axle
            parts.append(RigidPart(wheel.mass, (x, 0.0, wheel.radius), (across, axle, across, 0.0)))
        if self.drive is not None:
            parts.append(RigidPart(self.drive.mass, self.drive.axle, (*self.drive.inertia, 0.0)))
        return tuple(parts)

    def with_load(self, *load: RigidPart) -> BicycleParameters:
        """The same bicycle with further masses rigidly on its rear frame: the Whipple model of rider and bicycle."""
        extra = () if self.drive is None else (RigidPart(self.drive.mass, self.drive.axle, (*self.drive.inertia, 0.0)),)
        return replace(self, rear_frame=combine([self.rear_frame, *extra, *load]), drive=None)


def parallel_axes(mass: float, offset: np.ndarray) -> np.ndarray:
    """Moments of inertia ``(3, 3)``, kg·m², of a mass (kg) in one point about another, ``offset`` ``(3,)`` m away."""
    return np.asarray(mass * (offset @ offset * np.eye(3) - np.outer(offset, offset)))


def join(parts: Sequence[Mass]) -> Mass:
    """Several bodies as one."""
    mass = sum(part.mass for part in parts)
    centre = sum((part.mass * part.centre for part in parts), np.zeros(3)) / mass
    tensor = np.zeros((3, 3))
    for part in parts:
        tensor += part.tensor + parallel_axes(part.mass, part.centre - centre)
    return Mass(mass, centre, tensor)


def combine(parts: Sequence[RigidPart]) -> RigidPart:
    """One rigid body made of several, symmetric about the x-z plane as a whole."""
    return RigidPart.of(join([Mass(part.mass, np.array(part.centre), part.tensor) for part in parts]))


BENCHMARK = BicycleParameters(
    name="benchmark",
    source="J. P. Meijaard, J. M. Papadopoulos, A. Ruina, A. L. Schwab, Linearized dynamics equations for the balance "
    "and steer of a bicycle: a benchmark and review, Proc. R. Soc. A 463 (2007), table 1 (rider rigid in the rear "
    "frame); their axes are x forward, z down, so products of inertia change sign here",
    wheelbase=1.02,
    trail=0.08,
    steer_axis_tilt=math.pi / 10.0,
    rear_wheel=WheelParameters(radius=0.3, mass=2.0, inertia_axle=0.12, inertia_diameter=0.0603),
    front_wheel=WheelParameters(radius=0.35, mass=3.0, inertia_axle=0.28, inertia_diameter=0.1405),
    rear_frame=RigidPart(85.0, (0.3, 0.0, 0.9), (9.2, 11.0, 2.8, -2.4)),
    front_assembly=RigidPart(4.0, (0.9, 0.0, 0.7), (0.05892, 0.06, 0.00708, 0.00756)),
)

MOUNTAIN_BIKE = BicycleParameters(
    name="mountain-bike",
    source="Y. Zhang, K. Chen, J. Yi, Rider trunk and bicycle pose estimation with fusion of force/inertial sensors, "
    "IEEE Trans. Biomed. Eng. 60 (2013): total mass centre 0.45 m ahead of the rear contact and 0.66 m high, saddle "
    "0.26 m ahead (its height, printed 0.38 m, is taken as 0.88 m); the rest are round figures of this project for a "
    "26 inch mountain bike that carries 9 kg of instruments: 25 kg in all",
    wheelbase=1.05,
    trail=0.06,
    steer_axis_tilt=math.radians(18.0),
    rear_wheel=WheelParameters(0.335, 2.4, inertia_axle=0.17, inertia_diameter=0.086, crown_radius=0.02),
    front_wheel=WheelParameters(0.335, 2.0, inertia_axle=0.155, inertia_diameter=0.078, crown_radius=0.02),
    rear_frame=RigidPart(16.0, (0.357, 0.0, 0.776), (0.6, 1.4, 1.0, -0.1)),
    front_assembly=RigidPart(3.0, (0.92, 0.0, 0.72), (0.15, 0.13, 0.06, 0.01)),
    drive=DriveParameters((0.426, 0.0, 0.28), 0.17, 0.12, 1.6, (0.014, 0.017, 0.014)),
    saddle=(0.26, 0.0, 0.88),
    grip=(0.79, 0.27, 1.04),
    drag_area=0.5,
    rolling_resistance=0.006,
)
