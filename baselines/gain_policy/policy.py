"""A gain policy: a small network, or several, from statistics of a filter to its gains, evaluated with NumPy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...filters.adaptation.features import InnovationFeatures
from ...filters.adaptation.gains import GainRange
from ...filters.adaptation.named_features import NamedFeatures
from ...filters.adaptation.ruled_features import RuledFeatures, in_range
from ...filters.adaptation.rules import RULES, Rule
from ...filters.adaptation.time_scales import Features
from ...filters.adaptation.tuned import TunedFilter
from ..weights_io import load_weights, save_weights

KIND = "gain policy"
"""Field ``kind`` of the card."""

Layer = tuple[np.ndarray, np.ndarray]
"""Weight ``(outputs, inputs)`` and bias ``(outputs,)``; of M networks ``(M, outputs, inputs)`` and ``(M, outputs)``."""


@dataclass(frozen=True, eq=False)
class GainPolicy:
    """Observation ``(*batch, n)`` → action ``(*batch, k)`` in [−1, 1]: layers with tanh between them, then a clip.

    Of a policy that corrects a rule the action of the rule is added before the clip.

    Of several networks the action is the mean of theirs: the logarithms of the gains are averaged, each within its
    range, so a network that is wrong somewhere moves them by its share only.

    Attributes:
        filter: name of the filter that it tunes.
        ranges: of the actions.
        features: its observation, and the interval of its decisions.
        layers: weights and biases; the normalisation of observations is part of the first.
        card: description of the training.
        smoothing: s; the gains follow the actions with this time constant, 0: at once.
        bias_limit: rad/s; an estimator that follows the policy keeps the published gains while the estimated gyroscope
            bias is larger or not known yet (:mod:`.known_bias`). ∞: never.
        skip: ``(k, n)`` what is added of the observation to the last layer; None: nothing.

    Raises:
        ValueError: layers do not fit each other, the observation or the actions, or the limit is not positive.
    """

    filter: str
    ranges: tuple[GainRange, ...]
    features: Features
    layers: tuple[Layer, ...]
    card: dict[str, Any] = field(default_factory=dict)
    smoothing: float = 0.0
    bias_limit: float = math.inf
    skip: np.ndarray | None = None

    def __post_init__(self) -> None:
        if not self.bias_limit > 0.0:
            raise ValueError(f"bias_limit must be a positive rate in rad/s, got {self.bias_limit}")
        layers = tuple((np.asarray(weight, float), np.asarray(bias, float)) for weight, bias in self.layers)
        object.__setattr__(self, "layers", layers)
        width = self.features.size(len(self.ranges))
        for index, (weight, bias) in enumerate(layers):
            if weight.ndim not in (2, 3) or weight.shape[-1] != width or bias.shape != weight.shape[:-1]:
                raise ValueError(
                    f"layer {index} must take {width} inputs, got weight {weight.shape} and bias {bias.shape}"
                )
            width = weight.shape[-2]
        if len({weight.shape[:-2] for weight, _ in layers}) > 1:
            raise ValueError(
                f"all layers must be of as many networks, got weights {[weight.shape for weight, _ in layers]}"
            )
        if not layers or width != len(self.ranges):
            raise ValueError(
                f"the last layer must give {len(self.ranges)} actions, got {width if layers else 'no layer'}"
            )
        if self.skip is not None and self.skip.shape != (wanted := (width, self.features.size(width))):
            raise ValueError(f"skip must have the shape {wanted}, got {self.skip.shape}")

    @classmethod
    def constant(cls, tuned: TunedFilter, action: Sequence[float] | np.ndarray) -> GainPolicy:
        """A policy that always chooses the same action."""
        weight = np.zeros((tuned.actions, tuned.observation_size))
        return cls(tuned.name, tuned.ranges, tuned.features, ((weight, np.asarray(action, float)),))

    @classmethod
    def of_network(cls, tuned: TunedFilter, linear: Sequence[Any], mean: np.ndarray, std: np.ndarray) -> GainPolicy:
        """The linear layers of a torch network whose input is ``(observation - mean) / std``.

        Args:
            tuned: the filter that it sets.
            linear: ``torch.nn.Linear`` layers, with tanh between them.
            mean: ``(n,)`` of the observations.
            std: their standard deviations ``(n,)``.
        """
        layers: list[Layer] = [
            (layer.weight.detach().numpy().astype(float), layer.bias.detach().numpy().astype(float)) for layer in linear
        ]
        weight, bias = layers[0]
        layers[0] = (weight / std, bias - (weight / std) @ mean)
        skip = rule_skip(tuned.features, len(tuned.ranges))
        return cls(tuned.name, tuned.ranges, tuned.features, tuple(layers), smoothing=tuned.smoothing, skip=skip)

    @classmethod
    def mean_of(cls, policies: Sequence[GainPolicy]) -> GainPolicy:
        """The mean of policies that differ in their weights only; the rest is as of the first.

        Raises:
            ValueError: there is none, or they differ in filter, gains, observation or sizes of layers.
        """
        kinds = {
            (one.filter, one.ranges, one.features, one.smoothing, tuple(weight.shape for weight, _ in one.layers))
            for one in policies
        }
        if len(kinds) != 1:
            raise ValueError(
                f"policies must be of one filter and agree in gains, observation and layers, got {len(kinds)} kinds"
            )
        parts = zip(*(one.layers for one in policies), strict=True)
        layers = tuple((np.stack([w for w, _ in part]), np.stack([b for _, b in part])) for part in parts)
        return replace(policies[0], layers=layers)

    @classmethod
    def neutral(cls, tuned: TunedFilter) -> GainPolicy:
        """The published tuning."""
        return cls.constant(tuned, np.zeros(tuned.actions))

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """The action of an observation."""
        x = np.asarray(observation, dtype=float)
        batch, x = x.shape[:-1], x.reshape(-1, x.shape[-1])
        added = 0.0 if self.skip is None else x @ self.skip.T
        for weight, bias in self.layers[:-1]:
            x = np.tanh(x @ weight.swapaxes(-1, -2) + bias[..., None, :])
        weight, bias = self.layers[-1]
        actions = np.clip(x @ weight.swapaxes(-1, -2) + bias[..., None, :] + added, -1.0, 1.0)
        if actions.ndim == 3:
            actions = actions.mean(axis=0)
        return actions.reshape(*batch, -1)

    def save(self, path: str | Path, card: Mapping[str, Any] | None = None) -> Path:
        """Write weights and card; see :func:`poise.baselines.weights_io.save_weights`."""
        arrays = {}
        for index, (weight, bias) in enumerate(self.layers):
            arrays[f"{index}.weight"], arrays[f"{index}.bias"] = weight.astype(np.float32), bias.astype(np.float32)
        if self.skip is not None:
            arrays["skip"] = self.skip.astype(np.float32)
        own = {
            "kind": KIND,
            "filter": self.filter,
            "interval": self.features.interval,
            "scales": list(self.features.scales),
            "gains": [{"gain": part.gain, "lower": part.lower, "upper": part.upper} for part in self.ranges],
            "layers": len(self.layers),
            "smoothing": self.smoothing,
            "bias_limit": self.bias_limit if math.isfinite(self.bias_limit) else None,
        }
        if isinstance(self.features, NamedFeatures):
            own["rows"], own["channels"] = self.features.rows, [list(entry) for entry in self.features.channels]
        if isinstance(self.features, RuledFeatures):
            own["rule"] = rule_name(self.features.rule)
        described = dict(self.card if card is None else card)
        described.pop("sha256", None)
        return save_weights(path, arrays, {**own, **{name: described[name] for name in described if name not in own}})

    @classmethod
    def load(cls, path_or_name: str | Path) -> GainPolicy:
        """Read a policy: a file, or the name of a shipped one.

        Raises:
            FileNotFoundError: there is none.
            ValueError: the weights are damaged or are not a gain policy.
        """
        arrays, card = load_weights(path_or_name)
        if card.get("kind") != KIND:
            raise ValueError(f"{path_or_name} is not a {KIND} but {card.get('kind')!r}")
        try:
            ranges = tuple(
                GainRange(entry["gain"], float(entry["lower"]), float(entry["upper"])) for entry in card["gains"]
            )
            features: Features = InnovationFeatures(
                float(card["interval"]), tuple(float(scale) for scale in card["scales"])
            )
            if "channels" in card:
                channels = tuple((str(name), int(size), str(unit)) for name, size, unit in card["channels"])
                named = features.interval, features.scales, int(card["rows"]), channels
                features = NamedFeatures(*named)
                if "rule" in card:
                    features = RuledFeatures(*named, in_range(card["rule"], ranges[0]))
            layers = tuple((arrays[f"{index}.weight"], arrays[f"{index}.bias"]) for index in range(card["layers"]))
            limit = card.get("bias_limit")
            return cls(
                card["filter"],
                ranges,
                features,
                layers,
                card,
                float(card.get("smoothing", 0.0)),
                math.inf if limit is None else float(limit),
                arrays["skip"].astype(float) if "skip" in arrays else None,
            )
        except KeyError as missing:
            raise ValueError(f"{path_or_name}: the {KIND} lacks {missing}") from None


def rule_skip(features: Features, actions: int) -> np.ndarray | None:
    """What adds the action of a rule among the features to the first gain ``(k, n)``; None where there is none."""
    if not isinstance(features, RuledFeatures):
        return None
    skip = np.zeros((actions, features.size(actions)))
    skip[0, features.names.index("rule")] = 1.0
    return skip


def rule_name(rule: Rule) -> str:
    """Name of a rule with the constants of :data:`.RULES`; its range is that of the gain.

    Raises:
        ValueError: its constants are others.
    """
    for name, known in RULES.items():
        if replace(rule, largest=known.largest, reach=known.reach) == known:
            return name
    raise ValueError(f"a policy that is saved must correct a rule of {sorted(RULES)}, got {rule}")
