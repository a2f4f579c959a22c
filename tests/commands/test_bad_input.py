"""A user's mistake at the command line: one message on stderr, its status, nothing left behind.

Every case runs `hevopt.cli.main()` in a fresh folder and looks at what a user would see.
"""

import json
import os
import stat
from pathlib import Path

import pytest
from command_line import Seen

from hevopt.files.lookup import shipped_folder

SHIPPED = shipped_folder("architectures")
COMPONENTS = {
    "car": "car_compact",
    "engine": "engine_diesel_1600",
    "gearbox": "gearbox_manual_6",
    "machine": "machine_flywheel_18kw",
    "battery": "battery_liion_64",
}
SPEEDS_KMH = (0, 0, 5, 10, 15, 20, 20, 15, 10, 5, 0, 0)
CYCLE = "time_s,speed_kmh\n" + "".join(f"{t},{v}\n" for t, v in enumerate(SPEEDS_KMH))
FAST = "time_s,speed_kmh\n" + "".join(f"{t},{min(5 * t, 300)}\n" for t in range(80))
COLUMNS = ("time_s", "speed_mps", "speed_kmh", "speed_mph", "gear", "clutch_open", "grade")
LINEAR = "{ intercept = 3.30, slope = 0.57 }"
RATIOS = "[4.066, 2.219, 1.402, 1.026, 0.813, 0.676]"


def check(seen: Seen, status: int, *said: str) -> None:
    """The status, one message that says all of `said`, and an empty stdout where input is wrong."""
    assert seen.status == status, seen
    assert "Traceback" not in seen.err
    assert seen.err.count("hevopt: ") == 1
    missing = [text for text in said if text not in seen.err]
    assert not missing, f"{missing} not in {seen.err!r}"
    if status == 2:
        assert seen.out == ""


