"""What figures and tables look like, in a real browser: apart, within their room, named and in one order."""

import json
import re

import pytest
from page_helpers import AXES, effect, front, settle, until

from hevopt.pages.comparison.page import comparison_page


def test_no_bar_crosses_the_bound_drawn_at_it(shown):
    bars = shown.page.evaluate(
        "document.getElementById('fuel-bars').data.map(t => [t.type, [...t.x], [...t.y]])"
    )
    bound = next((x, y) for kind, x, y in bars if kind == "scatter")
    levels = {
        round((a + b) / 2, 6): y
        for a, b, y in zip(bound[0][::3], bound[0][1::3], bound[1][::3], strict=True)
    }
    drawn = [(x, y) for kind, xs, ys in bars if kind == "bar" for x, y in zip(xs, ys, strict=True)]
    assert len(drawn) == len(levels) == 20
    assert all(y >= levels[round(x, 6)] - 1e-9 for x, y in drawn)


def test_every_axis_names_its_quantity_and_unit(shown):
    axes = shown.page.evaluate(AXES)
    assert len(axes) >= 20
    bare = {"mode", "architecture"}
    for figure, name, title in axes:
        if (figure, name) == ("shares", "yaxis"):  # the rows' names
            continue
        assert title in bare or re.search(r"\(.+\)$", title), (figure, name, title)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_page_and_figures_follow_the_colour_scheme_as_it_changes(shown, scheme):
    page = shown.page
    page.emulate_media(color_scheme={"light": "dark", "dark": "light"}[scheme])
    papers = (
        "[getComputedStyle(document.body).backgroundColor, "
        "document.getElementById('traces')._fullLayout.paper_bgcolor]"
    )
    settle(page)
    first = page.evaluate(papers)
    page.emulate_media(color_scheme=scheme)
    settle(page)
    then = page.evaluate(papers)
    page.emulate_media(color_scheme="light")
    assert all(a != b for a, b in zip(first, then, strict=True))
    assert then == (
        ["rgb(255, 255, 255)", "#ffffff"] if scheme == "light" else ["rgb(20, 24, 28)", "#14181c"]
    )


def test_on_paper_every_figure_is_drawn_light_and_within_the_page(shown):
    page = shown.page
    page.emulate_media(media="print", color_scheme="dark")
    settle(page)
    page.wait_for_function(
        "[...document.querySelectorAll('figure:not([hidden]) .plot')]"
        ".every(p => /^#f+$/.test(p._fullLayout.paper_bgcolor))"
    )
    looks = page.evaluate(
        "[...document.querySelectorAll('figure:not([hidden]) .plot')].map(p => "
        "[p.querySelector('.main-svg').getBoundingClientRect().width, p._fullLayout.paper_bgcolor])"
    )
    assert len(looks) >= 11
    assert all(width <= 691 and paper in ("#fff", "#ffffff") for width, paper in looks)
    page.emulate_media(media="screen", color_scheme="light")
    settle(page)
    page.wait_for_function("document.getElementById('traces')._fullLayout.width > 690")
    page.evaluate("Plotly.relayout('traces', {'xaxis.range[0]': 100, 'xaxis.range[1]': 200})")
    assert page.input_value("#from") == "100"  # zooming is still linked afterwards
    page.click("#whole")


OVERLAPS = """() => {
  const drawn = [...document.querySelectorAll('#sankey .flow-label')];
  const labels = drawn.map(e => [e.textContent, e.getBoundingClientRect()]);
  const boxes = drawn.map(e => e.getBBox());
  const crossed = new Set();
  for (const link of document.querySelectorAll('#sankey .sankey-link')) {
    const length = link.getTotalLength();
    for (let at = 0; at < length; at += 4) {
      const { x, y } = link.getPointAtLength(at);
      const over = b => x > b.x && x < b.x + b.width && y > b.y && y < b.y + b.height;
      boxes.forEach((b, n) => { if (over(b)) crossed.add(n); });
    }
  }
  const room = document.querySelector('#sankey .main-svg').getBoundingClientRect();
  const count = document.querySelectorAll('#sankey .sankey-node').length;
  if (labels.length !== count || !count) return [['labels', labels.length, count]];
  return labels.flatMap(([name, a], n) => [
    ...(crossed.has(n) ? [[name, 'crossed']] : []),
    ...(a.left < room.left || a.right > room.right || a.bottom > room.bottom ? [[name, 'cut']] : []),
    ...labels.slice(0, n).filter(([, b]) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1
      && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1).map(([other]) => [name, other])]);
}"""


