"""The viewer in the browser: picture, plot and controls, kept at the time of the player."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from typing import Any

import numpy as np

from ...filters.support.names import look_up
from ...filters.support.optional import extra
from .curves import TRUTH, colours_of, curve_figure
from .motion import Motion, Rider, Subject
from .player import SPEEDS, Player
from .scene import DEVICE, RIDE, MotionScene, Options

with extra("view"):
    import viser

FRAMES = 30.0
"""Pictures a second."""
PLOT_INTERVAL = 0.5
"""s between updates of the plot."""
NOTHING = "–"


class Viewer:
    """Motion of a subject in the browser.

    Args:
        subject: what moves.
        motion: what is shown at first.
        title: of the page.
        host: address that the server listens on.
        port: of the server; 0 takes a free one.
        live: whether the motion grows.
        addable: names of estimators that may be added.
        more: subject and motion with other estimators, by their names.
    """

    def __init__(
        self,
        subject: Subject,
        motion: Motion,
        title: str,
        *,
        host: str = "127.0.0.1",
        port: int = 8080,
        live: bool = False,
        addable: Sequence[str] = (),
        more: Callable[[Sequence[str]], tuple[Subject, Motion]] | None = None,
    ) -> None:
        self.motion, self._addable, self._more = motion, tuple(addable), more
        self._lock = threading.RLock()
        self.player = Player(float(motion.time[0]), float(motion.time[-1]), following=live, time=float(motion.time[0]))
        ride = isinstance(subject, Rider)
        self.options = Options(dict.fromkeys(motion.figures, True), turn=ride)
        with redirect_stdout(StringIO()):  # what viser prints, whether it is verbose or not
            self.server = viser.ViserServer(host, port, title, verbose=False)
        self.stopped = threading.Event()
        self._changed = threading.Event()
        self._changed.set()
        self._row, self._plotted, self._ride = -1, -np.inf, ride
        self._draw(subject, motion)
        self._controls(title)
        self.tick(0.0)

    def _draw(self, subject: Subject, motion: Motion) -> None:
        """Make the bodies anew."""
        self._colours = colours_of(list(motion.figures))
        self._scene = MotionScene(self.server, subject.meshes(), motion, self._colours, RIDE if self._ride else DEVICE)
        self._row = -1

    @property
    def url(self) -> str:
        """Address of the page."""
        host = self.server.get_host()
        return f"http://{'localhost' if host == '0.0.0.0' else host}:{self.server.get_port()}"

    def _controls(self, title: str) -> None:
        gui, player = self.server.gui, self.player
        gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.set_panel_label(title)
        self._play = gui.add_button("Pause" if player.playing else "Play")
        self._play.on_click(lambda event: self._act(player.toggle))
        span = max(player.end - player.begin, 0.01)
        self._slider: Any = gui.add_slider("time (s)", player.begin, player.begin + span, 0.01, player.time)
        self._slider.on_update(
            lambda event: self._act(lambda: player.seek(self._slider.value)) if event.client is not None else None
        )
        speed = gui.add_dropdown("speed", [f"{each:g} ×" for each in SPEEDS], initial_value="1 ×")
        speed.on_update(lambda event: self._act(lambda: setattr(player, "speed", float(speed.value.split()[0]))))
        if player.following:
            gui.add_button("Follow the newest sample").on_click(lambda event: self._act(player.follow))
        self._choice: Any = gui.add_dropdown("plot", list(self.motion.curves) or [NOTHING])
        self._choice.on_update(lambda event: self._act(lambda: None))
        self._plot = gui.add_plotly(self._figure(), aspect=0.66)
        self._shown = gui.add_folder("Truth and estimates")
        with self._shown:
            if self._more is not None and self._addable:
                add = gui.add_dropdown("add", [NOTHING, *self._addable], initial_value=NOTHING, order=1e6)
                add.on_update(lambda event: self._add(add.value, event.client))
            for label in self.options.visible:
                self._checkbox(label, True, partial(self._choose, label))
        with gui.add_folder("Shown"):
            if self.motion.arrows:
                self._checkbox("forces" if self._ride else "acceleration", True, self._set("forces"))
            self._checkbox("trail", True, self._set("trails"))
            self._beside = self._checkbox("side by side", False, self._set("beside"))
            if self.motion.virtual:
                self._checkbox("virtual controller", False, self._set("virtual"))
            if self._ride:
                self._checkbox("follow heading", True, self._set("turn"))

    def _add(self, name: str, client: Any) -> None:
        """Add an estimator; what is wrong with it is said on the page."""
        try:
            self.add(name)
        except (ValueError, ImportError) as reason:
            if client is not None:
                client.add_notification(f"{name} cannot be shown", str(reason), color="red")

    def add(self, name: str) -> None:
        """Run another estimator and show it.

        Raises:
            ValueError: it does not fit to the recording, or says nothing of the attitude.
            ImportError: the package that it wraps is not installed.
        """
        if self._more is None or name == NOTHING or name in self.motion.figures:
            return
        subject, motion = self._more((*(label for label in self.motion.figures if label != TRUTH), name))
        if name not in motion.figures:
            raise ValueError(f"{name} does not estimate an attitude")
        with self._lock:
            self.motion = motion
            self.options.visible[name] = True
            self.server.scene.reset()
            self._draw(subject, motion)
            chosen = self._choice.value
            self._choice.options = list(motion.curves) or [NOTHING]
            self._choice.value = chosen if chosen in motion.curves else self._choice.options[0]
            with self._shown:
                self._checkbox(name, True, partial(self._choose, name))
            self._act(lambda: None)

    def _choose(self, label: str, value: bool) -> None:
        self.options.visible[label] = value

    def _set(self, name: str) -> Callable[[bool], object]:
        return lambda value: setattr(self.options, name, value)

    def _checkbox(self, label: str, value: bool, act: Callable[[bool], object]) -> Any:
        box = self.server.gui.add_checkbox(label, value)
        box.on_update(lambda event: self._act(lambda: act(box.value)))
        return box

    def _act(self, act: Callable[[], object]) -> None:
        act()
        self._plotted = -np.inf
        self._changed.set()

    def _figure(self) -> object:
        shown = {
            label: values
            for label, values in self.motion.curves.get(self._choice.value, {}).items()
            if self.options.visible.get(label, True)
        }
        return curve_figure(self.motion.time, shown, self._choice.value, self._colours, self.player.time)

    def begin(self, at: float | None = None, plot: str | None = None, *, beside: bool = False) -> None:
        """Choose what is shown at first.

        Args:
            at: time, s, paused; None plays from the beginning.
            plot: which curves: their name or a part of it.
            beside: figures stand side by side.

        Raises:
            ValueError: the time is not one of the motion, or there are no such curves.
        """
        if at is not None:
            if not self.player.begin <= at <= self.player.end:
                raise ValueError(f"at must lie from {self.player.begin:g} to {self.player.end:g} s, got {at:g}")
            self.player.seek(at)
            self.player.playing = False
        if plot is not None:
            titles = {title: title for title in self.motion.curves}
            found = next((title for title in titles if plot in title), None)
            self._choice.value = look_up("plot", plot, titles) if found is None else found
        self._beside.value = beside
        if beside:
            self._scene.step_back()
        self._act(lambda: None)

    def replace(self, motion: Motion) -> None:
        """Show a motion that has grown."""
        self.motion = motion
        self.player.grow(float(motion.time[0]), float(motion.time[-1]))
        self._slider.min = self.player.begin
        self._slider.max = max(self.player.end, self.player.begin + 0.01)
        self._row = -1

    def show(self, time: float) -> None:
        """Show a time, s, at once."""
        self.player.seek(time)
        self._changed.set()
        self.tick(0.0)

    def tick(self, clock: float) -> None:
        """Advance the player to a time of a monotonic clock, s, and update what has changed."""
        with self._lock:
            self._tick(clock)

    def _tick(self, clock: float) -> None:
        before = self.player.playing
        shown = self.player.advance(clock)
        changed = self._changed.is_set()
        self._changed.clear()
        row = int(np.clip(np.searchsorted(self.motion.time, shown + 1e-9) - 1, 0, len(self.motion) - 1))
        if row != self._row or changed:
            self._row = row
            self._scene.show(self.motion, row, self.options)
            self._slider.value = round(shown, 2)
        if changed or before != self.player.playing:
            self._play.label = "Pause" if self.player.playing else "Play"
        if changed or (self.player.playing and clock - self._plotted >= PLOT_INTERVAL):
            self._plotted = clock
            self._plot.figure = self._figure()

    def run(self, newer: Callable[[], Motion | None] = lambda: None) -> None:
        """Keep the page up to date, with the motion that has grown if there is one, until :attr:`stopped` is set."""
        while not self.stopped.wait(1.0 / FRAMES):
            grown = newer()
            if grown is not None and grown is not self.motion:
                self.replace(grown)
            self.tick(time.monotonic())

    def close(self) -> None:
        """Stop the server."""
        self.stopped.set()
        with redirect_stdout(StringIO()):
            self.server.stop()
