"""`hevopt maps import`: points of a bench to a component file, in whatever units and shape, nothing beyond them."""

import sys
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest
from map_bench import (
    ENGINE,
    FUEL,
    HEAT_JPKG,
    LIKE,
    OWN,
    RPM,
    SPEEDS,
    TORQUES,
    bench,
    car_with,
    component,
    write,
    write_motoring,
)
from numpy.testing import assert_allclose

from hevopt import compare, load_architecture


def test_nedc_fuel_of_a_measured_engine_is_that_of_its_coefficients(hevopt):
    rpm, torque, fuel, nox = bench(wander_rpm=3.0).T
    write_motoring()
    write(
        "bench.csv",
        "engine speed [1/min],torque [Nm],fuel consumption [g/h],NOx [g/h]",
        rpm,
        torque,
        fuel,
        nox,
    )
    seen = hevopt(
        "maps", "import", "bench.csv", "--kind", "engine", *LIKE, "--motoring", "motoring.csv"
    )
    assert seen.status == 0, seen
    for said in ("15 speed lines", "from engine_diesel_1600: displacement_cm3", "peak efficiency: 40.",
                 "idle fuel (850 rpm, torque 0): 0.09", "holes: none", "torque rises at one speed: none",
                 "full load: no curve given, so the highest torque measured"):  # fmt: skip
        assert said in seen.out
    coverage = float(seen.out.split("coverage: ")[1].split("%")[0])
    assert coverage > 99.5
    assert Path("bench.png").read_bytes().startswith(b"\x89PNG")
    measured = load_architecture(car_with("engine", "bench.toml", "A")).engine
    speed = np.linspace(measured.full_load_speed_radps[0], measured.speed_max_radps, 500)
    full = measured.full_load_nm(speed)
    at_full_load = measured.fuel_kgps(full, speed)
    assert_allclose(at_full_load, ENGINE.fuel_kgps(full, speed), rtol=0.03)
    for name, strategy in (("A", "baseline"), ("C2", "dp")):
        ours = car_with("engine", "bench.toml", name)
        rows = compare("nedc", [name, ours], [strategy]).rows
        assert rows[1].fuel_l_per_100km == pytest.approx(rows[0].fuel_l_per_100km, rel=5e-3)
        # Of plans that burn alike NOx differs, as the objective does not count it.
        loose = 3e-2 if strategy == "baseline" else 6e-2
        assert rows[1].nox_mg_per_km == pytest.approx(rows[0].nox_mg_per_km, rel=loose)


UNITS = {
    "rpm": ("speed [rpm]", lambda p: p[0]),
    "rad/s": ("speed [rad/s]", lambda p: p[0] * RPM),
    "Nm": ("torque [Nm]", lambda p: p[1]),
    "kW": ("power [kW]", lambda p: p[1] * p[0] * RPM / 1e3),
    "bar": ("BMEP [bar]", lambda p: 4 * pi * p[1] / 1598e-6 / 1e5),
    "g/s": ("fuel [g/s]", lambda p: p[2] / 3600),
    "kg/h": ("fuel [kg/h]", lambda p: p[2] / 1e3),
    "g/kWh": ("BSFC [g/kWh]", lambda p: p[2] / (p[0] * RPM * p[1] / 1e3)),
    "fraction": ("efficiency [-]", lambda p: p[0] * RPM * p[1] / (p[2] * HEAT_JPKG / 3.6e6)),
    "%": ("efficiency [%]", lambda p: 100 * p[0] * RPM * p[1] / (p[2] * HEAT_JPKG / 3.6e6)),
    "l/h": ("fuel flow [l/h]", lambda p: p[2] / 1e3 / 0.835),
    "NOx g/h": ("NOx [g/h]", lambda p: p[3]),
    "NOx mg/s": ("NOx [mg/s]", lambda p: p[3] / 3.6),
    "NOx g/kWh": ("NOx [g/kWh]", lambda p: p[3] / (p[0] * RPM * p[1] / 1e3)),
}


