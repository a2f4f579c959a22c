"""Imported cycles: one drive from every tool's file, distance and final time kept, every fault named by line."""

from pathlib import Path

import command_line
import numpy as np
import openpyxl
import pytest
import scipy.io
from drive_files import DRIVE_KMH, PLAIN, columns, imported, refusal
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hevopt import build_problem, load_architecture, load_cycle
from hevopt.driving.demand import demand_of
from hevopt.errors import DataError
from hevopt.measured.cycles.cycle import import_cycle
from hevopt.measured.cycles.sampled import summary
from hevopt.measured.resample import one_hertz_times, speeds_at

QUICK = settings(
    max_examples=80, deadline=None, derandomize=True, database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip


@st.composite
def drives(draw, acceleration_mps2):
    """Times at microseconds and speeds up to 60 m/s that change with an acceleration at most, with standstills."""
    steps_s = draw(st.lists(st.integers(1_000, 1_900_000), min_size=2, max_size=60))
    time_s = np.round(np.concatenate([[0], np.cumsum(steps_s)]) / 1e6, 6)
    shares = draw(st.lists(st.floats(-1, 1), min_size=len(steps_s), max_size=len(steps_s)))
    speed_mps = [draw(st.sampled_from([0.0, 5.0, 30.0]))]
    for step_s, share in zip(np.diff(time_s), shares, strict=True):
        speed_mps.append(min(max(speed_mps[-1] + acceleration_mps2 * share * step_s, 0.0), 60.0))
    return time_s, np.array(speed_mps)


def trapezoid(time_s, speed_mps):
    return float(np.trapezoid(speed_mps, time_s))


@QUICK
@given(drive=drives(9.8))
def test_resampling_keeps_distance_final_time_standstill_and_direction(drive):
    time_s, speed_mps = drive
    at_s = one_hertz_times(float(time_s[-1]))
    new_mps = speeds_at(time_s, speed_mps, at_s)
    assert at_s[0] == 0 and at_s[-1] == time_s[-1]
    assert (np.diff(at_s)[:-1] == 1).all() and (len(at_s) == 2 or 0.5 <= np.diff(at_s)[-1] < 1.5)
    measured_m = trapezoid(time_s, speed_mps)
    assert trapezoid(at_s, new_mps) == pytest.approx(measured_m, rel=1e-9, abs=1e-9)
    assert (new_mps >= 0).all()
    # Where the car stands for a whole second on both sides, it still does.
    for k, t in enumerate(at_s):
        near = (time_s > t - 1.5) & (time_s < t + 1.5)
        if (
            near.any()
            and (np.interp(np.linspace(t - 1.5, t + 1.5, 301), time_s, speed_mps) == 0).all()
        ):
            assert (speed_mps[near] > 0).any() or new_mps[k] == 0


@QUICK
@given(drive=drives(4.0))
def test_a_written_drive_comes_back_with_distance_and_final_time(tmp_path, drive):
    time_s, speed_mps = drive
    measured_m = trapezoid(time_s, speed_mps)
    rows = "".join(
        f"{t!r};{v!r}\n" for t, v in zip(time_s.tolist(), speed_mps.tolist(), strict=True)
    )
    text = "Zeit [s];Geschwindigkeit [m/s]\n" + rows.replace(".", ",")
    if measured_m < 1.001:
        return
    result = imported(tmp_path, text)
    (tmp_path / "out.csv").write_text(result.text)
    cycle = load_cycle(tmp_path / "out.csv")
    assert cycle.duration_s == time_s[-1]
    assert cycle.distance_m == pytest.approx(measured_m, rel=1e-3)
    assert result.distance_m == pytest.approx(measured_m, rel=1e-12)
    # Read as a foreign file, the cycle file gives itself.
    assert columns(import_cycle(tmp_path / "out.csv").text) == columns(result.text)


def test_ten_hertz_ramps_have_their_speeds_at_whole_seconds_by_hand(tmp_path):
    # 1 m/s² for 3 s, then 2 s at 3 m/s: no kink inside a second, so nothing to correct.
    tenths = np.arange(51) / 10
    rows = "".join(f"{t},{min(t, 3.0)}\n" for t in tenths)
    cycle = imported(tmp_path, "time [s],speed [m/s]\n" + rows).cycle
    assert cycle.speed_mps == pytest.approx([0, 1, 2, 3, 3, 3], abs=1e-9)
    # A move of 2 m/s at most between two whole seconds at rest: its 1 m is shared by both.
    cycle = imported(tmp_path, "time [s],speed [m/s]\n0,0\n1,0\n1.5,2\n2,0\n3,0\n").cycle
    assert cycle.speed_mps == pytest.approx([0, 0.5, 0.5, 0])


UNIT_PATHS = {
    "km/h": ("time_s,speed_kmh\n", 1.0, 1.0),
    "m/s": ("t [s],v [m/s]\n", 1.0, 1 / 3.6),
    "mph": ("Time (s),Speed (mph)\n", 1.0, 1 / 1.609344),
    "knots": ("time in s,speed in knots\n", 1.0, 1 / 1.852),
    "ms": ("t;v\nms;km/h\n", 1e3, 1.0),
    "min": ("time_min,v / km/h\n", 1 / 60, 1.0),
    "ft/s": ("time_ms,velocity_ft_s\n", 1e3, 1 / 3.6 / 0.3048),
    "FASTSim": ("cycSecs,cycMps,cycGrade,cycRoadType\n", 1.0, 1 / 3.6),
    "FASTSim plain": ("time_seconds,mps,grade\n", 1.0, 1 / 3.6),
    "VECTO": ("<t>,<v>\n", 1.0, 1.0),
}


@pytest.mark.parametrize("tool", UNIT_PATHS)
def test_every_unit_path_gives_the_same_cycle(tmp_path, tool):
    header, per_s, per_kmh = UNIT_PATHS[tool]
    separator = ";" if ";" in header else ","
    more = header.splitlines()[0].count(separator) - 1
    rows = "".join(
        separator.join([repr(t * per_s), repr(v * per_kmh), *["0"] * more]) + "\n"
        for t, v in enumerate(DRIVE_KMH)
    )
    result = imported(tmp_path, header + rows)
    expected = imported(tmp_path, "time_s,speed_kmh\n" + PLAIN, "expected.csv")
    grade_free = [
        line.removesuffix(",0").removesuffix(",grade") for line in columns(result.text).splitlines()
    ]
    assert (grade_free if "grade" in result.text else columns(result.text).splitlines()) == columns(
        expected.text
    ).splitlines()
    assert result.cycle.speed_mps * 3.6 == pytest.approx(DRIVE_KMH, abs=1e-5)


def test_books_and_matlab_files_give_the_same_cycle_and_problem(tmp_path):
    expected = imported(tmp_path, "time_s,speed_kmh\n" + PLAIN)
    mph = np.array([[t, v / 1.609344] for t, v in enumerate(DRIVE_KMH)])
    book = openpyxl.Workbook()
    for row in [["Time [s]", "Speed [km/h]"], *enumerate(DRIVE_KMH)]:
        book.active.append(row)
    book.save(tmp_path / "a.xlsx")
    scipy.io.savemat(tmp_path / "b.mat", {"cyc_mph": mph})
    vectors = {"time_s": np.arange(16), "speed_kmh": np.array(DRIVE_KMH)}
    scipy.io.savemat(tmp_path / "c.mat", vectors)
    for name in ("a.xlsx", "b.mat", "c.mat"):
        assert columns(import_cycle(tmp_path / name).text) == columns(expected.text)
    results = []
    for name in ("b.mat", "drive.csv"):
        out = tmp_path / "cycle.csv"
        out.write_text(import_cycle(tmp_path / name).text)
        results.append(
            build_problem(load_architecture("C2"), load_cycle(out), allow_shortfall=True)
        )
    for name in ("fuel_kg", "battery_power_w", "reject"):
        assert np.array_equal(*(getattr(problem.table, name) for problem in results))


def test_a_drive_over_distance_joins_its_points_by_constant_acceleration(tmp_path):
    # 0 to 36 km/h over 50 m takes 10 s, 100 m at 36 km/h 10 s, down over 50 m 10 s, then 5 s at rest.
    text = "<s>,<v>,<grad>,<stop>\n0,0,2,3\n50,36,2,0\n150,36,-2,0\n200,0,0,5\n"
    cycle = imported(tmp_path, text, "route.vdri").cycle
    assert cycle.duration_s == 38
    assert cycle.distance_m == pytest.approx(200)
    assert cycle.speed_mps[[0, 3, 8, 13, 23, 33, 38]] == pytest.approx(
        [0, 0, 5, 10, 10, 0, 0], abs=1e-6
    )
    assert cycle.grade[[5, 20, 30]] == pytest.approx([0.02, 0.02, -0.02])


def test_target_speeds_over_distance_are_followed_with_an_acceleration(tmp_path):
    # At 1 m/s²: 50 m and 10 s up to 10 m/s, 100 m at it, 50 m and 10 s down to the stop of 5 s.
    text = "s [m],v [km/h],grad [%],stop [s]\n0,0,0,3\n1,36,0,0\n200,0,0,5\n"
    assert "jumps of speed" in (message := refusal(tmp_path, text))
    assert "line 3" in message and "--acceleration" in message
    cycle = imported(tmp_path, text, acceleration_mps2=1.0).cycle
    assert cycle.duration_s == pytest.approx(38)
    assert cycle.distance_m == pytest.approx(200)
    assert cycle.speed_mps[[3, 8, 13, 20, 28, 33]] == pytest.approx([0, 5, 10, 10, 5, 0], abs=1e-5)
    # Braking for the stop begins in the stretch before the last: 10 to 4 m/s over 42 m, then to 0 over 8 m.
    text = "s [m],v [km/h],stop [s]\n0,36,0\n92,36,0\n100,0,5\n"
    cycle = imported(tmp_path, text, acceleration_mps2=1.0).cycle
    assert cycle.speed_mps == pytest.approx([10] * 6 + [*range(9, -1, -1)] + [0] * 5, abs=1e-5)
    for wrong in (0.0, -1.0, float("nan"), 20.0):
        assert "allowed: above 0 to 9.81" in refusal(tmp_path, text, acceleration_mps2=wrong)


@pytest.mark.parametrize(
    ("rows", "part"),
    [
        ("0,0,0\n50,36,0\n50,36,0\n99,0,0\n", "line 4: distance 50 m after 50 m does not increase"),
        ("0,0,0\n50,,0\n99,0,0\n", "line 3: distance or speed is no number"),
        ("0,0,0\n50,36,4\n99,0,0\n", "line 3: stop of 4 s at 36 km/h"),
        ("0,0,0\n50,36,0\n60,0,0\n99,0,0\n", "line 5: distance is covered at speed 0"),
        ("0,0,0\n50,-3,0\n99,0,0\n", "line 3: speed or stop time is negative"),
    ],
)
def test_faults_over_distance_are_named_by_line(tmp_path, rows, part):
    assert part in refusal(tmp_path, "<s>,<v>,<stop>\n" + rows)


@pytest.mark.parametrize(
    ("header", "values"),
    [
        ("grade_percent", "2"),
        ("slope [%]", "2"),
        ("grade [-]", "0.02"),
        ("grade (deg)", "1.1457628"),
    ],
)
def test_grade_in_any_unit_is_rise_over_run(tmp_path, header, values):
    rows = "".join(f"{t},{v},{values}\n" for t, v in enumerate(DRIVE_KMH))
    cycle = imported(tmp_path, f"time_s,speed_kmh,{header}\n{rows}").cycle
    assert cycle.grade == pytest.approx(0.02, abs=1e-7)


def test_grade_reaches_the_wheels_as_m_g_dh_and_the_fuel(tmp_path):
    speed = [0, 10, 20, 30, *[40] * 60, 30, 20, 10, 0]
    cars = {}
    for grade in (0, 3):
        rows = "".join(f"{t},{v},{grade}\n" for t, v in enumerate(speed))
        (tmp_path / f"{grade}.csv").write_text(
            imported(tmp_path, f"t [s],v [km/h],grade [%]\n{rows}").text
        )
        car, cycle = load_architecture("A"), load_cycle(tmp_path / f"{grade}.csv")
        demand = demand_of(cycle, car.vehicle, car.gearbox)
        table = build_problem(car, cycle, allow_shortfall=True).table
        fuel = np.where(table.reject == 0, table.fuel_kg, np.inf).min(axis=1)
        cars[grade] = np.sum(demand.wheel_power_w * demand.step_s), fuel[np.isfinite(fuel)].sum()
    rise_m = cycle.distance_m * np.sin(np.arctan(0.03))
    expected_j = car.vehicle.mass_kg * 9.80665 * rise_m
    assert cars[3][0] - cars[0][0] == pytest.approx(expected_j, rel=5e-4)
    assert cars[3][1] > 1.3 * cars[0][1]


def test_uneven_grades_keep_the_climb(tmp_path):
    rng = np.random.default_rng(3)
    time_s = np.cumsum(rng.uniform(0.05, 0.15, 1500))
    speed = 15 + 5 * np.sin(time_s / 9)
    grade = 0.05 * np.sin(time_s / 7)
    rows = "".join(
        f"{t:.3f},{v:.6f},{g:.6f}\n" for t, v, g in zip(time_s, speed, grade, strict=True)
    )
    cycle = imported(tmp_path, "t [s],v [m/s],grade [-]\n" + rows).cycle
    driven_m = (speed[1:] + speed[:-1]) / 2 * np.diff(time_s)
    climbs = []
    for sign in (1, -1):
        climbs.append(np.sum(driven_m * np.maximum(sign * grade[:-1], 0)))
        steps_m = np.diff(cycle.time_s) * (cycle.speed_mps[1:] + cycle.speed_mps[:-1]) / 2
        assert np.sum(steps_m * np.maximum(sign * cycle.grade[:-1], 0)) == pytest.approx(
            climbs[-1], rel=5e-3
        )


FASTSIM_NAMES = [
    ("cycSecs", "cycMps", "cycGrade"), ("time_s", "mps", "grade"),
    ("time_seconds", "speed_meters_per_second", "grade"),
]  # fmt: skip


@pytest.mark.parametrize("names", FASTSIM_NAMES)
def test_grades_of_fastsim_hold_over_the_step_that_ends_at_their_row(tmp_path, names):
    # Steps of 50, 500, 500 and 50 m: 0.01 over the first 550 m, 0.03 over the last.
    rows = "0,0,0.01\n10,10,0.01\n60,10,0.01\n110,10,0.03\n120,0,0.03\n"
    result = imported(tmp_path, ",".join(names) + "\n" + rows)
    assert result.cycle.grade[[0, 59, 60, 119]] == pytest.approx([0.01, 0.01, 0.03, 0.03])
    assert ("grade", "22.0 m up, 0.0 m down") in summary(result)
    assert any("step that ends at it (FASTSim" in text for text in result.rules)
    # Elsewhere a row's grade holds to the next row: 0.01 over 1050 m, 0.03 over 50 m.
    other = imported(tmp_path, "t [s],v [m/s],grade [-]\n" + rows)
    assert ("grade", "12.0 m up, 0.0 m down") in summary(other)


def test_altitude_becomes_grade_only_where_it_is_named(tmp_path):
    rows = "".join(f"{t},36,{0.4 * t}\n" for t in range(61))
    text = "time_s,speed_kmh,altitude_m\n" + rows
    assert not imported(tmp_path, text).cycle.grade.any()
    result = imported(tmp_path, text, columns={"altitude": "altitude_m"})
    # 0.4 m in 10 m of road.
    assert result.cycle.grade[:-1] == pytest.approx(0.04 / np.sqrt(1 - 0.04**2), abs=1e-6)
    assert any("through 100 m of road" in text for text in result.rules)
    assert ("grade", "24.0 m up, 0.0 m down") in summary(result)


def test_gears_and_clutch_hold_their_last_value(tmp_path):
    rows = [
        (0, 0, 0, 1),
        (0.4, 0, 1, 1),
        (1.0, 2, 1, 0),
        (1.9, 4, 2, 0),
        (2.2, 4, 3, 0),
        (4, 4, 3, 0),
    ]
    text = "time_s,speed_mps,gear,clutch_open\n" + "".join(
        f"{a},{b},{c},{d}\n" for a, b, c, d in rows
    )
    cycle = imported(tmp_path, text).cycle
    assert list(cycle.gear) == [0, 1, 2, 3, 3]
    assert list(cycle.clutch_open) == [True, False, False, False, False]
    assert imported(tmp_path, text, columns={"gear": "", "clutch_open": ""}).cycle.gear is None
    with pytest.raises(DataError, match="clutch_open without gear"):
        imported(tmp_path, text, columns={"gear": ""})


# Row -> its new text (None: taken out), the fault with the line it stands in, and whether a repair keeps the drive.
FAULTS = {
    "backward": (
        {5: "2.5,36"},
        "line 7: time 2.5 s is out of order (line 6: 4 s); the line is left out",
    ),
    "duplicate": ({5: "4,27"}, "line 7: time 4 s stands twice (line 6: 4 s)"),
    "forward": ({5: "500,36"}, "line 7: time 500 s is out of order"),
    "no time": ({5: ",36"}, "line 7: time is empty; the line is left out"),
    "no speed": ({5: "5,NaN"}, "line 7: speed is empty; drawn between its neighbours"),
    "text": ({5: "5,oops"}, "line 7: speed is 'oops', no usable number"),
    "negative": ({10: "10,-0.4"}, "line 12: speed -0.4 km/h is negative; set to 0"),
    "spike": (
        {5: "5,180"},
        "line 7: speed 180 km/h against 27 km/h of line 6, 1 s apart: 42.5 m/s², more than tyres hold (9.81 m/s²)",
    ),
    "spike at the start": (
        {0: "0,180"},
        "line 2: speed 180 km/h against 0 km/h of line 3, 1 s apart",
    ),
    "too fast": ({5: "5,400"}, "line 7: speed 400 km/h is above 360 km/h; drawn"),
}


@pytest.mark.parametrize("kind", FAULTS)
def test_faults_are_refused_by_line_and_repaired_only_when_asked(tmp_path, kind):
    changes, part = FAULTS[kind]
    rows = PLAIN.splitlines()
    for row, text in changes.items():
        rows[row] = text
    text = "time_s,speed_kmh\n" + "\n".join(rows)
    message = refusal(tmp_path, text)
    assert part in message and "1 fault (1 " in message and "--repair" in message
    result = imported(tmp_path, text, repair=True)
    assert len(result.repairs) == 1 and part in result.repairs[0]
    assert f"#   {result.repairs[0]}" in result.text.splitlines()
    # Row 5 is drawn between 27 and 36 km/h, row 10 set to 0; all others are as they were.
    expected = np.array(DRIVE_KMH, float)
    expected[5] = 31.5 if 5 in changes else 36
    assert result.cycle.speed_mps * 3.6 == pytest.approx(expected, abs=1e-5)


def test_a_gap_is_named_and_drawn_straight_across(tmp_path):
    rows = [f"{t / 10},{t / 10}\n" for t in range(60)]
    text = "time_s,speed_mps\n" + "".join(rows[:20] + rows[45:])
    part = "line 22: 2.6 s without a sample before 4.5 s (limit 2 s)"
    assert part in refusal(tmp_path, text)
    result = imported(tmp_path, text, repair=True)
    assert result.cycle.speed_mps == pytest.approx([0, 1, 2, 3, 4, 5, 5.9])


@pytest.mark.parametrize(("step_s", "missing", "limit"), [(5, 8, "25"), (1, 9, "5"), (1, 5, "5")])
def test_a_gap_of_more_than_five_steps_is_refused(tmp_path, step_s, missing, limit):
    rows = [f"{step_s * t},15\n" for t in range(40)]
    text = "time [s],speed [m/s]\n" + "".join(rows[:10] + rows[10 + missing :])
    part = f"line 12: {step_s * (missing + 1)} s without a sample before"
    message = refusal(tmp_path, text)
    assert part in message and f"(limit {limit} s)" in message
    assert [part in repair for repair in imported(tmp_path, text, repair=True).repairs] == [True]


def test_steps_of_more_than_three_usual_ones_are_listed_by_line(tmp_path):
    rows = [f"{t},15\n" for t in range(60)]
    text = "time_s,speed_mps\n" + "".join(rows[:10] + rows[13:30] + rows[34:50] + rows[52:])
    result = imported(tmp_path, text)
    long = "across 2 steps of more than 3 times the usual 1 s: line 12: 4 s; line 29: 5 s"
    assert result.rules[-1].endswith(long) and long in result.text
    assert not any(
        "steps of more" in t for t in imported(tmp_path, text[: text.index("13,")]).rules
    )


def test_a_clock_that_passes_midnight_is_one_fault_whose_repair_goes_on(tmp_path):
    clock = [f"{(86395 + t) % 86400}" for t in range(16)]
    clock = [f"{int(s) // 3600:02}:{int(s) // 60 % 60:02}:{int(s) % 60:02}" for s in clock]
    text = "time,speed_kmh\n" + "".join(f"{t},{v}\n" for t, v in zip(clock, DRIVE_KMH, strict=True))
    message = refusal(tmp_path, text)
    assert "1 fault (1 clocks that begin again)" in message
    assert "line 7: time 0 s after 86399 s: the clock passes midnight" in message
    cycle = imported(tmp_path, text, repair=True).cycle
    assert cycle.duration_s == 15
    assert cycle.speed_mps * 3.6 == pytest.approx(DRIVE_KMH, abs=1e-5)
    # A single time of 0 within a day is a fault of its own.
    message = refusal(tmp_path, text.replace("00:00:02", "23:59:58"))
    assert "line 9: time 86398 s" in message


@pytest.mark.parametrize(
    ("first", "second"), [("00:00", "00:01"), ("01/02/2024 10:00:00", "02/02/2024 10:00:01")]
)
def test_times_in_another_form_are_named_with_the_forms_that_are_read(tmp_path, first, second):
    message = refusal(tmp_path, f"time,speed [m/s]\n{first},0\n{second},1\n")
    assert f"line 2: column time: '{first}' is not a time that can be read" in message
    assert "2024-02-01 10:00:01" in message


def test_a_negative_speed_that_is_a_spike_too_is_one_fault(tmp_path):
    text = "time_s,speed_kmh\n0,0\n1,20\n2,40\n3,60\n4,-60\n5,60\n6,40\n7,20\n8,0\n"
    message = refusal(tmp_path, text)
    assert "1 fault (1 negative speeds)" in message and "drawn between its neighbours" in message
    result = imported(tmp_path, text, repair=True)
    assert result.cycle.speed_mps[4] * 3.6 == pytest.approx(60, abs=1e-5)
    assert "of the repaired drive's" in dict(summary(result))["distance"]
    plain = imported(tmp_path, "time_s,speed_kmh\n" + PLAIN)
    assert "of the file's" in dict(summary(plain))["distance"]


@pytest.mark.parametrize(
    ("header", "option"),
    [
        ("time [s],speed [km/h]\ns,m/s\n", "--speed-unit"),
        ("time_s,speed_kmh\ns,m/s\n", "--speed-unit"),
        ("time_min,speed [m/s]\ns,m/s\n", "--time-unit"),
        ("cycSecs,cycMps\ns,km/h\n", "--speed-unit"),
    ],
)
def test_two_units_for_one_column_are_refused_unless_the_user_says_which(tmp_path, header, option):
    message = refusal(tmp_path, header + PLAIN)
    assert "(units row), but" in message and f"say which holds with {option}" in message
    imported(tmp_path, header + PLAIN, units={"speed": "km/h", "time": "s"})


def test_a_suffix_that_only_looks_like_a_unit_contradicts_nothing(tmp_path):
    text = "time [s],v_s,other_kmh\ns,km/h,m/s\n" + PLAIN.replace("\n", ",0\n")
    result = imported(tmp_path, text, columns={"speed": "v_s"})
    assert result.cycle.speed_mps.max() == pytest.approx(10)


def test_all_faults_are_listed_or_counted_and_too_many_are_not_repaired(tmp_path):
    rows = [f"{t},{-1 if t % 20 == 0 else 18}\n" for t in range(1000)]
    message = refusal(tmp_path, "time_s,speed_kmh\n" + "".join(rows))
    assert "50 faults (50 negative speeds)" in message and "and 30 more\n" in message
    result = imported(tmp_path, "time_s,speed_kmh\n" + "".join(rows), repair=True)
    assert len(result.repairs) == 50
    most = "".join(f"{t},{-1 if t % 3 == 0 else 0.5}\n" for t in range(99))
    message = refusal(tmp_path, "time_s,speed_kmh\n" + most, repair=True)
    assert "33 of 99 lines are more than the 25%" in message


def test_a_sensors_steps_are_no_spikes(tmp_path):
    # 100 Hz, in steps of 0.5 km/h: 14 m/s² from sample to sample, 0.7 m/s² in truth.
    rows = "".join(f"{t / 100},{round(2.5 * t / 100 * 2) / 2}\n" for t in range(1000))
    assert imported(tmp_path, "time_s,speed_kmh\n" + rows).cycle.duration_s == 9.99


@pytest.mark.parametrize(
    ("text", "options", "part"),
    [
        ("t,v [km/h]\n", {}, "the unit of column t is not in the file; give it with --time-unit"),
        ("t [s],v\n", {}, "the unit of column v is not in the file; give it with --speed-unit"),
        ("t [s],v [Nm]\n", {}, "unit 'Nm' is one of torque; needed is speed"),
        ("t [s],x\n", {}, "no column of speed found by its name"),
        ("x,v [km/h]\n", {}, "no column of time or distance found by its name"),
        (
            "t [s],v [km/h]\n",
            {"columns": {"sped": "v"}},
            "role of a column 'sped' not found; close",
        ),
        ("t [s],v [km/h]\n", {"columns": {"speed": "w"}}, "no column 'w'"),
        ("t [s],v [km/h]\n", {"units": {"grade": "%"}}, "for which no column is used"),
        ("t [s],v [km/h]\n", {"acceleration_mps2": 1.0}, "leave --acceleration out"),
        ("t [h],v [km/h]\n", {"repair": True}, "check the unit of time"),
        ("t [s],v [km/h]\n", {"sheet": "A"}, "leave --sheet out"),
    ],
)
def test_what_is_missing_or_wrong_is_said_with_what_to_do(tmp_path, text, options, part):
    rows = "".join(f"{10 * t},{v}\n" for t, v in enumerate(DRIVE_KMH * 2))
    assert part in refusal(tmp_path, text + rows, **options)


def test_units_by_option_are_used_and_printed(tmp_path):
    result = imported(tmp_path, "t,v\n" + PLAIN, units={"time": "s", "speed": "km/h"})
    assert "speed: v in km/h (--speed-unit)" in result.assumptions
    by_number = imported(
        tmp_path, PLAIN, columns={"time": "1", "speed": "2"}, units={"time": "s", "speed": "km/h"}
    )
    assert columns(by_number.text) == columns(result.text)


def test_gears_and_grades_that_are_none_are_faults(tmp_path):
    rows = "".join(
        f"{t},{v},{7.5 if t == 3 else 1},{900 if t == 4 else 1}\n" for t, v in enumerate(DRIVE_KMH)
    )
    text = "time_s,speed_kmh,gear,grade_percent\n" + rows
    message = refusal(tmp_path, text)
    assert (
        "line 5: gear is 7.5, not a whole number from 0 to 20; 1 of the line before is used"
        in message
    )
    assert "line 6: grade is 9, not from -0.5 to 0.5; 0.01 of the line before is used" in message
    assert imported(tmp_path, text, repair=True).cycle.gear[3] == 1


def call(monkeypatch, capsys, *words):
    return command_line.call(monkeypatch, capsys, "cycles", "import", *words)


def test_the_command_prints_assumptions_and_summary_and_writes_only_with_out(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    Path("drive.csv").write_text("t,v\n" + PLAIN)
    words = ["drive.csv", "--speed-unit", "km/h", "--time-unit", "s"]
    status, out, _ = call(monkeypatch, capsys, *words)
    assert status == 0 and "not written; add --out" in out
    assert "speed: v in km/h (--speed-unit)" in out and "standstill" in out
    assert [path.name for path in tmp_path.iterdir()] == ["drive.csv"]
    status, out, _ = call(monkeypatch, capsys, *words, "--out", "cycle.csv")
    assert status == 0 and "written to cycle.csv" in out
    text = Path("cycle.csv").read_text()
    assert "drive.csv, sha256 " in text and load_cycle("cycle.csv").duration_s == 15


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["drive.csv"], "give it with --time-unit"),
        (["none.csv"], "no such file"),
        (["."], "a folder"),
        (["drive.csv", "--out", "drive.csv"], "is the file that drive.csv is read from"),
        (["drive.csv", "--out", "cycle"], "ends in .csv"),
        (["drive.csv", "--column", "speed"], "not of the form ROLE=VALUE"),
        (["drive.csv", "--unit", "time=s", "--unit", "time=ms"], "gives time twice"),
        (["drive.csv", "--unit", "time=s", "--time-unit", "ms"], "both --time-unit and --unit"),
    ],
)
def test_mistakes_at_the_command_exit_with_2_and_one_message(
    tmp_path, monkeypatch, capsys, words, part
):
    monkeypatch.chdir(tmp_path)
    Path("drive.csv").write_text("t,v\n" + PLAIN)
    status, out, err = call(monkeypatch, capsys, *words)
    assert status == 2 and part in err and not out
