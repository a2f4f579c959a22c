"""Pages of driven cars: their figures are the run's, and a browser draws them all."""

import re

import numpy as np
import pytest
from page_helpers import until

from hevopt import drive, load_architecture, performance
from hevopt.driving.cycle import Cycle
from hevopt.output.driven_tables import audit
from hevopt.pages.forward.drawing import drawn_run, tolerance_band
from hevopt.pages.forward.page import driven_page, performance_page

# Names of slopes that a line of the figure runs through: by sampling every line's path.
CROSSED = """() => {
  const plot = document.getElementById('forces');
  const drawn = [...plot.querySelectorAll('.annotation-text')];
  const labels = drawn.map(e => [e.textContent, e.getBoundingClientRect()]);
  if (labels.length < 4) return ['labels', labels.length];
  return labels.filter(([name, box]) => [...plot.querySelectorAll('.scatterlayer .lines path')].some(path => {
    if (path.closest('.trace').__data__[0].trace.name === name) return false;
    const matrix = path.getScreenCTM(), length = path.getTotalLength();
    for (let at = 0; at < length; at += 3) {
      const { x, y } = path.getPointAtLength(at).matrixTransform(matrix);
      if (x > box.left && x < box.right && y > box.top + 1 && y < box.bottom - 1) return true;
    }
    return false;
  })).map(([name]) => name);
}"""


@pytest.fixture(scope="module")
def driven():
    """A hop that asks for too much in between, so that the trace is left."""
    time_s = np.arange(61.0)
    speed = np.interp(time_s, [0, 5, 15, 20, 22, 45, 55, 60], [0, 0, 10, 10, 33, 25, 0, 0])
    cycle = Cycle("hop <1>", time_s, speed, np.zeros(61))
    return drive(load_architecture("C2"), cycle, "conventional", step_s=0.02)


@pytest.fixture(scope="module")
def fast():
    cars = [load_architecture(name) for name in ("A", "C2")]
    return [performance(cars[0]), performance(cars[1], boosts=True)]


@pytest.fixture(scope="module")
def pages(driven, fast, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    found = {
        "run": (folder / "run.html", driven_page(driven, "hevopt drive C2 --cycle 'a<b'")),
        "fast": (folder / "fast.html", performance_page(fast, "hevopt performance A,C2")),
    }
    for path, text in found.values():
        path.write_text(text, "utf-8")
    return {name: path for name, (path, _) in found.items()}


def test_its_tables_hold_the_runs_figures(driven, pages):
    text = pages["run"].read_text("utf-8")
    assert f'data-key="corrected" data-value="{driven.corrected_l_per_100km}"' in text
    kinds = re.findall(r'data-key="kind" data-value="([^"]+)"', text)
    assert [float(value) for value in kinds] == list(driven.difference_percent.values())
    given, taken = (
        sum(map(float, re.findall(rf'data-key="{side}" data-value="([^"]+)"', text)))
        for side in ("from", "to")
    )
    assert given == pytest.approx(taken, abs=1e-2 * len(audit(driven.run)))
    left = len(driven.run.quality.violations)
    assert left > 0 and len(re.findall(r'data-key="beyond"', text)) == left
    assert "hop &lt;1&gt;" in text and "a&lt;b" in text and "<1>" not in text


def test_the_page_of_performance_has_every_time(fast, pages):
    text = pages["fast"].read_text("utf-8")
    for of in fast:
        assert f'data-key="to-speed" data-value="{of.to_speed_s[100]}"' in text
        assert f'data-key="top" data-value="{of.top_mps[6] * 3.6}"' in text
    assert "C2, e-boost" in text


def test_what_is_drawn_keeps_the_runs_energy_and_its_ends(driven):
    run, found = driven.run, drawn_run(driven.run)
    ends = np.diff(np.append(0.0, found["t"]))
    drawn_kj = float(np.dot(found["brakes"], ends))
    assert drawn_kj == pytest.approx(
        float(run.books.flows["brake_power_w"].sum()) * run.step_s / 1e3, rel=1e-2
    )
    assert found["soc"][-1] == pytest.approx(100 * run.soc[-1], abs=1e-4)
    assert len(found["t"]) == len(found["gear"]) == len(found["clutch"]["launch"]) <= 2400


def test_the_band_is_the_tolerance_that_violations_are_judged_by(driven):
    run = driven.run
    low, high = tolerance_band(run)
    speed, wanted = 3.6 * run.speed_mps, 3.6 * run.wanted_mps
    assert (low <= np.maximum(wanted - 2, 0) + 1e-9).all() and (high >= wanted + 2 - 1e-9).all()
    outside = float(((speed < low - 1e-9) | (speed > high + 1e-9)).sum()) * run.step_s
    assert outside == pytest.approx(run.quality.outside_s, abs=0.3)


@pytest.mark.parametrize(
    ("name", "figures"), [("run", ("trace", "audit")), ("fast", ("pull", "forces"))]
)
def test_every_figure_is_drawn_and_nothing_leaves_the_screen(pages, opened, name, figures):
    found = opened(pages[name], viewport={"width": 1200, "height": 900})
    page = found.page
    until(page, "document.querySelectorAll('.plot .main-svg').length > 1")
    drawn = page.evaluate(
        "[...document.querySelectorAll('.plot')].map(p => [p.id, !!p._fullLayout])"
    )
    assert drawn == [[figure, True] for figure in figures]
    if name == "fast":
        for car in (0, 1):
            page.select_option("#car", index=car)
            assert page.evaluate(CROSSED) == []
    else:
        ticks = page.locator("#audit .xtick").all_text_contents()
        assert ticks and not any("k" in tick for tick in ticks)  # 10k kJ are 10000 kJ
    assert page.evaluate("document.documentElement.scrollWidth") == 1200
    assert found.trouble == []
