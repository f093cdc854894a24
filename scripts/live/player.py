"""The clock of a viewer: play, pause, seek, speed; follows the end of motion that grows."""

from __future__ import annotations

from dataclasses import dataclass, field

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Times real time."""


@dataclass
class Player:
    """Time that is shown.

    Attributes:
        begin: s, first time there is.
        end: s, last one; grows where the motion does.
        speed: times real time.
        playing: whether time advances; after the end it begins again.
        following: show the end while it grows.
    """

    begin: float = 0.0
    end: float = 0.0
    speed: float = 1.0
    playing: bool = True
    following: bool = False
    time: float = 0.0
    _clock: float | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        if not self.end >= self.begin:
            raise ValueError(f"end must not be before begin = {self.begin} s, got {self.end} s")
        if not self.speed > 0.0:
            raise ValueError(f"speed must be positive, got {self.speed}")
        self.time = min(max(self.time, self.begin), self.end)

    def advance(self, clock: float) -> float:
        """The time to show, s, at a time of a monotonic clock, s."""
        passed = 0.0 if self._clock is None else max(0.0, clock - self._clock)
        self._clock = clock
        if not self.playing:
            return self.time
        if self.following:
            self.time = self.end
            return self.time
        self.time += self.speed * passed
        if self.time > self.end:
            span = self.end - self.begin
            self.time = self.begin + (self.time - self.begin) % span if span > 0.0 else self.end
        return self.time

    def seek(self, time: float) -> None:
        """Show another time, within what there is, and do not follow the end any longer."""
        self.time = min(max(time, self.begin), self.end)
        self.following = False

    def toggle(self) -> None:
        """Play or pause."""
        self.playing = not self.playing

    def follow(self) -> None:
        """Show the end again while it grows."""
        self.following = self.playing = True

    def grow(self, begin: float, end: float) -> None:
        """There is more motion now, or its beginning was forgotten."""
        self.begin, self.end = begin, max(begin, end)
        self.time = min(max(self.time, self.begin), self.end)
