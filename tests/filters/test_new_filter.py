"""What it takes to add a filter: its class and its entry in the registry; everything else follows from them."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from types import ModuleType
from typing import ClassVar, Literal

import numpy as np
import pytest

import poise
from poise.baselines.comparison.data_sets import contenders
from poise.baselines.evaluation import evaluate
from poise.baselines.speed.fixtures import plausible_measurements
from poise.envs.hand.sensing import simulate_hand
from poise.filters.core.estimator import run_by_steps
from poise.filters.core.kalman import KalmanFilter
from poise.filters.core.matrices import covariance_of, identity
from poise.filters.core.model import Gain, Model
from poise.filters.core.quantity import ACCELEROMETER, GYROSCOPE, UP, Channel, Quantity
from poise.filters.core.rotation import exp, exp_matrix, normalize, rotate_back
from poise.filters.registry import FILTERS, Entry, make, name_of
from poise.filters.support.parameters import check_positive
from poise.filters.support.version import ROOT


@dataclass(frozen=True)
class Vertical(Model):
    """The vertical in sensor axes, turned by the gyroscope and corrected by the direction of the accelerometer."""

    start: Literal["tilt"] = "tilt"
    noise: float = 0.02
    """rad per sample"""
    spread: float = 0.3

    channels: ClassVar[tuple[Channel, ...]] = (GYROSCOPE, ACCELEROMETER)
    outputs: ClassVar[tuple[Quantity, ...]] = (UP,)
    state_size: ClassVar[int] = 3
    error_size: ClassVar[int] = 3
    residual_size: ClassVar[int] = 3
    gains: ClassVar = {"measurement": Gain("spread", description="variance of the accelerometer's direction")}

    def __post_init__(self):
        super().__post_init__()
        check_positive(self, "spread", or_zero=("noise",))

    def prior(self, z):
        up = normalize(z["imu/acc"])
        return up, covariance_of([0.1] * 3, 0.0 * up[..., :1])

    def predict(self, x, z, previous):
        turn = exp_matrix(-self.dt * z["imu/gyr"])
        return (turn @ x[..., None])[..., 0], turn, covariance_of([self.noise] * 3, 0.0 * x[..., :1])

    def residual(self, x, z):
        return normalize(z["imu/acc"]) - x, identity(3, x), covariance_of([self.spread] * 3, 0.0 * x[..., :1])

    def finish(self, x, z):
        return normalize(x)

    def pose(self, x):
        return {"up": x}


@pytest.fixture(autouse=True)
def _registered(monkeypatch):
    monkeypatch.setitem(FILTERS, "vertical", Entry(Vertical, "the vertical", "nowhere"))


def test_the_registry_reads_channels_and_outputs_from_the_class():
    info = poise.list_estimators()["vertical"]
    assert (info.kind, info.channels, info.outputs) == ("filter", ("imu/gyr", "imu/acc"), ("up",))
    assert name_of(Vertical()) == "vertical"
    assert "vertical" in contenders()


def test_it_is_made_with_its_parameters():
    made = poise.make_estimator("vertical", dt=0.02, spread=0.5, keep_covariance=False)
    assert made == KalmanFilter(Vertical(dt=0.02, spread=0.5), keep_covariance=False)
    with pytest.raises(ValueError, match=r"unknown parameters \['nose'\] of 'vertical'; accepted are .*'spread'"):
        make("vertical", nose=1.0)
    with pytest.raises(ValueError, match=r"start must be one of \('tilt',\), got 'level'"):
        make("vertical", start="level")
    with pytest.raises(ValueError, match="spread must be positive"):
        make("vertical", spread=0.0)
    with pytest.raises(ValueError, match="noise must not be negative"):
        make("vertical", noise=-1.0)


def test_it_finds_samples_of_its_channels_and_is_scored():
    filter = make("vertical")
    data = plausible_measurements(filter, 0)
    compiled, stepped = filter.run(data), run_by_steps(make("vertical", compiled=False), data)
    np.testing.assert_allclose(compiled.pose["up"], stepped.pose["up"], atol=1e-12)
    table = evaluate(["vertical", "tilt"], simulate_hand("fast", 1, duration=3.0))
    errors = table[table["metric"] == "inclination"].set_index("estimator")["value"]
    assert errors["vertical"] < errors["tilt"]


def test_the_recipe_of_the_contributors_page_predicts_through_a_drop_out(monkeypatch):
    """Put into the package, it meets the contracts of all filters; a turn to first order in dt would not."""
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    block = page.split("### A filter")[1].split("```python")[1].split("\ntrajectory =")[0]
    recipe = ModuleType("recipe")
    monkeypatch.setitem(sys.modules, "recipe", recipe)
    exec(block, recipe.__dict__)
    tracker = KalmanFilter(recipe.GravityTracker(), compiled=False)
    data = plausible_measurements(tracker, 13, 40)
    data["imu/acc"][20:] = np.nan
    found, up = tracker.run(data).pose["up"], None
    for t in range(19, 40):
        up = found[t] if up is None else rotate_back(exp(tracker.dt * data["imu/gyr"][t]), up)
        np.testing.assert_allclose(found[t], up, atol=1e-12)
