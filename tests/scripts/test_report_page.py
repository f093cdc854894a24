"""The page of a benchmark in a real browser: it draws, sorts and filters without a network or an error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from poise.baselines.comparison.html_report import html_report
from poise.baselines.comparison.tasks import Results
from poise.baselines.error_table import ErrorTable
from poise.filters.support.rows import RESULT
from poise.scripts.live.picture import OPTIONS, find_browser


def results() -> Results:
    """Errors of three estimators on six trajectories."""
    generator = np.random.default_rng(0)
    rows = [
        (name, f"ride {number}", "up", metric, scale * generator.uniform(0.8, 1.2), "deg")
        for name, scale in (("bounded-motion", 0.5), ("vqf", 7.0), ("tilt", 20.0))
        for number in range(6)
        for metric in ("inclination", "inclination largest")
    ]
    rows += [(name, trajectory, "up", "valid", 1.0, "1") for name, trajectory, *_ in rows]
    return Results(ErrorTable(rows, columns=list(RESULT)), {}, [])


def test_page_works_in_a_browser(tmp_path: Path) -> None:
    sync_api = pytest.importorskip("playwright.sync_api")
    pytest.importorskip("plotly")
    browser = find_browser()
    if browser is None:
        pytest.skip("no browser")
    kinds = {"bounded-motion": "filter", "vqf": "external", "tilt": "baseline"}
    path = tmp_path / "report.html"
    path.write_text(html_report("poise benchmark", {"rides": results()}, kinds, {"seed": 0}), encoding="utf-8")
    complaints: list[str] = []
    requests: list[str] = []
    with sync_api.sync_playwright() as play:
        window = play.chromium.launch(executable_path=browser, args=list(OPTIONS))
        page = window.new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(path.as_uri())
        page.wait_for_selector(".js-plotly-plot .main-svg")
        names = page.locator("tbody tr:visible td:first-child")
        assert names.all_inner_texts() == ["bounded-motion", "vqf", "tilt"]
        heading = page.locator("th", has_text="mean")
        heading.click()
        heading.press("Enter")
        assert heading.get_attribute("aria-sort") == "descending"
        assert page.locator(".xtitle").first.text_content() == "RMS error, deg"
        assert names.all_inner_texts() == ["tilt", "vqf", "bounded-motion"]
        page.locator("th", has_text="95 %").first.click()
        assert names.all_inner_texts() == ["bounded-motion", "vqf", "tilt"]  # 5.6 before 16, as numbers
        page.fill("#filter", "vq tilt")
        assert names.all_inner_texts() == ["vqf", "tilt"]
        plotted = "document.querySelector('.js-plotly-plot').data[0].y"
        assert page.evaluate(plotted) == ["tilt", "vqf"]
        page.locator("#kinds input").nth(1).click()
        assert len(names.all_inner_texts()) == len(page.evaluate(plotted)) == 1
        page.locator("summary").nth(2).click()
        page.wait_for_selector(".hm")
        window.close()
    assert complaints == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in requests)