@pytest.mark.parametrize(
    ("path", "full"),
    [("rad/s Nm g/s|NOx mg/s", False), ("rpm bar kg/h|NOx g/kWh", True), ("rad/s bar g/kWh|NOx g/h", False),
     ("rpm Nm fraction|NOx g/h", False), ("rad/s bar %|NOx mg/s", True), ("rpm Nm l/h|NOx g/h", False),
     ("rpm kW g/s|NOx g/h", True)],
)  # fmt: skip
def test_every_unit_path_gives_the_same_component(hevopt, path, full):
    points = bench(TORQUES[1:], full).T
    write_motoring()
    found = []
    for k, way in enumerate(("rpm Nm kg/h|NOx g/h", path)):
        flows, nox = way.split("|")
        names, values = zip(*(UNITS[u] for u in [*flows.split(), nox]), strict=True)
        write(f"b{k}.csv", ",".join(names), *(value(points) for value in values))
        arguments = (
            "--kind",
            "engine",
            *LIKE,
            "--motoring",
            "motoring.csv",
            "--set",
            "name=b",
            *OWN,
        )
        assert hevopt("maps", "import", f"b{k}.csv", *arguments).status == 0
        found.append(component(f"b{k}.toml"))
    assert found[0].keys() == found[1].keys()
    for table in ("full_load", "fuel_map"):
        assert found[0][table].keys() == found[1][table].keys()
        for key, expected in found[0][table].items():
            scale = np.nanmax(np.abs(expected))
            assert_allclose(found[1][table][key], expected, rtol=0, atol=2e-6 * scale, err_msg=key)


def grid_text(corner: str, values: np.ndarray) -> str:
    head = ";".join([corner, *(f"{t:g}" for t in TORQUES[1:])])
    rows = [
        ";".join([f"{s}", *("" if np.isnan(x) else f"{x:.9g}" for x in row)])
        for s, row in zip(SPEEDS, values, strict=True)
    ]
    return "\n".join([head, *rows]).replace(".", ",") + "\n"


def lattice() -> tuple[np.ndarray, np.ndarray]:
    """(speed, torque) fuel and NOx, g/h; corners above full load not measured."""
    fuel = np.full((len(SPEEDS), len(TORQUES) - 1), np.nan)
    nox = fuel.copy()
    for rpm, torque, f, n in bench(TORQUES[1:], False):
        place = SPEEDS.index(rpm), TORQUES[1:].index(torque)
        fuel[place], nox[place] = f, n
    return fuel, nox


def test_a_grid_with_masked_corners_works_unchanged(hevopt):
    fuel, nox = lattice()
    write_motoring()
    Path("fuel.csv").write_text(grid_text("n [rpm] \\ T [Nm]", fuel))
    Path("nox.csv").write_text(grid_text("n [rpm] \\ T [Nm]", nox))
    seen = hevopt("maps", "import", "fuel.csv", "--kind", "engine", *LIKE, "--motoring", "motoring.csv",
                  "--nox", "nox.csv", "--unit", "fuel=g/h", "--unit", "nox=g/h")  # fmt: skip
    assert seen.status == 0, seen
    assert "measured on a rectangular grid, used as it is" in seen.out
    table = component("fuel.toml")["fuel_map"]
    assert table["speed_rpm"] == list(SPEEDS)
    first = table["torque_nm"].index(TORQUES[1])
    assert table["torque_nm"][first:] == list(TORQUES[1:])
    for key, measured in (("fuel_gps", fuel), ("nox_gps", nox)):
        written = np.array(table[key])[:, first:] * 3600
        known = ~np.isnan(measured)
        assert_allclose(written[known], measured[known], rtol=1e-6)
        # Beyond the measured corners stand, at most, corners of cells that the full-load curve cuts.
        beyond = ~np.isnan(written) & ~known
        beside = np.maximum.accumulate(known[:, ::-1], axis=1)[:, ::-1]
        reach = beside | np.vstack([beside[1:], beside[-1:]]) | np.vstack([beside[:1], beside[:-1]])
        reach[:, 1:] |= reach[:, :-1].copy()
        assert (reach | ~beyond).all() and np.isnan(written).any()
    # Down to the motoring curve the flow is a line that ends in 0, so it lies between its neighbours.
    below = np.array(table["fuel_gps"])[:, : first + 1]
    assert (np.diff(below, axis=1) >= 0).all() and (below[:, 0] == 0).all()
    long = bench(TORQUES[1:], False).T
    write("long.csv", "n [rpm],T [Nm],fuel [g/h],nox [g/h]", *long)
    assert (
        hevopt(
            "maps", "import", "long.csv", "--kind", "engine", *LIKE, "--motoring", "motoring.csv"
        ).status
        == 0
    )
    for key, values in component("long.toml")["fuel_map"].items():
        assert_allclose(values, table[key], rtol=1e-6)


