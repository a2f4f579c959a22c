"""Fronts of fuel and NOx: inside they are plans, and nothing at all lies beyond their outside."""

import csv
import json
from itertools import pairwise

import numpy as np
import pytest
from command_line import call
from problems import every_plan, random_problem

from hevopt import (
    Battery,
    ControlTable,
    DataError,
    InfeasibleError,
    Problem,
    load_architecture,
    load_cycle,
    pareto,
    simulate,
    solve,
)
from hevopt.studies.fronts import in_units
from hevopt.studies.pareto import Front, HalfPlane, Point, front

# Strategies and weights whose plans are held against the outer front.
DRIVEN = (("conventional", 0), ("nox_cut", 0), ("ecms", 0), ("ecms", 30), ("dp", 7), ("dp", 300))


def reachable(problem):
    """Fuel and NOx of every plan that leaves enough charge, by enumeration."""
    fuel_kg, energy_j = every_plan(problem.with_nox_weight(0.0))
    with_nox_kg, _ = every_plan(problem.with_nox_weight(1.0))
    enough = energy_j >= problem.end_min_j - 1e-9
    return fuel_kg[enough], (with_nox_kg - fuel_kg)[enough]


def idle_battery():
    return Battery(np.array([0.0, 1.0]), np.array([100.0, 100.0]), np.zeros(2), np.zeros(2), 3600.0)


def two_steps():
    """The battery is never used; step 0 trades at 0.5 kg of fuel per kg of NOx, step 1 at 1.5; one choice is
    never the best."""
    fuel = 1e-4 * np.array([[1.0, 2.0, 1.8], [1.0, 4.0, 3.9]])
    nox = 1e-4 * np.array([[3.0, 1.0, 2.5], [3.0, 1.0, 2.9]])
    table = ControlTable.from_arrays(fuel, np.zeros_like(fuel), nox_kg=nox)
    return Problem(table, idle_battery(), 0.5, 0.5)


def test_a_front_by_hand_has_its_supported_points_and_corners_only():
    found = front(two_steps(), points_max=20, gap_enough=1e-9)
    plans = [(point.fuel_kg, point.nox_kg) for point in found.points]
    assert np.allclose(plans, 1e-4 * np.array([(2, 6), (3, 4), (6, 2)]), rtol=1e-12)
    assert found.gap < 1e-9
    # Between the weights of a point its half planes meet in that very point.
    assert np.allclose(found.corners[0], 1e-4 * np.array([6, 2]), rtol=1e-9)
    assert np.allclose(found.corners[-1], 1e-4 * np.array([2, 6]), rtol=1e-9)
    for point in found.points:
        assert all(a < b for a, b in pairwise(point.nox_weights))


def test_the_largest_gap_is_that_of_the_half_planes_known():
    """At 0 and 2 alone the points are (2, 6) and (6, 2): they tie at 1, where (3, 4) costs 7 and they cost 8;
    the half planes leave open their corner, 2 of fuel and 4 of NOx."""
    found = front(two_steps(), [0.0, 2.0])
    assert np.allclose(found.corners, [(4e-4, 2e-4)], rtol=1e-9)
    assert found.gap == pytest.approx(8 / 6 - 1, rel=1e-9)


def test_a_plan_that_ends_short_and_below_the_bound_has_no_gap():
    car, cycle = load_architecture("A"), load_cycle("nedc")
    short, level = Point((0.0,), 0.9, 0.0), Point((0.0,), 1.0 - 1e-12, 0.0)
    planes = (HalfPlane(0.0, 1.0, "one multiplier"),)
    gaps = [
        in_units(Front((point,), planes, (), 0.0), car, cycle, "ecms", 0).points[0].gap_percent
        for point in (short, level)
    ]
    assert gaps == [None, 0.0]


