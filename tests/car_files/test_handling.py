"""The tables of a car's file that only a driven car shows."""

import pytest

from hevopt import DataError, load_architecture
from hevopt.car.handling import Clutch, DriverGains, Handling, Shifting, Tyre, check_ranges
from hevopt.car_files.handling import ClutchFile, DriverFile, ShiftingFile, TyreFile
from hevopt.car_files.handling_meanings import HANDLING_MEANINGS
from hevopt.forward.run import shifting_of


def test_a_file_without_them_has_the_defaults_and_its_gearboxs_gap():
    car = load_architecture("C2")
    assert car.handling == Handling() and car.handling.shifting is None
    assert shifting_of(car).gap_s == car.gearbox.shift_gap_s > 0
    assert shifting_of(load_architecture("E")).gap_s == 0


def test_what_they_give_is_what_the_car_is_driven_with():
    given = {
        "tyre.friction": 1.0, "tyre.lag_s": 0.0, "clutch.slipping_nm": 300.0,
        "driver.proportional": 2.0, "shifting.ratio_lag_s": 0.2,
    }  # fmt: skip
    car = load_architecture("C2", given)
    assert car.handling.tyre == Handling().tyre._replace(friction=1.0, lag_s=0.0)
    assert car.handling.clutch.slipping_nm == 300 and car.handling.clutch.sticking_nm == 380
    assert car.handling.driver == Handling().driver._replace(proportional=2.0)
    shifting = shifting_of(car)
    assert shifting.ratio_lag_s == 0.2 and shifting.gap_s == car.gearbox.shift_gap_s
    assert shifting_of(load_architecture("C2", {"shifting.gap_s": 0.1})).gap_s == 0.1


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("tyre.friction", 20.0, "friction"),
        ("tyre.grip", 1.0, "grip"),
        ("clutch.closing_s", -1.0, "closing_s"),
        ("shifting.gap_s", "long", "gap_s"),
        ("driver.governor_s", 0.0, "governor_s"),
        ("driver.proportional", float("nan"), "proportional"),
    ],
)
def test_figures_that_no_car_has_are_refused(key, value, said):
    with pytest.raises(DataError, match=said):
        load_architecture("C2", {key: value})


@pytest.mark.parametrize(("model", "place"), [(TyreFile, 0), (ClutchFile, 1), (ShiftingFile, 2)])
def test_files_and_loops_allow_the_same(model, place):
    usual = Handling()[place] or shifting_of(load_architecture("C2"))
    for name, field in model.model_json_schema()["properties"].items():
        if name == "law":  # a name
            continue
        number = field["anyOf"][0]
        for edge in (number["minimum"], number["maximum"]):
            check_ranges(usual._replace(**{name: edge}))
        with pytest.raises(DataError):
            check_ranges(usual._replace(**{name: 1.01 * number["maximum"]}))


def test_every_key_is_one_of_the_loops():
    for model, part in zip((TyreFile, ClutchFile, DriverFile), (0, 1, 3), strict=True):
        assert set(model.model_fields) - {"law"} <= set(Handling()[part]._fields)


@pytest.mark.parametrize("part", [Tyre(), Clutch(), Shifting(), DriverGains()])
def test_what_the_schema_says_of_keys_left_out_is_what_holds(part):
    table = type(part).__name__.replace("Gains", "") + "File"
    for key, (_, meaning) in HANDLING_MEANINGS[table].items():
        if key != "gap_s":  # that of the gearbox's file
            said = meaning.removesuffix(" where left out").rsplit("; ", 1)[1]
            if key == "law":
                assert (said == "pacejka") == part.slips
            else:
                assert float(said) == getattr(part, key), key
