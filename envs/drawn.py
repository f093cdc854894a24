"""Base class of all environments of this package: rendering, reset options, copies and pickles."""

from __future__ import annotations

import copy
import inspect
import math
import time
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Protocol, Self

import gymnasium
import numpy as np

from ..filters.support.parameters import arguments_of, check_parameters
from .registration import refuse_unknown_arguments

RENDER_MODES = ("human", "rgb_array")
BODY_COLOUR = (0.25, 0.28, 0.33)
STICK_COLOUR = (0.95, 0.75, 0.1)
AXIS_COLOURS = ((0.85, 0.15, 0.15), (0.15, 0.65, 0.2), (0.2, 0.35, 0.95))
"""x red, y green, z blue."""
DEVICE_SIZE = (0.16, 0.10, 0.05)
"""m: extent of a device whose size is not known; that of the controller of ``poise/HandMotion-v0``."""

Box = tuple[Sequence[float], Sequence[float], Sequence[float]]
"""Half extents (m), centre in the body frame (m), colour (red, green, blue from 0 to 1)."""


def device_boxes(size: Sequence[float] = DEVICE_SIZE) -> list[Box]:
    """A device with two grips and a stick, whose orientation is visible from any side; ``size`` along its axes, m."""
    x, y, z = (0.5 * side for side in size)
    return [
        ((x, 0.6 * y, z), (0.0, 0.2 * y, 0.0), BODY_COLOUR),
        ((0.25 * x, 0.5 * y, 0.8 * z), (-0.75 * x, -0.8 * y, 0.0), BODY_COLOUR),
        ((0.25 * x, 0.5 * y, 0.8 * z), (0.75 * x, -0.8 * y, 0.0), BODY_COLOUR),
        ((0.12 * x, 0.12 * x, 0.4 * z), (-0.5 * x, 0.3 * y, 1.3 * z), STICK_COLOUR),
    ]


class Scene(Protocol):
    """What an environment is drawn with, see :mod:`poise.envs.rendering`."""

    def draw(self, pose: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray], estimate: np.ndarray) -> None:
        """Put everything in its place; ``estimate`` is the agent's."""
        ...

    def image(self) -> np.ndarray:
        """What is seen, ``(height, width, 3)`` uint8."""
        ...

    def close(self) -> None:
        """Free the window."""
        ...


def finite_action(action: Any, shape: tuple[int]) -> tuple[np.ndarray, list[float]]:
    """An action as an array of its own ``(n,)``, and its entries.

    Raises:
        ValueError: a wrong shape, or an entry that is not a finite real number.
    """
    try:
        values = None if np.iscomplexobj(action) else np.array(action, dtype=float)
    except (TypeError, ValueError):
        values = None
    if values is None or values.shape != shape or not all(map(math.isfinite, entries := values.tolist())):
        raise ValueError(f"action must hold {shape[0]} finite numbers, got {action!r}")
    return values, entries


class Shown(NamedTuple):
    """What a picture shows: true pose and further truth at one time step, and the estimate of it."""

    pose: Mapping[str, np.ndarray]
    truth: Mapping[str, np.ndarray]
    estimate: np.ndarray


