"""Gaps of more than a minute: never bridged unasked; cut and split lose and invent no metre and no second."""

from pathlib import Path

import command_line
import numpy as np
import pytest
from drive_files import DRIVE_KMH, columns, imported, refusal

from hevopt import build_problem, load_architecture, load_cycle, simulate, solve
from hevopt.errors import DataError
from hevopt.measured.cycles.cycle import import_cycle, import_drives

PARKED = Path(__file__).parents[1] / "logs" / "gap_parked.csv"


def written(*parts, head="time_s,speed_kmh"):
    """A log of some drives, each (start, speeds in km/h at 1 Hz)."""
    rows = [f"{start + k},{v}" for start, speeds in parts for k, v in enumerate(speeds)]
    return "\n".join([head, *rows])


@pytest.mark.parametrize("repair", [False, True])
def test_hours_parked_are_no_dropout_and_what_can_be_done_is_offered(repair):
    with pytest.raises(DataError) as error:
        import_cycle(PARKED, repair=repair)
    message = str(error.value)
    assert "1 fault (1 long gaps)" in message
    assert (
        "line 332: 29671 s (8 h 15 min) without a usable speed, 0 km/h before and 0 km/h after"
        in message
    )
    for offered in ("--gaps cut to join", "--gaps split for one", "--gaps bridge to draw"):
        assert offered in message
    assert "--repair" not in message


def fuel_l_per_100km(cycle):
    car = load_architecture("A")
    problem = build_problem(car, cycle)
    plan = solve(problem, "baseline")
    litres = simulate(problem, plan.control).fuel_kg / car.engine.fuel_density_kgpm3 * 1e3
    return float(litres.sum() / (cycle.distance_m / 1e5))


def test_a_drive_cut_at_its_gap_burns_what_it_burns_without_the_hours_parked(tmp_path):
    result = import_cycle(PARKED, gaps="cut")
    (tmp_path / "cut.csv").write_text(result.text)
    cycle = load_cycle(tmp_path / "cut.csv")
    assert cycle.duration_s == 658 and cycle.distance_m == pytest.approx(8333.33, abs=0.01)
    assert round(fuel_l_per_100km(cycle), 2) == 2.99
    assert "gaps cut out, their time and distance left out: line 332" in result.text
    assert not result.hints


def test_a_split_drive_is_one_cycle_a_trip():
    trips = import_drives(PARKED, gaps="split")
    assert [t.cycle.duration_s for t in trips] == [329, 329]
    assert columns(trips[0].text) == columns(trips[1].text)
    assert "trip 2 of 2, lines 332 to 661" in trips[1].text


def test_a_gap_is_bridged_where_that_is_asked_and_says_what_it_adds(tmp_path):
    result = imported(tmp_path, written((0, [36] * 20), (600, [72] * 20)), gaps="bridge")
    assert result.cycle.duration_s == 619
    # 581 s from 10 to 20 m/s.
    assert result.cycle.distance_m == pytest.approx(190 + 581 * 15 + 380)
    assert "581 s (10 min) and 8715 m" in result.text


@pytest.mark.parametrize("step_s", [1.0, 0.1])
def test_a_cut_at_speed_keeps_every_metre_and_second_and_says_so(tmp_path, step_s):
    one = 10 + 0.02 * np.arange(200)
    other = one[-1] + 2 - 0.02 * np.arange(200)
    time_s = step_s * np.r_[np.arange(200), 5000 + np.arange(200)]
    speed = np.r_[one, other]
    rows = "".join(f"{t:.6g},{v:.9g}\n" for t, v in zip(time_s, speed, strict=True))
    result = imported(tmp_path, "time_s,speed_mps\n" + rows, gaps="cut")
    driven_m = sum(np.trapezoid(part, dx=step_s) for part in (one, other))
    assert result.cycle.duration_s == pytest.approx(398 * step_s)
    assert result.cycle.distance_m == pytest.approx(driven_m, rel=1e-7)
    (hint,) = result.hints
    assert (
        "goes on at speed where it is cut" in hint and "line 201: 50.3 km/h; line 202: 57.5" in hint
    )


def test_speeds_that_no_car_joins_are_not_cut_and_that_is_not_offered(tmp_path):
    text = written((0, [0, 20, 40, 60, 80, 80]), (500, [0, 0, 10, 20, 0]))
    message = refusal(tmp_path, text)
    assert "--gaps cut" not in message and "--gaps split" in message
    assert (
        "line 8: 495 s (8 min) without a usable speed, 80 km/h before and 0 km/h after: no car"
        in refusal(tmp_path, text, gaps="cut")
    )
    trips = import_drives(tmp_path / "drive.csv", gaps="split")
    assert len(trips) == 2 and "trips end or begin at speed" in trips[0].hints[0]


