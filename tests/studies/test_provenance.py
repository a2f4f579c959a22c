"""Architectures with changed keys, and the digests that tell one from another."""

import ast
from dataclasses import replace

import pytest

from hevopt import DataError, load_architecture, load_cycle
from hevopt.studies.comparison import compare
from hevopt.studies.provenance import (
    _files_of,
    _imported,
    _reached,
    cycle_contents,
    digest,
    files_digests,
    physics_digest,
    versions,
)


def test_a_changed_key_reaches_the_car_and_nothing_else():
    plain = load_architecture("C2")
    car = load_architecture(
        "C2", {"machine.power_max_w": 2e4, "hybrid_mass_kg": 80, "gearbox.ratios.0": 4.2}
    )
    assert car.machines[0] == replace(plain.machines[0], power_max_w=2e4)
    assert car.vehicle.mass_kg == plain.vehicle.mass_kg + 10
    assert car.gearbox.ratios[1] == pytest.approx(4.2 * 3.4)
    assert load_architecture("C2").contents == plain.contents


def test_a_component_can_be_another_file_or_that_file_with_other_keys(tmp_path):
    (tmp_path / "mine.toml").write_text(
        """
name = "mine"
car = "car_compact"
engine = { file = "engine_diesel_1600", start_fuel_g = 0.5, fuel = { density_kgpl = 0.8 } }
gearbox = "gearbox_manual_6"
machine = "machine_flywheel_18kw"
battery = "battery_liion_64"
functions = []
coupling = { kind = "crankshaft" }
"""
    )
    car = load_architecture(tmp_path / "mine.toml", {"engine.idle_rpm": 900})
    assert car.engine.start_fuel_kg == pytest.approx(5e-4)
    assert car.engine.fuel_density_kgpm3 == pytest.approx(800)
    assert car.engine.heating_value_jpkg == pytest.approx(42.9e6)
    assert (
        load_architecture("C2", {"engine": "engine_diesel_1600_steep_nox"}).engine.law.nox.lo == 0.5
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"machine.power_w": 1}, "unknown key power_w; close matches: power_max_w"),
        ({"machine.power_max_w": -1}, "machine.power_max_w changed: power_max_w = -1; allowed"),
        ({"gearbox.ratios.7": 1}, "'gearbox.ratios' is a list of 6 values; its entries are 0 to 5"),
        ({"name.x": 1}, "not a table"),
        ({"machine": "nope"}, "component 'nope' not found"),
        ({"machine": {"power_max_w": 1}}, 'needs file = "name"'),
        ({"battery.cells_in_series": 3.5}, "whole number"),
    ],
)
def test_a_wrong_change_is_one_message(changes, words):
    with pytest.raises(DataError, match=r"changed|change of|not found|C2.toml") as found:
        load_architecture("C2", changes)
    assert words in str(found.value)


def test_an_asked_end_charge_is_reached_by_the_optimum_and_judged_for_all():
    low = {"battery.soc.end": 0.5}
    neutral, plug_in = (
        compare("nedc", ["C2"], ["conventional", "ecms", "dp"], changes=c).rows for c in ({}, low)
    )
    for before, after in zip(neutral, plug_in, strict=True):
        assert after.fuel_l_per_100km < before.fuel_l_per_100km
        assert after.gap_percent >= 0
        off = after.soc_end - 0.5
        missed = "end charge above" if off > 0 else "end charge missed"
        assert str(after.status) == ("ok" if abs(off) < 0.01 else missed)
    optimum = plug_in[-1]
    assert 0.5 <= optimum.soc_end < 0.501 and optimum.gap_percent < 0.2


def test_a_digest_changes_with_any_value_and_not_with_the_order_of_keys():
    car = load_architecture("C2")
    assert digest({"a": 1.0, "b": [2]}) == digest({"b": [2], "a": 1.0})
    one_bit_more = car.vehicle.mass_kg * (1 + 2**-52)
    assert digest({"a": car.vehicle.mass_kg}) != digest({"a": one_bit_more})
    assert digest(car.contents) != digest(load_architecture("C2", {"hybrid_mass_kg": 71}).contents)
    assert digest(car.contents) != digest(car.with_free_gear().contents)
    cycle = load_cycle("nedc")
    assert digest(cycle_contents(cycle)) != digest(cycle_contents(load_cycle("udds")))
    assert len(physics_digest()) == 64 and {"hevopt", "python", "numpy"} <= set(versions())
    files = files_digests([car], [cycle])
    assert len(files) == 7 and any(name.endswith("nedc.csv") for name in files)


def test_the_text_of_a_module_tells_what_its_syntax_tree_imports():
    def by_tree(text):
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and f"{node.module}.".startswith("hevopt."):
                module = node.module.removeprefix("hevopt").removeprefix(".")
                yield from (
                    f"{module}.{name}".strip(".") for name in ("", *(a.name for a in node.names))
                )

    def files(modules):
        return {file for module in modules for file in _files_of(module)}

    reached = _reached()
    assert len(reached) > 150
    for path in reached:
        text = path.read_text("utf-8")
        found = files(by_tree(text))
        assert files(_imported(text)) == found and found <= reached
