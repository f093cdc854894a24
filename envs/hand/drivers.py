"""Motion drivers of the hand-held device: :class:`KinematicDriver`, and force-controlled :class:`DynamicDriver`.

A driver returns the states of the device in blocks of samples. Estimates do not affect the motion, so sensors and truth
can be computed for many samples at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from ...filters.core import rotation
from ..sensors.ideal import STANDARD_GRAVITY, BodyState
from .gestures import Gesture


class States(NamedTuple):
    """States of the device at consecutive samples.

    Attributes:
        now: states ``(n, …)`` at the samples.
        earlier: states ``(n, …)`` one physics step (kinematic: one sample) before each of them.
    """

    now: BodyState
    earlier: BodyState


class MotionDriver(Protocol):
    """Source of the device's motion."""

    block: int
    """Preferred number of samples per block."""

    def start(self, gesture: Gesture, mass_factor: float = 1.0) -> None:
        """Begin a gesture; the next state is that of sample 0."""
        ...

    def advance(self, samples: int) -> States:
        """The states of the next samples."""
        ...

    def save(self) -> Any:
        """All memory, plain immutable data."""
        ...

    def restore(self, saved: Any) -> None:
        """Continue from saved memory, bitwise."""
        ...

    def close(self) -> None:
        """Free what is not memory."""
        ...


class KinematicDriver:
    """The device follows the gesture exactly; no physics engine is involved.

    Args:
        rate: samples per second, Hz.
    """

    block = 6000

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._gesture: Gesture | None = None
        self._step = 0

    def start(self, gesture: Gesture, mass_factor: float = 1.0) -> None:
        """Begin a gesture; the mass has no effect."""
        self._gesture, self._step = gesture, 0

    def advance(self, samples: int) -> States:
        """The states of the next samples, accelerations included."""
        assert self._gesture is not None
        states = self._gesture.sample(np.arange(self._step - 1, self._step + samples) / self.rate)
        self._step += samples
        return States(states.at(slice(1, None)), states.at(slice(None, -1)))

    def save(self) -> tuple[Gesture | None, int]:
        """All memory, plain immutable data."""
        return self._gesture, self._step

    def restore(self, saved: tuple[Gesture | None, int]) -> None:
        """Continue from saved memory, bitwise."""
        self._gesture, self._step = saved

    def close(self) -> None:
        """Nothing to free."""


@dataclass(frozen=True)
class Device:
    """A hand-held controller, a homogeneous box; the origin of the body frame is its centre.

    Attributes:
        mass: kg.
        size: ``(3,)`` extent along the body axes, m.
    """

    mass: float = 0.25
    size: tuple[float, float, float] = (0.16, 0.10, 0.05)

    @property
    def inertia(self) -> tuple[float, float, float]:
        """Moments about the body axes, kg·m²."""
        x, y, z = (side * side for side in self.size)
        return self.mass * (y + z) / 12.0, self.mass * (x + z) / 12.0, self.mass * (x + y) / 12.0


