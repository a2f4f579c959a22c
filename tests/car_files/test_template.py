"""Copies of architectures for editing, and the JSON Schema of what they may hold."""

import json
import re
import tomllib
from functools import cache
from itertools import pairwise
from pathlib import Path

import jsonschema
import pytest
from command_line import call
from conftest import ARCHITECTURES

from hevopt import DataError, load_architecture
from hevopt.car_files.meanings import MEANINGS
from hevopt.car_files.schema import MODELS, schema
from hevopt.car_files.template import new_files
from hevopt.files.lookup import shipped_folder

SHIPPED = shipped_folder("architectures")
KIND = re.compile(r"(car|engine|gearbox|machine|battery)_")


def written(folder: Path, name: str, like, **settings) -> Path:
    """The architecture of `new_files`, written with its components."""
    out = folder / f"{name}.toml"
    files = new_files(name, like, out, **settings)
    for path, text in files.items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    assert out in files
    return out


def but_name(contents) -> dict:
    return {**contents, "name": ""}


@pytest.mark.parametrize("like", ARCHITECTURES)
@pytest.mark.parametrize("components", [(), ("engine", "machine"), ("all",)])
def test_a_copy_loads_at_once_and_holds_the_same_values(tmp_path, like, components):
    path = written(tmp_path, "mine", like, components=components)
    car, original = load_architecture(path), load_architecture(like)
    assert car.name == "mine"
    assert but_name(car.contents) == but_name(original.contents)
    own = [p for p in car.files if p.parent == tmp_path / "components"]
    assert len(own) == (5 if components == ("all",) else len(components))


def test_a_copy_of_a_copy_elsewhere_holds_the_same_values_and_its_comments_once(tmp_path):
    first = written(tmp_path, "one", "E", components=["battery"])
    text = first.read_text().replace(
        'engine = "engine_diesel_1600"',
        'engine = { file = "engine_diesel_1600", scale = { power = 1.25 } }  # [E] mine',
    )
    first.write_text(text)
    (tmp_path / "sub").mkdir()
    second = written(tmp_path / "sub", "two", first, components=["engine"])
    one, two = load_architecture(first), load_architecture(second)
    assert but_name(one.contents) == but_name(two.contents)
    assert one.files[1:2] == (tmp_path / "components" / "one_battery.toml",)
    assert two.files[1].samefile(one.files[1])
    assert two.engine.law.displacement_m3 == pytest.approx(1.25 * 1598e-6)
    again = second.read_text()
    assert again.count("Millo, Rolando, Andreata 2011, section 4.2") == 1
    assert again.count("[E] mine") == 1 and again.count("an architecture for hevopt") == 1


def test_every_key_is_explained_and_keeps_its_source(tmp_path):
    path = written(tmp_path, "mine", "C2", components=["all"])
    for file in [path, *(tmp_path / "components").iterdir()]:
        lines = file.read_text().splitlines()
        for before, line in pairwise(lines):
            if re.match(r"[a-z_0-9]+ = |\[", line):
                assert before.startswith("#: "), (file.name, line)
    engine = (tmp_path / "components" / "mine_engine.toml").read_text()
    assert "(mm); 10 to 1000\nstroke_mm = 80.5  # [S]\n" in engine
    assert "[F] Default coefficients for compression ignition of CO2MPAS" in engine
    assert "scale = { displacement = 1.25 }" in engine and "Willans" in engine
    battery = (tmp_path / "components" / "mine_battery.toml").read_text()
    assert "min = 0.4  # no source named" in battery
    assert "hybrid_mass_kg = 70.0  # [E]" in path.read_text()
    assert "kind series; shipped: none\n" in path.read_text()


