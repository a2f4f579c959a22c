"""The lattice around the best design, where no range is proven: its levels, that it is judged, and its words."""

from itertools import product

import pytest

from hevopt import load_architecture
from hevopt.driving.cycle import load_cycle
from hevopt.output.sizing_tables import as_dict, notes
from hevopt.powertrain.powertrain import build_problem
from hevopt.sizing.around import beside
from hevopt.sizing.candidates import Fate
from hevopt.studies.case import dp_case
from hevopt.sweeps.plan.parameters import Range

SERIES = 'architecture = "D"\ncycles = ["short.csv"]\n'
STUDY = (
    "trials = 4\n[parameters]\nmachine.scale.power = { from = 0.5, to = 2.0 }\n"
    "battery.cells_in_series = [40, 64]\n"
)


@pytest.mark.parametrize(
    ("allowed", "value", "found"),
    [
        (Range(0.5, 2.5, None, False), 1.0, (0.9, 1.0, 1.1)),
        (Range(0.5, 2.5, None, False), 2.45, (2.35, 2.45, 2.5)),
        (Range(1.0, 100.0, None, True), 10.0, (7.9433, 10.0, 12.589)),
        (Range(40, 50, None, False), 44, (43, 44, 45)),
        (Range(40, 140, None, False), 40, (40, 45)),
        ((3.0, 1.0, 2.0), 2.0, (1.0, 2.0, 3.0)),
        ((1, 2), 1, (1, 2)),
        (("a", "b", "c"), "c", ("a", "b", "c")),
    ],
)
def test_a_value_and_those_beside_it(allowed, value, found):
    assert beside(allowed, value) == found


def test_where_no_range_is_proven_the_lattice_around_the_best_is_judged_whole(sized, tmp_path):
    found = sized(STUDY, head=SERIES, proven=True)
    around, best = found.around, found.best
    assert not found.proofs and "its driveline is gearbox_output" in found.unproven
    points = {
        tuple(sorted(zip(around.values, point, strict=True)))
        for point in product(*around.values.values())
    }
    judged = {tuple(sorted(one.design.values.items())): one for one in found.found}
    assert len(points) == around.designs >= 4 and points <= judged.keys()
    assert tuple(sorted(best.design.values.items())) in points and not around.held
    lattice = [judged[point] for point in points]
    assert all(one.fate in (Fate.SOLVED, Fate.DISCARDED) for one in lattice)
    assert around.least == min(one.bounds[0] for one in lattice) <= best.values[0]
    cycle = load_cycle(tmp_path / "short.csv")
    for one in lattice[::3]:
        car = load_architecture("D", one.design.values)
        alone = dp_case(car, cycle, build_problem(car, cycle)).dp_trajectory.cost_kg
        litres = alone / car.engine.fuel_density_kgpm3 / cycle.distance_m * 1e8
        assert litres >= around.least and litres >= best.values[0] * (1 - 1e-9)
    assert "not the ranges between" in notes(found) and "gearbox_output" in notes(found)
    assert as_dict(found)["lattice_around_the_best"]["least_bound"] == around.least


def test_parameters_beyond_its_room_are_held_and_said(sized, monkeypatch):
    monkeypatch.setattr("hevopt.sizing.around._DESIGNS", 3)
    found = sized(STUDY.replace("trials = 4", "trials = 3"), head=SERIES, proven=True)
    held = found.around.held
    assert list(held) == ["battery.cells_in_series"] and found.around.designs <= 3
    assert f"held: battery.cells_in_series = {held['battery.cells_in_series']}" in notes(found)
