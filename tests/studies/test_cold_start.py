"""`--cold-start`: a correction beside the rows, which stay what they are."""

import json
from pathlib import Path

import pytest
from split_cars import short

from hevopt import load_architecture, simulate
from hevopt.car.warming import warmed
from hevopt.strategies import baseline
from hevopt.studies.case import prepare
from hevopt.studies.cold_start import cold_figures


def test_figures_of_a_row_are_those_of_its_steps():
    car, cycle = load_architecture("A"), short("udds", 195)
    case = prepare(car, cycle)
    run = simulate(case.problem, baseline.solve(case.problem).control)
    found = cold_figures(case, run, 23.0)
    work_j = run.flows["engine_torque_nm"] * run.flows["engine_speed_radps"]
    coolant_c, burnt_kg = warmed(car.engine, run.fuel_kg, work_j, case.problem.table.step_s, 23.0)
    assert found.added_percent > 5.0 and found.warm_after_s is None
    assert found.coolant_end_c == coolant_c[-1] > 23.0
    ratio = found.cold_l_per_100km / found.warm_l_per_100km
    assert ratio == pytest.approx(1 + found.added_percent / 100)
    litres = found.cold_l_per_100km * cycle.distance_m / 1e5
    assert litres * car.engine.fuel_density_kgpm3 / 1e3 == pytest.approx(burnt_kg.sum())


def test_it_stands_beside_the_rows_and_changes_none(hevopt):
    Path("short.csv").write_text("time_s,speed_kmh\n0,0\n5,0\n20,50\n90,50\n110,0\n")
    words = ("compare", "--cycle", "short.csv", "--architectures", "A", "--strategies", "baseline")
    warm = json.loads(hevopt(*words, "--json")[1])
    cold = json.loads(hevopt(*words, "--json", "--cold-start", "20")[1])
    for row in (*warm["rows"], *cold["rows"]):
        row.pop("solve_s")
    assert cold["rows"] == warm["rows"] and "cold_start" not in warm
    (figures,) = cold["cold_start"]["rows"]
    assert (
        figures["architecture"] == "A" and 8 < figures["added_percent"] < 10
    )  # no more than the factor at 20 °C
    assert figures["warm_l_per_100km"] == warm["rows"][0]["fuel_l_per_100km"]
    status, out, _ = hevopt(*words, "--cold-start", "20")
    assert status == 0 and "started cold at 20 °C: a correction after the solution" in out
    status, _, err = hevopt(*words, "--cold-start", "-30")
    assert status == 2 and "allowed: 10 to 95" in err


def test_a_car_without_an_engine_that_warms_has_no_row(hevopt):
    Path("short.csv").write_text("time_s,speed_kmh\n0,0\n5,0\n20,50\n90,50\n110,0\n")
    words = ("run", "electric_compact", "--strategy", "ecms", "--cycle", "short.csv")
    status, out, _ = hevopt(*words, "--cold-start", "20")
    assert status == 0 and "no row has an engine that warms up" in out
