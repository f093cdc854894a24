"""A picture of a page that a browser without a window draws, for documentation and tests."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

from ...filters.support.optional import extra

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
"""Width and height, pixels."""
PATIENCE = 240.0
"""s until the page must have come to rest"""
HIDDEN = ".mantine-Notification-root, .mantine-Notifications-root { display: none !important }"
"""Notes on slow drawing, which are of the software renderer."""


def find_browser() -> str | None:
    """Path of a Chromium or Chrome, or None."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def take_picture(url: str, path: Path, size: tuple[int, int] = SIZE) -> Path:
    """Write a picture of a page when two pictures one after the other are equal.

    Args:
        url: of the page, which must come to rest by itself.
        path: PNG file.
        size: width and height, pixels.

    Raises:
        ValueError: there is no browser, or the page does not come to rest.
    """
    with extra("view"):
        from playwright.sync_api import sync_playwright

    browser = find_browser()
    if browser is None:
        raise ValueError(f"no browser found; looked for {', '.join(BROWSERS)}")
    with sync_playwright() as play:
        window = play.chromium.launch(executable_path=browser, args=list(OPTIONS))
        page = window.new_page(viewport={"width": size[0], "height": size[1]})
        page.goto(url, timeout=1e3 * PATIENCE)
        page.get_by_role("button", name="Play").wait_for(timeout=1e3 * PATIENCE)
        page.add_style_tag(content=HIDDEN)
        deadline, last = time.monotonic() + PATIENCE, b""
        while time.monotonic() < deadline:
            # what is new on a page fades in
            page.wait_for_timeout(3000.0)
            seen = page.screenshot(timeout=1e3 * PATIENCE)
            if seen == last:
                path.write_bytes(seen)
                window.close()
                return path
            last = seen
        window.close()
    raise ValueError(f"{url} did not come to rest in {PATIENCE:g} s")
