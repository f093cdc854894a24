"""One PyBullet world: create or load bodies, apply forces, step, read exact states, save and restore.

PyBullet's scalar-last quaternions and centre-of-mass frames stay inside this file. A body is addressed by the number
that its creation returns, one of its links by its index; :data:`BASE` is the base. States belong to the *body frame*
(the link frame of a URDF), not to PyBullet's frame of principal axes in the centre of mass.

Only double-precision fields are used. The link frame that PyBullet reports is single precision, which far from the
origin would add considerable noise to an accelerometer.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Self

import numpy as np

from ...filters.core import rotation
from ...filters.core.quantity import STANDARD_GRAVITY
from ...filters.support.optional import extra, silent
from ..sensors.ideal import BodyState

with extra("sim"), silent():
    import pybullet

BASE = -1
"""Index of the base of a body where a link is asked for."""
SOLVER_ITERATIONS = 30
"""Sweeps of the constraint solver, which close the loops of a rider's limbs within 0.1 mm."""

Vector = Sequence[float] | np.ndarray
Triple = tuple[float, float, float]
TupleState = tuple[Triple, tuple[float, float, float, float], Triple, Triple]
"""Position, quaternion (w, x, y, z), velocity and angular velocity as plain tuples, for loops over physics steps."""


class PhysicsError(RuntimeError):
    """PyBullet refused something, or its world is closed."""


class NoDisplayError(PhysicsError, ValueError):
    """A window was asked for where there is no display."""


