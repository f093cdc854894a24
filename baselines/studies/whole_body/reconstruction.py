"""Figure 7 of the whole-body paper: rider and bicycle in three dimensions, true and estimated, as picture and film."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....envs.data.trajectory import Trajectory
from ....filters.bicycle.geometry import RiderGeometry
from ....filters.bicycle.whole_body.linkage import SIDES, RiderLinkage, true_angles
from ....filters.core import rotation
from ...plots import BLUE, TRUTH_COLOR, new_spatial_figure
from ..claims import Claim
from ..report import Report
from ..ride_study import SETTLED, RideStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TRUE, FOUND = TRUTH_COLOR, BLUE
SNAPSHOTS, APART = 5, 0.5
"""snapshots of figure 7, and s between them, as in the paper"""
FILM, FRAME = 4.0, 0.1
"""s: length of the film, and time from frame to frame"""
LIMITS = ((-0.45, 1.45), (-0.7, 0.7), (0.0, 1.75))
"""m: x, y, z of the picture"""
GRID = 0.5
"""m: between lines of the grid"""
ELEVATION, AZIMUTH = 14.0, -62.0
"""deg: seen from behind on the left"""
JOINTS = {
    "shoulder": (("arm right", 0), ("arm left", 0)),
    "elbow": (("arm right", 1), ("arm left", 1)),
    "knee": (("leg right", 1), ("leg left", 1)),
    "head": (("trunk", 3),),
}
"""Joint → line and number of its points"""


class Reconstruction:
    """Skeletons of one ride, true and estimated by a variant of the study, the first if None."""

    def __init__(self, study: RideStudy, path: Path, method: str | None = None) -> None:
        self.ride: Trajectory = study.load(path)
        self.geometry = RiderGeometry.of(self.ride.metadata)
        self.truth = true_angles(self.ride.truth)
        self.found = dict(study.estimate(self.ride, study.variants[method or study.first]).pose)

    def at(self, time: float) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Lines of the true and of the estimated rider at a time, s, in the frame R.

        Both have the bicycle's true steering and crank angle, which no filter estimates.
        """
        index = min(int(np.searchsorted(self.ride.time, time - 1e-9)), len(self.ride) - 1)
        steer, crank = (self.ride.truth[f"bicycle/{name}"][index] for name in ("steer", "crank"))

        def lines(pose: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
            return skeleton(self.geometry, {name: values[index] for name, values in pose.items()}, steer, crank)

        return lines(self.truth), lines(self.found)

    def begin(self, length: float) -> float:
        """Time, s, from which on a span of this length is shown: settled if the ride is long enough."""
        return min(2.0 * SETTLED, max(0.0, float(self.ride.time[-1]) - length))

    def distances(self, every: float = 0.1) -> dict[str, float]:
        """Joint → RMS distance between its estimated and its true place, both sides, cm."""
        squares: dict[str, list[float]] = {name: [] for name in JOINTS}
        for time in np.arange(min(SETTLED, 0.5 * self.ride.time[-1]), self.ride.time[-1], every):
            true, found = self.at(float(time))
            for name, points in JOINTS.items():
                squares[name] += [float(np.sum((true[line][k] - found[line][k]) ** 2)) for line, k in points]
        return {name: 100.0 * float(np.sqrt(np.mean(values))) for name, values in squares.items()}


def draw(ax: Any, lines: Mapping[str, np.ndarray], color: str, width: float = 1.6, alpha: float = 1.0) -> None:
    """Lines with dots at the rider's joints."""
    for name, points in lines.items():
        rider = name.split()[0] in ("trunk", "shoulders", "arm", "leg")
        style = {"marker": "o", "markersize": 2.4} if rider else {}
        ax.plot(*points.T, color=color, linewidth=width if rider else 0.6 * width, alpha=alpha, **style)
    if "trunk" in lines:
        ax.plot(*lines["trunk"][-1:].T, marker="o", markersize=9, color=color, alpha=alpha)


def dress(ax: Any, title: str) -> None:
    """Limits, view and labels of a picture in space."""
    for axis, (low, high) in zip("xyz", LIMITS, strict=True):
        getattr(ax, f"set_{axis}lim")(low, high)
    ax.set_box_aspect([high - low for low, high in LIMITS], zoom=1.22)
    ax.view_init(ELEVATION, AZIMUTH)
    ax.set_title(title, fontsize=9, y=0.97)
    # numbers at the edges would be cut off; the grid is the scale
    for axis, (low, high) in zip("xyz", LIMITS, strict=True):
        getattr(ax, f"set_{axis}ticks")(np.arange(np.ceil(low / GRID), high / GRID) * GRID, labels=[])


def snapshots(scene: Reconstruction) -> Figure:
    """Truth above, estimate (with the truth pale behind it) below, at five moments."""
    figure, axes = new_spatial_figure(11.0, 5.2, 2, SNAPSHOTS)
    begin = scene.begin(SNAPSHOTS * APART)
    for k in range(SNAPSHOTS):
        time = begin + k * APART
        true, found = scene.at(time)
        draw(axes[k], true, TRUE)
        dress(axes[k], f"truth, {time:.1f} s")
        draw(axes[SNAPSHOTS + k], true, TRUE, 1.0, 0.3)
        draw(axes[SNAPSHOTS + k], found, FOUND)
        dress(axes[SNAPSHOTS + k], "estimate")
    return figure


def frames(scene: Reconstruction) -> list[Figure]:
    """Pictures of the film: truth on the left, estimate on the right."""
    pictures = []
    begin = scene.begin(FILM)
    for time in begin + np.arange(0.0, min(FILM, float(scene.ride.time[-1])), FRAME):
        figure, axes = new_spatial_figure(6.4, 3.6, 1, 2, dpi=80)
        true, found = scene.at(float(time))
        draw(axes[0], true, TRUE)
        dress(axes[0], f"truth, {time:.1f} s")
        draw(axes[1], true, TRUE, 1.0, 0.3)
        draw(axes[1], found, FOUND)
        dress(axes[1], "estimate")
        pictures.append(figure)
    return pictures


def reconstruction(study: RideStudy, report: Report, path: Path, course: str, seated: str) -> list[Claim]:
    """Picture and film of one ride; how far estimated joints are from the true ones, also by the variant ``seated``."""
    scene = Reconstruction(study, path)
    note = (
        f"Black: truth. Blue: estimate. The grid has lines every {GRID:g} m, in the frame that turns with the bicycle; "
        "steering and crank are true."
    )
    report.figure(f"figure-7-{course}", snapshots(scene), f"Figure 7: rider and bicycle in space, {course}", note)
    title = f"Figure 7: {FILM:g} s of the same ride as a film, {course}"
    report.animation(f"figure-7-film-{course}", frames(scene), FRAME, title)
    return [
        Claim.every(statement, each.distances(), 5.0, "cm")
        for statement, each in (
            ("Figure 7: every joint is where it truly is, within 5 cm", scene),
            (
                "Where the seat carries the trunk every joint is where it truly is, within 5 cm",
                Reconstruction(study, path, seated),
            ),
        )
    ]


HEAD = 0.28
"""m: centre of the head above the middle of the shoulders, about a seventh of a rider's height"""
RIM = np.linspace(0.0, 2.0 * np.pi, 33)
"""rad: angles of the points of a wheel"""


def skeleton(
    geometry: RiderGeometry, pose: Mapping[str, np.ndarray], steer: np.ndarray, crank: np.ndarray
) -> dict[str, np.ndarray]:
    """Lines of rider and bicycle in the frame R of the paper, which turns with the bicycle but does not roll.

    Args:
        geometry: lengths and places.
        pose: the paper's angles of one moment, each ``(size,)``.
        steer: ``(1,)`` rad.
        crank: ``(1,)`` rad.

    Returns:
        Name → ``(n, 3)`` points of a line, m: x forward, y left, z up.
    """
    link = RiderLinkage.for_rider(geometry)
    nothing = np.zeros(1)
    R_BT = rotation.euler_matrix("zxy", pose["trunk/angles"])
    pivot = link.point(link.trunk_pivot, "left", nothing)
    lines: dict[str, np.ndarray] = {}
    shoulders = {side: pivot + R_BT @ link.point(link.shoulder, side, nothing) for side in SIDES}
    neck = 0.5 * (shoulders["right"] + shoulders["left"])
    saddle = link.point(link.saddle, "left", nothing)
    lines["trunk"] = np.stack([saddle, pivot, neck, neck + HEAD * R_BT[:, 1]])
    lines["shoulders"] = np.stack([shoulders["right"], shoulders["left"]])
    for side in SIDES:
        R_BH = R_BT @ rotation.euler_matrix("yxy", pose[f"shoulder_{side}/angles"])
        elbow = shoulders[side] - link.upper_arm * R_BH[:, 1]
        lines[f"arm {side}"] = np.stack([shoulders[side], elbow, link.hand(side, steer)])
        R_BD = rotation.euler_matrix("zxy", pose[f"hip_{side}/angles"])
        hip = link.point(link.hip, side, nothing)
        lines[f"leg {side}"] = np.stack([hip, hip - link.thigh * R_BD[:, 1], link.pedal(side, crank)])
    lines |= bicycle(geometry, link, steer)
    roll = rotation.elementary_matrix(0, pose["bicycle/roll"][0])
    # from the paper's axes (forward, up, right) to ours (forward, left, up), rolled about the contact line
    return {name: (points @ roll.T)[:, [0, 2, 1]] * [1.0, -1.0, 1.0] for name, points in lines.items()}


def bicycle(geometry: RiderGeometry, link: RiderLinkage, steer: np.ndarray) -> dict[str, np.ndarray]:
    """Frame and wheels, paper's axes of the bicycle."""
    radius, origin = geometry.wheel_radius, np.zeros(1)
    rear, front = np.array([0.0, radius, 0.0]), np.array([geometry.wheelbase, radius, 0.0])
    saddle, axle, head = (
        link.point(place, "left", origin) for place in (geometry.saddle, geometry.crank_axle, geometry.steer_origin)
    )
    wheel = radius * np.stack([np.cos(RIM), np.sin(RIM), 0.0 * RIM], axis=-1)
    hands = [link.hand(side, steer) for side in SIDES]
    stem = 0.5 * (hands[0] + hands[1])
    return {
        "rear wheel": rear + wheel,
        "front wheel": front + wheel @ rotation.elementary_matrix(1, steer[0]).T,
        "frame": np.stack([rear, saddle, axle, rear, axle, head, saddle]),
        "fork": np.stack([front, head, stem]),
        "handlebar": np.stack(hands),
    }