def architecture(key: str, old: str, new: str) -> None:
    """C2 as x.toml, `old` replaced by `new` in itself (key "x") or in a component x_<key>.toml."""
    text = (SHIPPED / "C2.toml").read_text(encoding="utf-8")
    if key != "x":
        name = COMPONENTS[key]
        component = (SHIPPED / "components" / f"{name}.toml").read_text(encoding="utf-8")
        assert old in component
        Path(f"x_{key}.toml").write_text(component.replace(old, new, 1), encoding="utf-8")
        old, new = f'"{name}"', f'"x_{key}.toml"'
    assert old in text
    Path("x.toml").write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--cycle", "nedcc"], ["cycle 'nedcc' not found", "close matches: nedc;", "us06"]),
        (["--cycle", "NEDC"], ["close matches: nedc;"]),
        (["--architectures", "A,c2"], ["architecture 'c2'", "close matches: C2;", "A, B, C1"]),
        (["--strategies", "dp,ecmss"], ["strategy 'ecmss'", "close matches: ecms", "baseline"]),
        (["--cycle", "no.csv"], ["no.csv does not exist", ".csv file or a name"]),
        (["--cycle", "."], ["'.' not found"]),
        (["--cycle", ""], ["name '' is empty"]),
        (["--cycle", "a\0b"], ["'a\\x00b'", "not a name"]),
        (["--architectures", "no/no.toml"], ["no/no.toml does not exist", ".toml file or a name"]),
        (["--cycle", "nedc.csv"], ["nedc.csv does not exist", "shipped with a close name: nedc;"]),
        (["--architectures", "C2.toml"], ["shipped with a close name: C2"]),
        (["--cycle", "./noext"], ["cycle file ./noext does not exist"]),
        (["--cycle", "a" * 300 + ".csv"], ["aaa"]),
        (["--cycle", "a" * 300], ["aaa"]),
        (["--strategies", ","], ["strategies = []: name at least one, or leave it out"]),
        (["--strategies", "dp,ecms,dp"], ["'dp' is given twice; give it once"]),
        (["--architectures", ","], ["architectures = []: name at least one"]),
        (["--architectures", "A,B,A"], ["'A' is given twice; give it once"]),
        (["--nox-weight", "nan"], ["nox_weight = nan", "a finite number is needed"]),
        (["--nox-weight", "-1"], ["nox_weight = -1", "allowed: 0 to 1e+06"]),
        (["--nox-weight", "1e300"], ["nox_weight = 1e+300", "allowed: 0 to 1e+06"]),
    ],
)
def test_wrong_option(hevopt, arguments, said):
    Path("c.csv").write_text(CYCLE)
    check(hevopt("compare", "--architectures", "A", "--cycle", "c.csv", *arguments), 2, *said)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bogus"], "No such command 'bogus'"),
        (["compare", "--bogus"], "No such option: --bogus"),
        (["compare", "--nox-weight", "much"], "'--nox-weight'"),
        (["run"], "Missing argument"),
        (["run", "A", "B"], "unexpected extra argument"),
        (["table", "A"], "--out"),
    ],
)
def test_wrong_usage(hevopt, arguments, said):
    seen = hevopt(*arguments)
    assert seen.status == 2
    assert said in seen.err
    assert "Traceback" not in seen.err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ["c.csv: empty", "time_s,speed_kmh"]),
        ("# nothing\n\n", ["c.csv: empty"]),
        ("time_s,speed_kmh\n", ["c.csv: 0 data lines", "at least 2"]),
        ("time_s,speed_kmh\n0,5\n", ["c.csv: 1 data lines", "at least 2"]),
        ("0,0\n1,5\n", ["line 1: unknown column '0'", *COLUMNS]),
        (CYCLE.replace("kmh", "knots"), ["line 1: unknown column 'speed_knots'", *COLUMNS]),
        (CYCLE.replace(",", ";"), ["line 1: unknown column 'time_s;speed_kmh'"]),
        ("time_s\n0\n1\n", ["line 1: found columns time_s;", "exactly one of speed_mps"]),
        ("time_s,speed_kmh,speed_mps\n0,0,0\n", ["line 1", "exactly one of speed_mps"]),
        ("time_s,time_s,speed_kmh\n0,0,0\n", ["line 1: column time_s stands twice"]),
        ("time_s,speed_kmh,clutch_open\n0,0,0\n", ["clutch_open without gear"]),
        (CYCLE.replace("2,5", "2,nan", 1), ["line 4: speed_kmh is 'nan'", "finite"]),
        (CYCLE.replace("2,5", "2,-inf", 1), ["line 4: speed_kmh is '-inf'", "finite"]),
        (CYCLE.replace("2,5", "nan,5", 1), ["line 4: time_s is 'nan'", "finite"]),
        (CYCLE.replace("2,5", "2,", 1), ["line 4: speed_kmh is '', not a number"]),
        (CYCLE.replace("2,5", "2,x", 1), ["line 4: speed_kmh is 'x', not a number"]),
        (CYCLE.replace("2,5", "2,5,0", 1), ["line 4: 3 values, the header has 2"]),
        (CYCLE.replace("2,5", "2", 1), ["line 4: 1 values, the header has 2"]),
        (CYCLE.replace("2,5", '2,"5', 1), ["line 4: not a CSV line"]),
        (CYCLE.replace("\n3,", "\n1,", 1), ["line 5: time 1 s after 2 s", "sort the lines"]),
        (CYCLE.replace("\n3,", "\n2,", 1), ["line 5: time 2 s after 2 s", "duplicate"]),
        (CYCLE.replace("\n11,", "\n1e308,"), ["line 13: time_s is 1e+308", "-1e+09 to 1e+09"]),
        (CYCLE.replace("\n11,", "\n1e4,"), ["line 13", "0.0001 to 3600 s", "in seconds"]),
        (CYCLE.replace("\n3,", "\n2.000001,"), ["line 5: 1e-06 s after", "0.0001 to 3600 s"]),
        (CYCLE.replace("2,5", "2,1_0", 1), ["line 4: speed_kmh is '1_0', not a number"]),
        (CYCLE.replace("2,5", "2,\u0665", 1), ["line 4", "not a number"]),
        (CYCLE.replace("2,5", "2,5\u2028", 1).replace("3,10", "x,10"), ["line 5: time_s is 'x'"]),
        (CYCLE.replace("2,5", "2," + "x" * 99, 1), ["'" + "x" * 36 + "..., not a number"]),
        (CYCLE.replace("2,5", "2,5e-9999", 1).replace("10", "1e9999"), ["line 5", "a finite"]),
        (CYCLE.replace("time_s", "Time_s"), ["'Time_s'; close matches: time_s;"]),
        (CYCLE.replace("2,5", "2,359", 1), ["line 4: acceleration 99.7 m/s²"]),
        (CYCLE.replace("2,5", "2,-5", 1), ["line 4: speed_kmh is -5", "0 to 360", "unit"]),
        (CYCLE.replace("2,5", "2,1e308", 1), ["line 4: speed_kmh is 1e+308", "0 to 360"]),
        (CYCLE.replace("2,5", "2,150", 1), ["line 4: acceleration 41.7", "±20 m/s²", "units"]),
        ("time_s,speed_mps\n0,0\n1,0\n", ["distance 0 m", "must cover 1 m or more"]),
        ("time_s,speed_kmh,grade\n0,0,0\n1,5,0.6\n", ["line 3: grade is 0.6", "-0.5 to 0.5"]),
        ("time_s,speed_kmh,gear\n0,0,0\n1,5,25\n", ["line 3: gear is 25", "0 to 20"]),
        ("time_s,speed_kmh,gear\n0,0,0\n1,5,1.5\n", ["line 3: gear is 1.5", "whole number"]),
        ("time_s,speed_kmh,gear,clutch_open\n0,0,0,2\n1,5,1,0\n", ["clutch_open is 2", "0 to 1"]),
        ("time_s,speed_kmh,gear\n0,0,0\n1,5,9\n2,9,9\n", ["t = 1 s: gear 9", "gears 0 to 6"]),
    ],
)
def test_wrong_cycle(hevopt, text, said):
    Path("c.csv").write_text(text)
    check(hevopt("compare", "--architectures", "A", "--cycle", "c.csv"), 2, *said)


