"""Sizing: requirements by the performance models, the best of a lattice by hand, the search, and what is wrong."""

import json
import sys
from itertools import pairwise, product

import pytest
from command_line import call
from sizing_helpers import CYCLE, HEAD

from hevopt import load_architecture
from hevopt.driving.cycle import load_cycle
from hevopt.errors import DataError
from hevopt.forward.performance import performance
from hevopt.powertrain.powertrain import build_problem
from hevopt.sizing.candidates import Fate
from hevopt.sizing.requirements import RequirementFile, reached
from hevopt.sizing.study_file import read_size_study
from hevopt.studies.case import dp_case
from hevopt.sweeps.store.reading import open_to_read

FAST = '[[require]]\nfigure = "time_to_speed_s"\nspeed_kmh = 100\nboost = true\nat_most = {}\n'
SIZES = {"engine.scale.displacement": (1.0,), "machine.scale.power": (0.7, 1.5)}
LATTICE = "[parameters]\nengine.scale.displacement = [0.8, 1.0]\nmachine.scale.power = [0.7, 1.5]\n"


def by_hand(tmp_path) -> dict[tuple[float, float], tuple[float, float]]:
    """(engine, machine) -> time to 100 km/h and fuel of the lattice, each design driven and solved by itself."""
    cycle, found = load_cycle(tmp_path / "short.csv"), {}
    for sizes in product(*SIZES.values()):
        car = load_architecture("C2", dict(zip(SIZES, sizes, strict=True)))
        case = dp_case(car, cycle, build_problem(car, cycle))
        time_s = performance(car, boosts=True).to_speed_s[100]
        found[sizes] = time_s, case.dp_trajectory.cost_kg
    return found


def test_the_best_of_a_lattice_is_that_of_every_design_solved_and_moves_with_a_requirement(
    sized, tmp_path
):
    lattice = "[parameters]\n" + "".join(
        f"{key} = {list(values)}\n" for key, values in SIZES.items()
    )
    moved = []
    for most_s in (14.0, 9.8):
        found = sized(FAST.format(most_s) + lattice, f"s{most_s}")
        assert found.lattice and len(found.found) == 2
        best = found.best
        moved.append(tuple(best.design.values[key] for key in SIZES))
        assert all(one.excess <= 0 for one in best.required)
        assert found.least <= best.values[0] and best.bound_l_per_100km[0] <= best.values[0]
    alone = by_hand(tmp_path)
    for most_s, sizes in zip((14.0, 9.8), moved, strict=True):
        allowed = {each: fuel for each, (time_s, fuel) in alone.items() if time_s <= most_s}
        assert sizes == min(allowed, key=allowed.get)
    assert moved[0] != moved[1]


def test_ten_times_the_battery_is_never_free(sized):
    found = sized("[parameters]\nbattery.scale.capacity = [1.0, 10.0]\n")
    assert found.best.design.values == {"battery.scale.capacity": 1.0}
    cars = [one.car for one in found.found]
    assert cars[1].vehicle.mass_kg > cars[0].vehicle.mass_kg + 300


def test_the_search_repeats_itself_and_takes_what_the_store_has(sized):
    text = "trials = 12\nseed = 3\n" + FAST.format(11.5)
    text += "[parameters]\nengine.scale.displacement = { from = 0.7, to = 1.2 }\n"
    text += "machine.scale.power = { from = 0.5, to = 2.0 }\nengine.start_fuel_g = [0.1, 0.2]\n"
    first, again, fresh = sized(text), sized(text), sized(text, "other")
    rows = [
        [(one.design.values, one.fate, one.values) for one in f.found]
        for f in (first, again, fresh)
    ]
    assert rows[0] == rows[1] == rows[2] and len(rows[0]) >= 12 and not first.lattice
    assert first.counts[Fate.SOLVED] and first.counts[Fate.MISSES]
    solved = [one.values[0] for one in first.solved]
    assert first.best.values[0] == min(solved)
    for one in first.found:
        if one.fate is Fate.DISCARDED:
            assert one.bounds[0] >= min(solved)
    with open_to_read(first.store) as reader:
        pruned = {found.design: found for found in reader.pruned()}
    discarded = {one.design.number: one for one in first.found if one.fate is Fate.DISCARDED}
    assert pruned.keys() == discarded.keys() and pruned
    for number, one in pruned.items():
        assert one.bound == discarded[number].bounds[0] >= one.objective