def test_grids_without_a_label_are_told_by_options(hevopt):
    fuel, nox = lattice()
    for name, values in (("fuel", fuel), ("nox", nox)):
        Path(f"{name}.csv").write_text(grid_text("", values))
    units = [
        f"--unit={role}={unit}"
        for role, unit in (("speed", "rpm"), ("torque", "Nm"), ("fuel", "g/h"), ("nox", "g/h"))
    ]
    seen = hevopt(
        "maps",
        "import",
        "fuel.csv",
        "--kind",
        "engine",
        *LIKE,
        "--nox",
        "nox.csv",
        "--rows",
        "speed",
        *units,
    )
    assert seen.status == 0, seen
    table = component("fuel.toml")["fuel_map"]
    first = table["torque_nm"].index(TORQUES[1])
    assert_allclose(np.array(table["nox_gps"])[3, first] * 3600, nox[3, 0], rtol=1e-6)


def test_a_workbook_has_a_sheet_for_each_map_and_curve(hevopt):
    from openpyxl import Workbook

    fuel, nox = lattice()
    book = Workbook()
    for name, values in (("fuel", fuel), ("nox", nox)):
        sheet = book.create_sheet(name)
        sheet.append(["speed [rpm] \\ torque [Nm]", *TORQUES[1:]])
        for rpm, row in zip(SPEEDS, values, strict=True):
            sheet.append([rpm, *(None if np.isnan(x) else float(x) for x in row)])
    curves = book.create_sheet("curves")
    curves.append(["speed [rpm]", "full load [Nm]", "motoring torque [Nm]"])
    for rpm in SPEEDS:
        w = np.array(rpm * RPM)
        curves.append(
            [
                rpm,
                *(float(f(w)) for f in (ENGINE.full_load_nm, ENGINE.drag_nm)),
            ]
        )
    book.save("m.xlsx")
    sheets = ("--sheet", "fuel", "--nox", "m.xlsx#nox", "--full-load", "m.xlsx#curves")
    units = ("--unit", "fuel=g/h", "--unit", "nox=g/h")
    seen = hevopt("maps", "import", "m.xlsx", *sheets, *units, "--kind", "engine", *LIKE)
    assert seen.status == 0, seen
    found = component("m.toml")
    w = np.array(SPEEDS) * RPM
    assert_allclose(found["full_load"]["torque_nm"], ENGINE.full_load_nm(w), rtol=1e-6)
    assert_allclose(found["fuel_map"]["motoring_torque_nm"], ENGINE.drag_nm(w), rtol=1e-6)
    first = found["fuel_map"]["torque_nm"].index(TORQUES[1])
    written = np.array(found["fuel_map"]["nox_gps"])[:, first:] * 3600
    assert_allclose(written[~np.isnan(nox)], nox[~np.isnan(nox)], rtol=1e-6)


def test_units_by_option_do_not_outdo_the_header_of_another_file(hevopt):
    rpm, torque, fuel, _ = bench(TORQUES, False).T
    write("b.csv", "n,T,fuel", rpm, torque, fuel)
    speeds = np.array(SPEEDS) * RPM
    write(
        "full.csv",
        "omega [rad/s],T [kNm]",
        speeds,
        ENGINE.full_load_nm(speeds) / 1e3,
    )
    units = ("--unit", "speed=rpm", "--unit", "torque=Nm", "--unit", "fuel=g/h")
    seen = hevopt(
        "maps", "import", "b.csv", "--kind", "engine", *LIKE, *units, "--full-load", "full.csv"
    )
    assert seen.status == 0, seen
    found = component("b.toml")["full_load"]
    assert_allclose(found["speed_rpm"], SPEEDS)
    assert_allclose(found["torque_nm"], ENGINE.full_load_nm(speeds), rtol=1e-6)


