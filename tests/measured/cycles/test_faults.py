"""Faults of a drive: what a log really holds is found by line, what an ordinary sensor writes is none."""

from time import process_time

import numpy as np
import pytest
from drive_files import DRIVE_KMH, PLAIN, columns, imported, refusal


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


def trace(step_s, noise_mps=0.0, seed=1):
    """Times and speeds of a minute: standing, up to 15 m/s, along, and down again; noise while driving alone."""
    time_s = np.arange(round(60 / step_s) + 1) * step_s
    speed_mps = np.interp(time_s, [0, 5, 25, 40, 55, 60], [0, 0, 15, 15, 0, 0])
    noise = noise_mps * np.random.default_rng(seed).standard_normal(len(time_s))
    return time_s, np.where(speed_mps > 0, np.maximum(speed_mps + noise, 0), 0)


def written(time_s, speed_mps):
    rows = zip(time_s, speed_mps, strict=True)
    return "time_s,speed_mps\n" + "".join(f"{t:.6g},{v:.9g}\n" for t, v in rows)


@pytest.mark.parametrize("hertz", [10, 50, 100])
@pytest.mark.parametrize("noise_mps", [0.02, 0.1, 0.3])
def test_the_noise_of_a_fast_sensor_is_no_fault(tmp_path, hertz, noise_mps):
    time_s, speed_mps = trace(1 / hertz, noise_mps)
    result = imported(tmp_path, written(time_s, speed_mps))
    truth_m = np.trapezoid(speed_mps, time_s)
    assert result.cycle.distance_m == pytest.approx(truth_m, rel=1e-6)
    assert result.cycle.duration_s == 60


