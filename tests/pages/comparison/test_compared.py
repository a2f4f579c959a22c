"""Pages from Python: one call compares and writes, another makes the page of what was saved again."""

from pathlib import Path

import pytest
from command_line import call
from small_stores import DESIGNS, PLAN, ok

from hevopt import DataError, compare, compare_and_report, load_architecture, read_saved, report
from hevopt.pages.comparison.saved import load_results
from hevopt.sweeps.store.store import open_store

SHORT = "time_s,speed_kmh\n0,0\n5,0\n15,40\n40,40\n50,0\n60,0\n70,50\n110,50\n125,0\n130,0\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder with a short cycle."""
    monkeypatch.chdir(tmp_path)
    Path("short.csv").write_text(SHORT)
    return tmp_path


def test_one_call_writes_what_the_command_writes(folder, monkeypatch, capsys):
    told = []
    comparison = compare_and_report(
        "page.html", "short.csv", ["A", "B"], "dp", save="saved.gz", fronts=True, mass_kg=1400,
        progress=lambda *said: told.append(said),
    )  # fmt: skip
    assert told and not comparison.failures
    words = ("compare", "--cycle", "short.csv", "--architectures", "A,B", "--strategies", "dp")
    more = ("--mass", "1400", "--fronts", "--save", "other.gz", "--report", "other.html")
    assert call(monkeypatch, capsys, *words, *more)[0] == 0
    ours, theirs = (load_results(Path(name)) for name in ("saved.gz", "other.gz"))

    def comparable(results):
        contents = results.model_dump()
        for row in contents["rows"]:
            row["figures"]["solve_s"] = None
        return {name: value for name, value in contents.items() if name != "command"}

    assert comparable(ours) == comparable(theirs)
    expected = "hevopt.compare_and_report('page.html', 'short', ['A', 'B'], ['dp'], save='saved.gz', mass_kg=1400)"
    assert ours.command == expected
    assert report("saved.gz", "again.html") == Path("again.html")
    assert Path("again.html").read_bytes() == Path("page.html").read_bytes()
    assert len(read_saved("saved.gz")) == 2


def test_a_store_has_a_page_too(folder):
    with open_store(folder / "s.sqlite") as store:
        store.begin({"study": ""}, DESIGNS, PLAN)
        store.add([ok(case.key) for case in PLAN])
        store.commit()
    page = report("s.sqlite", "sweep.html").read_text()
    assert "<h1>Sweep s.sqlite</h1>" in page


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"page": None}, "name a file for the page, or one to save to"),
        ({"page": "short.csv"}, "page short.csv is the file that"),
        ({"save": "page.html"}, "page and save name one file"),
        ({"page": "no/such/folder/page.html"}, "no/such/folder"),
        ({"nox_wieght": 1}, "compare_and_report: setting 'nox_wieght' not found"),
        ({"architectures": "A3"}, "architecture 'A3' not found"),
    ],
)
def test_a_mistake_is_one_message_before_anything_is_solved(folder, monkeypatch, given, said):
    monkeypatch.setattr("hevopt.pages.comparison.compared.compare_cars", pytest.fail)
    options = {"page": "page.html", "cycle": "short.csv", "architectures": "A", "strategies": "dp"}
    with pytest.raises(DataError) as error:
        compare_and_report(**(options | given))
    assert said in str(error.value)
    assert not Path("page.html").exists()


def test_a_file_of_something_else_has_no_page(folder):
    with pytest.raises(DataError, match=r"short\.csv"):
        report("short.csv", "page.html")
    with pytest.raises(DataError):
        report("nix.gz", "page.html")
    assert not Path("page.html").exists()


def test_sensitivities_of_a_changed_car_are_refused_and_cost_no_row(folder):
    car = load_architecture("A", {"car.mass_kg": 1500})
    comparison = compare_and_report("page.html", "short.csv", car, "dp", effects=True)
    assert comparison.failures.keys() == {"A sensitivity"}
    assert "is not what" in str(comparison.failures["A sensitivity"])
    assert (
        comparison.rows[0].fuel_l_per_100km
        == compare("short.csv", car, "dp").rows[0].fuel_l_per_100km
    )
