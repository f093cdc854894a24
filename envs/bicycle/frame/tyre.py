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

from ...physics.multibody import Tuple3
from ..course.terrain import Ground

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
        for name in ("stiffness", "shear_stiffness", "relaxation_length", "friction"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be positive and finite, got {getattr(self, name)}")
        if not (self.damping >= 0.0 and self.shear_damping >= 0.0):
            raise ValueError("damping and shear_damping must not be negative")


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


AIRBORNE = TyreForce((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)


class Tyre:
    """One tyre with its state: the deflections of the bristles.

    Args:
        radius: to the tread of the unloaded tyre, m.
        crown_radius: of the cross-section, m; 0 for a knife edge.
        parameters: the tyre.
        ground: what it rolls on.
        time_step: s.
        rolling_resistance: ratio of rolling drag to load.
    """

    def __init__(
        self,
        radius: float,
        crown_radius: float,
        parameters: TyreParameters,
        ground: Ground,
        time_step: float,
        rolling_resistance: float = 0.0,
    ) -> None:
        self.radius, self.crown_radius, self.parameters = radius, crown_radius, parameters
        self.ground, self.time_step, self.rolling_resistance = ground, time_step, rolling_resistance
        self.bristles = (0.0, 0.0)

    def force(self, centre: Tuple3, axle: Tuple3, velocity: Tuple3, turning: Tuple3) -> TyreForce:
        """Force during the next step; call once a step.

        Args:
            centre: of the wheel, m, world.
            axle: unit vector along the axle, to the left of the wheel, world.
            velocity: of the centre, m/s, world.
            turning: angular velocity of the wheel, rad/s, world.
        """
        tyre, dt = self.parameters, self.time_step
        cx, cy, cz = centre
        ax, ay, az = axle
        height, slope_x, slope_y = self.ground.height_and_slope(cx, cy)
        # normal of the ground, and sine of the wheel's lean against it
        length = 1.0 / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        nx, ny, nz = -slope_x * length, -slope_y * length, length
        lean = nx * ax + ny * ay + nz * az
        # down the wheel's plane to the circle of crown centres, then along the normal to the tread
        upright = math.sqrt(max(1e-9, 1.0 - lean * lean))
        arm = (self.radius - self.crown_radius) / upright
        rx = -arm * (nx - lean * ax) - self.crown_radius * nx
        ry = -arm * (ny - lean * ay) - self.crown_radius * ny
        rz = -arm * (nz - lean * az) - self.crown_radius * nz
        px, py, pz = cx + rx, cy + ry, cz + rz
        if slope_x or slope_y or height != 0.0:
            height = self.ground.height_and_slope(px, py)[0]
        # normal force: spring and damper along the normal, never pulling
        penetration = (height - pz) * nz
        if penetration <= 0.0:
            self.bristles = (0.0, 0.0)
            return AIRBORNE
        vx, vy, vz = velocity
        wx, wy, wz = turning
        ux, uy, uz = vx + wy * rz - wz * ry, vy + wz * rx - wx * rz, vz + wx * ry - wy * rx
        load = max(0.0, tyre.stiffness * penetration - tyre.damping * (ux * nx + uy * ny + uz * nz))
        # forward = axle × normal, sideways = normal × forward
        tx, ty, tz = (ay * nz - az * ny) / upright, (az * nx - ax * nz) / upright, (ax * ny - ay * nx) / upright
        sx, sy, sz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        # velocities of the tread point and of the wheel's centre along these axes; lateral deflection by camber
        slip, side_slip = ux * tx + uy * ty + uz * tz, ux * sx + uy * sy + uz * sz
        rolling = vx * tx + vy * ty + vz * tz
        camber = lean / upright * load / tyre.shear_stiffness if tyre.camber_thrust else 0.0
        # implicit Euler: stable however short the relaxation length
        rate = abs(rolling) / tyre.relaxation_length
        forward = (self.bristles[0] + dt * slip) / (1.0 + dt * rate)
        sideways = (self.bristles[1] + dt * (side_slip + rate * camber)) / (1.0 + dt * rate)
        # shear force of the bristles, limited by Coulomb friction; beyond it they slide
        along = -(tyre.shear_stiffness * forward + tyre.shear_damping * slip)
        across = -(tyre.shear_stiffness * sideways + tyre.shear_damping * side_slip)
        shear, limit = math.hypot(along, across), tyre.friction * load
        if shear > limit:
            along, across = along * limit / shear, across * limit / shear
            forward, sideways = -along / tyre.shear_stiffness, -across / tyre.shear_stiffness
        self.bristles = (forward, sideways)
        force = (
            load * nx + along * tx + across * sx,
            load * ny + along * ty + across * sy,
            load * nz + along * tz + across * sz,
        )
        if self.rolling_resistance:
            # the load acts a little ahead of the contact: its moment brakes the wheel
            ahead = self.rolling_resistance * self.radius * math.tanh(rolling / ROLLING_SPEED)
            px, py, pz = px + ahead * tx, py + ahead * ty, pz + ahead * tz
        return TyreForce(force, (px, py, pz), load)
