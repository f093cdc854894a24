"""Soft tissue under worn sensors against the theory of a damped mass on a spring, and as a consistent motion."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.bicycle.sensors.soft_tissue import TISSUES, SoftTissue, SoftTissueMotion, tissue_of
from poise.envs.sensors.ideal import BodyState, Mounting
from poise.filters.core import rotation

SITE = Mounting((-0.1, 0.0, 0.27))


def shaken(rate, duration=2.0, rotate=True):
    """A trunk that is shaken up and down and nods, with its accelerations."""
    t = np.arange(0.0, duration, 1.0 / rate)
    w, size = 2.0 * np.pi * 5.0, 0.004
    up = np.array([0.0, 0.0, 1.0])
    height, speed, acceleration = size * np.sin(w * t), size * w * np.cos(w * t), -size * w**2 * np.sin(w * t)
    v, nod = 2.0 * np.pi * 1.3, 0.1 if rotate else 0.0
    axis = np.array([0.3, 0.9, 0.0]) / np.hypot(0.3, 0.9)
    orientation = rotation.exp(nod * np.sin(v * t)[:, None] * axis)
    angular = nod * v * np.cos(v * t)[:, None] * axis
    spin = -nod * v**2 * np.sin(v * t)[:, None] * axis
    return BodyState(
        t, height[:, None] * up, orientation, speed[:, None] * up, angular, acceleration[:, None] * up, spin
    )


def test_the_sensor_resonates_as_a_damped_mass_on_a_spring():
    tissue, rate = TISSUES["trunk"], 1000.0
    _, moved = SoftTissueMotion({"trunk": SITE}, rate).carry({"trunk": shaken(rate, 4.0, rotate=False)})
    last = moved["trunk"][-1000:, 2]
    ratio = 5.0 / tissue.frequency
    gain = 1.0 / np.hypot(1.0 - ratio**2, 2.0 * tissue.damping * ratio)
    expected = gain * 0.004 * (2.0 * np.pi * 5.0) ** 2 / (2.0 * np.pi * tissue.frequency) ** 2
    assert 0.5 * np.ptp(last) == pytest.approx(expected, rel=0.01)
    # up and down on the back is a nod of the sensor
    np.testing.assert_allclose(moved["trunk"][:, 4], moved["trunk"][:, 2] / tissue.depth, atol=1e-12)
    np.testing.assert_allclose(moved["trunk"][:, [3, 5]], 0.0, atol=1e-12)


def test_tissue_creeps_until_a_constant_load_leaves_no_displacement():
    n, zero = 3000, np.zeros((3000, 3))
    lying = np.tile(rotation.exp(np.array([0.0, 1.2, 0.0])), (n, 1))
    bone = BodyState(np.arange(n) / 100.0, zero, lying, zero, zero, zero, zero)
    _, moved = SoftTissueMotion({"trunk": SITE}, 100.0).carry({"trunk": bone})
    assert np.abs(moved["trunk"]).max() < 1e-12
    upright = bone._replace(orientation=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)))
    upright.orientation[0] = lying[0]
    _, moved = SoftTissueMotion({"trunk": SITE}, 100.0).carry({"trunk": upright})
    assert np.abs(moved["trunk"][50, :3]).max() > 5e-4
    assert np.abs(moved["trunk"][-1, :3]).max() < 1e-5


def test_velocities_and_accelerations_of_the_skin_are_derivatives_of_its_position():
    rate = 2000.0
    skins, moved = SoftTissueMotion({"trunk": SITE}, rate, scale=3.0).carry({"trunk": shaken(rate)})
    skin, dt = skins["trunk"], 1.0 / rate
    assert np.abs(moved["trunk"][:, 3:]).max() > 0.02
    inner = slice(400, -400)
    speed = np.gradient(skin.position, dt, axis=0)
    np.testing.assert_allclose(speed[inner], skin.velocity[inner], atol=2e-3)
    turned = rotation.multiply(skin.orientation[2:], rotation.conjugate(skin.orientation[:-2]))
    np.testing.assert_allclose(
        (rotation.log(turned) / (2.0 * dt))[inner], skin.angular_velocity[1:-1][inner], atol=5e-3
    )
    acceleration = np.gradient(skin.velocity, dt, axis=0)
    assert np.abs(acceleration[inner] - skin.acceleration[inner]).max() < 0.05 * np.abs(acceleration[inner]).max()
    spin = np.gradient(skin.angular_velocity, dt, axis=0)
    assert np.abs(spin[inner] - skin.angular_acceleration[inner]).max() < 0.05 * np.abs(spin[inner]).max()


def test_the_motion_hardly_depends_on_the_rate_of_the_samples():
    slow, fast = (
        SoftTissueMotion({"trunk": SITE}, rate).carry({"trunk": shaken(rate)})[1]["trunk"] for rate in (100.0, 1000.0)
    )
    # displacements during an interval of constant force lag half an interval behind
    assert np.abs(slow[50:, 2] - fast[::10][50:, 2]).max() < 0.2 * np.abs(fast[500:, 2]).max()


def test_two_blocks_are_one():
    whole, parts = (SoftTissueMotion({"trunk": SITE}, 100.0) for _ in range(2))
    bone = shaken(100.0)
    expected = whole.carry({"trunk": bone})[0]["trunk"]
    first = parts.carry({"trunk": bone.at(slice(0, 70))})[0]["trunk"]
    second = parts.carry({"trunk": bone.at(slice(70, None))})[0]["trunk"]
    for name in ("position", "orientation", "velocity", "acceleration"):
        joined = np.concatenate([getattr(first, name), getattr(second, name)])
        np.testing.assert_array_equal(joined, getattr(expected, name))


def test_without_tissue_the_bone_is_handed_on():
    bone = shaken(100.0)
    for sites, scale in (({"trunk": SITE}, 0.0), ({"bicycle": SITE}, 1.0)):
        skins, moved = SoftTissueMotion(sites, 100.0, scale).carry({"trunk": bone, "bicycle": bone})
        assert skins["trunk"] is bone
        assert skins["bicycle"] is bone
        assert moved == {}
    # a lumped rider's limbs have no velocities
    limb = bone._replace(acceleration=None)
    assert SoftTissueMotion({"thigh_left": SITE}, 100.0).carry({"thigh_left": limb})[0]["thigh_left"] is limb


def test_both_sides_are_mirrored():
    left, right = tissue_of("upper_arm_left"), tissue_of("upper_arm_right")
    assert left.normal == (0.0, 1.0, 0.0)
    assert right.normal == (0.0, -1.0, 0.0)
    assert tissue_of("forearm_left") is None
    assert tissue_of("bicycle") is None


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SoftTissue(0.0, 0.3, 0.1, (1.0, 0.0, 0.0)), "frequency must be positive"),
        (lambda: SoftTissueMotion({}, 100.0, -1.0), "soft_tissue must not be negative"),
    ],
)
def test_impossible_tissue_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