def test_what_a_row_cannot_say_is_left_out_and_listed(hevopt):
    rpm, torque, fuel, _ = bench(TORQUES, False).T
    with np.errstate(divide="ignore", invalid="ignore"):
        specific = np.where(torque > 0, fuel / (rpm * RPM * torque / 1e3), 0.0)
    specific[3] = np.nan
    write("b.csv", "n [rpm],T [Nm],be [g/kWh]", rpm, torque, specific)
    seen = hevopt("maps", "import", "b.csv", "--kind", "engine", *LIKE)
    assert seen.status == 0, seen
    assert "15 points left out, lines 2, 11, " in seen.out and "give a flow there" in seen.out
    assert "1 points not measured, line 5: cells are empty" in seen.out
    assert "motoring curve: ASSUMED, drag mean pressure of engine_diesel_1600" in seen.out
    # A flow for those rows, beside the specific consumption for the others, is used.
    flow = np.where((torque == 0) | np.isnan(specific), fuel, np.nan)
    write("b.csv", "n [rpm],T [Nm],be [g/kWh],fuel [g/h]", rpm, torque, specific, flow)
    seen = hevopt("maps", "import", "b.csv", "--kind", "engine", *LIKE)
    assert "left out" not in seen.out and "idle fuel (850 rpm, torque 0): 0.09252 g/s" in seen.out


def test_holes_and_falling_fuel_are_named(hevopt):
    fuel, _ = lattice()
    fuel[5, 7] = np.nan  # 2000 rpm, 100 Nm
    fuel[7, 4] = fuel[7, 3] * 0.9  # 2500 rpm, 45 Nm
    Path("g.csv").write_text(grid_text("n [rpm] \\ T [Nm]", fuel))
    seen = hevopt("maps", "import", "g.csv", "--kind", "engine", *LIKE, "--unit", "fuel=g/h")
    assert "holes: 1: 2000 rpm, 100 Nm" in seen.out
    assert "fuel falling as torque rises at one speed: 1: 2500 rpm, 45 Nm" in seen.out


def test_irregular_points_are_exact_for_a_plane_and_unknown_outside_their_hull(hevopt):
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(4)
    rpm, torque = rng.uniform(900, 4500, 300), rng.uniform(10, 200, 300)
    fuel = 0.1 * rpm + 20 * torque
    corners = np.array([[850, 5.0], [850, 210], [4600, 5], [4600, 210]])
    rpm, torque = np.append(rpm, corners[:, 0]), np.append(torque, corners[:, 1])
    fuel = np.append(fuel, 0.1 * corners[:, 0] + 20 * corners[:, 1])
    write("i.csv", "n [rpm],T [Nm],fuel [g/h]", rpm, torque, fuel)
    seen = hevopt("maps", "import", "i.csv", "--kind", "engine", *LIKE, "--set", "idle_rpm=860")
    assert "irregular points put on a grid: linear on the triangles" in seen.out, seen
    table = component("i.toml")["fuel_map"]
    s, t = np.meshgrid(table["speed_rpm"], table["torque_nm"], indexing="ij")
    values = np.array(table["fuel_gps"]) * 3600
    measured = (t >= 60) & ~np.isnan(values)
    assert measured.mean() > 0.5
    assert_allclose(values[measured], (0.1 * s + 20 * t)[measured], rtol=1e-5)
    drag = np.column_stack([table["speed_rpm"], table["motoring_torque_nm"]])
    hull = Delaunay(np.vstack([np.column_stack([rpm, torque]), drag]))
    inside = hull.find_simplex(np.column_stack([s.ravel(), t.ravel() - 1e-6])) >= 0
    above_drag = (t > np.array(table["motoring_torque_nm"])[:, None]).ravel()
    assert np.isnan(values).ravel()[above_drag & ~inside].all()


def test_nothing_is_continued_below_a_full_load_curve_that_no_point_reaches(hevopt):
    rpm, torque, fuel, _ = bench(TORQUES, False).T
    low = torque <= 100
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", rpm[low], torque[low], fuel[low])
    rows = [(r, ENGINE.full_load_nm(np.array(r * RPM)) + 1) for r in SPEEDS]
    write("full.csv", "n [rpm],T [Nm]", *np.array(rows).T)
    assert (
        hevopt(
            "maps", "import", "b.csv", "--kind", "engine", *LIKE, "--full-load", "full.csv"
        ).status
        == 0
    )
    engine = load_architecture(car_with("engine", "b.toml", "A")).engine
    speed, load = np.meshgrid(
        np.linspace(850, 5000, 200) * RPM, np.linspace(100.1, 290, 100), indexing="ij"
    )
    assert np.isnan(engine.fuel_kgps(load, speed)).all()