@pytest.mark.parametrize("media", ["screen", "narrow", "print"])
def test_labels_of_the_energy_flow_are_apart_and_crossed_by_no_line(nedc, shown, media):
    page = shown.page
    page.emulate_media(media="print" if media == "print" else "screen")
    settle(page)
    if media == "narrow":
        page.set_viewport_size({"width": 400, "height": 1400})
        until(page, "document.getElementById('sankey').clientWidth < 400")
        settle(page)
    # On paper, where the flow is as wide in every row, the last one of each car.
    last = {row.figures.architecture: n for n, row in enumerate(nedc.results.rows)}
    for n in range(0, len(nedc.results.rows), 3) if media == "screen" else last.values():
        # What is not on paper cannot be chosen by hand.
        choose = "(s, n) => { s.value = n; s.dispatchEvent(new Event('change')); }"
        page.locator("#row").evaluate(choose, str(n))
        assert page.evaluate(OVERLAPS) == [], n
    page.emulate_media(media="screen")
    page.set_viewport_size({"width": 1440, "height": 1400})
    until(page, "document.getElementById('traces')._fullLayout.width > 1200")
    settle(page)


def test_on_paper_the_head_of_a_table_can_be_repeated(shown):
    display = "getComputedStyle(document.querySelector('thead th button')).display"
    shown.page.emulate_media(media="print")
    assert shown.page.evaluate(display) == "contents"
    shown.page.emulate_media(media="screen")


def test_a_caption_is_no_wider_than_the_box_its_table_scrolls_in(nedc, opened):
    page = opened(nedc.path, viewport={"width": 400, "height": 800}).page
    over = page.evaluate(
        "[...document.querySelectorAll('.scroll:not([hidden]) caption')].map(c =>"
        " c.getBoundingClientRect().right - c.closest('.scroll').getBoundingClientRect().right)"
    )
    assert len(over) > 5 and max(over) <= 0.5


def test_tables_are_counted_where_the_count_goes_on(shown):
    counted, lost = shown.page.evaluate(
        """() => {
          const counts = (e, part) => getComputedStyle(e, part).counterIncrement;
          const inside = [...document.querySelectorAll('.scroll *')];
          return [[...document.querySelectorAll('table')].map(table => counts(table.closest('.scroll'))),
            inside.filter(e => [null, '::before'].some(part => counts(e, part) !== 'none')).length];
        }"""
    )
    # What is counted within a container counts from its beginning: every table would be the first.
    assert set(counted) == {"table 1"} and lost == 0


def test_long_names_are_short_in_axes_and_legends_and_whole_where_the_mouse_rests(
    nedc, opened, tmp_path
):
    name = "a car of the second series with a long name"
    contents = json.loads(nedc.results.model_dump_json())
    contents["cars"][name] = contents["cars"].pop("C2")
    for row in contents["rows"]:
        if row["figures"]["architecture"] == "C2":
            row["figures"]["architecture"] = name
    path = tmp_path / "long.html"
    path.write_text(comparison_page(type(nedc.results).model_validate(contents)), encoding="utf-8")
    page = opened(path, viewport={"width": 400, "height": 800}).page
    texts = page.evaluate(
        "[...document.querySelectorAll('#shares .ytick')].map(t => t.textContent)"
    )
    assert "a car of the … dp" in texts and len(texts) == 20
    drawn = page.evaluate(
        "['threshold_w', 'threshold_mps', 'threshold_soc', 'plane'].flatMap("
        "id => document.getElementById(`calibration-${id}`).data"
        ".filter(t => t.name?.startsWith('a car')).map(t => [t.name, t.hovertemplate]))"
    )
    assert drawn and all(len(label) < 30 and name in hover for label, hover in drawn)
    assert name in page.locator("#comparison").inner_text()


def test_bounds_of_fronts_are_seen_on_the_points_they_hold(nedc, opened, tmp_path):
    fronts = {"pareto": [front("C2"), front("D")]}
    fronts["pareto"][1]["points"][1] |= {"nox_weight": 1570.0, "nox_weights": [1570.0, 2000.4]}
    contents = json.loads(nedc.results.model_dump_json()) | fronts | {"nox_limit_mg_per_km": 180.0}
    path = tmp_path / "fronts.html"
    path.write_text(comparison_page(type(nedc.results).model_validate(contents)), encoding="utf-8")
    page = opened(path).page
    found = page.evaluate(
        "document.getElementById('pareto-front').data.map(t => [t.mode, t.line.color, t.line.dash])"
    )
    assert [mode for mode, _, _ in found] == ["lines+markers"] * 2 + ["lines"] * 2
    ink = page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--ink')")
    assert all(line[1:] == [ink, "solid"] for line in found[2:])
    assert ink not in {colour for _, colour, _ in found[:2]}
    caption = page.locator("#c-pareto").inner_text()
    assert "C2 0.100 %, D 0.100 %." in caption
    weights = page.locator("#pareto td[data-key=nox_weight]").all_inner_texts()
    assert weights == ["0", "10", "0", "1570 to 2000"]
    assert "--fronts" not in page.locator("#left-out").inner_text()
    # A limit that is given is a line over the bars of NOx.
    (line,) = page.evaluate("document.getElementById('nox-level-bars').layout.shapes")
    assert [line["y0"], line["y1"]] == [180, 180] and line["label"]["text"] == "limit 180 mg/km"
    assert "180 mg/km" in page.locator("#figure-nox-level-bars figcaption").inner_text()


