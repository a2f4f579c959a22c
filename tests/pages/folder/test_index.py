"""The index of a folder: what stands side by side is what the files hold, and every difference is named."""

import json

import pytest
from command_line import call
from page_helpers import Opened

from hevopt.pages.comparison.results import Results
from hevopt.pages.folder.differences import differences, moved, rows_apart, saved_comparison
from hevopt.pages.folder.page import _by_car


def small(nedc, change=lambda contents: None):
    """Three rows without long traces, changed."""
    contents = json.loads(nedc.results.model_dump_json())
    contents["rows"] = [contents["rows"][n] for n in (0, 8, 11)]
    contents["cars"] = {name: contents["cars"][name] for name in ("A", "C2")}
    change(contents)
    return Results.model_validate(contents)


def heavier(contents):
    contents["cars"]["C2"]["about"]["mass_kg"] = 1500.0
    contents["inputs"]["architectures/C2.toml"] = "f" * 64
    contents["versions"]["numpy"] = "0"
    contents["rows"][2]["figures"]["fuel_corrected_l_per_100km"] *= 1.05
    contents["rows"][1]["figures"]["strategy"] = "mine"


@pytest.fixture(scope="module")
def folder(nedc, tmp_path_factory):
    """Two versions of a study, one of another cycle, and a file that is none."""
    place = tmp_path_factory.mktemp("saved") / "my results"
    place.mkdir()
    (place / "v1.json.gz").write_bytes(small(nedc).packed())
    (place / "v2.json.gz").write_bytes(small(nedc, heavier).packed())
    other = small(nedc, lambda contents: contents.update(cycle="<b>town</b>"))
    (place / "town.json").write_bytes(other.text())
    (place / "notes.json").write_text("{}")
    return place


def test_what_differs_is_named_and_what_does_not_is_not(nedc):
    one, two = saved_comparison("1", small(nedc)), saved_comparison("2", small(nedc, heavier))
    assert differences(one, one) == [] and moved(one, one) == [] and rows_apart(one, one) == []
    found = [(d.kind, d.what, d.after) for d in differences(one, two)]
    assert found == [
        ("input file", "architectures/C2.toml", "f" * 12),
        ("car C2", "mass, kg", "1500"),
        ("version", "numpy", "0"),
    ]
    (line,) = moved(one, two)
    assert line.name == "C2 dp" and line.percent == pytest.approx(5.0)
    assert rows_apart(one, two) == ["no longer there: C2 conventional", "new: C2 mine"]
    weighted = saved_comparison("3", small(nedc, lambda c: c.update(nox_weight=5.0)))
    assert moved(one, weighted) == []
    assert ("setting", "weight on NOx", "0", "5") in differences(one, weighted)


def test_rows_of_a_car_stand_together(nedc):
    def other(contents):
        contents["rows"][0]["figures"]["strategy"] = "mine"

    both = [saved_comparison("1", small(nedc)), saved_comparison("2", small(nedc, other))]
    assert _by_car(both) == ["A baseline", "A mine", "C2 conventional", "C2 dp"]


def test_report_of_a_folder_writes_its_index(monkeypatch, capsys, folder, tmp_path, browser, nedc):
    page = tmp_path / "index.html"
    status, out, _ = call(monkeypatch, capsys, "report", str(folder), "--out", str(page))
    assert status == 0 and f"written to {page}" in out
    assert page.stat().st_size < 200_000  # no drawing library without figures
    found = Opened(browser, page, viewport={"width": 1200, "height": 900})
    shown = found.page
    try:
        assert shown.locator("h1").inner_text() == "Comparisons in my results"
        assert shown.locator("h2").all_inner_texts()[0] == "<b>town</b>"
        rows = shown.locator("#cycle-2 .side-by-side tbody tr")
        assert rows.count() == 4
        cells = rows.nth(2).locator("td").all_inner_texts()
        dp = nedc.results.rows[11].figures.fuel_corrected_l_per_100km
        assert cells == [f"{dp:.3f}", f"{1.05 * dp:.3f}"]
        assert "no longer there: C2 conventional" in shown.locator("#cycle-2").inner_text()
        assert "notes.json: not in the form" in shown.locator("#left").inner_text()
        shown.locator("#cycle-2 .side-by-side thead button").nth(1).click()
        assert rows.first.locator("th").inner_text() == "C2 dp"
        for width in (1200, 400):
            shown.set_viewport_size({"width": width, "height": 900})
            assert shown.evaluate("document.documentElement.scrollWidth") == width
        assert found.trouble == []
    finally:
        found.context.close()


def test_a_folder_without_results_is_one_message(monkeypatch, capsys, tmp_path):
    status, _, err = call(
        monkeypatch, capsys, "report", str(tmp_path), "--out", str(tmp_path / "x")
    )
    assert status == 2 and "no saved comparison in it" in err and "--save" in err
    (tmp_path / "a.json").write_text("[1]")
    status, _, err = call(
        monkeypatch, capsys, "report", str(tmp_path), "--out", str(tmp_path / "x")
    )
    assert status == 2 and "a.json: not in the form" in err and "Traceback" not in err
