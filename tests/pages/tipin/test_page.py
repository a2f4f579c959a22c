"""The page of a tip-in study: its figures are the study's, and a browser draws them all."""

import re
from dataclasses import replace

import pytest
from diesels import shipped
from page_helpers import until

from hevopt import load_architecture
from hevopt.car_files.mean_value_parts import mean_value_of
from hevopt.errors import DataError
from hevopt.pages.tipin.page import tipin_page
from hevopt.tipin.bands import bands_of
from hevopt.tipin.case import BASE, Case, variation
from hevopt.tipin.drive import Manoeuvre, tip_in


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A hybrid, its machine helping, a leaner smoke limit and a case that failed."""
    car = load_architecture("C2")
    study = Manoeuvre(car, mean_value_of("C2", car.contents["engine"]), 40 / 3.6, 4)
    cases = (BASE, variation("smoke", 1.4), Case("e-boost", assist=True))
    found = [tip_in(study, case) for case in cases]
    path = tmp_path_factory.mktemp("tipin") / "page.html"
    failed = {"gear ratio <9>": DataError("too high & more")}
    path.write_text(tipin_page(study, found, failed, [], "hevopt tipin C2 --set 'a<b'"), "utf-8")
    return path, found


def test_its_tables_hold_the_studys_figures(made):
    path, found = made
    text = path.read_text("utf-8")
    cells = re.findall(r'data-key="accel" data-value="([^"]+)"', text)
    assert [float(cell) for cell in cells] == [a for t in found for a in t.figures.accel_mps2]
    assert f"{100 * found[2].assist.filled:.0f}" in text
    assert "gear ratio &lt;9&gt;: too high &amp; more" in text
    assert "a&lt;b" in text and "<9>" not in text


def test_bands_stand_on_the_page_of_the_shipped_manoeuvre_alone():
    diesel, car = shipped("compact_1300").diesel, shipped("compact_1300").car
    own = Manoeuvre(car, diesel, 40 / 3.6, 4)
    base = tip_in(own, BASE).figures
    assert all(band.holds for band in bands_of(own, base))
    assert bands_of(Manoeuvre(car, diesel, 50 / 3.6, 4), base) == []
    assert bands_of(Manoeuvre(car, diesel, 40 / 3.6, 5), base) == []


@pytest.mark.parametrize("width", [1200, 400])
def test_every_figure_is_drawn_and_nothing_leaves_the_screen(made, opened, width):
    found = opened(made[0], viewport={"width": width, "height": 900})
    page = found.page
    until(page, "document.querySelectorAll('.plot .main-svg').length > 0")
    drawn = page.evaluate(
        "[...document.querySelectorAll('.plot')].map(p => [p.id, !!p._fullLayout])"
    )
    assert drawn == [[name, True] for name in ("time", "overlay", "compressor", "torque", "filled")]
    page.select_option("#case", index=1)
    until(
        page,
        "document.getElementById('compressor')._fullData.some(t => t.name === 'smoke limit 1.4')",
    )
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert found.trouble == []


def test_a_legend_of_many_cases_leaves_the_plots_their_room(made, opened, tmp_path):
    car = load_architecture("C2")
    study = Manoeuvre(car, mean_value_of("C2", car.contents["engine"]), 40 / 3.6, 4)
    base, other, _ = made[1]
    cases = (replace(other.case, label=f"smoke limit {1.4 + 0.01 * n:g}") for n in range(22))
    path = tmp_path / "many.html"
    path.write_text(
        tipin_page(study, [base, *(replace(other, case=c) for c in cases)], {}, [], "x")
    )
    page = opened(path, viewport={"width": 400, "height": 900}).page
    until(page, "document.querySelectorAll('#overlay .main-svg').length > 0")
    whole, shown, above = page.evaluate(
        "(l => [l.legend._height, l.legend._effHeight, l._size.t])(document.getElementById('overlay')._fullLayout)"
    )
    assert 200 < whole <= shown and whole <= above
