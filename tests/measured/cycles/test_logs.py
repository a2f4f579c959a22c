"""Files in the shapes that loggers and tools really write: each is read as it was meant, or asked about at once."""

from pathlib import Path

import command_line
import numpy as np
import pytest
from drive_files import DRIVE_KMH, PLAIN, columns, imported, refusal

from hevopt.checks.validate import validate
from hevopt.errors import DataError
from hevopt.measured.cycles.cycle import import_cycle
from hevopt.measured.cycles.sampled import summary

LOGS = Path(__file__).parents[1] / "logs"
# Up to 40 km/h by 2 km/h a second, and on at 40; up to 25 mph by 1 mph a second.
UP_TO_40 = np.minimum(2.0 * np.arange(31), 40)
UP_TO_25_MPH = np.minimum(np.arange(41.0), 25)


def test_months_by_name_and_two_clocks_of_a_phone_are_read():
    result = import_cycle(LOGS / "torque_pro.csv")
    assert result.cycle.speed_mps * 3.6 == pytest.approx(UP_TO_40, abs=1e-5)
    assert "time: Device Time in s (dates or times of day)" in result.assumptions
    by_gps = import_cycle(LOGS / "torque_pro.csv", columns={"time": "GPS Time"})
    assert columns(by_gps.text) == columns(result.text)


def test_the_cars_own_speed_comes_before_that_of_its_gps(tmp_path):
    rows = PLAIN.replace("\n", ",1\n")
    result = imported(tmp_path, "time (s),Speed (OBD)(km/h),GPS Speed (Meters/second)\n" + rows)
    assert result.cycle.speed_mps * 3.6 == pytest.approx(DRIVE_KMH, abs=1e-5)
    assert "columns not used: GPS Speed (Meters/second)" in result.assumptions
    gps = imported(tmp_path, "time (s),GPS Speed (Meters/second)\n0,1\n1,2\n2,1\n")
    assert gps.cycle.speed_mps.max() == 2


def test_four_samples_a_second_under_a_clock_of_seconds_are_spread_evenly():
    result = import_cycle(LOGS / "integer_seconds_4hz.csv")
    # 0.5 km/h more every quarter of a second up to 40 km/h after 20 s, and on to 49.75 s.
    assert result.cycle.duration_s == 49.75 and not result.repairs
    assert result.cycle.distance_m == pytest.approx((20 * 20 + 29.75 * 40) / 3.6, rel=1e-6)
    assert "up to 4 rows share each 1 s of the clock and are spread evenly over it" in result.text


def test_rows_of_a_clock_second_that_are_alike_are_one_sample(tmp_path):
    rows = "".join(f"{t},{v}\n" * 3 for t, v in enumerate(DRIVE_KMH))
    result = imported(tmp_path, "time_s,speed_kmh\n" + rows)
    assert result.cycle.speed_mps * 3.6 == pytest.approx(DRIVE_KMH, abs=1e-5)
    assert "are alike: one of them is kept" in result.text


def test_a_coarse_clock_that_begins_and_ends_within_a_second_stays_even(tmp_path):
    # 0.5 s of 4 Hz in the first second and in the last, and around a gap of two seconds.
    times = [9, 9, *np.repeat(range(10, 14), 4), 14, 14, 17, 17, *np.repeat(range(18, 22), 4), 22]
    speeds = np.r_[np.arange(20) / 4, 5 + np.arange(19) / 4]
    rows = "".join(f"{t},{v}\n" for t, v in zip(times, speeds, strict=True))
    result = imported(tmp_path, "time_s,speed_mps\n" + rows, repair=True)
    assert result.cycle.duration_s == pytest.approx(22 - 9.5)
    assert "line 22: 3.25 s without a sample" in result.repairs[0]


def test_rows_without_any_value_and_headers_written_again_are_no_rows(tmp_path):
    result = import_cycle(LOGS / "trailing_blank_rows.csv")
    assert result.cycle.duration_s == 30
    assert "rows without any value, left out: lines 33-332" in result.assumptions
    lines = PLAIN.splitlines()
    head = "time_s,speed_kmh"
    text = "\n".join([head, ",,", *lines[:5], head, "nan,-", *lines[5:], ",,,"])
    result = imported(tmp_path, text)
    assert result.cycle.speed_mps * 3.6 == pytest.approx(DRIVE_KMH, abs=1e-5)
    assert "header again: line 8" in result.assumptions
    assert "rows without any value, left out: lines 2, 9, 21" in result.assumptions


@pytest.mark.parametrize("name", ["epa_schedule.txt", "epa_schedule_2.txt"])
def test_a_schedule_whose_header_says_everything_needs_no_option(name):
    result = import_cycle(LOGS / name)
    assert result.cycle.speed_mps / 0.44704 == pytest.approx(UP_TO_25_MPH, abs=1e-5)
    assert result.cycle.distance_m == pytest.approx((25 * 12.5 + 15 * 25) * 0.44704, rel=1e-6)


