"""A comparison with its page, a browser, and a page opened in it."""

import json
import os
import shutil
from pathlib import Path
from time import monotonic

import pytest

from hevopt.output import file_tables as outputs
from hevopt.pages.comparison.collect import Collector
from hevopt.pages.comparison.page import comparison_page
from hevopt.pages.comparison.results import Results
from hevopt.studies import comparison as study

FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--no-first-run", "--disable-dev-shm-usage",
]  # fmt: skip

# However busy the machine; what comes at all comes within seconds on an idle one.
PATIENCE_S = 300.0

AXES = """() => [...document.querySelectorAll('.plot')]
  .filter(plot => plot.offsetParent).flatMap(plot => Object.entries(plot._fullLayout)
  .filter(([name]) => /^[xy]axis[0-9]*$/.test(name) && plot._fullLayout._plots)
  .filter(() => (plot._fullData || []).some(trace => trace.type !== 'sankey'))
  .map(([name, axis]) => [plot.id, name, axis.title.text || '']))"""


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

    def __init__(
        self, browser, path: Path, *, at: str = "", wait: bool = True, script: str = "", **settings
    ):
        self.context = browser.new_context(accept_downloads=True, **settings)
        self.context.set_default_timeout(1000 * PATIENCE_S)
        self.page = self.context.new_page()
        self.trouble, self.requests = [], []
        self.page.on("console", lambda message: self.trouble.append(message.text))
        self.page.on("pageerror", lambda error: self.trouble.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        if script:
            self.page.add_init_script(script)
        self.page.goto(path.as_uri() + (f"#{at}" if at else ""))
        if wait:
            self.page.wait_for_selector("html[data-drawn]", state="attached", timeout=120_000)


def until(page, condition: str, seconds: float = PATIENCE_S) -> None:
    """Wait for a condition of the page; the page's own policy forbids the browser to wait for a text."""
    end = monotonic() + seconds
    while not page.evaluate(condition):
        assert monotonic() < end, f"not within {seconds} s: {condition}"
        page.wait_for_timeout(20)


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


def settle(page):
    """Wait until what the page does on a change of media is done."""
    page.evaluate("new Promise(done => requestAnimationFrame(() => setTimeout(done, 50)))")


def front(car):
    points = [
        {
            "nox_weight": weight, "nox_weights": [weight], "strategy": "dp", "fuel_l_per_100km": fuel,
            "nox_mg_per_km": nox, "bound_l_per_100km": fuel, "gap_percent": 0.1, "certificate": "LP prices",
        }
        for weight, fuel, nox in ((0.0, 2.8, 300.0), (10.0, 2.9, 200.0))
    ]  # fmt: skip
    corners = ((260.0, 2.8), (190.0, 2.88))
    outer = [{"nox_mg_per_km": nox, "fuel_l_per_100km": fuel} for nox, fuel in corners]
    return {
        "architecture": car,
        "cycle": "nedc",
        "points": points,
        "outer": outer,
        "gap_percent": 0.1,
    }


def effect(car, percent):
    return {
        "architecture": car, "strategy": "dp", "parameter": car, "unit": car, "values": [1.0, 2.0, 3.0],
        "fuel_l_per_100km": [2.7, 2.8, 2.9], "delta_percent": [-percent, 0.0, percent],
        "nox_mg_per_km": [1.0, 1.0, 1.0], "delta_nox_percent": [0.0, 0.0, None], "elasticity": 0.3,
        "elasticity_nox": None,
    }  # fmt: skip
