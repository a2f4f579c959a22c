"""Designs: every combination or a sample, by hand and by counting, and what constraints leave of them."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import qmc

from hevopt import load_architecture
from hevopt.errors import DataError
from hevopt.sweeps.plan.designs import car_of, designs_of, groups_of
from hevopt.sweeps.plan.parameters import Range
from hevopt.sweeps.plan.study_file import read_study

HEAD = 'architecture = "C2"\ncycles = ["nedc"]\nstrategies = ["bound"]\n'


@pytest.fixture
def designs(tmp_path):
    """Tables, and what stands before them -> the designs of a study."""

    def make(tables: str, above: str = ""):
        path = tmp_path / "study.toml"
        path.write_text(f"{HEAD}{above}\n[parameters]\n{tables}\n")
        return designs_of(read_study(path))

    return make


def sample(method: str, count: int, seed: int = 1) -> str:
    return f'\n[sample]\nmethod = "{method}"\ncount = {count}\nseed = {seed}\n'


def values(designs, key: str) -> list:
    return [design.values[key] for design in designs]


def test_every_combination_comes_in_the_order_of_the_file_the_last_fastest(designs):
    made = designs(
        "nox_weight = [0, 10]\nhybrid_mass_kg = { from = 60, to = 80, count = 3 }\n"
        'engine = ["engine_diesel_1600_steep_nox", "engine_diesel_1600"]'
    )
    engines = ("engine_diesel_1600_steep_nox", "engine_diesel_1600")
    expected = list(product((0.0, 10.0), (60, 70, 80), engines))
    assert [tuple(design.values.values()) for design in made] == expected
    assert [design.number for design in made] == list(range(12))
    assert made[7].changes == {"hybrid_mass_kg": 60, "engine": "engine_diesel_1600"}
    assert made[7].nox_weight == 10 and made[-1] == made[11] and made[2:4] == [made[2], made[3]]
    assert (made.duplicates, made.excluded) == (0, 0)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (Range(0.0, 0.3, 4, False), [0.0, 0.1, 0.2, 0.3]),
        (Range(3.8, 4.2, 5, False), [3.8, 3.9, 4.0, 4.1, 4.2]),
        (Range(1, 4, 3, False), [1, 2, 4]),  # 2.5 is rounded to the even 2
        (Range(1, 1000, 4, True), [1, 10, 100, 1000]),
        (Range(0.01, 100.0, 5, True), [0.01, 0.1, 1.0, 10.0, 100.0]),
        (Range(1 / 3, 2 / 3, 2, False), [1 / 3, 2 / 3]),
    ],
)
def test_a_range_has_both_ends_and_equal_steps(given, expected):
    found = [given.at(n, given.count - 1) for n in range(given.count)]
    assert found == expected and list(map(type, found)) == list(map(type, expected))


def test_whole_numbers_that_rounding_makes_equal_come_once(designs):
    made = designs("battery.cells_in_series = { from = 60, to = 63, count = 7 }")
    assert values(made, "battery.cells_in_series") == [60, 61, 62, 63]
    assert all(isinstance(cells, int) for cells in values(made, "battery.cells_in_series"))


@pytest.mark.parametrize("count", [1, 5, 64, 100])
def test_a_sobol_sample_is_the_start_of_the_sequence_whatever_its_length(designs, count):
    made = designs(
        "machine.power_max_w = { from = 1e4, to = 3e4 }\nhybrid_mass_kg = { from = 1.0, to = 1e2, log = true }"
        + sample("sobol", count, seed=7)
    )
    unit = qmc.Sobol(2, seed=7).random_base2(7)[:count]
    np.testing.assert_allclose(
        values(made, "machine.power_max_w"), 1e4 + 2e4 * unit[:, 0], rtol=1e-9
    )
    np.testing.assert_allclose(values(made, "hybrid_mass_kg"), 100 ** unit[:, 1], rtol=1e-9)


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube"])
def test_a_sample_depends_on_its_seed_alone(designs, method):
    power = "machine.power_max_w = { from = 1e4, to = 3e4 }"
    first, again, other = (list(designs(power + sample(method, 20, seed))) for seed in (3, 3, 4))
    assert first == again and first != other


def test_a_latin_hypercube_has_one_design_in_every_slice_of_every_parameter(designs):
    made = designs(
        "machine.power_max_w = { from = 1e4, to = 3e4 }\nnox_weight = { from = 0, to = 50 }\n"
        "hybrid_mass_kg = { from = 1.0, to = 1e2, log = true }" + sample("latin_hypercube", 50)
    )
    slices = {
        "machine.power_max_w": [(x - 1e4) / 2e4 for x in values(made, "machine.power_max_w")],
        "nox_weight": [x / 50 for x in values(made, "nox_weight")],
        "hybrid_mass_kg": [np.log10(x) / 2 for x in values(made, "hybrid_mass_kg")],
    }
    for places in slices.values():
        assert sorted(int(50 * x) for x in places) == list(range(50))


def test_lists_steps_and_whole_numbers_have_equal_shares_of_a_sample(designs):
    made = designs(
        'engine = ["engine_diesel_1600", "engine_diesel_1600_steep_nox"]\n'
        "battery.cells_in_series = { from = 61, to = 64 }\n"
        "hybrid_mass_kg = { from = 60, to = 90, count = 4 }\n"
        "machine.power_max_w = { from = 1e4, to = 2e4 }" + sample("sobol", 256)
    )
    for key, count in (("engine", 2), ("battery.cells_in_series", 4), ("hybrid_mass_kg", 4)):
        found = values(made, key)
        assert {found.count(value) for value in found} == {256 // count}
        assert len(set(found)) == count
    assert values(made, "hybrid_mass_kg").count(70) == 64


def test_designs_sampled_twice_are_dropped_and_counted(designs):
    made = designs("battery.cells_in_series = { from = 61, to = 64 }" + sample("sobol", 100))
    assert sorted(values(made, "battery.cells_in_series")) == [61, 62, 63, 64]
    assert made.duplicates == 96
    assert [design.number for design in made] == [0, 1, 2, 3]


def test_constraints_drop_designs_and_count_them(designs):
    made = designs(
        "battery.cells_in_series = [16, 32]\nmachine.power_max_w = [1e4, 2e4]\nnox_weight = [0, 1, 2]",
        'constraints = ["battery.cells_in_series * 730 >= machine.power_max_w", "nox_weight != 1"]',
    )
    pairs = [(16, 1e4), (32, 1e4), (32, 2e4)]
    assert [tuple(d.values.values()) for d in made] == [(*p, w) for p in pairs for w in (0.0, 2.0)]
    assert made.excluded == 12 - 6 and made[5].number == 5


@pytest.mark.parametrize(
    ("tables", "above", "words"),
    [
        ("nox_weight = [0, 1]", 'constraints = ["nox_weight > 1"]', "exclude each of 2 designs"),
        (
            "nox_weight = [1, 0]",
            'constraints = ["1 / nox_weight > 0"]',
            "has no value at nox_weight = 0.0 (division by zero)",
        ),
        (
            "nox_weight = { from = 0, to = 1, count = 1001 }\n"
            "hybrid_mass_kg = { from = 1.0, to = 9.0, count = 1000 }",
            "",
            "1001 x 1000 values make 1e+06 designs; allowed: up to 1000000",
        ),
        (
            "battery.soc.start = [0.5, 0.6, 0.75]\nhybrid_mass_kg = [60, 70]\n"
            "battery.soc.max = [0.7, 0.72, 0.8]",
            "",
            "(battery.soc.start = 0.75, battery.soc.max = 0.7, hybrid_mass_kg = 60) is no car: ",
        ),
        (
            "battery.soc.start = [0.5, 0.75, 0.6]\nbattery.soc.max = [0.9, 0.74, 0.8]",
            "",
            "(battery.soc.start = 0.75, battery.soc.max = 0.74) is no car: ",
        ),
    ],
)
def test_designs_that_cannot_be_are_one_message(designs, tables, above, words):
    with pytest.raises(DataError) as found:
        designs(tables, above)
    assert words in str(found.value) and "study.toml" in str(found.value)


def test_a_combination_that_is_no_car_is_found_among_a_million_at_its_extremes(designs):
    tables = (
        "battery.soc.start = { from = 0.5, to = 0.75, count = 100 }\n"
        "battery.soc.max = { from = 0.74, to = 0.9, count = 100 }\n"
        "nox_weight = { from = 0, to = 99, count = 100 }"
    )
    with pytest.raises(DataError, match=r"start = 0.75, battery.soc.max = 0.74\) is no car"):
        designs(tables)


def test_the_car_of_a_design_has_its_values(designs, tmp_path):
    made = designs(
        "battery.cells_in_series = [32, 96]\nmachine.power_max_w = [9e3]\nnox_weight = [5]"
    )
    car = car_of(read_study(tmp_path / "study.toml"), made[1])
    plain = load_architecture("C2")
    assert car.machines[0].power_max_w == 9e3
    assert car.battery.power_max_discharge_w * 64 == plain.battery.power_max_discharge_w * 96


def test_designs_that_differ_only_in_nox_weight_share_a_group(designs):
    made = designs("nox_weight = [0, 10]\nbattery.cells_in_series = [32, 64, 96]")
    assert groups_of(made) == [
        ({"battery.cells_in_series": 32}, [(0, 0.0), (3, 10.0)]),
        ({"battery.cells_in_series": 64}, [(1, 0.0), (4, 10.0)]),
        ({"battery.cells_in_series": 96}, [(2, 0.0), (5, 10.0)]),
    ]
    assert groups_of(designs("nox_weight = [0, 10]")) == [({}, [(0, 0.0), (1, 10.0)])]


DERIVED = """
[derived]
battery.parallel = "round(machine.scale.power)"
car.mass_kg = "1300 + 10 * machine.scale.power"
"""


def test_derived_keys_follow_from_the_parameters(designs):
    made = designs("machine.scale.power = [1.0, 2.5]" + DERIVED)
    assert [d.changes for d in made] == [
        {"machine.scale.power": 1.0, "battery.parallel": 1, "car.mass_kg": 1310},
        {"machine.scale.power": 2.5, "battery.parallel": 2, "car.mass_kg": 1325},
    ]
    assert made[1].values == {"machine.scale.power": 2.5}
    car = load_architecture("C2", made[1].changes)
    assert (
        car.battery.capacity_as == 2 * 7 * 3600 and type(made[1].changes["battery.parallel"]) is int
    )


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('car.mass_kg = "10 * machine.scale.powr"', "not found; close matches: machine.scale.power"),
        ('car.mass_kg = "__import__(1)"', "derived.car.mass_kg: expression"),
        ('car.mass_kg = "machine.scale.power > 1"', "it is a truth; a number is needed"),
        ("car.mass_kg = 1300", "an expression in quotes is needed"),
        ('machine.scale.power = "2"', "derived.machine.scale.power: a parameter as well"),
        ('nox_weight = "machine.scale.power"', "derived.nox_weight: no key of a car"),
        ('car.mas_kg = "1300"', "unknown key mas_kg"),
        ('car.mass_kg = "1300 / (machine.scale.power - 1)"', "has no value at machine.scale.power = 1.0"),
        ('battery.parallel = "machine.scale.power / 2"', "parallel = 0.5"),
    ],
)  # fmt: skip
def test_a_wrong_expression_is_one_message(designs, line, words):
    with pytest.raises(DataError) as found:
        designs(f"machine.scale.power = [1.0, 2.0]\n[derived]\n{line}")
    assert words in str(found.value) and "\n" not in str(found.value)
