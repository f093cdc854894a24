"""Geometry of rider and bicycle for the configuration of filters: exact, or with the errors of a tape measure."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ....filters.bicycle.geometry import Point, RiderGeometry, TapeMeasure
from ..ride.contact_forces import CELLS_BEHIND, CELLS_LONG, CELLS_WIDE
from ..rider.posture import ANKLE_ANGLE, ANKLE_TO_PEDAL, Posture
from .sites import BICYCLE_IMU_SITE, BICYCLE_IMU_TILT, POST_LENGTH, POST_TILT, SensorSites, sensor_sites

BODY_LENGTHS = ("upper_arm", "forearm", "thigh", "shank", "ankle_to_pedal")
BODY_PLACES = ("trunk_pivot", "shoulder", "hip", "trunk_imu")


def rider_geometry(posture: Posture, sites: SensorSites | None = None) -> RiderGeometry:
    """The geometry of a person fitted to a bicycle; sites (None: the papers') give the wheel's rolling radius."""
    sites = sensor_sites(posture) if sites is None else sites
    bicycle, body, trunk = posture.bicycle, posture.body, posture.trunk()
    drive = bicycle.drive
    assert drive is not None
    return RiderGeometry(
        wheelbase=bicycle.wheelbase,
        saddle=_point(bicycle.saddle),
        trunk_pivot=_point(posture.lumbar),
        trunk_flexion=posture.flexion,
        shoulder=_point(posture.shoulder),
        hip=_point(posture.hip),
        grip=_point(bicycle.grip),
        steer_origin=_point(bicycle.steer_origin),
        steer_axis=_point(bicycle.steer_axis),
        crank_axle=_point(drive.axle),
        crank_length=drive.crank_length,
        pedal_offset=drive.pedal_offset,
        upper_arm=posture.arm.upper,
        forearm=math.hypot(*posture.arm.tip),
        thigh=posture.leg.upper,
        shank=body.segment("shank").length,
        ankle_to_pedal=ANKLE_TO_PEDAL * body.scale,
        ankle_angle=ANKLE_ANGLE,
        trunk_mass=trunk.mass,
        trunk_centre=_point(trunk.centre),
        trunk_moments=_point(np.diag(trunk.tensor)),
        rider_mass=body.mass,
        bicycle_imu=BICYCLE_IMU_SITE,
        bicycle_imu_tilt=BICYCLE_IMU_TILT,
        trunk_imu=posture.trunk_imu,
        wheel_radius=sites.wheel_radius,
        post_length=POST_LENGTH,
        post_tilt=POST_TILT,
        cells_long=CELLS_LONG,
        cells_wide=CELLS_WIDE,
        cells_behind=CELLS_BEHIND,
    )


def measured(geometry: RiderGeometry, rng: np.random.Generator, tape: TapeMeasure | None = None) -> RiderGeometry:
    """The same, as measured with a tape measure and a table of segment masses.

    Args:
        geometry: the true one.
        rng: draws the errors.
        tape: their standard deviations; None: the usual ones (2 % and 1 cm, as in the whole-body study).
    """
    tape = TapeMeasure() if tape is None else tape
    changed: dict[str, float | Point] = {
        name: getattr(geometry, name) * (1.0 + tape.lengths * float(rng.standard_normal())) for name in BODY_LENGTHS
    }
    for name in BODY_PLACES:
        changed[name] = _point(np.array(getattr(geometry, name)) + tape.places * rng.standard_normal(3))
    changed["trunk_mass"] = geometry.trunk_mass * (1.0 + tape.mass * float(rng.standard_normal()))
    return replace(geometry, **changed)  # type: ignore[arg-type]


def _point(values: np.ndarray | tuple[float, ...]) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z
