"""Sensitivities: each value is the car solved afresh, and the effects are what physics and arithmetic say."""

import json
from functools import cache
from math import log
from pathlib import Path

import pytest
from command_line import call

from hevopt import InfeasibleError, SolverError, load_architecture, load_cycle
from hevopt.pages.comparison.saved import load_results
from hevopt.studies.case import prepare
from hevopt.studies.sensitivity import effects_on, sensitivities, unsolved
from hevopt.studies.solved import run_case
from hevopt.studies.trials import trials_of


@cache
def of_b():
    return {(e.strategy, e.parameter): e for e in sensitivities("B", "nedc")}


def test_a_value_is_the_changed_car_solved_afresh():
    effect = of_b()["dp", "vehicle mass"]
    assert effect.values == pytest.approx([1170, 1300, 1430])
    car = load_architecture("B", {"car.mass_kg": effect.values[2]})
    row, _, _ = run_case(prepare(car, load_cycle("nedc")), "dp")
    assert effect.fuel_l_per_100km[2] == row.fuel_corrected_l_per_100km
    assert effect.nox_mg_per_km[2] == row.nox_mg_per_km


def test_dearer_starts_add_their_fuel_and_nothing_else():
    effect = of_b()["start_stop", "fuel of a start"]
    row, _, _ = run_case(prepare(load_architecture("B"), load_cycle("nedc")), "start_stop")
    added_l = row.engine_starts * 0.02e-3 / 0.835 / load_cycle("nedc").distance_m * 1e5
    assert effect.fuel_l_per_100km[2] - effect.fuel_l_per_100km[1] == pytest.approx(added_l)
    fuel_l = effect.fuel_l_per_100km[1]
    expected = log((fuel_l + added_l) / (fuel_l - added_l)) / log(0.22 / 0.18)
    assert effect.elasticity == pytest.approx(expected)


@pytest.mark.parametrize("strategy", ["dp", "start_stop"])
def test_more_to_move_and_more_to_lose_burns_more(strategy):
    more = ("vehicle mass", "rolling resistance", "drag area", "auxiliaries", "engine inertia")
    for parameter in more:
        effect = of_b()[strategy, parameter]
        assert effect.delta_percent[0] < 0 == effect.delta_percent[1] < effect.delta_percent[2]
        assert 0 < effect.elasticity < 1
    for parameter in ("driveline efficiency", "machine efficiency", "coulombic efficiency"):
        effect = of_b()[strategy, parameter]
        assert effect.delta_percent[0] > 0 > effect.delta_percent[2] and effect.elasticity < 0


def test_the_nox_map_moves_nox_alone():
    effect = of_b()["dp", "NOx map, high over low load"]
    assert effect.delta_percent == [0, 0] and effect.delta_nox_percent[1] < -5
    assert effect.values == pytest.approx([3.938 / 1.216, 8.0])


def test_a_car_has_the_parameters_of_its_own_files():
    """B has one battery cell and no machine loss coefficients; its battery's resistance is 0."""
    names = {parameter for _, parameter in of_b()}
    assert "machine efficiency" in names
    assert not names & {"machine loss", "battery cells in series", "battery resistance"}


def test_all_machines_of_a_car_are_changed_together():
    trials = {t.parameter.name: t for t in trials_of(load_architecture("p0_p4_diesel").contents)}
    low, own, high = trials["spin efficiency"].changes
    assert (
        set(low) == {"machine.spin_efficiency", "machine_2.spin_efficiency"} == set(high)
        and not own
    )
    belt, rear = (low[f"{name}.spin_efficiency"] for name in ("machine", "machine_2"))
    assert belt == pytest.approx(0.64 - 0.05) and rear == pytest.approx(0.85 * belt / 0.64)
    prius = {t.parameter.name: t for t in trials_of(load_architecture("prius_1998").contents)}
    less, given, _ = prius["machine loss"].changes
    assert set(less) == {"machine.loss_map.loss_w", "machine_2.loss_map.loss_w"} and not given


def test_what_is_changed_from_the_start_is_the_car_that_is_compared_with():
    base = {"car.mass_kg": 1500, "engine": "engine_diesel_1600_steep_nox"}
    effects = {e.parameter: e for e in sensitivities("A", "nedc", changes=base)}
    assert effects["vehicle mass"].values == pytest.approx([1350, 1500, 1650])
    assert "NOx map, high over low load" not in effects  # it has the other one already


def test_a_value_that_cannot_be_driven_has_no_figures_but_a_reason_and_the_others_keep_theirs():
    effects = {e.parameter: e for e in sensitivities("A", "nedc", changes={"car.mass_kg": 3400})}
    mass = effects.pop("vehicle mass")
    assert mass.values[-1] == pytest.approx(3740)
    for figures in (mass.fuel_l_per_100km, mass.delta_percent, mass.nox_mg_per_km):
        assert figures[-1] is None and None not in figures[:2]
    assert mass.elasticity is None and mass.reasons[:2] == [None, None]
    assert unsolved([mass, mass]) == [f"A, vehicle mass 3740: {mass.reasons[-1]}"]
    assert "cannot follow the cycle at" in mass.reasons[-1]
    assert unsolved([e for e in effects.values() if e.unit == "W"]) == []


