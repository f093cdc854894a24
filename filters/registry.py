"""Every estimator of this floor by name: what it is called, what it reads and gives, how it is made.

The table holds texts only, so listing it imports nothing; modules (and packages that are wrapped) are loaded when an
estimator is made.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from .core.estimator import Estimator
from .support.names import look_up

SIX = ("imu/gyr", "imu/acc")
NINE = (*SIX, "imu/mag")
PLANAR = ("planar/gyr", "array/acc")
RELATIVE = ("up", "relative_orientation")
TWO_GYRO = ("bicycle_imu/gyr", "trunk_imu/gyr", "relative/orientation")
TWO_GYRO_ANGLES = ("bicycle/roll", "two-gyro/relative_angles")
FORCE_INERTIAL = (
    *("bicycle_imu/gyr", "bicycle_imu/acc", "trunk_imu/gyr", "trunk_imu/acc"),
    *("seat/wrench", "seat/load_cells", "handlebar/force", "wheel/speed"),
)
FORCE_INERTIAL_ANGLES = ("bicycle/roll", "force-inertial/trunk_angles")
LIMBS = tuple(f"{part}_{side}" for part in ("upper_arm", "thigh") for side in ("right", "left"))
WHOLE_BODY = (
    *(f"{place}/gyr" for place in ("bicycle_imu", "trunk_imu", *LIMBS)),
    *("bicycle_imu/acc", "trunk_imu/acc", "seat/load_cells", "wheel/speed", "steer/angle", "crank/angle"),
)
WHOLE_BODY_ANGLES = (
    "bicycle/roll",
    "trunk/angles",
    *(f"{joint}_{side}/angles" for side in ("right", "left") for joint in ("shoulder", "hip")),
    *(f"{joint}_{side}/flexion" for side in ("right", "left") for joint in ("elbow", "knee")),
)
WORLD = ("orientation", "up")
ARRAY_ORIENTATION = (*WORLD, "angular_rate", "external_acceleration", "virtual_position")


@dataclass(frozen=True)
class Entry:
    """One estimator.

    Attributes:
        factory: ``module:class`` in this package; a model, a recurrence or an estimator.
        kind: ``filter`` (published or ours), ``reference`` (what everybody knows), ``external`` (another package's).
        description: one line.
        channels: names of what it reads.
        outputs: names of what it gives.
        recursion: what runs the equations: ``KalmanFilter``, ``Observer``, or None for what is an estimator itself.
        fixed: parameters that the name stands for; they cannot be given.
    """

    factory: str
    kind: Literal["filter", "reference", "external"]
    description: str
    channels: tuple[str, ...]
    outputs: tuple[str, ...]
    recursion: Literal["KalmanFilter", "Observer"] | None = None
    fixed: Mapping[str, Any] = field(default_factory=dict)

    def load(self) -> type:
        """The class of the equations or of the estimator."""
        module, name = self.factory.split(":")
        return getattr(importlib.import_module(f".{module}", __package__), name)


def _filter(factory: str, description: str, channels: tuple[str, ...], outputs: tuple[str, ...]) -> Entry:
    return Entry(factory, "filter", description, channels, outputs, "KalmanFilter")


def _reference(factory: str, description: str, channels: tuple[str, ...], outputs: tuple[str, ...]) -> Entry:
    return Entry(factory, "reference", description, channels, outputs, "Observer")


def _external(factory: str, axes: int, description: str, bias: bool) -> Entry:
    outputs = (WORLD if axes == 9 else RELATIVE) + (("gyroscope_bias",) if bias else ())
    return Entry(factory, "external", description, NINE[: axes // 3], outputs, None, {"axes": axes})


CATALOGUE: dict[str, Entry] = {
    "external-acceleration": _filter(
        "imu.external_acceleration:ExternalAcceleration",
        "Lee, Park, Robinovitch 2012: vertical and external acceleration; mode=1, 2 or 3",
        SIX,
        ("up", "external_acceleration"),
    ),
    "mekf": _filter(
        "imu.mekf:MEKF", "multiplicative extended Kalman filter with gyroscope bias", SIX, (*RELATIVE, "gyroscope_bias")
    ),
    "mekf-9": _filter(
        "imu.mekf:MEKF9", "the same with the heading of a magnetometer", NINE, (*WORLD, "gyroscope_bias")
    ),
    "bounded-motion": _filter(
        "imu.bounded_motion:BoundedMotion",
        "accelerates, but does not go anywhere: velocity near zero as pseudo-measurement",
        SIX,
        (*RELATIVE, "gyroscope_bias", "external_acceleration"),
    ),
    "bounded-motion-9": _filter(
        "imu.bounded_motion:BoundedMotion9",
        "the same with the heading of a magnetometer",
        NINE,
        (*WORLD, "gyroscope_bias", "external_acceleration"),
    ),
    "array-orientation": _filter(
        "arrays.spatial.orientation:ArrayOrientation",
        'He: orientation from an accelerometer array; array="controller", "octa" or your own',
        ("imu/gyr", "array/acc", "imu/mag"),
        ARRAY_ORIENTATION,
    ),
    "array-orientation-imu": Entry(
        "arrays.spatial.orientation:ArrayOrientation",
        "filter",
        "the same with the accelerometer of one IMU",
        NINE,
        ARRAY_ORIENTATION,
        "KalmanFilter",
        {"array": "triaxial"},
    ),
    "array-rate": Entry(
        "arrays.rate:ArrayRate",
        "filter",
        "He: angular rate from twelve accelerometers; method=weighted, time-integration, polynomial-roots or parsa",
        ("array/acc",),
        ("angular_rate", "angular_rate_covariance", "array-rate/weights"),
        "Observer",
    ),
    "planar-orientation": _filter(
        "arrays.planar.orientation:PlanarOrientation",
        "He: angle in a vertical plane; method=extended (on the specific force) or linear (on the tilt angle)",
        PLANAR,
        ("planar/angle",),
    ),
    "planar-pose": _filter(
        "arrays.planar.pose:PlanarPose",
        "He: complete pose in a vertical plane, from accelerometers alone",
        PLANAR[1:],
        ("planar/angle", "planar/angular_rate"),
    ),
    "planar-unscented": Entry(
        "arrays.planar.unscented:PlanarUnscented",
        "filter",
        "He: angle in a vertical plane by the unscented filter of the package filterpy",
        PLANAR,
        ("planar/angle",),
    ),
    "planar-mean": Entry(
        "arrays.planar.mean:PlanarMean",
        "filter",
        "He: angle in a vertical plane; method=weighted mean of the other two, integration or tilt",
        PLANAR,
        ("planar/angle",),
        "Observer",
    ),
    "marins": _filter(
        "imu.marins:Marins",
        "Marins et al. 2001: quaternion by Gauss-Newton, then a Kalman filter",
        NINE,
        (*WORLD, "angular_rate"),
    ),
    "two-gyro": _filter(
        "bicycle.two_gyro.filter:TwoGyro",
        "Zhang et al.: roll of a bicycle, attitude of the trunk; two gyroscopes and a camera; model=sigma1 or sigma2",
        TWO_GYRO,
        (*TWO_GYRO_ANGLES, "two-gyro/body_up", "trunk_imu/gyroscope_bias", "two-gyro/platform_bias"),
    ),
    "two-gyro-integration": _reference(
        "bicycle.platform_gyro:TwoGyroIntegration",
        "both gyroscopes integrated, nothing else",
        TWO_GYRO,
        TWO_GYRO_ANGLES,
    ),
    "platform-gyro": Entry(
        "bicycle.platform_gyro:PlatformGyro",
        "reference",
        "roll from the bicycle's gyroscope alone: pitch rate near zero as pseudo-measurement",
        TWO_GYRO[:1],
        ("bicycle/roll", "platform-gyro/bias"),
        "KalmanFilter",
    ),
    "force-inertial": _filter(
        "bicycle.force_inertial.filter:ForceInertial",
        "Zhang, Chen, Yi 2013: roll of a bicycle, angles of the trunk; two IMUs, forces at seat and handlebar",
        FORCE_INERTIAL,
        (*FORCE_INERTIAL_ANGLES, "trunk_imu/gyroscope_bias"),
    ),
    "force-inertial-integration": _reference(
        "bicycle.force_inertial.integration:ForceInertialIntegration",
        "the same gyroscopes integrated from the angles that the first forces tell",
        FORCE_INERTIAL,
        FORCE_INERTIAL_ANGLES,
    ),
    "whole-body": _filter(
        "bicycle.whole_body.filter:WholeBody",
        "Zhang et al. 2016: a rider's trunk, arms and legs from six gyroscopes and what hands and feet hold",
        WHOLE_BODY,
        WHOLE_BODY_ANGLES,
    ),
    "whole-body-integration": _reference(
        "bicycle.whole_body.integration:WholeBodyIntegration",
        "the same gyroscopes integrated, nothing else",
        WHOLE_BODY,
        WHOLE_BODY_ANGLES,
    ),
    "odometry-aided": _filter(
        "bicycle.odometry_aided:OdometryAided",
        "roll and pitch of a bicycle from its IMU and the wheel's speed: the wheel rolls and does not slide",
        ("bicycle_imu/gyr", "bicycle_imu/acc", "wheel/speed"),
        ("bicycle/roll", "bicycle/pitch", "bicycle_imu/gyroscope_bias"),
    ),
    "gyroscope-integration": _reference(
        "imu.classical:GyroscopeIntegration", "gyroscope alone, from the first inclination", SIX, RELATIVE
    ),
    "tilt": _reference("imu.classical:Tilt", "accelerometer alone, sample by sample", ("imu/acc",), ("up",)),
    "mahony": _reference(
        "imu.classical:Mahony", "Mahony, Hamel, Pflimlin 2008, published gains", SIX, (*RELATIVE, "gyroscope_bias")
    ),
    "mahony-9": _reference("imu.classical:Mahony9", "the same with a magnetometer", NINE, (*WORLD, "gyroscope_bias")),
    "vqf": _external("external.packages:VQF", 6, "VQF, Laidig and Seel 2023, causal form (package vqf)", True),
    "vqf-9": _external("external.packages:VQF", 9, "the same with a magnetometer (package vqf)", True),
    "imufusion": _external("external.packages:IMUFusion", 6, "Fusion of x-io Technologies (package imufusion)", False),
    "imufusion-9": _external(
        "external.packages:IMUFusion", 9, "the same with a magnetometer (package imufusion)", False
    ),
    "ahrs-madgwick": _external("external.ahrs:AHRSMadgwick", 6, "Madgwick 2010 (package ahrs)", False),
    "ahrs-madgwick-9": _external("external.ahrs:AHRSMadgwick", 9, "the same with a magnetometer (package ahrs)", False),
    "ahrs-mahony": _external("external.ahrs:AHRSMahony", 6, "Mahony et al. 2008 (package ahrs)", True),
    "ahrs-mahony-9": _external("external.ahrs:AHRSMahony", 9, "the same with a magnetometer (package ahrs)", True),
    "ahrs-ekf": _external("external.ahrs:AHRSEKF", 6, "extended Kalman filter on the quaternion (package ahrs)", False),
    "ahrs-ekf-9": _external("external.ahrs:AHRSEKF", 9, "the same with a magnetometer (package ahrs)", False),
}


def make(name: str, **parameters: Any) -> Estimator[Any]:
    """Make an estimator of this floor.

    Args:
        name: a key of :data:`CATALOGUE`.
        parameters: fields of the equations (``dt``, noises …) and of what runs them (``compiled``,
        ``keep_covariance``).

    Returns:
        The estimator.

    Raises:
        ValueError: an unknown name, an unknown parameter (the message lists those that there are), or a value that is
            refused.
        ImportError: the package that is wrapped is not installed.
    """
    entry = look_up("estimator", name, CATALOGUE)
    equations = entry.load()
    recursion = _recursion(entry)
    own = {item.name for item in fields(equations)} - set(entry.fixed)
    outer = {item.name for item in fields(recursion)} - {"model"} if recursion else set()
    unknown = sorted(set(parameters) - own - outer)
    if unknown:
        raise ValueError(f"unknown parameters {unknown} of {name!r}; there are {sorted(own | outer)}")
    made = equations(**{key: value for key, value in parameters.items() if key in own}, **entry.fixed)
    if recursion is None:
        return made
    return recursion(made, **{key: value for key, value in parameters.items() if key in outer})


def _recursion(entry: Entry) -> type | None:
    if entry.recursion == "KalmanFilter":
        from .core.kalman import KalmanFilter

        return KalmanFilter
    if entry.recursion == "Observer":
        from .core.observer import Observer

        return Observer
    return None