@pytest.mark.parametrize("step_mps", [1 / 3.6, 0.44704])
@pytest.mark.parametrize("held", [1, 10, 50])
def test_the_steps_of_a_sensor_and_values_that_it_holds_are_no_faults(tmp_path, step_mps, held):
    # 50 Hz rows of a sensor that writes whole km/h or mph, up to 50 times the same.
    time_s, speed_mps = trace(0.02)
    speed_mps = np.round(speed_mps / step_mps)[np.arange(len(time_s)) // held * held] * step_mps
    # Between two steps, it may show the other one for a single row.
    speed_mps[1400:1900:7] += step_mps * (held == 1)
    result = imported(tmp_path, written(time_s, speed_mps))
    assert result.cycle.distance_m == pytest.approx(np.trapezoid(speed_mps, time_s), rel=1e-6)


@pytest.mark.parametrize(
    ("hertz", "noise_mps", "jump_mps"),
    [(1, 0, 12), (10, 0, 4), (10, 0.1, -4), (50, 0.1, 4), (100, 0.1, -4), (100, 0.1, 30), (100, 0, 2)],
)  # fmt: skip
def test_wild_samples_are_found_by_line_and_drawn_between_their_neighbours(
    tmp_path, hertz, noise_mps, jump_mps
):
    time_s, speed_mps = trace(1 / hertz, noise_mps)
    spoilt = speed_mps.copy()
    places = [int(t * hertz) for t in (18, 33, 39)]
    spoilt[places] += jump_mps
    message = refusal(tmp_path, written(time_s, spoilt))
    assert "3 faults (3 spikes)" in message
    result = imported(tmp_path, written(time_s, spoilt), repair=True)
    assert [text.split(":")[0] for text in result.repairs] == [f"line {k + 2}" for k in places]
    assert all("more than tyres hold" in text for text in result.repairs)
    speed_mps[places] = (speed_mps[np.array(places) - 1] + speed_mps[np.array(places) + 1]) / 2
    truth_m = np.trapezoid(speed_mps, time_s)
    assert result.cycle.distance_m == pytest.approx(truth_m, rel=1e-6)


@pytest.mark.parametrize(("hertz", "long_s"), [(1, 2), (1, 6), (2, 2), (10, 2), (100, 0.5)])
def test_a_dropout_is_found_and_mended_as_a_whole(tmp_path, hertz, long_s):
    time_s = np.arange(60 * hertz + 1) / hertz
    speed_mps = np.full(len(time_s), 60 / 3.6)
    begins, count = 25 * hertz, int(long_s * hertz)
    speed_mps[begins : begins + count] = 0
    message = refusal(tmp_path, written(time_s, speed_mps))
    assert f"{count} faults ({count} spikes)" in message
    assert f"in lines {begins + 2} to {begins + count + 1} that are off as a whole" in message
    assert f"line {begins + 3}: speed 0 km/h is off as line {begins + 2} is" in message
    result = imported(tmp_path, written(time_s, speed_mps), repair=True)
    assert len(result.repairs) == count
    assert result.cycle.speed_mps == pytest.approx(60 / 3.6)


def test_what_holds_most_samples_is_the_drive_and_a_stop_that_brakes_bring_about_stays(tmp_path):
    # 4 s of an old value at the start; a full stop from 30 m/s in 4 s, 2 s at rest, and on.
    old = [50, 50, 50, 50]
    true = [0, 0, 4, 8, 16, 24, 30, 30, 22.5, 15, 7.5, 0, 0, 0, 4, 8, 16, 24, 30, 30]
    text = written(np.arange(24.0), np.array(old + true))
    assert "4 faults (4 spikes)" in (message := refusal(tmp_path, text, repair=False))
    assert "in lines 2 to 5 that are off" in message
    assert "speed 180 km/h against 0 km/h of line 6, 1 s apart: 50 m/s²" in message
    result = imported(tmp_path, text, repair=True)
    assert result.cycle.speed_mps == pytest.approx([0, 0, 0, 0, *true])
    assert not imported(tmp_path, written(np.arange(20.0), np.array(true))).repairs


def test_many_wild_samples_end_in_a_message_soon(tmp_path):
    rng = np.random.default_rng(4)
    text = written(np.arange(30_000) / 10, rng.uniform(0, 60, 30_000))
    began = process_time()
    assert "more than the 25% that --repair changes" in refusal(tmp_path, text, repair=True)
    assert process_time() - began < 10


@pytest.mark.parametrize("repair", [False, True])
def test_a_log_of_several_rates_is_told_what_to_do(tmp_path, repair):
    rows = [f"{t / 10},{t / 20 if t % 5 == 0 else ''},900\n" for t in range(101)]
    head = "time_s,speed_mps,rpm\n"
    message = refusal(tmp_path, head + "".join(rows), repair=repair)
    assert "21 of 101 lines have a speed" in message and "keep the lines with a speed" in message
    assert imported(tmp_path, head + "".join(rows[::5])).cycle.duration_s == 10
    missing = PLAIN.replace("5,36", "5,")
    assert "lines have a speed" not in refusal(tmp_path, "time_s,speed_kmh\n" + missing)


def test_a_usual_step_of_many_seconds_is_told(tmp_path):
    rows = "".join(f"{1000 * t},{v}\n" for t, v in enumerate(DRIVE_KMH))
    (hint,) = imported(tmp_path, "time_s,speed_kmh\n" + rows).hints
    assert "usual step of the file is 1000 s" in hint and "--time-unit ms" in hint
    assert not imported(tmp_path, "time,speed_kmh\n" + rows, units={"time": "ms"}).hints


@pytest.mark.parametrize(
    "header", ["elapsed_s,v_Ist [km/h]", "t [s],veh_spd_kmh", "cyc_time_s,ground_speed_kmh"]
)
@pytest.mark.parametrize("separator", [",", "|"])
def test_more_names_and_bars_are_read(tmp_path, header, separator):
    expected = imported(tmp_path, "time_s,speed_kmh\n" + PLAIN)
    text = f"{header}\n{PLAIN}".replace(",", separator)
    assert columns(imported(tmp_path, text, "other.csv").text) == columns(expected.text)
