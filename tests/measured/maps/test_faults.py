"""Maps that people have: own loads at every speed, holes, points that the engine cannot reach, curves down to 0."""

from pathlib import Path

import numpy as np
import pytest

from hevopt.car_files.text import component_text
from hevopt.errors import DataError
from hevopt.measured.maps.engine import import_engine
from hevopt.measured.maps.machine import import_machine
from hevopt.measured.maps.report import coverage
from hevopt.measured.maps.request import Request
from hevopt.measured.maps.tables import Source

FILES = Path(__file__).parents[1] / "faults"
LIKE = "engine_diesel_1600"
KGPH = {"fuel": "kg/h"}


def source(path: Path | str, units=None, extra: bool = False) -> Source:
    return Source(FILES / path, None, {}, units or {}, None, extra)


def engine(path, *, full=None, motoring=None, units=None, idle_rpm=1000, nox=None, **given):
    extra = {"full": full, "motoring": motoring, "nox": nox}
    extra = {role: source(p, units, True) for role, p in extra.items() if p is not None}
    given = {"idle_rpm": idle_rpm, "displacement_cm3": 1600, **given}
    return import_engine(Request(source(path, units), extra, LIKE, given))


def machine(path, full=None):
    extra = {} if full is None else {"full": source(full, extra=True)}
    return import_machine(Request(source(path), extra, None, {}))


def said(imported, start: str) -> str:
    """The line of the report that begins so."""
    return next(line for line in coverage(imported) if line.startswith(start))


def written(tmp_path, text: str, name: str = "x.csv") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


def grid_text(speeds, torques, value) -> str:
    """A grid with the cells that `value` gives; None leaves one empty."""
    lines = [",".join([r"speed [rpm] \ torque [Nm]", *(f"{t:g}" for t in torques)])]
    for n in speeds:
        cells = [value(n, t) for t in torques]
        lines.append(",".join([f"{n:g}", *("" if v is None else f"{v:.6g}" for v in cells)]))
    return "\n".join(lines) + "\n"


def long_text(speeds, torques, value, *, with_empty: bool) -> str:
    rows = ["speed [rpm],torque [Nm],fuel [kg/h]"]
    for n in speeds:
        for t in torques:
            v = value(n, t)
            if v is not None or with_empty:
                rows.append(f"{n:g},{t:g},{'' if v is None else f'{v:.6g}'}")
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize("name", ["engine_round_torques.csv", "engine_nearly_round_torques.csv"])
def test_round_torques_of_their_own_at_every_speed_are_no_grid(name):
    curves = "engine_round_torques_full.csv"
    imported = engine(name, full=curves, motoring=curves)
    assert said(imported, "coverage").startswith("coverage: 100.0% of the area")
    assert said(imported, "holes") == "holes: none"


def test_a_machine_keeps_the_triangles_around_a_missing_cell_and_names_it():
    imported = machine("motor_nan.csv")
    share = float(said(imported, "coverage").split()[1].rstrip("%"))
    assert share == pytest.approx(50, abs=1)  # of each of four cells the half without it
    assert said(imported, "holes") == "holes: 2: 2000 rpm, -50 Nm; 2000 rpm, 50 Nm"
    assert any("1 points not measured, line 6" in note for note in imported.notes)
    at = imported.grid.at(np.array([10.0, 90.0]), np.array([500.0, 3500.0]) * np.pi / 30)
    assert np.isfinite(at).all()


def test_a_cell_that_is_gone_is_one_hole_in_a_table_as_in_a_grid():
    reports = [
        coverage(engine(f"engine_cell_gone_{form}.csv", units=KGPH, idle_rpm=1200))
        for form in ("long", "grid")
    ]
    assert reports[0] == reports[1]
    assert "holes: 1: 2400 rpm, 40 Nm" in reports[0]


def test_a_column_mostly_not_measured_is_named_cell_by_cell():
    imported = engine("engine_nan_col.csv", units=KGPH)
    assert said(imported, "holes") == "holes: 3: 2000 rpm, 100 Nm; 3000 rpm, 100 Nm; 4000 rpm, 100 Nm"  # fmt: skip
    assert said(imported, "coverage").startswith("coverage: 39.1% of the area")


SPEEDS, TORQUES = (1000, 2000, 3000, 4000), tuple(range(0, 161, 20))


def burnt(n, t):
    return (t + 20) * n * 2.2e-5


def with_a_hole(n, t):
    return None if (n, t) in ((2000, 60), (3000, 100)) else burnt(n, t)


