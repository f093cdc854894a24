"""Calibration arithmetic on data made here, against SciPy and NumPy; what is degenerate is refused with its reason."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.filters.arrays.calibration.frame import align_axes, nearest_rotation, procrustes
from poise.filters.arrays.calibration.magnetometer import align_magnetometer, fit_ellipsoid
from poise.filters.arrays.calibration.rate_table import calibrate_accelerometer, calibrate_gyroscope, saturated

G = 9.81
UPWARD = {"first": 0.0, "second": 0.0, "up": 1.0}
TRUE = {"scale": 0.0392, "offset": -0.31, "first": 0.143, "second": -0.058}


def table(seed=0, noise=0.02, per_rate=100, rates=(80, 240, 400, 560, 720)):
    """Raw readings of an accelerometer carried around, from the acceleration of its circle (not from the formula)."""
    generator = np.random.default_rng(seed)
    rate, mounting, reading = [], [], []
    for name in ("first", "second"):
        for omega in np.radians(rates):
            # position ρ(cos ωt, sin ωt), sensitive axis along it: the reading is the second derivative along the axis
            t = generator.uniform(0.0, 1.0, per_rate)
            radius, h = TRUE[name], 1e-4
            path = [radius * np.stack([np.cos(omega * s), np.sin(omega * s)]) for s in (t - h, t, t + h)]
            axis = np.stack([np.cos(omega * t), np.sin(omega * t)])
            rate += [omega] * per_rate
            mounting += [name] * per_rate
            reading += np.sum(axis * (path[0] - 2 * path[1] + path[2]) / h**2, axis=0).tolist()
    rate, mounting = [*rate, *[0.0] * per_rate], [*mounting, *["up"] * per_rate]
    reading = np.array([*reading, *[G] * per_rate]) + noise * generator.standard_normal(len(rate))
    return (reading - TRUE["offset"]) / TRUE["scale"], np.array(rate), np.array(mounting)


@pytest.mark.parametrize("seed", range(5))
def test_four_unknowns_are_found(seed):
    raw, rate, mounting = table(seed)
    found = calibrate_accelerometer(np.rint(raw), rate, mounting, UPWARD, gravity=G)
    assert found.scale == pytest.approx(TRUE["scale"], rel=1e-3)
    assert found.offset == pytest.approx(TRUE["offset"], abs=5e-3)
    for name in ("first", "second"):
        assert found.positions[name] == pytest.approx(TRUE[name], abs=5e-4)
    assert found.residual == pytest.approx(math.hypot(0.02, TRUE["scale"] / math.sqrt(12.0)), rel=0.2)
    assert (found.samples, found.discarded) == (len(raw), 0)


def test_a_whole_position_is_not_determined():
    """The thesis' (4.5) with all of r: rank 3 of 5."""
    raw, rate, mounting = table(noise=0.0)
    axis = np.array([1.0, 0.0, 0.0])
    one = mounting == "first"
    centripetal = rate[one, None] ** 2 * np.array([1.0, 1.0, 0.0]) * axis
    columns = np.concatenate([raw[one, None], np.ones((one.sum(), 1)), centripetal], axis=1)
    values = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1.0), compute_uv=False)
    assert np.sum(values > 1e-6 * values[0]) <= 3


def test_degenerate_runs_are_refused_with_their_reason():
    raw, rate, mounting = table()
    level = mounting != "up"
    with pytest.raises(ValueError, match="no pose in which the axis points up"):
        calibrate_accelerometer(raw[level], rate[level], mounting[level], UPWARD)
    with pytest.raises(ValueError, match=r"do not separate scale, offset \(singular normal matrix\)"):
        calibrate_accelerometer(np.full(50, 3.0), np.zeros(50), np.full(50, "up"), UPWARD)
    one_rate = (mounting == "up") | (rate == rate[0])
    with pytest.raises(ValueError, match="'first' needs at least two different rates"):
        calibrate_accelerometer(raw[one_rate], rate[one_rate], mounting[one_rate], UPWARD)
    with pytest.raises(ValueError, match=r"upward must contain every mounting; \['up'\] are missing"):
        calibrate_accelerometer(raw, rate, mounting, {"first": 0.0, "second": 0.0})
    with pytest.raises(ValueError, match="every sample is saturated"):
        calibrate_accelerometer(raw, rate, mounting, UPWARD, saturation=0.0)
    with pytest.raises(ValueError, match="columns of one length"):
        calibrate_accelerometer(raw[:-1], rate, mounting, UPWARD)
    with pytest.raises(ValueError, match="3 unknowns need at least as many samples, got 2"):
        calibrate_accelerometer(np.array([1.0, 2.0]), np.array([1.0, 2.0]), np.array(["a", "a"]), {"a": 0.5})
    with pytest.raises(ValueError, match="rate must be finite"):
        calibrate_accelerometer(raw, np.where(rate > 0, rate, np.nan), mounting, UPWARD)


