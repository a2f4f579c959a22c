"""`hevopt validate`: every fault of every file at once, and what each file is."""

import re
from pathlib import Path

import pytest
from command_line import call
from hypothesis import given, settings
from hypothesis import strategies as st

from hevopt import DataError, load_cycle
from hevopt.car_files.engine import EngineFile
from hevopt.car_files.gearbox import GearboxFile
from hevopt.checks.validate import validate
from hevopt.driving.cycle import cycle_of, faults_in
from hevopt.files.lookup import shipped_folder
from hevopt.files.toml import faults_of, read_contents

SHIPPED = shipped_folder("architectures")
COMPONENTS = SHIPPED / "components"
BAD = """
name = "bad"
car = { file = "car_compact", mass_kg = -5, tyre_radius_m = "x" }
engine = "my_engine"
gearbox = "gearbox_manual_66"
machine = "machine_flywheel_18kw"
battery = "battery_liion_64"
hybrid_mas_kg = 80
functions = ["start_stop", "boost"]
[coupling]
kind = "gearbox_inputt"
second_clutch = 1
"""


@pytest.fixture
def folder(monkeypatch, tmp_path):
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def bad(folder):
    """An architecture with four faults of its own, two in its overrides, three in a file, one missing file."""
    (folder / "components").mkdir()
    text = (COMPONENTS / "engine_diesel_1600.toml").read_text()
    text = re.sub("idle_rpm = .*", "idle_rpm = 8500.0", text)
    text = re.sub("inertia_kgm2 = .*", "inertia_kg2 = 0.2", text, count=1)
    (folder / "components" / "my_engine.toml").write_text(text)
    (folder / "bad.toml").write_text(BAD)
    return "bad.toml"


def test_all_faults_of_an_architecture_and_its_components_are_listed_with_key_value_and_range(bad):
    found = validate(bad)
    assert (found.kind, found.count) == ("architecture", 10)
    for place, words in [
        (
            "bad.toml",
            "functions.1 = 'boost': close matches: e_boost; allowed: 'start_stop', 'e_boost'",
        ),
        ("bad.toml", "unknown key hybrid_mas_kg; close matches: hybrid_mass_kg; allowed: name"),
        (
            "bad.toml",
            "coupling.kind = 'gearbox_inputt': close matches: gearbox_input, gearbox_output; allowed: 'none'",
        ),
        ("bad.toml", "coupling.second_clutch = 1: true or false is needed"),
        ("car.mass_kg, car.tyre_radius_m changed in bad.toml", "mass_kg = -5; allowed: 50 to 1000"),
        ("changed in bad.toml", "tyre_radius_m = 'x': a number is needed"),
        ("my_engine.toml", "idle_rpm = 8500.0; allowed: 50 to 5000"),
        ("my_engine.toml", "inertia_kgm2 is missing"),
        ("my_engine.toml", "unknown key inertia_kg2; close matches: inertia_kgm2"),
        (
            "bad.toml, gearbox",
            "component 'gearbox_manual_66' not found; close matches: gearbox_manual_6",
        ),
    ]:
        assert any(f"{place}: {words}" in fault for fault in found.faults), (place, words)


def test_all_files_are_reported_at_once_and_the_good_ones_named(bad, monkeypatch, capsys):
    Path("c.csv").write_text("time_s,speed_kmh\n0,0\n1,-1\nx,2\n3,3\n2,4\n5,400\n6,1,2\n")
    status, out, _ = call(monkeypatch, capsys, "validate", bad, "C2", "c.csv", "nedc", "nix.toml")
    assert status == 2
    lines = out.splitlines()
    assert lines[0] == "bad.toml: architecture, 10 faults"
    assert (
        f"{SHIPPED / 'C2.toml'}: ok, architecture C2: 18 kW flywheel machine, two clutches" in lines
    )
    assert "c.csv: cycle, 5 faults" in lines
    for line, words in [
        (3, "speed_kmh is -1; allowed: 0 to 360"), (4, "time_s is 'x', not a number"), (6, "time 2 s after 3 s"),
        (7, "speed_kmh is 400; allowed: 0 to 360"), (8, "3 values, the header has 2"),
    ]:  # fmt: skip
        assert any(text.startswith(f"  c.csv, line {line}: {words}") for text in lines)
    assert any("ok, cycle nedc: 1180 s, 11.03 km, up to 120.0 km/h" in text for text in lines)
    assert "  nix.toml: cannot be read (No such file or directory); check the path" in lines


