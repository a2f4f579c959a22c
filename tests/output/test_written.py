"""Files that are written: told of, and inert in a spreadsheet."""

import csv
import io
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hevopt.errors import DataError
from hevopt.files.writing import check_outs, csv_cells, csv_comment, files_told, write_whole

_SIGNS = r"=+@\-\uff1d\uff0b\uff0d\uff20"
SIGNS = "=+-@\t\r\n\uff1d\uff0b\uff0d\uff20"


@pytest.mark.parametrize(
    "text",
    ["=1+1", "+cmd|x", "-2+3|cmd", "@SUM(A1)", "\t=1", "\r=1", " =1", "\ufeff=1", "\uff1d1", "=cmd|'/c calc'!A1"],
)  # fmt: skip
def test_what_a_spreadsheet_would_run_has_an_apostrophe_before_it(text):
    assert csv_cells([text])[0].startswith("'") and csv_cells([text])[0].endswith(text[-1])


def test_a_formula_behind_another_separator_is_inert_too():
    assert csv_cells(["a;=1", "a\t@b", "a\n=c", "a|+d"]) == ["a;'=1", "a\t'@b", "a\n'=c", "a|'+d"]
    assert csv_comment("from a.csv, =cmd") == "# from a.csv,' =cmd"


def test_numbers_and_ordinary_text_stay_as_they_are():
    cells = [
        -3.5, -1, None, True, "-5", "+1e-3", "C2", "-", "not neutral, shortfall", "a; -1 to 1", "it's", "'quoted'",
        "one multiplier, tabulated controls", "no; step 3\n  and more", "",
    ]  # fmt: skip
    assert csv_cells(cells) == cells


@given(st.text(st.sampled_from(SIGNS + "'; |,a1\0\ufeff"), max_size=8))
def test_every_text_can_be_restored_and_none_begins_a_formula(text):
    cell = csv_cells([text])[0]
    number = re.fullmatch(r"[+-]?\d+(\.\d*)?", text)
    assert number or not re.match(rf"[\s\0\ufeff]*[{_SIGNS}].|[\t\r\n]", cell, re.DOTALL)
    assert number or not re.search(r"[;|\t\r\n][=+@\-].", cell, re.DOTALL)


@given(st.lists(st.text(st.sampled_from("='+- ;\t\na1"), max_size=5), unique=True, min_size=2))
def test_two_texts_never_become_one(texts):
    cells = csv_cells(texts)
    assert len(set(cells)) == len(cells)
    out = io.StringIO()
    csv.writer(out).writerow(cells)
    assert next(csv.reader(io.StringIO(out.getvalue(), newline=""))) == cells


def test_what_is_written_and_what_is_not_is_told(tmp_path):
    first, second = tmp_path / "a.html", tmp_path / "b.json"
    with files_told() as files:
        check_outs({"--report": first, "--save": second})
        assert files.told() == "nothing was written"
        write_whole(first, b"x")
        assert files.told() == f"written: {first}; not written: {second}"
        write_whole(second, b"x")
        assert files.told() == f"written: {first}, {second}"
        with pytest.raises(DataError):
            write_whole(tmp_path / "none" / "c.csv", b"x")
        assert "c.csv" not in files.told()
    write_whole(first, b"y")


SHORT = "time_s,speed_kmh\n0,0\n5,0\n15,40\n40,40\n50,0\n60,0\n"


@pytest.fixture
def compare(hevopt, tmp_path):
    (tmp_path / "c.csv").write_text(SHORT)
    words = "compare --architectures A --strategies baseline --cycle c.csv".split()
    return lambda *more: hevopt(*words, *more)


@pytest.mark.parametrize("stop", [KeyboardInterrupt, OSError(28, "No space left on device")])
def test_stopped_between_two_files_a_command_says_which_there_are(
    compare, monkeypatch, tmp_path, stop
):
    def written(path, contents, write=write_whole):
        if path.name == "b.gz":
            raise stop
        write(path, contents)

    monkeypatch.setattr("hevopt.pages.comparison.compared.write_whole", written)
    seen = compare("--report", "a.html", "--save", "b.gz", "--out", "rows.csv")
    assert "written: a.html; not written: b.gz, rows.csv" in seen.err
    assert (tmp_path / "a.html").stat().st_size > 1000 and not (tmp_path / "rows.csv").exists()
    assert seen.status == (130 if stop is KeyboardInterrupt else 2)


def test_a_name_that_is_a_formula_is_inert_in_every_table(hevopt, tmp_path):
    import json

    from hevopt.files.lookup import shipped_folder

    text = (shipped_folder("architectures") / "A.toml").read_text()
    name = "=cmd|\\u0027/c calc\\u0027!A1"
    text = re.sub(r'(?m)^name = ".*?"', lambda _: f'name = "{name}"', text)
    (tmp_path / "m.toml").write_text(text)
    (tmp_path / "c.csv").write_text(SHORT)
    words = "compare --architectures ./m.toml --strategies baseline --cycle c.csv".split()
    for more in (["--out", "r.csv"], ["--out-steps", "s.csv"], ["--out", "r.json"]):
        assert hevopt(*words, *more).status == 0
    for table in ("r.csv", "s.csv"):
        with (tmp_path / table).open(newline="") as file:
            lines = list(csv.DictReader(file))
        assert {line["architecture"] for line in lines} == {"'=cmd|'/c calc'!A1"}
    rows = json.loads((tmp_path / "r.json").read_text())["rows"]
    assert rows[0]["architecture"] == "=cmd|'/c calc'!A1"


def test_json_names_files_without_folders(compare, tmp_path):
    import json

    seen = compare("--cycle", str(tmp_path / "c.csv"), "--json")
    inputs = json.loads(seen.out)["inputs"]
    assert "c.csv" in inputs and "architectures/A.toml" in inputs
    assert not any(name.startswith("/") for name in inputs)