@pytest.mark.parametrize(
    ("contents", "byte"),
    [(CYCLE.encode("utf-16"), 0), (CYCLE.encode() + b"# \xe9", len(CYCLE) + 2)],
)
def test_not_utf8(hevopt, contents, byte):
    for name in ("c.csv", "c.toml"):
        Path(name).write_bytes(contents)
    said = [f"byte {byte} is not UTF-8 text", "save the file as UTF-8"]
    check(hevopt("run", "A", "--cycle", "c.csv"), 2, "c.csv", *said)
    check(hevopt("run", "c.toml"), 2, "c.toml", *said)


def test_too_large_file(hevopt):
    with Path("c.csv").open("wb") as file:
        file.truncate(50_100_000)
    check(hevopt("run", "A", "--cycle", "c.csv"), 2, "c.csv: 50.1 MB", "up to 50 MB")
    Path("x.toml").write_text("#" * 5_100_000)
    check(hevopt("run", "x.toml"), 2, "x.toml: 5.1 MB", "up to 5 MB")
    Path("c.csv").write_text("time_s,speed_kmh\n" + "".join(f"{t},9\n" for t in range(200_001)))
    check(hevopt("run", "A", "--cycle", "c.csv"), 2, "line 200002: more than the 200000 data lines")


@pytest.mark.parametrize("spoilt", [CYCLE.replace("\n", "\r\n"), "\ufeff" + CYCLE, "#\n\n" + CYCLE])
def test_harmless_oddities_of_a_cycle(hevopt, spoilt):
    Path("c.csv").write_bytes(spoilt.encode())
    seen = hevopt("run", "A", "--cycle", "c.csv", "--json")
    assert (seen.status, seen.err) == (0, "")
    assert json.loads(seen.out)["rows"][0]["status"] == "ok"


