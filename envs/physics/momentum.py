"""Forces from the rate of change of momentum, compiled: what acts on some links, without PyBullet's joint sensors."""

from __future__ import annotations

from ...filters.compile.cache import jit


@jit
def spin_momentum(frame, moments):  # type: ignore[no-untyped-def]
    """Angular momentum of a link about its own centre of mass: three numbers, N·m·s, world axes.

    The frame ``(18,)`` is that of :mod:`.kinematics`, the moments ``(3,)`` principal ones, kg·m².
    """
    x = y = z = 0.0
    for axis in range(3):
        ax, ay, az = frame[3 + axis], frame[6 + axis], frame[9 + axis]
        spin = moments[axis] * (ax * frame[15] + ay * frame[16] + az * frame[17])
        x += ax * spin
        y += ay * spin
        z += az * spin
    return x, y, z


@jit
def newton_euler(before, after, rows, masses, moments, point, duration, gravity):  # type: ignore[no-untyped-def]
    """Total wrench of external contacts on some links, from the rate of change of their momentum.

    Force = Σ m (Δv/Δt − g), moment about ``point`` = Σ (x − point) × m (Δv/Δt − g) + Δ(Σ R I Rᵀ ω)/Δt.

    Args:
        before: frames ``(n + 1, 18)`` of :mod:`.kinematics` before a physics step.
        after: after it; the step's accelerations belong to positions ``before``, as the integrator has it.
        rows: ``(k,)`` of the links in the frames.
        masses: ``(k,)`` kg.
        moments: ``(k, 3)`` principal moments of inertia, kg·m².
        point: three numbers, m, world.
        duration: of the step, s.
        gravity: m/s², along −z.

    Returns:
        Force, N, and moment, N·m: three numbers each, world axes.
    """
    force_x = force_y = force_z = moment_x = moment_y = moment_z = 0.0
    for index in range(rows.shape[0]):
        old, new, mass = before[rows[index]], after[rows[index]], masses[index]
        fx, fy = mass * (new[12] - old[12]) / duration, mass * (new[13] - old[13]) / duration
        fz = mass * ((new[14] - old[14]) / duration + gravity)
        x, y, z = old[0] - point[0], old[1] - point[1], old[2] - point[2]
        first, second = spin_momentum(old, moments[index]), spin_momentum(new, moments[index])
        force_x, force_y, force_z = force_x + fx, force_y + fy, force_z + fz
        moment_x += y * fz - z * fy + (second[0] - first[0]) / duration
        moment_y += z * fx - x * fz + (second[1] - first[1]) / duration
        moment_z += x * fy - y * fx + (second[2] - first[2]) / duration
    return (force_x, force_y, force_z), (moment_x, moment_y, moment_z)
