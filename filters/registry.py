"""Registry of filters: the class behind each name, and descriptions that the class does not contain.

Channels, outputs and parameters are read from the classes. Listing them imports modules of this layer only (NumPy).
Wrapped packages are loaded when an estimator is made. A layer above adds entries of the same type
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
from .core.recursion import Observer
from .support.names import look_up
from .support.parameters import check_parameters

Kind = Literal["filter", "adaptive", "learned", "baseline", "external"]
HERE = "this package"


@dataclass(frozen=True)
class Entry:
    """One estimator.

    Attributes:
        factory: a class of equations, a class of estimators, or a function that makes an estimator; or its location,
            ``.module:name`` relative to this package.
        description: what it estimates and how, in one line.
        source: where it was published; by default in this package only.
        kind: ``filter`` (published or this package's), ``adaptive`` (a filter whose gains a policy or a rule sets),
            ``learned``, ``baseline`` (a classical reference without tuning), ``external`` (another package's).
        fixed: parameters that the name implies; they cannot be passed.
        describes: the class whose channels and outputs are those of the estimator, where ``factory`` is a function,
            or the name of a filter.
        experimental: not better on recordings or rides than the filter that it is built on; listed on request only.
    """

    factory: str | Callable[..., Any]
    description: str
    source: str = HERE
    kind: Kind = "filter"
    fixed: Mapping[str, Any] = field(default_factory=dict)
    describes: str | Callable[..., Any] = ""
    experimental: bool = False

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
        """Names of the required channels."""
        return self._names("channels")

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Names of the estimated quantities."""
        return self._names("outputs")

    def _names(self, attribute: str) -> tuple[str, ...]:
        if isinstance(self.describes, str) and self.describes in FILTERS:
            return FILTERS[self.describes]._names(attribute)
        described = _load(self.describes) if self.describes else self.made_by
        found = getattr(described, attribute, None)
        if found is None or isinstance(found, property):  # of a function, or depends on parameters
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
            raise ValueError(f"unknown parameters {unknown} of {name!r}; accepted are {sorted(own | outer)}")
        given = {key: value for key, value in parameters.items() if key not in outer}
        described = FILTERS[self.describes].made_by if self.describes in FILTERS else _load(self.describes)
        for owner in filter(None, (described, self.made_by)):
            check_parameters(owner, given)
        if self.runner:  # which has a field of its own that is named as a parameter of some equations: model
            check_parameters(self.runner, {key: value for key, value in parameters.items() if key in outer})
        if metadata and isinstance(self.made_by, type) and issubclass(self.made_by, Equations):
            found = self.made_by.parameters_from(metadata)
            # a name that fixes the device overrides the device of the recording
            given = given if set(found) & set(self.fixed) else found | given
        made = self.made_by(**given, **self.fixed)
        if self.kind == "external":
            made.load()
        if metadata and callable(getattr(made, "configured", None)) and not isinstance(made, Equations):
            made = made.configured(metadata)
        if self.runner:
            return self.runner(made, **{key: value for key, value in parameters.items() if key in outer})
        return made


def _load(place: Any) -> Any:
    if not isinstance(place, str) or not place:
        return place
    module, name = place.split(":")
    return getattr(importlib.import_module(module, __package__), name)


HE = "He, thesis, Université Laval"
TWO_GYRO, FORCE_INERTIAL, WHOLE_BODY = (
    "Zhang, Chen, Yi et al.",
    "Zhang, Chen, Yi 2013",
    "Zhang, Chen, Yi, Liu, Pan 2016",
)
MAHONY = "Mahony, Hamel, Pflimlin 2008"
SPATIAL, PLANAR, BICYCLE = ".arrays.spatial.orientation:ArrayOrientation", ".arrays.planar", ".bicycle"
WITH_HEADING = "the same with the heading of a magnetometer"

FILTERS: dict[str, Entry] = {
    "external-acceleration": Entry(
        ".imu.external_acceleration:ExternalAcceleration",
        "inclination and external acceleration; mode=1, 2 or 3",
        "Lee, Park, Robinovitch 2012",
    ),
    "mekf": Entry(
        ".imu.mekf:MEKF", "multiplicative extended Kalman filter with gyroscope bias", "Lefferts, Markley, Shuster 1982"
    ),
    "mekf-9": Entry(".imu.mekf:MEKF9", WITH_HEADING),
    "bounded-motion": Entry(
        ".imu.bounded_motion:BoundedMotion",
        "for bodies that accelerate but stay in one place: velocity near zero as pseudo-measurement",
    ),
    "bounded-motion-rest": Entry(
        ".imu.rest:RestingBoundedMotion",
        "bounded-motion, the bias of the gyroscope measured whenever the device lies still",
    ),
    "bounded-motion-9": Entry(".imu.bounded_motion:BoundedMotion9", WITH_HEADING),
    "bounded-motion-rest-9": Entry(
        ".imu.rest:RestingBoundedMotion9", "bounded-motion-rest with the heading of a magnetometer"
    ),
    "array-orientation": Entry(
        SPATIAL, 'orientation from an accelerometer array; array="controller", "octa" or your own', HE
    ),
    "array-orientation-imu": Entry(
        SPATIAL, "the same with the accelerometer of one IMU", HE, fixed={"array": "triaxial"}
    ),
    "array-rate": Entry(
        ".arrays.rate:ArrayRate",
        "angular rate from twelve accelerometers; method=weighted, time-integration, polynomial-roots or parsa",
        HE,
    ),
    "planar-orientation": Entry(
        f"{PLANAR}.orientation:PlanarOrientation",
        "angle in a vertical plane; method=extended (on the specific force) or linear (on the tilt angle)",
        HE,
    ),
    "planar-pose": Entry(
        f"{PLANAR}.pose:PlanarPose", "complete pose in a vertical plane, from accelerometers alone", HE
    ),
    "planar-unscented": Entry(
        f"{PLANAR}.unscented:PlanarUnscented",
        "angle in a vertical plane by the unscented filter of the package filterpy",
        HE,
    ),
    "planar-mean": Entry(
        f"{PLANAR}.mean:PlanarMean",
        "angle in a vertical plane; method=weighted mean of the other two, integration or tilt",
        HE,
    ),
    "marins": Entry(".imu.marins:Marins", "quaternion by Gauss-Newton, then a Kalman filter", "Marins et al. 2001"),
    "two-gyro": Entry(
        f"{BICYCLE}.two_gyro.filter:TwoGyro",
        "roll of a bicycle, attitude of the trunk; two gyroscopes and a camera; model=sigma1 or sigma2",
        TWO_GYRO,
    ),
    "two-gyro-consistent": Entry(
        f"{BICYCLE}.two_gyro.consistent:ConsistentTwoGyro",
        "two-gyro with noises that hold on rides: its covariance is that of its errors",
    ),
    "two-gyro-level": Entry(
        f"{BICYCLE}.two_gyro.filter:TwoGyro",
        "two-gyro by Σ1, with level ground as pseudo-measurement: the roll no longer drifts",
        fixed={"model": "sigma1", "constraint": True},
    ),
    "force-inertial": Entry(
        f"{BICYCLE}.force_inertial.filter:ForceInertial",
        "roll of a bicycle, angles of the trunk; two IMUs, forces at seat and handlebar",
        FORCE_INERTIAL,
    ),
    "force-inertial-consistent": Entry(
        f"{BICYCLE}.force_inertial.consistent:ConsistentForceInertial",
        "force-inertial from the usual posture, with noises that hold on rides: its covariance is that of its errors",
    ),
    "whole-body": Entry(
        f"{BICYCLE}.whole_body.filter:WholeBody",
        "a rider's trunk, arms and legs from six gyroscopes and the constraints at hands and feet",
        WHOLE_BODY,
    ),
    "whole-body-consistent": Entry(
        f"{BICYCLE}.whole_body.consistent:ConsistentWholeBody",
        "whole-body with biases and errors of the rider's geometry as states, from the usual posture: its covariance "
        "is that of its errors",
    ),
    "balanced-gyro": Entry(
        f"{BICYCLE}.balanced_gyro:BalancedGyro",
        "roll and pitch of a bicycle from its gyroscope alone: level on average, balanced in turns of unknown speed",
    ),
    "odometry-aided": Entry(
        f"{BICYCLE}.odometry_aided:OdometryAided",
        "roll and pitch of a bicycle from its IMU and the wheel's speed: the wheel rolls and does not slide",
    ),
    **{
        name: Entry(place, description, source, "baseline")
        for name, source, place, description in (
            (
                "two-gyro-integration",
                TWO_GYRO,
                f"{BICYCLE}.platform_gyro:TwoGyroIntegration",
                "both gyroscopes integrated",
            ),
            (
                "platform-gyro",
                HERE,
                f"{BICYCLE}.platform_gyro:PlatformGyro",
                "roll from the bicycle's gyroscope alone: pitch rate near zero as pseudo-measurement",
            ),
            (
                "force-inertial-integration",
                FORCE_INERTIAL,
                f"{BICYCLE}.force_inertial.integration:ForceInertialIntegration",
                "gyroscopes integrated from the angles that the first forces determine",
            ),
            (
                "whole-body-integration",
                WHOLE_BODY,
                f"{BICYCLE}.whole_body.integration:WholeBodyIntegration",
                "six gyroscopes integrated",
            ),
            (
                "gyroscope-integration",
                "textbook",
                ".imu.classical:GyroscopeIntegration",
                "gyroscope alone, from the first inclination",
            ),
            ("tilt", "textbook", ".imu.classical:Tilt", "accelerometer alone, sample by sample"),
            ("mahony", MAHONY, ".imu.classical:Mahony", "explicit complementary filter with bias, published gains"),
            ("mahony-9", MAHONY, ".imu.classical:Mahony9", "the same with a magnetometer"),
        )
    },
    **{
        f"{name}{suffix}": Entry(
            f".external.{place}", f"{text} (package {place.split(':')[0]})", source, "external", {"axes": axes}
        )
        for name, place, description, source in (
            ("vqf", "vqf:VQF", "VQF, causal form", "Laidig, Seel 2023"),
            ("imufusion", "imufusion:IMUFusion", "Fusion of x-io Technologies", "Madgwick 2014"),
            ("ahrs-madgwick", "ahrs:AHRSMadgwick", "gradient descent", "Madgwick 2010"),
            ("ahrs-mahony", "ahrs:AHRSMahony", "explicit complementary filter", MAHONY),
            ("ahrs-ekf", "ahrs:AHRSEKF", "extended Kalman filter on the quaternion", "documentation of ahrs"),
        )
        for suffix, axes, text in (("", 6, description), ("-9", 9, "the same with a magnetometer"))
    },
}
"""Name → filter. A new filter needs one entry here; its class provides the rest."""


def make(name: str, *, metadata: Mapping[str, Any] | None = None, **parameters: Any) -> Estimator[Any]:
    """Make a filter.

    Args:
        name: a key of :data:`FILTERS`.
        metadata: of a recording; the filter is configured with the person, vehicle or device described there.
        parameters: fields of the equations (``dt``, noises …) and of what runs them (``compiled``,
            ``keep_covariance``); they take precedence over ``metadata``.

    Returns:
        The estimator.

    Raises:
        ValueError: an unknown name, an unknown parameter (the message lists the accepted ones), or an invalid value.
        ImportError: the wrapped package is not installed.
    """
    return look_up("estimator", name, FILTERS).make(name, parameters, metadata)


def name_of(equations: Equations) -> str | None:
    """The name under which equations are registered, the most specific one; None if they are not registered."""
    kind = type(equations)
    place = f"{kind.__module__.removeprefix(__package__)}:{kind.__qualname__}"
    found = {
        name: len(entry.fixed)
        for name, entry in FILTERS.items()
        if entry.factory in (kind, place)
        and all(getattr(equations, field, None) == value for field, value in entry.fixed.items())
    }
    return max(found, key=lambda name: found[name]) if found else None
