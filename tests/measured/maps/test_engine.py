"""What `hevopt maps import` makes of an engine's points, against the formula that they were sampled from."""

from pathlib import Path

import numpy as np
import pytest
from map_bench import ENGINE, FUEL, LIKE, RPM, SPEEDS, bench, car_with, component, write
from numpy.testing import assert_allclose

from hevopt import load_architecture

IMPORT = ("maps", "import", "b.csv", "--kind", "engine", *LIKE)
CURVES = ("--full-load", "curves.csv", "--motoring", "curves.csv")
SPEED = np.array(SPEEDS) * RPM
FULL = ENGINE.full_load_nm(SPEED)
DRAG = ENGINE.drag_nm(SPEED)


def write_curves(share: float = 1.0, more_nm: float = 0.0) -> None:
    write("curves.csv", "n [rpm],full load [Nm],drag [Nm]", SPEEDS, FULL * share + more_nm, DRAG)


def imported_engine():
    return load_architecture(car_with("engine", "b.toml", "A")).engine


@pytest.mark.parametrize("apart", [False, True])
def test_nox_is_unknown_where_its_table_does_not_reach_and_right_where_it_does(hevopt, apart):
    rpm, torque, fuel, nox = bench().T
    reached = (rpm >= 1000) & (rpm <= 4500)
    write_curves()
    more = ()
    if apart:
        write("b.csv", "n [rpm],T [Nm],fuel [g/h]", rpm, torque, fuel)
        write("nox.csv", "n [rpm],T [Nm],NOx [g/h]", *(c[reached] for c in (rpm, torque, nox)))
        more = ("--nox", "nox.csv")
    else:
        blank = np.where(reached, nox, np.nan)
        write("b.csv", "n [rpm],T [Nm],fuel [g/h],NOx [g/h]", rpm, torque, fuel, blank)
    seen = hevopt(*IMPORT, *CURVES, *more)
    assert seen.status == 0, seen
    assert "idle NOx (850 rpm, torque 0): WARNING: not known" in seen.out
    lost = float(seen.out.split("WARNING: at ")[1].split("%")[0])
    area = np.trapezoid(FULL, SPEED)
    rest = np.trapezoid(FULL[1:-1], SPEED[1:-1])
    assert lost == pytest.approx(100 * (1 - rest / area), abs=1)
    engine = imported_engine()
    speed, share = np.meshgrid(np.linspace(850, 5000, 167) * RPM, np.linspace(0, 1, 40))
    load = share * engine.full_load_nm(speed)
    found = engine.nox_kgps(load, speed)
    inside = (speed >= 1000 * RPM) & (speed <= 4500 * RPM)
    assert np.isnan(found[~inside]).all() and not np.isnan(found[inside]).any()
    assert not np.isnan(engine.fuel_kgps(load, speed)).any()
    truth = ENGINE.nox_kgps(load, speed)
    assert_allclose(found[inside], truth[inside], rtol=0, atol=0.03 * truth.max())


def test_a_full_load_curve_a_hair_above_the_points_is_reached(hevopt):
    write("b.csv", "n [rpm],T [Nm],fuel [g/h],NOx [g/h]", *bench().T)
    write_curves(1.0001, 0.01)
    seen = hevopt(*IMPORT, *CURVES)
    assert "full load: up to 0.039 Nm (0.01%, at 1500 rpm) above the highest measured" in seen.out
    engine = imported_engine()
    speed = np.linspace(850, 5000, 800) * RPM
    truth = ENGINE.full_load_nm(speed)
    assert_allclose(engine.covered_nm(speed), truth, rtol=2e-6)
    assert (np.array(component("b.toml")["full_load"]["torque_nm"]) <= FULL.max() + 1e-3).all()


