"""The mixture stays between the filters, starts near the published one, and learns which one is right."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch

from poise.baselines.learned.config import FitConfig
from poise.baselines.learned.data import SequenceData
from poise.baselines.learned.fit import fit
from poise.baselines.learned.heading_head import HeadingHead
from poise.baselines.learned.inputs.filter_bank import TUNINGS, FilterBank
from poise.baselines.learned.inputs.front_end import Seen
from poise.baselines.learned.inputs.level_frame import LevelFrame
from poise.baselines.learned.mixture_head import MixtureHead
from poise.filters.core import rotation
from poise.filters.core.metrics import heading_error
from poise.filters.registry import make


def spread(tilts: np.ndarray) -> np.ndarray:
    """Deviation and candidates ``(..., K, 2)`` as a front end gives them."""
    return np.concatenate([np.ones((*tilts.shape[:-2], 1)), tilts.reshape(*tilts.shape[:-2], -1)], axis=-1)


def test_it_stays_between_the_filters() -> None:
    rng = np.random.default_rng(0)
    head, tilts = MixtureHead(3), rng.normal(0.0, 0.05, (500, 3, 2))
    said = head.up(rng.normal(0.0, 5.0, (500, 4)), spread(tilts))
    hull = np.concatenate([tilts, np.zeros((500, 1, 2))], axis=1)
    for angle in np.linspace(0.0, np.pi, 7):
        along = np.array([np.cos(angle), np.sin(angle)])
        assert (said[:, :2] @ along <= (hull @ along).max(axis=1) + 1e-12).all()
    near = head.up(np.zeros((500, 4)), spread(tilts))[:, :2]
    np.testing.assert_allclose(near, tilts.sum(axis=1) / (3.0 + np.exp(3.0)), rtol=1e-9)
    certain = np.tile([0.0, 0.0, 60.0, 0.0], (500, 1))
    np.testing.assert_allclose(head.up(certain, spread(tilts))[:, :2], tilts[:, 1], atol=1e-12)


def test_its_loss_is_the_ratio_to_the_published_filter() -> None:
    rng = np.random.default_rng(1)
    head = MixtureHead(2, preference=60.0)
    tilts = rng.normal(0.0, 0.05, (3, 40, 2, 2))
    true = np.concatenate([rng.normal(0.0, 0.02, (3, 40, 2)), np.ones((3, 40, 1))], axis=-1)
    mask = torch.ones(3, 40, dtype=torch.bool)
    parts: list[Any] = [torch.from_numpy(each) for each in (np.zeros((3, 40, 3)), true, spread(tilts))]
    rms = np.sqrt(np.mean(np.arctan(np.hypot(true[..., 0], true[..., 1])) ** 2, axis=1))
    assert float(head.loss(*parts, mask)) == pytest.approx(np.mean(rms / (rms + head.least)), rel=1e-6)
    assert float(head.loss(*parts, ~mask)) == 0.0


def test_it_learns_which_filter_is_right() -> None:
    """A feature tells which candidate has the truth."""
    rng = np.random.default_rng(2)
    front_end = FilterBank(LevelFrame(make("bounded-motion-rest")))
    count = len(TUNINGS)
    features = 0.1 * rng.standard_normal((48, 30, front_end.size)).astype(np.float32)
    tilts = rng.normal(0.0, 0.05, (48, 30, count, 2))
    right = rng.integers(0, 2, 48)
    features[..., 0] += np.where(right == 1, 2.0, -2.0)[:, None]
    true = np.where((right == 1)[:, None, None], tilts[..., 2, :], tilts[..., 4, :])
    target = np.concatenate([true, np.ones((48, 30, 1))], axis=-1).astype(np.float32)
    names = tuple(f"sequence-{index}" for index in range(48))
    data = SequenceData(features, target, spread(tilts).astype(np.float32), np.ones((48, 30), bool), names)
    torch.manual_seed(0)
    module = torch.nn.Linear(front_end.size, count + 1)
    config = FitConfig(epochs=40, batch=16, window=30, learning_rate=0.1)
    result = fit(module, front_end, MixtureHead(count), data, data, config)
    assert result.history[0]["validation"] > 0.5
    assert result.history[-1]["validation"] < 0.2


def test_a_heading_stays_between_those_of_the_filters() -> None:
    """It turns about the vertical alone; training counts its error in that of the published filter."""
    rng = np.random.default_rng(3)
    head = HeadingHead(2)
    turns = rng.normal(0.0, 0.2, (100, 2))
    given = np.concatenate([np.ones((100, 1)), turns], axis=-1)
    output, base = rng.normal(0.0, 3.0, (100, 3)), np.asarray(rotation.random(rng, (100,)))
    found = head.estimate(Seen(np.zeros((100, 0)), np.ones(100), {"relative_orientation": base}, given), output)
    np.testing.assert_allclose(found.pose["up"], rotation.up_in_body(base), atol=1e-9)
    turn = head.turn(output, given)[:, 0]
    assert (turn <= np.maximum(turns.max(axis=1), 0.0)).all()
    assert (turn >= np.minimum(turns.min(axis=1), 0.0)).all()
    np.testing.assert_allclose(heading_error(found.pose["orientation"], base), np.abs(turn), atol=1e-9)
    parts: list[Any] = [torch.from_numpy(each[None]) for each in (output, turn[:, None], given)]
    mask = torch.ones(1, 100, dtype=torch.bool)
    rms = np.sqrt(np.mean(turn**2))
    assert float(head.loss(*parts, mask)) == pytest.approx(np.log(head.least / (rms + head.least)), abs=1e-4)
    parts[0] = torch.tensor([60.0, 0.0, 0.0]) + 0.0 * parts[0]
    assert float(head.loss(*parts, mask)) == pytest.approx(0.0, abs=1e-6)
    lost = np.concatenate([np.ones((1, 1)), [[0.0, 3.0]]], axis=-1)
    assert 0.15 < head.turn(np.array([[-60.0, -60.0, 60.0]]), lost)[0, 0] <= head.largest


def test_it_needs_candidates() -> None:
    with pytest.raises(ValueError, match="candidates must be at least 1, got 0"):
        MixtureHead(0)
