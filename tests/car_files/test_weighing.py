"""What sizes weigh and cost: nothing moves as shipped, bigger is never free, by hand; batteries of other sizes."""

import numpy as np
import pytest

from hevopt import load_architecture
from hevopt.car_files.kinds import MACHINES
from hevopt.errors import DataError
from hevopt.problem.battery import energy_j


@pytest.mark.parametrize("name", ["A", "B", "C1", "C2", "D", "E", "prius_1998", "light_truck_p2"])
def test_a_shipped_car_weighs_what_its_files_say_and_every_part_has_a_mass(name):
    car = load_architecture(name)
    given = car.contents["car"]["mass_kg"] + car.contents.get("hybrid_mass_kg", 0.0)
    assert car.vehicle.mass_kg == given and car.added_kg == 0.0
    parts = [key for key in ("engine", *MACHINES, "battery") if key in car.contents]
    assert list(car.weighed) and set(car.weighed) == set(parts)
    assert all(part.mass_kg > 0 for part in car.weighed.values())
    assert car.price is None


@pytest.mark.parametrize(
    ("changes", "added_kg"),
    [
        ({"machine.scale.power": 2.0}, 18 * 0.94),
        ({"machine.power_max_w": 9e3}, -9 * 0.94),
        ({"engine.scale.torque": 1.5}, 0.5 * 1.598 * 125),
        ({"engine": "engine_diesel_1300"}, 1.248 * 137 - 1.598 * 125),
        ({"battery.cells_in_series": 640}, 9 * 64 * 7 * 3.585e-3 * 25),
        ({"battery.parallel": 2}, 64 * 7 * 3.585e-3 * 25),
        ({"battery.scale.capacity": 10}, 9 * 64 * 7 * 3.585e-3 * 25),
        ({"battery.scale.capacity": 1.0, "machine.scale.power": 1.0, "car.mass_kg": 1300}, 0.0),
        ({"battery.cells_in_series": 640, "hybrid_mass_kg": 70.0}, 0.0),
        ({"machine.scale.power": 2.0, "machine.mass_kgpkw": 0.5}, 36 * 0.5 - 18 * 0.94),
    ],
)
def test_another_size_weighs_its_difference_in_car_and_rolling_resistance(changes, added_kg):
    car, plain = load_architecture("C2", changes), load_architecture("C2")
    assert car.added_kg == pytest.approx(added_kg, rel=1e-12, abs=1e-12)
    assert car.vehicle.mass_kg == pytest.approx(1370 + added_kg, rel=1e-12)
    share = car.vehicle.rolling_n[0] / plain.vehicle.rolling_n[0]
    assert share == pytest.approx(car.vehicle.mass_kg / 1370, rel=1e-12)


def test_prices_add_up_over_the_parts_that_have_one():
    prices = {"machine.price_pkw": 20.0, "battery.price_pkwh": 800.0}
    car = load_architecture("C2", prices)
    assert car.price == pytest.approx(18 * 20 + 64 * 7 * 3.585e-3 * 800)
    assert load_architecture("C2", prices | {"engine.price_pl": 1000}).price == pytest.approx(
        car.price + 1598
    )


def test_parallel_cells_and_larger_ones_are_the_same_battery_and_as_good_as_more_in_series():
    plain = load_architecture("C2").battery
    two, large, long = (
        load_architecture("C2", {key: value}).battery
        for key, value in (
            ("battery.parallel", 2), ("battery.scale.capacity", 2.0), ("battery.cells_in_series", 128)
        )
    )  # fmt: skip
    for name in ("open_circuit_v", "discharge_ohm", "capacity_as", "power_max_charge_w"):
        assert np.array_equal(getattr(two, name), getattr(large, name))
    assert two.capacity_as == 2 * plain.capacity_as
    assert np.array_equal(two.charge_ohm, plain.charge_ohm / 2)
    soc = np.array([0.4, 0.8])
    assert energy_j(two, soc) == pytest.approx(energy_j(long, soc), rel=1e-14)
    loss = [b.discharge_ohm[0] / b.open_circuit_v[0] ** 2 for b in (two, long)]
    assert loss[0] == pytest.approx(loss[1], rel=1e-14)
    assert two.power_max_discharge_w == long.power_max_discharge_w


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"battery.parallel": 1.5}, "parallel = 1.5"),
        ({"battery.scale.capacity": 0.0}, "scale.capacity = 0.0; allowed: 0.05 to 20"),
        ({"machine.mass_kgpkw": -1}, "mass_kgpkw = -1; allowed: 0 to"),
        ({"engine.scale.torque": 0.05, "car.mass_kg": 50, "engine.mass_kgpl": 125}, "allowed: 50 kg or more"),
    ],
)  # fmt: skip
def test_a_wrong_size_is_one_message(changes, words):
    with pytest.raises(DataError) as found:
        load_architecture("C2", changes)
    assert words in str(found.value) and "\n" not in str(found.value)