def test_good_files_alone_end_with_0(monkeypatch, capsys):
    names = [str(path) for path in sorted(SHIPPED.glob("**/*.toml"))]
    status, out, err = call(monkeypatch, capsys, "validate", *names, "nedc", "us06")
    assert (status, err) == (0, "")
    assert len(out.splitlines()) == len(names) + 2 and out.count(": ok, ") == len(names) + 2
    for kind in ("car", "engine", "gearbox", "machine", "battery", "architecture", "cycle"):
        assert f": ok, {kind} " in out


def test_a_fault_behind_two_files_is_listed_once(bad, monkeypatch, capsys):
    _, out, _ = call(monkeypatch, capsys, "validate", bad, "components/my_engine.toml")
    assert out.count("idle_rpm = 8500.0") == 1
    assert "components/my_engine.toml: engine, 3 faults\n  listed above: 3\n" in out


def test_a_long_list_of_faulty_lines_is_cut_and_counted(folder):
    rows = "\n".join(f"{k},{-k}" for k in range(1, 101))
    Path("c.csv").write_text(f"time_s,speed_kmh\n{rows}\n")
    found = validate("c.csv")
    assert found.count == 100 and len(found.faults) == 21
    assert found.faults[-1] == "c.csv: and 80 more"


def test_study_files_are_checked_with_all_they_name(bad):
    Path("compare.toml").write_text(
        'cycle = "nix.csv"\narchitectures = ["C3", "bad.toml"]\nstrategies = ["dpp"]\nmass_kg = 1\n'
    )
    found = validate("compare.toml")
    assert (found.kind, found.count) == ("study file of compare", 14)
    text = "\n".join(found.faults)
    for words in ("mass_kg = 1; allowed: 50", "'C3' not found; close matches: C2", "'boost'", "nix.csv does not",
                  "strategy 'dpp' not found; close matches: dp"):  # fmt: skip
        assert words in text
    Path("sweep.toml").write_text(
        'architecture = "C2"\ncycles = ["nedcc"]\nstrategies = ["xx"]\n[parameters]\nmachine.power = [1]\n'
    )
    found = validate("sweep.toml")
    assert (found.kind, found.count) == ("study file of sweep", 3)
    Path("good.toml").write_text('cycle = "nedc"\narchitectures = ["A"]\nauxiliaries_w = 300\n')
    assert validate("good.toml").about == "nedc, A" and not validate("good.toml").faults
    Path("unfit.toml").write_text('architectures = ["A"]\nsoc_end = 0.5\n')
    assert "not for A" in validate("unfit.toml").faults[0]


def test_every_fault_that_a_study_sets_in_its_cars_is_listed_once(folder):
    Path("study.toml").write_text(
        'architectures = ["A", "C2"]\nstrategies = ["dp"]\nsoc_start = 0.9\nshift_cost_g = 0.2\nhorizon_s = 9\n'
        '[set]\nmachine.powr_max_w = 2e4\nengine.scale.displacement = "big"\nfoo.x = 1\ngearbox.ratios.7 = 1\n'
    )
    found = validate("study.toml")
    for words in (
        "set: unknown key foo; allowed: name",
        "set machine: unknown key powr_max_w; close matches: power_max_w",
        "set engine: scale.displacement = 'big': a number is needed",
        "set gearbox: change of 'gearbox.ratios.7': 'gearbox.ratios' is a list of 6 values",
        "strategies: horizon_s 9: no strategy asked for looks ahead",
        "settings: shift_cost_g = 0.2: not for A, C2",
        "start 0.9 must lie in [0.4, 0.8]",
    ):
        assert sum(words in fault for fault in found.faults) == 1, (words, found.faults)
    assert found.count == 7
    Path("study.toml").write_text('mass = 1\n[set]\nbattery = "nix"\nengine.idle_rpm = -1\n')
    text = "\n".join(validate("study.toml").faults)
    assert "unknown key mass;" in text and "component 'nix' not found" in text
    assert "set engine: idle_rpm = -1; allowed: 50 to 5000" in text


def test_shipped_names_of_every_kind_are_known(folder):
    for name, kind in (("C2", "architecture"), ("engine_diesel_1600", "engine"), ("nedc", "cycle")):
        found = validate(name)
        assert (found.kind, found.faults) == (kind, [])
    (fault,) = validate("engine_disel_1600").faults
    assert "close matches: engine_diesel_1600" in fault