def test_a_full_load_curve_well_above_the_points_is_no_reason_to_go_beyond_them(hevopt):
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", *bench().T[:3])
    write_curves(np.where(SPEED > 3000 * RPM, 1.1, 1.01))
    seen = hevopt(*IMPORT, *CURVES)
    assert "full load: up to 2.9 Nm" in seen.out and "the map ends below the curve at" in seen.out
    engine = imported_engine()
    speed = np.linspace(850, 5000, 800) * RPM
    truth = ENGINE.full_load_nm(speed)
    covered = engine.covered_nm(speed)
    assert (covered <= truth * (1 + 1e-6)).all()
    assert_allclose(covered[speed < 2700 * RPM], truth[speed < 2700 * RPM], rtol=1e-4)


def test_corners_of_a_grid_that_hold_0_are_no_fuel(hevopt):
    rpm, torque, fuel, _ = bench().T
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", rpm, torque, np.where(torque > 260, 0.0, fuel))
    seen = hevopt(*IMPORT)
    lines = np.flatnonzero(torque > 260) + 2
    assert seen.status == 2 and f"lines {lines[0]}-" in seen.err, seen
    assert "fuel 0 at a torque above 0" in seen.err and "not measured empty" in seen.err


@pytest.mark.parametrize("digits", [1, 2, 3, 4])
def test_curves_in_rounded_rad_per_s_start_at_idle(hevopt, digits):
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", *bench().T[:3])
    write("curves.csv", "n [rad/s],full load [Nm],drag [Nm]", np.round(SPEED, digits), FULL, DRAG)
    seen = hevopt(*IMPORT, *CURVES)
    assert seen.status == 0, seen
    assert component("b.toml")["full_load"]["speed_rpm"][0] == pytest.approx(850, rel=1e-9)


def test_drag_above_0_is_turned_also_with_a_standstill_and_mixed_signs_are_named(hevopt):
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", *bench().T[:3])
    write("drag.csv", "n [rpm],drag [Nm]", [0, *SPEEDS], np.abs([0, *DRAG]))
    seen = hevopt(*IMPORT, "--motoring", "drag.csv")
    assert seen.status == 0 and "given as drag, sign turned" in seen.out, seen
    assert_allclose(imported_engine().drag_nm(SPEED), DRAG, rtol=1e-6)
    mixed = np.where(np.arange(len(SPEEDS)) == 4, 1, -1) * DRAG
    write("drag.csv", "n [rpm],drag [Nm]", SPEEDS, mixed)
    seen = hevopt(*IMPORT, "--motoring", "drag.csv")
    assert seen.status == 2 and "line 6: the motoring torque" in seen.err, seen
    assert "has the other sign" in seen.err


@pytest.mark.parametrize(
    ("row", "said"),
    [("-900,50,400", ["line 6", "speed below 0"]), ("900,50,1e20", ["line 6", "fuel beyond any"])],
)
def test_what_no_bench_measures_is_named_with_its_line(hevopt, row, said):
    rows = ["n [rpm],T [Nm],fuel [g/h]", "800,0,400", "800,100,2000", "5000,0,3000", "5000,9,9000"]
    Path("b.csv").write_text("\n".join([*rows, row]) + "\n")
    seen = hevopt(*IMPORT)
    assert seen.status == 2 and all(words in seen.err for words in said), seen


def test_nox_of_a_table_of_its_own_is_reported_like_fuel(hevopt):
    rpm, torque, _, nox = bench(wander_rpm=4.0).T
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", *bench().T[:3])
    rows = [f"{a:.2f};{b:.2f};{c:.6f}" for a, b, c in zip(rpm, torque, nox, strict=True) if b >= 20]
    rows.append(f"{rpm[4]:.2f};{torque[4]:.2f};{nox[4] * 2:.6f}")
    Path("nox.csv").write_text("\n".join(["n [rpm];T [Nm];NOx [g/h]", *rows]).replace(".", ","))
    seen = hevopt(*IMPORT, "--nox", "nox.csv")
    assert seen.status == 0, seen
    for said in ("nox.csv: UTF-8, separated by semicolons", "nox.csv: decimal comma",
                 "nox.csv: nox: NOx [g/h] in g/h", "nox.csv: 15 speed lines; points moved to them by up to",
                 "nox.csv: 1 points measured more than once, averaged",
                 f"nox.csv: WARNING: repeats differ by up to 67% of their average, lines 3, {len(rows) + 1}",
                 "below the lowest measured torque (20 Nm), linear", "idle NOx (850 rpm, torque 0): "):  # fmt: skip
        assert said in seen.out, seen.out
    covered = float(seen.out.split("NOx: ")[-1].split("%")[0])
    assert covered == pytest.approx(100 * (1 - 20 / FULL.mean()), abs=2)


