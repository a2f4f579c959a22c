"""The page as a reader uses it, in a real browser."""

import gzip
import importlib.util
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from page_helpers import AXES, effect, find_browser, forty_rows, front, until
from PIL import Image

from hevopt.pages.comparison.page import comparison_page
from hevopt.pages.render import fixed

FORMS = {
    "fuel_l_per_100km": ".3f", "delta_fuel_percent": "+.1f", "fuel_corrected_l_per_100km": ".3f",
    "co2_g_per_km": ".1f", "nox_mg_per_km": ".0f", "delta_nox_percent": "+.1f",
    "delta_energy_percent": "+.2f", "engine_starts": "d", "bound_l_per_100km": ".3f", "gap_percent": ".3f",
    "solve_s": ".2f",
}  # fmt: skip
CELLS = """() => [...document.querySelectorAll('#comparison tbody tr')]
  .sort((a, b) => a.dataset.index - b.dataset.index).map(row => Object.fromEntries(
  [...row.cells].map(cell => [cell.dataset.key, [cell.textContent.trim(), cell.dataset.value]])))"""
FIRST = (
    "[...document.querySelectorAll('#comparison tbody tr')].map(row => row.cells[{}].dataset.value)"
)

CUT = """id => {
  const box = document.getElementById(id).getBoundingClientRect();
  return [...document.querySelectorAll(`#${id} text`)].map(text => [text.textContent, text.getBoundingClientRect()])
    .filter(([text, at]) => text && (at.left < box.left - 0.5 || at.right > box.right + 0.5)).map(([text]) => text);
}"""


def test_opening_and_using_it_logs_nothing_and_asks_for_nothing(nedc, opened):
    found = opened(nedc.path)
    page = found.page
    page.emulate_media(color_scheme="dark")
    page.select_option("#row", index=3)
    page.check("input[value=time]")
    page.click("#comparison thead button >> nth=2")
    for width in (400, 1000):
        page.set_viewport_size({"width": width, "height": 800})
        drawn = "document.getElementById('traces')._fullLayout.width"
        until(page, f"{width} - 70 < {drawn} && {drawn} < {width}")
        assert page.evaluate("document.documentElement.scrollWidth") == width  # never sideways
    assert found.trouble == []
    assert {url.split(":")[0] for url in found.requests} == {"file"} and len(found.requests) == 1


def test_no_figure_offers_to_send_its_data_anywhere(shown):
    offers = shown.page.evaluate(
        "[...document.querySelectorAll('.modebar-btn')].map(button => button.dataset.title)"
    )
    assert offers and not [offer for offer in offers if re.search("share|cloud|edit", offer, re.I)]


def test_every_number_of_the_table_is_that_of_the_json_output(nedc, shown):
    cells = shown.page.evaluate(CELLS)
    assert len(cells) == len(nedc.json["rows"]) == 20
    for shown_row, row in zip(cells, nedc.json["rows"], strict=True):
        assert shown_row["architecture"][0] == row["architecture"]
        assert shown_row["strategy"][0].rstrip("†") == row["strategy"]
        assert shown_row["status"][0] == row["status"]
        assert row["certificate"].startswith(shown_row["certificate"][0])
        for key, form in FORMS.items():
            text, value = shown_row[key]
            assert float(value) == row[key], key
            assert text == fixed(row[key], form), key
        change = row["soc_end"] - row["soc_start"]
        assert float(shown_row["delta_soc"][1]) == change
        ratio = row["fuel_corrected_l_per_100km"] / row["fuel_l_per_100km"]
        assert float(shown_row["co2_corrected_g_per_km"][1]) == pytest.approx(
            row["co2_g_per_km"] * ratio
        )


@pytest.mark.parametrize("way", ["mouse", "keyboard"])
def test_a_column_sorts_up_and_down(nedc, shown, way):
    page = shown.page
    page.locator("#comparison thead th").nth(0).locator("button").click()
    head = page.locator("#comparison thead th").nth(2)

    def press():
        if way == "mouse":
            head.locator("button").click()
        else:
            head.locator("button").focus()
            page.keyboard.press("Enter")
        return [float(value) for value in page.evaluate(FIRST.format(2))]

    fuel = sorted(row["fuel_l_per_100km"] for row in nedc.json["rows"])
    assert press() == fuel and head.get_attribute("aria-sort") == "ascending"
    assert press() == fuel[::-1] and head.get_attribute("aria-sort") == "descending"
    other = page.locator("#comparison thead th").nth(1)
    other.locator("button").click()
    assert head.get_attribute("aria-sort") is None
    names = page.locator("#comparison tbody td:nth-child(2)").all_inner_texts()
    assert names == sorted(names)


