"""Faults of a drive: what a log really holds is found by line, what an ordinary sensor writes is none."""

from pathlib import Path

import numpy as np
import pytest

from hevopt.errors import DataError
from hevopt.imports.cycle_import import import_cycle

DRIVE_KMH = [0, 0, 9, 18, 27, 36, 36, 27, 9, 0, 0, 0, 18, 36, 18, 0]
PLAIN = "".join(f"{t},{v}\n" for t, v in enumerate(DRIVE_KMH))


def imported(tmp_path: Path, text: str, name="drive.csv", **options):
    path = tmp_path / name
    path.write_text(text)
    return import_cycle(path, **options)


def refusal(tmp_path, text, name="drive.csv", **options):
    with pytest.raises(DataError) as error:
        imported(tmp_path, text, name, **options)
    return str(error.value)


def columns(text):
    """The cycle file without its comments."""
    return "\n".join(line for line in text.splitlines() if not line.startswith("#"))


@pytest.mark.parametrize("cell", ["20s", "abc", "1e999", "0:20"])
@pytest.mark.parametrize("repair", [False, True])
def test_a_stop_time_that_is_no_number_is_refused_by_line(tmp_path, cell, repair):
    text = "<s>,<v>,<grad>,<stop>\n0,0,0,5\n100,30,0,0\n200,0,0,{}\n600,50,0,0\n800,0,0,5\n"
    message = refusal(tmp_path, text.format(cell), "route.vdri", repair=repair)
    assert f"column <stop>: line 4: '{cell}': not usable numbers" in message
    # An empty cell is a stop of 0 s, which is said.
    result = imported(tmp_path, text.format(""), "route.vdri")
    assert "stop: empty in line 4, taken as 0 s" in result.assumptions
    assert columns(result.text) == columns(imported(tmp_path, text.format(0), "a.vdri").text)


@pytest.mark.parametrize("repair", [False, True])
def test_one_line_is_no_drive(tmp_path, repair):
    message = refusal(tmp_path, "time_s,speed_kmh\n0,20\n", repair=repair)
    assert message.endswith("drive.csv: one line; a drive needs at least 2")
    message = refusal(tmp_path, "time_s,speed_kmh\n5,20\n5,30\n5,40\n", repair=repair)
    assert "2 faults (2 duplicate times)" in message and "fewer than 2 lines have a time" in message


def test_columns_that_are_not_used_are_told(tmp_path):
    rows = PLAIN.replace("\n", ",1,x\n")
    result = imported(tmp_path, "time_s,speed_kmh,rpm,driver\n" + rows)
    assert "columns not used: rpm, driver" in result.assumptions
    assert "# read as: columns not used: rpm, driver" in result.text
    plain = imported(tmp_path, "time_s,speed_kmh\n" + PLAIN)
    assert not any("not used" in text for text in plain.assumptions)
