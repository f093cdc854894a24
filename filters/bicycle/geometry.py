"""Anthropometry of a rider and geometry of a bicycle, and how filters are configured with them.

The frame is the bicycle's: origin on the ground under the rear hub of the upright bicycle, x forward, y left, z up. The
trunk's frame has its origin in the lumbar joint and z up the trunk. The right side mirrors the left (y changes sign).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Self

from ..core.model import Equations
from ..support.parameters import check_positive
from ..support.ranges import Checked

Point = tuple[float, float, float]
GEOMETRY_STD = "geometry_std"
"""Key of the metadata: how exactly ``geometry`` was measured, the fields of :class:`TapeMeasure`"""
ARM_MASS = 0.0494
"""Mass of an arm with its hand, share of the rider's (P. de Leva, J. Biomechanics 29(9), 1996, table 4, men)."""


@dataclass(frozen=True)
class RiderGeometry:
    """Lengths in m, masses in kg, angles in rad. The defaults are a person of 1.76 m and 68 kg on the mountain bike.

    Raises:
        ValueError: a number that is not finite, a length or mass that is not positive, or a ``steer_axis`` that is not
            a unit vector.
    """

    wheelbase: float = 1.05
    saddle: Point = (0.2593, 0.0, 0.8825)
    """point where post and saddle meet"""
    trunk_pivot: Point = (0.2593, 0.0, 1.037)
    """lumbar joint, about which the trunk rotates"""
    trunk_flexion: float = 0.5847
    """usual forward lean of the trunk relative to the upright direction of the bicycle"""
    shoulder: Point = (0.0, 0.1896, 0.4287)
    """left shoulder joint, trunk frame"""
    hip: Point = (0.2593, 0.0859, 0.9634)
    """left hip joint"""
    grip: Point = (0.79, 0.27, 1.04)
    """position of the left hand at zero steer"""
    steer_origin: Point = (0.8761, 0.0, 0.72)
    """a point of the steering axis"""
    steer_axis: Point = (-0.309017, 0.0, 0.951057)
    """unit vector, upwards"""
    crank_axle: Point = (0.426, 0.0, 0.28)
    crank_length: float = 0.17
    pedal_offset: float = 0.12
    """of a foot from the mid-plane"""
    upper_arm: float = 0.2848
    forearm: float = 0.2718
    """elbow to grip"""
    thigh: float = 0.4268
    shank: float = 0.4387
    """knee to ankle"""
    ankle_to_pedal: float = 0.1516
    ankle_angle: float = math.radians(80.0)
    """exterior: 0 with the foot in line with the shank"""
    trunk_mass: float = 26.6764
    """of the parts that rotate about the lumbar joint, without the arms: trunk above it and head"""
    trunk_centre: Point = (0.0053, 0.0, 0.3648)
    """its centre of mass, trunk frame"""
    trunk_moments: Point = (1.0733, 0.9346, 0.2787)
    """its moments of inertia about the centre, trunk axes, kg·m²"""
    rider_mass: float = 68.0
    bicycle_imu: Point = (0.37, 0.0, 0.71)
    bicycle_imu_tilt: float = math.radians(10.0)
    """nose up"""
    trunk_imu: Point = (-0.1011, 0.0, 0.2729)
    """trunk frame"""
    wheel_radius: float = 0.335
    """rolling radius of the rear wheel"""
    post_length: float = 0.13
    """from the saddle down the post to the six-axis sensor"""
    post_tilt: float = math.radians(20.0)
    """backwards"""
    cells_long: float = 0.20
    """from the rear load cells to the front one"""
    cells_wide: float = 0.12
    """between the rear ones"""
    cells_behind: float = 0.043
    """from the rear ones forward to the saddle point"""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            numbers = value if isinstance(value, tuple) else (value,)
            if isinstance(field.default, float) and isinstance(value, tuple):
                raise ValueError(f"{field.name} must be a number, got {value}")
            if not all(math.isfinite(number) for number in numbers):
                raise ValueError(f"{field.name} must be finite, got {value}")
            if isinstance(field.default, tuple) and len(numbers) != 3:
                raise ValueError(f"{field.name} must be a point of three numbers, got {value}")
            if field.name in POSITIVE and not value > 0.0:
                raise ValueError(f"{field.name} must be positive, got {value}")
        if abs(math.hypot(*self.steer_axis) - 1.0) > 1e-3:
            raise ValueError(f"steer_axis must have length 1, got {self.steer_axis}")

    @property
    def knee_to_pedal(self) -> float:
        """Distance from knee to pedal with a fixed ankle (whole-body paper: l_sp)."""
        a, b = self.shank, self.ankle_to_pedal
        return math.sqrt(a * a + b * b + 2.0 * a * b * math.cos(self.ankle_angle))

    def describe(self) -> dict[str, Any]:
        """All numbers, for JSON; the inverse is :meth:`read`."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}

    @classmethod
    def of(cls, metadata: Mapping[str, Any]) -> Self:
        """The geometry in a recording's metadata; the default person if there is none.

        Raises:
            ValueError: the metadata contain an invalid geometry.
        """
        described = metadata.get("geometry")
        return cls() if described is None else cls.read(described)

    @classmethod
    def read(cls, described: Mapping[str, Any]) -> Self:
        """From what :meth:`describe` gave (``trajectory.metadata["geometry"]``).

        Raises:
            ValueError: an unknown name, or a value that the constructor rejects.
        """
        known = {field.name for field in fields(cls)}
        unknown = sorted(set(described) - known)
        if unknown:
            raise ValueError(f"unknown geometry {unknown}; accepted are {sorted(known)}")
        values: dict[str, Any] = {
            name: tuple(map(float, value)) if isinstance(value, list | tuple) else float(value)
            for name, value in described.items()
        }
        return cls(**values)


POSITIVE = frozenset(
    [
        "wheelbase",
        "crank_length",
        "upper_arm",
        "forearm",
        "thigh",
        "shank",
        "ankle_to_pedal",
        "trunk_mass",
        "rider_mass",
        "wheel_radius",
        "post_length",
        "cells_long",
        "cells_wide",
    ]
)
"""Fields that must be positive."""


@dataclass(frozen=True)
class TapeMeasure(Checked):
    """Standard deviations with which a rider's geometry is measured; all zero where it is exact.

    Raises:
        ValueError: one is negative or not finite.
    """

    lengths: float = 0.02
    """of each segment's length, relative"""
    places: float = 0.01
    """of each coordinate of a joint or sensor on the body, m"""
    mass: float = 0.03
    """of the trunk's mass, relative"""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_positive(self, or_zero=("lengths", "places", "mass"))

    @classmethod
    def of(cls, metadata: Mapping[str, Any]) -> Self:
        """What a recording's metadata say (:data:`GEOMETRY_STD`); the defaults where they do not say.

        Raises:
            ValueError: the metadata contain something else.
        """
        described = metadata.get(GEOMETRY_STD)
        if described is None:
            return cls()
        known = [field.name for field in fields(cls)]
        if not isinstance(described, Mapping) or not set(described) <= set(known):
            raise ValueError(f"{GEOMETRY_STD} must map some of {known} to standard deviations, got {described}")
        return cls(**described)


class RiderEquations(Equations):
    """Equations that are configured with a rider's anthropometry and a bicycle's geometry."""

    @classmethod
    def rider_parameters(cls, geometry: RiderGeometry) -> dict[str, Any]:
        """The parameters that the geometry determines, by field: those of its names, and ``imu_tilt``, by default."""
        known = asdict(geometry) | {"imu_tilt": geometry.bicycle_imu_tilt}
        return {field.name: known[field.name] for field in fields(cls) if field.name in known}

    @classmethod
    def for_rider(cls, geometry: RiderGeometry, **parameters: Any) -> Self:
        """The equations for one rider and bicycle; ``parameters`` are other fields, and take precedence."""
        return cls(**(cls.rider_parameters(geometry) | parameters))

    @classmethod
    def parameters_from(cls, metadata: Mapping[str, Any]) -> dict[str, Any]:
        """The parameters that ``metadata["geometry"]`` of a recorded ride determines."""
        return {} if metadata.get("geometry") is None else cls.rider_parameters(RiderGeometry.of(metadata))
