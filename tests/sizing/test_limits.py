"""Linear constraints of sizes: their half spaces, the vertices that they leave, and bounds and cars within them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from hevopt.car_files.load import load_architecture
from hevopt.errors import DataError
from hevopt.output.sizing_tables import notes
from hevopt.powertrain.powertrain import build_problem
from hevopt.sizing.candidates import Candidate, Fate
from hevopt.sizing.found import Sizing
from hevopt.sizing.proof.limits import meets, vertices
from hevopt.sizing.proof.prove import prove
from hevopt.sizing.proof.space import Space
from hevopt.sizing.size import _proofs
from hevopt.sizing.study_file import read_size_study
from hevopt.studies.case import dp_case
from hevopt.sweeps.plan.constraints import parse
from hevopt.sweeps.plan.designs import Design
from hevopt.sweeps.plan.linear import half_spaces

RANGES = {"machine.scale.power": (0.6, 1.6), "battery.cells_in_series": (40, 120)}
CELLS = "battery.cells_in_series <= 60 * machine.scale.power"


@pytest.mark.parametrize(
    "text",
    [
        "a.x + 2*b <= 3 and a.x >= -(b - 1)/2",
        "1 < a.x + b < 2",
        "a.x * (1 + 1) - b*c >= c",
        "a.x == 2*b",
        CELLS.replace("battery.cells_in_series", "a.x").replace("machine.scale.power", "b"),
    ],
)
def test_half_spaces_hold_where_the_constraint_holds(text):
    lines, whole = half_spaces(text, {"c": 0.5})
    rule = parse(text, dict.fromkeys(("a.x", "b", "c"), "number"))
    rng, seen = np.random.default_rng(1), set()
    for _ in range(400):
        values = {"a.x": rng.uniform(-3, 3), "b": rng.uniform(-3, 3), "c": 0.5}
        if "==" in text and rng.random() < 0.5:
            values["a.x"] = 2 * values["b"]
        sums = [sum(f * values.get(key, 1.0) for key, f in line.items()) for line in lines]
        assert rule.holds(values) == (min(sums) >= 0)
        seen.add(rule.holds(values))
    assert whole and len(seen) == 2


@pytest.mark.parametrize(
    "text", ["a.x * b <= 3", "a.x < 1 or b < 1", "max(a.x, b) <= 2", "a.x != 1"]
)
def test_what_is_not_linear_is_left_out_and_said(text):
    lines, whole = half_spaces(f"{text} and a.x <= 2" if " or " not in text else text, {})
    assert not whole and lines == ([] if " or " in text else [{"": 2.0, "a.x": -1.0}])


def test_the_least_of_a_line_over_vertices_is_that_of_a_linear_program():
    rng = np.random.default_rng(2)
    empty = 0
    for n in range(60):
        low = rng.uniform(0.3, 0.9, 3)
        high = low + rng.uniform(0.1, 1.0, 3) * np.array([1, n % 5 > 0, 1])
        rows = rng.normal(size=(n % 4, 4))
        found = vertices(low, high, rows)
        slope = rng.normal(size=3)
        bounds = list(zip(low, high, strict=True))
        program = linprog(slope, A_ub=-rows[:, 1:], b_ub=rows[:, 0], bounds=bounds)
        empty += program.status == 2
        assert (program.status == 2) == (len(found) == 0)
        if len(found):
            assert (found[:, 1:] @ slope).min() == pytest.approx(program.fun, abs=1e-6)
            loose = rows + np.array([1e-6, 0.0, 0.0, 0.0])
            assert all(meets(loose, vertex[1:]) for vertex in found)
    assert 0 < empty < 30


def test_a_constraint_moves_bound_and_best_and_no_design_within_lies_below(urban):
    free = prove("C2", RANGES, urban, target_gap=0.01, boxes_max=7)
    found = prove("C2", RANGES, urban, constraints=[CELLS], target_gap=0.01, boxes_max=7)
    assert found.within == (CELLS,) and found.closed
    best = found.best
    assert best["battery.cells_in_series"] <= 60 * best["machine.scale.power"] + 1e-6
    assert found.best_l_per_100km > free.bound_l_per_100km
    space, rng = Space("C2", RANGES, {}, [CELLS]), np.random.default_rng(3)
    corners = space.root.corners[:, 1:]
    designs = [*corners, *(rng.dirichlet(np.ones(len(corners)), 4) @ corners)]
    for theta in filter(lambda each: each is not None, map(space.whole, designs)):
        car = space.car(theta)
        case = dp_case(car, urban, build_problem(car, urban))
        litres = case.dp_trajectory.cost_kg / 0.835 / urban.distance_m * 1e5
        assert litres >= found.bound_l_per_100km
    narrow = prove("C2", RANGES | {"machine.scale.power": (0.6, 0.8)}, urban, target_gap=0.01)
    same = prove("C2", RANGES, urban, constraints=["machine.scale.power <= 0.8"], target_gap=0.01)
    assert same.bound_l_per_100km == pytest.approx(narrow.bound_l_per_100km, rel=0.01)
    assert same.best["machine.scale.power"] <= 0.8 + 1e-9


def test_constraints_that_no_car_meets_are_said():
    with pytest.raises(DataError, match="no car of the ranges meets the constraints"):
        Space("C2", RANGES, {}, ["machine.scale.power >= 2"])
    space = Space("C2", RANGES, {}, ["machine.scale.power ** 2 <= 1"])
    assert space.apart and not space.within and len(space.root.rows) == 0


def test_a_sizing_says_which_constraints_its_range_is_proven_within(urban_file, tmp_path):
    square = "machine.scale.power ** 2 >= 0.3"
    (tmp_path / "s.toml").write_text(
        f'architecture = "C2"\ncycles = ["{urban_file}"]\nconstraints = ["{CELLS}", "{square}"]\n'
        "[parameters]\nmachine.scale.power = { from = 0.6, to = 1.6 }\n"
        "battery.cells_in_series = [40, 64]\n"
    )
    study = read_size_study(tmp_path / "s.toml")
    values = {"machine.scale.power": 1.1, "battery.cells_in_series": 64}
    one = Candidate(Design(0, values, tmp_path), Fate.SOLVED, load_architecture("C2", values))
    one.values = one.fuel_l_per_100km = (9.0,)
    sizing = Sizing(study, tmp_path / "s.sqlite", False, [one])
    (proof,) = _proofs(sizing, one)
    # 64 cells are held: the machine is at least 64/60.
    assert proof.best["machine.scale.power"] >= 64 / 60 - 1e-9 and proof.within == (CELLS,)
    text = notes(replace(sizing, proofs=(proof,)))
    assert f"with battery.cells_in_series = 64 that meets {CELLS} is below" in text
    assert f"requirements, and whether it meets {square} or not; the best is" in text
