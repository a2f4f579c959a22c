"""Clocks in one number, hhmmss.ss, alone and in the files of VBOX loggers, across minutes, hours and midnight."""

import numpy as np
import pytest
from drive_files import imported, refusal

from hevopt.measured.coastdown.runs import read_runs

_HEAD = """File created on 14/03/2021 @ 10:12

[header]
satellites
time
latitude
longitude
velocity {unit}
heading
height
Engine_Speed

[channel units]
rpm

[comments]
Log Rate (Hz) : 5.00

[column names]
sats time lat long velocity heading height Engine_Speed

[data]
"""
STEP_S = 0.2


def clock(second: float) -> str:
    hundredths = round(second * 100) % 8_640_000
    minutes, rest = divmod(hundredths, 6000)
    return f"{minutes // 60:02d}{minutes % 60:02d}{rest // 100:02d}.{rest % 100:02d}"


def vbo(begin_s: float, speed_kmh: np.ndarray, unit="kmh") -> str:
    rows = [
        f"008 {clock(begin_s + STEP_S * n)} +03119.09973 +00058.49277 {v:07.3f} 176.64 +00100.00 +1.2E+03"
        for n, v in enumerate(speed_kmh)
    ]
    return _HEAD.format(unit=unit) + "\n".join(rows) + "\n"


@pytest.mark.parametrize("begin", [36_030, 39_570, 86_370], ids=["minute", "hour", "midnight"])
def test_a_vbox_file_across_the_end_of_a(begin, tmp_path):
    speed = 30 - 30 * np.cos(np.arange(301) * 2 * np.pi / 300)
    result = imported(tmp_path, vbo(begin, speed), "drive.vbo", repair=begin > 80_000)
    assert result.cycle.duration_s == pytest.approx(60)
    assert result.cycle.speed_mps[30] * 3.6 == pytest.approx(60, abs=0.05)
    assert "speed: velocity in km/h (VBOX file)" in result.assumptions
    # Midnight alone is no sound clock: the day that it leaves out is told.
    assert len(result.repairs) == (begin > 80_000)


def test_a_vbox_files_own_unit_of_velocity_holds(tmp_path):
    result = imported(tmp_path, vbo(36_000, np.linspace(0, 50, 51), "knots"), "drive.vbo")
    assert result.cycle.speed_mps.max() == pytest.approx(50 * 1852 / 3600)


def test_a_vbox_file_without_names_is_one_message(tmp_path):
    text = vbo(36_000, np.zeros(3)).replace("sats time lat", "\n").split("\n long")[0]
    said = refusal(tmp_path, text.split("\n\n\n")[0] + "\n[data]\n1 2 3\n", "drive.vbo")
    assert "no names of columns in its section [column names]" in said


@pytest.mark.parametrize("name", ["time", "utc", "Time [hhmmss.ss]"])
def test_a_clock_in_one_number_is_seen_at_the_ends_of_minutes(name, tmp_path):
    rows = "".join(f"{clock(36_045 + n)},{n % 7}\n" for n in range(100))
    result = imported(tmp_path, f"{name},speed_kmh\n{rows}")
    assert result.cycle.duration_s == 99 and not result.repairs


@pytest.mark.parametrize(
    "times",
    [range(100, 150), range(0, 300), [*range(30, 60), *range(100, 160)], [100, 150, 200, 250]],
    ids=["within a minute", "every second", "after a dropout", "far apart"],
)
def test_seconds_are_no_clock_in_one_number(times, tmp_path):
    rows = "".join(f"{t},{t % 7}\n" for t in times)
    result = imported(tmp_path, f"time_s,speed_kmh\n{rows}", repair=True)
    assert result.cycle.duration_s == times[-1] - times[0]


def test_a_coast_down_goes_on_over_the_end_of_a_minute(tmp_path):
    paths = [tmp_path / "there.vbo", tmp_path / "back.vbo"]
    for path, heading, slowest in zip(paths, ("176.64", "356.64"), (20, 21), strict=True):
        path.write_text(vbo(36_050, np.linspace(120, slowest, 301)).replace("176.64", heading))
    runs, _ = read_runs(paths, {}, {}, None, None)
    assert [run.direction for run in runs] == [1, -1]
    assert [run.time_s[-1] - run.time_s[0] for run in runs] == pytest.approx([60, 60])
