"""Drivelines as the plant reads them, against the backward balance of the same parts."""

from dataclasses import replace

import numpy as np
import pytest

from hevopt import DataError, load_architecture
from hevopt.car.parts import ShaftBrake
from hevopt.forward.lines import line_of


@pytest.fixture(scope="module", params=["A", "B", "C1", "C2", "D", "E"])
def car(request):
    return load_architecture(request.param)


def test_every_unit_turns_with_wheels_or_engine_as_the_couplings_say(car):
    line, gearbox = line_of(car), car.gearbox
    for n, (gear, chosen, opened) in enumerate(line.keys):
        wheel, side = line.ways.wheel[n], line.ways.side[n]
        assert (wheel[0], side[0]) == (0, 1)
        assert wheel[-1] == pytest.approx(gearbox.ratios[gear]) and side[-1] == 0
        expected = {
            "A": (0, 1), "B": (0, 1), "C1": (0, 1), "C2": (gearbox.ratios[gear], 0),
            "D": (0 if opened else 5 * gearbox.ratios[0], 0),
            "E": (gearbox.ratios[chosen[0][1]] if chosen else None, 0),
        }[car.name]  # fmt: skip
        assert (wheel[1], side[1]) == pytest.approx(expected)


def test_what_leaves_the_joints_is_what_enters_less_their_losses(car):
    """Yields at the wheels, of every unit and direction: the product of efficiencies on the way, or of 1 / each."""
    line = line_of(car)
    ways = line.ways
    for n in range(len(line.keys)):
        for variant in range(ways.load.shape[1]):
            for u in range(len(ways.inertia_kgm2)):
                passed = 1.0
                for j in range(len(line.losses)):
                    if ways.load[n, variant, j, u]:
                        eta = ways.efficiency[n, j]
                        passed *= 1 / eta if variant >> j & 1 else eta
                assert ways.wheel_yield[n, variant, u] == pytest.approx(passed)


def test_the_gears_of_a_dual_clutch_exclude_each_other_and_the_nearest_is_taken():
    line = line_of(load_architecture("E"))
    for gear, ((_, machine),), _ in line.keys:
        assert gear % 2 == 1 or gear == machine
    even = (("even gears", 2),)
    assert line.keys[line.index(4, even)][0] == 3  # 4 is on the machine's own shaft, in 2
    assert line.keys[line.index(2, even)][0] == 2


def test_a_car_without_an_engine_has_one_way_and_a_side_at_rest():
    car = load_architecture("electric_compact")
    line = line_of(car)
    assert line.keys == ((1, (), frozenset()),) and line.gears.tolist() == [1]
    assert line.ways.wheel.tolist() == [[0, 3.93, 0]] and line.ways.side.tolist() == [[1, 0, 0]]
    assert line.ways.wheel_yield[0, :, 1] == pytest.approx([0.97, 1 / 0.97])
    assert line.ways.inertia_kgm2[0] == 0


def test_a_coupling_that_opens_at_high_speed_has_ways_without_its_machine():
    car = load_architecture("D")
    line = line_of(car)
    top = car.machines[0].speed_max_radps / (5 * car.gearbox.ratios[0])
    assert line.fast_radps[:6] == pytest.approx(np.full(6, top))
    assert (line.fast_way == np.concatenate([np.arange(6, 12)] * 2)).all()


def test_a_driveline_with_choices_of_its_own_is_refused_in_one_sentence():
    car = load_architecture("C2")
    parts = (*car.driveline.parts, ShaftBrake("park", "gearbox input"))
    with pytest.raises(
        DataError, match=r"C2: .* cannot be driven forward yet, as the strategy moves park"
    ):
        line_of(replace(car, driveline=replace(car.driveline, parts=parts)))
    free = replace(car.driveline, free_engine_speed=True)
    with pytest.raises(DataError, match="gearbox beside the engine's own speed"):
        line_of(replace(car, driveline=free))
