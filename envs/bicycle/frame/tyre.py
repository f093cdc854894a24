"""Force of the ground on a rolling tyre: a torus on an analytic ground, computed outside PyBullet.

The tyre's nearest point carries a spring and damper along the ground's normal; friction is a pair of bristles (forward
and sideways) that deflect with the slip, relax over a rolling length and saturate at the friction limit; camber bends
the sideways bristle so that a leaning wheel needs no slip to carry its load straight down the wheel's plane. A contact
of PyBullet's own would need a knife-edge disc and an even plane; this one also rolls over bumps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ....filters.compile.cache import jit
from ....filters.support.parameters import check_positive
from ...physics.multibody import Tuple3
from ..course.terrain import Ground, height_and_slope

ROLLING_SPEED = 0.05
"""m/s: rolling drag is full well above this speed"""


@dataclass(frozen=True)
class TyreParameters:
    """Parameters of a tyre; defaults are rounded values of a bicycle tyre at about 3 bar (choice of this project).

    Raises:
        ValueError: a stiffness, length or friction that is not positive, or a negative damping.
    """

    stiffness: float = 1.2e5
    """N/m, radial"""
    damping: float = 400.0
    """N·s/m, radial"""
    shear_stiffness: float = 1.0e5
    """N/m of the bristles, forward and sideways"""
    shear_damping: float = 300.0
    """N·s/m"""
    relaxation_length: float = 0.1
    """m: relaxation length of a bristle; cornering stiffness = shear stiffness times this"""
    friction: float = 0.9
    """1: largest ratio of shear force to load"""
    camber_thrust: bool = True
    """whether a leaning wheel has a camber thrust of tan(camber) times the load"""

    def __post_init__(self) -> None:
        check_positive(
            self, "stiffness", "shear_stiffness", "relaxation_length", "friction", or_zero=("damping", "shear_damping")
        )


BENCHMARK_TYRE = TyreParameters(3.0e5, 1500.0, 3.0e5, 1500.0, 2.0, 1.0)
"""A tyre close to the rigid, slip-free wheels of linear theory, for the benchmark bicycle at steps of 1 ms.