def test_a_measured_map_is_copied_cell_by_cell(tmp_path):
    (tmp_path / "components").mkdir()
    loss = "[[0, nan], [1.5, 1e-7]]"
    (tmp_path / "components" / "mapped.toml").write_text(
        'name = "a map"\nkind = "map"\npower_max_w = 1e4\n[loss_map]\n'
        f"speed_rpm = [0, 6000]\ntorque_nm = [-50, 50]\nloss_w = {loss}\n"
    )
    text = (SHIPPED / "C2.toml").read_text().replace("machine_flywheel_18kw", "mapped")
    (tmp_path / "own.toml").write_text(text)
    path = written(tmp_path, "mine", tmp_path / "own.toml", components=["machine"])
    found, before = (
        load_architecture(p).contents["machine"]["loss_map"] for p in (path, tmp_path / "own.toml")
    )
    assert repr(found) == repr(before)


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("a b", {}, "allowed: up to 60 letters, digits, - and _"),
        ("../x", {}, "allowed: up to 60 letters"),
        ("c2", {}, "that of a shipped one (A, B, C1, C2, D, E, electric_compact, light_truck_p2, "),
        ("mine", {"like": "C3"}, "close matches: C2"),
        (
            "mine",
            {"components": ["motor"]},
            "available: car, engine, source, gearbox, machine, machine_2, machine_3, battery, all",
        ),
        ("mine", {"out": Path("mine.txt")}, "an architecture is a .toml file"),
    ],
)
def test_a_wrong_wish_is_one_message(tmp_path, monkeypatch, name, settings, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DataError) as found:
        new_files(name, **({"like": "C2"} | settings))
    assert words in str(found.value)


def test_nothing_is_overwritten_not_even_a_component(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "components").mkdir()
    (tmp_path / "components" / "mine_car.toml").write_text("mine")
    words = ("architectures", "new", "mine", "--like", "C2")
    status, _, err = call(monkeypatch, capsys, *words, "--components", "all")
    assert status == 2 and "mine_car.toml is there already; nothing was written" in err
    assert not (tmp_path / "mine.toml").exists()
    assert call(monkeypatch, capsys, *words)[0] == 0
    status, _, err = call(monkeypatch, capsys, *words)
    assert status == 2 and "mine.toml is there already" in err