def test_what_the_car_asks_for_outside_the_map_is_rejected_and_said(hevopt):
    rpm, torque, fuel, _ = bench(TORQUES, False).T
    low = torque <= 30
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", rpm[low], torque[low], fuel[low])
    rows = np.array([(r, ENGINE.full_load_nm(np.array(r * RPM))) for r in SPEEDS]).T
    write("full.csv", "n [rpm],T [Nm]", *rows)
    seen = hevopt("maps", "import", "b.csv", "--kind", "engine", *LIKE, "--full-load", "full.csv")
    assert 10 < float(seen.out.split("coverage: ")[1].split("%")[0]) < 40
    seen = hevopt("run", car_with("engine", "b.toml", "A"), "--strategy", "baseline")
    assert seen.status == 3 and "outside the engine map 1" in seen.err


@pytest.mark.parametrize("kind", ["W", "kW", "%", "electric"])
def test_nedc_fuel_of_a_measured_machine_is_that_of_its_formula(hevopt, kind):
    car = load_architecture("C2")
    rpm = np.concatenate([[0, 50, 125], np.arange(250, 6001, 250)])
    speed, torque = np.meshgrid(rpm, np.arange(-120, 121, 5.0), indexing="ij")
    keep = (np.abs(speed * RPM * torque) < 20e3) & ((speed > 0) | (kind != "%"))
    speed, torque = speed[keep], torque[keep]
    loss = car.machines[0].loss_w(torque, speed * RPM)
    power = torque * speed * RPM
    with np.errstate(divide="ignore", invalid="ignore"):
        efficiency = np.where(power > 0, power / (power + loss), (power + loss) / power)
    efficiency[(power == 0) | (efficiency < 0)] = 0.0
    header, values = {
        "W": ("loss [W]", loss),
        "kW": ("loss [kW]", loss / 1e3),
        "%": ("efficiency [%]", 100 * efficiency),
        "electric": ("electric power [W]", power + loss),
    }[kind]
    write("m.csv", f"speed [rpm],torque [Nm],{header}", speed, torque, values)
    seen = hevopt("maps", "import", "m.csv", "--kind", "machine", "--like", "machine_flywheel_18kw",
                  "--set", "power_max_w=18000.0")  # fmt: skip
    assert seen.status == 0, seen
    assert "peak efficiency motoring: 9" in seen.out and "peak efficiency generating: 9" in seen.out
    if kind == "%":
        assert "without power, or at efficiency 0" in seen.out
        assert "below 50 rpm: torque 0 alone can be used" in seen.out
    rows = compare("nedc", ["C2", car_with("machine", "m.toml")], ["dp"]).rows
    assert rows[1].fuel_l_per_100km == pytest.approx(rows[0].fuel_l_per_100km, rel=5e-3)


def test_a_machine_measured_as_a_motor_alone_is_assumed_symmetric_and_says_so(hevopt):
    write(
        "m.csv",
        "speed [rpm],torque [Nm],loss [W]",
        [0, 0, 6000, 6000],
        [0, 100, 0, 100],
        [50, 700, 200, 900],
    )
    seen = hevopt("maps", "import", "m.csv", "--kind", "machine")
    assert "ASSUMED that generating loses what motoring does" in seen.out
    assert "assumed: no --like: inertia_kgm2" in seen.out
    machine = load_architecture(car_with("machine", "m.toml")).machines[0]
    assert machine.torque_max_nm == 100
    torque, speed = np.array([50.0, -50.0]), np.full(2, 3000 * RPM)
    assert_allclose(machine.loss_w(torque, speed), (50 + 700 + 200 + 900) / 4)


def test_the_same_input_gives_the_same_bytes(hevopt):
    rpm, torque, fuel, nox = bench().T
    write("b.csv", "n [rpm],T [Nm],fuel [g/h],nox [g/h]", rpm, torque, fuel, nox)
    hevopt("maps", "import", "b.csv", "--kind", "engine", *LIKE)
    first = Path("b.toml").read_bytes(), Path("b.png").read_bytes()
    hevopt("maps", "import", "b.csv", "--kind", "engine", *LIKE)
    assert (Path("b.toml").read_bytes(), Path("b.png").read_bytes()) == first
    assert b"SHA-256" in first[0]