def up_to_full_load(n, t):
    return None if t > {1000: 100, 2000: 160, 3000: 140, 4000: 120}[n] else burnt(n, t)


def every_other(n, t):
    return burnt(n, t) if t in (0, 160) or (t / 20 + n / 1000) % 2 == 0 else None


@pytest.mark.parametrize("value", [burnt, with_a_hole, up_to_full_load, every_other])
def test_a_table_and_a_grid_of_the_same_points_are_the_same_map(tmp_path, value):
    texts = {
        "grid.csv": grid_text(SPEEDS, TORQUES, value),
        "long.csv": long_text(SPEEDS, TORQUES, value, with_empty=False),
        "long_empty.csv": long_text(SPEEDS, TORQUES, value, with_empty=True),
    }
    maps = [engine(written(tmp_path, text, name), units=KGPH) for name, text in texts.items()]
    for other in maps[1:]:
        for part in ("speed_radps", "torque_nm", "values"):
            a, b = getattr(maps[0].grid, part), getattr(other.grid, part)
            np.testing.assert_allclose(a, b, rtol=1e-6)
        assert coverage(maps[0])[1:] == coverage(other)[1:]
    holes = said(maps[0], "holes")
    assert holes == (
        "holes: 2: 2000 rpm, 60 Nm; 3000 rpm, 100 Nm" if value is with_a_hole else "holes: none"
    )


def test_full_load_points_of_their_own_beside_shared_torques_leave_no_holes(tmp_path):
    tops = {1000: 125, 2000: 165, 3000: 122, 4000: 110}
    rows = ["speed [rpm],torque [Nm],fuel [kg/h]"]
    for n, top in tops.items():
        rows += [f"{n},{t},{burnt(n, t):.6g}" for t in (*range(0, top, 10), top)]
    imported = engine(written(tmp_path, "\n".join(rows)))
    assert said(imported, "holes") == "holes: none"
    assert said(imported, "coverage").startswith("coverage: 100.0%")


def test_nox_at_fewer_points_than_fuel_is_not_thrown_away(tmp_path):
    rows = ["speed [rpm],torque [Nm],fuel [kg/h],nox [g/h]"]
    for n in (*SPEEDS, 5000):
        for t in TORQUES:
            nox = f"{burnt(n, t) * 5:.6g}" if n != 3000 and t % 40 == 0 else ""
            rows.append(f"{n},{t},{burnt(n, t):.6g},{nox}")
    imported = engine(written(tmp_path, "\n".join(rows)))
    grid = imported.nox[0]
    assert np.isfinite(grid.values[:, grid.torque_nm >= 0]).all()
    middle = grid.at(np.array(100.0), np.array(3000 * np.pi / 30))
    assert middle == pytest.approx(burnt(3000, 100) * 5e-3 / 3600, rel=1e-6)


def test_points_beyond_full_load_count_for_nothing():
    imported = engine("engine_peak_beyond_full_load.csv", full="engine_peak_full.csv")
    # 100 Nm x 104.72 rad/s / (2.60 kg/h x 42.9 MJ/kg) = 0.338
    best = "peak efficiency: 33.8% (248.3 g/kWh) at 1000 rpm, 100 Nm"
    assert said(imported, "peak") == best
    assert said(imported, "grid against").startswith("grid against 7 measured points")
    assert any("1 points were measured above full load" in line for line in coverage(imported))


def test_what_lies_beyond_full_load_or_below_idle_is_no_fault_of_the_map(tmp_path):
    def value(n, t):
        return burnt(n, t) * (0.3 if t > 120 or n < 1500 else 1)

    full = written(tmp_path, "speed [rpm],full load [Nm]\n1000,120\n4000,120\n", "full.csv")
    path = written(tmp_path, grid_text(SPEEDS, TORQUES, value))
    report = coverage(engine(path, full=full, units=KGPH, idle_rpm=2000))
    assert "fuel falling as torque rises at one speed: none" in report
    # (120 / 140) of 1 / (2.2e-5 kg/h / (Nm rpm) x 42.9 MJ/kg), at any speed
    peak = 120 / 140 * np.pi / 30 * 3600 / 2.2e-5 / 42.9e6
    assert next(s for s in report if s.startswith("peak")).startswith(f"peak efficiency: {peak:.1%}")  # fmt: skip