def test_a_front_of_fuel_and_price_has_no_design_that_another_beats(sized):
    text = 'objectives = ["fuel", "price"]\n[parameters]\nmachine.scale.power = [0.5, 1.0, 2.0]\n'
    found = sized(text + '[derived]\nmachine.price_pkw = "20"\nbattery.price_pkwh = "800"\n')
    values = [one.values for one in found.front]
    assert values == sorted(values) and len(values) >= 1
    assert all(b[1] < a[1] for a, b in pairwise(values))
    assert found.front[-1].values[1] == pytest.approx(0.5 * 18 * 20 + 64 * 7 * 3.585e-3 * 800)


def test_a_trailer_needs_more_slope_than_the_car_alone():
    car = load_architecture("C2")
    asked = [
        RequirementFile(figure="start_slope", at_least=0.12, trailer_kg=kg) for kg in (0.0, 1000.0)
    ]
    alone, towing = reached(car, asked)
    assert alone.reached == performance(car).start_slope
    assert 0 < towing.reached < 0.7 * alone.reached
    assert "trailer 1000 kg" in towing.name


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (FAST.format(1.0) + LATTICE, "no design meets what is asked"),
        ('objective = "fun"\n' + LATTICE, "objective 'fun'; allowed: fuel, co2, price, mass"),
        ('objective = "fuel"\nobjectives = ["fuel", "co2"]\n' + LATTICE, "not both"),
        ("weights = [1.0, 2.0]\n" + LATTICE, "weights: 2 for 1 cycles"),
        ('strategies = ["dp"]\n' + LATTICE, "a sizing has one strategy"),
        ('[[require]]\nfigure = "slope"\nat_least = 0.1\n' + LATTICE, "needs speed_kmh"),
        ('[[require]]\nfigure = "slope"\nspeed_kmh = 60\nat_least = 0.1\n' + LATTICE, "allowed: 50, 90, 130"),
        ('[[require]]\nfigure = "top_speed_kmh"\nat_most = 180\n' + LATTICE, "needs at_least, and no at_most"),
        ('objective = "price"\n' + LATTICE, "no part has a price"),
        ("[parameters]\nnox_weight = [0.0, 1.0]\n", "no size of a car"),
        ("tirals = 3\n" + LATTICE, "tirals"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_message(tmp_path, sized, text, words, monkeypatch, capsys):
    path = tmp_path / "wrong.toml"
    path.write_text(HEAD + text)
    if "no design" in words or "price" in words:
        monkeypatch.setattr("hevopt.sizing.size.workers", None)
        if "price" in words:
            with pytest.raises(DataError, match=words):
                sized(text)
            return
        found = sized(text)
        assert found.best is None and found.counts[Fate.MISSES] == 4
        from hevopt.sizing.size import _none_message

        assert words in _none_message(found) and "in place of 1" in _none_message(found)
        return
    with pytest.raises(DataError) as fault:
        read_size_study(path)
    assert words in str(fault.value)


def test_the_command_says_what_it_found_and_goes_on_from_its_store(tmp_path, monkeypatch, capsys):
    (tmp_path / "short.csv").write_text(CYCLE)
    path = tmp_path / "s.toml"
    path.write_text(HEAD + "[parameters]\nmachine.scale.power = [0.9, 1.1]\n")
    seen = call(monkeypatch, capsys, "size", path, "--jobs", 1)
    assert seen.status == 0, seen.err
    for words in (
        "best design: least fuel",
        "machine.scale.power",
        "no design of this lattice is below",
    ):
        assert words in seen.out
    page = tmp_path / "page.html"
    assert call(monkeypatch, capsys, "report", tmp_path / "s.sqlite", "--out", page).status == 0
    section = page.read_text().partition("Proven of the sizes")[2].partition("</ul>")[0]
    assert "no design of this lattice is below" in section and "l/100 km" in section
    assert "Sizing s.toml" in page.read_text() and "no result yet" not in page.read_text()
    again = call(monkeypatch, capsys, "size", path, "--json")
    found = json.loads(again.out)
    assert found["lattice"] and found["designs"]["tried"] == 2
    assert found["best"]["values"][0] >= found["least_bound"] > 0


def test_ranges_without_optuna_are_one_message_and_leave_no_store(tmp_path, monkeypatch, capsys):
    (tmp_path / "short.csv").write_text(CYCLE)
    path = tmp_path / "s.toml"
    path.write_text(HEAD + "[parameters]\nmachine.scale.power = { from = 0.9, to = 1.1 }\n")
    monkeypatch.setitem(sys.modules, "optuna", None)
    seen = call(monkeypatch, capsys, "size", path)
    assert seen.status == 2 and 'pip install "hevopt[sizing]"' in seen.err, seen.err
    assert not (tmp_path / "s.sqlite").exists()
