"""Measured tables: what was written comes back, whatever the shape; what is ambiguous is refused with its line."""

import zipfile
from datetime import datetime, time
from time import process_time

import numpy as np
import openpyxl
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hevopt.errors import DataError
from hevopt.measured.tables.names import base_of, unit_in_name
from hevopt.measured.tables.table import column_named, column_of, read_measured
from hevopt.measured.tables.units import in_si, numbers_of
from hevopt.units import unit_named

QUICK = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
# Values whose text shows whether a comma is a decimal mark: never three digits after it.
CELLS = st.integers(-999_999, 999_999).map(lambda n: n / 100)
TABLES = st.integers(2, 4).flatmap(
    lambda width: st.lists(
        st.lists(st.none() | CELLS, min_size=width, max_size=width), min_size=2, max_size=12
    )
)


def read(tmp_path, text, name="table.csv", encoding="utf-8", **options):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    return read_measured(path, **options)


def refusal(tmp_path, text, name="table.csv", **options):
    """What is said where a file cannot be read, or a column of it not be used."""
    with pytest.raises(DataError) as error:
        for column in read(tmp_path, text, name, **options).columns:
            numbers_of(column)
    return str(error.value)


def table_is(measured, rows):
    expected = np.array([[np.nan if cell is None else cell for cell in row] for row in rows])
    np.testing.assert_array_equal(np.stack([c.values for c in measured.columns], axis=1), expected)


