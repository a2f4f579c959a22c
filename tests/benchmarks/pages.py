"""How fast pages are built, painted and used, and how large they are, written to reports/benchmarks_pages.md:

    python tests/benchmarks/pages.py

On an idle machine with a browser; about a minute. Times are medians. Each page is opened in a browser context of
its own.
"""

import os
import platform
import sys
import tempfile
import time
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))

from page_helpers import FLAGS, Made, Opened, find_browser, forty_rows

from hevopt.pages import render as page
from hevopt.pages.comparison.page import comparison_page
from hevopt.pages.comparison.results import Results
from hevopt.studies.provenance import versions

OUT = Path(__file__).parents[2] / "reports" / "benchmarks_pages.md"
RUNS = 5
PAINT_MS = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
DRAWN_MS = "performance.now()"
CHOOSE_MS = """() => {
  const began = performance.now(), row = document.getElementById('row');
  row.value = String(row.querySelectorAll('option').length - 1);
  row.dispatchEvent(new Event('change'));
  return performance.now() - began;
}"""


def median(values: list[float]) -> float:
    """The middle one of an odd number of values."""
    return sorted(values)[len(values) // 2]


def build_s(results: Results) -> float:
    """Seconds to make the page, its drawing library packed afresh."""
    times = []
    for _ in range(RUNS):
        page._plotly.cache_clear()
        began = time.perf_counter()
        comparison_page(results)
        times.append(time.perf_counter() - began)
    return median(times)


def shown_ms(browser: Browser, path: Path) -> list[float]:
    """Milliseconds until the first paint, until all figures are drawn, and to show another row."""
    runs = []
    for _ in range(RUNS):
        opened = Opened(browser, path)
        runs.append([opened.page.evaluate(what) for what in (DRAWN_MS, PAINT_MS, CHOOSE_MS)])
        opened.context.close()
    drawn, paint, choose = map(median, zip(*runs, strict=True))
    return [paint, drawn, choose]


def line(browser: Browser, name: str, results: Results, path: Path) -> str:
    """A row of the table."""
    built_s = build_s(results)
    path.write_text(comparison_page(results), encoding="utf-8")
    figures = [f"{built_s:.2f}", f"{path.stat().st_size / 1e6:.1f}"]
    figures += [f"{milliseconds / 1e3:.2f}" for milliseconds in shown_ms(browser, path)]
    return f"| {name} | {' | '.join(figures)} |"


def main() -> None:
    """Run everything and write the page."""
    with tempfile.TemporaryDirectory(prefix="hevopt-") as name, sync_playwright() as playwright:
        folder = Path(name)
        browser = playwright.chromium.launch(executable_path=find_browser(), args=FLAGS)
        default = Made(folder, "default").results
        cases = {
            "default comparison, 20 rows x 1180 steps": default,
            "40 rows x 1800 steps": forty_rows(),
        }
        lines = [line(browser, what, of, folder / "page.html") for what, of in cases.items()]
        program = f"Chromium {browser.version}"
        browser.close()
    on = ", ".join(f"{key} {value}" for key, value in versions().items())
    text = [
        "# Speed of pages",
        "",
        "Made by `python tests/benchmarks/pages.py`; from solved results to the page, and the page in a browser.",
        f"{platform.machine()}, {os.cpu_count()} cores; {program}; {on}.",
        "",
        "| page | build, s | size, MB | first paint, s | all figures drawn, s | another row shown, s |",
        "|---|---|---|---|---|---|",
        *lines,
        "",
    ]
    OUT.write_text("\n".join(text))
    print("\n".join(text))


if __name__ == "__main__":
    main()