def test_a_copy_burns_what_the_original_burns(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ("architectures", "new", "mine", "--like", "C2", "--components", "engine,car")
    assert call(monkeypatch, capsys, *words)[0] == 0
    words = ("--architectures", "C2,mine.toml", "--strategies", "dp", "--json", "--cycle", "hwfet")
    first, second = json.loads(call(monkeypatch, capsys, "compare", *words)[1])["rows"]
    alike = ("fuel_l_per_100km", "nox_mg_per_km", "bound_l_per_100km", "soc_end", "engine_starts")
    assert [first[key] for key in alike] == [second[key] for key in alike]


def shipped_files():
    found = []
    for path in sorted(SHIPPED.glob("**/*.toml")):
        kind = KIND.match(path.name)
        found.append(pytest.param(path, kind.group(1) if kind else "architecture", id=path.stem))
    return found


@cache
def checker_of(kind):
    """What holds a file against the schema of a kind, which is one itself."""
    checker = jsonschema.Draft202012Validator(schema(kind))
    checker.check_schema(checker.schema)
    return checker


@pytest.mark.parametrize(("path", "kind"), shipped_files())
def test_shipped_files_agree_with_the_schema(path, kind):
    contents = tomllib.loads(path.read_text(encoding="utf-8"))
    for wanted in (kind, None):
        checker_of(wanted).validate(contents)
    for other in set(MODELS) - {kind}:
        assert not checker_of(other).is_valid(contents)


@pytest.mark.parametrize(
    ("kind", "key", "value"),
    [
        ("car", "mass_kg", 20), ("car", "mass", 1300), ("engine", "idle_rpm", "slow"), ("car", "road_load", None),
        ("machine", "kind", "magic"), ("battery", "cells_in_series", 1.5), ("engine", "scale", {"power": 0}),
        ("architecture", "engine", {"idle_rpm": 800}), ("battery", "resistance_ohm", [-1.0]),
        ("engine", "scale", {}), ("engine", "scale", {"power": 1.1, "torque": 1.1}), ("machine", "scale", {}),
        ("machine", "kind", "map"), ("machine", "kind", "efficiency"), ("machine", "efficiency", 0.9),
        ("architecture", "coupling", {"kind": "gearbox_input"}), ("car", "name", ""),
        ("architecture", "coupling", {"kind": "belt", "machine_ratio": 2.0}), ("architecture", "engine", ""),
        ("architecture", "coupling", {"kind": "gearbox_output", "machine_ratio": 2.0}),
        ("car", "road_load", {"rolling_c0": 0.01}), ("car", "road_load", {"coastdown_c1_nspm": 1.0}),
        ("car", "road_load", {"rolling_c0": 0.01, "drag_area_m2": 0.7, "coastdown_c0_n": 100.0}),
    ],
)  # fmt: skip
def test_the_schema_refuses_what_the_reader_refuses(kind, key, value):
    name = {"architecture": "C2"}.get(kind) or load_architecture("C2").files[
        ["architecture", "battery", "gearbox", "car", "engine", "machine"].index(kind)
    ].stem
    folder = SHIPPED if kind == "architecture" else SHIPPED / "components"
    contents = tomllib.loads((folder / f"{name}.toml").read_text(encoding="utf-8"))
    checker = jsonschema.Draft202012Validator(schema(kind))
    assert checker.is_valid(contents)
    assert not checker.is_valid({**contents, key: value})
    with pytest.raises(ValueError):
        MODELS[kind].model_validate({**contents, key: value})


def test_the_schema_knows_what_a_component_may_have_changed():
    contents = tomllib.loads((SHIPPED / "C2.toml").read_text(encoding="utf-8"))
    checker = jsonschema.Draft202012Validator(schema("architecture"))
    for key, table, good in [
        ("engine", {"fuel": {"density_kgpl": 0.8}, "scale": {"power": 1.1}}, True),
        ("car", {"mass_kg": 1300, "road_load": {"drag_area_m2": 0.6}}, True),
        ("engine", {"idel_rpm": 800}, False),
        ("engine", {"fuel": {"density": 0.8}}, False),
        ("engine", {"fuel": {"file": "x"}}, False),
        ("car", {"mass_kg": 20}, False),
    ]:
        named = {"file": contents[key], **table}
        assert checker.is_valid({**contents, key: named}) == good, table


def test_every_key_has_a_unit_a_meaning_and_a_place_in_the_schema(monkeypatch, capsys):
    status, out, _ = call(monkeypatch, capsys, "architectures", "schema")
    assert status == 0
    printed = json.loads(out)
    assert printed["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    tables = printed["$defs"]
    whole = {name: table for name, table in tables.items() if not name.endswith("Changed")}
    assert {name: set(table["properties"]) for name, table in whole.items()} == {
        name: set(keys) for name, keys in MEANINGS.items()
    }
    mass = tables["CarFile"]["properties"]["mass_kg"]
    assert (mass["x-unit"], mass["minimum"], mass["maximum"]) == ("kg", 50, 100_000)
    assert "null" not in out
    assert call(monkeypatch, capsys, "architectures", "schema", "engin")[0] == 2


SUFFIX_UNITS = {
    "_kg": "kg", "_m": "m", "_kgm2": "kg m²", "_w": "W", "_n": "N", "_cm3": "cm³", "_mm": "mm", "_rpm": "1/min",
    "_g": "g", "_mjpkg": "MJ/kg", "_kgpl": "kg/l", "_nm": "Nm", "_gps": "g/s", "_kmh": "km/h", "_s": "s",
    "_ah": "Ah", "_v": "V", "_ohm": "Ω", "_a": "A", "_m2": "m²", "_spm": "s/m", "_kgpm3": "kg/m³", "_ws": "W s",
    "_ws2": "W s²", "_kgpkg": "kg/kg",
}  # fmt: skip


def test_units_are_those_of_the_keys_suffixes():
    checked = 0
    for table in MEANINGS.values():
        for key, (unit, _) in table.items():
            suffix = f"_{key.rpartition('_')[2]}" if "_" in key else ""
            if suffix in SUFFIX_UNITS:
                per = "1/" if key.endswith(f"_per{suffix}") else ""
                assert unit == per + SUFFIX_UNITS[suffix], key
                checked += 1
    assert checked > 40


def test_all_components_and_a_name_beside_are_refused_with_what_to_do():
    with pytest.raises(DataError, match="--components all,engine: all stands alone"):
        new_files("mine", "C2", components=["all", "engine"])