class Physics:
    """A PyBullet world with gravity along −z, ready for exact rigid-body work.

    Args:
        time_step: length of one physics step, s. The integrator is semi-implicit Euler: errors are of first order.
        gravity: m/s².
        gui: open PyBullet's window.

    Raises:
        PhysicsError: no connection, for instance a window without a display.
    """

    def __init__(
        self,
        *,
        time_step: float = 1e-3,
        gravity: float = STANDARD_GRAVITY,
        gui: bool = False,
    ) -> None:
        self.client = -1
        if not time_step > 0.0:
            raise ValueError(f"time_step must be positive, got {time_step}")
        self.time_step, self.gui = float(time_step), gui
        self.gravity = float(gravity)
        self.steps = 0
        self.changes = 0
        """of the state: what was read from PyBullet is valid as long as this number stays"""
        self._inertial: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}
        if gui and sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
            # PyBullet would end the whole process
            raise NoDisplayError("a window needs a display, but DISPLAY is not set; use render_mode='rgb_array'")
        self.client = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
        if self.client < 0:
            raise PhysicsError(f"PyBullet could not {'open a window' if gui else 'start'}")
        pybullet.setGravity(0.0, 0.0, -self.gravity, physicsClientId=self.client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self.time_step,
            numSolverIterations=SOLVER_ITERATIONS,
            numSubSteps=0,
            deterministicOverlappingPairs=1,
            physicsClientId=self.client,
        )

    def create_body(
        self, mass: float, inertia: Vector, *, centre_of_mass: Vector = (0.0, 0.0, 0.0), visual: int = -1
    ) -> int:
        """Create a free rigid body without any damping, body frame at the origin.

        Args:
            mass: kg; 0 makes a fixed body.
            inertia: moments ``(3,)`` along the body axes or tensor ``(3, 3)``, about the centre of mass, kg·m².
            centre_of_mass: ``(3,)`` m, in the body frame.
            visual: shape to draw (a PyBullet number); −1 for none.

        Returns:
            The body's number.

        Raises:
            ValueError: a negative mass, or a moment of inertia that is not positive.
        """
        moments, axes = principal_axes(inertia)
        if not mass >= 0.0 or (mass > 0.0 and not np.all(moments > 0.0)):
            raise ValueError(
                f"mass and moments of inertia must be positive, got {mass} kg and {moments.tolist()} kg·m²"
            )
        body = pybullet.createMultiBody(
            baseMass=mass,
            baseVisualShapeIndex=visual,
            baseInertialFramePosition=floats(centre_of_mass),
            baseInertialFrameOrientation=xyzw(axes),
            physicsClientId=self.client,
        )
        if mass > 0.0:
            pybullet.changeDynamics(body, BASE, localInertiaDiagonal=moments.tolist(), physicsClientId=self.client)
        self.clear_defaults(body)
        return int(body)

    def load_urdf(self, source: str | Path, *, position: Vector = (0.0, 0.0, 0.0), fixed: bool = False) -> int:
        """Load a multibody with the inertias of its description, without dampings and motors.

        Args:
            source: path of a URDF file, or the URDF text itself (begins with ``<``).
            position: ``(3,)`` of the base frame, m.
            fixed: whether the base is fixed to the world.

        Raises:
            PhysicsError: PyBullet cannot read it.
        """
        with tempfile.TemporaryDirectory() as folder:
            path = Path(source) if not str(source).lstrip().startswith("<") else Path(folder) / "body.urdf"
            if path.parent == Path(folder):
                path.write_text(str(source))
            try:
                body = pybullet.loadURDF(
                    str(path),
                    floats(position),
                    useFixedBase=fixed,
                    flags=pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER,
                    physicsClientId=self.client,
                )
            except pybullet.error as error:
                raise PhysicsError(f"cannot load {path.name}: {error}") from error
        self.clear_defaults(body)
        return int(body)

    def clear_defaults(self, body: int) -> None:
        """Remove what PyBullet adds to every body: dampings, joint motors, the joint speed limit of 100 rad/s."""
        for link in range(BASE, self.link_count(body)):
            pybullet.changeDynamics(
                body,
                link,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
                maxJointVelocity=1000.0,
                physicsClientId=self.client,
            )
        for link in range(self.link_count(body)):
            kind = pybullet.getJointInfo(body, link, physicsClientId=self.client)[2]
            if kind in (pybullet.JOINT_REVOLUTE, pybullet.JOINT_PRISMATIC):
                pybullet.setJointMotorControl2(
                    body, link, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=self.client
                )
            elif kind == pybullet.JOINT_SPHERICAL:
                pybullet.setJointMotorControlMultiDof(
                    body,
                    link,
                    pybullet.POSITION_CONTROL,
                    [0.0, 0.0, 0.0, 1.0],
                    force=[0.0, 0.0, 0.0],
                    physicsClientId=self.client,
                )

    def link_count(self, body: int) -> int:
        """Number of links besides the base; each has one joint to its parent."""
        return int(pybullet.getNumJoints(body, physicsClientId=self.client))

    def links(self, body: int) -> dict[str, int]:
        """Link name → index, the base included."""
        names = {pybullet.getBodyInfo(body, physicsClientId=self.client)[0].decode(): BASE}
        for link in range(self.link_count(body)):
            names[pybullet.getJointInfo(body, link, physicsClientId=self.client)[12].decode()] = link
        return names

    def inertial_frame(self, body: int, link: int = BASE) -> tuple[np.ndarray, np.ndarray]:
        """Position ``(3,)`` and quaternion ``(4,)`` of the centre-of-mass frame in the body frame."""
        if (body, link) not in self._inertial:
            dynamics = pybullet.getDynamicsInfo(body, link, physicsClientId=self.client)
            self._inertial[body, link] = np.array(dynamics[3]), rotation.from_xyzw(np.array(dynamics[4]))
        return self._inertial[body, link]

    @property
    def time(self) -> float:
        """Seconds simulated since the world was made (or since the state that was restored)."""
        return self.steps * self.time_step

    def base_tuples(self, body: int) -> TupleState:
        """State of the base's centre-of-mass frame as plain tuples: the fast way for loops over physics steps."""
        # by position, because names of arguments take a tenth of the time
        position, (x, y, z, w) = pybullet.getBasePositionAndOrientation(body, self.client)
        velocity, angular_velocity = pybullet.getBaseVelocity(body, self.client)
        return position, (w, x, y, z), velocity, angular_velocity

    def state(self, body: int, link: int = BASE) -> BodyState:
        """State of the body frame of one link (or the base); accelerations are None."""
        if link == BASE:
            return self._body_frame(body, link, *(np.array(part) for part in self.base_tuples(body)))
        return self.states(body, [link]).at(0)

    def states(self, body: int, links: Sequence[int]) -> BodyState:
        """States of several links, stacked along the first axis; :data:`BASE` may be among them."""
        moving = [link for link in links if link != BASE]
        # PyBullet reads invalid memory when the base is asked for as a link
        rows = pybullet.getLinkStates(body, moving, 1, 1, self.client) if moving else ()
        found: dict[int, TupleState] = {BASE: self.base_tuples(body)} if BASE in links else {}
        for link, (position, (x, y, z, w), *_, velocity, turning) in zip(moving, rows, strict=True):
            found[link] = position, (w, x, y, z), velocity, turning
        states = [self._body_frame(body, link, *map(np.array, found[link])) for link in links]
        stacked = (np.stack([np.asarray(state[field]) for state in states]) for field in range(5))
        return BodyState(*stacked)

    def _body_frame(
        self,
        body: int,
        link: int,
        position: np.ndarray,
        quaternion: np.ndarray,
        velocity: np.ndarray,
        angular_velocity: np.ndarray,
    ) -> BodyState:
        """Carry the state of a centre-of-mass frame to the body frame."""
        offset, axes = self.inertial_frame(body, link)
        orientation = rotation.multiply(quaternion, rotation.conjugate(axes))
        lever = rotation.rotate(orientation, offset)
        velocity = velocity - rotation.cross(angular_velocity, lever)
        return BodyState(self.time, position - lever, orientation, velocity, angular_velocity)

    def set_state(self, body: int, state: BodyState) -> None:
        """Set the state of the base's body frame; the joints keep their positions and rates."""
        offset, axes = self.inertial_frame(body)
        lever = rotation.rotate(state.orientation, offset)
        self.changes += 1
        pybullet.resetBasePositionAndOrientation(
            body,
            floats(state.position + lever),
            xyzw(rotation.multiply(state.orientation, axes)),
            physicsClientId=self.client,
        )
        velocity = state.velocity + rotation.cross(state.angular_velocity, lever)
        pybullet.resetBaseVelocity(body, floats(velocity), floats(state.angular_velocity), physicsClientId=self.client)

    def step(self) -> None:
        """Advance by one time step; forces applied before act in it and end with it."""
        pybullet.stepSimulation(self.client)
        self.steps += 1
        self.changes += 1

    def save(self) -> tuple[int, int]:
        """Keep the whole state in memory; :meth:`restore` returns to it bitwise, :meth:`forget` frees it."""
        return int(pybullet.saveState(physicsClientId=self.client)), self.steps

    def restore(self, saved: tuple[int, int]) -> None:
        """Return to a saved state of this world.

        Raises:
            PhysicsError: it was saved by another world, or forgotten.
        """
        try:
            pybullet.restoreState(stateId=saved[0], physicsClientId=self.client)
        except pybullet.error as error:
            raise PhysicsError(f"no state {saved[0]} in this world") from error
        self.steps = saved[1]
        self.changes += 1

    def forget(self, saved: tuple[int, int]) -> None:
        """Free a saved state."""
        pybullet.removeState(saved[0], physicsClientId=self.client)

    def close(self) -> None:
        """End the world; further calls do nothing."""
        client, self.client = self.client, -1
        if client >= 0:
            # a window that the user closed has ended the connection already
            with contextlib.suppress(pybullet.error):
                pybullet.disconnect(physicsClientId=client)

    def __reduce__(self) -> str:
        raise TypeError(
            "a PyBullet world can neither be copied nor pickled; copy or pickle the environment, which makes a world "
            "of its own, or use its snapshot() and restore()"
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        with contextlib.suppress(Exception):
            self.close()


def principal_axes(inertia: Vector) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments ``(3,)`` and the quaternion ``(4,)`` of their axes in the body frame.

    Args:
        inertia: moments ``(3,)`` along the body axes, or a symmetric tensor ``(3, 3)``, kg·m².

    Raises:
        ValueError: another shape, or a tensor that is not symmetric.
    """
    tensor = np.asarray(inertia, dtype=float)
    if tensor.shape == (3,):
        return tensor, np.array([1.0, 0.0, 0.0, 0.0])
    if tensor.shape != (3, 3) or not np.allclose(tensor, tensor.T):
        raise ValueError(f"inertia must be (3,) or a symmetric (3, 3), got shape {tensor.shape}")
    moments, axes = np.linalg.eigh(tensor)
    axes[:, 2] *= np.linalg.det(axes)
    return moments, rotation.from_matrix(axes)


def floats(vector: Vector) -> list[float]:
    """Plain floats, which PyBullet takes fastest."""
    return np.asarray(vector, dtype=float).tolist()


def xyzw(quaternion: Vector) -> list[float]:
    """PyBullet's order of a scalar-first quaternion."""
    return rotation.to_xyzw(np.asarray(quaternion, dtype=float)).tolist()