With it all four eigenvalues at 3, 5 and 6 m/s lie within 1.3 % of theory. A softer tyre slips a little sideways while
the front wheel casters, which moves this fastest mode by 6 to 9 % (bicycle tyre) and the others by less than 1 %; one
twice as stiff is too stiff for a step of 1 ms.
"""


class TyreForce(NamedTuple):
    """Force of the ground on a tyre, world axes."""

    force: Tuple3
    """N"""
    point: Tuple3
    """m: where it acts"""
    load: float
    """N: its part along the normal"""


@jit
def tyre_force(tyre, ground, time_step, centre, axle, velocity, turning, bristles, found):  # type: ignore[no-untyped-def]
    """Force of the ground on a tyre during the next step.

    Args:
        tyre: :attr:`Tyre.numbers`.
        ground: table of the ground.
        time_step: s.
        centre: of the wheel, m, world.
        axle: unit vector along the axle, to the left of the wheel, world.
        velocity: of the centre, m/s, world.
        turning: angular velocity of the wheel, rad/s, world.
        bristles: ``(2,)`` deflections forward and sideways, m; advanced by one step.
        found: ``(7,)`` force (N), point where it acts (m) and load (N), overwritten.
    """
    radius, crown, rolling_resistance, camber_thrust = tyre[0], tyre[1], tyre[2], tyre[3]
    stiffness, damping, shear_stiffness, shear_damping = tyre[4], tyre[5], tyre[6], tyre[7]
    relaxation_length, friction = tyre[8], tyre[9]
    cx, cy, cz = centre
    ax, ay, az = axle
    height, slope_x, slope_y = height_and_slope(ground, cx, cy)
    # normal of the ground, and sine of the wheel's lean against it
    length = 1.0 / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
    nx, ny, nz = -slope_x * length, -slope_y * length, length
    lean = nx * ax + ny * ay + nz * az
    # down the wheel's plane to the circle of crown centres, then along the normal to the tread
    upright = math.sqrt(max(1e-9, 1.0 - lean * lean))
    arm = (radius - crown) / upright
    rx = -arm * (nx - lean * ax) - crown * nx
    ry = -arm * (ny - lean * ay) - crown * ny
    rz = -arm * (nz - lean * az) - crown * nz
    px, py, pz = cx + rx, cy + ry, cz + rz
    if slope_x != 0.0 or slope_y != 0.0 or height != 0.0:
        height = height_and_slope(ground, px, py)[0]
    # normal force: spring and damper along the normal, never pulling
    penetration = (height - pz) * nz
    if penetration <= 0.0:
        bristles[:] = 0.0
        found[:] = 0.0
        return
    vx, vy, vz = velocity
    wx, wy, wz = turning
    ux, uy, uz = vx + wy * rz - wz * ry, vy + wz * rx - wx * rz, vz + wx * ry - wy * rx
    load = max(0.0, stiffness * penetration - damping * (ux * nx + uy * ny + uz * nz))
    # forward = axle × normal, sideways = normal × forward
    tx, ty, tz = (ay * nz - az * ny) / upright, (az * nx - ax * nz) / upright, (ax * ny - ay * nx) / upright
    sx, sy, sz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    # velocities of the tread point and of the wheel's centre along these axes; lateral deflection by camber
    slip, side_slip = ux * tx + uy * ty + uz * tz, ux * sx + uy * sy + uz * sz
    rolling = vx * tx + vy * ty + vz * tz
    camber = lean / upright * load / shear_stiffness * camber_thrust
    # implicit Euler: stable however short the relaxation length
    rate = abs(rolling) / relaxation_length
    forward = (bristles[0] + time_step * slip) / (1.0 + time_step * rate)
    sideways = (bristles[1] + time_step * (side_slip + rate * camber)) / (1.0 + time_step * rate)
    # shear force of the bristles, limited by Coulomb friction; beyond it they slide
    along = -(shear_stiffness * forward + shear_damping * slip)
    across = -(shear_stiffness * sideways + shear_damping * side_slip)
    shear, limit = math.hypot(along, across), friction * load
    if shear > limit:
        along, across = along * limit / shear, across * limit / shear
        forward, sideways = -along / shear_stiffness, -across / shear_stiffness
    bristles[0], bristles[1] = forward, sideways
    # the load acts a little ahead of the contact: its moment brakes the wheel
    ahead = rolling_resistance * radius * math.tanh(rolling / ROLLING_SPEED)
    found[0] = load * nx + along * tx + across * sx
    found[1] = load * ny + along * ty + across * sy
    found[2] = load * nz + along * tz + across * sz
    found[3], found[4], found[5], found[6] = px + ahead * tx, py + ahead * ty, pz + ahead * tz, load


class Tyre:
    """One tyre with its state: the deflections of the bristles.

    Args:
        radius: to the tread of the unloaded tyre, m.
        crown_radius: of the cross-section, m; 0 for a knife edge.
        parameters: the tyre.
        rolling_resistance: ratio of rolling drag to load.
        memory: ``(2,)`` array to keep the bristles' deflections in; None for a new one.
    """

    def __init__(
        self,
        radius: float,
        crown_radius: float,
        parameters: TyreParameters,
        rolling_resistance: float = 0.0,
        memory: np.ndarray | None = None,
    ) -> None:
        self.parameters, p = parameters, parameters
        shape = (radius, crown_radius, rolling_resistance, float(p.camber_thrust))
        shear = (p.shear_stiffness, p.shear_damping, p.relaxation_length, p.friction)
        self.numbers = np.array([*shape, p.stiffness, p.damping, *shear])
        self.memory = np.zeros(2) if memory is None else memory

    @property
    def bristles(self) -> tuple[float, float]:
        """Deflections forward and sideways, m."""
        forward, sideways = self.memory.tolist()
        return forward, sideways

    @bristles.setter
    def bristles(self, deflections: tuple[float, float]) -> None:
        self.memory[:] = deflections

    def force(
        self, ground: Ground, time_step: float, centre: Tuple3, axle: Tuple3, velocity: Tuple3, turning: Tuple3
    ) -> TyreForce:
        """:func:`tyre_force` during the next step (s) on some ground; advances the bristles by this step."""
        found = np.zeros(7)
        tyre_force(self.numbers, ground.table, time_step, centre, axle, velocity, turning, self.memory, found)
        return tyre_force_of(found)


def tyre_force_of(numbers: np.ndarray) -> TyreForce:
    """The force in the numbers ``(7,)`` that :func:`tyre_force` wrote."""
    x, y, z, px, py, pz, load = numbers.tolist()
    return TyreForce((x, y, z), (px, py, pz), load)