def test_choosing_a_row_shows_its_traces_balance_and_points(nedc, shown):
    page = shown.page
    index = next(
        n for n, r in enumerate(nedc.json["rows"]) if (r["architecture"], r["strategy"]) == ("E", "ecms")
    )  # fmt: skip
    detail = nedc.results.rows[index].detail
    for choose in (
        lambda: page.select_option("#row", str(index)),
        lambda: page.click(f"button.choose[data-index='{index}']"),
    ):
        page.select_option("#row", "0")
        choose()
        assert page.locator("#h-row .chosen-name").inner_text() == "E ecms"
        soc = page.evaluate(
            "document.getElementById('traces')._fullData.find(t => t.name === 'SOC').y"
        )
        assert list(soc) == pytest.approx([100 * s for s in detail.trace.soc])
        assert page.locator("#energy table:visible").count() == 1
        assert "E ecms" in page.locator("#energy table:visible caption").inner_text()
        links = page.evaluate("document.getElementById('sankey').data[0].link.value")
        assert sum(links) == pytest.approx(sum(link.energy_j for link in detail.energy.links) / 1e3)


def test_zooming_in_one_trace_moves_all_of_them_and_the_points(shown):
    page = shown.page
    page.select_option("#row", label="C2 dp")
    traces = page.evaluate(
        "[...new Set(document.getElementById('traces')._fullData.map(t => t.xaxis))]"
    )
    assert traces == ["x"]
    before = page.evaluate("document.getElementById('engine-efficiency')._fullData.at(-1).x.length")
    page.locator("#traces").scroll_into_view_if_needed()
    area = page.locator("#traces .nsewdrag").nth(3).bounding_box()
    middle = area["y"] + area["height"] / 2
    page.mouse.move(area["x"] + 0.25 * area["width"], middle)
    page.mouse.down()
    page.mouse.move(area["x"] + 0.5 * area["width"], middle, steps=5)
    page.mouse.up()
    low, high = page.evaluate("document.getElementById('traces')._fullLayout.xaxis.range")
    assert low == pytest.approx(1180 / 4, abs=5) and high == pytest.approx(1180 / 2, abs=5)
    assert float(page.input_value("#from")) == pytest.approx(low, abs=0.06)
    assert (
        page.evaluate("document.getElementById('engine-efficiency')._fullData.at(-1).x.length")
        < before
    )
    page.fill("#from", "800")
    page.fill("#to", "1000")
    page.keyboard.press("Enter")
    assert page.evaluate("document.getElementById('traces')._fullLayout.xaxis.range") == [800, 1000]
    page.click("#whole")
    assert page.evaluate("document.getElementById('traces')._fullLayout.xaxis.range") == [0, 1180]


def test_the_downloads_are_the_saved_results_and_the_json_values(nedc, shown):
    with shown.page.expect_download() as waiting:
        shown.page.click("#download")
    with open(waiting.value.path(), "rb") as file:
        contents = file.read()
    assert contents == nedc.results.packed()
    rows = [row["figures"] for row in json.loads(gzip.decompress(contents))["rows"]]
    assert rows == nedc.json["rows"]
    with shown.page.expect_download() as waiting:
        shown.page.click("#download-table")
    with open(waiting.value.path(), encoding="utf-8") as file:
        head, *lines = file.read().splitlines()
    assert head.split(",") == list(nedc.json["rows"][0])
    fuel = head.split(",").index("fuel_l_per_100km")
    assert [float(line.split(",")[fuel]) for line in lines] == [
        row["fuel_l_per_100km"] for row in nedc.json["rows"]
    ]


def test_without_scripts_verdict_and_tables_are_there_and_figures_say_what_is_missing(nedc, opened):
    settings = {"java_script_enabled": False, "viewport": {"width": 400, "height": 800}}
    page = opened(nedc.path, wait=False, **settings).page
    for place in ("main", "#table .scroll >> nth=0", "#inputs", "footer"):
        box = page.locator(place).bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 400
    assert "proven lower bound" in page.locator(".verdict").inner_text()
    assert page.locator("#comparison tbody tr").count() == 20
    assert page.locator("table.balance:visible").count() == 20
    assert page.locator(".missing:visible").count() == page.locator(".plot:visible").count() > 8
    assert page.locator("#download:visible, #row:visible").count() == 0


def test_an_old_browser_is_told_that_figures_are_missing(nedc, opened):
    found = opened(nedc.path, script="delete window.DecompressionStream;")
    assert "current one can" in found.page.locator(".missing").first.inner_text()
    assert found.page.locator("#comparison tbody tr").count() == 20
    assert found.trouble == []


