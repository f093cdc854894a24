"""The sensors of one rider: where they should be, where they are, and how they move on soft tissue."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ....filters.core import rotation
from ....filters.core.quantity import STANDARD_GRAVITY
from ...sensors.ideal import BodyState, Mounting
from ...sensors.suite import SuiteState
from ..rider.posture import Posture
from .placement import PLACED, PlacementErrors
from .readings import RideQuantities
from .sites import sensor_sites
from .soft_tissue import SoftTissueMotion, TissueState
from .suites import CHANNELS, rider_bicycle_suite


class WornState(NamedTuple):
    """All memory of :class:`WornSensors`.

    Attributes:
        placed: where inertial sensors are, by site.
        suite: of their errors.
        tissue: of the tissue below them, by body.
    """

    placed: dict[str, Mounting]
    suite: SuiteState
    tissue: dict[str, TissueState]


class WornSensors:
    """A suite of sensors on a person on a bicycle.

    Args:
        posture: the person on the bicycle.
        options: of :func:`.rider_bicycle_suite`, sites and gravity excepted.
        errors: of their placement.
        soft_tissue: factor on the motion of soft tissue.
    """

    def __init__(
        self, posture: Posture, options: Mapping[str, Any], errors: PlacementErrors, soft_tissue: float
    ) -> None:
        self.posture, self.sites, self._options, self._errors = posture, sensor_sites(posture), options, errors
        self._place({})
        here = {name: CHANNELS[f"{name}/gyr"] for name in PLACED}
        carried = {sensor.channel.name.split("/")[0] for sensor in self.suite.sensors if sensor.sensing.on_body}
        self._nominal = {name: getattr(self.sites, here[name].site) for name in PLACED if name in carried}
        self._bodies = {name: here[name].body for name in self._nominal}
        moving = {sensor.body for sensor in self.suite.sensors if sensor.sensing.on_body}
        places = {here[name].body: getattr(self.sites, here[name].site) for name in PLACED if here[name].body in moving}
        self._tissue = SoftTissueMotion(places, self.suite.rate, soft_tissue)

    def _place(self, placed: dict[str, Mounting]) -> None:
        self._placed = placed
        self.suite = rider_bicycle_suite(sites=self.sites, placed=placed, gravity=STANDARD_GRAVITY, **self._options)

    def reset(self, rng: np.random.Generator) -> None:
        """Put the sensors on for another ride: draw their places and errors."""
        if not self._errors.none:
            self._place(self._errors.draw(self._nominal, rng.spawn(1)[0]))
        self._tissue.state = {}
        self.suite.reset(rng)

    def simulate(
        self, bodies: Mapping[str, BodyState], ride: RideQuantities
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Measurements at the next n time steps from the motion of the bones, and the truth about the sensors."""
        skins, moved = self._tissue.carry(bodies)
        measurements, truth, _ = self.suite.simulate(skins, ride)
        for name, site in self._nominal.items():
            mounting, count = self._placed.get(name, site), len(next(iter(measurements.values())))
            shift, turn = np.split(moved.get(self._bodies[name], np.zeros((count, 6))), 2, axis=1)
            axes = rotation.exp(turn)
            beside = np.subtract(mounting.lever_arm, site.lever_arm)
            truth[f"{name}/lever_arm"] = np.array(site.lever_arm) + shift + rotation.rotate(axes, beside)
            truth[f"{name}/rotation"] = rotation.multiply(axes, np.array(mounting.rotation))
        return measurements, truth

    def save(self) -> WornState:
        """A copy of all memory."""
        return WornState(self._placed, self.suite.save(), dict(self._tissue.state))

    def restore(self, state: WornState) -> None:
        """Continue from a saved state, exactly."""
        if state.placed != self._placed:
            self._place(state.placed)
        self.suite.restore(state.suite)
        self._tissue.state = dict(state.tissue)
