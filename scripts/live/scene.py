"""The picture of a motion in the browser, by viser: bodies, trails, forces."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...filters.core import rotation
from .curves import TRUTH
from .meshes import Mesh, by_colour, is_hilly, road_mesh
from .motion import Motion

if TYPE_CHECKING:
    from viser import ViserServer

OPACITY = 0.4
"""of the bodies of a single estimate; those of several are paler, so that the truth keeps its colours behind them"""
APART = 0.7
"""Opacity of the bodies of estimates that stand beside the truth"""
FIELD, ASPECT = 0.9, 1.2
"""Vertical field of view of the camera, rad, and width over height of the picture beside the controls."""
TRAIL = 3.0
"""s"""
TRAIL_POINTS = 150
TINT = 0.75
"""Share of its own colour in the colour of the bodies of an estimate."""
FORCE_COLOUR = (200, 40, 120)
ROAD_COLOUR = (168, 170, 172)
ROAD_INTERVAL = 0.5
"""s of motion after which a road that grows is drawn anew"""


@dataclass(frozen=True)
class Look:
    """How large things are drawn, m.

    Attributes:
        camera: where the camera is at first, from what it looks at.
        height: of the point that it looks at above the subject's position.
        beside: distance between figures that stand side by side.
        arrow: radius of an arrow's shaft.
        trail: width of a trail.
        cell: side of a cell of the ground.
        ground: height of the ground below the subject.
        name: height of a figure's name above the subject.
    """

    camera: tuple[float, float, float]
    height: float
    beside: float
    arrow: float
    trail: float
    cell: float
    ground: float
    name: float
    shell: float = 0.0
    """by which the bodies of each further estimate are larger, so that equal ones do not flicker"""


RIDE = Look((1.0, -2.9, 0.5), 0.8, 1.9, 0.016, 0.012, 0.5, 0.0, 1.9)
DEVICE = Look((0.02, -0.68, 0.30), 0.0, 0.26, 0.0025, 0.002, 0.05, -0.25, 0.16, 0.02)


@dataclass
class Options:
    """What is shown, by the choice of the user.

    Attributes:
        visible: label → whether its figure is shown.
        forces: arrows of forces or accelerations.
        trails: paths of the last seconds.
        beside: figures stand side by side.
        virtual: figures are at the position of the virtual controller.
        turn: the view turns with the heading of the subject.
    """

    visible: dict[str, bool]
    forces: bool = True
    trails: bool = True
    beside: bool = False
    virtual: bool = False
    turn: bool = False


class MotionScene:
    """Bodies of truth and estimates in a viser server.

    The world moves below the camera instead of the camera with the subject, so that the user turns the view freely.

    Args:
        server: of viser.
        meshes: body → meshes in its frame.
        motion: what it shows at first; later motion has the same figures.
        colours: of the labels.
        look: sizes.
    """

    def __init__(
        self,
        server: ViserServer,
        meshes: Mapping[str, list[Mesh]],
        motion: Motion,
        colours: Mapping[str, tuple[int, int, int]],
        look: Look,
    ) -> None:
        self.server, self.look = server, look
        self.labels = list(motion.figures)
        self._pale = OPACITY / math.sqrt(max(1, len(set(self.labels) - {TRUTH})))
        self._opacity = self._pale
        self._translucent: list[Any] = []
        scene = server.scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        self._world = scene.add_frame("/world", show_axes=False)
        self._ground = scene.add_grid(
            "/world/ground",
            infinite_grid=True,
            cell_size=look.cell,
            section_size=4.0 * look.cell,
            cell_color=(214, 218, 222),
            section_color=(176, 182, 188),
            fade_distance=60.0 * look.cell,
        )
        self._figures, self._bodies, self._trails, self._names = {}, {}, {}, {}
        for label, poses in motion.figures.items():
            self._figures[label] = scene.add_frame(f"/world/{label}", show_axes=False)
            for body in poses:
                frame = scene.add_frame(f"/world/{label}/{body}", show_axes=False)
                self._bodies[label, body] = frame
                for index, mesh in enumerate(by_colour(meshes[body])):
                    self._add_mesh(f"/world/{label}/{body}/{index}", mesh, label, colours[label])
            self._trails[label] = scene.add_line_segments(
                f"/world/trails/{label}", np.zeros((1, 2, 3)), colours[label], thickness=look.trail
            )
            self._names[label] = scene.add_label(f"/world/{label}/name", label, anchor="bottom-center", visible=False)
        self._arrows = {
            name: scene.add_arrows(
                f"/world/arrows/{name.replace('/', '-')}",
                np.zeros((1, 2, 3)),
                colours.get(name.split("/")[0], FORCE_COLOUR),
                shaft_radius=look.arrow,
                head_radius=2.2 * look.arrow,
                head_length=5.0 * look.arrow,
            )
            for name in motion.arrows
        }
        self._road_end = -np.inf
        self._lowest: float | None = None
        server.initial_camera.look_at = (0.0, 0.0, 0.0)
        server.initial_camera.position = look.camera
        server.initial_camera.fov = FIELD

    def step_back(self) -> None:
        """Begin with the camera so far away that all figures are seen side by side."""
        camera = np.array(self.look.camera)
        width = 2.0 * np.linalg.norm(camera) * np.tan(0.5 * FIELD) * ASPECT
        away = max(1.0, (len(self.labels) + 0.5) * self.look.beside / width)
        self.server.initial_camera.position = tuple(float(part) for part in away * camera)

    def _add_mesh(self, name: str, mesh: Mesh, label: str, colour: tuple[int, int, int]) -> None:
        own = 255.0 * np.array(mesh.colour)
        truth = label == TRUTH
        shown = own if truth else (1.0 - TINT) * own + TINT * np.array(colour)
        red, green, blue = (int(part) for part in shown)
        handle = self.server.scene.add_mesh_simple(
            name,
            mesh.vertices,
            mesh.faces,
            color=(red, green, blue),
            opacity=None if truth else self._opacity,
            scale=1.0 + self.look.shell * self.labels.index(label),
            cast_shadow=truth,
            receive_shadow=truth,
        )
        if not truth:
            self._translucent.append(handle)

    def _set_opacity(self, opacity: float) -> None:
        """How opaque the bodies of estimates are."""
        if opacity != self._opacity:
            self._opacity = opacity
            for handle in self._translucent:
                handle.opacity = opacity

    def _lay_road(self, motion: Motion) -> None:
        """The road so far, where the truth knows one that is not level."""
        bicycle = motion.figures.get(TRUTH, {}).get("bicycle")
        if bicycle is None or motion.time[-1] < self._road_end + ROAD_INTERVAL:
            return
        self._road_end = float(motion.time[-1])
        if is_hilly(bicycle.position):
            vertices, faces = road_mesh(bicycle.position)
            self._lowest = float(vertices[:, 2].min())
            self.server.scene.add_mesh_simple(
                "/world/road", vertices, faces, color=ROAD_COLOUR, side="double", cast_shadow=False
            )

    def show(self, motion: Motion, row: int, options: Options) -> None:
        """Put everything in its place at a row of a motion with the figures of the first one."""
        shown = [label for label in self.labels if options.visible.get(label, True)]
        focus, heading = self._focus(motion, row)
        world = rotation.exp(np.array([0.0, 0.0, -heading])) if options.turn else np.array([1.0, 0.0, 0.0, 0.0])
        raised = focus + np.array([0.0, 0.0, self.look.height])
        with self.server.atomic():
            self._set_opacity(APART if options.beside else self._pale)
            self._world.wxyz = world
            self._world.position = -rotation.rotate(world, raised)
            self._lay_road(motion)
            level = float(focus[2]) + self.look.ground if self._lowest is None else self._lowest
            self._ground.position = (0.0, 0.0, level)
            for label in self.labels:
                self._show_figure(motion, row, label, options, shown, world)
            for name, handle in self._arrows.items():
                self._show_arrow(motion, row, name, handle, options, shown)

    def _focus(self, motion: Motion, row: int) -> tuple[np.ndarray, float]:
        """Position of the subject, and its heading."""
        position, orientation = next(iter(motion.figures[self.labels[0]].values()))
        known = np.isfinite(position[row]).all()
        place = position[row] if known else np.zeros(3)
        turn = orientation[row]
        return place, float(rotation.to_euler_zyx(turn)[0]) if np.isfinite(turn).all() else 0.0

    def _offset(
        self, motion: Motion, row: int, label: str, options: Options, shown: list[str], world: np.ndarray
    ) -> np.ndarray:
        """By how much a figure is moved from the subject's position, world axes, m."""
        offset = np.zeros(3)
        if options.beside and label in shown:
            across = (shown.index(label) - 0.5 * (len(shown) - 1)) * self.look.beside
            offset = rotation.rotate_back(world, np.array([across, 0.0, 0.0]))
        if options.virtual and label in motion.virtual:
            place = next(iter(motion.figures[label].values())).position[row]
            offset = (
                offset + np.nan_to_num(motion.virtual[label][row]) - np.nan_to_num(place) + self._focus(motion, 0)[0]
            )
        return offset

    def _show_figure(
        self, motion: Motion, row: int, label: str, options: Options, shown: list[str], world: np.ndarray
    ) -> None:
        offset = self._offset(motion, row, label, options, shown, world)
        figure = self._figures[label]
        figure.visible = label in shown
        figure.position = offset
        for body, placed in motion.figures[label].items():
            frame, place, turn = self._bodies[label, body], placed.position[row], placed.orientation[row]
            known = bool(np.isfinite(place).all() and np.isfinite(turn).all() and turn.any())
            frame.visible = known
            if known:
                frame.position, frame.wxyz = place, rotation.normalize(turn)
        place = next(iter(motion.figures[label].values())).position[row]
        self._names[label].visible = options.beside and label in shown
        self._names[label].position = np.nan_to_num(place) + np.array([0.0, 0.0, self.look.name])
        trail = self._trails[label]
        first = next(iter(self.labels))
        drawn = options.trails and label in shown and (label == first or (options.virtual and label in motion.virtual))
        trail.visible = drawn
        if drawn:
            points = trail_of(motion, row, label, options.virtual)
            start = self._focus(motion, 0)[0] if options.virtual and label in motion.virtual else np.zeros(3)
            beside = self._offset(motion, row, label, Options({}, beside=options.beside), shown, world)
            trail.points = points + start + beside

    def _show_arrow(self, motion: Motion, row: int, name: str, handle: Any, options: Options, shown: list[str]) -> None:
        owner = name.split("/")[0]
        start, vector = (part[row] for part in motion.arrows[name])
        known = bool(np.isfinite(start).all() and np.isfinite(vector).all() and np.linalg.norm(vector) > 1e-4)
        apart = options.beside or (options.virtual and owner in motion.virtual)
        handle.visible = options.forces and known and not apart and (owner not in self.labels or owner in shown)
        if handle.visible:
            handle.points = np.array([[start, start + vector]])


def trail_of(motion: Motion, row: int, label: str, virtual: bool) -> np.ndarray:
    """The path of the last seconds as segments ``(k, 2, 3)``, m; of the virtual controller where that is shown."""
    if virtual and label in motion.virtual:
        path = motion.virtual[label]
    else:
        path = next(iter(motion.figures[label].values())).position
    first = int(np.searchsorted(motion.time, motion.time[row] - TRAIL))
    index = np.unique(np.linspace(first, row, TRAIL_POINTS).astype(int))
    points = np.nan_to_num(path[index])
    if len(points) < 2:
        return np.repeat(points[:1, None], 2, axis=1)
    return np.stack([points[:-1], points[1:]], axis=1)
