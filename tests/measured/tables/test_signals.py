"""Logs with one signal a row, as Car Scanner writes them."""

import numpy as np
import pytest
from drive_files import imported, refusal

from hevopt.measured.tables import signals

HEADER = '\ufeff"SECONDS";"PID";"VALUE";"UNITS";"LATITUDE";"LONGTITUDE";\n'


def row(time, signal, value, unit):
    return f'"{time}";"{signal}";"{value}";"{unit}";"40.1";"14.7";\n'


def log(speed="Vehicle speed", seconds=60, gps="Speed (GPS)"):
    """1 km/h more a second; the engine's speed and the satellites' at other moments, 2 % up."""
    rows = []
    for second in range(seconds):
        rows += [
            row(f"{40_000 + second}.101", "Engine RPM", 900 + second, "rpm"),
            row(f"{40_000 + second}.25", speed, second, "km/h"),
            row(f"{40_000 + second}.5", gps, second / 3.6, "m/s"),
            row(f"{40_000 + second}.5", "Altitude (GPS)", 100 + second**2 / 360, "m"),
        ]
    return HEADER + "".join(rows)


def test_the_rows_of_the_cars_speed_are_the_drive(tmp_path):
    result = imported(tmp_path, log())
    assert result.cycle.speed_mps * 3.6 == pytest.approx(np.arange(60), abs=1e-5)
    assert "one signal a row: 4 signals" in result.assumptions
    assert "speed: Vehicle speed in km/h (units of the signal's rows)" in result.assumptions
    by_gps = imported(tmp_path, log(), columns={"speed": "Speed (GPS)"})
    assert by_gps.cycle.speed_mps * 3.6 == pytest.approx(np.arange(60), abs=1e-5)


def test_other_signals_are_drawn_between_their_samples(tmp_path):
    columns = {"altitude": "Altitude (GPS)"}
    result = imported(tmp_path, log(seconds=300), columns=columns, altitude_baseline_m=100)
    assert result.cycle.grade[100:299] == pytest.approx(np.full(199, 0.02), rel=0.02)


def test_speeds_in_another_language_are_asked_for_by_name(tmp_path):
    text = log("Скорость", gps="Скорость (GPS)")
    said = refusal(tmp_path, text)
    assert "--column speed=" in said and "Скорость [km/h], Скорость (GPS) [m/s]" in said
    result = imported(tmp_path, text, columns={"speed": "Скорость"})
    assert result.cycle.speed_mps[-1] * 3.6 == pytest.approx(59)


def test_a_signal_in_two_units_is_two_signals(tmp_path):
    text = log() + row(40_060.25, "Vehicle speed", 60 / 1.609344, "mph")
    said = refusal(tmp_path, text)
    assert "columns Vehicle speed [km/h], Vehicle speed [mph] could all be meant" in said


def test_a_unit_with_control_characters_is_quoted_printable(tmp_path):
    said = refusal(tmp_path, log() + row(40_060.25, "Vehicle speed", 60, "km\x03h"))
    assert "columns Vehicle speed [km/h], Vehicle speed [km?h] could all be" in said


def test_a_value_that_is_no_number_is_a_fault_of_its_line(tmp_path):
    text = log().replace('"Vehicle speed";"7"', '"Vehicle speed";"off"')
    assert "line 31: speed is 'off'" in refusal(tmp_path, text)
    assert imported(tmp_path, text, repair=True).cycle.speed_mps[7] * 3.6 == pytest.approx(7)


def test_a_row_cut_short_is_named(tmp_path):
    assert "line 242: not a row of SECONDS, PID, VALUE" in refusal(
        tmp_path, log() + '"40060";"Veh\n'
    )


def test_a_header_that_runs_into_its_rows_is_quoted_shortly_and_printable(tmp_path):
    said = refusal(tmp_path, log().replace("\n", "\x0b").replace("Speed (GPS)", "Speed \x03"))
    assert "not a row of SECONDS, PID, VALUE" in said and "more; complete or remove it" in said
    assert said.isprintable() and len(said) < 500


def test_of_too_many_signals_those_of_a_drive_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(signals, "CELLS_MAX", 700)
    result = imported(tmp_path, log())
    assert result.cycle.speed_mps.max() * 3.6 == pytest.approx(59)
    assert "left out, signals without a unit of speed or length: Engine RPM" in result.assumptions