@pytest.mark.parametrize(
    ("head", "separator"),
    [
        ("Time [s], Speed [km/h]", "\t"), ("Time [s];Speed [km/h]", ","), ("Time, s  Speed, km/h", " "),
        ("Time, s,Speed, km/h", ","), ("Time (s) | Speed (km/h)", ";"), ("Time_s Speed_kmh", "\t"),
        ("Time Speed\ns km/h", ";"),
    ],
)  # fmt: skip
def test_a_header_may_be_split_otherwise_than_its_numbers(tmp_path, head, separator):
    expected = imported(tmp_path, "time_s,speed_kmh\n" + PLAIN)
    text = f"{head}\n{PLAIN.replace(',', separator)}"
    assert columns(imported(tmp_path, text, "a.txt").text) == columns(expected.text)


def test_two_headers_are_both_used():
    result = import_cycle(LOGS / "co2mpas_two_headers.csv")
    assert result.cycle.speed_mps * 3.6 == pytest.approx(
        np.minimum(2.0 * np.arange(41), 40), abs=1e-5
    )
    assert result.cycle.gear.tolist() == [0, *[1] * 40] or result.cycle.gear.max() == 1
    same = import_cycle(LOGS / "co2mpas_two_headers.csv", columns={"speed": "Velocity"})
    assert columns(same.text) == columns(result.text)


@pytest.mark.parametrize(
    "head",
    ["Time [s],Speed [km/h]\nt_1,v_1", "t_1,v_1\nTime [s],Speed [km/h]", "s,km/h\nTime,Speed"],
)
def test_names_and_units_may_stand_in_either_of_two_header_rows(tmp_path, head):
    expected = imported(tmp_path, "time_s,speed_kmh\n" + PLAIN)
    assert columns(imported(tmp_path, f"{head}\n{PLAIN}", "a.csv").text) == columns(expected.text)
    clash = "Time [s],Speed [km/h]\ntime_s,speed_mps\n" + PLAIN
    assert "unit 'm/s' (suffix of the name), but 'km/h' (header)" in refusal(tmp_path, clash)


def test_the_only_columns_with_units_of_time_and_speed_are_taken_and_others_asked_for(tmp_path):
    head = "Stamp (s),Profile phase 1 (km/h),x\n"
    rows = PLAIN.replace("\n", ",7\n")
    assert imported(tmp_path, head + rows).cycle.duration_s == 15
    two = "Stamp (s),Phase 1 (km/h),Phase 2 (km/h)\n" + rows
    assert "no column of speed found by its name" in refusal(tmp_path, two)


def test_date_and_time_in_two_columns_are_one_moment(tmp_path):
    path = LOGS / "date_and_time_split.csv"
    with pytest.raises(
        DataError, match=r"line 22: 172801 s \(48 h 00 min\) without a usable speed"
    ):
        import_cycle(path)
    assert import_cycle(path, gaps="bridge").cycle.duration_s == 172839
    assert import_cycle(path, columns={"date": ""}).cycle.duration_s == 39


@pytest.mark.parametrize(
    "days",
    [
        ("2024-03-01", "2024-03-02"), ("01.03.2024", "02.03.2024"), ("31/03/2024", "01/04/2024"),
        ("20240301", "20240302"), ("01-Mar-2024", "02-Mar-2024"), ("1 mars 2024", "2 mars 2024"),
        ("2024-03-01", "2024-03-02 "),
    ],
)  # fmt: skip
def test_dates_of_every_form_go_on_over_midnight(tmp_path, days):
    rows = "".join(
        f"{days[t > 7]};{'23:59:5' if t < 8 else '00:00:0'}{(t + 2) % 10};{v}\n"
        for t, v in enumerate(DRIVE_KMH)
    )
    result = imported(tmp_path, "Datum;Uhrzeit;Speed [km/h]\n" + rows)
    assert result.cycle.duration_s == 15 and not result.repairs
    assert "date: Datum, added to the time of day" in result.assumptions


def test_a_date_that_stays_open_is_asked_for_and_may_be_left_out(tmp_path):
    rows = "".join(f"0{3 + (t > 7)}/05/2024;10:00:{t:02};{v}\n" for t, v in enumerate(DRIVE_KMH))
    text = "Date;Time;Speed [km/h]\n" + rows
    message = refusal(tmp_path, text)
    assert "'03/05/2024'" in message and "--column date=" in message
    assert imported(tmp_path, text, columns={"date": ""}).cycle.duration_s == 15


