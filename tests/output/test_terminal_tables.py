"""The table of a comparison on terminals of every width."""

import re

import pytest
from command_line import call

WORDS = (
    "compare",
    "--architectures",
    "A,C2",
    "--strategies",
    "baseline,conventional,dp",
    "--cycle",
    "us06",
)


def table_of(out: str) -> list[str]:
    """The table's lines: from the one above the line of dashes to the first note."""
    lines = out.split("\n")
    dashes = next(n for n, line in enumerate(lines) if "──" in line)
    notes = next(
        n for n, line in enumerate(lines) if n > dashes and re.match(r"left out|vs ref:", line)
    )
    return lines[dashes - 2 : notes]


@pytest.fixture
def seen(monkeypatch, capsys):
    def at(columns: int | None, *words: str) -> str:
        monkeypatch.delenv("COLUMNS", raising=False)
        if columns is not None:
            monkeypatch.setenv("COLUMNS", str(columns))
        return call(monkeypatch, capsys, *WORDS, *words).out

    return at


def test_the_table_fits_the_width_and_says_what_left(seen):
    whole = table_of(seen(None))
    assert all(head in " ".join(whole[:2]) for head in ("CO2", "NOx", "proof", "corrected", "gap"))
    for columns in (80, 100, 140):
        out = seen(columns)
        table = table_of(out)
        assert max(map(len, out.split("\n"))) <= columns
        # One line a row and one between the cars, whatever the width; no figure is cut or wrapped.
        assert len(table) == len(whole)
        numbers = set(re.findall(r"[-+]?\d+\.\d+", "\n".join(table)))
        assert numbers <= set(re.findall(r"[-+]?\d+\.\d+", "\n".join(whole))) | numbers_of_time(
            table
        )
        left = re.search(r"left out for want of width: (.*?); --wide", out.replace("\n", " "))
        heads = " ".join(table[:2])
        assert all(must in heads for must in ("fuel", "gap", "status"))
        assert left and not {"fuel", "gap"} & set(left[1].split(", "))
        assert ("CO2" in left[1]) == ("CO2" not in heads)


def numbers_of_time(table: list[str]) -> set[str]:
    """What stands in the column of seconds, which is another in every run."""
    return {word for line in table for word in re.findall(r"\d+\.\d\d(?!\d)", line)}


def test_wide_shows_all_however_narrow(seen):
    assert "left out" not in seen(60, "--wide")
    assert "proof" in table_of(seen(60, "--wide"))[1] + table_of(seen(60, "--wide"))[0]


def test_a_pipe_gets_no_blanks_at_the_ends_of_lines(seen):
    for columns in (None, 80):
        assert not [line for line in seen(columns).split("\n") if line != line.rstrip()]


def test_the_mark_of_causal_rows_is_explained_where_a_row_has_it(seen, monkeypatch, capsys):
    assert "baseline†" in seen(None) and "†: causal" in seen(None)
    words = ("compare", "--architectures", "C2", "--strategies", "dp")
    assert "†" not in call(monkeypatch, capsys, *words).out


def test_published_figures_fit_the_width_too_and_proofs_that_are_shown_are_explained(
    seen, monkeypatch, capsys
):
    words = ("compare", "--architectures", "A,C2", "--strategies", "baseline,conventional")
    for columns in (80, 100, 140):
        monkeypatch.setenv("COLUMNS", str(columns))
        out = call(monkeypatch, capsys, *words).out
        lines = out.split("\n")
        assert max(map(len, lines)) <= columns
        (row,) = (line for line in lines if "C2 conventional, fuel" in line)
        assert re.search(r"-23 to -24 %   -\d\d\.\d %   \S", row)
        shown = "proof" in " ".join(table_of(out)[:2])
        assert shown == ("proof: one multiplier = " in out) == (columns == 140)
        assert "LP prices" not in out  # no row is proven by them


def test_a_failed_row_is_one_word_where_it_is_narrow(seen):
    rows = [line for line in table_of(seen(80)) if line.startswith(" A ")]
    assert len(rows) == 3 and all(line.endswith("failed") for line in rows)
    assert "cannot follow" in " ".join(table_of(seen(None)))


def test_a_battery_that_ends_as_it_began_gives_no_negative_nought(monkeypatch, capsys):
    cars = ("--architectures", "C2,p2_plug_in", "--strategies", "dp")
    out = call(monkeypatch, capsys, "compare", *cars, "--wide").out
    assert "kWh/100km" in out and re.search(r" 0\.00 ", out) and "-0.00 " not in out