@pytest.mark.parametrize("seed", range(24))
def test_no_plan_at_all_lies_beyond_the_outer_front(seed):
    problem = random_problem(seed)
    fuel_kg, nox_kg = reachable(problem)
    if not len(fuel_kg):
        with pytest.raises(InfeasibleError):
            front(problem)
        return
    found = front(problem)
    for plane in found.half_planes:
        assert (fuel_kg + plane.nox_weight * nox_kg >= plane.bound_kg * (1 - 1e-12)).all()
    for point in found.points:
        distance = np.abs(fuel_kg - point.fuel_kg) + np.abs(nox_kg - point.nox_kg)
        assert distance.min() < 1e-12
    assert found.gap >= -1e-12
    for weight in np.linspace(0, found.half_planes[-1].nox_weight, 50):
        best = min(point.cost_kg(weight) for point in found.points)
        assert best <= (1 + found.gap) * (fuel_kg + weight * nox_kg).min() * (1 + 1e-9)


def test_no_strategy_crosses_the_outer_front_of_a_car(problem_of):
    problem = problem_of("C2", "nedc")
    # Beyond these weights a bound takes the dearest proof.
    found = front(problem, [0, 2, 4, 8, 16, 32, 64])
    assert 0 <= found.gap <= 0.02 and len(found.points) > 5
    fuel, nox = ([getattr(p, name) for p in found.points] for name in ("fuel_kg", "nox_kg"))
    assert (np.diff(fuel) > 0).all() and (np.diff(nox) < 0).all()
    slopes = np.diff(fuel) / -np.diff(nox)
    assert (np.diff(slopes) > 0).all()  # convex
    driven = 0
    for name, weight in DRIVEN:
        weighted = problem.with_nox_weight(weight)
        trajectory = simulate(weighted, solve(weighted, name).control)
        if trajectory.end_j < problem.end_min_j:
            continue
        driven += 1
        for plane in found.half_planes:
            cost = trajectory.total_fuel_kg + plane.nox_weight * trajectory.total_nox_kg
            assert cost >= plane.bound_kg, name
    assert driven >= 5


def test_weights_with_one_best_plan_share_a_point():
    found = front(two_steps(), [0.0, 0.1, 0.2, 1.0, 5.0])
    assert [point.nox_weights for point in found.points] == [(0.0, 0.1, 0.2), (1.0,), (5.0,)]
    assert len(found.half_planes) == 5


def test_without_nox_there_is_one_point():
    table = ControlTable.from_arrays(np.full((3, 2), 1e-4), np.zeros((3, 2)))
    found = front(Problem(table, idle_battery(), 0.5, 0.5))
    assert len(found.points) == 1 and found.corners == () and found.gap < 1e-9


def test_points_of_another_strategy_keep_the_optimums_half_planes():
    problem = two_steps()

    def first_control(_):
        return solve(problem, "dp")  # the plan of weight 0, whatever the weight

    found = front(problem, [0.0, 2.0], solve=first_control)
    assert len(found.points) == 1
    assert found.half_planes == front(problem, [0.0, 2.0]).half_planes
    assert found.gap == pytest.approx(14 / 10 - 1)


@pytest.mark.parametrize("weights", [[-1.0], [float("nan")], [2e6], []])
def test_a_weight_that_means_nothing_is_a_data_error(weights):
    with pytest.raises(DataError, match=r"allowed: 0 to|at least one"):
        front(two_steps(), weights)
    with pytest.raises(DataError, match="1 or more"):
        front(two_steps(), points_max=0)


def test_the_figures_are_those_of_the_front_in_the_units_of_a_report(problem_of):
    from hevopt import load_architecture, load_cycle

    car, cycle = load_architecture("B"), load_cycle("nedc")
    found = front(problem_of("B", "nedc"), [0.0, 50.0])
    figures = in_units(found, car, cycle, "dp", 0).as_dict()
    first, km = figures["points"][0], cycle.distance_m / 1e3
    assert first["fuel_l_per_100km"] == pytest.approx(found.points[0].fuel_kg / 0.835 / km * 100)
    assert first["nox_mg_per_km"] == pytest.approx(found.points[0].nox_kg * 1e6 / km)
    assert first["bound_l_per_100km"] <= first["fuel_l_per_100km"]
    for point in figures["points"]:
        edge = np.interp(
            point["nox_mg_per_km"],
            [corner["nox_mg_per_km"] for corner in figures["outer"]][::-1],
            [corner["fuel_l_per_100km"] for corner in figures["outer"]][::-1],
        )
        assert edge <= point["fuel_l_per_100km"] * (1 + 1e-12)


