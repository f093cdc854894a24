"""A picture of a page that a browser without a window draws, for documentation and tests."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...filters.support.optional import MissingExtraError

if TYPE_CHECKING:
    from .viewer import Viewer

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
"""Names of the browser's program, in order of preference."""
OPTIONS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
)
"""Drawing by software, so that no graphics hardware is needed."""
SIZE = (1280, 720)
"""Width and height of a picture, pixels."""
FILM_SIZE, FILM_RATE = (640, 420), 12.5
"""Width and height of a moving picture, pixels, and pictures a second."""
FILMS = (".webp", ".gif")
"""Endings of files of moving pictures."""
PATIENCE = 240.0
"""s until the page must have come to rest"""
HIDDEN = ".mantine-Notification-root, .mantine-Notifications-root { display: none !important }"
"""Notes on slow drawing, which are of the software renderer."""


def find_browser() -> str | None:
    """Path of a Chromium or Chrome, or None."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


@contextmanager
def opened_page(viewer: Viewer, size: tuple[int, int]) -> Iterator[Any]:
    """The page of a viewer in a browser without a window, ready for pictures.

    Raises:
        ValueError: there is no browser, or the page does not connect to the viewer.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ModuleNotFoundError:
        raise MissingExtraError("playwright is not installed: pip install playwright", name="playwright") from None
    browser = find_browser()
    if browser is None:
        raise ValueError(f"no browser found; looked for {', '.join(BROWSERS)}")
    with sync_playwright() as play:
        window = play.chromium.launch(executable_path=browser, args=list(OPTIONS))
        page = window.new_page(viewport={"width": size[0], "height": size[1]})
        page.goto(viewer.url, timeout=1e3 * PATIENCE)
        deadline = time.monotonic() + PATIENCE
        while not viewer.server.get_clients():
            if time.monotonic() > deadline:
                raise ValueError(f"the browser did not connect to {viewer.url} in {PATIENCE:g} s")
            page.wait_for_timeout(500.0)
        page.add_style_tag(content=HIDDEN)
        yield page
        window.close()


def take_picture(viewer: Viewer, path: Path, size: tuple[int, int] = SIZE) -> Path:
    """Write a picture (PNG) of a page when two pictures one after the other are equal.

    The viewer is paused, and kept up to date by a thread; ``size`` is width and height in pixels.

    Raises:
        ValueError: there is no browser, or the page does not come to rest.
    """
    with opened_page(viewer, size) as page:
        deadline, last = time.monotonic() + PATIENCE, b""
        while time.monotonic() < deadline:
            # what is new on a page fades in
            page.wait_for_timeout(3000.0)
            seen = page.screenshot(timeout=1e3 * PATIENCE)
            if seen == last:
                path.write_bytes(seen)
                return path
            last = seen
    raise ValueError(f"{viewer.url} did not come to rest in {PATIENCE:g} s")


def take_film(viewer: Viewer, path: Path, until: float, size: tuple[int, int] = FILM_SIZE) -> Path:
    """Write a moving picture (WebP or GIF) of the scene from the time that a viewer shows until another, s.

    The viewer is paused, and nobody else updates it; ``size`` is width and height in pixels.

    Raises:
        ValueError: there is no browser, or ``until`` is not after the time that is shown.
    """
    from PIL import Image

    begin = viewer.player.time
    if not begin < until <= viewer.player.end:
        raise ValueError(f"until must lie after {begin:g} s and up to {viewer.player.end:g} s, got {until:g}")
    images = []
    with opened_page(viewer, size) as page:
        # what is new on a page fades in
        page.wait_for_timeout(10000.0)
        client = next(iter(viewer.server.get_clients().values()))
        for shown in np.arange(begin, until, 1.0 / FILM_RATE):
            viewer.show(float(shown))
            images.append(Image.fromarray(client.get_render(height=size[1], width=size[0])))
    images[0].save(
        path, save_all=True, append_images=images[1:], duration=round(1e3 / FILM_RATE), loop=0, quality=80, method=6
    )
    return path