def test_a_car_that_cannot_be_solved_as_given_is_named():
    with pytest.raises(InfeasibleError, match=r"^A, as given: "):
        sensitivities("A", "nedc", changes={"car.mass_kg": 9000})


def test_where_nothing_is_burnt_there_is_no_change(hevopt):
    Path("drv.csv").write_text("time_s,speed_kmh\n0,0\n3,20\n6,20\n9,0\n")
    words = "sensitivity C2 --strategies dp --cycle drv.csv --soc-start 0.75 --soc-end 0.5".split()
    status, out, err = hevopt(*words)
    assert status == 0, err
    assert "- / - / -" in out and "burns or emits nothing" in out
    for effect in json.loads(hevopt(*words, "--json").out)["sensitivity"]:
        assert effect["elasticity"] is None and set(effect["delta_percent"]) == {None}


def test_a_comparison_is_shown_and_written_whatever_a_value_does(hevopt):
    """3740 kg cannot be driven."""
    words = "compare --architectures A --mass 3400 --sensitivity"
    status, out, err = hevopt(*words.split(), "--report", "page.html", "--save", "saved.gz")
    assert status == 0 and "A" in out, err
    mass = next(e for e in load_results(Path("saved.gz")).sensitivity if "mass" in e.parameter)
    assert mass.delta_percent[-1] is None and mass.delta_percent[0] < 0
    assert "A, vehicle mass 3740: " in Path("page.html").read_text()


def test_studies_of_a_refined_comparison_are_refined(hevopt, quick):
    words = "compare --architectures B --strategies dp --refine --sensitivity --fronts --save s.gz"
    status, _, err = hevopt(*words.split())
    assert status == 0, err
    results = load_results(Path("s.gz"))
    row = results.rows[0].figures
    # Plans of the same table, each within 5e-5 of its optimum; on the table that is not refined fuel is 2e-4 more.
    front = results.pareto[0].points[0].fuel_l_per_100km
    assert front == pytest.approx(row.fuel_l_per_100km, rel=5e-5)
    for effect in results.sensitivity:
        if effect.strategy == "dp":
            assert row.fuel_corrected_l_per_100km in effect.fuel_l_per_100km
    given = hevopt("sensitivity", "B", "--strategies", "dp", "--refine", "--json").out
    assert json.loads(given)["sensitivity"] == [
        effect.model_dump() for effect in results.sensitivity if effect.strategy == "dp"
    ]


def test_what_a_car_lacks_costs_the_comparison_nothing(hevopt, monkeypatch):
    def failing(car, *others):
        if car.name == "B":
            raise InfeasibleError("B fails")
        return effects_on(car, *others)

    def no_front(*_, **__):
        raise SolverError("no front")

    monkeypatch.setattr("hevopt.pages.comparison.compared.effects_on", failing)
    monkeypatch.setattr("hevopt.studies.fronts.front", no_front)
    words = ("--sensitivity", "--fronts", "--save", "saved.gz", "--out", "rows.csv")
    status, out, err = hevopt("compare", "--architectures", "A,B", "--strategies", "dp", *words)
    assert status == 3 and "B sensitivity: B fails" in err and "A front: no front" in err
    assert "results written to saved.gz" in out and Path("rows.csv").is_file()
    results = load_results(Path("saved.gz"))
    assert {effect.architecture for effect in results.sensitivity} == {"A"}
    assert results.pareto == [] and results.failures["B sensitivity"] == "B fails"
    status, out, _ = hevopt(
        "compare", "--architectures", "A,B", "--strategies", "dp", *words, "--json"
    )
    assert status == 3 and len(json.loads(out)["rows"]) == 2


def test_the_command_shows_what_the_json_holds(monkeypatch, capsys):
    status, out, _ = call(monkeypatch, capsys, "sensitivity", "A", "--json")
    assert status == 0
    found = json.loads(out)["sensitivity"]
    assert {e["strategy"] for e in found} == {"baseline"}
    status, out, _ = call(monkeypatch, capsys, "sensitivity", "A")
    assert status == 0
    for effect in found:
        line = next(line for line in out.splitlines() if effect["parameter"] in line)
        assert f"{effect['values'][-1]:.4g}" in line
        if effect["elasticity"]:
            assert f"{effect['delta_percent'][0]:+.2f}" in line
            assert f"{effect['elasticity']:+.3f}" in line


def test_a_saved_comparison_holds_fronts_and_sensitivities_where_asked(
    monkeypatch, capsys, tmp_path
):
    path = tmp_path / "results.gz"
    words = ("compare", "--architectures", "A", "--save", str(path), "--fronts", "--sensitivity")
    status, _, err = call(monkeypatch, capsys, *words)
    assert status == 0, err
    results = load_results(path)
    assert [front.architecture for front in results.pareto] == ["A"]
    own = {effect.parameter: effect.as_dict() for effect in sensitivities("A", "nedc")}
    assert {effect.parameter: effect.model_dump() for effect in results.sensitivity} == own
    status, _, err = call(monkeypatch, capsys, "compare", "--architectures", "A", "--fronts")
    assert status == 2 and "--report or --save" in err