def test_from_python_it_is_the_front_of_the_command(monkeypatch, capsys):
    words = ("pareto", "B", "--weights", "0,20", "--auxiliaries", "400", "--json")
    by_command = json.loads(call(monkeypatch, capsys, *words)[1])
    found = pareto("B", weights=[0, 20], auxiliaries_w=400)
    assert {name: by_command[name] for name in found.as_dict()} == found.as_dict()
    table = found.to_frame()
    assert list(table["nox_weight"]) == [point.nox_weights[0] for point in found.points]
    assert table["fuel_l_per_100km"].dtype == "float64" and "points" in repr(found)


def test_a_front_of_ones_own_strategy_has_the_same_outer_front():
    weights = [0.0, 20.0]
    own = pareto(
        "B", weights=weights, strategy={"mine": lambda problem: solve(problem, "start_stop")}
    )
    dp = pareto("B", weights=weights)
    assert {point.strategy for point in own.points} == {"mine"}
    assert own.gap_percent >= dp.gap_percent
    bounds = {point.nox_weights[0]: point.bound_l_per_100km for point in dp.points}
    assert own.points[0].bound_l_per_100km == bounds[0.0]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"weights": [0], "points": 3}, "choose one"),
        ({"nox_weight": 3}, "give them as weights="),
        ({"strategy": ["dp", "ecms"]}, "the plans of one strategy"),
        ({"strategy": "sdp"}, "learns from other cycles"),
        ({"horizon_s": 5}, "no strategy asked for looks ahead"),
        ({"weights": [-1]}, "allowed: 0 to"),
        ({"wieghts": [1]}, "setting 'wieghts' not found"),
    ],
)
def test_a_mistake_in_python_is_one_message(settings, said):
    with pytest.raises(DataError) as error:
        pareto("B", **settings)
    assert said in str(error.value)


def test_the_command_shows_and_writes_one_front(monkeypatch, capsys, tmp_path):
    path = tmp_path / "front.csv"
    status, out, _ = call(monkeypatch, capsys, "pareto", "B", "--json", "--out", str(path))
    assert status == 0
    figures = json.loads(out)
    with path.open() as file:
        rows = list(csv.DictReader(file))
    plans = [row for row in rows if row["kind"] == "plan"]
    assert [float(row["fuel_l_per_100km"]) for row in plans] == [
        point["fuel_l_per_100km"] for point in figures["points"]
    ]
    assert len(rows) == len(figures["points"]) + len(figures["outer"])
    status, out, _ = call(monkeypatch, capsys, "pareto", "B", "--weights", "0,20")
    assert status == 0 and "no plan lies beyond" in out
    assert "continuous split" in out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--weights", "a"], "numbers separated by commas"),
        (["--weights", "1", "--points", "3"], "choose one"),
        (["--nox-weight", "3"], "--weights"),
        (["--strategy", "sdp"], "learns from other cycles"),
        (["--out", "front.txt"], ".csv"),
    ],
)
def test_a_users_mistake_is_one_message(monkeypatch, capsys, words, said):
    status, _, err = call(monkeypatch, capsys, "pareto", "B", *words)
    assert status == 2 and said in err and "Traceback" not in err


def test_a_refined_front_begins_at_the_refined_optimum(quick, monkeypatch, capsys):
    words = ("C2", "--refine", "--json")
    status, out, err = call(monkeypatch, capsys, "pareto", *words, "--weights", "0")
    assert status == 0, err
    point = json.loads(out)["points"][0]
    row = json.loads(call(monkeypatch, capsys, "run", *words).out)["rows"][0]
    assert point["fuel_l_per_100km"] == row["fuel_l_per_100km"]
    assert point["bound_l_per_100km"] <= point["fuel_l_per_100km"]
    words = ("pareto", "C2", "--weights", "0")
    assert "torque levels added" in call(monkeypatch, capsys, *words, "--refine").out
    _, out, _ = call(monkeypatch, capsys, *words, "--json")
    assert json.loads(out)["points"][0]["fuel_l_per_100km"] > point["fuel_l_per_100km"]
