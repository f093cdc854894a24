"""Bicycles by name: measured ones with published numbers, and heavy ones with round figures.

The measured ones are those of J. K. Moore, M. Hubbard, A. L. Schwab, J. D. G. Kooijman, Accurate measurement of bicycle
parameters, Proc. Bicycle and Motorcycle Dynamics (2010), as distributed with the Python package BicycleParameters;
there z points down, so products of inertia change sign here. What they do not give is a round figure of this project:
bottom bracket, crank and gears, saddle, grips, tyres and resistances.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .parameters import (
    BENCHMARK,
    MOUNTAIN_BIKE,
    BicycleParameters,
    DriveParameters,
    RigidPart,
    WheelParameters,
    parallel_axes,
)

MEASURED = "Moore et al. 2010 ({0}); contact points of the rider, crank, gears, tyres and resistances are round figures"


def without(part: RigidPart, drive: DriveParameters) -> RigidPart:
    """A rear frame without the crank that was weighed with it."""
    mass = part.mass - drive.mass
    centre = (part.mass * np.array(part.centre) - drive.mass * np.array(drive.axle)) / mass
    tensor = part.tensor - np.diag(drive.inertia)
    for weight, place in ((-drive.mass, np.array(drive.axle)), (-mass, centre)):
        tensor += parallel_axes(weight, place - np.array(part.centre))
    x, y, z = centre.tolist()
    xx, yy, zz, xz = (float(tensor[place]) for place in ((0, 0), (1, 1), (2, 2), (0, 2)))
    # a flat frame has yy = xx + zz; errors of measurement must not exceed it
    return RigidPart(mass, (x, y, z), (xx, min(yy, xx + zz), zz, xz))


CITY_DRIVE = DriveParameters(
    (0.46, 0.0, 0.29), 0.17, 0.12, 1.3, (0.011, 0.014, 0.011), (0.7, 0.9, 1.15, 1.5, 1.95, 2.5)
)
CITY_BIKE = BicycleParameters(
    name="city-bike",
    source=MEASURED.format("Batavus Browser, a Dutch city bicycle")
    + "; the rear frame's moment about y, 1.3164 kg·m², is lowered to what a rigid body can have",
    wheelbase=1.121,
    trail=0.0686,
    steer_axis_tilt=0.39968,
    rear_wheel=WheelParameters(0.341, 3.1, inertia_axle=0.1524, inertia_diameter=0.0904, crown_radius=0.018),
    front_wheel=WheelParameters(0.344, 2.0, inertia_axle=0.1492, inertia_diameter=0.0884, crown_radius=0.018),
    rear_frame=without(RigidPart(9.9, (0.274, 0.0, 0.538), (0.5296, 1.28, 0.7568, 0.1163)), CITY_DRIVE),
    front_assembly=RigidPart(3.2, (0.867, 0.0, 0.748), (0.2534, 0.2458, 0.0956, 0.0720)),
    drive=CITY_DRIVE,
    saddle=(0.22, 0.0, 0.90),
    grip=(0.70, 0.29, 1.10),
    drag_area=0.6,
    rolling_resistance=0.007,
)

RACING_DRIVE = DriveParameters(
    (0.40, 0.0, 0.275), 0.17, 0.11, 0.9, (0.008, 0.010, 0.008), (0.9, 1.15, 1.45, 1.8, 2.2, 2.7, 3.3, 4.0)
)
RACING_BIKE = BicycleParameters(
    name="racing-bike",
    source=MEASURED.format("Bianchi Pista, a track bicycle; with gears and road tyres"),
    wheelbase=0.989,
    trail=0.062,
    steer_axis_tilt=0.27576,
    rear_wheel=WheelParameters(0.332, 1.4, inertia_axle=0.0764, inertia_diameter=0.0552, crown_radius=0.0125),
    front_wheel=WheelParameters(0.334, 1.6, inertia_axle=0.1062, inertia_diameter=0.0553, crown_radius=0.0125),
    rear_frame=without(RigidPart(4.5, (0.383, 0.0, 0.477), (0.2900, 0.4758, 0.2494, -0.0502)), RACING_DRIVE),
    front_assembly=RigidPart(2.3, (0.906, 0.0, 0.733), (0.0980, 0.0692, 0.0396, 0.0044)),
    drive=RACING_DRIVE,
    saddle=(0.22, 0.0, 0.88),
    grip=(0.82, 0.21, 0.96),
    drag_area=0.38,
    rolling_resistance=0.004,
)

TRAIL_DRIVE = replace(RACING_DRIVE, axle=(0.43, 0.0, 0.30), mass=1.0, gears=(0.55, 0.75, 1.0, 1.3, 1.7, 2.2, 2.9))
TRAIL_BIKE = BicycleParameters(
    name="trail-bike",
    source=MEASURED.format("Gary Fisher, a light mountain bicycle"),
    wheelbase=1.07,
    trail=0.072,
    steer_axis_tilt=0.32987,
    rear_wheel=WheelParameters(0.339, 1.9, inertia_axle=0.1008, inertia_diameter=0.0630, crown_radius=0.024),
    front_wheel=WheelParameters(0.330, 1.5, inertia_axle=0.1062, inertia_diameter=0.0631, crown_radius=0.024),
    rear_frame=without(RigidPart(4.5, (0.367, 0.0, 0.499), (0.2825, 0.4697, 0.2677, -0.0559)), TRAIL_DRIVE),
    front_assembly=RigidPart(2.5, (0.960, 0.0, 0.719), (0.1147, 0.1000, 0.0226, 0.0182)),
    drive=TRAIL_DRIVE,
    saddle=(0.26, 0.0, 0.90),
    grip=(0.80, 0.30, 1.02),
    drag_area=0.5,
    rolling_resistance=0.008,
)

CARGO_BIKE = replace(
    CITY_BIKE,
    name="cargo-bike",
    source="round figures of this project for an electric long-tail bicycle: geometry of the city bicycle with a "
    "longer wheelbase; motor in the rear hub, battery and 20 kg of luggage on the rear rack",
    wheelbase=1.25,
    rear_wheel=WheelParameters(0.305, 5.5, inertia_axle=0.20, inertia_diameter=0.11, crown_radius=0.026),
    front_wheel=WheelParameters(0.305, 2.3, inertia_axle=0.15, inertia_diameter=0.08, crown_radius=0.026),
    rear_frame=RigidPart(42.0, (0.22, 0.0, 0.60), (2.1, 4.4, 3.2, 0.2)),
    front_assembly=RigidPart(3.8, (1.00, 0.0, 0.72), (0.27, 0.26, 0.10, 0.07)),
    drive=replace(CITY_DRIVE, axle=(0.58, 0.0, 0.28)),
    saddle=(0.35, 0.0, 0.89),
    grip=(0.83, 0.29, 1.08),
    drag_area=0.65,
    rolling_resistance=0.008,
)

BICYCLES = {
    bicycle.name: bicycle for bicycle in (BENCHMARK, MOUNTAIN_BIKE, CITY_BIKE, RACING_BIKE, TRAIL_BIKE, CARGO_BIKE)
}
"""The bicycles by name; the benchmark has no pedals."""