def test_parts_that_cover_no_metre_are_left_out_and_said(tmp_path):
    text = written((0, DRIVE_KMH), (500, [0] * 9), (900, [3]), (1300, DRIVE_KMH))
    for gaps in ("cut", "split"):
        trips = import_drives(_file(tmp_path, text), gaps=gaps)
        assert [t.cycle.duration_s for t in trips] == ([30] if gaps == "cut" else [15, 15])
        assert any("lines 18 to 26 between gaps left out: 0 m driven" in r for r in trips[0].rules)
    assert "no part between gaps" in refusal(
        tmp_path, written((0, [0] * 9), (500, [0] * 9)), gaps="cut"
    )


def _file(tmp_path, text):
    (tmp_path / "drive.csv").write_text(text)
    return tmp_path / "drive.csv"


def test_the_altitude_of_another_place_makes_no_cliff_where_a_drive_is_cut(tmp_path):
    parts = [(0, [36, *[36] * 59], 100), (9000, [36] * 60, 900)]
    rows = [
        f"{start + k},{v},{height}" for start, speeds, height in parts for k, v in enumerate(speeds)
    ]
    text = "\n".join(["time_s,speed_kmh,height [m]", *rows])
    result = imported(tmp_path, text, columns={"altitude": "height [m]"}, gaps="cut")
    assert not result.cycle.grade.any() and result.cycle.duration_s == 118


def test_grades_stay_at_their_places_where_a_drive_is_cut(tmp_path):
    text = written((0, [36] * 5), (500, [36] * 5)).splitlines()
    rows = [f"{row},{k / 1000}" for k, row in enumerate(text[1:], start=1)]
    to_next = imported(tmp_path, "\n".join(["t [s],v [km/h],grade [-]", *rows]), gaps="cut").cycle
    assert to_next.grade == pytest.approx(
        [0.001, 0.002, 0.003, 0.004, 0.006, 0.007, 0.008, 0.009, 0.01]
    )
    fastsim = [",".join([t, f"{float(v) / 3.6}", g]) for t, v, g in (r.split(",") for r in rows)]
    ends = imported(tmp_path, "\n".join(["cycSecs,cycMps,cycGrade", *fastsim]), gaps="cut").cycle
    assert ends.grade[:-1] == pytest.approx([0.002, 0.003, 0.004, 0.005, 0.007, 0.008, 0.009, 0.01])


def test_dropouts_up_to_a_minute_are_repaired_and_gaps_without_a_need_are_said(tmp_path):
    short = written((0, [36] * 20), (79, [36] * 20))
    assert "60 s without a sample before 79 s (limit 5 s); the speed is drawn" in refusal(
        tmp_path, short
    )
    assert imported(tmp_path, short, repair=True).cycle.duration_s == 98
    long = written((0, [36] * 20), (80, [36] * 20))
    assert "1 long gaps" in refusal(tmp_path, long, repair=True)
    result = imported(tmp_path, short, repair=True, gaps="cut")
    assert "--gaps cut: no gap of more than 60 s" in result.text


def test_faults_and_gaps_are_told_together_and_mended_together(tmp_path):
    text = written((0, DRIVE_KMH), (500, DRIVE_KMH)).replace("4,27\n", "4,\n", 1)
    message = refusal(tmp_path, text)
    assert "2 faults (1 without a speed, 1 long gaps)" in message
    assert "let --repair mend" in message and "--gaps cut" in message
    assert "let --repair" not in refusal(tmp_path, text, repair=True)
    assert "let --repair" in refusal(tmp_path, text, gaps="cut")
    assert imported(tmp_path, text, repair=True, gaps="cut").cycle.duration_s == 30


def test_a_repair_is_advised_only_where_it_helps(tmp_path):
    most = "".join(f"{t},{-1 if t % 3 == 0 else 0.5}\n" for t in range(99))
    message = refusal(tmp_path, "time_s,speed_kmh\n" + most)
    assert "33 of 99 lines are more than the 25% that --repair changes" in message
    assert "let --repair" not in message
    # Nothing is left to drive after the repair.
    rows = "".join(f"{t},{-1 if t == 5 else 0}\n" for t in range(60))
    message = refusal(tmp_path, "time_s,speed_kmh\n" + rows)
    assert "--repair does not help, since then: " in message and "distance 0 m" in message
    assert "distance 0 m" in refusal(tmp_path, "time_s,speed_kmh\n" + rows, repair=True)