GOOD = (
    "n [rpm],T [Nm],fuel [g/h]\n800,0,400\n800,100,2000\n5000,0,3000\n5000,100,9000\n3000,50,4000\n"
)


@pytest.mark.parametrize(
    ("text", "arguments", "said"),
    [
        (GOOD, [], ["needs displacement_cm3, bore_mm", "--like NAME"]),
        (GOOD.replace("n [rpm]", "n"), [*LIKE], ["unit of column n", "--unit speed=UNIT"]),
        (GOOD.replace("n [rpm]", "x [rpm]"), [*LIKE], ["no column of speed", "--column speed=NAME"]),
        (GOOD.replace("[g/h]", "[Nm]"), [*LIKE], ["fuel", "unit 'Nm' is one of torque"]),
        (GOOD.replace("fuel", "smoke"), [*LIKE], ["no column of fuel, specific consumption or eff"]),
        (GOOD.replace("9000", "-1"), [*LIKE], ["line 5", "below 0"]),
        (GOOD.replace("5000,0", ",0"), [*LIKE], ["line 4", "no speed"]),
        (GOOD.replace("fuel [g/h]", "eta"), [*LIKE, "--unit", "efficiency=-"], ["efficiency up to 9000"]),
        (GOOD.replace("T [Nm]", "T [bar]"), ["--set", "idle_rpm=800"], ["displacement_cm3", "--like NAME"]),
        (GOOD, [*LIKE, "--column", "fule=x"], ["--column 'fule=x'", "roles: speed"]),
        (GOOD, [*LIKE, "--set", "idel_rpm=800"], ["idel_rpm", "close matches: idle_rpm"]),
        (GOOD, [*LIKE, "--set", "idle_rpm=700"], ["idle_rpm 700", "800 to 5000 rpm"]),
        (GOOD, [*LIKE, "--set", "idle_rpm=fast"], ["idle_rpm = 'fast'"]),
        (GOOD, [*LIKE, "--displacement-cm3", "-5"], ["displacement_cm3 = -5"]),
        (GOOD, [*LIKE, "--out", "b.csv"], ["--out b.csv is the file that b.csv is read from"]),
        (GOOD, [*LIKE, "--out", "b.png"], ["--out and the plot name one file", "choose two"]),
        (GOOD, ["--like", "engine_diesl"], ["engine_diesl", "engine_diesel_1600"]),
        (GOOD, [*LIKE, "--full-load", "none.csv"], ["none.csv", "no such file"]),
        (GOOD, [*LIKE, "--motoring", "short.csv"], ["covers 1000 to 3000 rpm, the map 800 to 5000"]),
        (GOOD, [*LIKE, "--rows", "speed", "--sheet", "a"], ["not an Excel workbook"]),
        ("n [rpm],T [Nm],fuel [g/h]\n800,0,400\n5000,0,900\n", [*LIKE], ["2 points; a map needs 4 or more"]),
        ("n [rpm],T [Nm],fuel [g/h]\n8,9,40\n9,9,50\n50,9,90\n90,9,98\n", [*LIKE], ["all points have one torque"]),
        ("n [rpm],T [Nm],fuel [g/h]\n800,9,400\n2000,50,900\n3000,91,1500\n", [*LIKE], ["3 points", "4 or more"]),
        (",10,20\n1000,1,2\n2000,3,4\n", [*LIKE, "--unit", "fuel=g/s"], ["does not tell its axes", "--rows speed"]),
        ("", [*LIKE], ["b.csv: empty"]),
        (GOOD.replace("T [Nm]", "T [bar]"), [*LIKE], ["displacement of the engine measured", "--displacement-cm3"]),
        (GOOD.replace("g/h", "l/h"), [*LIKE], ["--set fuel.density_kgpl=VALUE"]),
        (GOOD.replace("fuel [g/h]", "eta [-]"), [*LIKE], ["efficiency up to 9000"]),
        (GOOD, [*LIKE, "--displacement-cm3", "1400", "--set", "displacement_cm3=1500"], ["are one key; give one"]),
        (GOOD, [*LIKE, "--set", "scale.displacement=2"], ["written as measured", "where a car uses"]),
        (GOOD, [*LIKE, "--set", "full_load.torque_nm=3"], ["from the measured points"]),
        (GOOD.replace("T [Nm]", "power [kW]").replace("800,0", "0,0"), [*LIKE], ["line 2", "torque at rest"]),
    ],
)  # fmt: skip
def test_bad_input_is_one_clear_message(hevopt, text, arguments, said):
    Path("b.csv").write_text(text)
    write("short.csv", "n [rpm],T [Nm]", [1000, 3000], [-20, -30])
    before = sorted(Path().iterdir())
    seen = hevopt("maps", "import", "b.csv", "--kind", "engine", *arguments)
    assert seen.status == 2 and seen.out == "" and seen.err.count("hevopt: error: ") == 1, seen
    assert all(words in seen.err for words in said), seen.err
    assert sorted(Path().iterdir()) == before


