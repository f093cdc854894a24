"""What is drawn over time: bodies of the truth and of each estimate, forces, and curves; grows by blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from ...envs.drawn import DEVICE_SIZE
from ...filters.bicycle.geometry import RiderGeometry
from ...filters.core import rotation
from ...filters.core.quantity import Quantity
from .curves import TRUTH, Arrays, Curves, curves_of
from .device import DeviceAttitude, VirtualController, device_meshes
from .meshes import Mesh
from .rider import Placed, Poses, estimated_values, forces_on, rider_meshes, rider_poses

NEWTONS = 1000.0
"""Force that is drawn as long as 1 m."""
ACCELERATIONS = 50.0
"""m/s² that are drawn as long as 1 m."""


class Block(NamedTuple):
    """Consecutive samples with their estimates.

    Attributes:
        time: ``(n,)`` s.
        truth: quantity → ``(n, size)``.
        measurements: channel → ``(n, size)``.
        estimates: label → quantity → ``(n, size)``.
    """

    time: np.ndarray
    truth: Arrays
    measurements: Arrays
    estimates: Mapping[str, Arrays]


class Arrow(NamedTuple):
    """A vector that is drawn: where it begins and how long it is, ``(n, 3)`` each, m, world."""

    start: np.ndarray
    vector: np.ndarray


@dataclass(frozen=True)
class Motion:
    """What is drawn over time.

    Attributes:
        time: ``(n,)`` s.
        figures: truth or label of an estimate → where its bodies are.
        virtual: label → position ``(n, 3)`` of the virtual controller, m.
        arrows: name → vector.
        curves: see :data:`Curves`.
    """

    time: np.ndarray
    figures: dict[str, Poses]
    virtual: dict[str, np.ndarray]
    arrows: dict[str, Arrow]
    curves: Curves

    def rows(self, part: slice) -> Motion:
        """Some of its samples."""
        return _map(self, lambda values: values[part])

    def __len__(self) -> int:
        return len(self.time)


def _map(motion: Motion, function: Any) -> Motion:
    return Motion(
        function(motion.time),
        {
            label: {name: Placed(*(function(part) for part in placed)) for name, placed in poses.items()}
            for label, poses in motion.figures.items()
        },
        {label: function(values) for label, values in motion.virtual.items()},
        {name: Arrow(*(function(part) for part in arrow)) for name, arrow in motion.arrows.items()},
        {
            title: {label: function(values) for label, values in curves.items()}
            for title, curves in motion.curves.items()
        },
    )


def joined(before: Motion, after: Motion) -> Motion:
    """One motion after another; both have the same bodies and curves."""
    later: list[np.ndarray] = []

    def keep(values: np.ndarray) -> np.ndarray:
        later.append(values)
        return values

    _map(after, keep)
    rest = iter(later)
    return _map(before, lambda values: np.concatenate([values, next(rest)]))


class Subject(Protocol):
    """What moves: its meshes, and where they are."""

    outputs: Mapping[str, Sequence[Quantity]]

    def meshes(self) -> dict[str, list[Mesh]]:
        """Body → meshes in its frame."""
        ...

    def motion(self, block: Block) -> Motion:
        """What is drawn of a block; blocks come in the order of time."""
        ...


@dataclass
class Rider:
    """A rider on a bicycle, or the fixture of the two-gyroscope paper.

    Attributes:
        geometry: lengths.
        outputs: label → quantities of the estimate.
    """

    geometry: RiderGeometry
    outputs: Mapping[str, Sequence[Quantity]]

    def meshes(self) -> dict[str, list[Mesh]]:
        """Body → meshes in its frame."""
        return rider_meshes(self.geometry)

    def motion(self, block: Block) -> Motion:
        """What is drawn of a block."""
        # angles of steering and crank by their encoders, where the truth is not known
        encoders = {"steer/angle": "bicycle/steer", "crank/angle": "bicycle/crank"}
        read = {name: values for name, values in block.measurements.items() if name in encoders}
        known = {encoders[name]: np.nan_to_num(values) for name, values in read.items()} | dict(block.truth)
        figures = {}
        if "bicycle/orientation" in block.truth:
            figures[TRUTH] = rider_poses(self.geometry, known)
        for label, estimate in block.estimates.items():
            figures[label] = rider_poses(self.geometry, estimated_values(estimate, known))
        forces = forces_on(self.geometry, block.truth)
        arrows = {name: Arrow(at, force / NEWTONS) for name, (at, force) in forces.items()}
        return Motion(block.time, figures, {}, arrows, curves_of(block.truth, block.estimates, self.outputs))


@dataclass
class Device:
    """A hand-held device, or any single sensor.

    Attributes:
        outputs: label → quantities of the estimate.
        dt: sampling interval, s.
        size: extent along the body axes, m.
    """

    outputs: Mapping[str, Sequence[Quantity]]
    dt: float
    size: Sequence[float] = DEVICE_SIZE
    _attitudes: dict[str, DeviceAttitude] = field(default_factory=dict, init=False)
    _virtual: dict[str, VirtualController] = field(default_factory=dict, init=False)

    def meshes(self) -> dict[str, list[Mesh]]:
        """The device alone."""
        return {"device": device_meshes(self.size)}

    def motion(self, block: Block) -> Motion:
        """What is drawn of a block."""
        n = len(block.time)
        place = np.nan_to_num(np.asarray(block.truth.get("position", np.zeros((n, 3))), float))
        truth = true_orientation(block.truth)
        figures: dict[str, Poses] = {}
        if truth is not None:
            figures[TRUTH] = {"device": Placed(place, truth)}
        virtual: dict[str, np.ndarray] = {}
        arrows: dict[str, Arrow] = {}
        for label, estimate in block.estimates.items():
            turn = self._attitudes.setdefault(label, DeviceAttitude()).orientation(estimate, truth)
            if turn is None:
                continue
            figures[label] = {"device": Placed(place, turn)}
            shown = self._virtual.setdefault(label, VirtualController()).position(estimate, turn, self.dt)
            if shown is not None:
                virtual[label] = shown
            arrows |= acceleration_arrow(label, estimate, place, turn)
        if truth is not None:
            arrows |= acceleration_arrow(TRUTH, block.truth, place, truth)
        return Motion(block.time, figures, virtual, arrows, curves_of(block.truth, block.estimates, self.outputs))


def acceleration_arrow(label: str, values: Arrays, place: np.ndarray, turn: np.ndarray) -> dict[str, Arrow]:
    """The acceleration of a device as an arrow, where it is known."""
    if "external_acceleration" not in values:
        return {}
    acceleration = rotation.rotate(turn, np.asarray(values["external_acceleration"], float))
    return {f"{label}/acceleration": Arrow(place, acceleration / ACCELERATIONS)}


def true_orientation(truth: Arrays) -> np.ndarray | None:
    """The orientation ``(n, 4)`` of a device; one of inclination alone where only that is known."""
    if "orientation" in truth:
        return np.asarray(truth["orientation"], float)
    return rotation.level(np.asarray(truth["up"], float)) if "up" in truth else None
