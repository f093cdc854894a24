"""What the constraints let a limb see: ranks of the observability Gramian, as an independent study found them."""

import math

import numpy as np
import pytest

from poise.baselines.studies.whole_body.motion import ExactRide
from poise.filters.bicycle.whole_body import constraints as limb_constraints
from poise.filters.bicycle.whole_body.constraints import hip_angles, limb_frame
from poise.filters.bicycle.whole_body.linkage import RiderLinkage
from poise.filters.bicycle.whole_body.rates import advance
from poise.filters.core import rotation

from .whole_body_cases import RIDER

LINKAGE = RiderLinkage.for_rider(RIDER)
DROPPED = (None, 0, 1, 2)


def gramians(kind, ride, duration, axis="x", turn=0.0):
    """Eigenvalue-root ratio and rank of the Gramian of a right limb, all three rows and without each."""
    dt = 0.01 if duration < 5.0 else 0.1
    t = np.arange(0.0, duration + 1e-9, dt)
    pose, rates = ride.pose(t), ride.rates(t)
    up = np.array([0.0, turn, 0.0])
    total = {row: np.zeros((3, 3)) for row in DROPPED}
    Phi = np.eye(3)
    for k in range(t.size):
        steer, crank = pose["bicycle/steer"][k], pose["bicycle/crank"][k]
        trunk = rotation.euler_matrix("zxy", pose["trunk/angles"][k])
        if kind == "arm":
            joint = (
                LINKAGE.point(place, side, steer)
                for place, side in ((LINKAGE.trunk_pivot, "left"), (LINKAGE.shoulder, "right"))
            )
            angles, hand = pose["shoulder_right/angles"][k], LINKAGE.hand("right", steer)
            H = limb_constraints.arm(pose["trunk/angles"][k], angles, *joint, hand, LINKAGE.upper_arm, LINKAGE.forearm)
            sequence, parent, to = "yxy", rates["trunk_imu"][k], trunk
            child = rates["upper_arm_right"][k]
        else:
            angles, foot = pose["hip_right/angles"][k], LINKAGE.pedal("right", crank)
            hip = LINKAGE.point(LINKAGE.hip, "right", steer)
            H = limb_constraints.leg(angles, hip, foot, LINKAGE.thigh, LINKAGE.knee_to_pedal, axis)
            sequence, parent, to = "zxy", rates["bicycle_imu"][k], np.eye(3)
            child = rates["thigh_right"][k]
        # a steady turn that the held posture rides through
        parent = parent + to.T @ up
        child = child + (to @ rotation.euler_matrix(sequence, angles)).T @ up
        for row in DROPPED:
            rows = np.delete(H.by_joint, row, axis=0) if row is not None else H.by_joint
            total[row] += (rows @ Phi).T @ (rows @ Phi)
        Phi = advance(sequence, angles, child, parent, dt)[1] @ Phi
    found = {}
    for row, W in total.items():
        roots = np.sqrt(np.maximum(np.linalg.eigvalsh(W), 0.0))
        found[row] = (roots[0] / roots[-1], int(np.sum(roots > 1e-3 * roots[-1])))
    return found


@pytest.mark.parametrize("kind", ["arm", "leg"])
def test_one_sample_needs_all_three_constraints(kind):
    found = gramians(kind, ExactRide(RIDER, "indoor", swivel=0.0), 0.0)
    assert [found[row][1] for row in DROPPED] == [3, 2, 2, 2]


@pytest.mark.parametrize("kind", ["arm", "leg"])
def test_held_posture_on_a_straight_line_needs_all_three_and_a_steady_turn_does_not(kind):
    held = ExactRide(RIDER, "held", swivel=0.0)
    assert [gramians(kind, held, 10.0)[row][1] for row in DROPPED] == [3, 2, 2, 2]
    assert [gramians(kind, held, 10.0, turn=0.4)[row][1] for row in DROPPED] == [3, 3, 3, 3]


@pytest.mark.parametrize(("kind", "axis"), [("arm", "x"), ("leg", "x"), ("leg", "y")])
def test_riding_makes_two_constraints_enough(kind, axis):
    found = gramians(kind, ExactRide(RIDER, "indoor", swivel=0.0), 1.0, axis)
    assert [found[row][1] for row in DROPPED] == [3, 3, 3, 3]
    assert 0.2 < found[None][0] < 0.7
    assert all(found[row][0] < found[None][0] for row in DROPPED[1:])


def test_the_printed_axis_of_c7_is_poor_at_some_crank_positions():
    ratios = {"x": [], "y": []}
    for crank in np.linspace(0.0, 2.0 * math.pi, 36):
        angle = np.array([crank])
        hip, foot = LINKAGE.point(LINKAGE.hip, "right", angle), LINKAGE.pedal("right", angle)
        frame, _ = limb_frame(hip, foot, LINKAGE.thigh, LINKAGE.knee_to_pedal, np.array([1.0, 0.0, 0.0]), "leg")
        for axis, values in ratios.items():
            H = limb_constraints.leg(hip_angles(frame), hip, foot, LINKAGE.thigh, LINKAGE.knee_to_pedal, axis)
            roots = np.linalg.svd(H.by_joint, compute_uv=False)
            values.append(roots[-1] / roots[0])
    worst = int(np.argmin(ratios["y"]))
    assert ratios["y"][worst] < 0.03
    assert ratios["x"][worst] > 0.3
