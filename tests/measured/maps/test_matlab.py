"""Maps as MATLAB files keep them: axes and a matrix over both, whichever way it lies, and ADVISOR's names."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from hevopt.errors import DataError
from hevopt.measured.maps.engine import import_engine
from hevopt.measured.maps.machine import import_machine
from hevopt.measured.maps.report import coverage
from hevopt.measured.maps.request import Request
from hevopt.measured.maps.tables import Source

SPEED_RPM, TORQUE_NM = np.array([1000.0, 2000, 3000, 4000]), np.array([10.0, 40, 80, 120, 160])
RADPS = SPEED_RPM * np.pi / 30
FUEL_GPS = np.outer(RADPS, TORQUE_NM + 20) / 0.4 / 42.9e3
FULL_NM, DRAG_NM = np.array([110.0, 160, 150, 120]), np.array([-15.0, -18, -22, -28])
GIVEN = {
    "displacement_cm3": 1600, "bore_mm": 80.0, "stroke_mm": 80.0, "idle_rpm": 1000, "inertia_kgm2": 0.2,
    "start_fuel_g": 0.2, "fuel": {"heating_value_mjpkg": 42.9, "density_kgpl": 0.835, "co2_kgpkg": 3.16},
}  # fmt: skip


def engine(tmp_path, variables, *, columns=None, units=None, rows=None, full=False, form="5"):
    path = tmp_path / "map.mat"
    scipy.io.savemat(path, variables, format=form)
    source = Source(path, None, columns or {}, units or {}, rows)
    extra = {"full": Source(path, None, {}, units or {}, rows, True)} if full else {}
    return import_engine(Request(source, extra, "engine_diesel_1600", GIVEN))


def fuel_at(imported, torque_nm, rpm):
    return float(imported.grid.at(np.array(torque_nm), np.array(rpm * np.pi / 30))) * 1e3


def check(imported):
    for rpm, torque in ((1000, 10), (1500, 60), (4000, 80), (2700, 133)):
        by_hand = rpm * np.pi / 30 * (torque + 20) / 0.4 / 42.9e3
        assert fuel_at(imported, torque, rpm) == pytest.approx(by_hand, rel=1e-9)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("form", ["4", "5"])
def test_axes_and_a_matrix_are_a_map_whichever_way_it_lies(tmp_path, turned, form):
    matrix = FUEL_GPS.T if turned else FUEL_GPS
    variables = {"speed_rpm": SPEED_RPM, "torque_nm": TORQUE_NM, "fuel_gps": matrix, "note": 3.0}
    imported = engine(tmp_path, variables, form=form)
    check(imported)
    notes = imported.notes
    assert notes[0] == "MATLAB file, grid of 4 speeds and 5 torques"
    assert "measured on a rectangular grid, used as it is" in notes


def test_matrices_of_speed_and_torque_are_a_map(tmp_path):
    speed, torque = np.meshgrid(SPEED_RPM, TORQUE_NM)
    variables = {"n_rpm": speed, "T_Nm": torque, "fuel_gps": FUEL_GPS.T}
    check(engine(tmp_path, variables))


def test_fields_of_a_structure_are_a_map(tmp_path):
    fields = {"speed_rpm": SPEED_RPM, "torque_nm": TORQUE_NM, "fuel_gps": FUEL_GPS}
    check(engine(tmp_path, {"engine": fields}))


@pytest.mark.parametrize("size", [4, 5])
def test_advisors_names_need_no_options(tmp_path, size):
    variables = {
        "fc_map_spd": RADPS, "fc_map_trq": TORQUE_NM[:size], "fc_fuel_map": FUEL_GPS[:, :size],
        "fc_nox_map": FUEL_GPS[:, :size] / 100, "fc_max_trq": np.minimum(FULL_NM, 20 * size + 40),
        "fc_ct_trq": DRAG_NM, "fc_fuel_den": 0.835, "fc_description": "x",
    }  # fmt: skip
    imported = engine(tmp_path, variables)
    assert imported.file.full_load.speed_rpm == pytest.approx(SPEED_RPM)
    assert imported.file.full_load.torque_nm == pytest.approx(variables["fc_max_trq"])
    assert imported.file.fuel_map.motoring_torque_nm == pytest.approx(DRAG_NM)
    assert fuel_at(imported, 60, 1500) == pytest.approx(1500 * np.pi / 30 * 80 / 0.4 / 42.9e3)
    nox = imported.nox[0].at(np.array(60.0), np.array(1500 * np.pi / 30))
    assert nox * 1e5 == pytest.approx(fuel_at(imported, 60, 1500), rel=1e-9)
    assert "speed: fc_map_spd in rad/s (MATLAB convention of fc_map_spd)" in imported.notes
    assert "holes: none" in coverage(imported)


def test_full_load_named_as_a_file_is_that_curve_and_not_the_axis(tmp_path):
    axes = {"speed_rpm": SPEED_RPM, "torque_nm": TORQUE_NM[:4], "fuel_gps": FUEL_GPS[:, :4]}
    curve = {"max_torque_nm": FULL_NM}
    imported = engine(tmp_path, axes | curve, rows="speed", full=True)
    assert imported.file.full_load.torque_nm == pytest.approx(FULL_NM)
    with pytest.raises(DataError, match="no column of torque found"):
        engine(tmp_path, axes, rows="speed", full=True)


def test_a_machine_of_advisors_names(tmp_path):
    speed, torque = np.array([0.0, 100, 200, 300]), np.array([-40.0, -20, 0, 20, 40])
    efficiency = 0.9 - 0.001 * np.abs(torque) + 0 * speed[:, None]
    path = tmp_path / "motor.mat"
    scipy.io.savemat(
        path,
        {"mc_map_spd": speed, "mc_map_trq": torque, "mc_eff_map": efficiency, "mc_max_trq": np.full(4, 40.0)},
    )  # fmt: skip
    source = Source(path, None, {}, {}, None)
    extra = {"full": Source(path, None, {}, {}, None, True)}
    imported = import_machine(Request(source, extra, None, {}))
    loss = imported.grid.at(np.array([20.0, -40.0]), np.array([200.0, 300.0]))
    assert loss == pytest.approx([4000 * (1 / 0.88 - 1), 12000 * (1 - 0.86)])
    assert imported.file.full_load.torque_nm == pytest.approx(np.full(4, 40))


SQUARE = {"speed_rpm": SPEED_RPM, "torque_nm": TORQUE_NM[:4], "fuel_gps": FUEL_GPS[:, :4]}


def test_a_square_matrix_needs_telling_which_way_it_lies(tmp_path):
    with pytest.raises(DataError, match="4 speeds and as many torques: which way fuel_gps lies"):
        engine(tmp_path, SQUARE)
    turned = SQUARE | {"fuel_gps": SQUARE["fuel_gps"].T}
    for variables, rows in ((SQUARE, "speed"), (turned, "torque")):
        imported = engine(tmp_path, variables, rows=rows)
        assert fuel_at(imported, 60, 1500) == pytest.approx(1500 * np.pi / 30 * 80 / 0.4 / 42.9e3)


WHOLE = {"speed_rpm": SPEED_RPM, "torque_nm": TORQUE_NM, "fuel_gps": FUEL_GPS}


@pytest.mark.parametrize(
    ("variables", "terms", "words"),
    [
        (WHOLE, {"rows": "torque"}, "--rows torque, but fuel_gps of 4 speeds and 5 torques lies the other"),
        ({"speed_rpm": SPEED_RPM, "torque_nm": SPEED_RPM, "fuel_gps": SPEED_RPM}, {"rows": "speed"},
         "--rows is for a matrix over vectors of speed and torque"),
        (WHOLE | {"fuel_gps": FUEL_GPS[:3]}, {}, "map.mat"),
        (WHOLE | {"n_rpm": SPEED_RPM}, {}, "speed_rpm, n_rpm could all be meant; choose with --column speed"),
        ({"speed": SPEED_RPM, "torque_nm": TORQUE_NM, "fuel_gps": FUEL_GPS}, {}, "the unit of column speed is not"),
        (WHOLE | {"fuel_gps": FUEL_GPS * 1j}, {}, "map.mat"),
        ({"speed_rpm": np.zeros((0, 0)), "torque_nm": TORQUE_NM, "fuel_gps": FUEL_GPS}, {}, "no column of speed"),
        (WHOLE | {"speed_rpm": SPEED_RPM * np.array([1, 1, np.nan, 1])}, {}, "no speed; fill the cells"),
    ],
)  # fmt: skip
def test_what_is_no_map_is_one_message(tmp_path, variables, terms, words):
    with pytest.raises(DataError, match=words):
        engine(tmp_path, variables, **terms)


def test_a_named_variable_is_taken(tmp_path):
    variables = {"a": SPEED_RPM, "b": TORQUE_NM, "c": FUEL_GPS, "speed_rpm": SPEED_RPM[:2]}
    columns = {"speed": "a", "torque": "b", "fuel": "c"}
    units = {"speed": "rpm", "torque": "Nm", "fuel": "g/s"}
    check(engine(tmp_path, variables, columns=columns, units=units))


def test_variables_of_two_maps_are_told_apart_by_name(tmp_path):
    other = {"mc_map_spd": RADPS / 2, "mc_map_trq": TORQUE_NM[:4], "mc_eff_map": FUEL_GPS[:, :4]}
    own = {"fc_map_spd": RADPS, "fc_map_trq": TORQUE_NM[:4], "fc_fuel_map": FUEL_GPS[:, :4]}
    with pytest.raises(DataError, match="fc_map_spd, mc_map_spd could all be meant"):
        engine(tmp_path, own | other)
    columns = {"speed": "fc_map_spd", "torque": "fc_map_trq"}
    imported = engine(tmp_path, own | other, columns=columns)
    assert fuel_at(imported, 60, 1500) == pytest.approx(1500 * np.pi / 30 * 80 / 0.4 / 42.9e3)


def test_cells_that_were_not_measured_are_holes(tmp_path):
    fuel = FUEL_GPS.copy()
    fuel[1, 2] = np.nan
    report = coverage(engine(tmp_path, WHOLE | {"fuel_gps": fuel}))
    assert "holes: 1: 2000 rpm, 80 Nm" in report


def test_a_program_of_matlab_gets_the_steps(tmp_path):
    path = Path(tmp_path / "FC_SI41.m")
    path.write_text("fc_map_spd=[100 200]; % (rad/s)\nfc_map_trq=[10 20];\n")
    with pytest.raises(DataError, match="run it in MATLAB or Octave, and save what it made"):
        import_engine(Request(Source(path, None, {}, {}, None), {}, None, GIVEN))


def test_numbers_that_no_bench_writes_raise_no_warning(tmp_path):
    signalling = np.frombuffer(b"\1\0\0\0\0\0\xf0\x7f", "<f8")[0]
    fuel = FUEL_GPS.copy()
    fuel[2, 3], fuel[1, 1] = signalling, 1e-318
    curve = {"max_torque_nm": FULL_NM * [1, 1e-310, 1, 1]}
    report = coverage(engine(tmp_path, WHOLE | {"fuel_gps": fuel} | curve))
    assert "holes: 1: 3000 rpm, 120 Nm" in report


def test_what_is_no_column_is_named_where_a_column_is_missing(tmp_path):
    variables = {"speed_rpm": SPEED_RPM, "moment": TORQUE_NM}
    with pytest.raises(DataError) as error:
        engine(tmp_path, variables)
    said = "columns found: moment; left out, not of 5 rows of numbers: speed_rpm (1 x 4)"
    assert str(error.value).endswith(said)