@pytest.mark.parametrize(
    ("name", "contents", "words"),
    [
        ("x.toml", b"x = [", "not valid TOML"),
        ("x.toml", b"\x00\xff", "not UTF-8"),
        ("x.toml", b"", "those of no known file; expected: architecture, car, engine"),
        ("x.toml", b'name = "x"', "those of no known file"),
        ("x.toml", b"a." * 3000 + b"b = 1", "nested too deeply"),
        ("x.csv", b"", "x.csv: empty; expected a header line"),
        ("x.csv", b"a,b\n1,2\n", "line 1: unknown column 'a'"),
        ("x.csv", b"time_s,speed_kmh\n1e308,0\n-1e308,0\n", "time_s is 1e+308; allowed"),
        ("x.csv", b"time_s,speed_kmh,gear\n0,0,1e300\n1,3,0.5\n", "gear is 1e+300; allowed: 0 to 20"),
    ],
)  # fmt: skip
def test_what_is_no_known_file_says_so(folder, name, contents, words):
    Path(name).write_bytes(contents)
    found = validate(name)
    assert found.count >= 1 and words in found.faults[0]


def test_a_cycle_is_recognised_by_its_header_too(folder):
    Path("trace.txt").write_text("# mine\ntime_s,speed_kmh\n0,0\n10,36\n20,0\n")
    found = validate("trace.txt")
    assert (found.kind, found.faults) == ("cycle", [])


def test_checks_of_a_whole_table_are_made_although_another_key_is_wrong():
    gearbox = read_contents(COMPONENTS / "gearbox_manual_6.toml")
    del gearbox["name"]
    gearbox["ratios"][0] = 1.0
    gearbox["shift_speeds"]["down_kmh"][1] = 60
    count, faults = faults_of(gearbox, GearboxFile, 20)
    assert count == 3
    assert faults[0] == "name is missing; add the key"
    assert set(faults[1:]) == {
        "ratios must fall from first gear to last",
        "each down_kmh must be below its up_kmh",
    }
    engine = read_contents(COMPONENTS / "engine_diesel_1600.toml")
    engine |= {"idle_rpm": 60, "bore_mm": 1, "scale": {"torque": 1.0, "power": 1.0}}
    _, faults = faults_of(engine, EngineFile, 20)
    assert faults[0] == "bore_mm = 1; allowed: 10 to 1000"
    assert "scale: give exactly one of" in faults[1] and "idle_rpm 60 must lie within" in faults[2]
    # A check that asks for a key that is wrong itself is left out.
    _, faults = faults_of({**engine, "idle_rpm": -1, "scale": {"torque": 1.0}}, EngineFile, 20)
    assert len(faults) == 2


CELLS = st.sampled_from(["0", "1", "5", "-1", "900", "1e9", "x", "", "nan", "0.5", "7200"])
LINES = st.lists(st.lists(CELLS, min_size=2, max_size=4).map(",".join), max_size=6)


@given(lines=LINES, header=st.sampled_from(["time_s,speed_kmh,gear", "time_s,speed_mps,grade"]))
@settings(max_examples=150, deadline=None, derandomize=True)
def test_a_cycle_has_faults_exactly_where_it_does_not_load(tmp_path_factory, lines, header):
    path = tmp_path_factory.getbasetemp() / "fuzzed.csv"
    rows = [f"{k},{line}" for k, line in enumerate(lines)]
    path.write_text("\n".join([header, *rows, ""]))
    faults = faults_in(path)
    try:
        load_cycle(path)
    except DataError as error:
        assert str(error) in map(str, faults)
        assert len(faults) <= 8 * (len(lines) + 1)
    else:
        assert faults == []


def test_loading_a_cycle_and_validating_it_read_alike():
    for path in shipped_folder("cycles").glob("*.csv"):
        assert faults_in(path) == []
        assert cycle_of(path, path.read_text()).duration_s == load_cycle(path).duration_s


def test_a_study_that_names_itself_or_another_is_told_that_it_is_no_architecture(folder):
    text = 'cycle = "nedc"\narchitectures = ["./{}.toml"]\nstrategies = ["baseline"]\n'
    for name, other in (("alone", "alone"), ("one", "two"), ("two", "one")):
        Path(f"{name}.toml").write_text(text.format(other))
    for name, other in (("alone", "alone"), ("one", "two")):
        (fault,) = validate(f"{name}.toml").faults
        assert f"./{other}.toml is no architecture but of the kind study file of compare" in fault
    Path("c.toml").write_text('cycle = "./alone.toml"\narchitectures = ["A"]\n')
    (fault,) = validate("c.toml").faults
    assert "cycle: ./alone.toml is no cycle but of the kind study file of compare" in fault


