"""Rotations; all rotation arithmetic of the package is here.

Unit quaternions are ``(..., 4)`` with the scalar first (w, x, y, z) and rotate body coordinates to world coordinates:
``v_world = rotate(q, v_body)``. The world is x east, y north, z up. Angles are radians. Every function broadcasts over
leading dimensions and works on NumPy arrays, torch tensors and traced expressions.
"""

from __future__ import annotations

import math

from .backend import Array, namespace, rows, together

SMALL_ANGLE_SQUARED = 1e-8
"""Below this squared angle (rad²) sin(x)/x and its kin are taken from their series, exact to double precision."""

NEWTON_STEPS = 8
"""Steps of :func:`nearest_matrix`: full precision unless two singular values almost vanish."""


def identity(like: Array) -> Array:
    """The quaternion of no rotation, with the batch shape and kind of the array ``like`` ``(..., n)``."""
    xp = namespace(like)
    zero = 0.0 * like[..., 0]
    return xp.stack([zero + 1.0, zero, zero, zero], axis=-1)


def norm(v: Array) -> Array:
    """Euclidean length ``(..., 1)`` of vectors ``(..., n)``; the last axis is kept, so that it divides ``v``."""
    xp = namespace(v)
    return xp.sqrt(xp.sum(v * v, axis=-1, keepdims=True))


def normalize(v: Array) -> Array:
    """Unit vector (or unit quaternion) along ``v`` ``(..., n)``; NaN for a zero vector."""
    return v / norm(v)


def multiply(p: Array, q: Array) -> Array:
    """Quaternion product ``p ⊗ q``: rotation by ``q``, then by ``p``."""
    xp = namespace(p, q)
    pw, px, py, pz = p[..., 0], p[..., 1], p[..., 2], p[..., 3]
    qw, qx, qy, qz = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    return together(
        xp,
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
    )


def conjugate(q: Array) -> Array:
    """Inverse of a unit quaternion."""
    xp = namespace(q)
    return xp.concat([q[..., :1], -q[..., 1:]], axis=-1)