@pytest.mark.parametrize("keep", ["one speed", "one torque"])
def test_nox_of_one_line_of_points_is_named(hevopt, keep):
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", *bench().T[:3])
    rpm, torque, _, nox = bench().T
    if keep == "one speed":
        rpm = np.full(len(rpm), rpm[0])
    else:
        torque = np.full(len(torque), 50.0)
    write("nox.csv", "n [rpm],T [Nm],NOx [g/h]", rpm, torque, nox)
    seen = hevopt(*IMPORT, "--nox", "nox.csv")
    assert seen.status == 2 and "Warning" not in seen.err, seen
    assert "nox.csv: NOx at one speed or one torque alone" in seen.err, seen.err


def test_points_of_the_dragged_engine_are_no_doubt_about_the_map(hevopt):
    rpm, torque, fuel, _ = bench().T
    columns = ([*rpm, *SPEEDS], [*torque, *DRAG], [*fuel, *np.zeros(len(SPEEDS))])
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", *columns)
    seen = hevopt(*IMPORT, *FUEL)
    assert "motoring curve: highest torque without fuel at each speed" in seen.out
    assert "WARNING" not in seen.out, seen.out


def test_a_hole_is_said_to_be_filled_only_where_it_is(hevopt):
    rpm, torque, fuel, _ = bench((0, *range(10, 271, 20)), False).T
    hole = (rpm > 1600) & (rpm < 2900) & (torque > 60) & (torque < 190)
    table = np.full((len(SPEEDS), 15), np.nan)
    torques = sorted(set(torque))
    for r, t, f, gone in zip(rpm, torque, fuel, hole, strict=True):
        table[SPEEDS.index(r), torques.index(t)] = np.nan if gone else f
    rows = [",".join([f"{s}", *("" if np.isnan(x) else f"{x:.6g}" for x in row)])
            for s, row in zip(SPEEDS, table, strict=True)]  # fmt: skip
    head = ",".join(["n [rpm] \\ T [Nm]", *(f"{t:g}" for t in torques)])
    Path("b.csv").write_text("\n".join([head, *rows]) + "\n")
    seen = hevopt(*IMPORT, "--unit", "fuel=g/h")
    assert "a hole in the measurement, not filled: what a car asks for there" in seen.out, seen.out
    # Holes amid the map are named before those at its edge.
    at = float(seen.out.split("holes: ")[1].split(": ")[1].split(" rpm")[0])
    assert 1600 < at < 2900


