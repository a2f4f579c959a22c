"""What a page says of its cars: sketches without two things in one place, and assumptions with their worth."""

import json
import re
from itertools import combinations

import pytest

from hevopt import load_architecture, load_cycle
from hevopt.files.lookup import grouped_names, shipped_names
from hevopt.pages.comparison.about import about_car
from hevopt.pages.comparison.assumptions import assumptions
from hevopt.pages.comparison.page import comparison_page
from hevopt.pages.comparison.results import Results
from hevopt.pages.comparison.saved_car import PartAbout
from hevopt.pages.comparison.sketch import sketch_of

CARS = shipped_names("architectures", ".toml") + grouped_names("architectures", ".toml")


@pytest.fixture(scope="module")
def nedc_cycle():
    return load_cycle("nedc")


def apart(drawn):
    """Every two icons have room for themselves and their labels."""
    for one, other in combinations(drawn.icons, 2):
        beside = abs(one.x - other.x) >= 80
        high, low = sorted((one, other), key=lambda icon: icon.y)
        assert beside or low.y - (high.y + high.tall) >= 60, (one, other)


@pytest.mark.parametrize("name", CARS)
def test_every_shipped_driveline_is_drawn_whole_and_apart(name, nedc_cycle):
    car = load_architecture(name)
    about = about_car(car, nedc_cycle)
    drawn = sketch_of(about)
    kinds = sorted(icon.kind for icon in drawn.icons)
    engine = ["engine"] if car.driveline.engine else []
    ends = [*engine, "battery", "wheels", *["machine"] * len(car.machines)]
    assert kinds == sorted([*(part.kind for part in about.parts), *ends])
    shafts = [line.name for line in drawn.lines if line.kind == "shaft"]
    assert sorted(shafts) == sorted(car.driveline.shafts)
    apart(drawn)
    left, top, width, height = drawn.box
    for icon in drawn.icons:
        assert left <= icon.x - 50 and icon.x + 50 <= left + width
        assert top <= icon.y - 14 and icon.y + icon.tall + 40 <= top + height


def test_a_part_is_drawn_between_the_shafts_that_it_joins(nedc_cycle):
    drawn = sketch_of(about_car(load_architecture("C2"), nedc_cycle))
    at = {line.name: line.x1 for line in drawn.lines if line.kind == "shaft"}
    icons = {icon.name: icon for icon in drawn.icons}
    assert at["crankshaft"] < icons["clutch"].x < at["gearbox input"] < icons["gearbox"].x
    assert icons["gearbox"].x < at["wheel"] < icons["wheels"].x
    assert icons["engine"].y == icons["clutch"].y == icons["gearbox"].y
    touching = [
        line for line in drawn.lines
        if line.kind == "joint" and line.y1 == icons["machine"].y and line.x1 == at["gearbox input"]
    ]  # fmt: skip
    assert touching  # the machine hangs on the gearbox's input, not on the crankshaft
    assert "machine on gearbox input" in drawn.words
    assert "clutch between crankshaft and gearbox input" in drawn.words


def test_a_driveline_of_ones_own_parts_is_drawn_too(nedc_cycle):
    about = about_car(load_architecture("E"), nedc_cycle)
    own = [
        PartAbout(kind="shaft brake", name="park brake", shafts=["even shaft"], note=""),
        PartAbout(kind="one-way clutch", name="freewheel", shafts=["odd shaft", "even shaft"], note=""),
    ]  # fmt: skip
    drawn = sketch_of(about.model_copy(update={"parts": [*about.parts, *own]}))
    assert {"park brake", "freewheel"} <= {icon.name for icon in drawn.icons}
    apart(drawn)
    long = [PartAbout(kind="gear", name="x" * 40, shafts=["wheel", "far"], note="")]
    (gear,) = (
        i for i in sketch_of(about.model_copy(update={"parts": long})).icons if i.kind == "gear"
    )
    assert len(gear.label) == 17 and gear.label.endswith("…")


def test_where_gears_come_from_is_said():
    with_gears, without = load_cycle("nedc"), load_cycle("wltc_class3b")
    assert without.gear is None
    car = load_architecture("C2")
    assert about_car(car, with_gears).gears == "cycle"
    assert about_car(car, without).gears == "shift speeds"
    assert about_car(car.with_free_gear(), with_gears).gears == "plan"
    assert about_car(load_architecture("prius_1998"), with_gears).gears == "none"


def by_words(results):
    return {a.what.split(",")[0].split(" ")[1]: " ".join(a.here) for a in assumptions(results)}


def test_assumptions_are_told_with_what_they_are_worth_here(nedc):
    found = by_words(nedc.results)
    row = next(
        row for row in nedc.results.rows
        if (row.figures.architecture, row.figures.strategy) == ("C2", "dp")
    )  # fmt: skip
    case, _, trajectory = nedc.solved["C2", "dp"]
    brakes_j = float((trajectory.flows["brake_power_w"] * case.problem.table.step_s).sum())
    kg = trajectory.total_fuel_kg
    percent = 100 * brakes_j * float(case.certificate.price_kgpj) / kg
    assert f"take {brakes_j / 1e3:.0f} of" in found["machine"]
    assert (
        f"C2: at most 50 % at 16 km/h, 80 % from 97 km/h; in {row.figures.strategy}"
        in found["machine"]
    )
    assert f"worth {percent:.1f} % of its fuel" in found["machine"]
    assert "A:" not in found["machine"]  # it recovers nothing
    assert re.search(r"C2\b[^:]*: 0.2 g a start; 11 to 28 starts", found["start"])
    # What is said of several cars alike is said once.
    assert "A, B, C1, C2, D: gears as the cycle lists them; 22 changes, 0.5 s without torque" in (
        " ".join(found.values())
    )
    assert "E: gears as the cycle lists them; 22 changes, under load" in " ".join(found.values())


def test_results_saved_without_their_cars_have_no_such_section(nedc):
    contents = json.loads(nedc.results.model_dump_json())
    for car in contents["cars"].values():
        del car["about"]
    older = Results.model_validate(contents)
    assert assumptions(older) == [] and 'id="cars"' not in comparison_page(older)
    text = nedc.path.read_text(encoding="utf-8")
    assert text.index('id="cars"') < text.index('id="table"') and text.count("<svg class") == 6
