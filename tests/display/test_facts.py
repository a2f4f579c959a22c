"""How objects show themselves: in one line, without their arrays, and harmless in a notebook."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from inspect import getmembers, isclass
from pathlib import Path
from pkgutil import walk_packages

import numpy as np
import pytest

import hevopt
from hevopt import Control, InfeasibleError
from hevopt.display.facts import Shown
from hevopt.studies.case import prepare
from hevopt.studies.comparison import Comparison
from hevopt.studies.pareto import front
from hevopt.studies.rows import Row, failed_row
from hevopt.studies.status import Status

LINE_MAX = 200


def public_dataclasses() -> dict[str, type]:
    """Every dataclass of the package whose name does not begin with an underscore, by module and name."""
    found = {}
    for module in walk_packages(hevopt.__path__, "hevopt."):
        for name, kind in getmembers(import_module(module.name), isclass):
            if is_dataclass(kind) and kind.__module__ == module.name and name[0] != "_":
                found[f"{module.name}.{name}"] = kind
    return found


def objects_in(root: object) -> Iterator[object]:
    """The dataclasses that an object is made of, itself first."""
    waiting, seen = [root], set()
    while waiting:
        one = waiting.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        if is_dataclass(one):
            yield one
            waiting += [getattr(one, part.name) for part in fields(one)]
        elif isinstance(one, Mapping):
            waiting += one.values()
        elif isinstance(one, list | tuple) and len(one) < 1000:
            waiting += one


def test_every_public_dataclass_that_holds_arrays_shows_itself_by_its_facts():
    bare = [
        name
        for name, kind in public_dataclasses().items()
        if any("NDArray" in str(part.type) or "ndarray" in str(part.type) for part in fields(kind))
        and kind.__repr__ is not Shown.__repr__
    ]
    assert not bare, f"derive from Shown, with repr=False: {', '.join(bare)}"


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """What a user meets of a car on a drive."""
    path = tmp_path_factory.mktemp("drives") / "short.csv"
    path.write_text("time_s,speed_kmh\n0,0\n5,0\n15,40\n40,40\n50,0\n")
    case = prepare(hevopt.load_architecture("C2"), hevopt.load_cycle(path))
    comparison = hevopt.compare(path, ["A", "C2"], ["dp", "ecms"])
    plain = hevopt.ControlTable.from_arrays(np.ones((3, 2)), np.zeros((3, 2)))
    return case, comparison, front(case.problem, [0.0, 10.0]), plain, hevopt.Plan([1, 2], {"a": 1})


def test_what_a_user_meets_is_told_in_one_line_without_arrays(shown):
    kinds = set()
    for one in (part for whole in shown for part in objects_in(whole)):
        if isinstance(one, Shown):
            line = repr(one)
            kinds.add(type(one).__name__)
            assert len(line) < LINE_MAX and "\n" not in line and "array([" not in line, line
            assert re.fullmatch(r"<table>.*</table>", one._repr_html_(), re.S)
    met = "Problem ControlTable Battery Plan Trajectory Certificate Comparison Architecture Cycle Engine Machine"
    assert set(met.split()) <= kinds


def test_a_line_tells_what_matters(shown):
    case, comparison, _, plain, plan = shown
    steps, controls = case.problem.table.fuel_kg.shape
    assert repr(case.problem).startswith(
        f"Problem(steps={steps}, controls={controls}, soc_start=0.6,"
    )
    assert (
        repr(plain) == "ControlTable(steps=3, controls=2, modes=1, duration_s=3, feasible='100%')"
    )
    assert repr(plan) == "Plan(steps=2, notes=(a))"
    assert repr(comparison) == "Comparison(cycle='short', rows=4, failed=0, reference='A dp')"
    fuel_kg = case.dp_trajectory.total_fuel_kg
    assert f"steps={steps}, fuel_kg={fuel_kg:.6g}" in repr(case.dp_trajectory)
    assert repr(case.cycle) == (
        "Cycle(name='short', samples=5, duration_s=50, distance_m=388.889, gears=False)"
    )


def test_a_notebook_shows_the_rows_of_a_comparison_failed_ones_among_them():
    car = hevopt.load_architecture("A")
    rows = [Row("A", "dp", Status(), 4.5), failed_row(car, "ecms", InfeasibleError("no plan"))]
    page = Comparison("c", rows)._repr_html_()
    assert page.count("<tr>") == 3 and "<td>4.5</td>" in page and "<td>failed: no plan</td>" in page
    assert "fuel_l_per_100km" in page and Comparison("c", [])._repr_html_().count("<tr>") == 1


@dataclass(frozen=True, slots=True, repr=False)
class Own(Shown):
    """What a test puts in."""

    first: object
    second: object = 0.5


def test_text_cannot_leave_its_cell_or_its_line():
    name = "<script>alert(1)</script>\n\x1b[31m\u202e"
    page = (
        Own(name, [name])._repr_html_()
        + Comparison(name, [Row(name, name, Status())])._repr_html_()
    )
    assert "<script>" not in page and "&lt;script&gt;" in page
    assert "\x1b" not in page and "\u202e" not in page
    assert "\n" not in repr(Own(name, name)) and "\x1b" not in repr(Own(name))


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (1 / 3, "0.333333"),
        (np.float64(2e7), "2e+07"),
        (np.bool_(True), "True"),
        (np.zeros((2, 3)), "array(2, 3)"),
        ("a'b", '"a\'b"'),
        ("x" * 60, "'" + "x" * 37 + "...'"),
        (Path("/home/somebody/car.toml"), "'car.toml'"),
        (frozenset({"b", "a"}), "(a, b)"),
        ({"price": np.ones(3)}, "(price)"),
        (tuple(range(7)), "7 entries"),
        ([{}, {}], "2 entries"),
        (Status(), "Status(...)"),
        (Control(True, 0, "a"), "(True, 0, a, 0)"),
        (print, "builtin_function_or_method"),
    ],
)
def test_a_value_is_told_in_a_few_words(value, said):
    assert repr(Own(value)) == f"Own(first={said}, second=0.5)"


def test_a_long_line_ends_with_the_facts_that_fit():
    line = repr(Own(tuple("abcdef"), ["y" * 40] * 4))
    assert line == "Own(first=(a, b, c, d, e, f), ...)"