@pytest.mark.parametrize(
    ("key", "old", "new", "said"),
    [
        ("x", "hybrid_mass_kg =", "hybrid_mass =", ["hybrid_mass;", "close matches: hybrid_mass_"]),
        ("x", "second_clutch", "secondclutch", ["coupling.secondclutch", "matches: second_clutch"]),
        ("x", 'name = "C2"', "", ["name is missing", "add the key"]),
        ("x", "[coupling]", "[couplng]", ["2 faults", "coupling is missing", "matches: coupling"]),
        ("x", "[coupling]", "[[coupling]]", ["coupling = [{", "a table [coupling] is needed"]),
        ("x", "second_clutch = true", "", ["'gearbox_input' needs second_clutch"]),
        ("x", "70.0", '"70"', ["hybrid_mass_kg = '70'", "number"]),
        ("x", "70.0", "true", ["hybrid_mass_kg = true", "number"]),
        ("x", "70.0", "nan", ["hybrid_mass_kg = nan", "finite"]),
        ("x", "70.0", "1e308", ["hybrid_mass_kg = 1e+308", "5000"]),
        ("x", "70.0", "9" * 400, ["hybrid_mass_kg = 999"]),
        ("x", '"start_stop"', '"startstop"', ["functions.0 = 'startstop'", "'start_stop'"]),
        ("x", '"gearbox_input"', '"input"', ["coupling.kind = 'input'", "'even_shaft'"]),
        ("x", '"C2"', '"a\\nb"', ["name = 'a\\nb': printable characters on one line"]),
        ("x", "70.0", "9" * 5000, ["a number has too many digits"]),
        ("x", "70.0", "0x" + "f" * 5000, ["hybrid_mass_kg = a very long int"]),
        ("x", '"car_compact"', "5", ["car = 5", "text in quotes"]),
        ("x", '"car_compact"', '"car_compct"', ["x.toml, car:", "close matches: car_compact, "]),
        ("x", '"car_compact"', '"no/car.toml"', ["x.toml, car:", "no/car.toml does not exist"]),
        ("x", '"car_compact"', '""', ["x.toml: car = ''", "1 or more characters"]),
        ("x", '"car_compact"', '"x.toml"', ["mass_kg is missing", "unknown key coupling"]),
        ("car", "1300.0", "0", ["mass_kg = 0; allowed: 50 to 100000"]),
        ("car", "1300.0", "1e308", ["mass_kg = 1e+308", "100000"]),
        ("car", "0.3132", "0.0", ["tyre_radius_m = 0.0", "0.1"]),
        ("car", "rolling_c0 = 0.009", "", ["road_load", "either rolling_c0 and drag_area_m2"]),
        ("car", "rolling_c0", "coastdown_c1_nspm = 1\nrolling_c0", ["no key of the other form"]),
        ("car", "5e-5", "1e300", ["rolling_c1_spm = 1e+300; allowed: -1e+06 to 1e+06"]),
        ("engine", "[100, 150", "[0, 150", ["full_load", "torque_nm must be > 0, found 0"]),
        ("engine", "[100, 150", "[nan, 150", ["full_load.torque_nm.0 = nan", "finite"]),
        ("engine", "[100, 150,", "[150,", ["full_load", "one length"]),
        ("engine", "[800, 1000", "[800, 700", ["full_load", "speed_rpm must increase"]),
        ("engine", "850.0", "0", ["idle_rpm = 0", "50"]),
        ("engine", "850.0", "700", ["idle_rpm 700", "within full_load.speed_rpm, 800 to 5000"]),
        ("engine", "290, 290", "1e308, 290", ["torque_nm.3 = 1e+308; allowed: -1e+06 to 1e+06"]),
        ("engine", "a = 0.39902", "a = 1e308", ["a = 1e+308; allowed: 0.01 to 10"]),
        ("engine", "b = 0.031510", "b = -0.5", ["a + b cm + c cm² is -6.72 at 5000 rpm"]),
        ("engine", "80.5", "800.0", ["a + b cm + c cm²", "it must be > 0"]),
        ("engine", "a2 = -0.0013733", "a2 = -0.1", ["full load at 2000 rpm has no fuel"]),
        ("engine", "dp = 1.471", "dp = 0.001", ["dp = 0.001; allowed: 0.01 to 1e+06"]),
        ("engine", "dp = 1.471", "dp = 0.01", ["reaches 917", "up to 700; raise dp"]),
        ("engine", "[fuel_coefficients]", "[fuel_coefs]", ["close matches: fuel_coefficients"]),
        ("gearbox", RATIOS, "[]", ["ratios = []", "1 or more entries"]),
        ("gearbox", "0.676", "0", ["ratios.5 = 0; allowed: 0.01 to 50"]),
        ("gearbox", "= 0.95", '= "x"', ["x_gearbox.toml: efficiency = 'x': a number is needed"]),
        ("gearbox", "= 0.95", "= [0.9, 2]", ["efficiency.1 = 2; allowed: 0.01 to 1"]),
        ("gearbox", "0.676", "0.9", ["ratios must fall"]),
        ("gearbox", ", 0.676", "", ["4 values each for 5 gears"]),
        ("gearbox", "[10, 28", "[20, 28", ["each down_kmh must be below its up_kmh"]),
        ("machine", '"loss"', '"los"', ["kind = 'los'", "'loss', 'efficiency' or 'map'"]),
        ("battery", "min = 0.40", "min = 0.90", ["empty window: min 0.9", "below max 0.8"]),
        ("battery", "start = 0.60", "start = 0.9", ["start 0.9", "[0.4, 0.8]"]),
        ("battery", "max = 0.80", "max = 80", ["soc.max = 80", "1"]),
        ("battery", "= 64", "= 64.0", ["cells_in_series = 64.0", "whole number"]),
        ("battery", "= 64", "= 0", ["cells_in_series = 0", "1"]),
        ("battery", "7.0", "0", ["capacity_ah = 0; allowed: 1e-06 to 1e+09"]),
        ("battery", "0.0038", "1\ncharge_ohm = 1", ["found: charge_ohm, resistance_ohm"]),
        ("battery", "slope", "slop", ["key open_circuit_v.slop; close matches: slope"]),
        ("battery", LINEAR, "3.3", ["open_circuit_v = 3.3: allowed: 'a table', 'a list'"]),
        ("battery", LINEAR, "[3.5, 3.4]\ncurve_soc = [0.0, 1.0]", ["must not fall"]),
        ("battery", "[soc]", "[[soc]]", ["a table [soc] is needed"]),
        ("battery", "0.0038", "[0.1, 0.2]", ["values over SOC need curve_soc"]),
    ],
)
def test_wrong_architecture(hevopt, key, old, new, said):
    architecture(key, old, new)
    check(hevopt("run", "x.toml"), 2, "x.toml" if key == "x" else f"x_{key}.toml", *said)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ["x.toml: 5 faults", "car is missing"]),
        ("hello", ["x.toml: not valid TOML"]),
        ("a = " + "[" * 100_000, ["x.toml: nested too deeply"]),
        ("\n".join(f"k{n} = 1" for n in range(30)), ["35 faults", "key k11", "and 15 more"]),
    ],
)
def test_not_an_architecture(hevopt, text, said):
    Path("x.toml").write_text(text)
    check(hevopt("run", "x.toml"), 2, *said)


