"""Workbooks of Excel 97 to 2003: their cells mean what they do in an .xlsx; spoilt ones are one message.

The files in workbooks/ were written with xlwt 1.3; drive.xls and map.xls are also what the fuzzer starts from.
"""

import random
from pathlib import Path

import numpy as np
import pytest

from hevopt.errors import DataError
from hevopt.measured.cycles.cycle import import_cycle
from hevopt.measured.maps.engine import import_engine
from hevopt.measured.maps.request import Request
from hevopt.measured.maps.tables import Source
from hevopt.measured.tables import xls as measured_xls
from hevopt.measured.tables.table import read_measured

FILES = Path(__file__).parents[1] / "workbooks"


def column(name: str, file: str = "sheets", sheet: str = "clock"):
    measured = read_measured(FILES / f"{file}.xls", sheet=sheet)
    return next(c for c in measured.columns if c.name == name)


def test_a_drive_is_read_and_per_cent_is_what_excel_shows():
    result = import_cycle(FILES / "drive.xls")
    assert result.cycle.speed_mps[:12] == pytest.approx((20.5 + np.arange(12)) / 3.6)
    assert result.cycle.grade == pytest.approx(0.03, abs=1e-12)


def test_a_map_is_read_past_text_and_an_empty_sheet():
    source = Source(FILES / "map.xls", None, {}, {}, None)
    given = {"idle_rpm": 1000, "displacement_cm3": 1600}
    imported = import_engine(Request(source, {}, "engine_diesel_1600", given))
    at = imported.grid.at(np.array(60.0), np.array(1500 * np.pi / 30))
    assert at * 3600 == pytest.approx(80 * 1500 * 2.2e-5, rel=1e-5)
    assert imported.notes[0] == "Excel workbook, sheet 'bench'; formulas by their stored values"


@pytest.mark.parametrize("file", ["sheets", "sheets_1904"])
def test_dates_durations_and_times_of_day_are_seconds(file):
    for name in ("time", "elapsed", "of day"):
        assert np.diff(column(name, file).values) == pytest.approx(np.ones(8), abs=1e-5)
        assert column(name, file).unit == "s"
    assert column("elapsed", file).values[0] == pytest.approx(90000)
    assert column("v", file).values[0] == 20.5


def test_truth_values_text_and_blanks_are_as_in_a_text_file():
    measured = read_measured(FILES / "sheets.xls", sheet="kinds")
    a, b, c = (column.values for column in measured.columns)
    assert a[0] == 1.5 and np.isnan(a[1:]).all()
    assert b.tolist() == [1, 0, 1] and c.tolist() == [3, 4, 5]
    assert measured.lines.tolist() == [2, 3, 4]


def test_a_sheet_must_be_named_where_several_hold_something():
    with pytest.raises(DataError, match="sheets 'clock', 'kinds'; choose one with --sheet"):
        read_measured(FILES / "sheets.xls")
    with pytest.raises(DataError, match="sheet 'clok' not found; close matches: clock"):
        read_measured(FILES / "sheets.xls", sheet="clok")


def test_a_workbook_beyond_the_limit_is_refused_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(measured_xls, "_BYTES_MAX", 5000)
    with pytest.raises(DataError, match=r"allowed in an \.xls workbook; save it as \.xlsx"):
        read_measured(FILES / "drive.xls")


def test_a_spoilt_workbook_is_a_table_or_one_message(tmp_path):
    whole, path = (FILES / "drive.xls").read_bytes(), tmp_path / "spoilt.xls"
    ended = 0
    for case in range(300):
        rng, spoilt = random.Random(case), bytearray(whole)
        for _ in range(rng.choice((1, 3, 30))):
            spoilt[rng.randrange(8, len(spoilt))] = rng.choice((0, 255, rng.randrange(256)))
        path.write_bytes(bytes(spoilt[: rng.choice((len(spoilt), rng.randrange(9, len(spoilt))))]))
        try:
            read_measured(path)
        except DataError as error:
            assert str(error).count(str(path)) == 1
            ended += 1
    assert 50 < ended < 300