def test_saturated_readings_are_told_and_left_out():
    raw, rate, mounting = table()
    raw = np.clip(np.rint(raw), -300, 300)
    found = calibrate_accelerometer(raw, rate, mounting, UPWARD, gravity=G)
    assert found.discarded == 200
    assert found.scale == pytest.approx(TRUE["scale"], rel=3e-3)
    clipped = calibrate_accelerometer(raw, rate, mounting, UPWARD, gravity=G, saturation=1e9)
    assert abs(clipped.scale / TRUE["scale"] - 1.0) > 0.02
    centred = np.full(40, 7.0)
    assert not saturated(centred, np.repeat([1.0, 2.0], 20), np.full(40, "first"), None).any()


def gyroscope(seed=0, rates=range(-325, 351, 25), noise=2.0, end=32767):
    generator = np.random.default_rng(seed)
    rate = np.radians(np.repeat(np.array(rates, dtype=float), 40))
    raw = (rate + 0.0087) / 1.531e-4 + noise * generator.standard_normal(len(rate))
    return np.clip(np.rint(raw), -end, end), rate


@pytest.mark.parametrize("seed", range(5))
def test_gyroscope_line_without_what_is_saturated(seed):
    raw, rate = gyroscope(seed)
    found = calibrate_gyroscope(raw, rate)
    kept = np.abs(raw) < 32767
    line = np.polyfit(raw[kept], rate[kept], 1)
    assert found.scale == pytest.approx(1.531e-4, rel=1e-4)
    assert found.offset == pytest.approx(-0.0087, abs=1e-4)
    assert (found.scale, found.offset) == pytest.approx(tuple(line), rel=1e-6)
    assert found.discarded == np.sum(~kept) > 100
    assert calibrate_gyroscope(raw, rate, saturation=32767).scale == pytest.approx(found.scale, rel=1e-12)


def test_gyroscope_needs_three_rates():
    raw, rate = gyroscope(rates=(-100, 100))
    with pytest.raises(ValueError, match="at least three different rates that are not saturated are needed, got 2"):
        calibrate_gyroscope(raw, rate)
    with pytest.raises(ValueError, match="got 0"):
        calibrate_gyroscope(*gyroscope(), saturation=1.0)
    with pytest.raises(ValueError, match="do not separate scale, offset"):
        calibrate_gyroscope(np.full(60, 5.0), np.repeat([1.0, 2.0, 3.0], 20), saturation=9.0)


ROOT = np.array([[1.0, 0.05, -0.02], [0.05, 0.9, 0.03], [-0.02, 0.03, 1.15]]) / 300.0
CENTRE = np.array([80.0, -130.0, 45.0])


def tumbling(seed, count=1500, noise=1.0):
    generator = np.random.default_rng(seed)
    attitude = Rotation.random(count, random_state=seed)
    field = np.array([0.1, 0.42, -0.9]) / np.linalg.norm([0.1, 0.42, -0.9])
    mounted = Rotation.from_rotvec(np.random.default_rng(seed + 100).normal(0.0, 0.8, 3))
    unit = mounted.inv().apply(attitude.inv().apply(field))
    raw = unit @ np.linalg.inv(ROOT).T + CENTRE + noise * generator.standard_normal((count, 3))
    return raw, attitude, mounted, field


@pytest.mark.parametrize("seed", range(5))
def test_ellipsoid_and_alignment_are_found(seed):
    raw, attitude, mounted, field = tumbling(seed)
    ellipsoid = fit_ellipsoid(raw)
    np.testing.assert_allclose(ellipsoid.centre, CENTRE, atol=0.4)
    np.testing.assert_allclose(ellipsoid.root, ROOT, atol=0.003 / 300.0)
    unit = (raw - ellipsoid.centre) @ ellipsoid.root
    found = align_magnetometer(unit, attitude.as_quat()[:, [3, 0, 1, 2]])
    error = Rotation.from_matrix(found.matrix) * mounted.inv()
    assert np.degrees(error.magnitude()) < 0.1
    assert np.degrees(np.arccos(found.field @ field)) < 0.1


def test_refinement_is_a_minimum_of_the_distance():
    raw, *_ = tumbling(3, noise=10.0)
    fit = fit_ellipsoid(raw)

    def cost(centre, root):
        return np.sum((np.linalg.norm((raw - centre) @ root, axis=1) - 1.0) ** 2)

    best = cost(fit.centre, fit.root)
    for index in range(3):
        for step in (-0.5, 0.5):
            assert cost(fit.centre + step * np.eye(3)[index], fit.root) > best
            shifted = fit.root.copy()
            shifted[index, index] *= 1.0 + 1e-3 * step
            assert cost(fit.centre, shifted) > best