def test_components_that_do_not_fit_together(hevopt):
    architecture("car", "1300.0", "60.0")
    light = Path("x.toml").read_text(encoding="utf-8").replace("70.0", "-50.0")
    Path("x.toml").write_text(light, encoding="utf-8")
    said = ["x_car.toml: mass_kg 60", "hybrid_mass_kg -50", "10 kg", "50 kg or more"]
    check(hevopt("run", "x.toml"), 2, *said)
    one_gear = (
        'name = "g"\nratios = [4.0]\nfinal_drive_ratio = 3.0\nefficiency = 0.95\n'
        "[shift_speeds]\nup_kmh = []\ndown_kmh = []\n"
    )
    Path("g.toml").write_text(one_gear)
    e = (SHIPPED / "E.toml").read_text(encoding="utf-8").replace("gearbox_manual_6", "g.toml")
    Path("x.toml").write_text(e, encoding="utf-8")
    check(
        hevopt("run", "x.toml"), 2, "x.toml, gearbox: 'g.toml' has 1 gear", "'even_shaft' needs 2"
    )
    architecture("x", "70.0", "80.0")
    seen = hevopt("compare", "--architectures", "C2,x.toml")
    check(seen, 2, "architecture C2 is given twice", "C2.toml and in x.toml", "change its name")


def fuel_map(speeds: str, fuel: str) -> None:
    """C2 as x.toml with a fuel map in place of the coefficients."""
    text = (SHIPPED / "components" / "engine_diesel_1600.toml").read_text(encoding="utf-8")
    coefficients = text[text.index("[fuel_coefficients]") :]
    keys = f"speed_rpm = {speeds}\ntorque_nm = [-40, 300]\nfuel_gps = {fuel}\n"
    new = f"[fuel_map]\n{keys}motoring_torque_nm = [-10, -30]\n"
    architecture("engine", coefficients, new)