def test_the_plot_colours_what_a_car_can_use_and_nothing_else(hevopt):
    from matplotlib.image import imread

    rpm, torque, fuel, nox = bench(full=False).T
    fuel[(rpm == 2000) & (torque > 90) & (torque < 160)] = np.nan
    write("b.csv", "n [rpm],T [Nm],fuel [g/h],NOx [g/h]", rpm, torque, fuel, nox)
    write_curves()
    assert hevopt(*IMPORT, *CURVES).status == 0
    engine = imported_engine()
    picture = imread("b.png")[..., :3]
    # The frame of the axes is black, and spans the full-load curve and the map with a margin of 5 %.
    dark = picture.max(axis=2) < 0.1
    columns, rows = np.flatnonzero(dark.mean(axis=0) > 0.8), np.flatnonzero(dark.mean(axis=1) > 0.8)
    left, right, top, bottom = columns[0], columns[-1], rows[0], rows[-1]
    green = np.abs(picture - picture[bottom - 60, right - 60]).max(axis=2) < 0.02
    column, row = (np.arange(a, b) for a, b in ((left + 2, right), (top + 2, bottom)))
    low, high = engine.law.torque_nm[0], 290.0
    speed = 850 + 4150 * ((column + 0.5 - left) / (right + 1 - left) * 1.1 - 0.05)
    load = low + (high - low) * ((bottom + 0.5 - row) / (bottom + 1 - top) * 1.1 - 0.05)
    speed, load = np.meshgrid(speed * RPM, load)
    flow = engine.fuel_kgps(load, speed) + engine.nox_kgps(load, speed)
    usable = ~np.isnan(flow) & (load <= engine.full_load_nm(speed))
    usable &= (load >= engine.drag_nm(speed)) & (speed <= SPEED[-1])
    shown = green[row[0] : row[-1] + 1, column[0] : column[-1] + 1]
    # Points, lines and hatches are drawn over the colour, and edges fall within pixels.
    assert (shown & ~usable).mean() < 0.005 and (usable & ~shown).mean() < 0.1


@pytest.mark.parametrize(
    "corner", ["speed [rpm]/torque [Nm]", "Drehzahl [1/min] / Drehmoment [Nm]"]
)
def test_a_grid_may_part_its_axes_with_a_slash(hevopt, corner):
    fuel = bench((10, 50, 90), False)[:, 2]
    table = np.reshape(fuel, (len(SPEEDS), 3))
    rows = [
        f"{s},{','.join(f'{x:.6g}' for x in row)}" for s, row in zip(SPEEDS, table, strict=True)
    ]
    Path("b.csv").write_text("\n".join([f"{corner},10,50,90", *rows]) + "\n")
    seen = hevopt(*IMPORT, "--unit", "fuel=g/h")
    assert seen.status == 0, seen
    found = component("b.toml")["fuel_map"]
    first = found["torque_nm"].index(10)
    assert_allclose(np.array(found["fuel_gps"])[:, first:] * 3600, table, rtol=1e-5)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--unit", "speed"), "--unit 'speed' is not of the form ROLE=VALUE"),
        (("--unit", "speed="), "is not of the form ROLE=VALUE"),
        (("--unit", "speed=rpm", "--unit", "speed=rad/s"), "gives speed twice"),
    ],
)
def test_an_option_of_pairs_is_checked_alike_in_every_command(hevopt, words, said):
    write("b.csv", "n,T [Nm],fuel [g/h]", *bench().T[:3])
    seen = hevopt(*IMPORT, *words)
    assert seen.status == 2 and said in seen.err, seen


def test_a_file_that_no_import_has_written_is_not_replaced(hevopt):
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", *bench().T[:3])
    for name in ("b.toml", "b.png"):
        Path(name).write_text("mine")
        seen = hevopt(*IMPORT)
        assert seen.status == 2 and f"{name} exists, and hevopt maps import has not" in seen.err
        assert Path(name).read_text() == "mine"
        Path(name).unlink()
    assert hevopt(*IMPORT).status == 0 and hevopt(*IMPORT).status == 0


def test_a_division_by_0_of_a_spreadsheet_is_a_point_without_power(hevopt):
    rpm, torque, fuel, _ = bench(full=False).T
    specific = [f"{f / (r * RPM * t / 1e3):.7g}" if t else "#DIV/0!"
                for r, t, f in zip(rpm, torque, fuel, strict=True)]  # fmt: skip
    rows = [f"{r:g},{t:g},{b}" for r, t, b in zip(rpm, torque, specific, strict=True)]
    Path("b.csv").write_text("\n".join(["n [rpm],T [Nm],be [g/kWh]", *rows]) + "\n")
    seen = hevopt(*IMPORT)
    assert seen.status == 0 and "fuel: 15 points not measured, lines 2, " in seen.out, seen