@pytest.mark.parametrize(
    ("text", "arguments", "said"),
    [
        (GOOD.replace("fuel [g/h]", "loss [W]"), ["--motoring", "b.csv"], ["of an engine only"]),
        (GOOD.replace("fuel [g/h]", "loss [g/h]"), [], ["unit 'g/h' is one of mass flow"]),
        (GOOD.replace("fuel [g/h]", "eff [%]"), [], ["efficiency up to 90"]),
        (GOOD.replace("fuel [g/h]", "Pel [W]"), [], ["lines 3, 5-6", "loss below 0"]),
        (GOOD, [], ["no column of loss, electric power or efficiency"]),
    ],
)  # fmt: skip
def test_bad_machine_input_is_one_clear_message(hevopt, text, arguments, said):
    Path("b.csv").write_text(text)
    seen = hevopt("maps", "import", "b.csv", "--kind", "machine", *arguments)
    assert seen.status == 2 and seen.out == "" and seen.err.count("hevopt: error: ") == 1, seen
    assert all(words in seen.err for words in said), seen.err


def test_the_help_loads_neither_arrays_nor_plots():
    import subprocess

    code = (
        "import sys; from hevopt import cli; sys.argv = ['hevopt', 'maps', 'import', '--help']\n"
        "try: cli.main()\nexcept SystemExit: pass\n"
        "print([m for m in ('numpy', 'matplotlib', 'scipy') if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stderr.strip() == "[]" and "--full-load" in done.stdout


def test_an_engine_of_another_displacement_takes_its_drag_by_mean_pressure(hevopt):
    Path("b.csv").write_text(GOOD)
    assert (
        hevopt(
            "maps", "import", "b.csv", "--kind", "engine", *LIKE, "--displacement-cm3", "3196"
        ).status
        == 0
    )
    drag = replace(ENGINE.law, displacement_m3=3196e-6).drag_nm(np.array(800 * RPM))
    assert component("b.toml")["fuel_map"]["motoring_torque_nm"][0] == pytest.approx(float(drag))


def test_what_lies_below_the_lowest_measured_torque_is_assumed_and_no_coverage(hevopt):
    rpm, torque, fuel, _ = bench(TORQUES[4:]).T
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", rpm, torque, fuel)
    write_motoring()
    seen = hevopt(
        "maps", "import", "b.csv", "--kind", "engine", *LIKE, "--motoring", "motoring.csv"
    )
    assert "ASSUMED below the lowest measured torque (30 Nm)" in seen.out, seen
    assert "g/s, " in seen.out and "NOT MEASURED but assumed, linear from 30 Nm" in seen.out
    covered = float(seen.out.split("coverage: ")[1].split("%")[0])
    speed = np.linspace(850, 5000, 2000) * RPM
    full = ENGINE.full_load_nm(speed)
    # A slack of 1 % of the largest torque belongs to the measured part.
    assert covered == pytest.approx(100 * (1 - 30 / full.mean()), abs=1.5)
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", *bench().T[:3])
    seen = hevopt(
        "maps", "import", "b.csv", "--kind", "engine", *LIKE, "--motoring", "motoring.csv"
    )
    assert "NOT MEASURED" not in seen.out and "ends below" not in seen.out


def test_a_hole_between_points_is_a_wide_gap(hevopt):
    rpm, torque, fuel, _ = bench().T
    arguments = ("maps", "import", "b.csv", "--kind", "engine", *LIKE, *FUEL)
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", rpm, torque, fuel)
    assert "WARNING" not in hevopt(*arguments).out
    kept = ~((rpm > 1400) & (rpm < 3100) & (torque > 50) & (torque < 190))
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", rpm[kept], torque[kept], fuel[kept])
    seen = hevopt(*arguments)
    assert "WARNING: a hole in the measurement" in seen.out
    place = seen.out.split("points: around ")[1].split(" Nm")[0]
    at = [float(word) for word in place.replace(" rpm", "").split(",")]
    assert 1400 < at[0] < 3100 and 50 < at[1] < 190


def test_speeds_that_wander_are_lines_and_keep_their_points(hevopt):
    rpm, torque, fuel, _ = bench(TORQUES[2:], wander_rpm=20.0).T
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", rpm, torque, fuel)
    seen = hevopt("maps", "import", "b.csv", "--kind", "engine", *LIKE)
    assert "15 speed lines; points moved" in seen.out, seen
    off = float(seen.out.split("fuel differs by ")[1].split("%")[0])
    assert off < 2 and "WARNING: more than" not in seen.out


def test_impossible_fuel_and_points_above_full_load_are_warned_of(hevopt):
    rpm, torque, fuel, _ = bench().T
    write("b.csv", "n [rpm],T [Nm],fuel [g/h]", rpm, torque, 10 * fuel)
    write("full.csv", "n [rpm],T [Nm]", [850, 5000], [80, 80])
    seen = hevopt("maps", "import", "b.csv", "--kind", "engine", *LIKE, "--full-load", "full.csv")
    assert "WARNING: less than any engine has" in seen.out
    assert "points were measured above full load, by up to" in seen.out


def test_a_machines_full_load_curve_sets_its_limits_and_ends_its_map(hevopt):
    speed, torque = np.meshgrid(
        np.arange(0, 6001, 500.0), np.arange(-100, 101, 10.0), indexing="ij"
    )
    write("m.csv", "speed [rpm],torque [Nm],loss [W]", speed.ravel(), torque.ravel(),
          50 + torque.ravel() ** 2 / 10)  # fmt: skip
    rpm = np.array([100, 1000, 2000, 4000, 5000])
    limit = np.array([80, 80, 60, 30, 20])
    write("full.csv", "speed [rpm],power [kW]", rpm, limit * rpm * RPM / 1e3)
    seen = hevopt("maps", "import", "m.csv", "--kind", "machine", "--full-load", "full.csv")
    assert seen.status == 0, seen
    found = component("m.toml")
    assert found["torque_max_nm"] == pytest.approx(80) and found["speed_max_rpm"] == 5000
    assert found["power_max_w"] == pytest.approx(max(limit * rpm * RPM), rel=1e-5)
    machine = load_architecture(car_with("machine", "m.toml")).machines[0]
    for sign in (1, -1):
        held = machine.loss_w(sign * limit * 0.999, rpm * RPM)
        assert np.isfinite(held).all()
        assert np.isnan(machine.loss_w(np.array(sign * 61.0), np.array(4000 * RPM)))
    # Between lines of the map as well, no torque beyond the curve.
    assert machine.limit_nm(np.array(4500 * RPM)) == pytest.approx(25)


def test_a_shortfall_is_driven_with_what_a_masked_map_covers(hevopt):
    fuel, _ = lattice()
    Path("g.csv").write_text(
        grid_text("n [rpm] \\ T [Nm]", np.where(np.array(TORQUES[1:]) > 130, np.nan, fuel))
    )
    speeds = np.array(SPEEDS) * RPM
    write("full.csv", "n [rpm],T [Nm]", SPEEDS, ENGINE.full_load_nm(speeds))
    seen = hevopt("maps", "import", "g.csv", "--kind", "engine", *LIKE, "--unit", "fuel=g/h",
                  "--full-load", "full.csv")  # fmt: skip
    assert "the map ends below the curve at 100% of the speeds" in seen.out, seen
    assert "reaches up to the curve" not in seen.out
    for name in ("A", "C2"):
        table = compare("us06", [car_with("engine", "g.toml", name)], ["dp"], allow_shortfall=True)
        assert table.rows[0].fuel_l_per_100km is not None, table.failures