@pytest.mark.parametrize(
    ("speeds", "fuel", "said"),
    [
        ("[800, 5000]", "[[nan, nan], [nan, nan]]", ["fuel_map: fuel_gps holds nan only"]),
        ("[800, 5000]", "[[0, 1], [0, 1e308]]", ["fuel_gps: allowed: 0 to 1e+06, or nan"]),
        ("[-800, 5000]", "[[0, 1], [0, 5]]", ["speed_rpm.0 = -800; allowed: 0 to 1e+06"]),
    ],
)
def test_wrong_fuel_map(hevopt, speeds, fuel, said):
    fuel_map(speeds, fuel)
    check(hevopt("run", "x.toml"), 2, "x_engine.toml", *said)


def test_an_engine_without_fuel_has_no_percentages(hevopt):
    fuel_map("[800, 5000]", "[[0, 0], [0, 0]]")
    engine = Path("x_engine.toml")
    engine.write_text(engine.read_text().replace("start_fuel_g = 0.2", "start_fuel_g = 0.0"))
    Path("c.csv").write_text(CYCLE)
    seen = hevopt("compare", "--architectures", "x.toml", "--cycle", "c.csv", "--json")
    rows = json.loads(seen.out, parse_constant=pytest.fail)["rows"]
    for row in rows:
        assert row["fuel_l_per_100km"] == 0 and row["status"] == "not neutral"
        assert (
            row["delta_energy_percent"] is row["gap_percent"] is row["delta_fuel_percent"] is None
        )


def test_a_figure_that_is_not_finite_is_a_failed_case(hevopt, monkeypatch):
    Path("c.csv").write_text(CYCLE)
    monkeypatch.setattr("hevopt.studies.case.litres_per_100km", lambda *_: float("inf"))
    seen = hevopt(
        "compare", "--architectures", "B", "--strategies", "dp", "--cycle", "c.csv", "--json"
    )
    check(seen, 3, "B dp: fuel_l_per_100km is inf")
    assert json.loads(seen.out, parse_constant=pytest.fail)["rows"][0]["status"].startswith(
        "failed"
    )


def test_a_name_with_markup_is_shown_as_it_stands(hevopt):
    architecture("x", '"C2"', '"[/red]:car:"')
    Path("[b].csv").write_text(CYCLE)
    words = ("--architectures", "x.toml", "--strategies", "dp", "--cycle", "[b].csv")
    seen = hevopt("compare", *words)
    assert seen.status == 0 and "[/red]:car:" in seen.out and "cycle [b]" in seen.out


@pytest.mark.parametrize("form", ["x_car.toml", "./x_car.toml", "sub/../x_car.toml", "absolute"])
def test_component_by_path_from_another_folder(hevopt, tmp_path, monkeypatch, form):
    architecture("car", "1300.0", "1400.0")
    Path("c.csv").write_text(CYCLE)
    Path("sub").mkdir()
    form = str(tmp_path / "x_car.toml") if form == "absolute" else form
    text = Path("x.toml").read_text(encoding="utf-8").replace("x_car.toml", form)
    Path("x.toml").write_text(text, encoding="utf-8")
    monkeypatch.chdir("sub")
    seen = hevopt("run", "../x.toml", "--cycle", str(tmp_path / "c.csv"), "--json")
    assert (seen.status, seen.err) == (0, "")


@pytest.mark.parametrize("command", ["run", "table"])
@pytest.mark.parametrize("out", ["folder", "no/such/folder.csv", "c.csv/x", "x" * 300])
def test_place_that_cannot_be_written(hevopt, command, out):
    Path("c.csv").write_text(CYCLE)
    Path("folder").mkdir()
    before = sorted(Path().rglob("*"))
    seen = hevopt(command, "A", "--cycle", "c.csv", "--out", out)
    check(seen, 2, f"{out}: cannot be written", "choose another place")
    assert sorted(Path().rglob("*")) == before