def test_names_from_files_stay_text(nedc, opened, tmp_path):
    evil = "<script>document.title='taken'</script><b>bold</b>{{7*7}}&amp;"
    contents = json.loads(nedc.results.model_dump_json())
    contents["rows"] = [contents["rows"][n] for n in (0, 8, 9, 11)]
    contents["cycle"] = contents["command"] = evil
    contents["cars"] = {
        (evil if name == "C2" else name): car for name, car in contents["cars"].items()
    }
    for row in contents["rows"]:
        if row["figures"]["architecture"] == "C2":
            row["figures"]["architecture"] = evil
    contents["published"][0]["what"] = evil
    contents["inputs"][evil] = evil
    contents |= {"pareto": [front(evil)], "sensitivity": [effect(evil, 3.0), effect("C2", 5.0)]}
    path = tmp_path / "evil.html"
    path.write_text(comparison_page(type(nedc.results).model_validate(contents)), encoding="utf-8")
    found = opened(path)
    page = found.page
    assert found.trouble == [] and "taken" not in page.evaluate("document.title.slice(0, 5)")
    assert page.locator("h1").inner_text() == f"Comparison on {evil}"
    assert page.locator("#h-row .chosen-name").inner_text() == f"{evil} dp"
    assert page.locator("b", has_text=re.compile("^bold$")).count() == 0
    assert page.locator("svg tspan[style*=bold]", has_text=re.compile("^bold$")).count() == 0
    assert page.locator("script").count() == 4  # data, library as text and as code, ours
    for axis in page.evaluate(AXES):
        assert axis[2] or axis[0] in ("shares", "sensitivity"), axis
    assert page.evaluate("document.getElementById('pareto-front').data.map(t => t.x.length)") == [
        2,
        3,
    ]
    assert page.evaluate("[...document.getElementById('sensitivity').data[0].x]") == [-3.0]
    assert page.locator("[data-effects]:visible th[scope=row]").all_inner_texts() == [evil]
    page.select_option("#effects-of", label="C2 dp")
    assert page.evaluate("[...document.getElementById('sensitivity').data[1].x]") == [5.0]
    assert page.locator("[data-effects]:visible").count() == 1


def test_what_was_not_asked_for_is_said_and_a_wide_figure_says_to_scroll(nedc, opened):
    at = "row=C2+conventional&over=C2+dp&from=100&to=200"
    page = opened(nedc.path, at=at, viewport={"width": 400, "height": 800}).page
    # A link to two rows and a window opens them.
    assert page.locator("#h-row .chosen-name").inner_text() == "C2 conventional"
    assert page.locator("#over option:checked").inner_text() == "C2 dp"
    assert [page.input_value(end) for end in ("#from", "#to")] == ["100", "200"]
    said = page.locator("#left-out").inner_text()
    assert "--fronts" in said and "--sensitivity" in said
    assert page.locator("#h-calibration").inner_text() == "Calibration of the rules"
    assert page.locator("#figure-sankey.wider").count() == 1
    assert page.locator("#figure-fuel-bars.wider").count() == 0
    until(page, "document.querySelectorAll('#flow-apart .ytick text').length > 2")
    # No label of the two rows' difference is cut, and the bar of the rows covers no heading.
    assert page.evaluate(CUT, "flow-apart") == []
    page.evaluate("document.getElementById('energy').scrollIntoView()")
    bar, heading = (page.locator(name).bounding_box() for name in (".chooser", "#energy h2"))
    assert bar["y"] + bar["height"] <= heading["y"]


def test_forty_rows_of_1800_steps_stay_small_and_usable(opened, tmp_path):
    results = forty_rows()
    assert len(results.rows) == 40 and len(next(iter(results.cars.values())).time_s) >= 1800
    page_file = tmp_path / "forty.html"
    page_file.write_text(comparison_page(results), encoding="utf-8")
    assert page_file.stat().st_size <= 12e6
    page = opened(page_file).page
    page.select_option("#row", "39")
    assert page.locator("#h-row .chosen-name").inner_text() == "C2 39 dp"
    assert page.locator("#comparison tbody tr").count() == 40


def test_a_missing_browser_is_a_skip_and_a_failure_where_one_is_required(monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setenv("HEVOPT_REQUIRE_BROWSER", "1")
    with pytest.raises(pytest.fail.Exception, match="chromium"):
        find_browser()
    monkeypatch.delenv("HEVOPT_REQUIRE_BROWSER")
    with pytest.raises(pytest.skip.Exception, match="chromium"):
        find_browser()


def test_the_picture_of_the_readme_shows_what_the_page_draws_today(nedc, opened):
    source = Path(__file__).parents[2] / "docs" / "picture.py"
    spec = importlib.util.spec_from_file_location("picture", source)
    picture = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(picture)
    page = opened(nedc.path, viewport={"width": picture.WIDTH, "height": 800}).page
    drawn, committed = (
        np.array(Image.open(io.BytesIO(png)).convert("L").resize((60, 24)), dtype=float)
        for png in (picture.picture_of(page), picture.OUT.read_bytes())
    )
    assert drawn.std() > 20  # bars on paper, no empty frame
    assert np.abs(drawn - committed).mean() < 6  # grey of 256; fonts differ between machines
