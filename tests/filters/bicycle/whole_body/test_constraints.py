"""Limbs held at both ends: inverse kinematics, constraints, angles of elbow and knee."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sympy import lambdify
from sympy.physics.mechanics import Point, ReferenceFrame, dynamicsymbols

from poise.filters.bicycle.whole_body import constraints as limb_constraints
from poise.filters.bicycle.whole_body.constraints import hip_angles, limb_frame, shoulder_angles
from poise.filters.bicycle.whole_body.linkage import RiderLinkage

from .whole_body_cases import RIDER

LINKAGE = RiderLinkage.for_rider(RIDER)
TRUNK = np.radians([-33.0, 0.0, 0.0])
ORIGIN = np.zeros(1)


def leg_at(side, crank, swivel=0.0):
    hip = LINKAGE.point(LINKAGE.hip, side, ORIGIN)
    # the fixtures' angle is that of the side's own pedal, 0 in front
    foot = LINKAGE.pedal(side, np.array([crank + math.pi * (side == "right")]))
    frame, knee = limb_frame(hip, foot, LINKAGE.thigh, LINKAGE.knee_to_pedal, np.array([1.0, 0, 0]), "leg", swivel)
    return hip, foot, knee, hip_angles(frame)


def arm_at(side, trunk, steer, swivel=0.0):
    pivot, joint = LINKAGE.point(LINKAGE.trunk_pivot, "left", ORIGIN), LINKAGE.point(LINKAGE.shoulder, side, ORIGIN)
    R = Rotation.from_euler("ZXY", trunk).as_matrix()
    hand = LINKAGE.hand(side, np.array([steer]))
    outward = np.array([0.0, 0.0, 1.0 if side == "right" else -1.0])
    frame, elbow = limb_frame(pivot + R @ joint, hand, LINKAGE.upper_arm, LINKAGE.forearm, outward, "arm", swivel)
    return pivot, joint, hand, elbow, shoulder_angles(R, frame)


def knee_of(hip, foot):
    return limb_constraints.knee_flexion(
        hip, foot, LINKAGE.thigh, LINKAGE.shank, LINKAGE.ankle_to_pedal, LINKAGE.ankle_angle
    )


@pytest.mark.parametrize(
    ("crank", "angles", "flexion"),
    [
        (0.0, (62.097678, -1.374734, 2.594143), 83.064998),
        (0.5, (30.318116, -2.029757, 1.186538), 52.086874),
        (1.0, None, 101.078743),
        (1.5, None, 124.688633),
    ],
)
def test_right_leg(crank, angles, flexion):
    hip, foot, knee, found = leg_at("right", crank * math.pi)
    if crank == 0.0:
        np.testing.assert_allclose(knee, [0.622585, 0.760865, 0.095340], atol=1e-6)
    if angles is not None:
        np.testing.assert_allclose(np.degrees(found), angles, atol=1e-6)
    assert math.degrees(knee_of(hip, foot)) == pytest.approx(flexion, abs=1e-6)


def test_right_arm():
    *_, elbow, angles = arm_at("right", TRUNK, 0.0)
    np.testing.assert_allclose(elbow, [0.673592, 1.189413, 0.443707], atol=1e-6)
    np.testing.assert_allclose(np.degrees(angles), [37.542407, -78.099643, 15.020196], atol=1e-6)
    pivot, joint, hand, _, angles = arm_at("right", TRUNK, math.radians(20.0))
    np.testing.assert_allclose(hand, [0.876848, 1.068219, 0.247889], atol=1e-6)
    np.testing.assert_allclose(np.degrees(angles), [46.644855, -84.381777, 5.281061], atol=1e-6)
    for steer, flexion in ((0.0, 93.407361), (math.radians(20.0), 83.191246)):
        hand = LINKAGE.hand("right", np.array([steer]))
        found = limb_constraints.elbow_flexion(TRUNK, pivot, joint, hand, LINKAGE.upper_arm, LINKAGE.forearm)
        assert math.degrees(found) == pytest.approx(flexion, abs=1e-6)


@pytest.mark.parametrize("side", ["right", "left"])
def test_inverse_kinematics_meets_the_constraints(side):
    trunk = np.array([-0.6, 0.1, -0.05])
    pivot, joint, hand, _, shoulder = arm_at(side, trunk, 0.1)
    found = limb_constraints.arm(trunk, shoulder, pivot, joint, hand, LINKAGE.upper_arm, LINKAGE.forearm)
    np.testing.assert_allclose(found.residuals, 0.0, atol=1e-12)
    hip, foot, _, angles = leg_at(side, 2.0)
    found = limb_constraints.leg(angles, hip, foot, LINKAGE.thigh, LINKAGE.knee_to_pedal, "x")
    np.testing.assert_allclose(found.residuals, 0.0, atol=1e-12)
    # off the usual plane only the swivel constraints notice
    *_, shoulder = arm_at(side, trunk, 0.1, swivel=0.2)
    found = limb_constraints.arm(trunk, shoulder, pivot, joint, hand, LINKAGE.upper_arm, LINKAGE.forearm)
    np.testing.assert_allclose(found.residuals[:2], 0.0, atol=1e-12)
    assert abs(found.residuals[2]) > 0.05


def test_mirrored_riders_have_mirrored_limbs():
    for right, left in zip(arm_at("right", TRUNK, 0.0)[2:4], arm_at("left", TRUNK, 0.0)[2:4], strict=True):
        np.testing.assert_allclose(left, right * [1.0, 1.0, -1.0], atol=1e-12)
    right, left = leg_at("right", 1.0)[3], leg_at("left", 1.0)[3]
    np.testing.assert_allclose(left, right * [1.0, -1.0, -1.0], atol=1e-12)


def test_constraints_against_sympy_points():
    """The same residuals from frames and points of sympy.physics.mechanics."""
    angles = dynamicsymbols("t1:4 p1:4")
    bicycle, trunk, arm = ReferenceFrame("B"), ReferenceFrame("T"), ReferenceFrame("H")
    trunk.orient_body_fixed(bicycle, angles[:3], "ZXY")
    arm.orient_body_fixed(trunk, angles[3:], "YXY")
    pivot, joint, hand, _, _ = arm_at("right", TRUNK, 0.2)
    vector = lambda frame, values: sum(float(v) * axis for v, axis in zip(values, frame, strict=True))  # noqa: E731
    ground = Point("O")
    shoulder = ground.locatenew("S", vector(bicycle, pivot) + vector(trunk, joint))
    elbow = shoulder.locatenew("E", -LINKAGE.upper_arm * arm.y)
    f = elbow.pos_from(ground) - vector(bicycle, hand)
    length = f.magnitude() / LINKAGE.forearm - 1
    hinge = f.dot(arm.z) / LINKAGE.forearm
    swivel = shoulder.pos_from(elbow).cross(f).dot(bicycle.z) / (LINKAGE.upper_arm * LINKAGE.forearm)
    expected = lambdify(angles, [length, hinge, swivel])
    rng = np.random.default_rng(0)
    for _ in range(3):
        theta, phi = TRUNK + 0.2 * rng.standard_normal(3), np.array([0.6, -1.4, 0.2]) + 0.2 * rng.standard_normal(3)
        found = limb_constraints.arm(theta, phi, pivot, joint, hand, LINKAGE.upper_arm, LINKAGE.forearm)
        np.testing.assert_allclose(found.residuals, expected(*theta, *phi), atol=1e-12)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_derivatives(axis):
    rng = np.random.default_rng(1)
    pivot, joint, hand, _, phi = arm_at("left", TRUNK, 0.2)
    theta, phi = TRUNK + 0.1 * rng.standard_normal(3), phi + 0.1 * rng.standard_normal(3)
    hip, foot, _, psi = leg_at("left", 2.5)
    psi = psi + 0.1 * rng.standard_normal(3)

    def arm(e):
        return limb_constraints.arm(e[:3], e[3:], pivot, joint, hand, LINKAGE.upper_arm, LINKAGE.forearm)

    def leg(e):
        return limb_constraints.leg(e, hip, foot, LINKAGE.thigh, LINKAGE.knee_to_pedal, axis)

    both = np.concatenate([theta, phi])
    for function, at, given in (
        (arm, both, np.concatenate([arm(both).by_trunk, arm(both).by_joint], axis=-1)),
        (leg, psi, leg(psi).by_joint),
    ):
        for i in range(len(at)):
            step = 1e-6 * np.eye(len(at))[i]
            slope = (function(at + step).residuals - function(at - step).residuals) / 2e-6
            np.testing.assert_allclose(given[:, i], slope, atol=1e-8)


@pytest.mark.parametrize("crank", [0.3, 2.0, 4.5])
def test_knee_flexion_against_an_ankle_that_is_built(crank):
    """Thigh, shank and foot as three segments with a fixed ankle: the angle at the knee is C8*, not C8."""
    hip, foot, knee, angles = leg_at("right", crank)
    frame = Rotation.from_euler("ZXY", angles).as_matrix()
    beta = knee_of(hip, foot)
    # the shank hangs on the thigh, turned backwards about the hinge; the foot is turned forwards from the shank's line
    shank = frame @ Rotation.from_euler("Z", -beta).as_matrix()
    toes = shank @ Rotation.from_euler("Z", LINKAGE.ankle_angle).as_matrix()
    ankle = knee - LINKAGE.shank * shank[:, 1]
    np.testing.assert_allclose(ankle - LINKAGE.ankle_to_pedal * toes[:, 1], foot, atol=1e-12)
    published = limb_constraints.knee_flexion(
        hip, foot, LINKAGE.thigh, LINKAGE.shank, LINKAGE.ankle_to_pedal, LINKAGE.ankle_angle, True
    )
    assert math.degrees(published - beta) == pytest.approx(7.05, abs=0.02)


def test_c7_about_the_upright_axis_loses_the_knee():
    """How much C7 feels of a knee's swivel over the crank: about x always, about y hardly anything somewhere."""
    felt = {"x": [], "y": []}
    for crank in np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False):
        hip, foot, _, angles = leg_at("right", crank)
        ahead, back = leg_at("right", crank, 1e-4)[3], leg_at("right", crank, -1e-4)[3]
        for axis, values in felt.items():
            found = limb_constraints.leg(angles, hip, foot, LINKAGE.thigh, LINKAGE.knee_to_pedal, axis)
            values.append(abs(found.by_joint[2] @ (ahead - back)) / 2e-4)
    # divided by the sine of the angle between thigh and lower leg
    assert min(felt["y"]) < 0.1 * max(felt["x"])
    assert min(felt["x"]) > 5.0 * min(felt["y"])