@pytest.mark.parametrize(
    ("out", "said"),
    [
        ("", "Is a folder"),
        (".", "Is a folder"),
        ("pipe", "Not a regular file"),
        ("read_only", "Read-only file"),
        ("loop", "cannot be written"),
        ("c.csv", "--out c.csv is the file that c.csv is read from"),
        ("link", "--out link is the file that x.toml is read from"),
    ],
)
def test_out_is_refused_before_anything_is_solved(hevopt, monkeypatch, out, said):
    Path("c.csv").write_text(CYCLE)
    architecture("x", "70.0", "80.0")
    os.mkfifo("pipe")
    Path("link").symlink_to("x.toml")
    Path("loop").symlink_to("loop")
    Path("read_only").touch()
    monkeypatch.setattr("os.access", lambda path, mode: mode != os.W_OK or path.name != "read_only")
    monkeypatch.setattr("hevopt.powertrain.powertrain.build_problem", pytest.fail)
    for command in ("run", "table"):
        check(hevopt(command, "./x.toml", "--cycle", "c.csv", "--out", out), 2, said)
    assert stat.S_ISFIFO(Path("pipe").stat().st_mode)


@pytest.mark.parametrize("command", ["run", "table"])
def test_out_never_overwrites_a_component(hevopt, command):
    Path("car.toml").write_bytes((SHIPPED / "components/car_compact.toml").read_bytes())
    before = Path("car.toml").read_bytes()
    seen = hevopt(command, "A", "--set", "car=./car.toml", "--out", "car.toml")
    check(seen, 2, "--out car.toml is the file that car.toml is read from", "choose another")
    assert Path("car.toml").read_bytes() == before


def test_out_follows_links_and_keeps_the_mode(hevopt):
    Path("c.csv").write_text(CYCLE)
    Path("t.csv").touch(mode=0o640)
    Path("link.csv").symlink_to("t.csv")
    assert hevopt("run", "A", "--cycle", "c.csv", "--out", "link.csv").status == 0
    assert Path("link.csv").is_symlink() and Path("t.csv").read_text().startswith("cycle,time_s")
    assert stat.S_IMODE(Path("t.csv").stat().st_mode) == 0o640
    assert {p.name for p in Path().iterdir()} == {"c.csv", "t.csv", "link.csv"}


def test_input_that_is_no_regular_file(hevopt):
    for name in ("p.csv", "p.toml", "noext"):
        os.mkfifo(name)
    check(hevopt("run", "A", "--cycle", "p.csv"), 2, "p.csv is not a regular file")
    check(hevopt("run", "A", "--cycle", "./noext"), 2, "./noext is not a regular file")
    check(hevopt("run", "p.toml"), 2, "p.toml is not a regular file")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (FAST, ["A cannot follow", "Nm missing at the wheels", "more", "--allow-shortfall"]),
        (
            "time_s,speed_kmh,gear\n0,0,0\n1,9,0\n2,9,0\n",
            ["gear 0", "reach the wheels", "correct the cycle's gear column"],
        ),
    ],
)
def test_infeasible_cycle(hevopt, text, said):
    Path("c.csv").write_text(text)
    check(hevopt("run", "A", "--cycle", "c.csv", "--out", "t.csv"), 3, *said)
    assert [p.name for p in Path().iterdir()] == ["c.csv"]
    seen = hevopt("compare", "--architectures", "A", "--cycle", "c.csv", "--json")
    check(seen, 3, *said)
    rows = json.loads(seen.out, parse_constant=pytest.fail)["rows"]
    assert all(row["status"].startswith("failed: ") for row in rows)
    assert all(row["fuel_l_per_100km"] is None for row in rows)


def test_a_limit_is_named_where_no_torque_is_missing(hevopt):
    architecture("car", "250.0", "50000.0")
    Path("c.csv").write_text(CYCLE)
    for words in ((), ("--allow-shortfall",)):
        seen = hevopt("run", "x.toml", "--cycle", "c.csv", *words)
        check(seen, 3, "most controls are rejected for: battery limit")
        assert "Nm missing" not in seen.err and "--allow-shortfall" not in seen.err


@pytest.mark.parametrize("cause", [None, KeyboardInterrupt()])
def test_interrupt(hevopt, monkeypatch, cause):
    def interrupted(*_, **__):
        if cause is None:
            raise KeyboardInterrupt
        raise SystemError("returned a result with an exception set") from cause

    monkeypatch.setattr("hevopt.studies.comparison.compare_cars", interrupted)
    seen = hevopt("compare")
    assert seen == (130, "", "hevopt: interrupted; nothing was written\n")