def test_an_hour_that_is_lost_may_be_summer_time(tmp_path):
    rows = [f"2024-03-31 0{1 if t < 8 else 3}:{59 if t < 8 else 0:02}:{52 + t if t < 8 else t - 8:02},{v}"
            for t, v in enumerate(DRIVE_KMH)]  # fmt: skip
    text = "\n".join(["time,speed [km/h]", *rows])
    assert "a clock set to summer time: --gaps cut" in refusal(tmp_path, text)
    assert imported(tmp_path, text, gaps="cut").cycle.duration_s == 14


CLOCKS = {
    "winter time": lambda s: (
        f"2024-10-27 02:{59 if s < 8 else 0:02}:{52 + s if s < 8 else s - 8:02}"
    ),
    "12 hours": lambda s: (
        f"{12 if s < 8 else 1:02}:{59 if s < 8 else 0:02}:{52 + s if s < 8 else s - 8:02}"
    ),
    "minutes": lambda s: f"{59 if s < 8 else 0:02}:{52 + s if s < 8 else s - 8:02}.0",
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_clocks_that_begin_again_are_one_fault_whose_repair_goes_on(tmp_path, clock):
    rows = "".join(f"{CLOCKS[clock](t)},{v}\n" for t, v in enumerate(DRIVE_KMH))
    message = refusal(tmp_path, "time,speed [km/h]\n" + rows)
    assert "1 fault (1 clocks that begin again)" in message and "are added from here on" in message
    result = imported(tmp_path, "time,speed [km/h]\n" + rows, repair=True)
    assert result.cycle.speed_mps * 3.6 == pytest.approx(DRIVE_KMH, abs=1e-5)


def call(monkeypatch, capsys, *words):
    return command_line.call(monkeypatch, capsys, "cycles", "import", *words)


def test_trips_are_written_beside_each_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = (str(PARKED), "--gaps", "split", "--out", "day.csv")
    status, out, _ = call(monkeypatch, capsys, *words)
    assert status == 0 and "written to day_1.csv" in out and "written to day_2.csv" in out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["day_1.csv", "day_2.csv"]
    assert load_cycle("day_2.csv").duration_s == 329
    status, _, err = call(monkeypatch, capsys, str(PARKED), "--gaps", "cuts")
    assert status == 2 and "close matches: cut; available: cut, split, bridge" in err
    Path("day_1.csv").write_text(PARKED.read_text())
    status, _, err = call(monkeypatch, capsys, "day_1.csv", "--gaps", "split", "--out", "day.csv")
    assert status == 2 and "--out, trip 1 day_1.csv is the file that day_1.csv is read from" in err


def test_a_drive_over_distance_has_no_gaps(tmp_path):
    text = "<s>,<v>,<stop>\n0,0,3\n50,36,0\n100,0,5\n"
    assert "leave --gaps out" in refusal(tmp_path, text, "route.vdri", gaps="cut")


@pytest.mark.parametrize("cell", ["", "400", "0"])
def test_minutes_without_a_usable_speed_are_a_gap_and_never_drawn_across(tmp_path, cell):
    rows = [f"{t},{cell if 200 <= t < 280 else 90}" for t in range(600)]
    text = "\n".join(["time_s,speed_kmh", *rows])
    message = refusal(tmp_path, text, repair=True)
    assert (
        "line 282: 81 s (1 min) without a usable speed, 90 km/h before and 90 km/h after" in message
    )
    result = imported(tmp_path, text, repair=True, gaps="cut")
    assert result.cycle.duration_s == 598 - 80 and result.cycle.distance_m == pytest.approx(
        518 * 25
    )
    if cell:
        assert len(result.repairs) == 80 and "left out with more than a minute" in result.repairs[0]
    else:
        assert not result.repairs
        assert "more than a minute without a speed, left out: lines 202-281" in result.text


def test_a_log_that_waits_for_its_first_speed_begins_there(tmp_path):
    rows = [f"{t},{90 if 70 <= t <= 200 else ''}" for t in range(270)]
    result = imported(tmp_path, "\n".join(["time_s,speed_kmh", *rows]))
    assert result.cycle.duration_s == 130 and result.cycle.distance_m == pytest.approx(130 * 25)
    assert "without a speed, left out: lines 2-71, 203-271" in result.text
