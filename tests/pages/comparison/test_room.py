"""What `--save` writes, `hevopt report` reads; what it would not is refused, at best before anything is solved."""

from pathlib import Path

import pytest

from hevopt.errors import DataError
from hevopt.pages.comparison import room
from hevopt.pages.comparison.collect import STEPS_MAX
from hevopt.pages.comparison.compared import write_files
from hevopt.pages.comparison.saved import load_results


def test_rows_over_steps_that_could_not_be_read_back_are_refused_at_once():
    room.check_planned(STEPS_MAX, 6, 85)
    with pytest.raises(
        DataError, match=r"100 rows of 20000 steps are 23 million values.* here 88 rows"
    ):
        room.check_planned(STEPS_MAX, 6, 100)


def test_the_values_planned_are_those_counted(nedc, monkeypatch):
    steps, cars, rows = 1180, len(nedc.results.cars), len(nedc.results.rows)
    counted = nedc.results.text().count(b",")
    # A car's maps are beside what is over time.
    monkeypatch.setattr(room, "_VALUES_MAX", int(0.8 * counted))
    with pytest.raises(DataError, match=f"{rows} rows of {steps} steps"):
        room.check_planned(steps, cars, rows)
    monkeypatch.setattr(room, "_VALUES_MAX", counted)
    room.check_planned(steps, cars, rows)


@pytest.mark.parametrize("limit", ["_VALUES_MAX", "_LISTS_MAX", "_TEXTS_MAX", "MEGABYTES_MAX"])
def test_what_is_too_much_to_be_read_is_not_written(limit, nedc, tmp_path, monkeypatch):
    page, saved = tmp_path / "page.html", tmp_path / "all.json.gz"
    write_files(nedc.results, None, saved)
    monkeypatch.setattr(room, limit, 0)
    with pytest.raises(DataError, match="allowed: up to 0; give a file written by"):
        load_results(saved)
    saved.unlink()
    with pytest.raises(
        DataError, match=r"--save .* allowed: up to 0; `hevopt report` reads no more"
    ):
        write_files(nedc.results, page, saved)
    assert not page.exists() and not saved.exists()


def test_a_comparison_too_large_to_be_saved_is_refused_before_it_is_solved(hevopt, monkeypatch):
    monkeypatch.setattr(room, "_VALUES_MAX", 10_000)
    seen = hevopt("compare", "--architectures", "A,C2", "--save", "all.json.gz")
    assert seen.status == 2 and "rows of 1180 steps" in seen.err and not seen.out
    assert not Path("all.json.gz").exists()