def test_alignment_reaches_the_global_minimum_from_far():
    """A half turn of the mounting, at which one start alone may end elsewhere."""
    generator = np.random.default_rng(1)
    attitude = Rotation.random(200, random_state=1)
    field = np.array([0.0, 1.0, 0.0])
    for rotvec in ([math.pi, 0.0, 0.0], [0.0, 2.2, 2.2], [0.0, 0.0, -math.pi]):
        mounted = Rotation.from_rotvec(rotvec)
        unit = mounted.inv().apply(attitude.inv().apply(field)) + 0.01 * generator.standard_normal((200, 3))
        found = align_magnetometer(unit, attitude.as_quat()[:, [3, 0, 1, 2]])
        assert np.degrees((Rotation.from_matrix(found.matrix) * mounted.inv()).magnitude()) < 0.5


def test_readings_that_are_no_ellipsoid_are_refused():
    raw, attitude, *_ = tumbling(0)
    with pytest.raises(ValueError, match=r"raw must have shape \(T, 3\), got \(1500, 2\)"):
        fit_ellipsoid(raw[:, :2])
    with pytest.raises(ValueError, match="at least 30 samples are needed, got 12"):
        fit_ellipsoid(raw[:12])
    with pytest.raises(ValueError, match="lie in a plane"):
        fit_ellipsoid(raw * [1.0, 1.0, 0.0])
    generator = np.random.default_rng(0)
    u, v = generator.uniform(-1.5, 1.5, 400), generator.uniform(0.0, 2 * math.pi, 400)
    hyperboloid = np.stack([np.cosh(u) * np.cos(v), np.cosh(u) * np.sin(v), np.sinh(u)], axis=-1)
    with pytest.raises(ValueError, match="do not lie on an ellipsoid"):
        fit_ellipsoid(100.0 * hyperboloid)
    with pytest.raises(ValueError, match=r"do not lie on an ellipsoid|cover too little|do not determine"):
        fit_ellipsoid(generator.uniform(-1.0, 1.0, (400, 3)) ** 3)
    quaternions = attitude.as_quat()[:, [3, 0, 1, 2]]
    unit = (raw - CENTRE) @ ROOT
    with pytest.raises(ValueError, match="must be"):
        align_magnetometer(unit, quaternions[:-1])
    with pytest.raises(ValueError, match="one is zero"):
        align_magnetometer(unit, quaternions * (np.arange(len(unit)) != 7)[:, None])
    spin = Rotation.from_rotvec(np.linspace(0, 6, 300)[:, None] * [0, 0, 1.0])
    flat = spin.inv().apply([0.0, 0.5, -0.8])
    with pytest.raises(ValueError, match="turn the device about at least two axes"):
        align_magnetometer(flat, spin.as_quat()[:, [3, 0, 1, 2]])


def test_frames_are_aligned_and_mirrors_refused():
    generator = np.random.default_rng(4)
    truth = Rotation.from_rotvec([0.5, -1.1, 0.7])
    other = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]) / np.array([[1], [1], [1], [math.sqrt(3)]])
    body = truth.apply(other) + 1e-3 * generator.standard_normal((4, 3))
    fit = align_axes(body, other)
    expected, _ = Rotation.align_vectors(body, other)
    assert np.degrees((Rotation.from_matrix(fit.matrix) * expected.inv()).magnitude()) < 0.05
    assert np.degrees((Rotation.from_matrix(fit.matrix) * truth.inv()).magnitude()) < 0.2
    assert fit.residual < 3e-3
    with pytest.raises(ValueError, match="reflection"):
        align_axes(body * [1, 1, -1], other)
    with pytest.raises(ValueError, match="span three dimensions"):
        align_axes(body[:2], other[:2])
    with pytest.raises(ValueError, match="axes_other must be directions, row 4 is zero"):
        align_axes(body, other * [[1], [1], [1], [0]])
    with pytest.raises(ValueError, match="shape \\(n, 3\\)"):
        align_axes(body, other[:3])


def test_procrustes_gives_determinant_and_nearest_rotation():
    matrix = np.random.default_rng(2).normal(size=(3, 3))
    for m in (matrix, matrix * [[1], [1], [-1]]):
        nearest, values, determinant = procrustes(m)
        assert determinant == pytest.approx(np.linalg.det(nearest))
        assert values[0] >= values[-1]
        turned = nearest_rotation(m)
        assert np.linalg.det(turned) == pytest.approx(1.0)
        best = np.sum((turned - m) ** 2)
        others = Rotation.random(4000, random_state=0).as_matrix()
        assert best <= np.sum((others - m) ** 2, axis=(1, 2)).min()
