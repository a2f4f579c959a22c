"""Dates and times of day: every usual way gives the same seconds; an open order of day and month is refused."""

from datetime import datetime, timedelta

import numpy as np
import openpyxl
import pytest

from hevopt.errors import DataError
from hevopt.measured.cycles.cycle import import_cycle
from hevopt.measured.tables.dates import Slashed, moment_in
from hevopt.measured.tables.month_names import month_of
from hevopt.measured.tables.table import read_measured

START = datetime(2024, 3, 1, 11, 59, 30)
STEPS_S = np.array([0.0, 1, 2, 29, 30, 45, 3600, 90000, 1296000])


def written(tmp_path, form, start=START, steps_s=STEPS_S, separator=","):
    path = tmp_path / "drive.csv"
    rows = [
        f"{(start + timedelta(seconds=s)).strftime(form)}{separator}20\n" for s in steps_s.tolist()
    ]
    path.write_text(f"time{separator}speed [km/h]\n" + "".join(rows))
    return path


FORMS = [
    "%Y-%m-%d %H:%M:%S", "%Y-%m-%dT%H:%M:%SZ", "%Y/%m/%d %H:%M:%S", "%d.%m.%Y %H:%M:%S", "%d.%m.%y %H:%M:%S",
    "%d.%m.%Y %I:%M:%S %p", "%Y/%m/%d %I:%M:%S%p", "%d/%m/%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p",
    "%Y-%m-%d %I:%M:%S %p", "%d.%m.%Y %H:%M:%S.500",
]  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("separator", [";", ","])
def test_dates_of_every_form_are_the_same_seconds(tmp_path, form, separator):
    # The last row is in the middle of the month, which tells day from month.
    measured = read_measured(written(tmp_path, form, separator=separator))
    np.testing.assert_allclose(measured.columns[0].values, STEPS_S, atol=1e-6)
    assert measured.columns[0].unit == "s"
    assert measured.columns[0].source.startswith("dates or times of day")


def test_half_days_begin_at_12(tmp_path):
    path = tmp_path / "a.csv"
    cells = [
        "12:00:00 AM",
        "1:00:00 am",
        "11:59:59 a.m.",
        "12:00 PM",
        "1:00:00 PM",
        "11:59:59,5 pm",
    ]
    path.write_text("time;speed [km/h]\n" + "".join(f"{cell};1\n" for cell in cells))
    expected = [0, 3600, 43199, 43200, 46800, 86399.5]
    np.testing.assert_allclose(read_measured(path).columns[0].values, expected)


MAY_7 = [
    "07-May-2024 09:15:00.5", "7-mai-2024 09:15:00,5", "07/mag/2024 09.15.00,5",
    "7 de mayo de 2024 9:15:00.5 a. m.",
    "May 7, 2024 9:15:00.5 AM", "mar. 07 mai 2024 09:15:00.5", "2024-May-07 09:15:00.5", "7. Mai 2024 09:15:00.5",
    "Tue May 07 09:15:00.5 2024", "7 maja 2024, 09:15:00.5", "07/05/2024 09:15:00.5", "5/7/24 9:15:00.5 AM",
    "Tue, 07 May 2024 09:15:00.5 GMT",
]  # fmt: skip


@pytest.mark.parametrize("cell", MAY_7)
def test_months_by_name_in_every_usual_order_are_dates(cell):
    moment = moment_in(cell)
    if isinstance(moment, Slashed):
        assert {moment.first, moment.second, moment.year, moment.seconds} == {5, 7, 2024, 33300.5}
    else:
        assert moment.replace(tzinfo=None) == datetime(2024, 5, 7, 9, 15, 0, 500_000)


@pytest.mark.parametrize(
    ("month", "names"),
    [
        (1, "Jan January Januar Jänner janv. gen gennaio ene enero sty"), (2, "Feb févr. Februar lut fev"),
        (3, "Mar Mär März mars mrt marzo março"), (4, "Apr avr. avril abr kwi"), (5, "May Mai mag maj mei maio"),
        (6, "Jun giu juin cze czerwca"), (7, "Jul juil. lug julio lip"), (8, "Aug août aout ago sie"),
        (9, "Sep Sept set wrz"), (10, "Oct Okt ott out paź"), (11, "Nov lis listopada"),
        (12, "Dec Dez déc. dic gru des"), (0, "jui ma runs Ju"),
    ],
)  # fmt: skip
def test_months_have_their_names_in_many_languages(month, names):
    assert [month_of(name.rstrip(".")) for name in names.split()] == [month] * len(names.split())


def test_zones_in_a_date_count_and_minutes_with_a_fraction_are_times(tmp_path):
    summer, winter = (moment_in(f"Sun Oct 27 02:30:00 {z} 2024") for z in ("CEST", "GMT+01:00"))
    assert (winter - summer).total_seconds() == 3600
    assert moment_in("15:00.4") == 900.4 and moment_in("15:00") is None
    assert moment_in("1:00:00 PM") == 46800 and moment_in("10:00:00 UTC") == 36000


@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S"])
def test_the_column_decides_the_order_or_it_does_not_matter(tmp_path, form):
    order = "day first" if form.startswith("%d") else "month first"
    result = import_cycle(
        written(tmp_path, form, datetime(2024, 3, 31, 23, 59, 30), np.arange(61.0))
    )
    assert result.cycle.duration_s == 60
    assert f"time: time in s (dates or times of day, {order})" in result.assumptions
    # On one day alone the order changes no difference.
    result = import_cycle(written(tmp_path, form, START, np.arange(61.0)))
    assert result.cycle.duration_s == 60
    assert any("day and month in either order" in text for text in result.assumptions)


@pytest.mark.parametrize("repair", [False, True])
@pytest.mark.parametrize("form", ["%d/%m/%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p"])
def test_an_order_that_stays_open_is_refused(tmp_path, form, repair):
    path = written(tmp_path, form, datetime(2024, 3, 1, 23, 59, 30), np.arange(61.0))
    with pytest.raises(DataError) as error:
        import_cycle(path, repair=repair)
    message = str(error.value)
    assert "line 2: column time: '0" in message and "/2024 " in message
    assert "01/02/2024 where the column shows which of the two is the day" in message


@pytest.mark.parametrize(
    "cell",
    [
        "32.01.2024 10:00:00",
        "2024/13/01 10:00:00",
        "01.02.2024 25:00:00",
        "13:00:00 PM",
        "0:30:00 AM",
    ],
)
def test_what_is_no_date_is_a_fault_by_line(tmp_path, cell):
    path = written(tmp_path, "%d.%m.%Y %H:%M:%S", START, np.arange(20.0))
    lines = path.read_text().splitlines()
    lines[5] = f"{cell},20"
    path.write_text("\n".join(lines))
    with pytest.raises(DataError, match=f"line 6: time is '{cell}', no usable number"):
        import_cycle(path)


def test_a_date_column_that_nobody_uses_is_no_obstacle(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"0{1 + k}/02/2024 10:00:00,{k},20\n" for k in range(5)]
    path.write_text("stamp,time [s],speed [km/h]\n" + "".join(rows))
    assert import_cycle(path).cycle.duration_s == 4


def test_dates_of_a_workbook_are_those_of_a_text(tmp_path):
    book = openpyxl.Workbook()
    book.active.append(["time", "speed [km/h]"])
    for step_s in STEPS_S.tolist():
        book.active.append([START + timedelta(seconds=step_s), 20])
    book.save(tmp_path / "a.xlsx")
    values = read_measured(tmp_path / "a.xlsx").columns[0].values
    np.testing.assert_allclose(values, STEPS_S, atol=1e-3)