def test_what_is_named_twice_is_refused_as_compare_does_and_read_once(folder, monkeypatch, capsys):
    Path("study.toml").write_text(
        'architectures = ["A", "A"]\nstrategies = ["baseline", "baseline"]\n'
    )
    found = validate("study.toml")
    assert found.count == 2
    for key, name in (("architectures", "A"), ("strategies", "baseline")):
        assert any(
            f"{key} = [" in f and f"'{name}' is given twice; give it once" in f
            for f in found.faults
        )
    assert call(monkeypatch, capsys, "compare", "study.toml").status == 2
    copy = (SHIPPED / "A.toml").read_text()
    Path("copy.toml").write_text(copy.replace('"C2"', '"A"'))
    Path("study.toml").write_text('architectures = ["A", "./copy.toml"]\n')
    (fault,) = validate("study.toml").faults
    assert "architecture A is given twice" in fault
    Path("study.toml").write_text(f"architectures = {['A'] * 5000}\n")
    (fault,) = validate("study.toml").faults
    assert "allowed: up to 1000 entries" in fault
    Path("study.toml").write_text("architectures = []\nstrategies = []\n")
    assert validate("study.toml").count == 2


def test_every_fault_of_a_sweep_is_listed_beside_unknown_keys(folder):
    Path("sweep.toml").write_text(
        'architecture = "C99"\ncycles = ["nedcc"]\nstrategies = ["bnd"]\nfoo = 1\n[parameters]\n'
        "machine.power_max_w = []\nnox_weight = 3\n"
    )
    faults = validate("sweep.toml").faults
    for words in (
        "unknown key foo",
        "'C99' not found",
        "'nedcc' not found",
        "machine.power_max_w = []",
        "nox_weight = 3",
        "strategy 'bnd' not found",
    ):
        assert sum(words in fault for fault in faults) == 1, (words, faults)
    text = Path("sweep.toml").read_text().replace("C99", "C2")
    Path("sweep.toml").write_text(text + "constraints = [3]\n[sample]\nmethod = 'x'\n")
    faults = validate("sweep.toml").faults
    for words in (
        "strategy 'bnd' not found",
        "constraints is a key of the whole file",
        "constraints.0 = 3: text in quotes",
        "sample.count is missing",
        "sample.method = 'x'",
    ):
        assert sum(words in fault for fault in faults) == 1, (words, faults)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name = 'x'\nidle = 1\n'my key' = 2\n'my key' = 3\nz = 1\n", "'my key' is given twice (line 4)"),
        ("[fuel]\nname = 1\nname = 2", "name is given twice (line 3); leave one out"),
        ("[a.b]\n[a.b]\n", "Cannot declare a.b twice (at line 2"),
        ("[coupling]\nkind = true\nsecond_clutch = 2024-01-01\n", "kind = true: allowed:"),
        ("[coupling]\nkind = 'none'\nsecond_clutch = 2024-01-01\n", "second_clutch = 2024-01-01: true"),
        ("[coupling]\nkind = 'none'\nsecond_clutch = [true, { a = 1 }]\n", "= [true, { a = 1 }]: true"),
    ],
)  # fmt: skip
def test_messages_about_toml_name_the_key_and_speak_toml(folder, text, words):
    Path("x.toml").write_text(text)
    assert any(words in fault for fault in validate("x.toml").faults), validate("x.toml").faults


def test_close_matches_of_a_component_are_those_of_its_kind_beside_the_file_too(folder):
    car = (SHIPPED / "C2.toml").read_text()
    (folder / "components").mkdir()
    for name in ("my_C2_engine", "my_C2_gearbox", "diesel_small"):
        (folder / "components" / f"{name}.toml").write_text("")
    for name, words in [
        ("my_C2_engin", "close matches: my_C2_engine; available: diesel_small, my_C2_engine, engine_"),
        ("./components/my_C2_engin.toml", "there with a close name: my_C2_engine; give the path"),
    ]:  # fmt: skip
        Path("car.toml").write_text(re.sub("^engine = .*", f'engine = "{name}"', car, flags=re.M))
        (fault,) = validate("car.toml").faults
        assert words in fault and "gearbox" not in fault.split("engine:")[1], fault
