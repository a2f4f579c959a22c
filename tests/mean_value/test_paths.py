"""How engine and machines reach the wheels, by hand from the cars' files."""

import pytest

from hevopt import DataError, load_architecture
from hevopt.mean_value.paths import paths, strongest

RATIOS = {3: 1.402, 4: 1.026, 6: 0.676}
FINAL, ETA, ROTOR = 3.40, 0.95, 0.074


@pytest.mark.parametrize("gear", RATIOS)
@pytest.mark.parametrize(
    ("name", "ratio", "efficiency"),
    [("C1", None, ETA), ("C2", None, ETA), ("D", 5.0 * FINAL, 0.97), ("E", 0, ETA)],
)
def test_each_hybrid_reaches_the_wheels_by_its_own_way(name, ratio, efficiency, gear):
    car = load_architecture(name)
    found = paths(car, gear, 40 / 3.6)
    engine = RATIOS[gear] * FINAL
    # On the even shaft: the engine's gear where that is even, else the one that pulls most, second.
    own = {None: engine, 0: engine if gear % 2 == 0 else 2.219 * FINAL}.get(ratio, ratio)
    assert found.engine == pytest.approx((engine, ETA))
    assert found.machines[0] == pytest.approx((own, efficiency))
    inertia = car.machines[0].inertia_kgm2
    on_crank = name == "C1"
    assert found.crank_kgm2 == pytest.approx(inertia if on_crank else 0.0)
    assert found.wheel_kgm2 == pytest.approx(0.0 if on_crank else inertia * own**2)
    assert strongest(car, found, 40 / 3.6) == 0


def test_a_gear_that_is_none_is_one_message():
    with pytest.raises(
        DataError, match=r"A\.toml: gear 7 of a tip-in; this car has gears 1 to 6; choose"
    ):
        paths(load_architecture("A"), 7, 10.0)
