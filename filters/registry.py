"""Every filter by name: which class it is, and what the class cannot know of itself.

Channels, outputs and parameters are read from the classes. Listing them imports modules of this layer (NumPy only);
packages that are wrapped are loaded when an estimator is made. A layer above adds entries of the same type
(:mod:`poise.baselines.registry`).
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Literal

from .core.estimator import Estimator
from .core.kalman import KalmanFilter
from .core.model import Equations, Model, Recurrence
from .core.observer import Observer
from .support.names import look_up

Kind = Literal["filter", "adaptive", "learned", "baseline", "external"]
ROOT = __package__.rpartition(".")[0]


@dataclass(frozen=True)
class Entry:
    """One estimator.

    Attributes:
        factory: a class of equations, a class of estimators, or a function that makes an estimator; or where it is,
            ``package.module:name`` below the root of this package.
        kind: ``filter`` (published or this package's), ``adaptive`` (a filter whose gains a policy sets), ``learned``,
            ``baseline`` (a classical reference without tuning), ``external`` (another package's).
        description: what it estimates and how, in one line.
        source: where it was published.
        fixed: parameters that the name stands for; they cannot be given.
        describes: the class whose channels and outputs are those of the estimator, where ``factory`` is a function.
    """

    factory: str | Callable[..., Any]
    kind: Kind
    description: str
    source: str
    fixed: Mapping[str, Any] = field(default_factory=dict)
    describes: str | type = ""

    @cached_property
    def made_by(self) -> Callable[..., Any]:
        """The class or function that makes the estimator or its equations."""
        return _load(self.factory)

    @property
    def runner(self) -> type | None:
        """What runs the equations: ``KalmanFilter``, ``Observer``, or None for a complete estimator."""
        if isinstance(self.made_by, type) and issubclass(self.made_by, Model):
            return KalmanFilter
        return Observer if isinstance(self.made_by, type) and issubclass(self.made_by, Recurrence) else None

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that it needs."""
        return self._names("channels")

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Names of the quantities that it estimates."""
        return self._names("outputs")

    def _names(self, attribute: str) -> tuple[str, ...]:
        described = _load(self.describes) if self.describes else self.made_by
        found = getattr(described, attribute)
        if isinstance(found, property):  # depends on parameters
            found = getattr(described(**self.fixed), attribute)
        return tuple(each.name for each in found)

    def make(self, name: str, parameters: Mapping[str, Any], metadata: Mapping[str, Any] | None = None) -> Any:
        """The estimator; ``name`` is for messages. See :func:`make`."""
        signature = inspect.signature(self.made_by).parameters
        own, outer = set(signature) - set(self.fixed), set()
        if self.runner:
            outer = {item.name for item in fields(self.runner)} - {"model"}
        unknown = sorted(set(parameters) - own - outer)
        if unknown and not any(each.kind is each.VAR_KEYWORD for each in signature.values()):
            raise ValueError(f"unknown parameters {unknown} of {name!r}; there are {sorted(own | outer)}")
        given = {key: value for key, value in parameters.items() if key not in outer}
        if metadata and isinstance(self.made_by, type) and issubclass(self.made_by, Equations):
            found = self.made_by.parameters_from(metadata)
            # a name that fixes the device stands for another one than that of the recording
            given = given if set(found) & set(self.fixed) else found | given
        made = self.made_by(**given, **self.fixed)
        if self.kind == "external":
            made.load()
        if self.runner:
            return self.runner(made, **{key: value for key, value in parameters.items() if key in outer})
        return made


def _load(place: Any) -> Any:
    if not isinstance(place, str):
        return place
    module, name = place.split(":")
    return getattr(importlib.import_module(f"{ROOT}.{module}"), name)


HE = "He, thesis, Université Laval"
THIS = "this package"
TWO_GYRO = "Zhang, Chen, Yi et al."
FORCE_INERTIAL = "Zhang, Chen, Yi 2013"
WHOLE_BODY = "Zhang, Chen, Yi, Liu, Pan 2016"
MAHONY = "Mahony, Hamel, Pflimlin 2008"
WITH_MAGNETOMETER = "the same with a magnetometer"

FILTERS: dict[str, Entry] = {
    "external-acceleration": Entry(
        "filters.imu.external_acceleration:ExternalAcceleration",
        "filter",
        "inclination and external acceleration; mode=1, 2 or 3",
        "Lee, Park, Robinovitch 2012",
    ),
    "mekf": Entry(
        "filters.imu.mekf:MEKF",
        "filter",
        "multiplicative extended Kalman filter with gyroscope bias",
        "Lefferts, Markley, Shuster 1982",
    ),
    "mekf-9": Entry("filters.imu.mekf:MEKF9", "filter", "the same with the heading of a magnetometer", THIS),
    "bounded-motion": Entry(
        "filters.imu.bounded_motion:BoundedMotion",
        "filter",
        "accelerates, but does not go anywhere: velocity near zero as pseudo-measurement",
        THIS,
    ),
    "bounded-motion-9": Entry(
        "filters.imu.bounded_motion:BoundedMotion9", "filter", "the same with the heading of a magnetometer", THIS
    ),
    "array-orientation": Entry(
        "filters.arrays.spatial.orientation:ArrayOrientation",
        "filter",
        'orientation from an accelerometer array; array="controller", "octa" or your own',
        HE,
    ),
    "array-orientation-imu": Entry(
        "filters.arrays.spatial.orientation:ArrayOrientation",
        "filter",
        "the same with the accelerometer of one IMU",
        HE,
        {"array": "triaxial"},
    ),
    "array-rate": Entry(
        "filters.arrays.rate:ArrayRate",
        "filter",
        "angular rate from twelve accelerometers; method=weighted, time-integration, polynomial-roots or parsa",
        HE,
    ),
    "planar-orientation": Entry(
        "filters.arrays.planar.orientation:PlanarOrientation",
        "filter",
        "angle in a vertical plane; method=extended (on the specific force) or linear (on the tilt angle)",
        HE,
    ),
    "planar-pose": Entry(
        "filters.arrays.planar.pose:PlanarPose",
        "filter",
        "complete pose in a vertical plane, from accelerometers alone",
        HE,
    ),
    "planar-unscented": Entry(
        "filters.arrays.planar.unscented:PlanarUnscented",
        "filter",
        "angle in a vertical plane by the unscented filter of the package filterpy",
        HE,
    ),
    "planar-mean": Entry(
        "filters.arrays.planar.mean:PlanarMean",
        "filter",
        "angle in a vertical plane; method=weighted mean of the other two, integration or tilt",
        HE,
    ),
    "marins": Entry(
        "filters.imu.marins:Marins", "filter", "quaternion by Gauss-Newton, then a Kalman filter", "Marins et al. 2001"
    ),
    "two-gyro": Entry(
        "filters.bicycle.two_gyro.filter:TwoGyro",
        "filter",
        "roll of a bicycle, attitude of the trunk; two gyroscopes and a camera; model=sigma1 or sigma2",
        TWO_GYRO,
    ),
    "force-inertial": Entry(
        "filters.bicycle.force_inertial.filter:ForceInertial",
        "filter",
        "roll of a bicycle, angles of the trunk; two IMUs, forces at seat and handlebar",
        FORCE_INERTIAL,
    ),
    "whole-body": Entry(
        "filters.bicycle.whole_body.filter:WholeBody",
        "filter",
        "a rider's trunk, arms and legs from six gyroscopes and the constraints at hands and feet",
        WHOLE_BODY,
    ),
    "odometry-aided": Entry(
        "filters.bicycle.odometry_aided:OdometryAided",
        "filter",
        "roll and pitch of a bicycle from its IMU and the wheel's speed: the wheel rolls and does not slide",
        THIS,
    ),
    "two-gyro-integration": Entry(
        "filters.bicycle.platform_gyro:TwoGyroIntegration",
        "baseline",
        "both gyroscopes integrated, no update",
        TWO_GYRO,
    ),
    "platform-gyro": Entry(
        "filters.bicycle.platform_gyro:PlatformGyro",
        "baseline",
        "roll from the bicycle's gyroscope alone: pitch rate near zero as pseudo-measurement",
        THIS,
    ),
    "force-inertial-integration": Entry(
        "filters.bicycle.force_inertial.integration:ForceInertialIntegration",
        "baseline",
        "gyroscopes integrated from the angles that the first forces determine",
        FORCE_INERTIAL,
    ),
    "whole-body-integration": Entry(
        "filters.bicycle.whole_body.integration:WholeBodyIntegration",
        "baseline",
        "six gyroscopes integrated, no update",
        WHOLE_BODY,
    ),
    "gyroscope-integration": Entry(
        "filters.imu.classical:GyroscopeIntegration",
        "baseline",
        "gyroscope alone, from the first inclination",
        "textbook",
    ),
    "tilt": Entry("filters.imu.classical:Tilt", "baseline", "accelerometer alone, sample by sample", "textbook"),
    "mahony": Entry(
        "filters.imu.classical:Mahony",
        "baseline",
        "explicit complementary filter with bias, published gains",
        MAHONY,
    ),
    "mahony-9": Entry("filters.imu.classical:Mahony9", "baseline", WITH_MAGNETOMETER, MAHONY),
    **{
        f"{name}{suffix}": Entry(
            f"filters.external.{place}", "external", f"{text} (package {place.split(':')[0]})", source, {"axes": axes}
        )
        for name, place, description, source in (
            ("vqf", "vqf:VQF", "VQF, causal form", "Laidig, Seel 2023"),
            ("imufusion", "imufusion:IMUFusion", "Fusion of x-io Technologies", "Madgwick 2014"),
            ("ahrs-madgwick", "ahrs:AHRSMadgwick", "gradient descent", "Madgwick 2010"),
            ("ahrs-mahony", "ahrs:AHRSMahony", "explicit complementary filter", MAHONY),
            ("ahrs-ekf", "ahrs:AHRSEKF", "extended Kalman filter on the quaternion", "documentation of ahrs"),
        )
        for suffix, axes, text in (("", 6, description), ("-9", 9, WITH_MAGNETOMETER))
    },
}
"""Name → filter. A new one is an entry here; its class says the rest."""


def make(name: str, *, metadata: Mapping[str, Any] | None = None, **parameters: Any) -> Estimator[Any]:
    """Make a filter.

    Args:
        name: a key of :data:`FILTERS`.
        metadata: of a recording; the filter is configured with the person, vehicle or device that they describe.
        parameters: fields of the equations (``dt``, noises …) and of what runs them (``compiled``,
            ``keep_covariance``); they win over ``metadata``.

    Returns:
        The estimator.

    Raises:
        ValueError: an unknown name, an unknown parameter (the message lists those that there are), or a value that is
            refused.
        ImportError: the package that is wrapped is not installed.
    """
    return look_up("estimator", name, FILTERS).make(name, parameters, metadata)


def name_of(equations: Equations) -> str | None:
    """The name under which equations are registered; None if they are not."""
    kind = type(equations)
    place = f"{kind.__module__.removeprefix(f'{ROOT}.')}:{kind.__qualname__}"
    return next((name for name, entry in FILTERS.items() if entry.factory in (kind, place)), None)
