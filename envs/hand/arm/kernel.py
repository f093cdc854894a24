"""The motion of a device that an arm pulls, step by step, compiled.

World: x east, y north, z up; quaternions w, x, y, z, body to world.
"""

from __future__ import annotations

import math

import numpy as np

from ....filters.compile.cache import jit

REFERENCE = 25
"""Position, velocity, acceleration; quaternion, angular velocity and acceleration; unit noise of force and torque."""
SLIP = 0.1
"""Speed from which friction is full, m/s: below it grows with the speed, so that the integrator stays stable."""


@jit
def pulled(
    state: np.ndarray,
    late: np.ndarray,
    first: int,
    reference: np.ndarray,
    half: np.ndarray,
    parameters: np.ndarray,
    h: float,
    states: np.ndarray,
) -> None:
    """Step the device along a reference; semi-implicit Euler, the rotation by its exponential.

    Args:
        state: ``(13,)`` at the start; changed to that at the end.
        late: ``(n, 12)`` ring of the last n errors of position, velocity, attitude and angular velocity, changed.
        first: number of the first step since the gesture began, which selects the place in the ring.
        reference: ``(N, 25)`` at the start of each step.
        half: ``(3,)`` half the size of the device, m.
        parameters: of :meth:`Arm.parameters`.
        h: length of a step, s.
        states: ``(N, 13)``, filled with the state after each step.
    """
    known, mass = parameters[0], parameters[1]
    ix, iy, iz, jx, jy, jz = parameters[2:8]
    spring, damper, wrist, wrist_damper = parameters[8:12]
    foreseen, reflex, noise, grip, gravity = parameters[12:17]
    table, stiff, dashpot, friction = parameters[17:21]
    reach = math.sqrt(half[0] ** 2 + half[1] ** 2 + half[2] ** 2)
    matrix, error = np.empty((3, 3)), np.empty(12)
    force, torque, body = np.empty(3), np.empty(3), np.empty(3)
    for step in range(len(reference)):
        wanted = reference[step]
        w, x, y, z = state[3], state[4], state[5], state[6]
        matrix[0, 0], matrix[0, 1], matrix[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
        matrix[1, 0], matrix[1, 1], matrix[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
        matrix[2, 0], matrix[2, 1], matrix[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
        # errors now; the vector part of reference ⊗ actual⁻¹ is half the small angle between them
        d, a, b, c = wanted[9], wanted[10], wanted[11], wanted[12]
        twice = 2.0 if d * w + a * x + b * y + c * z >= 0.0 else -2.0
        error[6] = twice * (w * a - d * x + c * y - b * z)
        error[7] = twice * (w * b - d * y + a * z - c * x)
        error[8] = twice * (w * c - d * z + b * x - a * y)
        for i in range(3):
            error[i], error[3 + i] = wanted[i] - state[i], wanted[3 + i] - state[7 + i]
            error[9 + i] = wanted[13 + i] - state[10 + i]
        place = late[(first + step) % len(late)]
        # command and its noise, muscles, reflexes, weight
        command = known * math.sqrt(
            (foreseen * wanted[6]) ** 2 + (foreseen * wanted[7]) ** 2 + (foreseen * wanted[8] + gravity) ** 2
        )
        for i in range(3):
            force[i] = known * foreseen * wanted[6 + i] + noise * command * wanted[19 + i]
            force[i] += spring * (error[i] + reflex * place[i]) + damper * (error[3 + i] + reflex * place[3 + i])
            torque[i] = wrist * (error[6 + i] + reflex * place[6 + i]) + noise * grip * command * wanted[22 + i]
            torque[i] += wrist_damper * (error[9 + i] + reflex * place[9 + i])
            place[i], place[3 + i], place[6 + i], place[9 + i] = error[i], error[3 + i], error[6 + i], error[9 + i]
        force[2] += (known - mass) * gravity
        # the wrist's command: what Euler's equation of the known body asks for
        for i in range(3):
            body[i] = matrix[0, i] * wanted[16] + matrix[1, i] * wanted[17] + matrix[2, i] * wanted[18]
        body[0], body[1], body[2] = foreseen * jx * body[0], foreseen * jy * body[1], foreseen * jz * body[2]
        for i in range(3):
            torque[i] += matrix[i, 0] * body[0] + matrix[i, 1] * body[1] + matrix[i, 2] * body[2]
        # corners below the top of the table press and rub
        if state[2] - reach < table:
            for corner in range(8):
                body[0] = half[0] if corner & 1 else -half[0]
                body[1] = half[1] if corner & 2 else -half[1]
                body[2] = half[2] if corner & 4 else -half[2]
                rx = matrix[0, 0] * body[0] + matrix[0, 1] * body[1] + matrix[0, 2] * body[2]
                ry = matrix[1, 0] * body[0] + matrix[1, 1] * body[1] + matrix[1, 2] * body[2]
                rz = matrix[2, 0] * body[0] + matrix[2, 1] * body[1] + matrix[2, 2] * body[2]
                depth = table - state[2] - rz
                if depth > 0.0:
                    ux = state[7] + state[11] * rz - state[12] * ry
                    uy = state[8] + state[12] * rx - state[10] * rz
                    uz = state[9] + state[10] * ry - state[11] * rx
                    press = max(0.0, stiff * depth - dashpot * uz)
                    rub = -friction * press / max(SLIP, math.sqrt(ux * ux + uy * uy))
                    fx, fy = rub * ux, rub * uy
                    force[0] += fx
                    force[1] += fy
                    force[2] += press
                    torque[0] += ry * press - rz * fy
                    torque[1] += rz * fx - rx * press
                    torque[2] += rx * fy - ry * fx
        # Euler's equation in body axes: I α = T − ω × I ω
        p = matrix[0, 0] * state[10] + matrix[1, 0] * state[11] + matrix[2, 0] * state[12]
        q = matrix[0, 1] * state[10] + matrix[1, 1] * state[11] + matrix[2, 1] * state[12]
        r = matrix[0, 2] * state[10] + matrix[1, 2] * state[11] + matrix[2, 2] * state[12]
        for i in range(3):
            body[i] = matrix[0, i] * torque[0] + matrix[1, i] * torque[1] + matrix[2, i] * torque[2]
        body[0] = (body[0] - (iz - iy) * q * r) / ix
        body[1] = (body[1] - (ix - iz) * r * p) / iy
        body[2] = (body[2] - (iy - ix) * p * q) / iz
        for i in range(3):
            state[7 + i] += h * force[i] / mass
            state[10 + i] += h * (matrix[i, 0] * body[0] + matrix[i, 1] * body[1] + matrix[i, 2] * body[2])
            state[i] += h * state[7 + i]
        # attitude: exp(ω h) ⊗ q
        rate = math.sqrt(state[10] ** 2 + state[11] ** 2 + state[12] ** 2)
        half_angle = 0.5 * h * rate
        cosine = math.cos(half_angle)
        sine = 0.5 * h if rate == 0.0 else math.sin(half_angle) / rate
        ex, ey, ez = sine * state[10], sine * state[11], sine * state[12]
        nw = cosine * w - ex * x - ey * y - ez * z
        nx = cosine * x + ex * w + ey * z - ez * y
        ny = cosine * y - ex * z + ey * w + ez * x
        nz = cosine * z + ex * y - ey * x + ez * w
        size = math.sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
        state[3], state[4], state[5], state[6] = nw / size, nx / size, ny / size, nz / size
        for i in range(state.shape[0]):
            states[step, i] = state[i]