@QUICK
@given(
    rows=TABLES,
    separator=st.sampled_from(["\t", ";", ",", " "]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    ends=st.sampled_from(["\n", "\r\n", "\r"]),
    decimal_comma=st.booleans(),
    units_row=st.booleans(),
    before=st.sampled_from(["", "# comment\n", "Messung, Müller\n\n", "% a\n// b\n* c\n"]),
    quoted=st.booleans(),
)
def test_text_in_every_shape_comes_back(
    tmp_path, rows, separator, encoding, ends, decimal_comma, units_row, before, quoted
):
    first = [0.5 if row is None else row for row in [None] * len(rows[0])]
    rows = [first, *rows]  # one number that settles the decimal mark
    quoted = (quoted and separator != " ") or separator == ","
    empty = "nan" if separator == " " else ""

    def cell(value):
        text = empty if value is None else repr(value)
        text = text.replace(".", ",") if decimal_comma else text
        return f'"{text}"' if quoted else text

    lines = [separator.join(f"größe_{i}" for i in range(len(first)))]
    lines += [separator.join(["[km/h]"] * len(first))] * units_row
    lines += [separator.join(map(cell, row)) for row in rows]
    text = before + "\n".join(lines) + "\n"
    measured = read(tmp_path, text.replace("\n", ends), encoding=encoding)
    filled = [k for k, row in enumerate(rows) if any(cell is not None for cell in row)]
    table_is(measured, [rows[k] for k in filled])
    assert [c.name for c in measured.columns] == [f"größe_{i}" for i in range(len(first))]
    assert {c.unit for c in measured.columns} == ({"km/h"} if units_row else {None})
    head = before.count("\n") + 1 + units_row
    # A row whose cells are all empty is none.
    assert list(measured.lines) == [head + 1 + k for k in filled]


@QUICK
@given(rows=TABLES)
def test_excel_and_matlab_tables_come_back(tmp_path, rows):
    rows = [[0.5] * len(rows[0]), *rows]
    names = [f"v{i}_kmh" for i in range(len(rows[0]))]
    book = openpyxl.Workbook()
    for row in [["Logged drive"], [], names, *rows]:
        book.active.append(row)
    book.save(tmp_path / "book.xlsx")
    measured = read_measured(tmp_path / "book.xlsx")
    filled = [row for row in rows if any(cell is not None for cell in row)]
    table_is(measured, filled)
    assert {c.unit for c in measured.columns} == {"km/h"}
    assert measured.lines[0] == 4
    array = np.array([[np.nan if cell is None else cell for cell in row] for row in rows])
    for level, packed in (("5", True), ("5", False), ("4", False)):
        path = tmp_path / "vectors.mat"
        vectors = dict(zip(names, array.T, strict=True)) | {"note": "text"}
        scipy.io.savemat(path, vectors, format=level, do_compression=packed, oned_as="column")
        table_is(read_measured(path), array.tolist())


def test_matlab_matrices_structures_and_types(tmp_path):
    path = tmp_path / "drive.mat"
    arrays = {
        "cyc_mph": np.array([[0, 0], [1, 30]], np.int16),
        "scale": 2.0,
        "z": np.array([1j, 2]),
    }
    scipy.io.savemat(
        path, arrays | {"log": {"time": np.arange(2.0), "on": np.array([True, False])}}
    )
    measured = read_measured(path)
    assert [(c.name, c.unit) for c in measured.columns] == [
        ("cyc_mph(:,1)", "s"), ("cyc_mph(:,2)", "mph"), ("log.time", None), ("log.on", None),
    ]  # fmt: skip
    assert list(measured.columns[1].values) == [0, 30]
    assert "scale (1 x 1), z (no real numbers)" in measured.notes[1]
    assert column_of(measured, ["time"], "").name == "log.time"


@pytest.mark.parametrize(
    ("name", "unit", "base"),
    [
        ("Speed [km/h]", "km/h", "speed"), ("v (m/s)", "m/s", "v"), ("v / (km/h)", "km/h", "v"),
        ("n / min^-1", "min^-1", "n"), ("v in km/h", "km/h", "v"), ("Speed, mph", "mph", "speed"),
        ("Engine speed rpm", "rpm", "enginespeed"), ("torque_nm", "Nm", "torque"),
        ("speed_meters_per_second", "m/s", "speed"), ("GPS Speed (Meters/second)", "Meters/second", "gpsspeed"),
        ("fuel_g_kwh", "g/kWh", "fuel"), ("speed_m_s", "m/s", "speed"), ("mps", "mps", "mps"),
        ("fuel_gps", "g/s", "fuel"), ("speed_gps", None, "speedgps"), ("Speed (GPS)", None, "speedgps"),
        ("t", None, "t"), ("min", None, "min"), ("Load [-]", "-", "load"), ("log.time_s", "s", "time"),
        ("Drehmoment {Nm}", "Nm", "drehmoment"), ("v [furlong]", "furlong", "v"),
    ],
)  # fmt: skip
def test_names_carry_units_in_every_usual_way(name, unit, base):
    assert unit_in_name(name)[0] == unit
    assert base_of(name) == base


@pytest.mark.parametrize(
    ("text", "quantity", "si"),
    [
        ("Meters/second", "speed", 1.0), ("km/hr", "speed", 1 / 3.6), ("miles/hour", "speed", 0.44704),
        ("km/h", "speed", 1 / 3.6), ("KPH", "speed", 1 / 3.6), ("mph", "speed", 1609.344 / 3600),
        ("kn", "speed", 1852 / 3600), ("ft/s", "speed", 0.3048), ("ms", "time", 1e-3),
        ("1/min", "rotation", np.pi / 30), ("min⁻¹", "rotation", np.pi / 30), ("N·m", "torque", 1.0),
        ("lb-ft", "torque", 0.3048 * 0.45359237 * 9.80665), ("bar", "pressure", 1e5),
        ("hp", "power", 550 * 0.3048 * 0.45359237 * 9.80665), ("MW", "power", 1e6),
        ("g/kWh", "specific consumption", 1e-3 / 3.6e6), ("kg/h", "mass flow", 1 / 3600),
        ("l/h", "volume flow", 1e-3 / 3600), ("%", "fraction", 0.01), ("deg", "angle", np.pi / 180),
    ],
)  # fmt: skip
def test_units_have_their_factors(text, quantity, si):
    unit = unit_named(text)
    assert (unit.quantity, unit.si) == (quantity, pytest.approx(si, rel=1e-12))


def test_a_letters_case_that_tells_milli_from_mega_is_not_guessed():
    assert unit_named("mw") is None and unit_named("KN") is None


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("t;v\n0;1,234\n1;2,345\n", "line 2: '1,234' could be a thousand or a decimal comma"),
        ("t;v\n0;1.234,5\n1;2,5\n", "line 2: '1.234,5' has a thousands separator"),
        ('t,v\n0,5\n1,"1,234,567"\n', "line 3: '1,234,567' has a thousands separator"),
        ("t;v\n0;1,5\n1;2.5\n", "line 2: '1,5' has a decimal comma, but 2.5 in line 3 a point"),
        ("t,v\n0,1\n1\n2,3,4\n5,6\n", "2 columns, but line 3: 1 values; line 4: 3 values"),
        ("t,v\n0,1\n2,3,4\n5,6,7\n", "3 columns, but line 2: 2 values"),
        ('t,v\n0,1\n1,"2\n2,3\n', "line 3: a quote is opened"),
        ("", "empty"),
        (" \n\n", "empty"),
        ("hello\nworld\n", "no row of numbers"),
        (b"t,v\n0,\0\n", "byte 6 is zero"),
        (b"\xff\xfe\0\0t", "UTF-32"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1....", "not an .xls workbook that can be read"),
        (b"PK\x03\x04....", "not a readable .xlsx"),
        (b"t,v\n0,\x81\n", "byte 6 is not UTF-8 or Windows-1252"),
        ("a" * 2_000_000, "line 1: 2000000 characters"),
        ("1\n" * 1_200_000, "allowed: up to 1000000"),
        (",".join("1" * 3000) + "\n", "3000 columns"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_place(tmp_path, text, part):
    assert part in refusal(tmp_path, text)


def test_ragged_lines_are_listed_and_counted(tmp_path):
    message = refusal(tmp_path, "t,v\n" + "0,1\n" * 60 + "2\n" * 30)
    assert "line 62: 1 values; line 63: 1 values" in message and "and 10 more" in message


@pytest.mark.parametrize(
    ("contents", "name"), [(b"MATLAB 7.3 MAT-file", "a.mat"), (b"\x89HDF\r\n", "b")]
)
def test_matlab_of_version_7_3_says_how_to_save(tmp_path, contents, name):
    assert "-v7" in refusal(tmp_path, contents, name)


def test_every_truncated_matlab_file_is_refused_or_read(tmp_path):
    path = tmp_path / "whole.mat"
    scipy.io.savemat(path, {"log": {"a": np.arange(3.0), "b": "text"}, "time_s": np.arange(3)})
    whole = path.read_bytes()
    outcomes = []
    for end in range(1, len(whole), 3):
        try:
            outcomes.append([c.name for c in read(tmp_path, whole[:end], "cut.mat").columns])
        except DataError as error:
            outcomes.append("not a readable .mat file" in str(error) or str(error))
    # Only a cut between the two variables, or before both, leaves a whole file.
    assert outcomes.count(True) >= len(outcomes) - 3


def test_a_line_of_100_mb_is_refused_at_once(tmp_path):
    path = tmp_path / "long.csv"
    path.write_bytes(b"1," * 49_999_000)
    began = process_time()
    with pytest.raises(DataError, match="line 1: 99998000 characters"):
        read_measured(path)
    assert process_time() - began < 20


@pytest.mark.parametrize("contents", ["0" * 300_000_000, "<a>" * 4_000_000])
def test_packed_bombs_are_refused_unread(tmp_path, contents):
    path = tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("xl/worksheets/sheet1.xml", contents)
    began = process_time()
    with pytest.raises(DataError, match="MB unpacked; allowed"):
        read_measured(path)
    assert process_time() - began < 20


def test_a_packed_matlab_bomb_is_refused(tmp_path):
    path = tmp_path / "bomb.mat"
    scipy.io.savemat(path, {"a": np.zeros((30_000_000, 1))}, do_compression=True)
    with pytest.raises(DataError, match="more than 200 MB unpacked"):
        read_measured(path)


def test_sheets_are_chosen_dates_are_seconds_and_lines_are_sheet_rows(tmp_path):
    book = openpyxl.Workbook()
    for row in (["Drive"], [], ["Time", "Speed", "Note"], [None, "km/h"]):
        book.active.append(row)
    for k in range(3):
        book.active.append([datetime(2024, 5, 1, 10, 0, k), 1.5 * k, "x" if k == 1 else None])
    book.active.merge_cells("A1:C1")
    book.active["B6"] = "=1+1"  # never computed, so without a stored value
    book.create_sheet("empty")
    book.save(tmp_path / "book.xlsx")
    measured = read_measured(tmp_path / "book.xlsx")
    assert [(c.name, c.unit, c.source) for c in measured.columns[:2]] == [
        ("Time", "s", "dates or times of day"), ("Speed", "km/h", "units row"),
    ]  # fmt: skip
    assert list(measured.columns[0].values) == [0, 1, 2]
    assert np.isnan(measured.columns[1].values[1])
    assert list(measured.lines) == [5, 6, 7]
    book.create_sheet("other").append([1, 2])
    book.save(tmp_path / "book.xlsx")
    with pytest.raises(DataError, match="sheets 'Sheet', 'other'; choose one with --sheet"):
        read_measured(tmp_path / "book.xlsx")
    with pytest.raises(DataError, match="sheet 'Shet' not found; close matches: Sheet"):
        read_measured(tmp_path / "book.xlsx", sheet="Shet")
    assert len(read_measured(tmp_path / "book.xlsx", sheet="Sheet").lines) == 3


def test_times_of_day_and_dates_in_text_are_seconds(tmp_path):
    measured = read(
        tmp_path, "a,b,c\n23:59:59.5,2024-02-29T00:00:00Z,7\n24:00:01,2024-03-01 00:00:00.5Z,8\n"
    )
    assert list(measured.columns[0].values) == [86399.5, 86401]
    assert list(measured.columns[1].values) == [0, 86400.5]
    assert measured.columns[1].unit == "s"


def test_text_before_the_header_comments_and_columns_that_hold_nothing(tmp_path):
    text = "Logger 3\nCar: a, b\n\n# made by hand\nt [s],v,,\n0,1,,\n# pause\n1,2,,\n"
    measured = read(tmp_path, text)
    assert [c.name for c in measured.columns] == ["t [s]", "v"]
    assert list(measured.lines) == [6, 8]
    assert "comments: lines 4, 7" in measured.notes
    assert "text before the header: lines 1-2" in measured.notes


def test_a_header_in_a_comment_a_grid_and_no_header_at_all(tmp_path):
    assert read(tmp_path, "# x\n# time_s, v [km/h]\n0,1\n1,2\n").columns[0].unit == "s"
    grid = read(tmp_path, "rpm\\Nm;10;20\n1000;1,5;2\n2000;3;4\n")
    assert [c.name for c in grid.columns] == ["rpm\\Nm", "10", "20"]
    plain = read(tmp_path, "1,2\n3,4\n")
    assert [c.name for c in plain.columns] == ["column 1", "column 2"]
    assert len(plain.lines) == 2


def test_text_among_numbers_matters_only_where_the_column_is_used(tmp_path):
    measured = read(tmp_path, "time_s,v [km/h],who\n0,1,ann\n1,x,bob\n2,1e999,carl\n")
    assert list(in_si(measured, measured.columns[0], ["time"], "--time-unit").values) == [0, 1, 2]
    with pytest.raises(DataError, match="line 3: 'x'; line 4: '1e999': not usable numbers"):
        in_si(measured, measured.columns[1], ["speed"], "--speed-unit")


def test_a_missing_an_unknown_and_another_quantitys_unit_are_refused(tmp_path):
    measured = read(tmp_path, "v,w [furlong],x [Nm]\n1,2,3\n4,5,6\n")
    for column, part in zip(
        measured.columns,
        ("is not in the file; give it with --u", "is unknown", "is one of torque"),
        strict=True,
    ):
        with pytest.raises(DataError, match=part):
            in_si(measured, column, ["speed"], "--u")
    given = in_si(measured, measured.columns[2], ["speed"], "--u", "km/h")
    assert given.values[0] == pytest.approx(3 / 3.6)
    assert given.note == "x [Nm] in km/h (--u, against Nm in the file)"


def test_columns_are_named_by_name_base_or_number_and_doubles_are_refused(tmp_path):
    measured = read(tmp_path, "Speed [km/h],v (m/s),Höhe\n1,2,3\n4,5,6\n")
    assert [column_named(measured, name).name for name in ("speed", "v", "3")] == [
        "Speed [km/h]", "v (m/s)", "Höhe",
    ]  # fmt: skip
    with pytest.raises(DataError, match=r"close matches: Speed \[km/h\]"):
        column_named(measured, "Sped [km/h]")
    with pytest.raises(DataError, match="could all be meant; choose with --column speed=NAME"):
        column_of(measured, ["speed", "v"], "--column speed=NAME")


def test_names_that_a_terminal_could_obey_are_shown_harmless(tmp_path):
    measured = read(tmp_path, '"\x1b[31mv",=1+1\n1,2\n3,4\n')
    assert measured.columns[0].name == "?[31mv"


def test_a_time_of_day_column_takes_excels_clock_cells(tmp_path):
    book = openpyxl.Workbook()
    for row in (["clock", "v"], [time(8, 0, 1), 1], [time(8, 0, 3), 2]):
        book.active.append(row)
    book.save(tmp_path / "clock.xlsx")
    assert list(np.diff(read_measured(tmp_path / "clock.xlsx").columns[0].values)) == [2]


@pytest.mark.parametrize(
    ("header", "units", "found"),
    [
        ("speed,torque,fuel,coolant", "rpm,Nm,kg/h,degC", ["rpm", "Nm", "kg/h", "degC"]),
        ("speed,torque,fuel,CO", "rpm,Nm,kg/h,ppm", ["rpm", "Nm", "kg/h", "ppm"]),
        ("time,speed,T", "s,km/h,°C", ["s", "km/h", "°C"]),
        ("time,speed,note", "s,km/h,", ["s", "km/h", None]),
    ],
)
def test_a_units_row_may_hold_units_that_no_table_knows(tmp_path, header, units, found):
    row = ",".join("1.5" for _ in found)
    measured = read(tmp_path, f"{header}\n{units}\n{row}\n{row}\n")
    assert [c.name for c in measured.columns] == header.split(",")
    assert [c.unit for c in measured.columns] == found
    assert "units row in line 2" in measured.notes and list(measured.lines) == [3, 4]
    strange = measured.columns[2]
    if found[2] == "°C":
        with pytest.raises(DataError, match="column T: unit '°C' is one of celsius"):
            in_si(measured, strange, ("speed",), "--unit speed=UNIT")


def test_names_below_titles_are_no_units_row_and_a_name_may_be_a_unit(tmp_path):
    measured = read(tmp_path, "Engine,Engine,Emissions\nrpm,Nm,NOx\n800,10,1\n900,20,2\n")
    assert [(c.name, c.unit) for c in measured.columns] == [
        ("rpm", "rpm"), ("Nm", "Nm"), ("NOx", None),
    ]  # fmt: skip


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_quoted_cells_may_hold_line_breaks_and_lines_keep_their_numbers(tmp_path, separator, ends):
    rows = [
        ["Time\n[s]", "Speed\n\n[km/h]", 'Note ""x""'],
        ["0", "10", "a"],
        ["1", "11", "b\nc\n# d"],
    ]
    rows += [["2", "oops", "e"], ["3", "13", "f"]]
    text = "\n".join(separator.join(f'"{cell}"' for cell in row) for row in rows)
    measured = read(tmp_path, text.replace("\n", ends))
    assert [c.name for c in measured.columns] == ["Time [s]", "Speed [km/h]", 'Note "x"']
    assert list(measured.columns[0].values) == [0, 1, 2, 3]
    assert list(measured.lines) == [5, 6, 9, 10]
    with pytest.raises(DataError, match="line 9: 'oops'"):
        in_si(measured, measured.columns[1], ["speed"], "--speed-unit")


@pytest.mark.parametrize(
    "text", ['t,v\n0,1\n1,"2\n2,3\n3,"4\n', 't,v\n0,"1\n' + "1,2\n" * 20 + '3,4"\n']
)
def test_a_quote_that_is_not_closed_takes_no_lines_along(tmp_path, text):
    assert "a quote is opened and not closed in the line" in refusal(tmp_path, text)


def test_blank_lines_are_told_by_their_numbers(tmp_path):
    measured = read(tmp_path, "t [s],v\n\n0,1\n  \n\n1,2\n\n")
    assert "blank: lines 2, 4-5" in measured.notes and list(measured.lines) == [3, 6]
    assert not any("blank" in note for note in read(tmp_path, "t [s],v\n0,1\n1,2\n").notes)