def test_a_machines_best_point_lies_within_its_full_load(tmp_path):
    rows = ["speed [rpm],torque [Nm],loss [W]"]
    for n in (0, 2000, 4000):
        loss = {t: 20 + n / 20 + t * (2 if t < 80 else 0.1) for t in range(0, 101, 20)}
        rows += [f"{n},{t},{loss[t]}" for t in loss]
    full = written(tmp_path, "speed [rpm],torque [Nm]\n0,70\n4000,50\n", "full.csv")
    imported = machine(written(tmp_path, "\n".join(rows)), full)
    power, loss = 50 * 4000 * np.pi / 30, 20 + 200 + 2 * 50
    assert said(imported, "peak efficiency motoring") == (
        f"peak efficiency motoring: {power / (power + loss):.1%} at 4000 rpm, 50 Nm"
    )


@pytest.mark.parametrize("last", ["0", "-3"])
def test_a_full_load_curve_is_read_to_its_last_positive_point(tmp_path, last):
    text = f"speed [rpm],torque [Nm]\n1000,120\n3000,140\n4000,100\n4500,{last}\n"
    path = written(tmp_path, grid_text(SPEEDS, TORQUES, burnt))
    imported = engine(path, full=written(tmp_path, text, "full.csv"), units=KGPH)
    assert imported.file.full_load.speed_rpm == pytest.approx([1000, 3000, 4000])
    note = next(note for note in imported.notes if note.startswith("full curve"))
    assert f"{last} Nm at 4500 rpm: READ TO ITS LAST POINT ABOVE 0, at 4000 rpm" in note
    part = machine("motor_nan.csv", written(tmp_path, text, "full.csv"))
    assert part.file.speed_max_rpm == pytest.approx(4000)
    assert any("LAST POINT ABOVE 0" in note for note in part.notes)


def test_a_line_dragged_only_ends_full_load_before_it(tmp_path):
    def value(n, t):
        return burnt(n, t) if n < 4000 else (0.5 if t == 0 else None)

    imported = engine(written(tmp_path, grid_text(SPEEDS, TORQUES, value)), units=KGPH)
    assert imported.file.full_load.speed_rpm[-1] == pytest.approx(3000)
    assert any("at 4000 rpm: READ TO ITS LAST POINT" in note for note in imported.notes)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("1000,120\n2000,0\n3000,140\n", "full-load torque 0 Nm at 2000 rpm, between"),
        ("1000,0\n2000,0\n3000,140\n", "1 speeds with a torque above 0"),
        ("0,0\n1500,120\n3000,140\n", "idle_rpm 1000 lies outside the full-load curve, 1500"),
    ],
)
def test_a_full_load_curve_that_cannot_be_read_so_is_one_message(tmp_path, rows, words):
    path = written(tmp_path, grid_text(SPEEDS, TORQUES, burnt))
    full = written(tmp_path, "speed [rpm],torque [Nm]\n" + rows, "full.csv")
    with pytest.raises(DataError, match=words):
        engine(path, full=full, units=KGPH)


def test_another_engines_fuel_is_a_warning_that_names_what_is_inherited(tmp_path):
    path = written(tmp_path, grid_text(SPEEDS, TORQUES, burnt))

    def warning(**given):
        notes = engine(path, units=KGPH, **given).notes
        return next((note for note in notes if note.startswith("WARNING: the fuel")), "")

    assert "density_kgpl 0.835" in warning() and "heating_value_mjpkg 42.9" in warning()
    part = warning(**{"fuel.density_kgpl": 0.745, "fuel.heating_value_mjpkg": 42.6})
    assert "co2_kgpkg" in part and "density" not in part.split(":")[2].split(";")[0]
    fuel = {"heating_value_mjpkg": 42.6, "density_kgpl": 0.745, "co2_kgpkg": 3.1}
    assert warning(fuel=fuel) == ""


def test_drag_of_a_measured_engine_is_not_extrapolated_for_another(tmp_path):
    short = grid_text((1000, 2000, 3000), TORQUES, burnt)
    other = engine(written(tmp_path, short, "short.csv"), units=KGPH)
    text = component_text([], other.contents, other.origins)
    like = str(written(tmp_path, text, "short.toml"))
    path = written(tmp_path, grid_text(SPEEDS, TORQUES, burnt))
    request = Request(source(path, KGPH), {}, like, {"idle_rpm": 1000})
    ends = "motoring curve covers 1000 to 3000 rpm, the map 1000 to 4000"
    with pytest.raises(DataError, match=ends):
        import_engine(request)
