"""The shipped example of a sizing: its best meets what is asked, moves with it, and is that of a full lattice."""

from itertools import product
from pathlib import Path

import pytest

from hevopt import load_architecture
from hevopt.driving.cycle import load_cycle
from hevopt.forward.performance import performance
from hevopt.powertrain.powertrain import build_problem
from hevopt.sizing.proof.space import DRIVE
from hevopt.studies.case import dp_case

EXAMPLE = (Path(__file__).parents[2] / "examples" / "size_c2.toml").read_text()
LEVELS = {
    "engine.scale.displacement": (0.7, 1.2),
    "machine.scale.power": (0.5, 2.0),
    "battery.cells_in_series": (40, 80),
    DRIVE: (2.8, 4.0),
}


def lattice(at_most: float) -> str:
    """The example with two values of each parameter, and a time to 100 km/h."""
    head = EXAMPLE.partition("[parameters]")[0].replace("at_most = 11.0", f"at_most = {at_most}")
    values = "".join(f"{key} = {list(levels)}\n" for key, levels in LEVELS.items())
    return f"{head}[parameters]\n{values}"


@pytest.mark.long
def test_the_best_of_a_full_lattice_of_the_example_is_that_of_every_design_by_hand_and_moves(sized):
    cycle, alone = load_cycle("nedc"), {}
    for point in product(*LEVELS.values()):
        car = load_architecture("C2", dict(zip(LEVELS, point, strict=True)))
        driven, plain = performance(car, boosts=True), performance(car)
        fuel_kg = dp_case(car, cycle, build_problem(car, cycle)).dp_trajectory.cost_kg
        alone[point] = driven.to_speed_s[100], plain.start_slope, fuel_kg
    bests = []
    for at_most in (11.0, 9.0):
        found = sized(lattice(at_most), f"s{at_most}", head="")
        allowed = {
            point: fuel_kg
            for point, (time_s, slope, fuel_kg) in alone.items()
            if time_s is not None and time_s <= at_most and slope >= 0.30
        }
        assert found.lattice and 0 < len(allowed) < len(alone)
        bests.append(tuple(found.best.design.values[key] for key in LEVELS))
        assert bests[-1] == min(allowed, key=allowed.get)
        assert all(one.excess <= 0 for one in found.best.required)
    assert bests[0] != bests[1]


@pytest.mark.long
def test_the_best_of_the_example_meets_what_is_asked_and_its_ranges_are_proven(sized):
    found = sized(EXAMPLE, head="", proven=True)
    assert all(one.excess <= 0 for one in found.best.required) and len(found.best.required) == 2
    assert found.proofs and set(found.proofs[0].ranges) == set(LEVELS)
    assert found.proven <= found.best.values[0] < 1.02 * found.proven
    time_s = found.best.required[0].reached
    harder = sized(EXAMPLE.replace("at_most = 11.0", f"at_most = {0.9 * time_s:.3f}"), "h", head="")
    assert harder.best.design.values != found.best.design.values
    assert harder.best.values[0] >= found.least
