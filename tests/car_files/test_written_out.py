"""Kinds of coupling written out as parts: the same driveline, read back."""

import numpy as np
import pytest
from split_cars import short

from hevopt import DataError, build_problem, load_architecture
from hevopt.car_files.template import new_files

KINDS = (
    "A", "B", "C1", "C2", "D", "E", "p0_p4_diesel", "prius_1998", "series_1500", "series_parallel_1500",
    "electric_compact",
)  # fmt: skip


def written(path, like):
    (target, text), *_ = new_files("mine", like, path / "mine.toml", parts=True).items()
    target.write_text(text)
    return load_architecture(target)


@pytest.mark.parametrize("like", KINDS)
def test_parts_say_what_a_kind_stands_for(tmp_path, like):
    own, line = written(tmp_path, like).driveline, load_architecture(like).driveline
    assert own.kind == "parts" != line.kind
    assert own.parts == line.parts
    assert (own.engine, own.machines) == (line.engine, line.machines)
    assert (own.free_engine_speed, own.follows_load) == (line.free_engine_speed, line.follows_load)


def test_parts_are_written_as_parts_again(tmp_path):
    first = written(tmp_path, "prius_1998")
    (path, text), *_ = new_files("again", first.source, tmp_path / "again.toml", parts=True).items()
    path.write_text(text)
    assert load_architecture(path).driveline == first.driveline


# An alternator that follows its load, a gear that opens above a speed, the two halves of a dual clutch gearbox.
@pytest.mark.parametrize("like", ["A", "D", "E"])
def test_a_table_of_parts_is_that_of_the_kind(tmp_path, like):
    cycle = short("us06", 150)
    own, kind = (
        build_problem(car, cycle, levels=6, allow_shortfall=True).table
        for car in (written(tmp_path, like), load_architecture(like))
    )
    for name in ("fuel_kg", "battery_power_w", "reject", "switch_fuel_kg", "switch_energy_j"):
        assert np.array_equal(getattr(own, name), getattr(kind, name)), name


def test_what_is_closed_together_is_written_as_well(tmp_path):
    car = written(tmp_path, "series_parallel_1500").source
    states = 'states = [{ closed = [] }, { closed = ["lock-up clutch"], engine = "on" }]\n'
    car.write_text(car.read_text() + states)
    line = load_architecture(car).driveline
    ((path, text),) = new_files("again", car, tmp_path / "again.toml", parts=True).items()
    path.write_text(text)
    assert load_architecture(path).driveline == line and len(list(line.states())) == 3


GEARS = """{ kind = "gearbox", name = "odd", first = "input", second = "wheel", gears = [1, 3, 5] },
  { kind = "gearbox", name = "even", first = "input", second = "wheel", gears = [2, 4, 6] },
"""


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        (GEARS.replace("4, 6", "3, 4, 6"), "gear 3 of .* is in both odd and even"),
        (GEARS.replace("2, 4", "2"), "gear 4 of .* is in no gearbox"),
        (GEARS.replace("4, 6", "4, 6, 7"), "gear 7: .* has 6 gears"),
        (GEARS.replace("gears = [2, 4, 6]", "preselected = true"), "preselected needs gears"),
        (GEARS.replace("[1, 3, 5]", "[1, 3, 5], shift_fuel_g = 0.1"), "these are listed"),
        (GEARS.replace("[1, 3, 5]", "[1, 3, 5], efficiency = 0.9"), "that of the architecture's gearbox"),
        (GEARS.replace("gears = [1, 3, 5]", "ratios = [3.0, 2.0], gears = [1]"), "does not use gears"),
        (GEARS.replace("gears = [1, 3, 5]", "ratios = [3.0, 2.0], efficiency = [0.9]"), "ratios has 2"),
        ('{ kind = "gear", name = "g", first = "input", second = "wheel", ratio = 3.0, efficiency = [0.9] },',
         "one efficiency is needed"),
        ('{ kind = "gear", name = "g", first = "input", second = "whele", ratio = 3.0 },' + GEARS,
         "g ends at 'whele', on which nothing else is"),
    ],
)  # fmt: skip
def test_gears_that_cannot_be_are_one_message(tmp_path, parts, words):
    path = tmp_path / "mine.toml"
    text = written(tmp_path, "C2").source.read_text()
    begin = text.index("parts = [")
    clutch = '{ kind = "clutch", name = "clutch", first = "crankshaft", second = "input", operation = "driver" },'
    text = text[:begin] + f"parts = [{clutch}\n{parts}]\n"
    path.write_text(text.replace('"gearbox input"', '"input"'))
    with pytest.raises(DataError, match=words):
        load_architecture(path)


def test_gears_of_a_free_gearbox_may_each_have_their_efficiency(tmp_path):
    rear = """{ kind = "gearbox", name = "rear", first = "rear machine", second = "wheel", ratios = [8.0, 4.0], \
efficiency = [0.96, 0.97], shift_fuel_g = 0.05 },"""
    car = written(tmp_path, "p0_p4_diesel").source
    text = car.read_text()
    line = next(line for line in text.splitlines() if 'name = "rear axle"' in line)
    car.write_text(text.replace(line, rear))
    box = load_architecture(car).driveline.boxes[-1]
    assert box.efficiencies == (1.0, 0.96, 0.97) and box.choice == "free"
    ((path, text),) = new_files("again", car, tmp_path / "again.toml", parts=True).items()
    path.write_text(text)
    assert load_architecture(path).driveline.boxes[-1] == box
