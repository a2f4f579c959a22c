"""A comparison with its page, a browser, and a page opened in it."""

import json
import os
import shutil
from pathlib import Path

import pytest

from hevopt import outputs, study
from hevopt.pages.collect import Collector
from hevopt.pages.comparison import comparison_page
from hevopt.pages.results import Results

FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--no-first-run", "--disable-dev-shm-usage",
]  # fmt: skip


def find_browser() -> str:
    """The program of a browser; skips where there is none, fails if HEVOPT_REQUIRE_BROWSER=1."""
    names = ("chromium", "chromium-browser", "google-chrome")
    program = next(filter(None, map(shutil.which, names)), None)
    if program is None:
        notice = f"no browser found ({', '.join(names)}); install Debian's chromium"
        if os.environ.get("HEVOPT_REQUIRE_BROWSER") == "1":
            pytest.fail(f"{notice}: HEVOPT_REQUIRE_BROWSER=1")
        pytest.skip(notice)
    return program


class Made:
    """A comparison with what is made from it."""

    def __init__(self, folder: Path, name: str, **settings):
        collector = Collector()
        self.solved = {}

        def observe(case, row, plan, trajectory):
            self.solved[row.architecture, row.strategy] = case, plan, trajectory
            collector.observe(case, row, plan, trajectory)

        comparison = study.compare(observe=observe, **settings)
        self.results = collector.results(comparison, "hevopt compare --cycle 'my cycle'")
        self.json = json.loads(outputs.result_json(comparison, {}))
        self.path = folder / f"{name}.html"
        self.path.write_text(comparison_page(self.results), encoding="utf-8")


class Opened:
    """A page in the browser, with what it asked for and what went wrong."""

    def __init__(self, browser, path: Path, *, wait: bool = True, script: str = "", **settings):
        self.context = browser.new_context(accept_downloads=True, **settings)
        self.page = self.context.new_page()
        self.trouble, self.requests = [], []
        self.page.on("console", lambda message: self.trouble.append(message.text))
        self.page.on("pageerror", lambda error: self.trouble.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        if script:
            self.page.add_init_script(script)
        self.page.goto(path.as_uri())
        if wait:
            self.page.wait_for_selector("html[data-drawn]", state="attached")


def forty_rows() -> Results:
    """Forty rows of 1800 steps: dynamic programming on WLTC, every car under several names."""
    collector = Collector()
    comparison = study.compare("wltc_class3b", strategies=["dp"], observe=collector.observe)
    contents = json.loads(collector.results(comparison, "hevopt compare").model_dump_json())
    rows, cars = contents["rows"], contents["cars"]
    contents["rows"], contents["cars"] = [], {}
    for n in range(40):
        row = rows[n % len(rows)]
        own = row["figures"]["architecture"]
        contents["cars"][f"{own} {n}"] = cars[own]
        figures = row["figures"] | {"architecture": f"{own} {n}"}
        contents["rows"].append({"figures": figures, "detail": row["detail"]})
    return Results.model_validate(contents)