class DrawnEnv(gymnasium.Env[Any, np.ndarray]):
    """An environment that can be drawn, copied and pickled.

    A copy is a new environment with the arguments of the original at the same position in the episode. Both continue
    with the same numbers and share nothing; closing one does not affect the other. The copy has no window until it
    renders.

    Args:
        render_mode: ``human`` (a window), ``rgb_array`` or None.
        rate: steps per second of the environment, Hz.

    Raises:
        TypeError: an argument that the environment does not have.
        ValueError: another render mode.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 100}  # noqa: RUF012
    reset_options: ClassVar[tuple[str, ...]] = ()
    """Names that ``reset(options=...)`` understands."""
    _made_with: tuple[tuple[Any, ...], dict[str, Any]]

    def __new__(cls, *args: Any, **kwargs: Any) -> Self:
        """Check the names and types of the arguments, and remember them for copies."""
        refuse_unknown_arguments(cls, kwargs)
        passed_on = kwargs | arguments_of(cls.__init__, args, kwargs)
        for kind in cls.__mro__:
            if (made_by := vars(kind).get("__init__")) is not None:
                check_parameters(made_by, passed_on)
                own = inspect.signature(made_by).parameters
                passed_on = {name: value for name, value in passed_on.items() if name not in own}
        made = super().__new__(cls)
        made._made_with = args, kwargs
        return made

    def __init__(self, render_mode: str | None, rate: float) -> None:
        if render_mode not in (None, *RENDER_MODES):
            raise ValueError(f"render_mode must be None or one of {list(RENDER_MODES)}, got {render_mode!r}")
        self.render_mode = render_mode
        self.metadata = {**type(self).metadata, "render_fps": max(1, round(rate))}
        self._steps_a_second = float(rate)
        self._scene: Scene | None = None
        self._drawn = -math.inf

    def shown(self) -> Shown | None:
        """What a picture shows now; None where there is no episode."""
        raise NotImplementedError

    def make_scene(self, gui: bool) -> Scene:
        """Make what the environment is drawn with."""
        raise NotImplementedError

    def save_episode(self) -> Any:
        """Position in the episode, for a copy."""
        raise NotImplementedError

    def restore_episode(self, saved: Any) -> None:
        """Undo :meth:`save_episode`, in an environment made with equal arguments."""
        raise NotImplementedError

    def checked_options(self, options: Mapping[str, Any] | None) -> dict[str, Any]:
        """The options of a reset.

        Raises:
            ValueError: an unknown one; the message lists those that are known.
        """
        if options is not None and not isinstance(options, Mapping):
            raise ValueError(f"options must be a mapping from name to value, got {options!r}")
        given = dict(options or {})
        unknown = sorted(set(given) - set(self.reset_options))
        if unknown:
            known = f"known are {list(self.reset_options)}" if self.reset_options else "this environment has none"
            raise ValueError(f"unknown reset options {unknown}; {known}")
        return given

    def render(self) -> np.ndarray | None:
        """An image ``(height, width, 3)`` uint8 with ``render_mode="rgb_array"``; a window is drawn by itself.

        Raises:
            RuntimeError: :meth:`reset` was not called.
        """
        shown = self.shown()
        if shown is None:
            raise RuntimeError("call reset first: there is nothing to draw")
        if self.render_mode is None:
            gymnasium.logger.warn("render() does nothing without a render_mode, such as rgb_array")
            return None
        return self._draw(shown).image() if self.render_mode == "rgb_array" else None

    def _draw(self, shown: Shown) -> Scene:
        if self._scene is None:
            self._scene = self.make_scene(self.render_mode == "human")
        self._scene.draw(*shown)
        return self._scene

    def _show(self, step: int) -> None:
        """Update a window, at most fifty times a second and not faster than real time."""
        if self.render_mode != "human":
            return
        stride = max(1, round(self._steps_a_second / 50.0))
        if step % stride:
            return
        if step == 0:
            self._drawn = -math.inf
        wait = self._drawn + stride / self._steps_a_second - time.monotonic()
        if 0.0 < wait < 1.0:
            time.sleep(wait)
        self._drawn = time.monotonic()
        shown = self.shown()
        assert shown is not None
        self._draw(shown)

    def close(self) -> None:
        """Close the window; may be called twice."""
        scene, self._scene = self._scene, None
        if scene is not None:
            scene.close()

    def __reduce__(self) -> tuple[Any, ...]:
        """Arguments and position in the episode, from which copies and pickles are made."""
        state = self.save_episode(), self._np_random, self._np_random_seed, self.spec
        return _made_again, (type(self), *self._made_with, state)

    def __copy__(self) -> Self:
        """Copies are always deep: two environments cannot share an episode."""
        return copy.deepcopy(self)


def _made_again(cls: type[DrawnEnv], args: tuple[Any, ...], kwargs: dict[str, Any], state: tuple[Any, ...]) -> DrawnEnv:
    episode, generator, seed, spec = state
    made = cls(*args, **kwargs)
    made.spec = spec
    if episode is not None:
        made.restore_episode(episode)
    made._np_random, made._np_random_seed = generator, seed
    return made
