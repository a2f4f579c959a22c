"""A user's mistake at the command line: one message on stderr, its status, nothing left behind.

Every case runs `hevopt.cli.main()` in a fresh folder and looks at what a user would see.
"""

import json
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from hevopt import cli
from hevopt.files import shipped_folder

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
RATIOS = "[4.066, 2.219, 1.402, 1.026, 0.813, 0.676]"


class Seen(NamedTuple):
    """What a user sees of a run."""

    status: int
    out: str
    err: str


@pytest.fixture
def hevopt(monkeypatch, capsys, tmp_path):
    """Run the command line in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> Seen:
        monkeypatch.setattr(sys, "argv", ["hevopt", *arguments])
        try:
            cli.main()
            status = 0
        except SystemExit as stop:
            status = stop.code or 0
        return Seen(status, *capsys.readouterr())

    return run


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
        (["--strategies", "dp,ecmss"], ["strategy 'ecmss'", "close matches: ecms;", "baseline"]),
        (["--cycle", "no.csv"], ["no.csv does not exist", ".csv file or a name"]),
        (["--cycle", "."], ["'.' not found"]),
        (["--cycle", ""], ["name '' is empty"]),
        (["--cycle", "a\0b"], ["'a\\x00b'", "not a name"]),
        (["--architectures", "no/no.toml"], ["no/no.toml does not exist", ".toml file or a name"]),
        (["--nox-weight", "nan"], ["nox_weight nan", "allowed: 0 to 1e6"]),
        (["--nox-weight", "-1"], ["nox_weight -1", "allowed: 0 to 1e6"]),
        (["--nox-weight", "1e300"], ["nox_weight 1e+300", "allowed: 0 to 1e6"]),
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
        ("time_s,time_s,speed_kmh\n0,0,0\n", ["line 1: a column name stands twice"]),
        ("time_s,speed_kmh,clutch_open\n0,0,0\n", ["clutch_open without gear"]),
        (CYCLE.replace("2,5", "2,nan", 1), ["line 4: speed_kmh is nan", "finite"]),
        (CYCLE.replace("2,5", "2,-inf", 1), ["line 4: speed_kmh is -inf", "finite"]),
        (CYCLE.replace("2,5", "nan,5", 1), ["line 4: time_s is nan", "finite"]),
        (CYCLE.replace("2,5", "2,", 1), ["line 4: speed_kmh is '', not a number"]),
        (CYCLE.replace("2,5", "2,x", 1), ["line 4: speed_kmh is 'x', not a number"]),
        (CYCLE.replace("2,5", "2,5,0", 1), ["line 4: 3 values, the header has 2"]),
        (CYCLE.replace("2,5", "2", 1), ["line 4: 1 values, the header has 2"]),
        (CYCLE.replace("2,5", '2,"5', 1), ["line 4: not a CSV line"]),
        (CYCLE.replace("\n3,", "\n1,", 1), ["line 5: time 1 s after 2 s", "sort the lines"]),
        (CYCLE.replace("\n3,", "\n2,", 1), ["line 5: time 2 s after 2 s", "duplicate"]),
        (CYCLE.replace("\n11,", "\n1e308,"), ["line 13", "up to 3600 s", "in seconds"]),
        (CYCLE.replace("2,5", "2,-5", 1), ["line 4: speed_kmh is -5", "0 to 360", "unit"]),
        (CYCLE.replace("2,5", "2,1e308", 1), ["line 4: speed_kmh is 1e+308", "0 to 360"]),
        (CYCLE.replace("2,5", "2,150", 1), ["line 4: acceleration 41.7", "±20 m/s²", "units"]),
        ("time_s,speed_mps\n0,0\n1,0\n", ["speed is 0 throughout", "some distance"]),
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
        file.truncate(100_000_001)
    check(hevopt("run", "A", "--cycle", "c.csv"), 2, "c.csv: 100 MB", "100 MB allowed")


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
        ("x", "[coupling]", "[[coupling]]", ["coupling = [{"]),
        ("x", "second_clutch = true", "", ["'gearbox_input' needs second_clutch"]),
        ("x", "70.0", '"70"', ["hybrid_mass_kg = '70'", "number"]),
        ("x", "70.0", "true", ["hybrid_mass_kg = True", "number"]),
        ("x", "70.0", "nan", ["hybrid_mass_kg = nan", "finite"]),
        ("x", "70.0", "1e308", ["hybrid_mass_kg = 1e+308", "5000"]),
        ("x", "70.0", "9" * 400, ["hybrid_mass_kg = 999"]),
        ("x", '"start_stop"', '"startstop"', ["functions.0 = 'startstop'", "'start_stop'"]),
        ("x", '"gearbox_input"', '"input"', ["coupling.kind = 'input'", "'even_shaft'"]),
        ("x", '"car_compact"', "5", ["car = 5", "string"]),
        ("x", '"car_compact"', '"car_compct"', ["x.toml, car:", "close matches: car_compact;"]),
        ("x", '"car_compact"', '"no/car.toml"', ["x.toml, car:", "no/car.toml does not exist"]),
        ("x", '"car_compact"', '""', ["x.toml, car:", "'' is empty"]),
        ("x", '"car_compact"', '"x.toml"', ["mass_kg is missing", "unknown key coupling"]),
        ("car", "1300.0", "0", ["mass_kg = 0", "50"]),
        ("car", "1300.0", "1e308", ["mass_kg = 1e+308", "100000"]),
        ("car", "0.3132", "0.0", ["tyre_radius_m = 0.0", "0.1"]),
        ("car", "rolling_c0 = 0.009", "", ["road_load", "either rolling_c0 and drag_area_m2"]),
        ("engine", "[100, 150", "[0, 150", ["full_load", "torque_nm must be > 0, found 0"]),
        ("engine", "[100, 150", "[nan, 150", ["full_load.torque_nm.0 = nan", "finite"]),
        ("engine", "[100, 150,", "[150,", ["full_load", "one length"]),
        ("engine", "[800, 1000", "[800, 700", ["full_load", "speed_rpm must be >= 0 and increase"]),
        ("engine", "850.0", "0", ["idle_rpm = 0", "50"]),
        ("engine", "850.0", "700", ["idle_rpm 700", "within full_load.speed_rpm, 800 to 5000"]),
        ("engine", "[fuel_coefficients]", "[fuel_coefs]", ["close matches: fuel_coefficients"]),
        ("gearbox", RATIOS, "[]", ["ratios = []", "at least 1"]),
        ("gearbox", "0.676", "0", ["ratios.5 = 0", "greater than 0"]),
        ("gearbox", "0.676", "0.9", ["ratios must fall"]),
        ("gearbox", ", 0.676", "", ["4 values each for 5 gears"]),
        ("gearbox", "[10, 28", "[20, 28", ["each down_kmh must be below its up_kmh"]),
        ("machine", '"loss"', '"los"', ["kind = 'los'", "'loss' or 'efficiency'"]),
        ("battery", "min = 0.40", "min = 0.90", ["empty window: min 0.9", "below max 0.8"]),
        ("battery", "start = 0.60", "start = 0.9", ["start 0.9", "[0.4, 0.8]"]),
        ("battery", "max = 0.80", "max = 80", ["soc.max = 80", "1"]),
        ("battery", "= 64", "= 64.0", ["cells_in_series = 64.0", "integer"]),
        ("battery", "= 64", "= 0", ["cells_in_series = 0", "1"]),
        ("battery", "7.0", "0", ["capacity_ah = 0", "greater than 0"]),
        ("battery", "0.0038", "[0.1, 0.2]", ["values over SOC need curve_soc"]),
    ],
)
def test_wrong_architecture(hevopt, key, old, new, said):
    architecture(key, old, new)
    check(hevopt("run", "x.toml"), 2, "x.toml" if key == "x" else f"x_{key}.toml", *said)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", ["x.toml: 8 faults", "engine is missing"]),
        ("hello", ["x.toml: not valid TOML"]),
        ("a = " + "[" * 100_000, ["x.toml: nested too deeply"]),
    ],
)
def test_not_an_architecture(hevopt, text, said):
    Path("x.toml").write_text(text)
    check(hevopt("run", "x.toml"), 2, *said)


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
    ("text", "said"),
    [
        (FAST, ["A cannot follow", "Nm missing at the wheels", "more", "--allow-shortfall"]),
        ("time_s,speed_kmh,gear\n0,0,0\n1,9,0\n2,9,0\n", ["gear 0", "does not reach the wheels"]),
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


def test_interrupt(hevopt, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("hevopt.study.compare", interrupted)
    seen = hevopt("compare")
    assert (seen.status, seen.out) == (130, "")
    assert "Traceback" not in seen.err
