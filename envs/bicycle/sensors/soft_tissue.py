"""Motion of worn sensors on soft tissue: a damped mass on springs at each site, between bone and sensor.

Skin, fat and muscle under a sensor let it slide and rock against the bone. The displacement x of the sensor (body axes)
follows the specific force f of the bone at the site, less what the tissue has crept into::

    x'' + 2 ζ ω x' + ω² x = −(f − c),    c' = (f − c) / T

and the sensor rocks about a point at a depth h below the skin by the rotation vector φ = n × x / h, where n is the
outward normal of the skin. The truth of a ride is that of the bones, so soft tissue is an error of the sensors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from ....filters.compile.cache import jit
from ....filters.core import rotation
from ....filters.core.quantity import STANDARD_GRAVITY
from ....filters.support.parameters import check_positive
from ...sensors.ideal import BodyState, Mounting, mounted

CREEP = 3.0
"""s: T, after which tissue under a constant load is at rest again"""


@dataclass(frozen=True)
class SoftTissue:
    """Tissue at one site.

    Raises:
        ValueError: a frequency, damping or depth that is not positive.
    """

    frequency: float
    """Hz: natural frequency ω / 2π of the sensor with the tissue below it"""
    damping: float
    """1: ζ"""
    depth: float
    """m: h; radius of the rocking, longer than the tissue is thick where a strap holds the sensor"""
    normal: tuple[float, float, float]
    """n: outward unit vector, body axes"""

    def __post_init__(self) -> None:
        check_positive(self, "frequency", "damping", "depth")


TISSUES = {
    "trunk": SoftTissue(9.0, 0.3, 0.16, (-1.0, 0.0, 0.0)),
    "upper_arm": SoftTissue(8.0, 0.3, 0.08, (0.0, 1.0, 0.0)),
    "thigh": SoftTissue(7.0, 0.25, 0.08, (1.0, 0.0, 0.0)),
}
"""Tissue by kind of body. Frequency and damping are assumed, of the order of published resonances of skin-mounted
accelerometers over the spine and on the thigh; the depth of the trunk is chosen such that its gyroscope has the
spectrum above 4 Hz of the chest sensor of a recorded ride, those of the limbs are assumed."""


class TissueState(NamedTuple):
    """Where the tissue of one site is.

    Attributes:
        time: s of the last sample.
        velocity: ``(3,)`` m/s of the site on the bone then, world axes.
        values: ``(9,)`` displacement (m), its rate (m/s) and the force that it has crept into (m/s²), body axes.
    """

    time: float
    velocity: np.ndarray
    values: np.ndarray


@jit
def _displacements(step, pushed, force, values):  # type: ignore[no-untyped-def]
    """States ``(n, 9)`` after n intervals of constant force; ``step`` ``(3, 3)``, ``pushed`` ``(3,)``: of one axis."""
    found = np.empty((force.shape[0], 9))
    for index in range(force.shape[0]):
        new = found[index]
        for axis in range(3):
            for row in range(3):
                total = pushed[row] * force[index, axis]
                for column in range(3):
                    total += step[row, column] * values[3 * column + axis]
                new[3 * row + axis] = total
        values = new
    return found


def tissue_of(body: str) -> SoftTissue | None:
    """The tissue of a body by its name, mirrored on the right side; None where sensors sit firmly."""
    kind, _, side = body.rpartition("_")
    found = TISSUES.get(body, TISSUES.get(kind))
    if found is None or side != "right":
        return found
    x, y, z = found.normal
    return SoftTissue(found.frequency, found.damping, found.depth, (x, -y, z))


class SoftTissueMotion:
    """Soft tissue under the sensors of one rider, carried from sample to sample.

    Args:
        sites: body → place and axes of its sensor; bodies without tissue are left as they are.
        rate: samples per second, Hz.
        scale: factor on all displacements; 0 for none.

    Raises:
        ValueError: a scale that is negative or not finite.
    """

    def __init__(self, sites: Mapping[str, Mounting], rate: float, scale: float = 1.0) -> None:
        if not 0.0 <= scale < math.inf:
            raise ValueError(f"soft_tissue must not be negative and be finite, got {scale}")
        self.scale, self.rate = scale, rate
        self.sites = {body: site for body, site in sites.items() if scale and tissue_of(body) is not None}
        self._steps = {body: self._exact(tissue_of(body)) for body in self.sites}
        self.state: dict[str, TissueState] = {}

    def _exact(self, tissue: SoftTissue | None) -> tuple[np.ndarray, np.ndarray]:
        """Exact solution of one axis over an interval with constant force."""
        assert tissue is not None
        w = 2.0 * math.pi * tissue.frequency
        block = np.zeros((4, 4))
        block[0, 1] = 1.0
        block[1] = (-(w**2), -2.0 * tissue.damping * w, 1.0, -1.0)
        block[2, 2:] = (-1.0 / CREEP, 1.0 / CREEP)
        block = expm(block / self.rate)
        return np.ascontiguousarray(block[:3, :3]), np.ascontiguousarray(block[:3, 3])

    def carry(self, bodies: Mapping[str, BodyState]) -> tuple[dict[str, BodyState], dict[str, np.ndarray]]:
        """Motion of the skin at the next n samples, from the motion of the bones ``(n, …)`` by name.

        Returns:
            The bodies with the motion of their skin, a frame to which sensors are fixed, and displacement and rotation
            vector ``(n, 6)`` of each site (m, rad; body axes).
        """
        worn, moved = dict(bodies), {}
        for body, site in self.sites.items():
            bone = bodies[body]
            if bone.acceleration is None:
                continue
            worn[body], moved[body] = self._skin(body, bone, site)
        return worn, moved

    def _skin(self, body: str, bone: BodyState, site: Mounting) -> tuple[BodyState, np.ndarray]:
        tissue, (step, pushed) = tissue_of(body), self._steps[body]
        assert tissue is not None
        lever = np.array(site.lever_arm)
        place = mounted(bone, Mounting(site.lever_arm))
        time, up = np.asarray(bone.time), np.array([0.0, 0.0, STANDARD_GRAVITY])
        last = self.state.get(body)
        if last is None:
            # at rest under the force of the first sample
            first = rotation.rotate_back(bone.orientation[0], up)
            last = TissueState(
                float(time[0]) - 1.0 / self.rate, place.velocity[0], np.concatenate([np.zeros(6), first])
            )
        velocity = np.concatenate([last.velocity[None], place.velocity])
        spans = np.diff(np.concatenate([[last.time], time]))[:, None]
        force = rotation.rotate_back(bone.orientation, np.diff(velocity, axis=0) / spans + up)
        values = _displacements(step, pushed, np.ascontiguousarray(force), last.values)
        self.state[body] = TissueState(float(time[-1]), place.velocity[-1], values[-1])
        x, rate, creep = (self.scale * values[:, 3 * part : 3 * part + 3] for part in range(3))
        w = 2.0 * math.pi * tissue.frequency
        pull = -(self.scale * force - creep) - 2.0 * tissue.damping * w * rate - w**2 * x
        normal = np.array(tissue.normal) / tissue.depth
        angle, turning, spin = (rotation.cross(normal, each) for each in (x, rate, pull))
        # everything in bone axes: rates of the sensor against the bone, small angles to second order
        turning = turning + 0.5 * rotation.cross(angle, turning)
        spin = spin + 0.5 * rotation.cross(angle, spin)
        omega = rotation.rotate_back(bone.orientation, bone.angular_velocity)
        orientation = rotation.multiply(bone.orientation, rotation.exp(angle))
        angular = bone.angular_velocity + rotation.rotate(bone.orientation, turning)
        angular_acceleration = rotation.rotate(bone.orientation, spin + rotation.cross(omega, turning))
        assert bone.angular_acceleration is not None
        assert place.acceleration is not None
        angular_acceleration = bone.angular_acceleration + angular_acceleration
        # the displaced site, and from there back along the skin's own lever to the frame's origin
        offset, drift = rotation.rotate(bone.orientation, x), rotation.rotate(bone.orientation, rate)
        swing = rotation.cross(bone.angular_velocity, offset)
        moved = rotation.rotate(bone.orientation, pull) + 2.0 * rotation.cross(bone.angular_velocity, drift)
        moved += rotation.cross(bone.angular_acceleration, offset) + rotation.cross(bone.angular_velocity, swing)
        arm = rotation.rotate(orientation, lever)
        turn = rotation.cross(angular, arm)
        skin = BodyState(
            bone.time,
            place.position + offset - arm,
            orientation,
            place.velocity + drift + swing - turn,
            angular,
            place.acceleration + moved - rotation.cross(angular_acceleration, arm) - rotation.cross(angular, turn),
            angular_acceleration,
        )
        return skin, np.concatenate([x, angle], axis=1)