class DynamicDriver:
    """A hand pulls and twists the device along the gesture: computed force and torque plus critically damped feedback.

    The computed part is the inverse dynamics of the engine's own integrator (semi-implicit Euler: second differences of
    the gesture at the physics steps), so what is left to the feedback is the rounding of the rotation.

    Args:
        rate: samples per second, Hz.
        device: what is moved.
        bandwidth: undamped natural frequency of the feedback, Hz.
        longest_step: upper bound of the physics step, s.
        gravity: m/s².
    """

    block = 50

    def __init__(
        self,
        rate: float,
        device: Device | None = None,
        *,
        bandwidth: float = 10.0,
        longest_step: float = 1e-3,
        gravity: float = STANDARD_GRAVITY,
    ) -> None:
        # imported here, because kinematic motion does not need PyBullet
        from ..physics.world import Physics

        self.rate, self.device, self.bandwidth = rate, device or Device(), bandwidth
        self.substeps = max(1, math.ceil(1.0 / (rate * longest_step) - 1e-9))
        self.physics = Physics(time_step=1.0 / (rate * self.substeps), gravity=gravity)
        self._body = self.physics.create_body(self.device.mass, self.device.inertia)
        self._gesture: Gesture | None = None
        self._mass_factor, self._step = 1.0, 0
        self._state: tuple[tuple[float, ...], ...] = ()

    def start(self, gesture: Gesture, mass_factor: float = 1.0) -> None:
        """Begin a gesture at rest; ``mass_factor`` multiplies mass and moments of inertia.

        The controller uses the nominal mass; its feedback compensates the difference.
        """
        self._gesture, self._mass_factor, self._step = gesture, mass_factor, 0
        inertia = np.multiply(self.device.inertia, mass_factor)
        self.physics.set_mass(self._body, mass_factor * self.device.mass, inertia)

    def advance(self, samples: int) -> States:
        """Step the physics world and return the states of the next samples; accelerations are unknown (None)."""
        assert self._gesture is not None
        step, rows = self.physics.time_step, []
        if self._step == 0:
            first = self._gesture.sample(np.array([-step, 0.0]))
            tuples = [tuple(tuple(field[row].tolist()) for field in first[1:5]) for row in (0, 1)]
            rows.append((tuples[0], tuples[1]))
            self._state = tuples[1]
        count = samples - len(rows)
        start = (self._step + len(rows) - 1) * self.substeps
        if count:
            rows += self._follow(start, count)
            self._state = rows[-1][1]
        times = np.arange(self._step, self._step + samples) / self.rate
        self._step += samples
        earlier, now = (
            [np.array(field) for field in zip(*(row[side] for row in rows), strict=True)] for side in (0, 1)
        )
        return States(BodyState(times, *now), BodyState(times - step, *earlier))

    def _follow(self, start: int, samples: int) -> list[tuple[Any, Any]]:
        """Follow the gesture from physics step ``start``; states one step before each sample and at it."""
        physics, body, substeps = self.physics, self._body, self.substeps
        reference = self._reference(start, samples * substeps)
        # resetting the body to its state makes a block a function of plain numbers, which can be saved
        physics.set_base_tuples(body, *self._state)
        read, step, push, twist = physics.base_tuples, physics.step, physics.apply_force, physics.apply_torque
        mass, (ix, iy, iz) = self.device.mass, self.device.inertia
        stiffness = (2.0 * math.pi * self.bandwidth) ** 2
        damping = 2.0 * math.sqrt(stiffness)
        weight = mass * physics.gravity
        rows = []
        state = previous = read(body)
        for index, (rx, ry, rz, sx, sy, sz, ax, ay, az, d, a, b, c, ux, uy, uz, bx, by, bz) in enumerate(reference, 1):
            place, (w, x, y, z), (vx, vy, vz), (ox, oy, oz) = state
            px, py, pz = place
            force = (
                mass * (ax + stiffness * (rx - px) + damping * (sx - vx)),
                mass * (ay + stiffness * (ry - py) + damping * (sy - vy)),
                mass * (az + stiffness * (rz - pz) + damping * (sz - vz)) + weight,
            )
            # vector part of reference ⊗ actual⁻¹: half the small angle between them
            twice = 2.0 * stiffness if d * w + a * x + b * y + c * z >= 0.0 else -2.0 * stiffness
            alpha_x = bx + twice * (w * a - d * x + c * y - b * z) + damping * (ux - ox)
            alpha_y = by + twice * (w * b - d * y + a * z - c * x) + damping * (uy - oy)
            alpha_z = bz + twice * (w * c - d * z + b * x - a * y) + damping * (uz - oz)
            # rotation matrix, as rotation.to_matrix
            m00, m01, m02 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
            m10, m11, m12 = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
            m20, m21, m22 = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
            # Euler's equation in body axes: torque = I α + ω × I ω
            p = m00 * ox + m10 * oy + m20 * oz
            q = m01 * ox + m11 * oy + m21 * oz
            r = m02 * ox + m12 * oy + m22 * oz
            tx = ix * (m00 * alpha_x + m10 * alpha_y + m20 * alpha_z) + (iz - iy) * q * r
            ty = iy * (m01 * alpha_x + m11 * alpha_y + m21 * alpha_z) + (ix - iz) * r * p
            tz = iz * (m02 * alpha_x + m12 * alpha_y + m22 * alpha_z) + (iy - ix) * p * q
            push(body, force, place)
            twist(
                body,
                (m00 * tx + m01 * ty + m02 * tz, m10 * tx + m11 * ty + m12 * tz, m20 * tx + m21 * ty + m22 * tz),
            )
            step()
            previous, state = state, read(body)
            if index % substeps == 0:
                rows.append((previous, state))
        return rows

    def _reference(self, start: int, steps: int) -> list[list[float]]:
        """Rows of position, velocity, acceleration, quaternion, angular velocity and acceleration for each step.

        Velocities are those with which the integrator passes from point to point.
        """
        assert self._gesture is not None
        h = self.physics.time_step
        motion = self._gesture.sample(np.arange(start - 1, start + steps + 1) * h)
        velocity = np.diff(motion.position, axis=0) / h
        turns = rotation.multiply(motion.orientation[1:], rotation.conjugate(motion.orientation[:-1]))
        spin = rotation.log(turns) / h
        columns = (
            motion.position[1:-1],
            velocity[:-1],
            np.diff(velocity, axis=0) / h,
            motion.orientation[1:-1],
            spin[:-1],
            np.diff(spin, axis=0) / h,
        )
        return np.concatenate(columns, axis=1).tolist()

    def save(self) -> tuple[Any, ...]:
        """All memory, plain immutable data."""
        return self._gesture, self._mass_factor, self._step, self._state

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Continue from saved memory, bitwise."""
        gesture, mass_factor, step, state = saved
        self.start(gesture, mass_factor)
        self._step, self._state = step, state

    def close(self) -> None:
        """End the physics world."""
        self.physics.close()