def test_a_column_that_nobody_uses_blocks_nothing(tmp_path):
    path = LOGS / "thousands_in_unused_column.csv"
    result = import_cycle(path)
    assert result.cycle.speed_mps * 3.6 == pytest.approx([0, 5.5, 8, 0], abs=1e-5)
    with pytest.raises(DataError, match=r"line 2: '1.234,5' has a thousands separator"):
        import_cycle(path, columns={"altitude": "3"})
    # What the column cannot tell by itself, the others' marks leave open: 1.234 may be a thousand.
    text = path.read_text().replace("5,5", "7").replace(";8;", ";1.234;")
    assert "line 4: '1.234' could be a thousand: 1.234,5 in line 2" in refusal(tmp_path, text)


def test_a_times_unit_that_is_missing_may_be_days():
    path = LOGS / "excel_day_fraction.xlsx"
    with pytest.raises(
        DataError, match="as days, in which spreadsheets keep times, its steps are 1 s"
    ):
        import_cycle(path)
    result = import_cycle(path, units={"time": "day"})
    assert result.cycle.duration_s == 30 and "already at 1 Hz" in result.text


def test_an_altitude_that_is_not_used_says_how_and_its_noise_makes_no_hills(tmp_path):
    result = import_cycle(LOGS / "noisy_altitude.csv")
    assert not result.cycle.grade.any()
    assert result.hints[-1].endswith(
        "the grade comes from column altitude [m] with --column altitude='altitude [m]'"
    )
    used = import_cycle(LOGS / "noisy_altitude.csv", columns={"altitude": "altitude [m]"})
    assert np.abs(used.cycle.grade).max() < 0.01
    assert not any("counts as level" in hint for hint in used.hints)
    plain = imported(tmp_path, "time_s,speed_kmh,elevation\n" + PLAIN.replace("\n", ",4\n"))
    assert plain.hints[-1].endswith("--column altitude='elevation' --unit altitude=m")
    graded = "time_s,speed_kmh,grade_percent,elevation\n" + PLAIN.replace("\n", ",1,4\n")
    assert not imported(tmp_path, graded).hints


def test_a_table_without_a_header_is_asked_for_everything_at_once(tmp_path):
    message = refusal(tmp_path, PLAIN)
    assert (
        "4 things are not in the file; give them all, such as --column time=1 --column speed=2"
        in message
    )
    assert (
        "--time-unit s --speed-unit km/h" in message
        and "columns found: column 1, column 2" in message
    )
    swapped = "".join(f"{v};{t}\n" for t, v in enumerate(DRIVE_KMH))
    assert "--column time=2 --column speed=1" in refusal(tmp_path, swapped)
    message = refusal(tmp_path, "t,v\n" + PLAIN)
    assert "2 things are not in the file" in message
    assert "--time-unit" in message and "--speed-unit" in message


@pytest.mark.parametrize("name", ["wltp", "WLTC", "wltp_class3.csv"])
def test_cycles_are_proposed_by_what_people_call_them(name, monkeypatch, capsys):
    words = ("compare", "--architectures", "A", "--cycle", name)
    status, _, err = command_line.call(monkeypatch, capsys, *words)
    assert status == 2 and "wltc_class3b" in err.split("available")[0]


@pytest.mark.parametrize(
    ("name", "proposed"),
    [("ftp", "ftp75, udds;"), ("artemis", "cadc_urban, cadc_road,"), ("nedc_cold", "nedc;"),
     ("japan 10-15", "available: cadc")],
)  # fmt: skip
def test_names_of_cycles_that_are_not_shipped_say_what_is(name, proposed, monkeypatch, capsys):
    words = ("compare", "--architectures", "A", "--cycle", name)
    assert proposed in command_line.call(monkeypatch, capsys, *words)[2]


@pytest.mark.parametrize(
    "name", ["excel_day_fraction.xlsx", "epa_schedule.txt", "torque_pro.csv", "gap_parked.csv"]
)
def test_validate_points_a_raw_drive_to_the_importer(name, monkeypatch, capsys):
    status, out, _ = command_line.call(monkeypatch, capsys, "validate", str(LOGS / name))
    assert status == 2 and out.count("hevopt cycles import FILE --out NAME.csv") == 1


def test_validate_points_logs_with_our_own_columns_or_letters_to_the_importer(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("# Höhe\ntime_s,speed_kmh\n0,0\n1,9\n".encode("latin-1"))
    assert "cycles import" in validate(str(path)).faults[0]
    path.write_text("time_s,speed_kmh\n0,0\n1,9\n1,9\n2,-1\n")
    assert "cycles import" in validate(str(path)).advice
    assert validate("nedc").advice == ""


def test_the_summary_of_a_file_that_says_everything_is_that_of_its_drive():
    found = dict(summary(import_cycle(LOGS / "epa_schedule.txt")))
    assert found["duration"] == "40 s" and found["max speed"] == "40.2 km/h"