def test_sensitivities_stand_in_one_order_and_their_table_sorts(nedc, opened, tmp_path):
    lines = [effect("C2", 1.0), effect("C2", -4.0), effect("C2", 2.0)]
    for line, name in zip(lines, ("mass", "drag", "load"), strict=True):
        line["parameter"] = name
    contents = json.loads(nedc.results.model_dump_json()) | {"sensitivity": lines}
    path = tmp_path / "effects.html"
    path.write_text(comparison_page(type(nedc.results).model_validate(contents)), encoding="utf-8")
    page = opened(path).page
    names = page.locator("[data-effects] th[scope=row]")
    assert names.all_inner_texts() == ["drag", "load", "mass"]
    drawn = page.evaluate("[...document.getElementById('sensitivity').data[0].y]")
    assert [label.split(",")[0] for label in drawn[::-1]] == ["drag", "load", "mass"]
    page.locator("[data-effects] thead button").first.click()
    assert names.all_inner_texts() == ["drag", "load", "mass"]
    page.locator("[data-effects] thead button").first.click()
    assert names.all_inner_texts() == ["mass", "load", "drag"]


BARS = """id => {
  const { data, layout } = document.getElementById(id);
  return [data.filter(t => t.type === 'bar').flatMap(t => t.x.map((x, n) => [x, t.y[n]])),
    layout.annotations.map(a => [a.x, a.y, a.yanchor])];
}"""


@pytest.mark.parametrize("figure", ["fuel-bars", "nox-bars", "nox-level-bars"])
def test_a_bar_has_its_figure_on_its_own_side(nedc, shown, figure):
    bars, labels = shown.page.evaluate(BARS, figure)
    assert len(labels) == len(bars) == 20
    height = dict(map(tuple, bars))
    for x, y, anchor in labels:
        if abs(height[x]) > 0.05:
            assert (y > 0) == (height[x] > 0) and abs(y) >= abs(height[x]) - 1e-9
            assert anchor == ("bottom" if y > 0 else "top")
    if figure == "nox-level-bars":
        nox = sorted(row.figures.nox_mg_per_km for row in nedc.results.rows)
        assert sorted(height.values()) == pytest.approx(nox)


def test_nothing_that_matters_lies_behind_a_scroll_at_1200_px(shown):
    page = shown.page
    page.set_viewport_size({"width": 1200, "height": 1400})
    drawn = "[...document.querySelectorAll('figure:not([hidden]) .plot')].every(p => p._fullLayout.width < 1200)"
    until(page, drawn)
    # One line a row, what all bounds speak of being said once below.
    low = "[...document.querySelectorAll('#comparison tbody tr')].map(row => row.offsetHeight)"
    assert (
        max(page.evaluate(low)) < 30
        and "continuous split" not in page.locator("#comparison").inner_text()
    )
    assert "All bounds here: continuous split, every torque" in page.locator("#table").inner_text()
    wide = page.evaluate(
        "[...document.querySelectorAll('.scroll, .plot')].filter(s => s.offsetParent)"
        ".filter(s => s.scrollWidth > s.clientWidth)"
        ".map(s => s.textContent.slice(0, 60))"
    )
    page.set_viewport_size({"width": 1440, "height": 1400})
    until(page, "document.getElementById('traces')._fullLayout.width > 1200")
    assert wide == []
    heads = page.locator("#comparison thead .what").all_inner_texts()
    assert heads[:8] == [
        "Car",
        "Strategy",
        "Fuel",
        "Change",
        "Fuel corr.",
        "Gap",
        "Bound",
        "Status",
    ]


def test_every_button_has_a_name_of_its_own(shown):
    names = shown.page.evaluate(
        "[...document.querySelectorAll('button')].filter(b => b.offsetParent)"
        ".map(b => b.getAttribute('aria-label') || b.textContent.trim())"
    )
    assert len(names) > 60 and all(names)
    assert sorted(names) == sorted(set(names))
    assert "C2 dp: show in detail" in names
    assert "Change of NOx (%): sort Every architecture and strategy on nedc" in names
