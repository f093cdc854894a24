"""Forms of the papers' filters whose covariance is that of their errors on rides."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

import poise
from poise.baselines.measures import measures
from poise.envs.bicycle.environment import RiderBicycleEnv
from poise.filters.bicycle.force_inertial.consistent import ConsistentForceInertial
from poise.filters.bicycle.force_inertial.filter import ForceInertial
from poise.filters.bicycle.geometry import RiderGeometry
from poise.filters.bicycle.two_gyro.consistent import ConsistentTwoGyro
from poise.filters.bicycle.two_gyro.filter import TwoGyro

GEOMETRY = RiderGeometry()


def sample(generator: np.random.Generator) -> dict[str, np.ndarray]:
    values = {channel.name: generator.normal(0.0, 0.5, channel.size) for channel in ForceInertial.channels}
    return values | {
        "wheel/speed": generator.uniform(1.0, 5.0, 1),
        "seat/load_cells": generator.uniform(80.0, 200.0, 3),
        "seat/wrench": generator.normal([0.0, 0.0, -400.0, 0.0, 0.0, 0.0], 20.0),
        "handlebar/force": generator.normal([0.0, 0.0, -60.0, 0.0, 0.0, -60.0], 10.0),
    }


def test_the_start_is_the_usual_posture_whatever_the_forces_are() -> None:
    model = ConsistentForceInertial.for_rider(replace(GEOMETRY, trunk_flexion=0.7))
    generator = np.random.default_rng(0)
    for _ in range(3):
        x, covariance = model.prior(sample(generator))
        np.testing.assert_allclose(x[:3], [0.0, 0.5 * math.pi - 0.7, 0.0])
        np.testing.assert_allclose(np.sqrt(np.diag(covariance))[:2], np.radians([34.0, 43.0]))
    first = sample(generator) | {"seat/wrench": np.full(6, np.nan)}
    assert np.isnan(model.prior(first)[0][:3]).all()


def test_the_posture_is_three_more_rows_with_their_derivatives() -> None:
    model, generator = ConsistentForceInertial.for_rider(GEOMETRY), np.random.default_rng(1)
    z, x = sample(generator), np.concatenate([[0.1, 1.1, -0.2, 0.3], 0.01 * generator.normal(size=23)])
    x[13] = 3.0
    r, H, R = model.residual(x, z)
    np.testing.assert_allclose(r[4:], [0.2, model.usual_pitch - 1.1, 0.2])
    np.testing.assert_allclose(np.diag(R)[4:], model.posture_noise**2 / model.dt)
    published, _, _ = ForceInertial.for_rider(GEOMETRY, ahead_share=model.ahead_share).residual(x, z)
    np.testing.assert_allclose(r[:4], published)
    for column in range(7):
        step = 1e-6 * np.eye(27)[column]
        change = (model.residual(x + step, z)[0] - model.residual(x - step, z)[0]) / 2e-6
        np.testing.assert_allclose(H[:, column], -change, rtol=1e-5, atol=1e-5)


def test_a_noise_without_sense_is_refused() -> None:
    with pytest.raises(ValueError, match="posture_noise must be positive"):
        ConsistentForceInertial(posture_noise=0.0)


@pytest.mark.parametrize(
    ("form", "published"), [(ConsistentTwoGyro, TwoGyro), (ConsistentForceInertial, ForceInertial)]
)
def test_published_forms_keep_their_constants(form: type[Any], published: type[Any]) -> None:
    usual = {field.name: field.default for field in fields(published)}
    assert usual["orientation_noise" if published is TwoGyro else "torque_noise"] in (math.radians(2.0), 12.0)
    assert {field.name for field in fields(form)} >= set(usual)


def test_covariances_on_a_ride_are_those_of_the_errors() -> None:
    env = RiderBicycleEnv("outdoor", 1, suite="all", fidelity="lumped", duration=12.0)
    ride = poise.record(env, seed=3)
    ride = ride.replace(mask=ride.time > 5.0)
    for paper, angle in (("two-gyro", "two-gyro/relative_angles"), ("force-inertial", "force-inertial/trunk_angles")):
        found = {}
        for name in (paper, f"{paper}-consistent"):
            made: Any = poise.make_estimator(name, dt=ride.dt, metadata=ride.metadata, keep_covariance=True)
            rows = measures(made, poise.run(made, ride), ride)
            found[name] = next(value for quantity, metric, value, _ in rows if (quantity, metric) == (angle, "nees"))
        # one ride holds few independent errors
        assert 0.02 < found[f"{paper}-consistent"] < 3.0
        assert found[f"{paper}-consistent"] < 0.5 * found[paper]
