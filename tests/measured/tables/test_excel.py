"""Cells of Excel workbooks: what is shown in per cent, durations, clock times and formulas."""

import zipfile
from datetime import time, timedelta

import numpy as np
import openpyxl
import pytest

from hevopt.errors import DataError
from hevopt.measured.cycles.cycle import import_cycle
from hevopt.measured.maps.tables import Source, read_table
from hevopt.measured.tables.table import read_measured
from hevopt.measured.tables.units import in_si


def book(tmp_path, rows, number_format="General", column=3):
    path = tmp_path / "book.xlsx"
    made = openpyxl.Workbook()
    for row in rows:
        made.active.append(row)
    for k in range(len(rows) - 1):
        made.active.cell(k + 2, column).number_format = number_format
    made.save(path)
    return path


def drive(header, value):
    return [["time [s]", "speed [km/h]", header], *([t, 20, value] for t in range(5))]


@pytest.mark.parametrize("header", ["grade [%]", "grade", "grade [-]", "grade_percent"])
@pytest.mark.parametrize("number_format", ["0.00%", "0%", "0.0 %;[Red]-0.0 %"])
def test_a_cell_shown_in_per_cent_is_what_excel_shows(tmp_path, header, number_format):
    result = import_cycle(book(tmp_path, drive(header, 0.03), number_format))
    assert result.cycle.grade == pytest.approx(0.03, abs=1e-12)
    assert any("in % (cells in per cent" in text for text in result.assumptions)


@pytest.mark.parametrize("number_format", ["General", '0.00" %"', r"0.00\ \%"])
def test_a_percent_sign_that_is_only_text_scales_nothing(tmp_path, number_format):
    # Excel shows 0.03 %.
    result = import_cycle(book(tmp_path, drive("grade [%]", 0.03), number_format))
    assert result.cycle.grade == pytest.approx(0.0003, abs=1e-12)


def test_efficiencies_of_a_map_in_per_cent_are_what_excel_shows(tmp_path):
    rows = [["speed [rpm]", "torque [Nm]", "efficiency"]]
    rows += [[n, m, 0.07 + n / 1e4] for n in (1000, 2000) for m in (10, 20)]
    table = read_table(Source(book(tmp_path, rows, "0.0%"), None, {}, {}, None), "fuel")
    assert table.values["efficiency"] == pytest.approx([0.17, 0.17, 0.27, 0.27])


def test_cells_in_per_cent_are_scaled_by_no_other_unit(tmp_path):
    path = book(tmp_path, drive("grade", 0.03), "0%")
    assert import_cycle(path, units={"grade": "%"}).cycle.grade == pytest.approx(0.03)
    with pytest.raises(DataError, match="cells in per cent, which are never taken in 'fraction'"):
        import_cycle(path, units={"grade": "fraction"})
    with pytest.raises(DataError, match=r"unit '%' \(cells in per cent\), but 'deg' \(header\)"):
        import_cycle(book(tmp_path, drive("grade [deg]", 0.03), "0%"))


def test_a_column_half_in_per_cent_is_refused_by_line(tmp_path):
    path = book(tmp_path, drive("grade [%]", 0.03), "0%")
    made = openpyxl.load_workbook(path)
    made.active["C4"].number_format = "General"
    made.save(path)
    measured = read_measured(path)
    with pytest.raises(DataError, match=r"line 2: '3%'.*not usable numbers"):
        in_si(measured, measured.columns[2], ["fraction"], "--unit grade=UNIT")


def test_text_in_per_cent_is_read_as_such(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time [s];speed [km/h];grade\n" + "".join(f"{t};20;3,50 %\n" for t in range(5)))
    assert import_cycle(path).cycle.grade == pytest.approx(0.035)


@pytest.mark.parametrize("header", ["time [min]", "time [s]", "time", "time_h"])
@pytest.mark.parametrize("clock", [False, True])
def test_durations_and_clock_times_are_scaled_by_no_unit(tmp_path, header, clock):
    steps = [timedelta(seconds=3570 + t) for t in range(61)]
    times = [
        time(step.seconds // 3600, step.seconds // 60 % 60, step.seconds % 60) for step in steps
    ]
    rows = [[header, "speed [km/h]"], *([t, 36] for t in (times if clock else steps))]
    path = book(tmp_path, rows, column=2)
    result = import_cycle(path)
    assert result.cycle.duration_s == 60 and result.cycle.distance_m == pytest.approx(600)
    assert any("dates or times of day" in text for text in result.assumptions)
    unit = header[5:].strip("[]")
    told = any(
        f"{unit} of the " in text and "is not applied" in text for text in result.assumptions
    )
    assert told == (unit in ("min", "h"))
    assert import_cycle(path, units={"time": "s"}).cycle.duration_s == 60
    with pytest.raises(
        DataError, match=r"dates or times of day.*never taken in 'min'; leave --time-unit"
    ):
        import_cycle(path, units={"time": "min"})


def test_long_durations_and_parts_of_seconds_come_back(tmp_path):
    steps = [
        timedelta(hours=1200),
        timedelta(hours=1200, milliseconds=250),
        timedelta(hours=1200, seconds=1),
    ]
    path = book(tmp_path, [["t", "v"], *([step, 1] for step in steps)], column=2)
    np.testing.assert_allclose(np.diff(read_measured(path).columns[0].values), [0.25, 0.75])


def test_formulas_are_read_by_their_stored_values(tmp_path):
    path = book(tmp_path, [["time [s]", "speed [km/h]"], *([t, 4711] for t in range(5))], column=2)
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    sheet = "xl/worksheets/sheet1.xml"
    assert parts[sheet].count(b"<v>4711</v>") == 5
    parts[sheet] = parts[sheet].replace(b"<v>4711</v>", b"<f>6*6</f><v>36</v>")
    with zipfile.ZipFile(path, "w") as archive:
        for name, contents in parts.items():
            archive.writestr(name, contents)
    result = import_cycle(path)
    assert result.cycle.speed_mps == pytest.approx(10)
    assert any("formulas by their stored values" in text for text in result.assumptions)