def cross(a: Array, b: Array) -> Array:
    """Vector product ``a × b`` of ``(..., 3)`` arrays, broadcasting."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return together(namespace(a, b), [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def skew(v: Array) -> Array:
    """Matrix ``(..., 3, 3)`` with ``skew(v) @ b = v × b``."""
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    zero = 0.0 * x
    return rows([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


def rotate(q: Array, v: Array) -> Array:
    """Turn vectors ``(..., 3)`` by unit quaternions ``(..., 4)``: body coordinates to world coordinates."""
    u = q[..., 1:]
    t = 2.0 * cross(u, v)
    return v + q[..., :1] * t + cross(u, t)


def rotate_back(q: Array, v: Array) -> Array:
    """Turn vectors by the inverse of ``q``: world coordinates to body coordinates."""
    return rotate(conjugate(q), v)


def to_matrix(q: Array) -> Array:
    """Rotation matrix ``(..., 3, 3)`` of a unit quaternion: ``to_matrix(q) @ v = rotate(q, v)``."""
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    return rows(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def from_matrix(m: Array) -> Array:
    """Unit quaternion (w >= 0) of a rotation matrix ``(..., 3, 3)``; accurate for every angle.

    The four possible square roots are formed and the best conditioned one is chosen (Shepperd's method, without
    branches).
    """
    xp = namespace(m)
    m00, m11, m22 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    squares = xp.stack(
        [1.0 + m00 + m11 + m22, 1.0 + m00 - m11 - m22, 1.0 - m00 + m11 - m22, 1.0 - m00 - m11 + m22], axis=-1
    )
    a, b, c = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    d, e, f = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    candidates = [
        xp.stack([squares[..., 0], a, b, c], axis=-1),
        xp.stack([a, squares[..., 1], d, e], axis=-1),
        xp.stack([b, d, squares[..., 2], f], axis=-1),
        xp.stack([c, e, f, squares[..., 3]], axis=-1),
    ]
    best, q = squares[..., :1], candidates[0]
    for index in (1, 2, 3):
        larger = xp.greater(squares[..., index : index + 1], best)
        q = xp.where(larger, candidates[index], q)
        best = xp.where(larger, squares[..., index : index + 1], best)
    return positive(normalize(q))


def nearest_matrix(m: Array) -> Array:
    """The rotation matrix nearest to ``m`` ``(..., 3, 3)`` in the sense of the Frobenius norm, determinant +1.

    With the singular values s of m the largest root of p(λ) = (λ² − ‖m‖²)² − 8 λ det m − 4 ‖adj m‖² is
    λ = s₁ + s₂ ± s₃; Newton's steps from √3 ‖m‖ fall to it. No branches and no decomposition
    (F. L. Markley, "Attitude Determination using Vector Observations: a Fast Optimal Matrix Algorithm", Journal of the
    Astronautical Sciences 41(2), 1993). Not finite where the nearest rotation is not unique.
    """
    xp = namespace(m)
    first, second, third = m[..., 0, :], m[..., 1, :], m[..., 2, :]
    cofactors = xp.stack([cross(second, third), cross(third, first), cross(first, second)], axis=-2)
    determinant = xp.sum(first * cofactors[..., 0, :], axis=-1)
    squared = xp.sum(first * first + second * second + third * third, axis=-1)
    minors = 4.0 * xp.sum(cofactors[..., 0, :] ** 2 + cofactors[..., 1, :] ** 2 + cofactors[..., 2, :] ** 2, axis=-1)
    root = xp.sqrt(3.0 * squared)
    for _ in range(NEWTON_STEPS):
        rest = root * root - squared
        slope = 4.0 * root * rest - 8.0 * determinant
        root = root - (rest * rest - 8.0 * root * determinant - minors) / slope
    kappa = 0.5 * (root * root - squared)
    scale = kappa * root - determinant
    combined = (kappa + squared)[..., None, None] * m + root[..., None, None] * cofactors - m @ m.mT @ m
    return combined / scale[..., None, None]


def positive(q: Array) -> Array:
    """The one of ``q`` and ``-q`` (the same rotation) whose scalar part is not negative."""
    xp = namespace(q)
    return xp.where(xp.less(q[..., :1], 0.0), -q, q)


def exp(v: Array) -> Array:
    """Unit quaternion of a rotation vector ``(..., 3)``, radians."""
    xp = namespace(v)
    squared = xp.sum(v * v, axis=-1, keepdims=True)
    small = xp.less(squared, SMALL_ANGLE_SQUARED)
    angle = xp.sqrt(xp.where(small, 1.0 + 0.0 * squared, squared))
    half_sinc = xp.where(small, 0.5 - squared / 48.0, xp.sin(0.5 * angle) / angle)
    return xp.concat([xp.where(small, 1.0 - squared / 8.0, xp.cos(0.5 * angle)), half_sinc * v], axis=-1)


def log(q: Array) -> Array:
    """Rotation vector ``(..., 3)`` of a unit quaternion, length at most pi."""
    xp = namespace(q)
    q = positive(q)
    u = q[..., 1:]
    squared = xp.sum(u * u, axis=-1, keepdims=True)
    small = xp.less(squared, SMALL_ANGLE_SQUARED)
    sine = xp.sqrt(xp.where(small, 1.0 + 0.0 * squared, squared))
    w = q[..., :1]
    factor = xp.where(small, 2.0 / w - 2.0 * squared / (3.0 * w**3), 2.0 * xp.atan2(sine, w) / sine)
    return factor * u


def exp_matrix(v: Array) -> Array:
    """Rotation matrix ``(..., 3, 3)`` of a rotation vector ``(..., 3)``."""
    return to_matrix(exp(v))


def from_axis_angle(axis: Array, angle: Array) -> Array:
    """Unit quaternion that turns by ``angle`` ``(...)`` about the unit vector ``axis`` ``(..., 3)``."""
    return exp(axis * angle[..., None])


def from_euler_zyx(yaw: Array, pitch: Array, roll: Array) -> Array:
    """Unit quaternion of yaw, then pitch, then roll about the turned axes: ``Rz(yaw) Ry(pitch) Rx(roll)``."""
    xp = namespace(yaw, pitch, roll)
    cy, sy = xp.cos(0.5 * yaw), xp.sin(0.5 * yaw)
    cp, sp = xp.cos(0.5 * pitch), xp.sin(0.5 * pitch)
    cr, sr = xp.cos(0.5 * roll), xp.sin(0.5 * roll)
    return xp.stack(
        [
            cy * cp * cr + sy * sp * sr,
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
        ],
        axis=-1,
    )


def to_euler_zyx(q: Array) -> tuple[Array, Array, Array]:
    """Yaw, pitch and roll ``(...)`` of a unit quaternion; pitch in [-pi/2, pi/2].

    The three give the rotation back also at pitch ±pi/2, where only the sum or the difference of the others is defined
    (E. Bernardes, S. Viollet, "Quaternion to Euler angles conversion", PLOS ONE 17(11), 2022).
    """
    xp = namespace(q)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    half_sum, half_difference = xp.atan2(z + x, w - y), xp.atan2(z - x, w + y)
    ratio = xp.atan2(xp.sqrt((z - x) ** 2 + (w + y) ** 2), xp.sqrt((z + x) ** 2 + (w - y) ** 2))
    return wrap(half_sum + half_difference), 2.0 * ratio - 0.5 * math.pi, wrap(half_sum - half_difference)


def from_euler_xyz(first: Array, second: Array, third: Array) -> Array:
    """Unit quaternion of turns about x, then the turned y, then the turned z: ``Rx(first) Ry(second) Rz(third)``."""
    return conjugate(from_euler_zyx(-third, -second, -first))


def to_euler_xyz(q: Array) -> tuple[Array, Array, Array]:
    """The angles ``(...)`` of :func:`from_euler_xyz`; the second in [-pi/2, pi/2]."""
    third, second, first = to_euler_zyx(conjugate(q))
    return -first, -second, -third


def up_in_body(q: Array) -> Array:
    """Inclination vector (unit vector that points up) in body axes ``(..., 3)``: third row of the rotation matrix."""
    xp = namespace(q)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    return xp.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=-1)


def roll_pitch(up: Array) -> tuple[Array, Array]:
    """Roll and pitch (Z-Y-X angles) of the inclination vector in body axes ``(..., 3)``."""
    xp = namespace(up)
    x, y, z = up[..., 0], up[..., 1], up[..., 2]
    return xp.atan2(y, z), xp.atan2(-x, xp.sqrt(y * y + z * z))


def level(up: Array) -> Array:
    """Unit quaternion of zero yaw with the inclination vector ``up`` in body axes (any length, ``(..., 3)``)."""
    roll, pitch = roll_pitch(up)
    return from_euler_zyx(0.0 * roll, pitch, roll)


def angle(q: Array) -> Array:
    """Angle of rotation ``(...)`` in [0, pi] of a quaternion, whichever sign and (positive) length it has."""
    xp = namespace(q)
    return 2.0 * xp.atan2(norm(q[..., 1:])[..., 0], xp.abs(q[..., 0]))


def wrap(value: Array) -> Array:
    """The same angle in [-pi, pi]."""
    xp = namespace(value)
    return xp.atan2(xp.sin(value), xp.cos(value))


def from_xyzw(q: Array) -> Array:
    """Scalar-first quaternion of a scalar-last one (PyBullet, SciPy)."""
    return namespace(q).concat([q[..., 3:], q[..., :3]], axis=-1)


def to_xyzw(q: Array) -> Array:
    """Scalar-last quaternion (PyBullet, SciPy) of a scalar-first one."""
    return namespace(q).concat([q[..., 1:], q[..., :1]], axis=-1)


def random(generator: object, shape: tuple[int, ...] = ()) -> Array:
    """Uniformly distributed unit quaternions ``(*shape, 4)`` from a :class:`numpy.random.Generator`."""
    return normalize(generator.standard_normal((*shape, 4)))  # type: ignore[attr-defined]


def elementary_matrix(axis: int, angle: Array) -> Array:
    """Rotation matrix ``(..., 3, 3)`` about coordinate axis 0, 1 or 2 by ``angle`` ``(...)``."""
    xp = namespace(angle)
    c, s = xp.cos(angle), xp.sin(angle)
    if axis == 0:
        return rows([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    if axis == 1:
        return rows([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return rows([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def euler_matrix(sequence: str, angles: Array) -> Array:
    """Child-to-parent matrix ``(..., 3, 3)`` of turns about the new axes, e.g. ``"zxy"``: ``Rz(1) Rx(2) Ry(3)``.

    Args:
        sequence: three of the letters x, y, z.
        angles: ``(..., 3)`` rad, in the order of the sequence.
    """
    first, second, third = (elementary_matrix("xyz".index(name), angles[..., i]) for i, name in enumerate(sequence))
    return first @ second @ third


def euler_axes(sequence: str, angles: Array) -> Array:
    """Matrix ``(..., 3, 3)`` whose columns are the axes of :func:`euler_matrix`'s turns, in the parent's coordinates.

    The child's rate relative to the parent is this matrix times the rates of the angles.
    """
    xp = namespace(angles)
    a, b, c = ("xyz".index(name) for name in sequence)
    first = elementary_matrix(a, angles[..., 0])
    both = first @ elementary_matrix(b, angles[..., 1])
    unit = 0.0 * first + rows([[1.0 + 0.0 * angles[..., 0], 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    return xp.stack([unit[..., a], first[..., b], both[..., c]], axis=-1)


def euler_zxy(m: Array) -> Array:
    """Angles ``(..., 3)`` of ``m = Rz(1) Rx(2) Ry(3)``; the second in [-pi/2, pi/2]."""
    xp = namespace(m)
    first = xp.atan2(-m[..., 0, 1], m[..., 1, 1])
    return xp.stack([first, xp.asin(m[..., 2, 1]), xp.atan2(-m[..., 2, 0], m[..., 2, 2])], axis=-1)


def euler_yxy(m: Array, sign: float = -1.0) -> Array:
    """Angles ``(..., 3)`` of ``m = Ry(1) Rx(2) Ry(3)``; the second has the given sign."""
    xp = namespace(m)
    first = xp.atan2(sign * m[..., 0, 1], sign * m[..., 2, 1])
    third = xp.atan2(sign * m[..., 1, 0], -sign * m[..., 1, 2])
    return xp.stack([first, sign * xp.acos(m[..., 1, 1]), third], axis=-1)
